"""A measured mode that may be none: its weight in a fit, what the posterior makes of it, and what
the user gets.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from fecore.modes import MeasuredModes
from fecore.updating.forward import unpaired_cost
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.pipeline import update
from fecore.updating.posterior import (
    LinearProblem,
    Mixture,
    over_sets,
    spurious_mode_penalty,
    weights_of,
)
from fecore.updating.result import UpdateResult
from tests.support.draws import Drawn
from tests.support.fits import COARSE

RANDOM = np.random.default_rng(8)
COUNT, SIZE = 5, 2
RECIPE = Recipe(damping_models=("rayleigh",))


@pytest.fixture
def problem() -> LinearProblem:
    """Five frequencies of two unknowns, the fourth off by one per cent."""
    residual = 0.001 * RANDOM.standard_normal(COUNT)
    residual[3] += 0.01
    sd, at = np.array([0.3, 0.2]), np.array([0.1, -0.2])
    noise = np.diag(RANDOM.uniform(1e-8, 1e-6, COUNT))
    nothing = np.zeros(SIZE)
    return LinearProblem(
        residual,
        noise,
        RANDOM.standard_normal((COUNT, SIZE)),
        at,
        lambda _: np.diag(sd**-2),
        {},
        nothing,
    )


def likelihood(problem: LinearProblem, which: list[int], spread: float) -> float:
    """Of some frequencies, the unknowns integrated out."""
    S, r = (
        problem.sensitivity[which],
        problem.residual[which] + problem.sensitivity[which] @ problem.x,
    )
    V = (
        problem.noise[np.ix_(which, which)]
        + spread**2 * np.eye(len(which))
        + S @ np.linalg.solve(problem.prior(0.0), S.T)
    )
    return float(np.exp(-(np.linalg.slogdet(2 * np.pi * V)[1] + r @ np.linalg.solve(V, r)) / 2))


@pytest.mark.parametrize("probability", [0.6, 0.99, 0.999999])
def test_the_weight_of_one_mode_is_its_posterior_probability(
    problem: LinearProblem, probability: float
) -> None:
    """Both sets by brute force: the likelihood of all frequencies with it, and of the others times
    the band's density.
    """
    spreads = 0.001 * np.exp(np.linspace(np.log(0.1), np.log(30.0), 41))
    # of ln s, as in `posterior`
    prior = np.exp(-2 * (np.log(spreads) + 0.001**2 / (2 * spreads**2)))
    P, W = np.where(np.arange(COUNT) == 3, probability, 1.0), np.full(COUNT, 2.5)
    real, none = (
        sum(p * likelihood(problem, which, s) for p, s in zip(prior, spreads, strict=True))
        for which in ([0, 1, 2, 3, 4], [0, 1, 2, 4])
    )
    others = problem.only(np.arange(COUNT) != 3)
    # what the others predict, where the model misses it by five per cent
    step, covariance = others.solve(0.001, 0.0)
    spread = np.sqrt(
        problem.noise[3, 3] + 0.05**2 + problem.sensitivity[3] @ covariance @ problem.sensitivity[3]
    )
    off = scipy.stats.norm.pdf(problem.residual[3] - problem.sensitivity[3] @ step, 0, spread)
    real += 0.01 * off * none
    expected = probability * real / (probability * real + (1 - probability) / 2.5 * none)
    assert weights_of(problem, P, W, 0.0)[3] == pytest.approx(expected, rel=1e-9)
    assert weights_of(problem, P, W, 0.0)[[0, 1, 2, 4]].tolist() == [1.0] * 4


def test_the_descent_is_the_derivative_of_the_weighted_misfit(problem: LinearProblem) -> None:
    weighted = replace(problem, weight=np.array([1.0, 0.3, 1.0, 0.05, 0.9]))
    root, V = np.sqrt(weighted.weights), problem.noise + 0.002**2 * np.eye(COUNT)

    def misfit(step: np.ndarray) -> complex:
        r, x = root * (problem.residual - problem.sensitivity @ step), problem.x + step
        return complex(r @ np.linalg.solve(V, r) + x @ problem.prior(0.0) @ x) / 2

    cost, descent, _ = weighted.at(0.002, 0.0)
    assert cost == pytest.approx(misfit(np.zeros(SIZE)).real, rel=1e-12)
    by_step = [-misfit(1e-30j * unit).imag / 1e-30 for unit in np.eye(SIZE)]
    np.testing.assert_allclose(descent, by_step, rtol=1e-12)


def test_the_posterior_is_that_of_both_sets_by_their_odds(problem: LinearProblem) -> None:
    without, mode_inclusion = problem.with_weight(3, 0.0), np.where(np.arange(COUNT) == 3, 0.3, 1.0)
    given = without.mixture(0.0)[0]
    found = over_sets(without, mode_inclusion, 0.0, given)
    moments = [problem.with_weight(3, w).mixture(0.0)[0].total for w in (1.0, 0.0)]
    np.testing.assert_allclose(found.total, 0.3 * moments[0] + 0.7 * moments[1], rtol=1e-12)
    alone = problem.only(np.arange(COUNT) != 3).mixture(0.0)[0]
    # weight 0 is to have no such frequency
    np.testing.assert_allclose(moments[1], alone.total, rtol=1e-9)
    assert over_sets(without, np.ones(COUNT), 0.0, given) is given
    assert isinstance(found, Mixture)


def test_what_is_certain_costs_what_it_did() -> None:
    modes = MeasuredModes(
        np.array([10.0, 20.0, 30.0]), np.full(3, 0.01), probability=np.array([1.0, 0.6, 0.1])
    )
    assert unpaired_cost(modes) == pytest.approx(
        [8.0, -np.log(0.4 + 0.6 * np.exp(-8)), -np.log(0.9 + 0.1 * np.exp(-8))]
    )
    assert unpaired_cost(replace(modes, probability=None)).tolist() == [8.0] * 3
    fits = scipy.stats.norm.logpdf(0, 0, 0.001)
    expected = 0.8 * (np.log(0.6 / 0.4 * 1.5) + fits)
    weights = np.array([1.0, 0.2])
    assert spurious_mode_penalty(
        weights, np.array([1.0, 0.6]), np.array([3.0, 1.5]), 0.001
    ) == pytest.approx(expected)


def updated(drawn: Drawn, modes: MeasuredModes, probability: object) -> UpdateResult:
    """By modes alone, as if somebody had typed them in."""
    given = None if probability is None else np.asarray(probability, dtype=float)
    modes = replace(modes, probability=given)
    return update(Measurement(None, drawn.measurement.points, modes), COARSE, RECIPE)


@pytest.mark.long
def test_a_false_pole_pulls_by_its_probability(drawn: Drawn, identified: Measurement) -> None:
    """In place of the second bending mode stands a pole of its shape, 5 % too high. In short a mode
    in doubt leaves its constant wide, below.
    """
    modes = identified.modes
    assert modes is not None
    false = replace(modes, frequency_hz=modes.frequency_hz * np.where(np.arange(5) == 1, 1.05, 1.0))
    left = [0, 2, 3, 4]
    both = [*left, *(5 + row for row in left)]
    assert modes.shapes is not None
    assert modes.covariance is not None
    without = MeasuredModes(
        modes.frequency_hz[left],
        modes.damping_ratio[left],
        modes.shapes[left],
        modes.dofs,
        modes.covariance[np.ix_(both, both)],
    )
    found = {p: updated(drawn, false, np.where(np.arange(5) == 1, p, 1.0)) for p in (0.6, 0.999)}
    truth = {p.name: p for p in updated(drawn, without, None).parameters}

    def moved(result: UpdateResult, name: str) -> float:
        (found,) = (p for p in result.parameters if p.name == name)
        return abs(found.estimate - truth[name].estimate) / truth[name].standard_deviation

    assert moved(found[0.6], "Ex") < 0.05
    assert moved(found[0.6], "Gxz") < 0.2
    assert moved(found[0.999], "Ex") > 0.3
    assert "mode_not_believed" in {finding.kind for finding in found[0.6].findings}
    assert "mode_not_believed" not in {finding.kind for finding in found[0.999].findings}
    assert found[0.6].verdict.level == "usable"
    assert found[0.999].verdict.level == "with_care"


def test_a_mode_in_doubt_that_alone_fixes_a_constant_leaves_it_wide(
    drawn: Drawn, identified: Measurement
) -> None:
    """The third mode alone is torsion. Where it may be none, so may the shear modulus be what the
    prior says.
    """
    shear = {}
    for p in (0.6, 0.99):
        result = updated(drawn, identified.modes, np.where(np.arange(5) == 2, p, 1.0))
        (shear[p],) = (each for each in result.parameters if each.name == "Gxy")
    wide, narrow = shear[0.6], shear[0.99]
    assert wide.estimate == pytest.approx(narrow.estimate, rel=1e-3)
    assert wide.standard_deviation > 2 * narrow.standard_deviation
    assert wide.budget[0].source == "which modes are real"
