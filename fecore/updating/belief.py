"""Whether each measured mode is one of the structure: its probability P before the update, and what the model makes of it.

A mode that is none lies anywhere in the band. So the likelihood of the residual r = ln f_measured - ln f is a mixture,

    P N(r; 0, σ²) + (1 - P)/W,      W = f_max/f: uniform from 0 Hz to the highest measured frequency, as a density of ln f,

and the posterior of the unknowns one over all sets of modes that may be real. Given the others, mode k is real with w,

    w/(1 - w) = P W/(1 - P) · p(all with k)/p(all without k),

the evidence with the unknowns and the discrepancy integrated out: the mode itself does not widen what it is judged by. The fit
weighs the data of mode k by w and finds w anew in every turn (expectation maximisation; Dempster, Laird and Rubin 1977). The
posterior about the estimate is that of the likeliest set of modes and of those that differ from it in one mode, each with its
Gaussians and by its odds. Where P = 1 for all, as where somebody typed the modes in, nothing of this changes a result.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.updating.posterior import LinearProblem, Mixture


def weights_of(problem: LinearProblem, probability: FloatArray, width: FloatArray, scatter: float) -> FloatArray:
    """Find w of the frequencies of a problem, each given the weights of the others.

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
        real, none = (problem.with_weight(k, w).log_evidence(scatter) for w in (1.0, 0.0))
        odds = _logit(probability[k]) + np.log(width[k]) + real - none - np.log(2 * np.pi) / 2
        weights[k] = scipy.special.expit(odds)
    return weights


def _logit(probability: FloatArray | float) -> FloatArray:
    with np.errstate(divide="ignore"):  # what is certain has infinite odds
        return np.asarray(scipy.special.logit(probability))


def over_sets(problem: LinearProblem, scatter_scale: float, given: Mixture) -> Mixture:
    """The posterior about the estimate over which modes are real: the likeliest set, and those that differ in one mode.

    `given`, that of the problem with its weights, where there is no doubt.
    """
    weights = problem.weights
    open_to_doubt = np.flatnonzero(weights < 1)
    if not open_to_doubt.size:
        return given
    likeliest = np.round(weights)
    sets = np.tile(likeliest, (1 + open_to_doubt.size, 1))
    sets[1 + np.arange(open_to_doubt.size), open_to_doubt] = 1 - likeliest[open_to_doubt]
    held = np.abs(likeliest - weights)[open_to_doubt]  # probability of the other verdict
    share = np.concatenate([[1.0], held / (1 - held)])
    parts = [replace(problem, weight=chosen).mixture(scatter_scale)[0] for chosen in sets]
    return Mixture.joined(share / share.sum(), np.zeros((len(parts), problem.x.size)), parts)


def stray_cost(weights: FloatArray, probability: FloatArray, width: FloatArray, spread: float) -> float:
    """In log evidence, what modes cost that are taken for none: the density of the band beside that of a mode that fits."""
    off = weights < 1
    fits = _logit(probability[off]) + np.log(width[off]) - np.log(2 * np.pi * spread**2) / 2
    return float((1 - weights[off]) @ np.maximum(fits, 0.0))
