"""What a joint update computes, in the worker's child process: no database, no web."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from fecore.body.oriented import OrientedSpecimen
from fecore.updating.campaigns import Campaign, CampaignsRecipe, CampaignsResult, update_campaigns
from fecore.updating.excursions import fixed_points
from fecore.updating.layout import Coupon
from fecore.updating.measurement import Measurement, prepare
from fecore.updating.recipe import Recipe
from service.compute.origin import origin
from service.jobs.kinds import Report


@dataclass(frozen=True)
class JointCampaign:
    """One campaign as it was loaded.

    Attributes:
        name, specimen: in the result.
        body: with the material of all campaigns, in its own axes.
        measurement, recipe: for identification where there is no mode set.
        provenance: ids of what it was made of.
        warnings: what was left out while loading.
    """

    name: str
    specimen: str
    body: OrientedSpecimen
    measurement: Measurement
    recipe: Recipe
    provenance: dict[str, Any]
    warnings: tuple[str, ...]


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
    """A result ready to be stored: of the core, with warnings of what was left out, and what each campaign was made of."""

    result: CampaignsResult
    warnings: tuple[str, ...]
    sources: tuple[dict[str, Any], ...]
    provenance: dict[str, Any]


def compute_joint(inputs: JointInputs, report: Report) -> Iterator[JointOutput]:
    """Find each campaign's modes and update all together."""
    campaigns, warnings = [], list(inputs.warnings)
    count = len(inputs.campaigns)
    for number, each in enumerate(inputs.campaigns):
        report(f"finding the modes of {each.name}", 0.5 * number / count)
        data = prepare(each.measurement, each.body, each.recipe)
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
