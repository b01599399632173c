"""A result as the REST contract shows it: plain JSON, made by the models of `result_schemas`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fecore.updating.campaigns import CampaignsResult
from fecore.updating.result import Correlation, FrfCorrelation, HeldOut, PosteriorSummary, UpdateResult
from service.store.updating.result_schemas import JointResultOut, ResultOut
from service.store.updating.versions import VERSION

LARGE_PARTS = {"stabilisation": ("identification", "stabilisation"), "convergence": ("convergence",)}
"""Parts of a document that only a figure needs, and where they stand."""


def slim(document: Mapping[str, Any], leave_out: Iterable[str]) -> dict[str, Any]:
    """A document without some of its large parts; the one that is given stays as it is."""
    left = dict(document)
    for name in leave_out:
        first, *deeper = LARGE_PARTS[name]
        if deeper and isinstance(left.get(first), dict):
            left[first] = {key: value for key, value in left[first].items() if key != deeper[0]}
        elif not deeper:
            left.pop(first, None)
    return left


def describe(
    result: UpdateResult, identification: dict[str, Any] | None, warnings: Iterable[str], provenance: dict[str, Any]
) -> dict[str, Any]:
    """The document that `GET /update-jobs/{id}/result` answers."""
    laws = [{**vars(law), "curve": dict(zip(_CURVE, law.curve, strict=True))} for law in result.damping_models]
    shapes = result.shapes
    modes = [] if shapes is None else list(zip(shapes.frequency_hz.tolist(), shapes.kinds, strict=True))
    members = {
        **{name: getattr(result, name) for name in _AS_THEY_ARE},
        "warnings": [*warnings, *result.warnings],
        "correlation": _correlation(result.correlation),
        "damping_models": laws,
        "damping_fit": {
            "starts": result.damping_starts,
            "optima": list(result.damping_optima),
            "history": result.damping_history.tolist(),
        },
        "model_modes": [{"number": k, "frequency_hz": hz, "kind": kind} for k, (hz, kind) in enumerate(modes, start=1)],
        "identifiability": {"null_directions": list(result.null_directions)},
        "discrepancy": {"frequency": result.frequency_discrepancy, "damping": result.damping_discrepancy},
        "identification": identification,
        "posterior": _posterior(result.posterior),
        "provenance": provenance,
        "version": VERSION,
    }
    return ResultOut.model_validate(members).model_dump(mode="json", exclude_unset=True)


_CURVE = ("frequency_hz", "damping_ratio")
_AS_THEY_ARE = (
    *("verdict", "findings", "outcomes", "parameters", "modes", "convergence", "starts", "pairing"),
    *("band_hz", "channel_delay_s"),
)


def describe_joint(
    result: CampaignsResult, warnings: Iterable[str], sources: Sequence[dict[str, Any]], provenance: dict[str, Any]
) -> dict[str, Any]:
    """The document of a joint update, each campaign's part with the ids of what it was made of."""
    members = {
        **vars(result),
        "warnings": [*result.warnings, *warnings],
        "posterior": {"names": result.free, "correlation": result.correlation},
        "campaigns": [{**vars(part), **source} for part, source in zip(result.campaigns, sources, strict=True)],
        "damping_models": result.damping,
        "discrepancy": {"frequency": result.discrepancy, "scatter": result.scatter},
        "provenance": provenance,
    }
    for name in ("correlation", "free", "scatter", "damping"):
        del members[name]
    return JointResultOut.model_validate(members).model_dump(mode="json", exclude_unset=True)


def _posterior(posterior: PosteriorSummary) -> dict[str, Any]:
    """The method, how the parameters correlate, and for samples what the chains were like."""
    described: dict[str, Any] = {"method": posterior.method}
    if posterior.correlation is not None:
        described |= {"names": posterior.names, "correlation": posterior.correlation}
    if posterior.samples is not None:
        described["samples"] = len(posterior.samples)
        for name in ("effective_samples", "autocorrelation_time", "acceptance"):
            described[name] = list(getattr(posterior, name))
    return described


def _correlation(correlation: Correlation) -> dict[str, Any]:
    return {
        **_agreement(correlation.updated),
        "initial": _agreement(correlation.initial),
        "held_out": {"frfs": _held_out(correlation.held_out_frfs), "band": _held_out(correlation.held_out_band)},
        "mac_matrix": correlation.mac_matrix,
    }


def _held_out(held: HeldOut | None) -> dict[str, Any] | None:
    if held is None:
        return None
    kept = {"points": held.points, "band_hz": held.band_hz, "coverage_95": held.coverage_95}
    return kept | _agreement(held.agreement)


def _agreement(agreement: FrfCorrelation | None) -> dict[str, Any]:
    if agreement is None:
        return {"sac": [], "frac": [], "csac_mean": None, "csf_mean": None}
    means = {f"{name}_mean": float(np.nanmean(getattr(agreement, name))) for name in ("csac", "csf")}
    return {"sac": agreement.sac, "frac": agreement.frac, **means}
