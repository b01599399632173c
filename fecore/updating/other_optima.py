"""Other constants that meet the same frequencies with the same partners.

As those of two springs below a body that is nearly symmetric: exchanged, the frequencies stay
nearly the same, and each of the two points is a minimum of the misfit. Shapes say which one it is.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.elastic import Misfit, Unsettled, fit_elastic
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.layout import Layout

# of a step by which the shapes alone lower their misfit: from so many standard deviations on they
# choose other constants
_ELSEWHERE = 4.0
_REACH = 2.0  # of the prior's standard deviations: constants that are tried
# largest rms miss of the frequencies from which constants that are exchanged are fitted anew
_NEARLY_ALIKE = 0.05
_EXCHANGED = 3  # of such starts
_APART = 3.0  # standard deviations between two results that are two


def by_shapes_too(outcome: ElasticResult | Unsettled, layout: Layout) -> list[FloatArray]:
    """Where frequencies and shapes together lead from a result to which the shapes object.

    The shapes object where a step that they and the prior alone take lowers their misfit by far
    more than it would by chance: gᵀ(JᵀJ + P)⁻¹g with J the derivative of the shapes' residuals and
    g = Jᵀm their descent, which has the mean 1 for each constant that they determine.
    """
    if isinstance(outcome, Unsettled):
        return []
    misfit = Misfit(replace(outcome.layout, coupons=()), use_shapes=True)
    at = outcome.states, outcome.pairings
    errors = misfit.shape_errors(*at, outcome.discrepancy)
    problem = misfit.linear(outcome.x, *at, outcome.weights, errors, misfit.by_shear(*at))
    information = problem.others["mode shapes"] + outcome.layout.precision(outcome.scatter)
    descent = problem.other_descent
    if descent @ np.linalg.solve(information, descent) < _ELSEWHERE**2:
        return []
    guided = fit_elastic(layout, use_shapes=True, start=outcome.x)
    if isinstance(guided, Unsettled) or _distance(guided.x - outcome.x, outcome) < _APART:
        return []
    return [guided.x]


def with_constants_exchanged(result: ElasticResult, layout: Layout) -> list[FloatArray]:
    """A result's x with two constants of one unit exchanged, where the frequencies stay nearly the
    same: the nearest first.
    """
    prior, count = layout.prior, len(layout.shared)
    theta, sd = layout.material(result.x), np.sqrt(np.diag(result.inverse))
    reach = _REACH * layout.sd(layout.scatter)
    near: list[tuple[float, FloatArray]] = []
    for i, j in combinations(range(count), 2):
        logarithmic = prior.logarithmic[i] and prior.logarithmic[j]
        if not logarithmic or prior.unit_of(layout.shared[i]) != prior.unit_of(layout.shared[j]):
            continue
        apart, x = np.log(theta[j] / theta[i]), result.x.copy()
        x[i], x[j] = x[i] + apart, x[j] - apart
        changed = result.problem.residual - result.problem.sensitivity @ (x - result.x)
        if abs(apart) > _APART * max(sd[i], sd[j]) and np.all(np.abs(x) <= reach):
            near.append((float(np.sqrt(np.mean(changed**2))), x))
    near.sort(key=lambda each: each[0])
    return [x for miss, x in near[:_EXCHANGED] if miss < _NEARLY_ALIKE]


def are_one(a: ElasticResult, b: ElasticResult) -> bool:
    """Whether two results are the same: their partners, and their constants."""
    nearer = min(_distance(a.x - b.x, each) for each in (a, b))
    return a.partners == b.partners and nearer < _APART


def _distance(apart: FloatArray, result: ElasticResult) -> float:
    """How far something lies from a result, in its posterior's standard deviations."""
    return float(np.sqrt(apart @ np.linalg.solve(result.inverse, apart)))
