"""The posterior of stage 1 against what it is an integral of, and what it says of each parameter."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from fecore.updating.measured_ratios import ScaleMixture, log_likelihood_of_deviations, scale_of_deviations
from fecore.updating.posterior import (
    LinearProblem,
    Mixture,
    discrepancy,
    identifiability,
    log_likelihood,
    spread_over,
)

RANDOM = np.random.default_rng(5)
SQUARE = RANDOM.standard_normal((4, 4))
NOISE = 1e-6 * SQUARE @ SQUARE.T
RESIDUAL = 0.002 * RANDOM.standard_normal(4)
SENSITIVITY = 0.1 * RANDOM.standard_normal((4, 2))
PRIOR = np.array([[2.0, 0.5], [0.5, 1.0]])
DESCENT = np.array([0.3, -0.2])


def gaussian(values: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(w,) logarithms of a Gaussian's density at (w, n) values, up to a constant."""
    return (
        -(np.linalg.slogdet(covariance)[1] + np.einsum("wn,nw->w", values, np.linalg.solve(covariance, values.T))) / 2
    )


def over(scales: np.ndarray, log_prior: np.ndarray, values: np.ndarray) -> np.ndarray:
    each = [gaussian(values, NOISE + s**2 * np.eye(4)) + p for s, p in zip(scales, log_prior, strict=True)]
    return np.asarray(scipy.special.logsumexp(each, axis=0))


def test_the_likelihood_is_that_of_gaussians_over_the_priors_scales() -> None:
    tried = RANDOM.standard_normal((6, 4)) * np.array([[0.0005], [0.001], [0.002], [0.005], [0.01], [0.03]])
    scale = 0.001 * np.exp(np.linspace(np.log(0.1), np.log(30.0), 41))
    of_square = -2 * np.log(scale**2) - 0.001**2 / scale**2  # inverse gamma of shape 1, which is ν₀/2
    expected = over(scale, of_square + 2 * np.log(scale), tried)  # of ln s
    np.testing.assert_allclose(np.diff(log_likelihood(NOISE)(tried)), np.diff(expected), rtol=1e-9)


def test_the_mixture_is_likelihood_times_prior() -> None:
    sd, rest = np.array([2.0, 3.0]), PRIOR - np.diag([1 / 4, 1 / 9])  # of the prior a part is coupons
    problem = LinearProblem(RESIDUAL, NOISE, SENSITIVITY, np.zeros(2), lambda _: sd, {"coupons": rest}, DESCENT)
    found, scatters = problem.mixture(0.0)
    assert not scatters.any()
    assert found.weight.sum() == pytest.approx(1)
    at = 0.5 * RANDOM.standard_normal((8, 2))
    density = sum(
        weight * np.exp(gaussian(at - mean, covariance))
        for weight, mean, covariance in zip(found.weight, found.shift, found.covariance, strict=True)
    )
    likelihood = log_likelihood(NOISE)(RESIDUAL - at @ SENSITIVITY.T)
    expected = likelihood + at @ DESCENT - np.einsum("np,pq,nq->n", at, PRIOR, at) / 2
    np.testing.assert_allclose(np.diff(np.log(density)), np.diff(expected), rtol=1e-8)
    narrow, wide = found.covariance[0], found.covariance[-1]
    assert np.all(np.diag(narrow) < np.diag(wide))
    assert found.scale[[0, -1]] == pytest.approx([1e-4, 0.03])


def test_moments_and_reach_are_those_of_the_mixture() -> None:
    weight, mean, sd = np.array([0.3, 0.7]), np.array([1.0, -0.5]), np.array([0.5, 2.0])
    mixture = Mixture(weight, mean[:, None], sd[:, None, None] ** 2, np.array([1.0, 2.0]))
    assert mixture.total[0, 0] == pytest.approx(0.3 * (0.25 + 1) + 0.7 * (4 + 0.25))
    for probability in (0.95, 0.5):
        below, above = mixture.reach(np.array([2.0]), probability)
        outside = [weight @ scipy.special.ndtr((x - 2 * mean) / (2 * sd)) for x in (-below, above)]
        assert outside == pytest.approx([(1 - probability) / 2, (1 + probability) / 2])
    assert mixture.reach(np.array([2.0])) == mixture.reach(np.array([2.0]), 0.95)
    assert mixture.reach(np.array([0.0])) == (0, 0)
    aside = Mixture(np.ones(1), np.array([[9.0]]), np.ones((1, 1, 1)), np.ones(1)).reach(np.ones(1))
    assert aside == pytest.approx((0, 9 + 1.959964))


@pytest.mark.parametrize("sd", [0.01, 1.0, 100.0])
def test_one_gaussian_reaches_two_standard_deviations(sd: float) -> None:
    one = Mixture(np.ones(1), np.zeros((1, 1)), np.full((1, 1, 1), sd**2), np.ones(1))
    assert one.reach(np.ones(1)) == pytest.approx((1.959964 * sd, 1.959964 * sd), rel=1e-6)
    assert ScaleMixture(np.ones(1), np.ones(1)).reach(0.36 * sd**2, 0.64 * sd**2) == pytest.approx(
        1.959964 * sd, rel=1e-6
    )


def test_a_discrepancy_is_the_mean_of_residuals_and_prior() -> None:
    residual = np.array([0.003, 0.004])
    assert discrepancy(residual, 1.0, 0.001) == pytest.approx(np.sqrt((2 * 1e-6 + 25e-6) / (2 + 1)))
    assert discrepancy(residual, 5.0, 0.001) == pytest.approx(np.sqrt(27e-6 / 2))  # no freedom is left


def test_a_parameter_is_identifiable_where_no_unseen_direction_moves_it() -> None:
    sd = np.array([2.0, 1.0, 10.0, 1.0])
    turn = np.eye(4)
    turn[1:3, 1:3] = np.array([[0.8, -0.6], [0.6, 0.8]])  # the second and the third move together where nothing is seen
    share = turn @ np.diag([0.01, 0.99, 0.02, 0.6]) @ turn.T
    covariance = share * np.outer(sd, sd)
    found = identifiability(("a", "b", "c", "d"), covariance, sd)
    assert [one.identifiable for one in found] == [True, False, False, False]
    assert [one.information for one in found] == pytest.approx(list(1 - np.diag(share)))
    assert [one.confounded_with for one in found] == [(), ("c",), ("b",), ()]
    wider = spread_over(found, 60 * covariance * np.eye(4)[0], sd)
    assert (wider[0].identifiable, wider[0].information) == (False, pytest.approx(0.4))
    assert spread_over(found, covariance, sd) == found


def test_the_scale_of_deviations_has_the_restricted_likelihood() -> None:
    scale = scale_of_deviations(RESIDUAL, NOISE, SENSITIVITY, 0.02)
    unit = 0.02 / np.sqrt(3)  # the root mean square of Student's t of three degrees of freedom is √3
    log_prior = -2 * np.log1p((scale.scale / unit) ** 2 / 3) + np.log(scale.scale)
    expected = []
    for s in scale.scale:
        V = NOISE + s**2 * np.eye(4)
        W = np.linalg.inv(V)
        inner = SENSITIVITY.T @ W @ SENSITIVITY
        left = W - W @ SENSITIVITY @ np.linalg.solve(inner, SENSITIVITY.T @ W)
        logs = np.linalg.slogdet(W)[1] - np.linalg.slogdet(inner)[1] - RESIDUAL @ left @ RESIDUAL
        expected.append(logs / 2)
    expected += log_prior
    np.testing.assert_allclose(np.diff(np.log(scale.weight)), np.diff(expected), rtol=1e-6, atol=1e-9)
    assert scale.weight.sum() == pytest.approx(1)
    assert scale.scale[[0, -1]] == pytest.approx(unit * np.array([0.01, 30.0]))
    tried = 0.01 * RANDOM.standard_normal((3, 4))
    whole = over(scale.scale, log_prior, tried)
    np.testing.assert_allclose(np.diff(log_likelihood_of_deviations(NOISE, 0.02)(tried)), np.diff(whole), rtol=1e-9)


def test_a_scale_of_nothing_reaches_nowhere() -> None:
    certain = ScaleMixture(np.ones(1), np.array([0.5]))
    assert certain.reach(0.0, 0.0) == 0
    assert certain.reach(3.0, 1.0) == pytest.approx(2 * 1.959964)
    assert certain.reach(0.0, 1.0, 0.5) == pytest.approx(0.6744898)
    open_between = ScaleMixture(np.array([0.4, 0.6]), np.array([1.0, 3.0]))
    sd = np.sqrt(2 + np.array([1, 9]) / (0.4 + 0.6 * 9) * 7)
    assert np.array([0.4, 0.6]) @ scipy.special.ndtr(open_between.reach(2.0, 7.0) / sd) == pytest.approx(0.975)
