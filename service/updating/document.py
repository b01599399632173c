"""A result as the REST contract shows it: plain JSON, NaN as null."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.result import (
    Correlation,
    FrfCorrelation,
    HeldOut,
    ParameterEstimate,
    PosteriorSummary,
    UpdateResult,
)
from service.modes.identification_document import describe_identification
from service.updating.versions import VERSION

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


def describe(result: UpdateResult, warnings: Iterable[str], provenance: dict[str, Any]) -> dict[str, Any]:
    """The document that `GET /update-jobs/{id}/result` answers."""
    return {
        "verdict": asdict(result.verdict) | {"reasons": list(result.verdict.reasons)},
        "warnings": [*warnings, *result.warnings],
        "outcomes": [asdict(outcome) for outcome in result.outcomes],
        "parameters": [_parameter(p) for p in result.parameters],
        "modes": [asdict(mode) for mode in result.modes],
        "correlation": _correlation(result.correlation),
        "damping_models": [
            {
                "name": fit.name,
                "coefficients": fit.coefficients,
                "bic": fit.bic if np.isfinite(fit.bic) else None,
                "preferred": fit.preferred,
                "missed": _numbers(fit.missed),
                "standard_deviations": fit.standard_deviations,
                "curve": {"frequency_hz": _short(fit.curve[0]), "damping_ratio": _short(fit.curve[1])},
                "by_mechanism": fit.by_mechanism,
            }
            for fit in result.damping_models
        ],
        "damping_fit": {
            "starts": result.damping_starts,
            "optima": list(result.damping_optima),
            "history": result.damping_history.tolist(),
        },
        "convergence": [
            {"parameters": step.parameters, "frequency_hz": _numbers(step.frequency_hz), "cost": step.cost}
            for step in result.convergence
        ],
        "starts": [
            {
                "chosen": start.chosen,
                "failure": start.failure or None,
                "cost": list(start.cost),
                "parameters": {name: values.tolist() for name, values in start.parameters.items()},
            }
            for start in result.starts
        ],
        "pairing": asdict(result.pairing),
        "model_modes": []
        if result.shapes is None
        else [
            {"number": k + 1, "frequency_hz": float(hz), "kind": kind}
            for k, (hz, kind) in enumerate(zip(result.shapes.frequency_hz, result.shapes.kinds, strict=True))
        ],
        "identifiability": {"null_directions": list(result.null_directions)},
        "discrepancy": {"frequency": result.frequency_discrepancy, "damping": result.damping_discrepancy},
        "band_hz": None if result.band_hz is None else list(result.band_hz),
        "channel_delay_s": result.channel_delay_s,
        "identification": None if result.identification is None else describe_identification(result.identification),
        "posterior": _posterior(result.posterior),
        "provenance": provenance,
        "version": VERSION,
    }


def _parameter(parameter: ParameterEstimate) -> dict[str, Any]:
    return {
        **asdict(parameter),
        "interval_95": list(parameter.interval_95),
        "budget": [asdict(entry) for entry in parameter.budget],
        "confounded_with": list(parameter.confounded_with),
    }


def _posterior(posterior: PosteriorSummary) -> dict[str, Any]:
    """The method, how the parameters correlate, and for samples what the chains were like."""
    described: dict[str, Any] = {"method": posterior.method}
    if posterior.correlation is not None:
        described |= {"names": list(posterior.names), "correlation": posterior.correlation.tolist()}
    if posterior.samples is not None:
        described |= {
            "samples": len(posterior.samples),
            "effective_samples": list(posterior.effective_samples),
            "autocorrelation_time": list(posterior.autocorrelation_time),
            "acceptance": list(posterior.acceptance),
        }
    return described


def _correlation(correlation: Correlation) -> dict[str, Any]:
    matrix = correlation.mac_matrix
    return {
        **_agreement(correlation.updated),
        "initial": _agreement(correlation.initial),
        "held_out": {
            "frfs": _held_out(correlation.held_out_frfs),
            "band": _held_out(correlation.held_out_band),
        },
        "mac_matrix": None if matrix is None else [_numbers(row) for row in matrix],
    }


def _held_out(held: HeldOut | None) -> dict[str, Any] | None:
    if held is None:
        return None
    return {
        "points": list(held.points),
        "band_hz": list(held.band_hz),
        **_agreement(held.agreement),
        "coverage_95": held.coverage_95,
    }


def _agreement(agreement: FrfCorrelation | None) -> dict[str, Any]:
    if agreement is None:
        return {"sac": [], "frac": [], "csac_mean": None, "csf_mean": None}
    return {
        "sac": _numbers(agreement.sac),
        "frac": _numbers(agreement.frac),
        "csac_mean": float(np.nanmean(agreement.csac)),
        "csf_mean": float(np.nanmean(agreement.csf)),
    }


def _short(values: FloatArray) -> list[float | None]:
    """Numbers of a curve that is only drawn, to five digits."""
    return [None if value is None else float(f"{value:.5g}") for value in _numbers(values)]


def _numbers(values: FloatArray) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
