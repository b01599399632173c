"""What an update job computes, in the worker's child process: no database, no web."""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

import fecore
from fecore.body.specimen import Specimen
from fecore.modes import MeasuredModes
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from service.jobs.kinds import Report
from service.updating.arrays import as_npz
from service.updating.document import describe


@dataclass(frozen=True)
class UpdateInputs:
    """Everything that an update needs, and where it came from.

    Attributes:
        measurement, specimen, recipe: for the core.
        warnings: what was left out while loading.
        provenance: ids and digests of the inputs, and the recipe as sent.
    """

    measurement: Measurement
    specimen: Specimen
    recipe: Recipe
    warnings: tuple[str, ...]
    provenance: dict[str, Any]


@dataclass(frozen=True)
class UpdateOutput:
    """A result ready to be stored.

    Attributes:
        document: the contract's result.
        prediction: arrays as npz: predicted FRFs, shapes, samples.
        identified: modes that the job found itself, in the specimen's frame; None where it was given a mode set.
    """

    document: dict[str, Any]
    prediction: bytes
    identified: MeasuredModes | None


def compute_update(inputs: UpdateInputs, report: Report) -> Iterator[UpdateOutput]:
    """Run the core and describe its result."""
    stages = _Stopwatch(report)
    result = update(inputs.measurement, inputs.specimen, inputs.recipe, stages.progress, report)
    provenance = {
        **inputs.provenance,
        "software": {"modalbase": fecore.__version__, "numpy": np.__version__, "python": platform.python_version()},
        "host": platform.node(),
        "computed_at": datetime.now(UTC).isoformat(),
        "durations_s": stages.finish(),
    }
    document = describe(result, inputs.warnings, provenance)
    identified = None if result.identification is None else result.identification.modes
    yield UpdateOutput(document, as_npz(result), identified)


class _Stopwatch:
    """Passes progress on and notes how long each stage took."""

    def __init__(self, report: Report) -> None:
        self._report = report
        self._stage, self._since = "", time.perf_counter()
        self._durations: dict[str, float] = {}

    def progress(self, stage: str, share: float) -> None:
        if stage != self._stage:
            self._close()
            self._stage = stage
        self._report(stage, share)

    def finish(self) -> dict[str, float]:
        self._close()
        return self._durations

    def _close(self) -> None:
        now = time.perf_counter()
        if self._stage and self._stage != "done":
            self._durations[self._stage] = self._durations.get(self._stage, 0.0) + now - self._since
        self._since = now
