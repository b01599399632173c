"""A judged parameter as plain JSON: what is stored of it, shown and drawn. Dates are ISO, in the
zone of the series.
"""

import math
from typing import Any

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.temperatures import temperatures_between
from fecore.trend.assessment import ParameterTrend
from fecore.trend.baseline import Baseline, score
from fecore.trend.change import ChangePoint, Rate
from fecore.trend.series import TEMPERATURE


def describe_trend(trend: ParameterTrend) -> dict[str, Any]:
    """A watched parameter with its baseline, limits, points, states, change and rate; what is not
    known is None.
    """
    return {
        "name": trend.name,
        "direction": trend.direction,
        "state": trend.state.value,
        "baseline": None if trend.baseline is None else _baseline(trend.baseline),
        "curve": None if trend.baseline is None else _curve(trend.baseline),
        "limits": (
            None
            if trend.limits is None
            else {"chart": trend.limits.chart, "score": _finite(trend.limits.score)}
        ),
        "autocorrelation": _autocorrelation(trend),
        "points": _points(trend),
        "change_point": None if trend.change is None else describe_change(trend.change),
        "rate": None if trend.rate is None else describe_rate(trend.rate),
        "timeline": [
            {
                "date": m.date.isoformat(),
                "event": m.event.value,
                "campaign_id": m.label,
                "state": m.state.value,
            }
            for m in trend.timeline
        ],
        "notes": list(trend.notes),
    }


def _baseline(baseline: Baseline) -> dict[str, Any]:
    fit = baseline.fit
    return {
        "campaign_ids": list(baseline.labels),
        "mean": baseline.mean,
        "mean_sd": baseline.mean_sd,
        "between_campaigns_sd": fit.between_sd,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "covariates": [
            {
                "name": name,
                "centre": float(baseline.centre[k]),
                "low": float(baseline.low[k]),
                "high": float(baseline.high[k]),
                "slope": float(fit.coefficients[k + 1]),
                "slope_sd": float(np.sqrt(fit.covariance[k + 1, k + 1])),
            }
            for k, name in enumerate(baseline.covariates)
        ],
    }


def _curve(baseline: Baseline) -> dict[str, Any] | None:
    """The parameter over temperature, other covariates at the baseline's mean; None where
    temperature is not regressed out.
    """
    if TEMPERATURE not in baseline.covariates:
        return None
    fit, k = baseline.fit, baseline.covariates.index(TEMPERATURE)
    temperature = temperatures_between(float(baseline.low[k]), float(baseline.high[k]))
    at = np.zeros((temperature.size, 1 + len(baseline.covariates)))
    at[:, 0], at[:, 1 + k] = 1.0, temperature - baseline.centre[k]
    estimate = at @ fit.coefficients
    reach = float(scipy.special.stdtrit(fit.degrees_of_freedom, 0.975)) * np.sqrt(
        np.einsum("ij,jk,ik->i", at, fit.covariance, at)
    )
    level = baseline.mean or math.nan
    return {
        "temperature_c": temperature.tolist(),
        "estimate": estimate.tolist(),
        "low": (estimate - reach).tolist(),
        "high": (estimate + reach).tolist(),
        "per_K": _finite(float(fit.coefficients[1 + k]) / level),
        "per_K_sd": _finite(float(np.sqrt(fit.covariance[1 + k, 1 + k])) / abs(level)),
    }


def _autocorrelation(trend: ParameterTrend) -> dict[str, Any] | None:
    """How much campaigns resemble their neighbours, and the factor by which the limits are wider
    for it.
    """
    if trend.baseline is None:
        return None
    autocorrelation = trend.baseline.autocorrelation
    return {
        "lag_1": autocorrelation.mean,
        "interval_95": list(autocorrelation.interval_95),
        "interval_days": autocorrelation.interval_days,
        "limits_widened_by": trend.widened_by,
    }


def _points(trend: ParameterTrend) -> list[dict[str, Any]]:
    series = trend.series
    corrected: FloatArray = (
        np.full(len(series), np.nan)
        if trend.baseline is None
        else score(trend.baseline, series).corrected
    )
    later = (
        {} if trend.watched is None else {label: i for i, label in enumerate(trend.watched.labels)}
    )
    return [
        {
            "campaign_id": label,
            "performed_at": series.dates[i].isoformat(),
            "raw": float(series.estimate[i]),
            "standard_deviation": float(series.standard_deviation[i]),
            "corrected": _finite(corrected[i]),
            "in_baseline": trend.baseline is not None and label in trend.baseline.labels,
            "judged": None if label not in later else describe_judged(trend, later[label]),
        }
        for i, label in enumerate(series.labels)
    ]


def describe_judged(trend: ParameterTrend, i: int) -> dict[str, Any]:
    """How the i-th watched campaign was judged; `residual_limit` is the limit of a single score as
    a residual.
    """
    assert trend.scores is not None
    assert trend.baseline is not None
    assert trend.limits is not None
    t = -scipy.special.stdtrit(
        trend.baseline.fit.degrees_of_freedom, scipy.special.ndtr(-trend.limits.score)
    )
    return {
        "residual_limit": _finite(t * trend.scores.residual_sd[i]),
        "residual": float(trend.scores.residual[i]),
        "residual_sd": float(trend.scores.residual_sd[i]),
        "score": float(trend.scores.score[i]),
        "chart": {side: float(values[i]) for side, values in trend.statistic.items()},
        "outside": bool(trend.outside[i]),
        "extrapolated": bool(trend.scores.extrapolated[i]),
        "covariate_missing": bool(trend.scores.missing[i]),
    }


def describe_change(change: ChangePoint) -> dict[str, Any]:
    """When a change began, and how large it is."""
    return {
        "pattern": change.pattern,
        "date": change.date.isoformat(),
        "date_interval": [date.isoformat() for date in change.date_interval],
        "size": change.size,
        "size_sd": change.size_sd,
    }


def describe_rate(rate: Rate) -> dict[str, Any]:
    """How fast a parameter changes, and since when."""
    return {
        "per_year": rate.per_year,
        "interval_95": list(rate.interval_95),
        "relative_per_year": rate.relative_per_year,
        "relative_interval_95": list(rate.relative_interval_95),
        "since": None if rate.since is None else rate.since.isoformat(),
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
