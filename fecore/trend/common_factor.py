"""Do the residuals of the baselines move together? A covariate that was not recorded does that.

Let R (q, q) be the correlation matrix of the residuals of q parameters in the same n campaigns, p
coefficients regressed out, N = n - p. Of independent parameters

    -(N - (2q + 5)/6) ln|R| ~ χ²,  q(q - 1)/2 degrees of freedom

(Bartlett, J. R. Statist. Soc. B 16, 1954). Estimates of one update share the noise of its
frequencies, so this alone proves nothing. Along the first principal direction w, noise of standard
deviations s_j in units of each parameter's scatter has a variance of (Σ |w_j| s_j)² at most,
however it is correlated. Only where the variance λ₁ exceeds that too, N λ₁ against χ² of N degrees
of freedom, is there a factor that the covariates do not explain. Each test has the level
`FALSE_ALARMS`, so both together say it wrongly no more often.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.trend.baseline import Baseline
from fecore.trend.series import Series, select

# probability that residuals are said to move together where each parameter scatters by itself
FALSE_ALARMS = 0.05


@dataclass(frozen=True)
class CommonFactor:
    """One direction in which the residuals of the baselines move together."""

    share: float  # of the residuals' variance, each parameter in units of its own scatter
    weights: FloatArray  # (q,) the direction, of length 1, its largest component positive
    p: float  # probability of residuals that are correlated as strongly by chance


def common_factor(baselines: Sequence[tuple[Series, Baseline]]) -> CommonFactor | None:
    """The factor that the parameters' baselines share; None where the residuals do not show one.

    Args:
        baselines: each parameter's series and its baseline, of the same covariates. Parameters
            whose baseline has other campaigns than the first one's are left out.
    """
    alike = [(series, base) for series, base in baselines if base.labels == baselines[0][1].labels]
    if len(alike) < 2:
        return None
    residual, noise = (
        np.column_stack(columns)
        for columns in zip(*(_residuals(*one) for one in alike), strict=True)
    )
    n, q = residual.shape
    free = n - 1 - len(alike[0][1].covariates)
    if free <= q or np.any(np.ptp(residual, axis=0) == 0):  # R is singular
        return None
    scatter = np.sqrt(np.sum(residual**2, axis=0) / free)
    correlation = residual.T @ residual / free / np.outer(scatter, scatter)
    variances, directions = np.linalg.eigh(correlation)
    w = directions[:, -1]
    statistic = -(free - (2 * q + 5) / 6) * np.linalg.slogdet(correlation)[1]
    p = float(scipy.special.chdtrc(q * (q - 1) / 2, max(statistic, 0.0)))
    most = float(np.mean((noise / scatter @ np.abs(w)) ** 2))
    beyond = float(scipy.special.chdtrc(free, free * variances[-1] / most))
    if max(p, beyond) > FALSE_ALARMS:
        return None
    return CommonFactor(float(variances[-1] / q), w * np.sign(w[np.argmax(np.abs(w))]), p)


def _residuals(series: Series, baseline: Baseline) -> tuple[FloatArray, FloatArray]:
    """(n,) residuals of a baseline's own campaigns, and their stated standard deviations."""
    place = {label: i for i, label in enumerate(series.labels)}
    base = select(series, [place[label] for label in baseline.labels])
    centred = base.measured(baseline.covariates) - baseline.centre
    expected = baseline.mean + centred @ baseline.fit.coefficients[1:]
    return base.estimate - expected, base.standard_deviation
