"""Statistics of an update: the posterior, deviations from a law, and what is found in words."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from fecore.findings import Finding
from fecore.updating.known_findings import FINDINGS
from fecore.updating.laws import ScaleMixture, disagreement, scale_of_deviations
from fecore.updating.posterior import (
    LinearProblem,
    Mixture,
    identifiability,
    log_likelihood,
    root,
    spread_over,
)
from fecore.updating.result import finding, warnings

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
        -(
            np.linalg.slogdet(covariance)[1]
            + np.einsum("wn,nw->w", values, np.linalg.solve(covariance, values.T))
        )
        / 2
    )


def test_the_mixture_is_likelihood_times_prior() -> None:
    # of the prior a part is coupons
    sd, rest = np.array([2.0, 3.0]), PRIOR - np.diag([1 / 4, 1 / 9])
    problem = LinearProblem(
        RESIDUAL,
        NOISE,
        SENSITIVITY,
        np.zeros(2),
        lambda _: np.diag(sd**-2),
        {"coupons": rest},
        DESCENT,
    )
    finding, scatters = problem.mixture(0.0)
    assert not scatters.any()
    assert finding.weight.sum() == pytest.approx(1)
    at = 0.5 * RANDOM.standard_normal((8, 2))
    density = sum(
        weight * np.exp(gaussian(at - mean, covariance))
        for weight, mean, covariance in zip(
            finding.weight, finding.shift, finding.covariance, strict=True
        )
    )
    likelihood = log_likelihood(NOISE)(RESIDUAL - at @ SENSITIVITY.T)
    expected = likelihood + at @ DESCENT - np.einsum("np,pq,nq->n", at, PRIOR, at) / 2
    np.testing.assert_allclose(np.diff(np.log(density)), np.diff(expected), rtol=1e-8)
    narrow, wide = finding.covariance[0], finding.covariance[-1]
    assert np.all(np.diag(narrow) < np.diag(wide))
    assert finding.scale[[0, -1]] == pytest.approx([1e-4, 0.03])


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


@pytest.mark.parametrize("scatter", [6e-5, 1e-3])
def test_an_even_body_whose_modes_scatter_is_covered_too(scatter: float) -> None:
    """Six frequencies that are off by a share which the prior's scale of 2e-5 does not foresee,
    three unknowns.
    """
    rng, below, sds = np.random.default_rng(53), [], []
    by = rng.uniform(0, 0.5, (6, 3))
    noise, start = 1e-14 * np.eye(6), np.zeros(3)
    for _ in range(300):
        off = scatter * rng.standard_normal(6)
        problem = LinearProblem(
            off, noise, by, start, lambda _: 0.1 * np.eye(3), {}, start, scale=2e-5
        )
        mixture, _ = problem.mixture(0.0)
        sd = np.sqrt(mixture.covariance[:, 0, 0])
        below.append(mixture.weight @ scipy.special.ndtr(-mixture.shift[:, 0] / sd))
        sds.append(np.sqrt(mixture.weight @ sd**2))
    assert np.mean(np.abs(np.array(below) - 0.5) < 0.475) > 0.88
    known = scatter * np.sqrt(np.linalg.inv(by.T @ by)[0, 0])
    assert np.median(sds) < np.sqrt(3) * known, (
        "not wider than Student's t of the three that are left"
    )


def test_a_parameter_is_identifiable_where_no_unseen_direction_moves_it() -> None:
    sd = np.array([2.0, 1.0, 10.0, 1.0])
    turn = np.eye(4)
    # the second and the third move together where nothing is seen
    turn[1:3, 1:3] = np.array([[0.8, -0.6], [0.6, 0.8]])
    share = turn @ np.diag([0.01, 0.99, 0.02, 0.6]) @ turn.T
    covariance = share * np.outer(sd, sd)
    finding = identifiability(("a", "b", "c", "d"), covariance, sd)
    assert [one.identifiable for one in finding] == [True, False, False, False]
    assert [one.information for one in finding] == pytest.approx(list(1 - np.diag(share)))
    assert [one.confounded_with for one in finding] == [(), ("c",), ("b",), ()]
    wider = spread_over(finding, 60 * covariance * np.eye(4)[0], sd)
    assert (wider[0].identifiable, wider[0].information) == (False, pytest.approx(0.4))
    assert spread_over(finding, covariance, sd) == finding


def test_the_scale_of_deviations_has_the_restricted_likelihood() -> None:
    scale = scale_of_deviations(RESIDUAL, NOISE, SENSITIVITY, 0.02)
    expected = []
    for s in scale.scale:
        V = NOISE + s**2 * np.eye(4)
        W = np.linalg.inv(V)
        inner = SENSITIVITY.T @ W @ SENSITIVITY
        left = W - W @ SENSITIVITY @ np.linalg.solve(inner, SENSITIVITY.T @ W)
        logs = np.linalg.slogdet(W)[1] - np.linalg.slogdet(inner)[1] - RESIDUAL @ left @ RESIDUAL
        expected.append(logs / 2)
    np.testing.assert_allclose(
        np.diff(np.log(scale.weight)), np.diff(expected), rtol=1e-6, atol=1e-9
    )
    assert scale.weight.sum() == pytest.approx(1)
    assert scale.scale[[0, -1]] == pytest.approx([1e-5, 0.08])
    assert np.ptp(np.diff(np.log(scale.scale))) < 1e-9, "even in ln s"


OMEGA = 2 * np.pi * np.array([25.0, 160.0, 400.0, 445.0, 866.0, 1210.0])
LAW = np.array([30.0, 1e-5])
RATES = np.column_stack([1 / OMEGA, OMEGA]) / 2
RATIO = RATES @ LAW
BASIS = RATES / RATIO[:, None]


@pytest.mark.parametrize(("scatter", "low", "high"), [(0.001, 0.0005, 0.004), (0.05, 0.03, 0.09)])
def test_the_scale_follows_the_modes(scatter: float, low: float, high: float) -> None:
    finding = []
    for seed in range(20):
        off = scatter * np.random.default_rng(seed).standard_normal(OMEGA.size)
        left = off - BASIS @ np.linalg.lstsq(BASIS, off, rcond=None)[0]
        finding.append(scale_of_deviations(left, 1e-8 * np.eye(OMEGA.size), BASIS, 0.02).rms)
    assert low < np.median(finding) < high


def test_with_as_many_modes_as_coefficients_the_prior_is_all_that_is_known() -> None:
    scale = scale_of_deviations(np.zeros(2), 1e-8 * np.eye(2), BASIS[:2], 0.02)
    assert scale.rms == pytest.approx(0.02, rel=0.05)
    # Even in ln s from 1e-5 to 0.08: a twentieth lies in the uppermost twentieth of these decades.
    assert scale.scale[np.searchsorted(np.cumsum(scale.weight), 0.95)] == pytest.approx(
        0.051, rel=0.1
    )


def test_intervals_are_those_of_the_mixture() -> None:
    scale = scale_of_deviations(np.zeros(2), 1e-8 * np.eye(2), BASIS[:2], 0.02)
    draws = np.random.default_rng(1).choice(scale.scale, 200_000, p=scale.weight) / scale.rms
    sample = np.random.default_rng(2).standard_normal(200_000) * np.sqrt(0.25 + draws**2)
    assert scale.reach(0.25, 1.0) == pytest.approx(
        float(np.quantile(np.abs(sample), 0.95)), rel=0.02
    )


def test_what_frfs_and_modes_disagree_by_is_added_beyond_noise() -> None:
    noise, own = 1e-6 * np.eye(OMEGA.size), np.diag((1e-3 * LAW) ** 2)
    assert disagreement(BASIS, noise, 0.001, LAW, own) == pytest.approx([0.0, 0.0])
    added = disagreement(BASIS, noise, 0.001, LAW * [1.0, 1.03], own)
    assert added[0] == 0
    assert added[1] == pytest.approx(0.03 * LAW[1], rel=0.02)


def test_findings_alike_are_folded_and_the_same_is_said_once() -> None:
    one, other = (
        Finding("alone", text, text, subject=text[: -len(" is alone")])
        for text in ("mode 1 (20.00 Hz) is alone", "mode 2 (30.00 Hz) is alone")
    )
    lid = Finding("lid", "the lid is open", "the lid is open", level="do_not_use")
    said = warnings([replace(one, level="with_care", weight=2), one, other, lid])
    assert said == (lid.text, f"{one.text} (likewise: {other.subject})")
    apart = replace(one, folds=False)
    assert warnings([apart, replace(other, folds=False)]) == (one.text, other.text)
    passed = one.passed_on("pairing", 1.0)
    assert (passed.kind, passed.remark, passed.text) == ("pairing", "alone", one.text)
    unlike = replace(other, kind="another").passed_on("pairing", 1.0)
    assert warnings([passed, unlike]) == (one.text, other.text)


def test_a_row_of_the_table_says_what_was_found_and_what_to_do() -> None:
    said = finding("modes_absent", level="do_not_use", modes="a mode", which="12.00 Hz")
    assert said.text.endswith(
        "none there: the boundary or the geometry is wrong, or modes were paired wrongly"
    )
    assert (said.kind, said.level, said.weight) == ("modes_absent", "do_not_use", 85)
    assert said.advice == "check boundary and geometry, and the pairs in the table of modes"
    mesh = {"size": 20, "finest": 5, "moved": "Ex by +3 %", "enough": 10}
    moved = finding("mesh_moves", **mesh)
    assert moved.text == f"{moved.sentence}; {moved.advice}"
    assert moved.advice == "elements of 10 mm would do"
    assert all(row.sentence and not row.sentence.endswith(".") for row in FINDINGS.values())


def test_what_is_known_exactly_has_an_interval_of_no_width() -> None:
    weight, scale = np.array([0.4, 0.6]), np.array([0.01, 0.02])
    assert ScaleMixture(weight, scale).reach(0.0, 0.0) == 0.0
    assert Mixture(weight, np.zeros((2, 3)), np.stack([np.eye(3)] * 2), scale).reach(
        np.zeros(3)
    ) == (0.0, 0.0)


def test_the_root_of_a_difference_of_covariances_is_no_larger_than_the_difference() -> None:
    """Of Ex 1e-9 less and of Gxy nothing is left but what both share: scaled by itself its root was
    of the order of 1e139.
    """
    larger = np.diag([8.4e-4, 1.0e-3])
    difference = np.array([[-1e-9, 1e-8], [1e-8, 0.0]])
    assert np.max(np.abs(root(difference, larger))) < np.sqrt(2e-8)
    exact = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
    np.testing.assert_allclose(
        root(exact, larger) @ root(exact, larger).T, exact, rtol=1e-12
    )  # where it is a covariance
