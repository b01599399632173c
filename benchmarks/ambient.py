"""Made recordings of responses beside pyOMA-2, in the same run.

pyOMA-2 needs libraries that we do not, so it has an environment of its own, which the first
argument names:

    python -m venv peer && peer/bin/pip install pyOMA-2
    python -m benchmarks ambient peer/bin/python
"""

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.output_only import RATE, STRONG, TOP, recording
from benchmarks.tables import Table, load
from fecore.arrays import FloatArray
from fecore.frf import along_z
from fecore.modal import identify_output_only
from fecore.signal import half_spectra

NEAR = 3.0  # half bandwidths of a mode within which a pole is it


def ambient(python: str = "none", sets: int = 10, first: int = 3000) -> list[str]:
    """Modes of made ten-minute recordings of eight sensors, ours and pyOMA-2's: found, false, errors
    of f and ζ, processor time.

    Args:
        python: the Python that has pyOMA-2; `none`: ours alone.
        sets: how many recordings.
        first: seed of the first.
    """
    found: dict[str, list[tuple[int, int, list[tuple[float, float]], float]]] = {}
    strong = 0
    for seed in range(first, first + sets):
        x, f, zeta, share, _ = recording(seed)
        wanted = (f < TOP) & (share > STRONG)
        strong += int(wanted.sum())
        for name, (modes, seconds) in (_ours(x) | _peers(python, x, f)).items():
            one = _judged(np.array(modes).reshape(-1, 2), f, zeta, wanted)
            found.setdefault(name, []).append((*one, seconds))
    print(f"{sets} recordings, {strong} modes with 1 % of the power, {load()}")
    columns = ("found:.0f", "false:.0f", "f, median error %:.3f", "ζ, median error %:.1f")
    table = Table("", "code:18", *columns, "processor s:.1f")
    for name, rows in found.items():
        errors = np.array([error for row in rows for error in row[2]]).reshape(-1, 2)
        middle = np.median(100 * np.abs(errors), axis=0) if len(errors) else [np.nan, np.nan]
        counts = (sum(row[0] for row in rows), sum(row[1] for row in rows))
        table.row(name, *counts, *middle, float(np.mean([row[3] for row in rows])))
    return [] if sum(row[0] for row in found["modalbase"]) > 0.9 * strong else ["modes are lost"]


def _ours(x: FloatArray) -> dict[str, Any]:
    begin = time.process_time()
    modes = identify_output_only(
        half_spectra(lambda: [x], RATE, along_z(range(1, 9)))
    ).identification.modes
    pairs = np.column_stack([modes.frequency_hz, modes.damping_ratio]).tolist()
    return {"modalbase": (pairs, time.process_time() - begin)}


def _peers(python: str, x: FloatArray, f: FloatArray) -> dict[str, Any]:
    if python == "none":
        return {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "recording.npz")
        np.savez(path, x=x, rate=RATE, f=f[f < TOP])
        script = Path(__file__).with_name("peer_pyoma.py")
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(
            [python, str(script), str(path)],
            capture_output=True,
            text=True,
            check=True,
            env=environment,
        )
    answer: dict[str, Any] = json.loads(done.stdout.rsplit("\n", 1)[-1])
    return answer


def _judged(
    modes: FloatArray, f: FloatArray, zeta: FloatArray, wanted: FloatArray
) -> tuple[int, int, list[tuple[float, float]]]:
    """How many of the wanted modes are found, how many poles are none, and relative errors."""
    seen: set[int] = set()
    false, errors = 0, []
    for hz, ratio in modes:
        off = np.abs(f - hz) / (f * zeta)
        nearest = int(np.argmin(off))
        if off[nearest] > NEAR or nearest in seen:
            false += 1
            continue
        seen.add(nearest)
        errors.append((float(hz / f[nearest] - 1), float(ratio / zeta[nearest] - 1)))
    return sum(bool(wanted[k]) for k in seen), false, errors
