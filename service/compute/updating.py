"""What an update job and a joint update compute, in the worker's child process: no database, no
web.
"""

import platform
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

import fecore
from fecore.body.constants import Body
from fecore.body.matrices import MatrixBody
from fecore.body.specimen import OrientedSpecimen
from fecore.body.structure import Structure
from fecore.errors import InputError
from fecore.modes import MeasuredModes
from fecore.signal import Processed
from fecore.updating.campaigns import Campaign, CampaignsRecipe, CampaignsResult, update_campaigns
from fecore.updating.inputs import Inputs
from fecore.updating.layout import Coupon
from fecore.updating.measurement import Measurement, prepare
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from fecore.updating.result import UpdateResult
from fecore.updating.systematic_effects import fixed_points
from service.compute.frame import Frame
from service.compute.identifying import describe_identification
from service.compute.processing import ProcessingInputs, ProcessingOutput, process_whole
from service.compute.result_arrays import as_npz
from service.jobs.kinds import Reporter

JointBody = OrientedSpecimen | Structure | MatrixBody
"""What several campaigns may be of: specimens of one material, or one body in space."""

_OF_HITS = 0.05  # share of an update's progress that its hits take


@dataclass(frozen=True)
class Hits:
    """Time blocks that become the measurement on the way."""

    records: ProcessingInputs  # the hits, and how to process them
    # label to coordinates in the specimen's frame, m
    points: Mapping[int, tuple[float, float, float]]
    frame: Frame  # of the file in which the hits' directions are
    roving_mass: float  # of a sensor that moved with the response, kg
    inputs: Inputs  # how well the laboratory knows what else it hands in
    temperature_c: float | None = None  # in the test, °C; None where nobody stated it


@dataclass(frozen=True)
class UpdateInputs:
    """Everything that an update needs, and where it came from."""

    # measurement, specimen, recipe: for the core; the measurement is None where hits become it
    measurement: Measurement | None
    specimen: Body
    recipe: Recipe
    warnings: tuple[str, ...]  # what was left out while loading
    provenance: dict[str, Any]  # ids and digests of the inputs, and the recipe as sent
    hits: Hits | None = None  # time blocks of a campaign that has no FRFs yet, or None


@dataclass(frozen=True)
class UpdateOutput:
    """A result ready to be stored."""

    result: UpdateResult  # of the core, without what is in the arrays
    prediction: bytes  # arrays as npz: predicted FRFs, shapes, samples
    warnings: tuple[str, ...]  # what was left out while loading, and of the hits
    provenance: dict[str, Any]  # where all of it came from
    # modes that the job found itself, in the specimen's frame; None where it was given a mode set
    identified: MeasuredModes | None = None
    identification: dict[str, Any] | None = None  # how they were found, as JSON
    processing: ProcessingOutput | None = None  # what became of the hits, where there were hits


def compute_update(inputs: UpdateInputs, report: Reporter) -> Iterator[UpdateOutput]:
    """Run the core."""
    stages = _Stopwatch(report, 0.0 if inputs.hits is None else _OF_HITS)
    measurement, recipe, processing, warnings = (
        inputs.measurement,
        inputs.recipe,
        None,
        inputs.warnings,
    )
    if inputs.hits is not None:
        processing = process_whole(
            inputs.hits.records, lambda stage, share: report(stage, _OF_HITS * share)
        )
        measurement = _measured(inputs.hits, processing.processed)
        recipe, band = _within_force(recipe, processing.processed)
        warnings = (*warnings, *processing.document["warnings"], *band)
    assert measurement is not None, "a measurement is loaded, or made of hits"
    result = update(measurement, inputs.specimen, recipe, stages.progress, report)
    identification = result.identification
    yield UpdateOutput(
        result=replace(result, prediction=None, identification=None),
        prediction=as_npz(result),
        warnings=warnings,
        provenance={**inputs.provenance, **origin(), "durations_s": stages.finish()},
        identified=None if identification is None else identification.modes,
        identification=None if identification is None else describe_identification(identification),
        processing=processing,
    )


def _within_force(recipe: Recipe, processed: Processed) -> tuple[Recipe, tuple[str, ...]]:
    """The recipe with modes sought where the hammer has half of its force, unless it states a band;
    and a note of it.
    """
    if recipe.identification.band_hz is not None:
        return recipe, ()
    band = float(processed.frfs.frequency_hz[0]), processed.strong_hz
    note = (
        f"modes were sought up to {band[1]:.0f} Hz, where the hammer has half of its largest force;"
        " identification.band_hz states another band"
    )
    return replace(recipe, identification=replace(recipe.identification, band_hz=band)), (note,)


def _measured(hits: Hits, processed: Processed) -> Measurement:
    """The FRFs of the hits in the specimen's frame, with the window that they carry."""
    frfs, inputs = processed.frfs, hits.inputs
    moved = replace(
        frfs,
        responses=tuple(hits.frame.dof(dof) for dof in frfs.responses),
        references=tuple(hits.frame.dof(dof) for dof in frfs.references),
    )
    if inputs.window_rate is None:
        inputs = replace(
            inputs, window_rate=processed.rate_per_s, window_rate_sd=processed.rate_sd_per_s
        )
    axes, warm = hits.frame.point_axes(hits.points), hits.temperature_c
    return Measurement(moved, hits.points, None, hits.roving_mass, inputs, axes, temperature_c=warm)


@dataclass(frozen=True)
class JointCampaign:
    """One campaign as it was loaded."""

    # name, specimen: in the result
    name: str
    specimen: str
    body: JointBody  # with the material of all campaigns, in its own axes; or a body in space
    # measurement, recipe: for identification where there is no mode set
    measurement: Measurement
    recipe: Recipe
    provenance: dict[str, Any]  # ids of what it was made of
    warnings: tuple[str, ...]  # what was left out while loading


@dataclass(frozen=True)
class JointInputs:
    """Everything that a joint update needs, and where it came from."""

    campaigns: tuple[JointCampaign, ...]
    recipe: CampaignsRecipe
    coupons: tuple[Coupon, ...]
    warnings: tuple[str, ...]
    provenance: dict[str, Any]


@dataclass(frozen=True)
class JointOutput:
    """A result ready to be stored: of the core, with warnings of what was left out, and what each
    campaign was made of.
    """

    result: CampaignsResult
    warnings: tuple[str, ...]
    sources: tuple[dict[str, Any], ...]
    provenance: dict[str, Any]


def compute_joint(inputs: JointInputs, report: Reporter) -> Iterator[JointOutput]:
    """Find each campaign's modes and update all together."""
    campaigns, warnings = [], list(inputs.warnings)
    count = len(inputs.campaigns)
    for number, each in enumerate(inputs.campaigns):
        report(f"finding the modes of {each.name}", 0.5 * number / count)
        try:
            data = prepare(each.measurement, each.body, each.recipe)
        except InputError as error:
            raise InputError(
                f"jobs.{number}.{error.field}", f"{error.message} ({each.name})"
            ) from error
        assert data.modes is not None, "they are handed in or found, else `prepare` refuses"
        points = () if data.frfs is None else fixed_points(*data.frfs.points)
        fixed = () if each.body.masses else points
        campaigns.append(
            Campaign(
                name=each.name,
                specimen=each.specimen,
                body=each.body,
                modes=data.modes,
                points=each.measurement.points,
                inputs=each.measurement.inputs,
                fixed_points=fixed,
                axes=each.measurement.axes or {},
                temperature_c=each.measurement.temperature_c,
            )
        )
        warnings += [f"campaign {each.name}: {text}" for text in (*each.warnings, *data.warnings)]
    result = update_campaigns(
        campaigns,
        inputs.recipe,
        inputs.coupons,
        lambda stage, share: report(stage, 0.5 + 0.5 * share),
    )
    sources = tuple(each.provenance for each in inputs.campaigns)
    yield JointOutput(result, tuple(warnings), sources, {**inputs.provenance, **origin()})


class _Stopwatch:
    """Passes progress on and notes how long each stage took."""

    def __init__(self, report: Reporter, first: float) -> None:
        self._report, self._first = report, first
        self._stage, self._since = "", time.perf_counter()
        self._durations: dict[str, float] = {}

    def progress(self, stage: str, share: float) -> None:
        if stage != self._stage:
            self._close()
            self._stage = stage
        self._report(stage, self._first + (1 - self._first) * share)

    def finish(self) -> dict[str, float]:
        self._close()
        return self._durations

    def _close(self) -> None:
        now = time.perf_counter()
        if self._stage and self._stage != "done":
            self._durations[self._stage] = self._durations.get(self._stage, 0.0) + now - self._since
        self._since = now


def origin() -> dict[str, Any]:
    """Versions, host and time, for the provenance of a result."""
    return {
        "software": {
            "modalbase": fecore.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
        "host": platform.node(),
        "computed_at": datetime.now(UTC).isoformat(),
    }
