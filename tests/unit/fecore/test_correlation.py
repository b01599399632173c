"""Correlation criteria and pairing."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fecore.correlation import _FREQUENCY_SCALE as FREQUENCY_SCALE
from fecore.correlation import (
    Pairing,
    auto_mac,
    csac,
    csf,
    frac,
    frequency_error,
    mac,
    pair_modes,
    sac,
)


def random_complex(*shape: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def test_mac_of_a_worked_pair() -> None:
    # |(1, 1j)ᴴ(1, 0)|² / (2 · 1) = 0.5; the transpose that the paper prints would give (1, 1j)ᵀ(1, 1j) = 0
    assert mac([[1, 1j]], [[1, 0]])[0, 0] == pytest.approx(0.5, abs=1e-15)
    assert mac([[1, 1j]], [[1, 1j]])[0, 0] == pytest.approx(1, abs=1e-15)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.integers(1, 5),
    st.integers(1, 8),
    st.floats(-150, 150),
    st.floats(0, 6.28),
    st.integers(0, 99),
)
def test_mac_does_not_see_scale_or_phase(n: int, p: int, power: float, phase: float, seed: int) -> None:
    a, b = random_complex(n, p, seed=seed), random_complex(3, p, seed=seed + 1)
    first = mac(a, b)
    assert np.all((first >= 0) & (first <= 1))
    assert np.allclose(mac(a * 10**power * np.exp(1j * phase), b), first, atol=1e-12)
    assert np.allclose(mac(b, a), first.T, atol=1e-14)
    assert np.allclose(np.diag(auto_mac(a)), 1, atol=1e-12)


def test_a_zero_shape_is_nan_alone() -> None:
    value = mac([[0, 0], [1, 2]], [[1, 2]])
    assert np.isnan(value[0, 0])
    assert value[1, 0] == pytest.approx(1)


def test_criteria_of_frfs_against_their_definitions() -> None:
    e, n = random_complex(4, 6, seed=1), random_complex(4, 6, seed=2)
    for i in range(4):
        top = abs(np.vdot(e[i], n[i])) ** 2 / (np.vdot(e[i], e[i]).real * np.vdot(n[i], n[i]).real)
        assert frac(e, n)[i] == pytest.approx(top, rel=1e-13)
        x, y = abs(e[i]), abs(n[i])
        assert sac(e, n)[i] == pytest.approx((x @ y) ** 2 / (x @ x * (y @ y)), rel=1e-13)
    for k in range(6):
        x, y = e[:, k], n[:, k]
        xx, yy, xy = np.vdot(x, x).real, np.vdot(y, y).real, abs(np.vdot(x, y))
        assert csac(e, n)[k] == pytest.approx(xy**2 / (xx * yy), rel=1e-13)
        assert csf(e, n)[k] == pytest.approx(2 * xy / (xx + yy), rel=1e-13)


def test_csf_sees_scale_and_csac_does_not() -> None:
    e = random_complex(5, 9)
    assert np.allclose(csac(e, 2 * e), 1)
    assert np.allclose(csf(e, 2 * e), 0.8)  # 2·2/(1 + 4)


def test_dead_channels_and_lines_are_nan_alone() -> None:
    e = random_complex(3, 4)
    e[1] = 0
    assert np.isnan(frac(e, e)[1])
    assert np.allclose(frac(e, e)[[0, 2]], 1)
    e[:, 3] = 0
    assert np.isnan(csf(e, e)[3])


def test_errors_are_relative_to_the_measured_value() -> None:
    assert np.allclose(frequency_error([100.0, 200.0], [101.0, 198.0]), [0.01, -0.01])


def test_pairing_is_the_best_of_all_permutations() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        model = rng.standard_normal((5, 8))
        measured = model[rng.permutation(5)[:4]] + 0.5 * rng.standard_normal((4, 8))
        hz = np.linspace(100, 100.1, 5)  # so close that frequency does not matter
        pairing = pair_modes(measured, model, hz[:4], hz, minimum_mac=0.0)
        worth = np.maximum(-np.log(1.05 - mac(measured, model)), 1e-6)
        best = max(itertools.permutations(range(5), 4), key=lambda order: sum(worth[range(4), list(order)]))
        assert pairing.pairs == tuple(enumerate(best))


def test_one_good_pair_is_not_given_up_for_two_poor_ones() -> None:
    # MAC [[0.99, 0.55], [0.6, 0]] (shapes need not be orthogonal)
    measured = np.array([[1, 0, 0.1, 0], [np.sqrt(0.6), 0, 0, np.sqrt(0.4)]])
    model = np.array([[1, 0, 0, 0], [np.sqrt(0.55), 0.67, 0, -np.sqrt(0.55 * 0.6 / 0.4)]])
    matrix = mac(measured, model)
    assert matrix[0, 0] > 0.98
    assert matrix[1, 1] < 1e-3
    assert 0.25 < matrix[0, 1] < 0.6
    assert pair_modes(measured, model, [100, 100], [100, 100], minimum_mac=0.2).pairs == ((0, 0),)


def test_unpaired_modes_of_both_sides_are_named() -> None:
    model = np.eye(4)
    measured = np.eye(4)[[0, 2]] + 0.01
    pairing = pair_modes(np.vstack([measured, [1, 1, 1, 1]]), model, [10, 30, 35], [10, 20, 30, 400], minimum_mac=0.5)
    assert pairing.pairs == ((0, 0), (1, 2))
    assert pairing.unpaired_measured == (2,)
    assert pairing.unpaired_model == (1,)  # 400 Hz is beyond what was measured
    text = " ".join(pairing.messages([10, 30, 35], [10, 20, 30, 400]))
    assert "35.00 Hz" in text
    assert "20.00 Hz" in text


def test_frequency_settles_spatial_aliasing_and_says_so() -> None:
    # Two sampled shapes alike: only the frequency can decide
    model = np.array([[1, 0, 0], [0.1, 1, 1], [0.1, 1, 1.02]])
    pairing = pair_modes(model[[0, 2]], model, [100, 800], [100, 640, 810])
    assert pairing.pairs == ((0, 0), (1, 2))
    assert pairing.ambiguous == ((1, 2, 1),)


@pytest.mark.parametrize(
    ("likeness", "scales", "partner"),
    [
        (0.98, 1, 1),
        (0.99, 1, 0),
        (0.95, 1.5, 1),
        (0.90, 3, 1),
        (0.92, 3, 0),
    ],  # however far off, no more than four times as much
)
def test_a_distance_in_frequency_costs_as_much_as_some_mac(likeness: float, scales: float, partner: int) -> None:
    model = [[np.sqrt(likeness), np.sqrt(1 - likeness)], [1, 0]]
    assert pair_modes([[1, 0]], model, [100], [100, 100 * np.exp(scales * FREQUENCY_SCALE)]).pairs == ((0, partner),)


def test_a_hidden_mode_is_neither_a_partner_nor_missed() -> None:
    shapes = np.eye(2)[[0, 0, 1]]
    pairing = pair_modes(np.eye(2), shapes, [10, 30], [10, 10.5, 30], hidden=[0])
    assert (pairing.pairs, pairing.unpaired_model) == (((0, 1), (1, 2)), ())
    assert pair_modes(None, None, [10], [10, 12], hidden=[0]).pairs == ((0, 1),)


def test_without_shapes_frequency_pairs() -> None:
    pairing = pair_modes(None, None, [25, 160, 440], [26, 158, 400, 441, 900])
    assert pairing.pairs == ((0, 0), (1, 1), (2, 3))
    assert pairing.mac is None
    assert pairing.unpaired_model == (2,)
    assert pair_modes(None, None, [100], [101, 120]).ambiguous == ()
    assert pair_modes(None, None, [100], [98, 103]).ambiguous == ((0, 0, 1),)


def test_messages_count_modes_from_one() -> None:
    pairing = Pairing(((0, 1),), None, (1,), (0,), ((0, 1, 2),))
    assert pairing.messages([10, 35], [9, 10.5, 11]) == (
        "measured mode 2 (35.00 Hz) has no partner in the model",
        "model mode 1 (9.00 Hz) was not measured",
        "measured mode 1 (10.00 Hz) is paired with model mode 2 (10.50 Hz), but model mode 3 (11.00 Hz) fits nearly as well",
    )


def test_slow_modes_are_paired_and_a_factor_of_three_is_the_furthest() -> None:
    assert pair_modes(None, None, [0.3], [0.5]).pairs == ((0, 0),)
    assert frequency_error([0.4], [0.5]) == pytest.approx([0.25])
    assert pair_modes(np.eye(1), np.eye(1), [10], [29.9]).pairs == ((0, 0),)
    assert pair_modes(np.eye(1), np.eye(1), [10], [30.1]).pairs == ()


def test_a_rival_is_near_in_frequency_and_the_one_most_alike() -> None:
    model = np.array([[1, 0, 0], [1, 0.1, 0], [1, 0.05, 0]])
    assert pair_modes([[1, 0, 0]], model, [100], [100, 140, 145]).ambiguous == ((0, 0, 2),)
    assert pair_modes([[1, 0, 0]], model, [100], [100, 151, 160]).ambiguous == ()


def test_a_model_mode_a_little_outside_of_the_measured_ones_was_not_measured() -> None:
    within = 1 - 0.9 * FREQUENCY_SCALE, 1 + 0.9 * FREQUENCY_SCALE
    beyond = 1 - 1.1 * FREQUENCY_SCALE, 1 + 1.1 * FREQUENCY_SCALE
    for share, expected in ((within, (0, 2)), (beyond, ())):
        pairing = pair_modes(np.eye(3)[[1]], np.eye(3), [100], [100 * share[0], 100, 100 * share[1]])
        assert pairing.pairs == ((0, 1),)
        assert pairing.unpaired_model == expected


def test_shapes_of_any_size_are_compared() -> None:
    shapes = np.array([[1e-200, 0], [3e200, 3e200]])
    assert mac(shapes, shapes) == pytest.approx(np.array([[1, 0.5], [0.5, 1]]))


def test_two_measured_modes_of_a_mixed_pair_both_have_partners_and_few_dofs_say_nothing() -> None:
    dofs = 30
    shapes = np.linalg.qr(np.random.default_rng(1).standard_normal((dofs, 2)))[0].T
    turn = np.array([[1.0, 1.0], [1.0, -1.0]])
    found = pair_modes(turn @ shapes, shapes, [100.0, 100.1], [100.2, 100.3], 0.6, mixing=0.01)
    assert found.pairs == ((0, 0), (1, 1))
    assert found.mac is not None
    assert found.mac.diagonal() == pytest.approx([1.0, 1.0])
    assert not pair_modes(turn @ shapes, shapes, [100.0, 100.1], [100.2, 100.3], 0.6).pairs
    # Two shapes span much of what a few dofs can show.
    few = pair_modes(turn @ np.eye(2, 8), np.eye(2, 8), [100.0, 100.1], [100.2, 100.3], 0.6, mixing=0.01)
    assert not few.pairs
    # A hidden mode mixes with none.
    assert not pair_modes(turn @ shapes, shapes, [100.0, 100.1], [100.2, 100.3], 0.6, hidden=(1,), mixing=0.01).pairs
