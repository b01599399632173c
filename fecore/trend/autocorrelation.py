"""Campaigns that resemble their neighbours: lag-1 autocorrelation of a baseline, and limits that hold in spite of it.

Scores of an unchanged structure are taken as independent when limits are set (run_length.py). Where what is left after the
covariates follows an autoregression

    e_i = φ e_{i−1} + √(1 − φ²) u_i,   Corr(e_i, e_j) = φ^(|t_i − t_j| / Δ),   Δ the usual time between campaigns

the chart's value scatters more, the baseline's mean is known less, and its scatter is seen too small: all call more often.

**φ of a short baseline.** The usual estimate Σ e_i e_{i−1} / Σ e_i² of 12 campaigns is off by −(1 + 3φ)/n and scatters by 0.3
(Kendall 1954, Marriott and Pope 1954), so no single value is taken: the restricted likelihood of the residuals, which has no
such bias, on a grid of φ, times a prior. The prior has `_NONE` of its weight on φ = 0, as most series of a laboratory are, and
falls as (1 − φ) above it; negative φ calls less often and counts as none.

**Limits.** Series of a baseline and the campaigns after it are simulated for each φ, judged as `score` and the chart do, and each
gives the least factor κ of both limits at which it is not called within the horizon. The limits are widened by the κ at which
the weighted probability of a call is what it is at κ = 1 for φ = 0. The same random numbers serve every φ, so what the
simulation lacks in numbers mostly cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fecore.arrays import FloatArray
from fecore.trend.charts import Chart, Limits
from fecore.trend.deviates import normal_score

GRID = np.arange(10) / 10
"""φ for which series are simulated."""

_NONE = 0.4  # weight of φ = 0 before the data
_SERIES = 6000  # simulated ones: a probability of 10 % is known to 0.4 %
_SEED = 20_261_122


@dataclass(frozen=True)
class Autocorrelation:
    """What a baseline says of φ.

    Attributes:
        weights: (10,) probability of each φ of `GRID`.
        interval_days: Δ, to which φ belongs.
    """

    weights: FloatArray
    interval_days: float

    @property
    def mean(self) -> float:
        """Expected φ."""
        return float(self.weights @ GRID)

    @property
    def interval_95(self) -> tuple[float, float]:
        """φ between which 95 % of the probability lies."""
        below = np.cumsum(self.weights)
        return float(GRID[np.searchsorted(below, 0.025)]), float(GRID[np.searchsorted(below, 0.975)])


def diagnose(X: FloatArray, y: FloatArray, sd: FloatArray, days: FloatArray) -> Autocorrelation:
    """φ of the campaigns of a baseline.

    Args:
        X: (n, p) regressors of the baseline.
        y: (n,) estimates.
        sd: (n,) standard deviation of each, the scatter between campaigns included.
        days: (n,) when they were, increasing.
    """
    X, y = X / sd[:, None], y / sd
    n, p = X.shape
    usual = float(np.median(np.diff(days)))
    apart = np.abs(days[:, None] - days) / usual
    likelihood = np.empty(GRID.size)
    for k, phi in enumerate(GRID):
        inverse = np.linalg.inv(phi**apart)
        information = X.T @ inverse @ X
        right = X.T @ inverse @ y
        misfit = float(y @ inverse @ y - right @ np.linalg.solve(information, right))
        likelihood[k] = 0.5 * (
            np.linalg.slogdet(inverse)[1] - np.linalg.slogdet(information)[1] - (n - p) * np.log(misfit)
        )
    weights = np.exp(likelihood - likelihood.max()) * _prior()
    return Autocorrelation(weights / weights.sum(), usual)


def _prior() -> FloatArray:
    falling = 1 - GRID[1:]
    return np.concatenate([[_NONE], (1 - _NONE) * falling / falling.sum()])


def widened(
    limits: Limits,
    chart: Chart,
    found: Autocorrelation,
    *,
    baseline: int,
    covariates: int,
    campaigns: int,
    pending: int,
) -> tuple[Limits, float]:
    """Limits that are called as often as stated under what is known of φ, and the factor κ by which they are wider.

    Args:
        limits: for independent scores.
        chart: kind and constants.
        found: what the baseline says of φ.
        baseline: campaigns in it.
        covariates: how many are regressed out.
        campaigns: H, after the baseline.
        pending: consecutive campaigns outside that make an alarm.
    """
    table = _factors(chart, limits, baseline, covariates, campaigns, pending)
    stated = _called(table[0], 1.0)
    if stated == 0:
        return limits, 1.0
    low, high = 1.0, float(table[:, -1].max())
    for _ in range(30):
        middle = (low + high) / 2
        called = sum(w * _called(row, middle) for w, row in zip(found.weights, table, strict=True))
        low, high = (middle, high) if called > stated else (low, middle)
    return Limits(limits.chart * high, limits.score * high), high


def _called(factors: FloatArray, limit: float) -> float:
    """Share of the series that need a wider limit than this; `factors` is in order."""
    return 1 - float(np.searchsorted(factors, limit, side="right")) / factors.size


@lru_cache(maxsize=32)
def _factors(chart: Chart, limits: Limits, baseline: int, covariates: int, campaigns: int, pending: int) -> FloatArray:
    """(10, series) for each φ, in order: the factor of the limits at which each simulated series is just not called."""
    rng = np.random.default_rng(_SEED)
    length, p = baseline + campaigns, 1 + covariates
    innovation = rng.standard_normal((length, _SERIES))
    X = np.concatenate([np.ones((_SERIES, length, 1)), rng.standard_normal((_SERIES, length, covariates))], axis=2)
    base, later = X[:, :baseline], X[:, baseline:]
    inverse = np.linalg.inv(base.swapaxes(1, 2) @ base)
    solve = inverse @ base.swapaxes(1, 2)
    leverage = np.einsum("sij,sjk,sik->si", later, inverse, later)
    a, b, c = chart.recursion
    rows = []
    for phi in GRID:
        errors = innovation.copy()
        for i in range(1, length):
            errors[i] = phi * errors[i - 1] + np.sqrt(1 - phi**2) * innovation[i]
        seen, ahead = errors[:baseline].T[..., None], errors[baseline:].T[..., None]
        beta = solve @ seen
        left = (seen - base @ beta)[..., 0]
        variance = np.sum(left**2, axis=1, keepdims=True) / (baseline - p)
        scores = normal_score((ahead - later @ beta)[..., 0] / np.sqrt(variance * (1 + leverage)), baseline - p)
        value = np.zeros(_SERIES)
        reach = np.empty((campaigns, _SERIES))
        for i in range(campaigns):
            value = np.maximum(0.0, a * value + b * scores[:, i] - c)
            reach[i] = np.maximum(value / limits.chart, scores[:, i] / limits.score)
        in_a_row = np.min([reach[k : campaigns - pending + 1 + k] for k in range(pending)], axis=0)
        rows.append(np.sort(in_a_row.max(axis=0)))
    return np.array(rows)
