"""What an update computes, in the worker's child process: no database, no web."""

import platform
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

import fecore
from fecore.body.constants import Body
from fecore.errors import InputError
from fecore.modes import MeasuredModes
from fecore.signal import Processed
from fecore.updating.campaigns import Campaign, CampaignsRecipe, CampaignsResult, update_campaigns
from fecore.updating.inputs import Inputs, fixed_points
from fecore.updating.layout import Coupon
from fecore.updating.measurement import Measurement, Recipe, prepare
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from service.compute.frame import Frame
from service.compute.identifying import describe_identification
from service.compute.processing import ProcessingInputs, ProcessingOutput, process_whole
from service.compute.result_arrays import arrays_to_keep, as_npz
from service.platform.queue.kinds import Reporter

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
class LoadedCampaign:
    """One campaign as it was loaded."""

    # with the material of all campaigns, in its own axes, where there are several; or a body in
    # space
    body: Body
    # measurement, recipe: for the core; the measurement is None where hits become it
    measurement: Measurement | None
    recipe: Recipe
    warnings: tuple[str, ...]  # what was left out while loading
    provenance: dict[str, Any]  # ids and digests of what it was made of
    hits: Hits | None = None  # time blocks of a campaign that has no FRFs yet, or None
    # name, specimen: in a result of several campaigns
    name: str = ""
    specimen: str = ""


@dataclass(frozen=True)
class Together:
    """How several campaigns are updated together."""

    recipe: CampaignsRecipe
    coupons: tuple[Coupon, ...]
    warnings: tuple[str, ...]  # of the coupons
    provenance: dict[str, Any]  # the request


@dataclass(frozen=True)
class UpdateInputs:
    """Everything that an update needs, and where it came from."""

    campaigns: tuple[LoadedCampaign, ...]
    together: Together | None = None  # of several campaigns; None of one


@dataclass(frozen=True)
class UpdateOutput:
    """A result ready to be stored."""

    result: UpdateResult | CampaignsResult  # of the core, without what is in the arrays
    prediction: bytes  # arrays as npz: predicted FRFs, shapes, samples; none of several campaigns
    warnings: tuple[str, ...]  # what was left out while loading, and of the hits
    provenance: dict[str, Any]  # where all of it came from
    sources: tuple[dict[str, Any], ...] = ()  # what each of several campaigns was made of
    # modes that the job found itself, in the specimen's frame; None where it was given a mode set
    identified: MeasuredModes | None = None
    identification: dict[str, Any] | None = None  # how they were found, as JSON
    processing: ProcessingOutput | None = None  # what became of the hits, where there were hits


def compute_update(inputs: UpdateInputs, report: Reporter) -> Iterator[UpdateOutput]:
    """Run the core: on one campaign, or on several together."""
    if inputs.together is None:
        (campaign,) = inputs.campaigns
        yield _update_one(campaign, report)
    else:
        yield _update_together(inputs.campaigns, inputs.together, report)


def _update_one(campaign: LoadedCampaign, report: Reporter) -> UpdateOutput:
    stages = _Stopwatch(report, 0.0 if campaign.hits is None else _OF_HITS)
    measurement, recipe, warnings = campaign.measurement, campaign.recipe, campaign.warnings
    processing = None
    if campaign.hits is not None:
        processing = process_whole(
            campaign.hits.records, lambda stage, share: report(stage, _OF_HITS * share)
        )
        measurement = _measured(campaign.hits, processing.processed)
        recipe, band = _within_force(recipe, processing.processed)
        warnings = (*warnings, *processing.document["warnings"], *band)
    assert measurement is not None, "a measurement is loaded, or made of hits"
    result = update(measurement, campaign.body, recipe, stages.progress, report)
    identification = result.identification
    return UpdateOutput(
        result=replace(result, prediction=None, identification=None),
        prediction=as_npz(arrays_to_keep(result)),
        warnings=warnings,
        provenance={**campaign.provenance, **origin(), "durations_s": stages.finish()},
        identified=None if identification is None else identification.modes,
        identification=None if identification is None else describe_identification(identification),
        processing=processing,
    )


def _update_together(
    loaded: Sequence[LoadedCampaign], together: Together, report: Reporter
) -> UpdateOutput:
    """Find each campaign's modes and update all together."""
    campaigns, warnings = [], list(together.warnings)
    for number, each in enumerate(loaded):
        report(f"finding the modes of {each.name}", 0.5 * number / len(loaded))
        assert each.measurement is not None, "of several campaigns each has FRFs or a mode set"
        try:
            data = prepare(each.measurement, each.body, each.recipe)
        except InputError as error:
            raise InputError(
                f"jobs.{number}.{error.field}", f"{error.message} ({each.name})"
            ) from error
        assert data.modes is not None, "they are handed in or found, else `prepare` refuses"
        points = () if data.frfs is None else fixed_points(*data.frfs.points)
        campaigns.append(
            Campaign(
                name=each.name,
                specimen=each.specimen,
                body=each.body,
                modes=data.modes,
                points=each.measurement.points,
                inputs=each.measurement.inputs,
                fixed_points=() if each.body.masses else points,
                axes=each.measurement.axes or {},
                temperature_c=each.measurement.temperature_c,
            )
        )
        warnings += [f"campaign {each.name}: {text}" for text in (*each.warnings, *data.warnings)]
    result = update_campaigns(
        campaigns,
        together.recipe,
        together.coupons,
        lambda stage, share: report(stage, 0.5 + 0.5 * share),
    )
    return UpdateOutput(
        result=result,
        prediction=as_npz({}),
        warnings=tuple(warnings),
        provenance={**together.provenance, **origin()},
        sources=tuple(each.provenance for each in loaded),
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
