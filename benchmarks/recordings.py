"""A long wav with many hits: how long it takes to find and cut them, and the memory that it takes.

recordings   MINUTES...: of 4 channels of 24 bits at 51.2 kHz, one hit in 4 s
"""

import resource
import tempfile
import wave
from pathlib import Path

import numpy as np

from benchmarks.clock import now
from service.compute.recordings import channels_of

RATE, CHANNELS, PAUSE_S = 51_200, 4, 4


def recordings(*minutes: int) -> None:
    """Print a line for each length."""
    mapped = [
        {"variable": f"channel_{k + 1}", "quantity": "acceleration" if k else "force", "point": k + 1}
        for k in range(CHANNELS)
    ]
    for length in minutes or (10, 30):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "long.wav"
            _write(path, length)
            begin = now()
            channels = channels_of(path, {"recording": {}, "channels": mapped}, path.name)
            found = channels.survey()
            blocks = sum(1 for _ in channels.blocks(found, channels.places(found.hits)))
            seconds, most = now() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            size = path.stat().st_size / 1e6
            print(f"{length} min, {size:.0f} MB: {len(found.hits)} hits, {blocks} blocks of {found.length}; ", end="")
            print(f"{seconds[0]:.1f} s ({seconds[1]:.1f} s of the processor), at most {most:.0f} MB")


def _write(path: Path, minutes: int) -> None:
    """The same four seconds again and again, under new noise: a pulse of 0.3 ms, and modes that ring for 1 to 2 s."""
    time = np.arange(PAUSE_S * RATE) / RATE - 1.0
    late = np.maximum(time, 0.0)
    rings = [0.3 * np.exp(-5 * late) * np.sin(2 * np.pi * f * late) for f in (30.0, 180.0, 510.0)]
    signal = np.column_stack([0.5 * np.exp(-((time / 1.5e-4) ** 2)), *rings])
    rng, parts = np.random.default_rng(5), minutes * 60 // PAUSE_S
    with wave.open(str(path), "wb") as file:
        file.setnchannels(CHANNELS)
        file.setsampwidth(3)
        file.setframerate(RATE)
        for _ in range(parts):
            noisy = signal + rng.normal(0, 1e-4, signal.shape)
            counts = np.round(noisy * (2**23 - 1)).astype("<i4")
            file.writeframesraw(counts.view(np.uint8).reshape(-1, 4)[:, :3].tobytes())
