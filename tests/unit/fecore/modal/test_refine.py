"""What identification says of its own errors: held to formulas written out anew."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy

from fecore.errors import IdentificationError
from fecore.frf import Dof, FrfSet
from fecore.modal import identify
from fecore.modal.arrangement import Arrangement, arrange
from fecore.modal.errors import (
    ErrorModel,
    mean_over_tests,
)
from fecore.modal.refine import PoleFit, refine
from fecore.modal.series import (
    Terms,
    columns,
    mean_weight,
    memory,
    normal_columns,
    shared_error,
    spectrum,
    stacked,
    whitening,
)
from fecore.modal.shapes import PairModes, PairProblem
from fecore.normal import Z_95
from tests.support.lengths import long

HZ, ZETA, FRFS = np.array([101.3, 160.7]), np.array([0.01, 0.02]), 12


def measured(
    hz: np.ndarray = HZ, zeta: np.ndarray = ZETA, noise: float = 1e-7, line: float = 1.0
) -> Arrangement:
    """Receptances of a roving sensor, 60 to 220 Hz, with white noise; each mode has a shape of its
    own.
    """
    random = np.random.default_rng(7)
    lines = np.arange(60.0, 220.5, line)
    shapes = random.standard_normal((FRFS, hz.size))
    s, omega = 2j * np.pi * lines[:, None], 2 * np.pi * hz
    values = shapes @ (1 / (s**2 + 2 * zeta * omega * s + omega**2)).T
    white = random.standard_normal((2, *values.shape))
    dofs = tuple(Dof(i + 1, 3) for i in range(FRFS))
    frfs = FrfSet(
        lines, values + noise * (white[0] + 1j * white[1]), dofs, (Dof(99, 3),) * FRFS, "receptance"
    )
    return arrange(frfs)


TERMS = Terms(HZ, ZETA, (0,))


def assessed(fit: PoleFit, **known: Any) -> PoleFit:
    """The fit with errors of which no more is known than this."""
    n = fit.terms.pairs
    nothing = ErrorModel(
        memory=1.0,
        sessions=np.zeros(FRFS, dtype=np.int64),
        shared=np.zeros(n),
        change=np.zeros(2 * n),
    )
    return replace(fit, errors=replace(nothing, **known))


def explicit(arrangement: Arrangement, fit: PoleFit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance of θ, variance of the residues, and each FRF's score, by the whole Jacobian of all
    unknowns at once.
    """
    s = 2j * np.pi * arrangement.frequency_hz[:, None]
    omega, zeta = 2 * np.pi * fit.terms.frequency_hz, fit.terms.damping_ratio
    root = np.sqrt(1 - zeta**2)
    pole, by_zeta = omega * (-zeta + 1j * root), omega * (-1 - 1j * zeta / root)
    direct, mirror = 1 / (s - pole), 1 / (s - pole.conj())
    basis = np.concatenate([direct + mirror, 1j * (direct - mirror), np.ones_like(s)], axis=1)
    residue = fit.residues
    n, q = pole.size, basis.shape[1]
    rows, own, other = [], [], []
    for i, r in enumerate(residue):
        steep = [r * by * direct**2 + (r * by).conj() * mirror**2 for by in (pole, by_zeta)]
        weight = np.sqrt(2 / fit.variance[i])[:, None]
        own.append(np.concatenate(steep, axis=1) * weight)
        other.append(basis * weight)
        rows.append(fit.residual[i][:, None] * weight)
    total = np.zeros((2 * n + q * len(own), 2 * n + q * len(own)))
    score = []
    for i, (j, phi, left) in enumerate(zip(own, other, rows, strict=True)):
        at = slice(2 * n + i * q, 2 * n + (i + 1) * q)
        total[: 2 * n, : 2 * n] += (j.conj().T @ j).real
        total[: 2 * n, at] = (j.conj().T @ phi).real
        total[at, : 2 * n] = total[: 2 * n, at].T
        total[at, at] = (phi.conj().T @ phi).real
        score.append((j.conj().T @ left).real[:, 0])
    scale = np.sqrt(np.diag(total))
    inverse = np.linalg.inv(total / np.outer(scale, scale)) / np.outer(scale, scale)
    variance = np.diag(inverse)[2 * n :].reshape(len(own), q)
    return inverse[: 2 * n, : 2 * n], variance[:, :n] + variance[:, n : 2 * n], np.array(score)


@pytest.mark.parametrize("stated", [0.25, 4.0])
def test_covariances_are_those_of_all_unknowns_at_once(stated: float) -> None:
    """Stated noise too small by half or too large by twice: the residual counts where it is larger,
    never smaller.
    """
    arrangement = measured()
    variance = np.full(arrangement.values.shape, stated * 2e-14)
    variance[::2] *= 1.5
    fit = refine(arrangement, TERMS, variance, steps=0)
    theta, residues, score = explicit(arrangement, fit)
    freedom = 2 * arrangement.values.size - 2 * 2 - FRFS * 5
    chi_squared = float(np.sum(2 / variance * np.abs(fit.residual) ** 2))
    assert (fit.freedom, fit.chi_squared) == (freedom, pytest.approx(chi_squared, rel=1e-12))
    inflation = max(1.0, chi_squared / freedom)
    assert (inflation > 1) is (stated < 1)
    np.testing.assert_allclose(
        fit.parameter_covariance, theta * inflation, rtol=1e-6, atol=1e-9 * theta.max()
    )
    np.testing.assert_allclose(fit.residue_variance, residues * inflation, rtol=1e-6)
    np.testing.assert_allclose(fit.scores, score, rtol=1e-6, atol=1e-9 * np.abs(score).max())
    np.testing.assert_allclose(fit.by_frf.sum(axis=0), np.diag(fit.information), rtol=1e-12)
    longer = assessed(fit, memory=3.0)
    assert longer.inflation == pytest.approx(3 * inflation, rel=1e-12)
    np.testing.assert_allclose(
        longer.parameter_covariance, 3 * fit.parameter_covariance, rtol=1e-12
    )


def test_scatter_between_sessions_counts_from_eight_on() -> None:
    """H⁻¹ (Σ g gᵀ) H⁻¹ S/(S - 1), over the 1 + 1/√(2(S - 1)) to which it is known; a parameter
    grows by its own.
    """
    arrangement = measured()
    fit = refine(arrangement, TERMS, np.full(arrangement.values.shape, 8e-14), steps=0)
    plain = fit.parameter_covariance
    score = (
        40
        * np.random.default_rng(1).standard_normal(fit.scores.shape)
        * np.sqrt(np.diag(fit.information))
    )
    score[:, 1:] *= 1e-3
    few = assessed(replace(fit, scores=score), sessions=np.arange(FRFS) % 7)
    np.testing.assert_array_equal(few.parameter_covariance, plain)
    inverse = np.linalg.inv(fit.information)
    for sessions, count in ((np.arange(FRFS), FRFS), (np.arange(FRFS) % 8, 8)):
        sums = np.array([score[sessions == s].sum(axis=0) for s in range(count)])
        between = np.sqrt(np.diag(inverse @ sums.T @ sums @ inverse) * count / (count - 1))
        expected = np.maximum(np.sqrt(np.diag(plain)), between / (1 + 1 / np.sqrt(2 * (count - 1))))
        found = assessed(replace(fit, scores=score), sessions=sessions).parameter_covariance
        np.testing.assert_allclose(np.sqrt(np.diag(found)), expected, rtol=1e-9)
        assert expected[0] > 2 * np.sqrt(plain[0, 0])


def test_what_the_data_do_not_determine_is_vague_and_spoils_nothing_else() -> None:
    """Parameters 1 and 3 are seen only as their sum: each is unknown, the others keep their
    variance.
    """
    arrangement = measured()
    fit = refine(arrangement, TERMS, np.full(arrangement.values.shape, 8e-14), steps=0)
    both = np.zeros(4)
    both[[1, 3]] = 1.0
    blind = replace(fit, information=np.diag([4.0, 0.0, 25.0, 0.0]) + 9 * np.outer(both, both))
    null = spectrum(blind.information)[3]
    assert null.tolist().count(True) == 1
    variance = np.diag(blind.parameter_covariance)
    assert variance[[0, 2]] == pytest.approx([0.25, 0.04], rel=1e-9)
    assert np.all(variance[[1, 3]] > 1e8)
    assert np.all(np.isfinite(variance))
    nothing = replace(fit, information=np.diag([4.0, 0.0, 25.0, 1.0]))
    assert np.diag(nothing.parameter_covariance)[[0, 2, 3]] == pytest.approx(
        [0.25, 0.04, 1.0], rel=1e-9
    )
    assert nothing.parameter_covariance[1, 1] > 1e8
    # little, in its own unit, is not nothing
    faint = replace(fit, information=np.diag([4.0, 1e-12, 25.0, 1.0]))
    assert faint.parameter_covariance[1, 1] == pytest.approx(1e12, rel=1e-9)


def test_a_step_keeps_damping_where_it_means_something() -> None:
    terms = Terms(np.array([100.0, 200.0]), np.array([0.01, 0.02]), (0,))
    after = terms.moved(np.array([0.1, -0.1, 2.0, -2.0]))
    assert after.frequency_hz == pytest.approx(
        np.array([100.0, 200.0]) * np.exp([0.1, -0.1]), rel=1e-12
    )
    assert after.damping_ratio.tolist() == [0.95, 1e-5]


PAIR = PairModes(
    np.array([101.0, 101.6]),
    np.array([0.01, 0.012]),
    np.array([[1.0, 0.4 + 0.1j], [-0.5 + 0.2j, 1.0]]),
)


def site_of_pair(noise: float = 1e-7) -> tuple[Arrangement, PairProblem]:
    """Receptances of twelve roving dofs by two references, of two modes near to each other beside a
    third.
    """
    random = np.random.default_rng(5)
    lines = np.arange(60.0, 220.5, 0.5)
    s, shapes = 2j * np.pi * lines, random.standard_normal((FRFS, 3))
    hz, zeta = np.append(PAIR.frequency_hz, HZ[1]), np.append(PAIR.damping_ratio, ZETA[1])
    pole = 2 * np.pi * hz * (-zeta + 1j * np.sqrt(1 - zeta**2))
    residue = np.einsum(
        "pq,qm->pmq", shapes, np.concatenate([PAIR.participation, [[1.0, 1.0]]])
    ) / (2j * pole.imag)
    direct, mirror = 1 / (s - pole[:, None]), 1 / (s - pole.conj()[:, None])
    values = (residue @ direct + residue.conj() @ mirror).reshape(2 * FRFS, -1)
    white = random.standard_normal((2, *values.shape))
    pairs = [(Dof(i + 1, 3), Dof(90 + j, 3)) for i in range(FRFS) for j in range(2)]
    responses, references = (tuple(pair[side] for pair in pairs) for side in (0, 1))
    arrangement = arrange(
        FrfSet(
            lines, values + noise * (white[0] + 1j * white[1]), responses, references, "receptance"
        )
    )
    fit = refine(arrangement, TERMS, np.full(values.shape, 2e-14), steps=0)
    site = PairProblem.about(arrangement, fit, 0)
    assert site is not None
    return arrangement, site


def explicit_pair(
    arrangement: Arrangement, modes: PairModes, row: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coefficients of one roving dof (ψ₁, ψ₂, and of each reference the other pole and constant),
    covariance, misfit.
    """
    s = 2j * np.pi * arrangement.frequency_hz[:, None]
    pole = (
        2
        * np.pi
        * modes.frequency_hz
        * (-modes.damping_ratio + 1j * np.sqrt(1 - modes.damping_ratio**2))
    )
    away = 2 * np.pi * HZ[1] * (-ZETA[1] + 1j * np.sqrt(1 - ZETA[1] ** 2))
    lengths, blocks, right = [], [], []
    for j in range(2):
        seen = modes.participation[:, j]
        own, mirror = seen / (s - pole), seen.conj() / (s - pole.conj())
        other = np.concatenate(
            [
                1 / (s - away) + 1 / (s - away.conjugate()),
                1j * (1 / (s - away) - 1 / (s - away.conjugate())),
            ],
            axis=1,
        )
        whole = np.zeros((s.size, 10), dtype=complex)
        whole[:, 0:4:2], whole[:, 1:4:2] = own + mirror, 1j * (own - mirror)
        whole[:, 4 + 3 * j : 6 + 3 * j], whole[:, 6 + 3 * j] = other, 1.0
        blocks.append(whole)
        value = arrangement.values[np.flatnonzero((arrangement.row == [row, j]).all(axis=1))[0]]
        right.append(value)
    basis, value = np.concatenate(blocks), np.concatenate(right)
    real = np.concatenate([basis.real, basis.imag]) * 1e7
    lengths = np.linalg.norm(real, axis=0)
    target = np.concatenate([value.real, value.imag]) * 1e7
    c = np.linalg.lstsq(real / lengths, target, rcond=None)[0] / lengths
    covariance = np.linalg.inv((real / lengths).T @ (real / lengths)) / np.outer(lengths, lengths)
    return c, covariance, target - real @ c


def test_residues_of_a_pair_are_those_of_least_squares_written_out() -> None:
    """Two modes of rank one, the other pole and the constant of each reference being unknown beside
    them.
    """
    arrangement, site = site_of_pair()
    values, spread = site.residues(PAIR)
    for row in range(FRFS):
        c, covariance, _ = explicit_pair(arrangement, PAIR, row)
        for j in range(2):
            frf = np.flatnonzero((arrangement.row == [row, j]).all(axis=1))[0]
            assert values[frf] == pytest.approx(
                (c[0:4:2] + 1j * c[1:4:2]) * PAIR.participation[:, j], rel=1e-6
            )
            own = (
                np.diag(covariance)[:4].reshape(2, 2).sum(axis=1)
                * np.abs(PAIR.participation[:, j]) ** 2
            )
            np.testing.assert_allclose(spread[frf], own, rtol=1e-6)


def test_a_pair_is_found_from_its_pole_within_its_errors() -> None:
    """Started at one pole between the two; the covariance is that of the Jacobian, by central
    differences of the misfit.
    """
    arrangement, site = site_of_pair()
    found, covariance = site.fitted(site.start(), 1.5)
    order = np.argsort(found.frequency_hz)
    sd = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(np.log(found.frequency_hz[order] / PAIR.frequency_hz)) < 3 * sd[:2][order])
    assert np.all(np.abs(found.damping_ratio[order] - PAIR.damping_ratio) < 3 * sd[2:4][order])
    theta, step = found.theta, np.append(np.full(4, 1e-5), np.full(found.theta.size - 4, 1e-3))
    jacobian, score = [], []
    for row in range(FRFS):
        slopes = []
        for k, size in enumerate(step):
            ahead, back = (
                explicit_pair(
                    arrangement, found.at(theta + sign * size * (np.arange(theta.size) == k)), row
                )[2]
                for sign in (1, -1)
            )
            slopes.append((ahead - back) / (2 * size))
        jacobian.append(np.array(slopes))
        score.append(np.array(slopes) @ explicit_pair(arrangement, found, row)[2])
    inverse = np.linalg.inv(sum(j @ j.T for j in jacobian))
    between = np.sqrt(np.sum((np.array(score) @ inverse) ** 2, axis=0) * FRFS / (FRFS - 1)) / (
        1 + 1 / np.sqrt(2 * FRFS - 2)
    )
    np.testing.assert_allclose(sd, np.maximum(np.sqrt(1.5 * np.diag(inverse)), between), rtol=0.02)


def test_a_pair_needs_more_lines_than_unknowns() -> None:
    arrangement, _ = site_of_pair()
    fit = refine(arrangement, TERMS, np.full(arrangement.values.shape, 2e-14), steps=0)
    one_frf = np.arange(len(arrangement.pairs)) == 0
    few = replace(
        arrangement,
        measured=arrangement.measured & ~(one_frf[:, None] & (arrangement.frequency_hz > 61.2)),
    )
    assert PairProblem.about(few, fit, 0) is None


@pytest.mark.parametrize("rho", [0.0, 0.6])
def test_lines_that_share_their_error_count_less(rho: float) -> None:
    """An autoregressive error: ρ_j = ρʲ, summed while it is above 0.05, so that τ = 1 + 2 (ρ + ...
    + ρ⁵) for ρ = 0.6.
    """
    random = np.random.default_rng(3)
    shape = (300, 512)
    white = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    error = white.copy()
    for line in range(1, shape[1]):
        error[:, line] = rho * error[:, line - 1] + np.sqrt(1 - rho**2) * white[:, line]
    expected = 1 + 2 * sum(rho**j for j in range(1, 6))
    variance, everywhere, flat = (
        np.full(shape, 2.0),
        np.ones(shape, dtype=bool),
        np.ones(shape, dtype=complex),
    )
    assert memory(error, variance, everywhere, flat) == pytest.approx(expected, rel=0.03)
    level = np.exp(random.standard_normal(512))
    assert memory(error * level, variance * level**2, everywhere, level * flat) == pytest.approx(
        expected, rel=0.03
    )
    assert memory(1e-6 * error, variance, everywhere, flat) == pytest.approx(expected, rel=0.03)
    # an error relative to a model that turns
    turning = np.exp(1j * np.linspace(0, 300, 512)) * np.ones(shape)
    assert memory(error * turning, variance, everywhere, turning) == pytest.approx(
        expected, rel=0.05
    )
    spike = error.copy()
    # counts as three standard deviations: 9 beside the 511 of the other lines
    spike[:, 200] *= 1000
    hidden = memory(spike, variance, everywhere, flat)
    plain = memory(error, variance, everywhere, flat)
    assert 0.97 * (plain - 1) <= hidden - 1 <= plain - 1 + 0.01
    assert memory(0 * flat, variance, everywhere, flat) == 1.0
    whole = np.ones((1, 40))  # one error on all lines, seen over a quarter of them
    assert memory(whole.astype(complex), whole, whole > 0, whole.astype(complex)) == pytest.approx(
        1 + 2 * 10, rel=1e-9
    )


@pytest.mark.parametrize(("pull", "moved"), [(1e-3, True), (0.0, False), (-1e-3, False)])
def test_a_frequency_is_the_mean_over_the_tests_of_a_roving_sensor(
    pull: float, moved: bool
) -> None:
    """A sensor's mass pulls the first mode down by the square of its shape where it stands: nothing
    that pulls up is one, nor a hammer.
    """
    random, lines = np.random.default_rng(7), np.arange(60.0, 220.5, 0.25)
    shapes, s = random.standard_normal((FRFS, 2)), 2j * np.pi * lines
    hz = HZ * (1 - pull * shapes**2 * [1, 0])
    omega = 2 * np.pi * hz[:, :, None]
    values = np.sum(shapes[:, :, None] / (s**2 + 2 * ZETA[:, None] * omega * s + omega**2), axis=1)
    white = random.standard_normal((*values.shape, 2)) @ [1e-8, 1e-8j]
    dofs = tuple(Dof(i + 1, 3) for i in range(FRFS))
    arrangement = arrange(FrfSet(lines, values + white, dofs, (Dof(99, 3),) * FRFS, "receptance"))
    fit = refine(arrangement, TERMS, np.full(values.shape, 2e-16))
    mean = mean_over_tests(arrangement, fit, fit.by_frf)  # each FRF is a test
    assert (mean is not None) is moved
    hammer = tuple((response, reference) for reference, response in arrangement.pairs)
    assert mean_over_tests(replace(arrangement, pairs=hammer), fit, fit.by_frf) is None
    if mean is not None:
        before = np.log(fit.terms.frequency_hz / hz.mean(axis=0))
        after = before + mean.move
        assert np.all(np.abs(after) < 3 * np.sqrt(mean.variance))
        assert abs(after[0]) < abs(before[0]) / 5


@pytest.mark.parametrize("size", [0.0, 0.003])
def test_an_error_that_all_frfs_share_is_counted_whole(size: float) -> None:
    """Every FRF's first mode errs by one smooth relative function of the lines: no number of FRFs
    makes it less.
    """
    arrangement = measured(line=0.125)
    fit = refine(arrangement, TERMS, np.full(arrangement.values.shape, 2e-14), steps=0)
    off = (arrangement.frequency_hz - HZ[0]) / (HZ[0] * ZETA[0])
    error = size * np.cos(2 * off)
    own = (
        fit.linear.coefficients[:, :2]
        @ columns(arrangement.omega, TERMS, arrangement.power)[:, :2].T
    )
    shared = shared_error(arrangement, replace(fit, residual=fit.residual + error * own))
    power = np.where(np.abs(off) <= 3, np.sum(np.abs(own) ** 2, axis=0), 0.0)
    parts = np.sum(np.abs(own) ** 2, axis=1) / np.sum(np.abs(own) ** 2)
    lines = int(np.sum(power > 0))
    chance = (
        (2 * lines - 4 + 2 * np.sqrt(4 * lines - 8)) / (2 * lines) * np.sum(parts**2)
    )  # were FRFs of this size independent
    expected = np.sqrt(np.sum(power * error**2) / np.sum(power) * (1 - chance))
    assert shared[0] == pytest.approx(expected, rel=0.05, abs=1e-12)
    assert shared[1] == 0.0
    wide = assessed(fit, shared=shared)
    added = np.diag(wide.parameter_covariance - fit.parameter_covariance)
    np.testing.assert_allclose(added, np.tile((4 * shared * ZETA) ** 2, 2), rtol=1e-6, atol=1e-20)


def test_a_deviation_is_at_least_the_change_under_other_weights() -> None:
    """Of three poles one changes by more than its deviation: that alone becomes the change."""
    arrangement = measured(line=0.125)
    fit = refine(arrangement, TERMS, np.full(arrangement.values.shape, 2e-14), steps=0)
    before = np.sqrt(np.diag(fit.parameter_covariance))
    times = np.where(np.arange(before.size) == 1, -3.0, 0.5)
    changed = assessed(fit, change=times * before).parameter_covariance
    expected = before * np.maximum(1.0, np.abs(times))
    np.testing.assert_allclose(np.sqrt(np.diag(changed)), expected, rtol=1e-9)


@pytest.mark.parametrize("first", [0.2, long(0.5), 1.0])
@pytest.mark.parametrize("noise", [1e-4, 5e-3])
def test_an_interval_allows_for_a_frequency_that_falls_with_the_amplitude(
    first: float, noise: float
) -> None:
    """A spring kx³ shifts a mode by δ half bandwidths at first, δe^{-2σt} later: e^{iδ/2} Σ_n
    (-iδ/2)ⁿ/n! e^{-(1+2n)σt}.
    """
    random, lines, hz, zeta = np.random.default_rng(1), np.arange(20.0, 80.0, 0.125), 50.0, 0.01
    n = np.arange(12)
    pole = 2 * np.pi * hz * (-zeta * (1 + 2 * n) + 1j * np.sqrt(1 - zeta**2))
    part = np.exp(0.5j * first) * (-0.5j * first) ** n / scipy.special.factorial(n) / 2j
    s = 2j * np.pi * lines[:, None]
    curve = (part / (s - pole) + part.conj() / (s - pole.conj())).sum(axis=1)
    white = random.standard_normal((2, 6, lines.size)) * noise * np.abs(curve).max()
    values = random.standard_normal((6, 1)) * curve + white[0] + 1j * white[1]
    found = identify(
        FrfSet(lines, values, tuple(Dof(i, 3) for i in range(6)), (Dof(9, 3),) * 6, "receptance")
    ).modes
    (off,), (sd,) = found.frequency_hz / hz - 1, found.frequency_sd_hz / hz
    assert off > 0.15 * first * zeta  # the fit is off by far more than the noise makes it
    assert sd / 2 < off < Z_95 * sd


@pytest.mark.parametrize("frfs", [1, 20])
def test_normal_matrices_are_those_of_each_frf_whether_few_or_many(frfs: int) -> None:
    random = np.random.default_rng(3)
    basis = (random.standard_normal((60, 22)) + 1j * random.standard_normal((60, 22))).T.copy().T
    weight = random.uniform(0, 1, (frfs, 60))
    expected = np.einsum("lq,nl,lp->nqp", basis.conj(), weight, basis).real
    np.testing.assert_allclose(normal_columns(weight, basis), expected, atol=1e-12)
    parts = basis[:, :9], basis[:, 9:]
    np.testing.assert_allclose(normal_columns(weight, *parts), expected[:, :, 9:], atol=1e-12)


def test_a_basis_is_made_orthonormal_whatever_the_size_of_its_columns() -> None:
    weight = np.array([[1.0, 3.0, 1.0, 3.0], [1e9, 1e9, 1e9, 1e9], [0.0, 0.0, 0.0, 0.0]])
    assert mean_weight(weight) ** 2 == pytest.approx(np.array([1.5, 2.5, 1.5, 2.5]) / 3, rel=1e-12)
    basis = np.array([[1, 1e-14], [1j, 2e-14], [1, 1e-14j], [2, 0]], dtype=complex)
    scaled = stacked(basis, mean_weight(weight))
    turn = whitening(scaled)
    np.testing.assert_allclose(turn.T @ scaled.T @ scaled @ turn, np.eye(2), atol=1e-12)
    assert whitening(np.concatenate([scaled, scaled[:, :1]], axis=1)).shape == (3, 2)
    arrangement = measured()
    variance = np.full(arrangement.values.shape, 2e-14)
    variance[3] = np.inf
    with pytest.raises(
        IdentificationError,
        match="has no weight on the measured lines of an FRF; leave that FRF out",
    ):
        refine(arrangement, TERMS, variance, steps=0)
