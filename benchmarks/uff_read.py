"""Reading 1,000 FRFs of 3,201 lines from a UFF file, all checks included, against pyuff's own reading of the same file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyuff

from modalbase.formats.uff import Axis, Frf, Limits, read_file
from modalbase.formats.uff.write import write_file

FRFS, LINES, ROUNDS = 1000, 3201, 3
_IDS = ("FRF", "NONE", "NONE", "NONE", "NONE")


def frfs() -> Iterator[Frf]:
    """FRFs of noise."""
    rng = np.random.default_rng(7)
    axis = Axis(0.0, 0.5, LINES)
    for i in range(FRFS):
        values = rng.standard_normal(LINES) + 1j * rng.standard_normal(LINES)
        yield Frf(0, "FRF", _IDS, i + 1, 3, 1, 3, "accelerance", axis, values)


def best(work: Callable[[], int]) -> float:
    """Shortest of the rounds, seconds."""
    times = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        if work() != FRFS:
            raise RuntimeError("not every FRF was read")
        times.append(time.perf_counter() - began)
    return min(times)


def ours(path: Path, limits: Limits) -> int:
    """FRFs that our reader finds."""
    return sum(isinstance(item, Frf) for item in read_file(path, limits))


def main() -> None:
    """Print times and ratios for text and binary."""
    print(f"{FRFS} FRFs of {LINES} lines, complex double; best of {ROUNDS}, s (ratio to pyuff)")
    print(f"{'file':<8}{'MB':>6}{'pyuff':>8}{'default':>16}{'own columns alone':>20}{'pyuff twice over all':>24}")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "frfs.uff"
        for name, binary in (("text", False), ("binary", True)):
            write_file(path, frfs(), binary=binary)
            peer = best(lambda: sum(s["type"] == 58 for s in pyuff.UFF(str(path)).read_sets()))
            row = f"{name:<8}{path.stat().st_size / 1e6:>6.0f}{peer:>8.2f}"
            for width, limits in (
                (16, Limits()),
                (20, Limits(cross_check_bytes=0)),
                (24, Limits(cross_check_bytes=2**40)),
            ):
                mine = best(lambda limits=limits: ours(path, limits))  # type: ignore[misc]
                row += f"{f'{mine:.2f} ({mine / peer:.2f})':>{width}}"
            print(row)


if __name__ == "__main__":
    main()
