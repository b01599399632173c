"""What a joint update computes, in the worker's child process: no database, no web."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

import fecore
from fecore.body.oriented import OrientedSpecimen
from fecore.updating.campaigns import Campaign, CampaignsRecipe, update_campaigns
from fecore.updating.elastic import Coupon
from fecore.updating.excursions import fixed_points
from fecore.updating.measurement import Measurement, prepare
from fecore.updating.recipe import Recipe
from fecore.updating.result import CampaignPart, CampaignsResult, ParameterEstimate
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


def compute_joint(inputs: JointInputs, report: Report) -> Iterator[dict[str, Any]]:
    """Find each campaign's modes, update all together and describe the result."""
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
    provenance = {
        **inputs.provenance,
        "software": {"modalbase": fecore.__version__, "numpy": np.__version__, "python": platform.python_version()},
        "host": platform.node(),
        "computed_at": datetime.now(UTC).isoformat(),
    }
    yield _describe(result, warnings, [each.provenance for each in inputs.campaigns], provenance)


def _describe(
    result: CampaignsResult, warnings: list[str], sources: list[dict[str, Any]], provenance: dict[str, Any]
) -> dict[str, Any]:
    """The document of a joint update: plain JSON, each campaign's part with the ids of what it was made of."""
    parts = zip(result.campaigns, sources, strict=True)
    return {
        "verdict": asdict(result.verdict) | {"reasons": list(result.verdict.reasons)},
        "warnings": [*result.warnings, *warnings],
        "parameters": [_parameter(each) for each in result.parameters],
        "posterior": {"names": list(result.free), "correlation": result.correlation.tolist()},
        "campaigns": [_part(part) | source for part, source in parts],
        "odd_one_out": result.odd_one_out,
        "damping_models": [asdict(law) | {"bic": law.bic if np.isfinite(law.bic) else None} for law in result.damping],
        "discrepancy": {"frequency": result.discrepancy, "scatter": result.scatter},
        "provenance": provenance,
    }


def _part(part: CampaignPart) -> dict[str, Any]:
    return {
        "name": part.name,
        "specimen": part.specimen,
        "predictive_p": part.predictive_p,
        "contradicts": part.contradicts,
        "alone": {name: dict(values) for name, values in part.alone.items()},
        "own": [_parameter(each) for each in part.own],
        "modes": [asdict(mode) for mode in part.modes],
    }


def _parameter(parameter: ParameterEstimate) -> dict[str, Any]:
    return asdict(parameter) | {
        "interval_95": list(parameter.interval_95),
        "budget": [asdict(entry) for entry in parameter.budget],
        "confounded_with": list(parameter.confounded_with),
    }
