"""The refinement's derivatives, the linear stage on clean data, and the noise model."""

from __future__ import annotations

import numpy as np
import pytest

from fecore.frf import Dof, FrfSet
from fecore.modal import identify
from fecore.modal.arrangement import arrange, split_sides
from fecore.modal.basis import Terms
from fecore.modal.lscf import linear_poles
from fecore.modal.noise import line_scatter
from fecore.modal.refinement import evaluate, moved, refine
from fecore.updating.residual_noise import residual_variance
from tests.support.beams import ABOVE_HZ, ABOVE_ZETA, PAPER_HZ, PAPER_ZETA, paper_frfs


def test_gradient_and_information_against_differences() -> None:
    arrangement = arrange(paper_frfs(0.05, 3))
    variance = line_scatter(arrangement.values, arrangement.measured, 1.0)
    start = Terms(PAPER_HZ * 1.01, PAPER_ZETA * 1.2, (-2, 0))
    fit = evaluate(arrangement, start, variance)

    def chi(step: np.ndarray) -> float:
        return evaluate(arrangement, moved(start, step), variance).chi_squared

    units = np.eye(start.parameters) * 1e-6
    numeric = np.array([(chi(u) - chi(-u)) / 2e-6 for u in units])
    assert np.allclose(numeric, -2 * fit.gradient, rtol=1e-6)
    # at the optimum of clean data χ² = eᵀHe to second order: Kaufman's matrix is exact there
    clean = arrange(paper_frfs(0.0))
    true = Terms(np.append(PAPER_HZ, ABOVE_HZ), np.append(PAPER_ZETA, ABOVE_ZETA), (0,))
    best = evaluate(clean, true, variance)
    step = 1e-6 * np.random.default_rng(1).standard_normal(true.parameters)
    moved_chi = evaluate(clean, moved(true, step), variance).chi_squared
    assert moved_chi == pytest.approx(step @ best.information @ step, rel=1e-3)


def test_refinement_comes_home_from_a_poor_start() -> None:
    arrangement = arrange(paper_frfs(0.01, 3))
    variance = line_scatter(arrangement.values, arrangement.measured, 1.0)
    hz, zeta = np.append(PAPER_HZ, ABOVE_HZ[0]), np.append(PAPER_ZETA, ABOVE_ZETA[0])
    fit = refine(arrangement, Terms(hz * 1.01, zeta * [0.5, 2, 0.5, 2, 0.5, 2], (0,)), variance)
    assert np.allclose(fit.terms.frequency_hz[:5], PAPER_HZ, rtol=1e-3)
    assert np.allclose(fit.terms.damping_ratio[:5], PAPER_ZETA, rtol=0.01)


def test_linear_stage_is_exact_on_clean_data_and_biased_on_noisy() -> None:
    def first_damping(noise: float) -> float:
        arrangement = arrange(paper_frfs(noise, 1))
        variance = line_scatter(arrangement.values, arrangement.measured, 1.0)
        found = linear_poles(arrangement.omega, arrangement.values, 1 / variance, 30)
        at = np.flatnonzero((found.order == 18) & (np.abs(np.abs(found.pole) / (2 * np.pi) - 25.6) < 12))
        pole = found.pole[at[np.argmin(np.abs(np.abs(found.pole[at]) / (2 * np.pi) - 25.6))]]
        return float(-pole.real / np.abs(pole))

    assert first_damping(0.0) == pytest.approx(0.1556, rel=0.01)
    assert abs(first_damping(0.05) / 0.1556 - 1) > 0.05  # why the refinement is there


def test_noise_model_finds_both_parts() -> None:
    clean, noisy = arrange(paper_frfs(0.0)), arrange(paper_frfs(0.05, 2))
    rms = np.mean(np.abs(clean.values) ** 2, axis=1, keepdims=True)
    true = 0.025**2 * np.abs(clean.values) ** 2 + 0.05**2 * rms
    residual = noisy.values - clean.values
    found = residual_variance(residual, clean.values, clean.measured)
    assert np.median(found / true) == pytest.approx(1, abs=0.02)
    assert np.all(np.abs(found / true - 1) < 1.0)
    scatter = line_scatter(noisy.values, noisy.measured, 1.0)
    assert np.median(scatter / true) == pytest.approx(1, abs=0.05)


def test_fixed_dofs_are_the_fewest_that_touch_all_pairs() -> None:
    a, b, c = Dof(1, 3), Dof(2, 3), Dof(3, 3)
    roving, fixed, row = split_sides(((a, c), (b, c), (c, c)))  # roving sensor, or response: one reference
    assert (roving, fixed) == ((a, b, c), (c,))
    assert row.tolist() == [[0, 0], [1, 0], [2, 0]]
    assert split_sides(((c, a), (c, b)))[1] == (c,)  # roving hammer
    # a row and a column of the matrix share their dof: (c, a) is (a, c) by reciprocity
    assert split_sides(((a, c), (c, b)))[1] == (c,)


def test_a_chain_of_masses_without_any_noise() -> None:
    """Rounding alone decides between terms; once the cost rose by more than all that was left of it."""
    rng = np.random.default_rng(24)
    k = rng.uniform(0.5, 2, 3)
    stiffness = np.diag(k + np.append(k[1:], 0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    share = rng.uniform(0.001, 0.02)  # c = share k
    hz = np.append(1e-5, np.arange(1, 401) * 1e-3)
    w = 2 * np.pi * hz[:, None, None]
    values = np.linalg.inv((1 + 1j * share * w) * stiffness - w**2 * np.eye(3))[:, :, 0].T
    dofs = tuple(Dof(i, 3) for i in (1, 2, 3))
    found = identify(FrfSet(hz, values, dofs, dofs[:1] * 3, "receptance")).modes
    true = np.sqrt(np.linalg.eigvalsh(stiffness))
    np.testing.assert_allclose(found.frequency_hz, true / (2 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(found.damping_ratio, share * true / 2, rtol=1e-6)
