"""How fast a parameter changes: stiffness loss and damping rise a year, with intervals.

The slope of a straight line through all campaigns, baseline included, fitted together with the covariates, so that what
time and temperature share is in the slope's uncertainty: y = β₀ + Σ β_k (c_k − c̄_k) + ρ (t − t̄). The scatter τ between
campaigns is estimated anew from the line's own residuals; where a step rather than a line is in the data, it widens ρ.

Where a change was called that is a ramp, the rate is the ramp's, from its onset on (`rate_since_onset`): the baseline before it
says nothing about the speed after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
import scipy

from fecore.errors import InputError
from fecore.trend.baseline import complete_campaigns
from fecore.trend.change import ChangePoint
from fecore.trend.regression import fit_with_scatter
from fecore.trend.series import Series, select

DAYS_A_YEAR = 365.25  # Julian year


@dataclass(frozen=True)
class Rate:
    """Rate of change of a parameter.

    Attributes:
        per_year: ρ, the parameter's unit a year; a stiffness loss is negative, a damping rise positive.
        standard_deviation: of `per_year`.
        interval_95: from Student's t.
        relative_per_year: ρ over the baseline's mean, 1/year.
        relative_interval_95: the same for the interval.
        since: the date from which the parameter changes so; None: over all campaigns.
    """

    per_year: float
    standard_deviation: float
    interval_95: tuple[float, float]
    relative_per_year: float
    relative_interval_95: tuple[float, float]
    since: datetime | None = None


def rate(series: Series, covariates: Sequence[str], baseline_mean: float) -> Rate:
    """Rate of change over a series in time order.

    Campaigns that miss a covariate say nothing about the rate and are left out.

    Raises:
        InputError: fewer complete campaigns than coefficients and two more, or a baseline of 0.
    """
    if baseline_mean == 0:
        raise InputError("baseline_mean", "is 0, so a rate relative to it means nothing")
    complete = select(series, complete_campaigns(series, covariates).tolist())
    years = complete.days / DAYS_A_YEAR
    c = [complete.covariates[name] - complete.covariates[name].mean() for name in covariates]
    X = np.column_stack([np.ones(len(complete)), *c, years - years.mean()])
    fit = fit_with_scatter(X, complete.estimate, complete.standard_deviation)
    slope, sd = float(fit.coefficients[-1]), float(np.sqrt(fit.covariance[-1, -1]))
    return _rate(slope, sd, fit.degrees_of_freedom, baseline_mean)


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
    if baseline_mean == 0:
        raise InputError("baseline_mean", "is 0, so a rate relative to it means nothing")
    found = _rate(change.mean, change.mean_sd, change.degrees_of_freedom, baseline_mean)
    return replace(found, since=change.date)


def _rate(slope: float, sd: float, degrees_of_freedom: float, baseline_mean: float) -> Rate:
    half = float(scipy.special.stdtrit(degrees_of_freedom, 0.975)) * sd
    relative = sorted(((slope - half) / baseline_mean, (slope + half) / baseline_mean))
    return Rate(
        slope, sd, (slope - half, slope + half), slope / baseline_mean, (float(relative[0]), float(relative[1]))
    )
