"""When a change began: a step or a ramp at an unknown campaign.

After the baseline r = Δ g_τ + η, with g_τ the pattern of a change that began with campaign τ (a
step: 1 from τ on; a ramp: the time since the campaign before τ), and η ~ N(0, σ² C) with C the
campaigns' own variances and the baseline's error that they share. With a flat prior on Δ and τ, and
the baseline's ν degrees of freedom for σ² (1 in expectation), whitening by C = LLᵀ leaves

    p(τ | r) ∝ (g̃ᵀg̃)^{−1/2} (ν + Q_τ)^{−(ν + m − 1)/2},   Q_τ = |r̃|² − (g̃ᵀr̃)² / g̃ᵀg̃

(a Bayesian change point, Smith 1975). The interval is the shortest set of campaigns that holds 95 %
of it, filled up.

How fast a parameter changes: stiffness loss and damping rise a year, with intervals.

The slope of a straight line through all campaigns, baseline included, fitted together with the
covariates, so that what time and temperature share is in the slope's uncertainty: y = β₀ + Σ β_k
(c_k − c̄_k) + ρ (t − t̄). The scatter τ between campaigns is estimated anew from the line's own
residuals; where a step rather than a line is in the data, it widens ρ.

Where a change was called that is a ramp, the rate is the ramp's, from its onset on
(`rate_since_onset`): the baseline before it says nothing about the speed after it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.trend.baseline import complete_campaigns, fit_with_scatter, slope_prior
from fecore.trend.series import Series, days_since, select

Pattern = Literal["step", "ramp"]

DAYS_A_YEAR = 365.25  # Julian year


@dataclass(frozen=True)
class ChangePoint:
    """Where a change began."""

    pattern: Pattern  # what fits better: a `step`, or a `ramp` that still goes on
    # of the first changed campaign, counted from the first one after the baseline; the most
    # probable
    index: int
    interval: tuple[int, int]  # (first, last) index of the 95 % interval
    # date, date_interval: the same as dates. A change lies between the campaign before and the
    # first changed one, so the interval begins at the date of the campaign before; the baseline's
    # end where there is none
    date: datetime
    date_interval: tuple[datetime, datetime]
    size: float  # step: change of the parameter; ramp: change a year. In the parameter's unit
    size_sd: float  # its standard deviation, given the index
    # mean, mean_sd: of the size over all indices by their probability, so that not knowing the
    # onset is in it: mean = Σ p_τ Δ_τ, variance Σ p_τ (s_τ² + Δ_τ²) − mean²
    mean: float
    mean_sd: float
    degrees_of_freedom: float  # of both standard deviations


def change_point(
    dates: tuple[datetime, ...],
    days: FloatArray,
    residual: FloatArray,
    covariance: FloatArray,
    degrees_of_freedom: float,
    probability: float = 0.95,
    pattern: Pattern | None = None,
) -> ChangePoint:
    """Estimate the change point of m campaigns after the baseline.

    Args:
        dates: (1 + m,) the baseline's last campaign, then the m campaigns.
        days: (1 + m,) the same as days.
        residual: (m,) against the baseline.
        covariance: (m, m) of the residuals of an unchanged structure.
        degrees_of_freedom: of the baseline's scatter.
        probability: of the interval.
        pattern: `step` or `ramp`; by default the one under which the residuals are more probable.

    Raises:
        InputError: fewer than two campaigns.
    """
    m = residual.size
    if m < 2:
        raise InputError(
            "points", f"{m} campaigns after the baseline, expected at least 2 for a change point"
        )
    root = scipy.linalg.cholesky(covariance, lower=True)
    white = scipy.linalg.solve_triangular(root, residual, lower=True)
    candidates: tuple[Pattern, ...] = ("step", "ramp") if pattern is None else (pattern,)
    fits = []
    for kind in candidates:
        g = scipy.linalg.solve_triangular(root, _patterns(kind, days), lower=True)
        size = np.sum(g**2, axis=0)
        along = g.T @ white
        misfit = white @ white - along**2 / size
        log_p = -0.5 * np.log(size) - (degrees_of_freedom + m - 1) / 2 * np.log(
            degrees_of_freedom + misfit
        )
        fits.append((float(misfit.min()), kind, log_p, along / size, size, misfit))
    _, kind, log_p, amplitude, size, misfit = min(fits, key=lambda item: item[0])
    posterior = np.exp(log_p - scipy.special.logsumexp(log_p))
    index = int(np.argmax(posterior))
    ranked = np.argsort(-posterior)
    held = ranked[: int(np.searchsorted(np.cumsum(posterior[ranked]), probability)) + 1]
    first, last = int(held.min()), int(held.max())
    variance = (degrees_of_freedom + misfit) / (degrees_of_freedom + m - 1) / size
    mean = float(posterior @ amplitude)
    return ChangePoint(
        pattern=kind,
        index=index,
        interval=(first, last),
        date=dates[index + 1],
        date_interval=(dates[first], dates[last + 1]),
        size=float(amplitude[index]),
        size_sd=float(np.sqrt(variance[index])),
        mean=mean,
        mean_sd=float(np.sqrt(posterior @ (variance + (amplitude - mean) ** 2))),
        degrees_of_freedom=degrees_of_freedom + m - 1,
    )


def _patterns(kind: Pattern, days: FloatArray) -> FloatArray:
    """(m, m) pattern of a change that began with campaign τ, a column each; a ramp in years."""
    m = days.size - 1
    if kind == "step":
        return np.tril(np.ones((m, m)))
    return np.maximum(0.0, days[1:, None] - days[None, :-1]) / DAYS_A_YEAR


TIME_UNITS = {"hour": 1 / 24 / DAYS_A_YEAR, "day": 1 / DAYS_A_YEAR, "year": 1.0}
"""Units of time in years."""
_HALF_A_YEAR, _TWO_DAYS = DAYS_A_YEAR / 2, 2.0


def time_unit(days: float) -> str:
    """The unit of time in which people read how fast something changes that was seen for so many
    days: of hours, a change a year is a number that nobody has seen.

    >>> time_unit(0.5), time_unit(30.0), time_unit(400.0)
    ('hour', 'day', 'year')
    """
    return "year" if days >= _HALF_A_YEAR else "day" if days >= _TWO_DAYS else "hour"


@dataclass(frozen=True)
class Rate:
    """Rate of change of a parameter."""

    # ρ, the parameter's unit a year; a stiffness loss is negative, a damping rise positive
    per_year: float
    standard_deviation: float  # of `per_year`
    interval_95: tuple[float, float]  # from Student's t
    relative_per_year: float  # ρ over the baseline's mean, 1/year
    relative_interval_95: tuple[float, float]  # the same for the interval
    # the date from which the parameter changes so; None: over all campaigns
    since: datetime | None = None


@dataclass(frozen=True)
class Line:
    """A straight line in time through a series, and what covariates do beside it."""

    rate: Rate  # of change
    # by covariate, the change of the parameter by one unit of it, and its standard deviation
    effects: Mapping[str, tuple[float, float]]
    corrected: FloatArray  # (n,) estimates at the covariates' means; NaN where one was not measured
    ends: tuple[float, float]  # the line at the first and at the last campaign of the series
    used: int  # campaigns whose covariates are all known


def rate(
    series: Series,
    covariates: Sequence[str],
    baseline_mean: float,
    per_kelvin: tuple[float, float] | None = None,
) -> Rate:
    """Rate of change over a series in time order: that of `line`."""
    return line(series, covariates, baseline_mean, per_kelvin).rate


def line(
    series: Series,
    covariates: Sequence[str],
    baseline_mean: float,
    per_kelvin: tuple[float, float] | None = None,
) -> Line:
    """The line through a series in time order, fitted together with the covariates.

    Campaigns that miss a covariate say nothing about the rate and are left out.

    Args:
        series: in time order.
        covariates: names of those to regress out.
        baseline_mean: what the rate is relative to.
        per_kelvin: mean and standard deviation of the relative change by temperature, as known
            before; None: nothing is.

    Raises:
        InputError: fewer complete campaigns than coefficients and two more, or a baseline of 0.
    """
    complete = select(series, complete_campaigns(series, covariates).tolist())
    regressors = np.column_stack(
        [complete.measured(covariates), days_since(series.dates[0], complete.dates) / DAYS_A_YEAR]
    )
    centre = regressors.mean(axis=0)
    X = np.column_stack([np.ones(len(complete)), regressors - centre])
    prior = slope_prior(covariates, baseline_mean, per_kelvin, more=1)
    fit = fit_with_scatter(X, complete.estimate, complete.standard_deviation, prior)
    sd = np.sqrt(np.diag(fit.covariance))
    level, slope = float(fit.coefficients[0]), float(fit.coefficients[-1])
    years = np.array([0.0, series.days[-1] / DAYS_A_YEAR])
    first, last = (level + slope * (years - centre[-1])).tolist()
    return Line(
        _rate(slope, float(sd[-1]), fit.degrees_of_freedom, baseline_mean),
        {name: (float(fit.coefficients[k]), float(sd[k])) for k, name in enumerate(covariates, 1)},
        series.estimate - (series.measured(covariates) - centre[:-1]) @ fit.coefficients[1:-1],
        (first, last),
        len(complete),
    )


def rate_since_onset(change: ChangePoint, baseline_mean: float) -> Rate:
    """Rate of a ramp from its onset on; a line through the baseline too gives a slower one.

    Its interval holds that the onset is not known: see `ChangePoint.mean_sd`.

    Args:
        change: a ramp.
        baseline_mean: what the rate is relative to.

    Raises:
        InputError: the change is a step, or the baseline is 0.
    """
    if change.pattern != "ramp":
        raise InputError("change", "is a step, which has no rate")
    speed = _rate(change.mean, change.mean_sd, change.degrees_of_freedom, baseline_mean)
    return replace(speed, since=change.date)


def _rate(slope: float, sd: float, degrees_of_freedom: float, baseline_mean: float) -> Rate:
    if baseline_mean == 0:
        raise InputError("baseline_mean", "is 0, so a rate relative to it means nothing")
    half = float(scipy.special.stdtrit(degrees_of_freedom, 0.975)) * sd
    relative = sorted(((slope - half) / baseline_mean, (slope + half) / baseline_mean))
    return Rate(
        slope,
        sd,
        (slope - half, slope + half),
        slope / baseline_mean,
        (float(relative[0]), float(relative[1])),
    )
