"""Gaussian posteriors: what an estimate's spread is made of, and what the data did and did not tell.

Two spreads are reported of every estimate. *Noise only* is what repeated measurements on the same body would show. *Full*
adds the discrepancy between model and body, whose size is estimated from the residuals with a prior of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from fecore.arrays import FloatArray

_IDENTIFIABLE_INFORMATION = 0.5
_DISCREPANCY_DOF = 4.0
_NULL_SHARE = 0.9


@dataclass(frozen=True)
class Verdict:
    """What the data say of one parameter.

    Attributes:
        name: the parameter.
        identifiable: whether the data, rather than the prior, supply most of what is known of it.
        information: 1 - (posterior sd / prior sd)², from 0 (nothing learnt) to 1.
    """

    name: str
    identifiable: bool
    information: float


def verdicts(names: tuple[str, ...], prior_sd: FloatArray, posterior_sd: FloatArray) -> tuple[Verdict, ...]:
    """Identifiability of each parameter: the data tell more than half of what is known of it."""
    information = np.clip(1 - (posterior_sd / prior_sd) ** 2, 0, 1)
    return tuple(
        Verdict(name, bool(share > _IDENTIFIABLE_INFORMATION), float(share))
        for name, share in zip(names, information, strict=True)
    )


def null_directions(covariance: FloatArray, prior_sd: FloatArray) -> FloatArray:
    """(d, p) unit vectors, in prior standard deviations, along which more than 0.9 of the prior variance is left."""
    share, directions = np.linalg.eigh(covariance / np.outer(prior_sd, prior_sd))
    unseen: FloatArray = directions.T[share > _NULL_SHARE]
    return unseen


def interval_95(estimate: float, standard_deviation: float) -> tuple[float, float]:
    """Central 95 % interval of a Gaussian posterior."""
    reach = float(norm.ppf(0.975)) * standard_deviation
    return estimate - reach, estimate + reach


def discrepancy(relative_residual: FloatArray, fitted: float, prior: float) -> float:
    """Standard deviation of the relative model discrepancy, from residuals and its own prior.

    The mean of a scaled inverse χ² posterior for the variance, with ν₀ = 4 prior degrees of freedom at s₀:
    s² = (ν₀ s₀² + Σ r²) / (ν₀ + n - p). With five modes the residuals alone have one or two degrees of freedom.

    Args:
        relative_residual: (n,) residuals as shares of the measured values.
        fitted: p, number of parameters that the residuals determined.
        prior: s₀.
    """
    freedom = max(relative_residual.size - fitted, 0.0)
    total = _DISCREPANCY_DOF * prior**2 + float(np.sum(relative_residual**2))
    return float(np.sqrt(total / (_DISCREPANCY_DOF + freedom)))
