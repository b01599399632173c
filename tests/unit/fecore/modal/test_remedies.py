"""What stands against one fault of measured FRFs each, alone; what becomes of whole sets is in the corpus."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.made_frfs import KINDS
from fecore.modal import identify
from fecore.modal.arrangement import arrange
from fecore.modal.basis import Terms
from fecore.modal.compression import compress
from fecore.modal.error_model import memory
from fecore.modal.leakage import leakage
from fecore.modal.noise import line_scatter
from fecore.modal.refinement import evaluate
from tests.support.beams import PAPER_HZ, PAPER_ZETA, paper_frfs


@pytest.mark.parametrize("seed", [2, 4002])
def test_a_group_of_overlapping_modes_is_found_though_none_of_them_pays_alone(seed: int) -> None:
    draw = KINDS["plate"](seed)
    found = identify(draw.frfs).found
    f = found.modes.frequency_hz[[why is None for why in found.doubt]]
    for true in draw.frequency_hz[~draw.optional]:
        assert np.min(np.abs(f / true - 1)) < 0.002, f"{true:.2f} Hz is lost; found {f}"


def test_a_null_direction_touches_only_its_own_parameters() -> None:
    """A pole far beyond the band beside another: nothing is known of either, and all is known of the others."""
    arrangement = arrange(paper_frfs(0.01, 3))
    variance = line_scatter(arrangement.values, arrangement.measured, 1.0)
    alone = evaluate(arrangement, Terms(PAPER_HZ, PAPER_ZETA, (-2, 0)), variance)
    beside = Terms(np.append(PAPER_HZ, [9e5, 9.0001e5]), np.append(PAPER_ZETA, [0.5, 0.5]), (-2, 0))
    fit = evaluate(arrangement, beside, variance)
    own, all_of = np.diag(alone.parameter_covariance), np.diag(fit.parameter_covariance)
    assert np.allclose(all_of[:5] / fit.inflation, own[:5] / alone.inflation, rtol=0.5)
    assert np.all(all_of[5:7] > 1e3 * own[:5].max())


def test_combinations_keep_the_poles_and_lose_the_bulk() -> None:
    arrangement = arrange(paper_frfs(0.01, 3))
    noise = line_scatter(arrangement.values, arrangement.measured, 1.0)
    few, _ = compress(arrangement, noise)
    assert 5 <= len(few.values) < 15
    basis, flat = (np.concatenate([each.values.real, each.values.imag], axis=1) for each in (few, arrangement))
    back = flat @ np.linalg.pinv(basis) @ basis
    lost = 2 * np.mean((back - flat) ** 2) / np.mean(noise)
    assert lost < 2  # what is left out is noise


def test_memory_of_white_and_of_smooth_errors() -> None:
    rng = np.random.default_rng(4)
    white = rng.standard_normal((20, 2000)) + 1j * rng.standard_normal((20, 2000))
    smooth = sum(np.roll(white, shift, axis=1) for shift in range(5))
    whole, one = np.ones((20, 2000), dtype=bool), np.ones((20, 2000))
    assert memory(white, one, whole) == 1.0
    assert memory(smooth, one, whole) == pytest.approx(5, rel=0.05)  # 1 + 2 (0.8 + 0.6 + 0.4 + 0.2)


def test_scatter_of_lines_follows_frequency_and_does_not_see_resonances() -> None:
    draw = KINDS["bridge"](5)
    values, hz = draw.frfs.values[:, 1:], draw.frfs.frequency_hz[1:]
    scatter = np.sqrt(np.median(line_scatter(values, np.ones(values.shape, dtype=bool), 1.0), axis=0))
    low, high = scatter[np.argmin(np.abs(hz - 1))], scatter[np.argmin(np.abs(hz - 7))]
    assert 5 < low / high < 60  # 1/f² down to a floor
    peak = np.argmin(np.abs(hz - draw.frequency_hz[2]))
    assert scatter[peak] < 0.3 * np.sqrt(np.mean(np.abs(values[:, peak]) ** 2))


def test_leakage_is_left_out_only_where_there_is_some() -> None:
    draw = KINDS["bridge"](5)
    cut, said = leakage(arrange(draw.frfs))
    assert 0.5 < cut.frequency_hz[0] < draw.frequency_hz[0]
    assert "leakage below" in said[0]
    for clean in (paper_frfs(0.05, 1), paper_frfs(0.0)):
        assert leakage(arrange(clean))[1] == []
