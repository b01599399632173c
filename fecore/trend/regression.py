"""Weighted regression of estimates that scatter by more than their own uncertainty.

    y = Xβ + ε,  Var ε_i = s_i² + τ²

s_i is each point's own standard deviation, τ the scatter between campaigns (clamping, instruments), which is not known
and comes from the residuals. With s̄ the harmonic mean of the s_i, the total variance v = τ² + s̄² has the restricted
likelihood of the residuals, with the s_i in proportion smaller where v < s̄², and a prior uniform in log v: what Student's t
stands for. A true v below s̄² there cannot be, so what the posterior has there lies on s̄² (a confidence distribution with a
point mass at the bound: Schweder and Hjort 2016). The mean of the precision 1/v gives the total variance and its spread the
degrees of freedom of a t distribution (Satterthwaite's matching): ν = 2 E[1/v]² / Var[1/v].

Cutting only moves v up, so charts call no more often than with Student's t, whatever τ is. A prior on τ ≥ 0, as one with
some weight on τ = 0, calls more often where τ is near the s_i: 1.3 times as often with half a decade of weight.

The two ends are the textbook's: where the s_i vanish, v = RSS/(n − p) and ν = n − p, Student's t; where they explain all
scatter, ν is large and intervals are normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.errors import InputError

_GRID = 400  # points of log v; the posterior is smooth over a decade
_LEAST, _WIDEST = 1e-2, 1e4  # of v on the grid, in units of the smallest and the largest plausible variance
_NEGLIGIBLE = 1e-4  # scatter of residuals over s̄² from which less makes no difference
_NORMAL = 1000.0  # more degrees of freedom than this are taken as a normal distribution


@dataclass(frozen=True)
class RegressionFit:
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


def fit_with_scatter(X: FloatArray, y: FloatArray, s: FloatArray) -> RegressionFit:
    """Fit β and τ.

    Args:
        X: (n, p) regressors.
        y: (n,) estimates.
        s: (n,) their own standard deviations, positive.

    Raises:
        InputError: fewer than p + 2 points, or regressors that the points do not separate.
    """
    n, p = X.shape
    if n < p + 2:
        raise InputError("points", f"{n} points for {p} coefficients and their scatter, expected at least {p + 2}")
    if np.linalg.matrix_rank(X / np.maximum(np.abs(X).max(axis=0), 1e-300)) < p:
        raise InputError("covariates", "the points do not separate the regressors (a constant or repeated covariate)")
    harmonic = float(1 / np.mean(1 / s**2))
    ordinary = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    seen = float(ordinary @ ordinary) / (n - p)
    v = np.geomspace(_LEAST * max(seen, _NEGLIGIBLE * harmonic), _WIDEST * max(seen, harmonic), _GRID)
    share, between_variance = np.minimum(v / harmonic, 1.0), np.maximum(v - harmonic, 0.0)
    log_likelihood = _restricted_likelihood(X, ordinary, share[:, None] * s**2 + between_variance[:, None])
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    precision = 1 / np.maximum(v, harmonic)
    mean = float(weight @ precision)
    spread = float(weight @ (precision - mean) ** 2)
    total = 1 / mean
    between = max(total - harmonic, 0.0)
    beta, covariance = _generalised_least_squares(X, y, s**2 + between)
    own = y - X @ _generalised_least_squares(X, y, s**2)[0]
    return RegressionFit(
        beta,
        covariance,
        float(np.sqrt(between)),
        total,
        min(2 * mean**2 / spread, _NORMAL) if spread > 0 else _NORMAL,
        float(scipy.special.chdtr(n - p, np.sum((own / s) ** 2))),
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
