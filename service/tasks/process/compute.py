"""Hits to FRFs and recordings of responses to half spectra in the child process, in parts. This
module imports no database.
"""

import json
import os
import pickle
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fecore.findings import texts
from fecore.signal import (
    Averages,
    Estimate,
    Findings,
    LoadFrfs,
    process_in_parts,
    with_steps_joined,
)
from service.compute.processing import (
    HitsOfFiles,
    PointFile,
    ProcessingInputs,
    Report,
    describe_frfs,
    describe_nothing,
    describe_processing,
    ids_of,
    judging,
)
from service.compute.responses import (
    EncodedSpectra,
    ResponseInputs,
    averages_of,
    encoded,
    spectra_of,
)

_MOST_THREADS = 4


@dataclass(frozen=True)
class Measured:
    """What a campaign has to process."""

    hits: ProcessingInputs | None
    responses: ResponseInputs | None


def process_campaign(inputs: Measured, report: Report) -> Iterator[Averages | EncodedSpectra | str]:
    """The FRFs of the hits and of measured loads and the half spectra of other recordings, in the end the document about
    them as JSON.
    """
    document = dict(describe_nothing())
    if inputs.hits is not None:
        for item in process_records(inputs.hits, report):
            if isinstance(item, str):
                document = json.loads(item)
            else:
                yield item
    if inputs.responses is not None:
        made, steps = list[dict[str, Any]](), list[tuple[LoadFrfs, str]]()
        for file, each in spectra_of(inputs.responses, report):
            kept = encoded(file, each)
            made.append({**kept.document, "sha256": kept.sha256.hex()})
            yield kept
            if isinstance(each, LoadFrfs) and each.window_rate_per_s:
                yield _described(each, document)
            elif isinstance(each, LoadFrfs):
                steps.append((each, file.filename))
        for each in with_steps_joined([frfs for frfs, _ in steps], [name for _, name in steps]):
            yield _described(each, document)
        document["spectra"] = made
    yield json.dumps(document)


def _described(frfs: LoadFrfs, document: dict[str, Any]) -> Averages:
    """FRFs of measured loads as those of hits, which the document then names."""
    averages = averages_of(frfs)
    document["frfs"] += describe_frfs(averages, {})
    document["warnings"] += texts(frfs.notes)
    return averages


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
