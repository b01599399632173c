"""Do the campaigns agree? Each one's frequencies against what the others foretell, and each one's constants against theirs.

Posterior predictive check, each campaign left out in turn (Gelman et al., Bayesian Data Analysis, 3rd ed., 6.3). Given the
others, the stacked frequencies f_c of campaign c are Gaussian about their prediction with covariance V = N_c + s² + S_c C S_cᵀ,
its own nuisances at their priors, so

    T = eᵀV⁻¹e ~ χ²(n_c),        p_c = Σ_m w_m P(χ² > T_m)

over the others' posterior of discrepancy and scatter. A small p_c says that the campaign is not of this material, or that one
of its inputs is further off than stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.updating.elastic_result import ElasticResult

CONTRADICTS = 0.01
"""Posterior predictive p, over the number of campaigns, below which a campaign contradicts the others."""


@dataclass(frozen=True)
class Agreement:
    """One campaign beside the others.

    Attributes:
        predictive_p: probability of frequencies further from the others' prediction than measured; None of a single campaign.
        alone: (q,) coordinates' deviations of the material's parameters by this campaign alone.
        alone_sd: (q,) their standard deviations.
        z: (q,) of alone against all together, in standard deviations of the difference; 0 where the campaign says nothing.
    """

    predictive_p: float | None
    alone: FloatArray
    alone_sd: FloatArray
    z: FloatArray


def agreements(elastic: ElasticResult, scatter_scale: float) -> tuple[Agreement, ...]:
    """Of each campaign in its order."""
    return tuple(_agreement(elastic, number, scatter_scale) for number in range(len(elastic.rows)))


def odd_one_out(elastic: ElasticResult, found: Sequence[Agreement], scatter_scale: float) -> int | None:
    """Number of the campaign without which the others agree best; None where none contradicts, or there are but two."""
    values = [each.predictive_p for each in found if each.predictive_p is not None]
    if len(values) < 3 or min(values) >= CONTRADICTS / len(values):
        return None
    without = []
    for number in range(len(values)):
        rest = [other for other in range(len(values)) if other != number]
        without.append(min(predictive_p(elastic, other, rest, scatter_scale) for other in rest))
    return int(np.argmax(without))


def predictive_p(elastic: ElasticResult, number: int, among: Sequence[int], scatter_scale: float) -> float:
    """Posterior predictive p of a campaign, given the others among some."""
    problem, at = elastic.problem, elastic.rows[number]
    others = problem.only(_rows_of(elastic, [other for other in among if other != number]))
    mixture, _ = others.mixture(scatter_scale)
    S, residual, noise = problem.sensitivity[at], problem.residual[at], problem.noise[at, at]
    weights = problem.weights[at]
    missed = np.sqrt(weights) * (residual - mixture.shift @ S.T)
    spanned = noise + mixture.scale[:, None, None] ** 2 * np.eye(residual.size) + S @ mixture.covariance @ S.T
    distance = np.sum(missed * np.linalg.solve(spanned, missed[..., None])[..., 0], axis=1)
    return float(mixture.weight @ scipy.special.chdtrc(float(weights.sum()), distance))


def _agreement(elastic: ElasticResult, number: int, scatter_scale: float) -> Agreement:
    problem, q = elastic.problem, len(elastic.layout.shared)
    everyone = range(len(elastic.rows))
    p = predictive_p(elastic, number, everyone, scatter_scale) if len(elastic.rows) > 1 else None
    alone = problem.only(_rows_of(elastic, [number]))
    step, covariance = alone.solve(elastic.discrepancy, elastic.scatter)
    variance, joint = np.diag(covariance)[:q], np.diag(elastic.inverse)[:q]
    apart = np.sqrt(np.maximum(variance - joint, 1e-12 * variance))
    informed = joint < 0.999 * variance
    return Agreement(p, elastic.x[:q] + step[:q], np.sqrt(variance), np.where(informed, step[:q] / apart, 0.0))


def _rows_of(elastic: ElasticResult, numbers: Sequence[int]) -> BoolArray:
    keep = np.zeros(elastic.problem.residual.size, dtype=bool)
    for number in numbers:
        keep[elastic.rows[number]] = True
    return keep
