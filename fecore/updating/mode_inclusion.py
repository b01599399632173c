"""Whether each measured mode is one of the structure: its probability P before the update, and what
the model makes of it.

A mode that is none lies anywhere in the band. So the likelihood of the residual r = ln f_measured -
ln f is a mixture,

    P N(r; 0, σ²) + (1 - P)/W,      W = f_max/f: uniform from 0 Hz to the highest measured frequency, as a density of ln f,

and the posterior of the unknowns one over all sets of modes that may be real. Given the others,
mode k is real with w,

    w/(1 - w) = P W/(1 - P) · (p(all with k)/p(all without k) + π N(e; 0, σ_π²)),

the evidence with the unknowns and the discrepancy integrated out: the mode itself does not widen
what it is judged by. The second term is that of a real mode which the model misses by far, e from
what the others predict: of another material, boundary or length than stated. So a mode that is
certain is not taken for none where it contradicts a wrong model. The estimate is that of the
likeliest set, found anew in every turn of the fit (hard expectation maximisation): the data of a
mode with w < ½ have no weight. The posterior about it holds the sets that differ from it in one
mode, each with its Gaussians and by its odds. Where P = 1 for all, as where somebody typed the
modes in, nothing of this changes a result.
"""

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.updating.posterior import DISCREPANCY, LinearProblem, Mixture

FAR_OFF = 0.01  # π: of the modes, that the model misses by far more than its discrepancy
_THEN_BY = 0.05  # by how much then: as a wrong boundary, thickness or material does


def weights_of(
    problem: LinearProblem, probability: FloatArray, width: FloatArray, scatter: float
) -> FloatArray:
    """Find w of the frequencies of a problem, each given which of the others are taken for real.

    Args:
        problem: at an estimate, with the present weights.
        probability: (n,) P.
        width: (n,) W.
        scatter: the scatter τ between specimens.

    Returns:
        (n,) w, 1 where P is.
    """
    weights: FloatArray = np.ones(probability.size)
    for k in np.flatnonzero(probability < 1).tolist():
        none = problem.with_weight(k, 0.0)
        fits = (
            problem.with_weight(k, 1.0).log_evidence(scatter)
            - none.log_evidence(scatter)
            - np.log(2 * np.pi) / 2
        )
        real = np.logaddexp(fits, np.log(FAR_OFF) + _log_far_off(none, k, scatter))
        weights[k] = scipy.special.expit(_logit(probability[k]) + np.log(width[k]) + real)
    return weights


def _log_far_off(others: LinearProblem, k: int, scatter: float) -> float:
    """Ln N(e; 0, σ_π²) of a frequency that has no weight in a problem, the spread of its prediction
    included.
    """
    step, covariance = others.solve(DISCREPANCY, scatter)
    along = others.sensitivity[k]
    variance = others.noise[k, k] + _THEN_BY**2 + float(along @ covariance @ along)
    return float(
        -(np.log(2 * np.pi * variance) + (others.residual[k] - along @ step) ** 2 / variance) / 2
    )


def _logit(probability: FloatArray | float) -> FloatArray:
    with np.errstate(divide="ignore"):  # what is certain has infinite odds
        return np.asarray(scipy.special.logit(probability))


def over_sets(
    problem: LinearProblem, mode_inclusion: FloatArray, scatter_scale: float, given: Mixture
) -> Mixture:
    """The posterior about the estimate over which modes are real.

    Args:
        problem: at the estimate, of the likeliest set: weights 1 and 0.
        mode_inclusion: (n,) w of each mode.
        scatter_scale: of the scatter between specimens; 0 for none.
        given: the posterior of that set, which is all where there is no doubt.
    """
    doubted = np.flatnonzero(mode_inclusion < 1).tolist()
    if not doubted:
        return given
    other = np.abs(problem.weights - mode_inclusion)[doubted]  # probability of the other verdict
    share = np.concatenate([[1.0], other / np.maximum(1 - other, 1e-300)])
    sets = [
        problem.with_weight(k, 1 - problem.weights[k]).mixture(scatter_scale)[0] for k in doubted
    ]
    return Mixture.joined(
        share / share.sum(), np.zeros((share.size, problem.x.size)), [given, *sets]
    )


def spurious_mode_penalty(
    weights: FloatArray, probability: FloatArray, width: FloatArray, discrepancy: float
) -> float:
    """In log evidence, what modes cost that are taken for none: the density of the band beside that
    of a mode that fits.
    """
    off = weights < 1
    fits = _logit(probability[off]) + np.log(width[off]) - np.log(2 * np.pi * discrepancy**2) / 2
    return float((1 - weights[off]) @ np.maximum(fits, 0.0))
