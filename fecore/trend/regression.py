"""Weighted regression of estimates that scatter by more than their own uncertainty.

    y = Xβ + ε,  Var ε_i = s_i² + τ²

s_i is each point's own standard deviation, τ the scatter between campaigns (clamping, instruments), which is not known
and comes from the residuals: with the restricted likelihood of τ² and a prior on v = τ² + s̄² (s̄ the harmonic mean of the
s_i), the posterior of the precision 1/v is found on a grid. Its mean gives the total variance and its spread the degrees
of freedom of a t distribution (Satterthwaite's matching): ν = 2 E[1/v]² / Var[1/v]. The prior is uniform in log v, with an
atom at τ = 0 that weighs as much as half a decade: without the atom twelve campaigns that scatter by their own s_i alone
would be given 1.5 times that variance.

The two ends are the textbook's: where the s_i vanish, v = RSS/(n − p) and ν = n − p, Student's t; where they explain all
scatter, ν is large and intervals are normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from fecore.arrays import FloatArray
from fecore.errors import InputError

_GRID = 400  # points of log v; the posterior is smooth over a decade
_ATOM = 0.5 * np.log(10)  # weight of τ = 0 in units of log v: half a decade
_WIDEST = 1e4  # largest v on the grid, in units of the largest plausible variance
_NORMAL = 1000.0  # more degrees of freedom than this are not told from a normal distribution


@dataclass(frozen=True)
class Fit:
    """A regression and what it does not know.

    Attributes:
        coefficients: (p,) β.
        covariance: (p, p) of β, the scatter τ included.
        between_sd: τ, standard deviation between campaigns.
        total_variance: v = τ² + s̄².
        degrees_of_freedom: ν of the t distribution that stands for the uncertainty of v.
        excess: p-value of Σ (residual / s_i)² being as small as it is if the s_i were all the scatter there is; near 0
            where the stated standard deviations are larger than the scatter that is seen.
    """

    coefficients: FloatArray
    covariance: FloatArray
    between_sd: float
    total_variance: float
    degrees_of_freedom: float
    excess: float


def fit_with_scatter(X: FloatArray, y: FloatArray, s: FloatArray) -> Fit:
    """Fit β and τ.

    Args:
        X: (n, p) regressors.
        y: (n,) estimates.
        s: (n,) their own standard deviations, positive.

    Raises:
        InputError: fewer than p + 2 points, or regressors that the points do not tell apart.
    """
    n, p = X.shape
    if n < p + 2:
        raise InputError("points", f"{n} points for {p} coefficients and their scatter, expected at least {p + 2}")
    if np.linalg.matrix_rank(X / np.maximum(np.abs(X).max(axis=0), 1e-300)) < p:
        raise InputError("covariates", "the points do not tell the regressors apart (a constant or repeated covariate)")
    harmonic = float(1 / np.mean(1 / s**2))
    ordinary = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    widest = _WIDEST * max(float(ordinary @ ordinary) / (n - p), harmonic)
    lowest = max(harmonic, 1e-8 * widest / _WIDEST)
    v = np.geomspace(lowest, widest, _GRID)
    log_likelihood = _restricted_likelihood(X, ordinary, s**2 + (v - harmonic)[:, None])
    prior = np.full(_GRID, np.log(widest / lowest) / _GRID)
    prior[0] += _ATOM * (lowest == harmonic)
    weight = prior * np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    mean = float(weight @ (1 / v))
    spread = float(weight @ (1 / v - mean) ** 2)
    total = 1 / mean
    between = max(total - harmonic, 0.0)
    beta, covariance = _generalised_least_squares(X, y, s**2 + between)
    own = y - X @ _generalised_least_squares(X, y, s**2)[0]
    return Fit(
        beta,
        covariance,
        float(np.sqrt(between)),
        total,
        min(2 * mean**2 / spread, _NORMAL) if spread > 0 else _NORMAL,
        float(stats.chi2.cdf(np.sum((own / s) ** 2), n - p)),
    )


def _generalised_least_squares(X: FloatArray, y: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    weighted = X / variance[:, None]
    covariance = np.linalg.inv(X.T @ weighted)
    return covariance @ (weighted.T @ y), covariance


def _restricted_likelihood(X: FloatArray, y: FloatArray, variance: FloatArray) -> FloatArray:
    """(G,) logarithm of the likelihood of the residuals with β integrated out, for (G, n) variances."""
    weighted = X.T[None] / variance[:, None, :]
    information = weighted @ X
    right = weighted @ y
    explained = np.einsum("gi,gi->g", right, np.linalg.solve(information, right[..., None])[..., 0])
    log_determinant = np.linalg.slogdet(information)[1]
    misfit = (1 / variance) @ y**2 - explained
    return np.asarray(-0.5 * (log_determinant + np.log(variance).sum(axis=1) + misfit))
