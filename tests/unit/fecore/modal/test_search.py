"""Derivatives of the refinement, the linear stage, the noise model, and what stands against one
fault of measured FRFs each.
"""

import numpy as np
import pytest

from benchmarks.made_frfs import KINDS, Harsh
from fecore.errors import IdentificationError
from fecore.frf import Dof, FrfSet
from fecore.modal import identify
from fecore.modal.arrangement import arrange, linear_poles, split_sides
from fecore.modal.prepare import leakage, line_scatter
from fecore.modal.refine import refine
from fecore.modal.search import compress
from fecore.modal.series import Terms
from fecore.updating.misfit import residual_variance
from tests.support.beams import ABOVE_HZ, ABOVE_ZETA, PAPER_HZ, PAPER_ZETA, paper_frfs
from tests.support.lengths import long


def test_gradient_and_information_against_differences() -> None:
    arrangement = arrange(paper_frfs(0.05, 3))
    variance = line_scatter(arrangement.values, arrangement.measured, 1.0)
    start = Terms(PAPER_HZ * 1.01, PAPER_ZETA * 1.2, (-2, 0))
    fit = refine(arrangement, start, variance, steps=0)

    def chi(step: np.ndarray) -> float:
        return refine(arrangement, start.moved(step), variance, steps=0).chi_squared

    units = np.eye(start.parameters) * 1e-6
    numeric = np.array([(chi(u) - chi(-u)) / 2e-6 for u in units])
    assert np.allclose(numeric, -2 * fit.gradient, rtol=1e-6)
    # at the optimum of clean data χ² = eᵀHe to second order: Kaufman's matrix is exact there
    clean = arrange(paper_frfs(0.0))
    true = Terms(np.append(PAPER_HZ, ABOVE_HZ), np.append(PAPER_ZETA, ABOVE_ZETA), (0,))
    best = refine(clean, true, variance, steps=0)
    step = 1e-6 * np.random.default_rng(1).standard_normal(true.parameters)
    moved_chi = refine(clean, true.moved(step), variance, steps=0).chi_squared
    assert moved_chi == pytest.approx(step @ best.information @ step, rel=1e-3)


def test_linear_stage_is_exact_on_clean_data_and_biased_on_noisy() -> None:
    def first_damping(noise: float) -> float:
        arrangement = arrange(paper_frfs(noise, 1))
        variance = line_scatter(arrangement.values, arrangement.measured, 1.0)
        found = linear_poles(arrangement.omega, arrangement.values, 1 / variance, 30)
        at = np.flatnonzero(
            (found.order == 18) & (np.abs(np.abs(found.pole) / (2 * np.pi) - 25.6) < 12)
        )
        pole = found.pole[at[np.argmin(np.abs(np.abs(found.pole[at]) / (2 * np.pi) - 25.6))]]
        return float(-pole.real / np.abs(pole))

    assert first_damping(0.0) == pytest.approx(0.1556, rel=0.01)
    assert abs(first_damping(0.05) / 0.1556 - 1) > 0.05  # why the refinement is there


def test_combinations_are_as_many_as_carry_the_modes() -> None:
    """Forty modes, all about as strong: twenty-four combinations would leave a twentieth of them."""
    random, hz = np.random.default_rng(1), np.arange(1.0, 801.0)
    f = np.linspace(15, 790, 40)[:, None]
    curves = hz**2 / (f**2 - hz**2 + 0.01j * f * hz)
    white = 0.1 * random.standard_normal((200, 800, 2)) @ [1, 1j]
    values = random.standard_normal((200, 40)) @ curves + white
    points = tuple(Dof(n, 3) for n in range(1, 201))
    arrangement = arrange(FrfSet(hz, values, points, (Dof(999, 3),) * 200))
    few, _ = compress(arrangement, np.full(values.shape, 0.02))
    assert 34 <= len(few.pairs) <= 40


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
    # roving sensor, or response: one reference
    roving, fixed, row = split_sides(((a, c), (b, c), (c, c)))
    assert (roving, fixed) == ((a, b, c), (c,))
    assert row.tolist() == [[0, 0], [1, 0], [2, 0]]
    assert split_sides(((c, a), (c, b)))[1] == (c,)  # roving hammer
    # a row and a column of the matrix share their dof: (c, a) is (a, c) by reciprocity
    assert split_sides(((a, c), (c, b)))[1] == (c,)


@pytest.mark.parametrize("seed", [2, long(4002)])
def test_a_group_of_overlapping_modes_is_found_though_none_of_them_pays_alone(seed: int) -> None:
    draw = KINDS["plate"](seed)
    found = identify(draw.frfs).found
    f = found.modes.frequency_hz[[why is None for why in found.doubt]]
    for true in draw.frequency_hz[~draw.optional]:
        assert np.min(np.abs(f / true - 1)) < 0.002, f"{true:.2f} Hz is lost; found {f}"


def test_leakage_is_left_out_only_where_there_is_some() -> None:
    draw = KINDS["bridge"](5)
    cut, said = leakage(arrange(draw.frfs))
    assert 0.5 < cut.frequency_hz[0] < draw.frequency_hz[0]
    assert "leakage below" in said[0].text
    for clean in (paper_frfs(0.05, 1), paper_frfs(0.0)):
        assert leakage(arrange(clean))[1] == []


def test_noise_that_rises_to_0_hz_is_no_leakage_but_for_a_line_by_chance() -> None:
    """White and as 1/f: the last line alone stands out of the jumps; nothing is left out, and no
    mode is found.
    """
    noise = KINDS["quiet"](5009, Harsh.drawn(5009)).frfs
    assert leakage(arrange(noise))[1] == []
    with pytest.raises(IdentificationError, match="no mode"):
        identify(noise)
