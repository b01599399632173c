"""Records to FRFs in the child process. This module imports no database."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fecore.processing import Hit, Processed, Processing, process
from service.records.hits import BlockRow, describe_verdict, hits_of


@dataclass(frozen=True)
class PointFile:
    """The blocks of one place: what is said of each, and the file in which their samples stand one behind the other."""

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


def process_records(inputs: ProcessingInputs, report: Callable[[str, float], None]) -> Iterator[ProcessingOutput]:
    """The one output of a processing."""
    found = process(_Source(inputs.points), inputs.processing, lambda done: report("judging and averaging hits", done))
    found = replace(found, warnings=(*inputs.left_out, *found.warnings))
    yield ProcessingOutput(found, _document(found, inputs.points))


def _document(found: Processed, points: Sequence[PointFile]) -> dict[str, Any]:
    windows, delay = found.processing.windows, found.delay
    ids = {
        (row.place, row.hit, row.quantity == "force" or (row.point, row.direction)): {
            "id": str(row.id),
            "sha256": row.sha256.hex(),
        }
        for point in points
        for row in point.rows
    }
    return {
        "processing": {
            "estimator": found.processing.estimator,
            "windows": windows and {"force_length_s": windows.force_length_s, "rate_per_s": windows.rate_per_s},
            "band_hz": found.processing.band_hz,
            "delay_s": found.processing.delay_s,
        },
        "force_coupling": found.coupling
        and {"amplitude_per_s": found.coupling.amplitude_per_s, "rate_per_s": found.coupling.rate_per_s},
        "window_rate_per_s": found.rate_per_s,
        "delay": delay and {"seconds": delay.seconds, "sd": delay.sd, "peaks": delay.peaks},
        "excited_hz": found.excited_hz,
        "warnings": list(found.warnings),
        "hits": [describe_verdict(verdict) for verdict in found.verdicts],
        "frfs": [
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
            for response, force, used in zip(found.frfs.responses, found.frfs.references, found.used, strict=True)
        ],
    }
