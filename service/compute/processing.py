"""Records to FRFs in the child process. This module imports no database."""

import json
import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fecore.signal import (
    Averages,
    Estimate,
    Findings,
    Hit,
    Processed,
    Processing,
    process,
    process_in_parts,
)
from service.compute.hits import BlockRow, describe_verdict, hits_of

_MOST_THREADS = 4


@dataclass(frozen=True)
class PointFile:
    """The blocks of one place and one set of sensors: what is said of each, and the file in which
    their samples stand one behind the other.
    """

    rows: tuple[BlockRow, ...]
    path: Path


@dataclass(frozen=True)
class ProcessingInputs:
    """Records by place, how to process them, and in words what was left out."""

    points: tuple[PointFile, ...]
    processing: Processing
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class ProcessingOutput:
    """FRFs, and the document about them."""

    processed: Processed
    document: dict[str, Any]


class _Source:
    """Hits of the files, read anew at each look."""

    def __init__(self, points: Sequence[PointFile]) -> None:
        self.points = points

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, number: int, /) -> list[Hit]:
        point = self.points[number]
        return hits_of(point.rows, _samples(point))


def _samples(point: PointFile) -> Iterator[np.ndarray[Any, Any]]:
    data = point.path.read_bytes()
    start = 0
    for row in point.rows:
        samples = np.frombuffer(data, row.dtype, row.samples, start)
        yield samples
        start += samples.nbytes


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


Report = Callable[[str, float], None]


def process_records(inputs: ProcessingInputs, report: Report) -> Iterator[Averages | str]:
    """The FRFs of a processing in parts, and in the end the document about them as JSON, which is
    several times as fast on its way to the worker as its many dictionaries are.

    Memory holds the hits of a few points and one part, however many points there are; and of each
    hit its verdict.
    """
    described: list[dict[str, Any]] = []
    ids = _ids(inputs.points)
    threads = min(_processors(), _MOST_THREADS)
    shelf = _DiskShelf(inputs.points)
    source = _Source(inputs.points)
    for item in process_in_parts(
        source, inputs.processing, _progress(report), shelf=shelf, threads=threads
    ):
        if isinstance(item, Findings):
            yield json.dumps(_document(item, described, inputs.left_out))
        else:
            described += _frfs(item, ids)
            yield item


def process_whole(inputs: ProcessingInputs, report: Report) -> ProcessingOutput:
    """The same with all FRFs in memory, for who works on with them."""
    averages = process(_Source(inputs.points), inputs.processing, _progress(report))
    document = _document(averages, _frfs(averages, _ids(inputs.points)), inputs.left_out)
    return ProcessingOutput(averages, document)


def _progress(report: Report) -> Callable[[float], None]:
    return lambda done: report("judging and averaging hits", done)


def _processors() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _ids(points: Sequence[PointFile]) -> dict[Any, dict[str, str]]:
    """Key and digest of each block, by place, hit, and whether it is the force or else its
    sensor.
    """
    return {
        (row.place, row.hit, row.quantity == "force" or (row.point, row.direction)): {
            "id": str(row.id),
            "sha256": row.sha256.hex(),
        }
        for point in points
        for row in point.rows
    }


def _frfs(averages: Averages, ids: dict[Any, dict[str, str]]) -> list[dict[str, Any]]:
    """What the document says of FRFs."""
    return [
        {
            "response_point": response.point,
            "response_direction": response.direction,
            "reference_point": force.point,
            "reference_direction": force.direction,
            "hits": list(used),
            "records": [
                ids[(force.point, force.direction), hit, channel]
                for hit in used
                for channel in (True, (response.point, response.direction))
            ],
        }
        for response, force, used in zip(
            averages.frfs.responses, averages.frfs.references, averages.used, strict=True
        )
    ]


def _document(
    findings: Findings, frfs: list[dict[str, Any]], left_out: Sequence[str]
) -> dict[str, Any]:
    windows = findings.processing.windows
    return {
        "processing": {
            "estimator": findings.processing.estimator,
            "windows": windows and asdict(windows),
            "band_hz": findings.processing.band_hz,
            "delay_s": findings.processing.delay_s,
            "false_discovery": findings.processing.false_discovery,
        },
        "force_coupling": findings.coupling and asdict(findings.coupling),
        "window_rate_per_s": findings.rate_per_s,
        "delay": findings.delay and asdict(findings.delay),
        "excited_hz": findings.excited_hz,
        "warnings": [*left_out, *findings.warnings],
        "hits": [describe_verdict(verdict) for verdict in findings.verdicts],
        "frfs": frfs,
    }
