"""Correlation criteria and pairing."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fecore
from fecore.correlation import _FREQUENCY_SCALE as FREQUENCY_SCALE
from fecore.correlation import (
    CRITERIA,
    Pairing,
    auto_mac,
    comac,
    correlate,
    csac,
    csf,
    fdac,
    frac,
    frequency_error,
    mac,
    pair_modes,
    sac,
)
from fecore.errors import InputError
from tests.support.places import ROOT


def random_complex(*shape: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def test_mac_of_a_worked_pair() -> None:
    # |(1, 1j)ᴴ(1, 0)|² / (2 · 1) = 0.5; the transpose that the paper prints would give (1, 1j)ᵀ(1, 1j) = 0
    assert mac([[1, 1j]], [[1, 0]])[0, 0] == pytest.approx(0.5, abs=1e-15)
    assert mac([[1, 1j]], [[1, 1j]])[0, 0] == pytest.approx(1, abs=1e-15)


@settings(max_examples=40)
@given(
    st.integers(1, 5),
    st.integers(1, 8),
    st.floats(-150, 150),
    st.floats(0, 6.28),
    st.integers(0, 99),
)
def test_mac_does_not_see_scale_or_phase(
    n: int, p: int, power: float, phase: float, seed: int
) -> None:
    a, b = random_complex(n, p, seed=seed), random_complex(3, p, seed=seed + 1)
    first = mac(a, b)
    assert np.all((first >= 0) & (first <= 1))
    assert np.allclose(mac(a * 10**power * np.exp(1j * phase), b), first, atol=1e-12)
    assert np.allclose(mac(b, a), first.T, atol=1e-14)
    assert np.allclose(np.diag(auto_mac(a)), 1, atol=1e-12)


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


def test_fdac_is_csac_on_its_diagonal_and_follows_shifted_lines() -> None:
    e, n = random_complex(4, 6, seed=1), random_complex(4, 7, seed=2)
    values = fdac(e, n)
    assert values.shape == (6, 7)
    for i in range(6):
        for j in range(7):
            x, y = e[:, i], n[:, j]
            top = abs(np.vdot(x, y)) ** 2 / (np.vdot(x, x).real * np.vdot(y, y).real)
            assert values[i, j] == pytest.approx(top, rel=1e-12)
    assert np.allclose(np.diag(fdac(e, n[:, :6])), csac(e, n[:, :6]), rtol=1e-12)
    shifted = np.roll(e, 2, axis=1)  # the model's frequencies are two lines higher
    assert list(np.argmax(fdac(e, shifted), axis=1)) == [2, 3, 4, 5, 0, 1]
    with pytest.raises(InputError, match="are 4 and 3"):
        fdac(e, n[:3])


def test_comac_finds_the_dof_that_disagrees() -> None:
    e = random_complex(5, 6, seed=3)
    assert np.allclose(comac(e, 3.7 * np.exp(0.4j) * e), 1, atol=1e-12)  # scale and phase
    assert np.allclose(comac(e, -e), 1, atol=1e-12)
    n = e.copy()
    n[:, 2] = random_complex(5, 1, seed=4)[:, 0]
    assert np.argmin(comac(e, n)) == 2
    unit = lambda rows: np.abs(rows) / np.linalg.norm(rows, axis=1, keepdims=True)  # noqa: E731
    x, y = unit(e), unit(n)
    plain = np.sum(x * y, axis=0) ** 2 / (np.sum(x**2, axis=0) * np.sum(y**2, axis=0))
    assert np.allclose(comac(e, n), plain, rtol=1e-12)
    assert np.allclose(comac(e[:1], n[:1]), 1)  # of one pair it says nothing


@pytest.mark.parametrize("name", CRITERIA)
def test_each_criterion_is_whole(name: str) -> None:
    """A row names its function, what it shows and where; the guide has its figure and its term."""
    criterion = CRITERIA[name]
    assert getattr(fecore, name) is criterion.function
    assert criterion.meaning
    assert criterion.says
    assert criterion.sentence
    assert f"`{criterion.figure}`" in (ROOT / "docs/figures.md").read_text(), "docs/figures.md"
    assert f"**{criterion.label}**" in (ROOT / "docs/glossary.md").read_text(), "docs/glossary.md"
    assert f"`{criterion.member}" in (ROOT / "docs/results.md").read_text(), "docs/results.md"
    first, second = random_complex(4, 6, seed=1), random_complex(4, 6, seed=2)
    values = correlate(criterion.of, first, second)[name]
    assert np.all((values >= 0) & (values <= 1))
    same = correlate(criterion.of, first, first)[name]
    best = {1.0: "agreement", 0.0: "difference"}
    assert np.round((np.diag(same) if same.ndim == 2 else same).mean(), 12) in best


def test_dead_channels_and_lines_are_nan_alone() -> None:
    e = random_complex(3, 4)
    e[1] = 0
    assert np.isnan(frac(e, e)[1])
    assert np.allclose(frac(e, e)[[0, 2]], 1)
    e[:, 3] = 0
    assert np.isnan(csf(e, e)[3])
    assert np.isnan(mac(e, e)[1]).all()


def test_pairing_is_the_best_of_all_permutations() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        model = rng.standard_normal((5, 8))
        measured = model[rng.permutation(5)[:4]] + 0.5 * rng.standard_normal((4, 8))
        hz = np.linspace(100, 100.1, 5)  # so close that frequency does not matter
        pairing = pair_modes(measured, model, hz[:4], hz, minimum_mac=0.0)
        worth = np.maximum(-np.log(1.05 - mac(measured, model)), 1e-6)
        best = max(
            itertools.permutations(range(5), 4), key=lambda order: sum(worth[range(4), list(order)])
        )
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


ALIASED = np.array([[1, 0, 0], [0.1, 1, 1], [0.1, 1, 1.02]])  # the last two are sampled alike
ALIKE = np.array([[1, 0, 0], [1, 0.1, 0], [1, 0.05, 0]])
MIXED, ONE = np.array([[1.01, 0.01, 0.01, 0.01], [0.01, 0.01, 1.01, 0.01], [1, 1, 1, 1]]), np.eye(1)
INSIDE, OUTSIDE = (
    [100 * (1 - by), 100, 100 * (1 + by)] for by in (0.9 * FREQUENCY_SCALE, 1.1 * FREQUENCY_SCALE)
)


# fmt: off
PAIRINGS = [
    pytest.param(None, None, [25, 160, 440], [26, 158, 400, 441, 900], {},
                 {"pairs": ((0, 0), (1, 1), (2, 3)), "mac": None, "unpaired_model": (2,)}, id="without shapes"),
    pytest.param(None, None, [100], [101, 120], {}, {"ambiguous": ()}, id="without shapes, another far away"),
    pytest.param(None, None, [100], [98, 103], {}, {"ambiguous": ((0, 0, 1),)}, id="without shapes, another as near"),
    pytest.param(None, None, [0.3], [0.5], {}, {"pairs": ((0, 0),)}, id="slow"),
    pytest.param(ONE, ONE, [10], [29.9], {}, {"pairs": ((0, 0),)}, id="just below thrice as high"),
    pytest.param(ONE, ONE, [10], [30.1], {}, {"pairs": ()}, id="more than thrice as high"),
    # 400 Hz was not measured
    pytest.param(MIXED, np.eye(4), [10, 30, 35], [10, 20, 30, 400], {"minimum_mac": 0.5},
                 {"pairs": ((0, 0), (1, 2)), "unpaired_measured": (2,), "unpaired_model": (1,)}, id="some of both alone"),
    pytest.param(np.eye(3)[[1]], np.eye(3), [100], INSIDE, {}, {"pairs": ((0, 1),), "unpaired_model": (0, 2)},
                 id="a little outside of the measured ones"),
    pytest.param(np.eye(3)[[1]], np.eye(3), [100], OUTSIDE, {}, {"pairs": ((0, 1),), "unpaired_model": ()},
                 id="outside of the measured ones"),
    pytest.param(ALIASED[[0, 2]], ALIASED, [100, 800], [100, 640, 810], {},
                 {"pairs": ((0, 0), (1, 2)), "ambiguous": ((1, 2, 1),)}, id="aliased: frequency decides, and says so"),
    pytest.param(ALIKE[[0]], ALIKE, [100], [100, 140, 145], {}, {"ambiguous": ((0, 0, 2),)}, id="the rival most alike"),
    pytest.param(ALIKE[[0]], ALIKE, [100], [100, 151, 160], {}, {"ambiguous": ()}, id="half as high again is no rival"),
    pytest.param(np.eye(2), np.eye(2)[[0, 0, 1]], [10, 30], [10, 10.5, 30], {"hidden": [0]},
                 {"pairs": ((0, 1), (1, 2)), "unpaired_model": ()}, id="hidden"),
    pytest.param(None, None, [10], [10, 12], {"hidden": [0]}, {"pairs": ((0, 1),)}, id="hidden, without shapes"),
]
# fmt: on


@pytest.mark.parametrize(
    ("measured", "model", "measured_hz", "model_hz", "choices", "expected"), PAIRINGS
)
def test_who_is_paired_with_whom(measured, model, measured_hz, model_hz, choices, expected) -> None:
    pairing = pair_modes(measured, model, measured_hz, model_hz, **choices)
    assert {name: getattr(pairing, name) for name in expected} == expected


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
def test_a_distance_in_frequency_costs_as_much_as_some_mac(
    likeness: float, scales: float, partner: int
) -> None:
    model = [[np.sqrt(likeness), np.sqrt(1 - likeness)], [1, 0]]
    assert pair_modes(
        [[1, 0]], model, [100], [100, 100 * np.exp(scales * FREQUENCY_SCALE)]
    ).pairs == ((0, partner),)


def test_an_error_is_relative_to_the_measured_frequency() -> None:
    assert frequency_error([0.4], [0.5]) == pytest.approx([0.25])


def test_messages_count_modes_from_one() -> None:
    pairing = Pairing(((0, 1),), None, (1,), (0,), ((0, 1, 2),))
    assert pairing.messages([10, 35], [9, 10.5, 11]) == (
        "measured mode 2 (35.00 Hz) has no partner in the model",
        "model mode 1 (9.00 Hz) was not measured",
        (
            "measured mode 1 (10.00 Hz) is paired with model mode 2 (10.50 Hz), but model mode 3"
            " (11.00 Hz) fits nearly as well"
        ),
    )


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
    few = pair_modes(
        turn @ np.eye(2, 8), np.eye(2, 8), [100.0, 100.1], [100.2, 100.3], 0.6, mixing=0.01
    )
    assert not few.pairs
    # A hidden mode mixes with none.
    assert not pair_modes(
        turn @ shapes, shapes, [100.0, 100.1], [100.2, 100.3], 0.6, hidden=(1,), mixing=0.01
    ).pairs
