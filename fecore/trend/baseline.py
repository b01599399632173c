"""The baseline: the first n campaigns, the regression on covariates, and scores of later campaigns against it.

With centred covariates c the baseline says y = β₀ + Σ β_k (c_k − c̄_k). A later campaign at x = (1, c − c̄) has the residual
r = y − xᵀβ, whose variance is

    s² + τ² + h + m,   h = xᵀ V_β x,   m = Σ over missing covariates of (β_k² + V_kk) Var(c_k)

s its own standard deviation, τ the scatter between campaigns, h the baseline's uncertainty at that covariate (its
leverage), m what a covariate that was not measured could have done, had it been as in the baseline. The score is the
residual's quantile in a t distribution of ν degrees of freedom, as a normal deviate: z = Φ⁻¹(T_ν(r / sd)).

Beyond the baseline's covariates the error of the slope is shared by all campaigns, so it looks like a change. There the
variance is raised to h + (s² + τ²) h/h_max, h_max the largest leverage in the baseline, so that the share of the baseline's
error in a score stays what it was when the chart's limits were set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.trend.autocorrelation import Autocorrelation, diagnose
from fecore.trend.deviates import normal_score
from fecore.trend.regression import RegressionFit, fit_with_scatter
from fecore.trend.series import Series, days_since, select

_CONSISTENT = 0.01  # p-value below which the stated standard deviations are called too large


@dataclass(frozen=True)
class Baseline:
    """What is known of a parameter before it is watched.

    Attributes:
        labels: campaigns that make the baseline.
        covariates: names of the covariates that are regressed out.
        centre, low, high, variance: (k,) mean, range and variance of each covariate in the baseline.
        fit: β (value at the mean covariates, then the slopes), its covariance, τ and ν.
        leverage_mean, leverage_max: of the baseline's own campaigns, xᵀ V_β x.
        autocorrelation: how much its campaigns resemble their neighbours.
    """

    labels: tuple[str, ...]
    covariates: tuple[str, ...]
    centre: FloatArray
    low: FloatArray
    high: FloatArray
    variance: FloatArray
    fit: RegressionFit
    leverage_mean: float
    leverage_max: float
    autocorrelation: Autocorrelation

    @property
    def mean(self) -> float:
        """Parameter at the baseline's mean covariates."""
        return float(self.fit.coefficients[0])

    @property
    def mean_sd(self) -> float:
        """Standard deviation of `mean`."""
        return float(np.sqrt(self.fit.covariance[0, 0]))

    @property
    def shared(self) -> float:
        """Variance of the baseline's own error in units of a campaign's variance: the g of the chart's limits."""
        return self.leverage_mean / self.fit.total_variance


@dataclass(frozen=True)
class Scores:
    """Campaigns judged against a baseline.

    Attributes:
        corrected: (n,) estimates brought to the baseline's mean covariates.
        residual: (n,) estimate less what the baseline expects at the campaign's covariates.
        residual_sd: (n,) its standard deviation, extrapolation and missing covariates included.
        score: (n,) normal deviate of the residual.
        extrapolated: (n,) whether a covariate lies beyond the baseline's.
        missing: (n,) whether a covariate was not measured.
        covariance: (n, n) of the residuals; off the diagonal, the baseline's error that campaigns share.
    """

    corrected: FloatArray
    residual: FloatArray
    residual_sd: FloatArray
    score: FloatArray
    extrapolated: BoolArray
    missing: BoolArray
    covariance: FloatArray


def complete_campaigns(series: Series, covariates: Sequence[str]) -> IntArray:
    """Indices of the campaigns of which every covariate is known."""
    known = np.ones(len(series), bool)
    for name in covariates:
        known &= np.isfinite(series.covariates.get(name, np.full(len(series), np.nan)))
    return np.flatnonzero(known)


def fit_baseline(
    series: Series, n: int, covariates: Sequence[str] = ()
) -> tuple[Baseline, Series | None, tuple[str, ...]]:
    """Baseline of the first n campaigns whose covariates are all known; the later campaigns, if any; and notes.

    Args:
        series: in time order.
        n: campaigns in the baseline; at least the number of coefficients (1 + covariates) and three more.
        covariates: to regress out.

    Raises:
        InputError: too few campaigns with all covariates, or a covariate that does not vary.
    """
    names = tuple(covariates)
    if n < len(names) + 4:
        raise InputError("baseline", f"{n} campaigns, expected at least {len(names) + 4} for {len(names)} covariates")
    complete = complete_campaigns(series, names)
    if complete.size < n:
        raise InputError(
            "baseline", f"needs {n} campaigns with all covariates, {series.name} has {complete.size} of {len(series)}"
        )
    used, last = complete[:n], int(complete[n - 1])
    left_out = [series.labels[i] for i in range(last) if i not in used]
    notes = [f"left out of the baseline, a covariate is missing: {', '.join(left_out)}"] if left_out else []
    base = select(series, used.tolist())
    c = np.array([base.covariates[name] for name in names]).reshape(len(names), n).T
    for k, name in enumerate(names):
        if np.ptp(c[:, k]) == 0:
            raise InputError(f"covariates.{name}", "does not vary in the baseline, so its effect is not known")
    X = np.column_stack([np.ones(n), c - c.mean(axis=0)])
    fit = fit_with_scatter(X, base.estimate, base.standard_deviation)
    if fit.excess < _CONSISTENT:
        notes.append("the stated standard deviations are larger than the scatter; changes are found later than need be")
    leverage = np.einsum("ij,jk,ik->i", X, fit.covariance, X)
    baseline = Baseline(
        labels=tuple(base.labels),
        covariates=names,
        centre=c.mean(axis=0),
        low=c.min(axis=0),
        high=c.max(axis=0),
        variance=c.var(axis=0, ddof=1),
        fit=fit,
        leverage_mean=float(leverage.mean()),
        leverage_max=float(leverage.max()),
        autocorrelation=diagnose(
            X,
            base.estimate,
            np.sqrt(base.standard_deviation**2 + fit.between_sd**2),
            days_since(base.dates[0], base.dates),
        ),
    )
    watched = select(series, range(last + 1, len(series))) if last + 1 < len(series) else None
    return baseline, watched, tuple(notes)


def score(baseline: Baseline, series: Series) -> Scores:
    """Scores of campaigns against a baseline; see the module's docstring for the equations."""
    n = len(series)
    raw = [series.covariates.get(name, np.full(n, np.nan)) for name in baseline.covariates]
    c = np.array(raw).reshape(len(raw), n).T
    absent = np.isnan(c)
    centred = np.where(absent, 0.0, c - baseline.centre)
    X = np.column_stack([np.ones(n), centred])
    fit = baseline.fit
    slopes = fit.coefficients[1:]
    residual = series.estimate - X @ fit.coefficients
    shared = X @ fit.covariance @ X.T
    leverage = np.diag(shared)
    unmeasured = absent @ ((slopes**2 + np.diag(fit.covariance)[1:]) * baseline.variance)
    own = series.standard_deviation**2 + fit.between_sd**2 + unmeasured
    sd = np.sqrt(leverage + own * np.maximum(1.0, leverage / baseline.leverage_max))
    np.fill_diagonal(covariance := shared.copy(), sd**2)
    outside = np.any(~absent & ((c < baseline.low) | (c > baseline.high)), axis=1)
    return Scores(
        corrected=series.estimate - centred @ slopes,
        residual=residual,
        residual_sd=sd,
        score=normal_score(residual / sd, fit.degrees_of_freedom),
        extrapolated=outside,
        missing=np.any(absent, axis=1),
        covariance=covariance,
    )
