"""A long recording with many hits, as wav of 24 bits and as TDMS of float64 in one segment: how
long it takes to find and cut them, and the memory that it takes.
"""

import multiprocessing
import resource
import tempfile
import wave
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.clock import now
from fecore.arrays import FloatArray
from service.tasks.import_file.recordings import channels_of

RATE, CHANNELS, PAUSE_S = 51_200, 4, 4


def recordings(*minutes: int) -> None:
    """Recordings of 4 channels at 51.2 kHz, one hit in 4 s, as wav and as TDMS: seconds and memory
    to find and cut the hits.
    """
    for length in minutes or (10, 30):
        for suffix, write in ((".wav", _write), (".tdms", _write_tdms)):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / f"long{suffix}"
                # each in a process of its own, whose memory is its alone
                for target in (write, _look):
                    process = multiprocessing.get_context("spawn").Process(
                        target=target, args=(path, length)
                    )
                    process.start()
                    process.join()
                    assert process.exitcode == 0, f"{target.__name__} of {suffix} failed"


def _look(path: Path, minutes: int) -> None:
    names = [f"channel_{k + 1}" if path.suffix == ".wav" else f"daq/c{k}" for k in range(CHANNELS)]
    mapped = [
        {"variable": name, "quantity": "acceleration" if k else "force", "point": k + 1}
        for k, name in enumerate(names)
    ]
    begin = now()
    channels = channels_of(path, {"recording": {}, "channels": mapped}, path.name)
    found = channels.survey()
    blocks = sum(1 for _ in channels.blocks(found, channels.places(found.hits)))
    seconds, most = now() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    size = path.stat().st_size / 1e6
    print(
        f"{path.suffix}, {minutes} min, {size:.0f} MB: {len(found.hits)} hits, {blocks} blocks of"
        f" {found.length}; ",
        end="",
    )
    print(
        f"{seconds[0]:.1f} s ({seconds[1]:.1f} s of the processor), at most {most:.0f} MB",
        flush=True,
    )


def _write_tdms(path: Path, minutes: int) -> None:
    """The samples of `_write` of the whole recording at one stroke."""
    from nptdms import ChannelObject, TdmsWriter  # an optional extra

    noisy = np.concatenate(list(_parts(minutes)))
    with TdmsWriter(path) as file:
        said = {"wf_increment": 1 / RATE}
        file.write_segment(
            [ChannelObject("daq", f"c{k}", row, said) for k, row in enumerate(noisy.T)]
        )


def _parts(minutes: int) -> Iterator[FloatArray]:
    """The same four seconds again and again, under new noise: a pulse of 0.3 ms, and modes that
    ring for 1 to 2 s.
    """
    time = np.arange(PAUSE_S * RATE) / RATE - 1.0
    late = np.maximum(time, 0.0)
    rings = [0.3 * np.exp(-5 * late) * np.sin(2 * np.pi * f * late) for f in (30.0, 180.0, 510.0)]
    signal = np.column_stack([0.5 * np.exp(-((time / 1.5e-4) ** 2)), *rings])
    rng = np.random.default_rng(5)
    for _ in range(minutes * 60 // PAUSE_S):
        yield signal + rng.normal(0, 1e-4, signal.shape)


def _write(path: Path, minutes: int) -> None:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(CHANNELS)
        file.setsampwidth(3)
        file.setframerate(RATE)
        for noisy in _parts(minutes):
            counts = np.round(noisy * (2**23 - 1)).astype("<i4")
            file.writeframesraw(counts.view(np.uint8).reshape(-1, 4)[:, :3].tobytes())
