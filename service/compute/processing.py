"""Records on disk to FRFs, whole; and the document about them. This module imports no database."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fecore.signal import (
    Averages,
    Findings,
    Hit,
    Processed,
    Processing,
    process,
)
from service.compute.hits import BlockRow, describe_verdict, hits_of


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


class HitsOfFiles:
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


Report = Callable[[str, float], None]


def process_whole(inputs: ProcessingInputs, report: Report) -> ProcessingOutput:
    """The FRFs of a processing, all in memory for who works on with them, and its document."""
    averages = process(HitsOfFiles(inputs.points), inputs.processing, judging(report))
    document = describe_processing(
        averages, describe_frfs(averages, ids_of(inputs.points)), inputs.left_out
    )
    return ProcessingOutput(averages, document)


def judging(report: Report) -> Callable[[float], None]:
    """What the core reports to: the share of hits that are judged."""
    return lambda done: report("judging and averaging hits", done)


def ids_of(points: Sequence[PointFile]) -> dict[Any, dict[str, str]]:
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


def describe_frfs(averages: Averages, ids: dict[Any, dict[str, str]]) -> list[dict[str, Any]]:
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


def describe_nothing() -> dict[str, Any]:
    """The document of a processing without hits."""
    none = ("processing", "force_coupling", "window_rate_per_s", "delay", "excited_hz")
    return {**dict.fromkeys(none), "warnings": [], "hits": [], "frfs": []}


def describe_processing(
    findings: Findings, frfs: list[dict[str, Any]], left_out: Sequence[str]
) -> dict[str, Any]:
    """The document about a processing.

    Args:
        findings: of the core.
        frfs: of `describe_frfs`.
        left_out: what was left out, in words.
    """
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
