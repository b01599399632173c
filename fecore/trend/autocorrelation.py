"""Campaigns that resemble their neighbours: lag-1 autocorrelation of a baseline, and limits that
hold in spite of it.

Scores of an unchanged structure are taken as independent when limits are set (charts.py). Where
what is left after the covariates follows an autoregression

    e_i = φ e_{i−1} + √(1 − φ²) u_i,   Corr(e_i, e_j) = φ^(|t_i − t_j| / Δ),   Δ the usual time between campaigns

the chart's value scatters more, the baseline's mean is known less, and its scatter is seen too
small: all call more often.

**φ of a short baseline.** The usual estimate Σ e_i e_{i−1} / Σ e_i² of 12 campaigns is off by −(1 +
3φ)/n and scatters by 0.3 (Kendall 1954, Marriott and Pope 1954), so no single value is taken: the
restricted likelihood of the residuals, which has no such bias, on a grid of φ, times a prior. The
prior has `_NONE` of its weight on φ = 0 and is flat above it; negative φ calls less often and
counts as none. With a fifth on φ = 0 an EWMA of one parameter with 12 campaigns in the baseline
gives 0.46 times as many false alarms as stated where campaigns are independent and 1.20 times where
φ = 0.5 (1.00 and 2.44 without; 2,500 series, standard error 0.04); with two fifths 0.61 and 1.36,
with three 0.74 and 1.54. A prior moves both together. Neither does it help to take limits from
series whose baselines look like this one, scatter and all (a ratio of 4 between the two, as here,
for two parameters); one φ for two parameters would bring that ratio from 3.6 to 2.9, and takes for
granted that they share it.

**Limits.** Series of a baseline and the campaigns after it are simulated for each φ and judged as
`score` and the chart do; each gives the least factor κ of both limits at which it is not called
within the horizon. The limits are widened by the κ at which the weighted probability of a call is
what it is at κ = 1 for φ = 0. The same random numbers serve every φ, so what the simulation lacks
in numbers mostly cancels.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.trend.charts import Chart, Limits

# t up to 10⁶, closest about 0: linear between is exact to 2e-5
_NODES = np.sinh(np.linspace(0, 14.5, 2901))


def normal_score(t: FloatArray, degrees_of_freedom: float) -> FloatArray:
    """Φ⁻¹(T_ν(t)), from the nearer tail so that a large deviate keeps its digits."""
    tail = np.maximum(scipy.special.stdtr(degrees_of_freedom, -np.abs(t)), 1e-300)
    return np.asarray(-np.sign(t) * scipy.special.ndtri(tail))


def simulated_scores(t: FloatArray, degrees_of_freedom: float) -> FloatArray:
    """The same of many simulated deviates, from a table: a tenth of the time, within 2e-5 up to |t|
    = 10⁶.
    """
    return np.copysign(np.interp(np.abs(t), _NODES, _table(degrees_of_freedom)), t)


@lru_cache(maxsize=64)
def _table(degrees_of_freedom: float) -> FloatArray:
    return normal_score(_NODES, degrees_of_freedom)


GRID = np.arange(10) / 10  # φ for which series are simulated
_NONE = 0.2  # weight of φ = 0 before the data
_SERIES = 4000  # simulated ones: a probability of 10 % is known to 0.5 %
_SEED = 20_261_122  # of the simulated series: limits are the same whenever they are found
_SLOWEST = 0.9  # lag-1 correlation of a wave that goes round once in 14 campaigns
_EXACT = 1e-9  # misfit in variances below which equal values say nothing of φ
_PHASE = 0.4  # of the first wave, so that none is taken where it is zero


@dataclass(frozen=True)
class Autocorrelation:
    """What a baseline says of φ."""

    weights: FloatArray  # (10,) probability of each φ of `GRID`
    interval_days: float  # Δ, to which φ belongs
    campaigns: int  # n, in the baseline
    # lag-1 correlation of each covariate along the baseline, to a quarter
    covariates: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Expected φ."""
        return float(self.weights @ GRID)

    @property
    def interval_95(self) -> tuple[float, float]:
        """φ between which 95 % of the probability lies."""
        below = np.cumsum(self.weights)
        return float(GRID[np.searchsorted(below, 0.025)]), float(
            GRID[np.searchsorted(below, 0.975)]
        )


def diagnose(X: FloatArray, y: FloatArray, sd: FloatArray, days: FloatArray) -> Autocorrelation:
    """φ of the campaigns of a baseline.

    Args:
        X: (n, p) regressors of the baseline.
        y: (n,) estimates.
        sd: (n,) standard deviation of each, the scatter between campaigns included.
        days: (n,) when they were, increasing.
    """
    colours = tuple(_colour(column) for column in X.T[1:])
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
            np.linalg.slogdet(inverse)[1]
            - np.linalg.slogdet(information)[1]
            - (n - p) * np.log(max(misfit, _EXACT))
        )
    weights = np.exp(likelihood - likelihood.max()) * _prior()
    return Autocorrelation(weights / weights.sum(), usual, n, colours)


def _colour(covariate: FloatArray) -> float:
    """Lag-1 correlation of a covariate, to a quarter, between the fastest and the slowest wave that
    a baseline can show.
    """
    c = covariate - covariate.mean()
    lag_1 = float(c[1:] @ c[:-1]) / max(float(c @ c), 1e-300)
    return float(np.clip(np.round(4 * lag_1) / 4, -0.5, _SLOWEST))


def _prior() -> FloatArray:
    return np.concatenate([[_NONE], np.full(GRID.size - 1, (1 - _NONE) / (GRID.size - 1))])


def widened(
    limits: Limits, chart: Chart, autocorrelation: Autocorrelation, *, campaigns: int, pending: int
) -> tuple[Limits, float]:
    """Limits that are called as often as stated under what is known of φ, and the factor κ by which
    they are wider.

    Args:
        limits: for independent scores.
        chart: kind and constants.
        autocorrelation: what the baseline says of φ.
        campaigns: H, after the baseline.
        pending: consecutive campaigns outside that make an alarm.
    """
    table = _factors(
        chart, limits, autocorrelation.campaigns, autocorrelation.covariates, campaigns, pending
    )
    stated = _called(table[0], 1.0)
    low, high = 1.0, float(table[:, -1].max())
    if stated == 0 or high <= low:
        return limits, 1.0
    for _ in range(30):
        middle = (low + high) / 2
        called = sum(
            w * _called(row, middle) for w, row in zip(autocorrelation.weights, table, strict=True)
        )
        low, high = (middle, high) if called > stated else (low, middle)
    return Limits(limits.chart * high, limits.score * high), high


def _called(factors: FloatArray, limit: float) -> float:
    """Share of the series that need a wider limit than this; `factors` is in order."""
    return 1 - float(np.searchsorted(factors, limit, side="right")) / factors.size


@lru_cache(maxsize=32)
def _factors(
    chart: Chart,
    limits: Limits,
    baseline: int,
    covariates: tuple[float, ...],
    campaigns: int,
    pending: int,
) -> FloatArray:
    """(10, series) for each φ, in order: the factor of the limits at which each simulated series is
    just not called.

    Each covariate is a wave with the lag-1 correlation of the real one: where it runs in seasons as
    the errors do, its slope is known less, which a white covariate would not show. It goes on after
    the baseline as in it.
    """
    n, p = baseline, 1 + len(covariates)
    angles = np.arccos(np.array(covariates))[None, :] * np.arange(n)[
        :, None
    ] + 0.5 * np.pi * np.arange(p - 1)
    base = np.column_stack([np.ones(n), np.cos(angles + _PHASE)])
    later = base[np.arange(n, n + campaigns) % n]
    inverse = np.linalg.inv(base.T @ base)
    expand = np.sqrt(1 + np.einsum("ij,jk,ik->i", later, inverse, later))[:, None]
    projection = inverse @ base.T
    innovation = np.random.default_rng(_SEED).standard_normal((n + campaigns, _SERIES))
    a, b, c = chart.recursion
    rows = []
    for phi in GRID:
        errors = innovation.copy()
        for i in range(1, n + campaigns):
            errors[i] = phi * errors[i - 1] + np.sqrt(1 - phi**2) * innovation[i]
        beta = projection @ errors[:n]
        sd = np.sqrt(np.sum((errors[:n] - base @ beta) ** 2, axis=0) / (n - p))
        scores = simulated_scores((errors[n:] - later @ beta) / (sd * expand), n - p)
        value = np.zeros(_SERIES)
        reach = np.empty_like(scores)
        for i in range(campaigns):
            value = np.maximum(0.0, a * value + b * scores[i] - c)
            reach[i] = np.maximum(value / limits.chart, scores[i] / limits.score)
        in_a_row = np.min([reach[k : campaigns - pending + 1 + k] for k in range(pending)], axis=0)
        rows.append(np.sort(in_a_row.max(axis=0)))
    return np.array(rows)
