"""Records to FRFs in the child process, in parts. This module imports no database."""

import json
import os
import pickle
from collections.abc import Iterator, Sequence
from typing import Any

from fecore.signal import Averages, Estimate, Findings, process_in_parts
from service.compute.processing import (
    HitsOfFiles,
    PointFile,
    ProcessingInputs,
    Report,
    describe_frfs,
    describe_processing,
    ids_of,
    judging,
)

_MOST_THREADS = 4


def process_records(inputs: ProcessingInputs, report: Report) -> Iterator[Averages | str]:
    """The FRFs of a processing in parts, and in the end the document about them as JSON, which is
    several times as fast on its way to the worker as its many dictionaries are.

    Memory holds the hits of a few points and one part, however many points there are; and of each
    hit its verdict.
    """
    described: list[dict[str, Any]] = []
    ids = ids_of(inputs.points)
    threads = min(_processors(), _MOST_THREADS)
    shelf = _DiskShelf(inputs.points)
    source = HitsOfFiles(inputs.points)
    for item in process_in_parts(
        source, inputs.processing, judging(report), shelf=shelf, threads=threads
    ):
        if isinstance(item, Findings):
            yield json.dumps(describe_processing(item, described, inputs.left_out))
        else:
            described += describe_frfs(item, ids)
            yield item


class _DiskShelf:
    """FRFs on disk, of each point beside its blocks; what is taken is gone."""

    def __init__(self, points: Sequence[PointFile]) -> None:
        self.paths = [point.path.with_suffix(".frfs") for point in points]

    def __setitem__(self, point: int, estimates: tuple[Estimate, ...], /) -> None:
        with self.paths[point].open("wb") as file:
            pickle.dump(estimates, file, pickle.HIGHEST_PROTOCOL)

    def __getitem__(self, point: int, /) -> tuple[Estimate, ...]:
        with self.paths[point].open("rb") as file:
            estimates: tuple[Estimate, ...] = pickle.load(file)
        self.paths[point].unlink()
        return estimates


def _processors() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
