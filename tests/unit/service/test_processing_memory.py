"""A processing of records as the child process runs it: what memory it takes."""

import os
import tracemalloc
from pathlib import Path
from uuid import UUID

import numpy as np

from fecore.signal import Averages, Processing, Windows
from service.compute.hits import BlockRow
from service.compute.processing import PointFile, ProcessingInputs, process_records

SAMPLES, RATE_HZ = 65_536, 12_800.0
FRF_BYTES = 32 * SAMPLES / 2.56
"""Values, variance and coherence of one FRF."""


def _places(folder: Path, count: int) -> ProcessingInputs:
    """So many points of one hit each; on disk they all have the same samples."""
    folder.mkdir()
    rng = np.random.default_rng(1)
    t = np.arange(SAMPLES) / RATE_HZ - 0.05
    force = 80 * np.exp(-((t / 4e-4) ** 2)) + 0.05 * rng.standard_normal(SAMPLES)
    ring = np.where(t > 0, 80 * np.exp(-8 * t) * np.sin(1256 * t), 0.0) + 0.05 * rng.standard_normal(SAMPLES)
    first = folder / "0.blocks"
    first.write_bytes(np.array([force, ring], "<f4").tobytes())
    places = []
    for number in range(1, count + 1):
        path = folder / f"{number}.blocks"
        os.link(first, path)
        rows = tuple(
            BlockRow(
                id=UUID(int=2 * number + channel),
                sha256=bytes(32),
                quantity=quantity,
                point=point,
                direction=3,
                force_point=number,
                force_direction=3,
                hit=1,
                sample_rate_hz=RATE_HZ,
                samples=SAMPLES,
                window_rate_per_s=0.0,
                full_scale=None,
                dtype="<f4",
            )
            for channel, (quantity, point) in enumerate((("force", number), ("acceleration", 999)))
        )
        places.append(PointFile(rows, path))
    return ProcessingInputs(tuple(places), Processing(windows=Windows()))


def _peak_bytes(inputs: ProcessingInputs) -> int:
    """Of a processing whose parts are taken and let go, as `store` does."""
    tracemalloc.start()
    try:
        made = 0
        for item in process_records(inputs, lambda _stage, _share: None):
            made += len(item.hits) if isinstance(item, Averages) else 0
        assert made == len(inputs.points)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_frfs_that_a_processing_makes(tmp_path: Path) -> None:
    few, many = 15, 25
    _peak_bytes(_places(tmp_path / "first", 1))  # what it imports is no part of it
    grown = _peak_bytes(_places(tmp_path / "many", many)) - _peak_bytes(_places(tmp_path / "few", few))
    assert grown < 0.4 * (many - few) * FRF_BYTES  # all FRFs in memory, once, would be 1
    assert not list(tmp_path.rglob("*.frfs"))  # what lay on disk between the passes
