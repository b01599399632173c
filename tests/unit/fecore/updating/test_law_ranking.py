"""The ranking of damping laws against generalised least squares written out, and what it says in
words.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.dynamics.damping_laws import RAYLEIGH, CaugheySeries
from fecore.dynamics.mechanism_laws import MechanismDamping
from fecore.updating.laws import LawRanking, MeasuredRatios, RankedLaw, rank_laws

OMEGA = 2 * np.pi * np.array([25.0, 160.0, 400.0, 445.0, 866.0])
RATIO = (30 / OMEGA + 1e-5 * OMEGA) / 2 * np.array([1.01, 0.98, 1.3, 1.0, 1.0])
NOISE = np.diag([0.01, 0.02, 0.005, 0.01, 0.03]) ** 2 + 1e-5
RATIOS = MeasuredRatios(OMEGA, RATIO, NOISE)


@pytest.mark.parametrize("scatter", [1.0, 0.01])  # a law that fits has no wider covariance for it
def test_laws_are_ranked_by_generalised_least_squares(scatter: float) -> None:
    law = (30 / OMEGA + 1e-5 * OMEGA) / 2
    ratios = replace(RATIOS, ratio=law * (RATIO / law) ** scatter)
    (found,) = rank_laws(ratios, [0, 1, 2, 4, 6], [RAYLEIGH]).laws
    B = np.column_stack([1 / OMEGA, OMEGA]) / 2 / ratios.ratio[:, None]
    V = NOISE + 0.02**2 * np.eye(5)
    W = np.linalg.inv(V)
    spread = np.linalg.inv(B.T @ W @ B)
    gain = spread @ B.T @ W
    coefficients = gain.sum(axis=1)
    missed = B @ coefficients - 1
    chi_squared = missed @ W @ missed
    assert bool(chi_squared > 3) is (scatter == 1.0)
    np.testing.assert_allclose(found.coefficients, coefficients, rtol=1e-9)
    np.testing.assert_allclose(found.missed, missed, atol=1e-10)
    assert found.chi_squared == pytest.approx(chi_squared)
    assert found.bic == pytest.approx(chi_squared + 2 * np.log(5))
    np.testing.assert_allclose(found.covariance, spread * max(1, chi_squared / 3), rtol=1e-8)
    np.testing.assert_allclose(found.noise_covariance, gain @ NOISE @ gain.T, rtol=1e-8)
    numbers = [(1, 2, 3, 5, 7)[k] for k in range(5) if abs(missed[k]) > 3 * np.sqrt(V[k, k])]
    assert [number for number, _ in found.named] == numbers
    assert (3 in numbers) is (scatter == 1.0)
    assert [miss for _, miss in found.named] == [
        found.missed[(1, 2, 3, 5, 7).index(number)] for number in numbers
    ]


LOSSES = MechanismDamping("mechanism", (("E", (0,)), ("G", (1,))))


def ranked(
    shear: list[float], losses: tuple[float, float, float], noise: float = 0.01
) -> RankedLaw:
    """The law by mechanism on modes with these shares of shear that follow it, a0 and two loss
    factors, exactly.
    """
    strain = np.column_stack([1 - np.array(shear), shear])
    exact = (losses[0] + OMEGA * (strain @ losses[1:])) / OMEGA / 2
    return rank_laws(
        MeasuredRatios(OMEGA, exact, noise**2 * np.eye(5), strain), list(range(5)), [LOSSES]
    ).laws[0]


def test_three_standard_deviations_name_a_mode_and_refute_a_mechanism() -> None:
    law, sd = (30 / OMEGA + 1e-5 * OMEGA) / 2, np.sqrt(np.diag(NOISE) + 0.02**2)
    off = []
    for factor in np.linspace(1.0, 1.2, 41):
        ratios = replace(RATIOS, ratio=law * np.array([1, 1, factor, 1, 1]))
        found = rank_laws(ratios, [0, 1, 2, 3, 4], [RAYLEIGH]).laws[0]
        off.append(abs(found.missed[2]) / sd[2])
        assert (3 in [number for number, _ in found.named]) is bool(off[-1] > 3)
    below = []
    for shear in np.linspace(-0.001, 0.0, 41):
        mechanism = ranked([0.01, 0.02, 0.9, 0.03, 0.06], (10.0, 0.03, shear))
        below.append(mechanism.coefficients[2] / np.sqrt(mechanism.covariance[2, 2]))
        assert bool(np.isinf(mechanism.bic)) is bool(below[-1] < -3)
    for tried in (off, np.negative(below)):
        assert np.any((np.array(tried) > 2.5) & (np.array(tried) < 3))
        assert np.any((np.array(tried) > 3) & (np.array(tried) < 3.5))


def law(name: str, bic: float, named: tuple[tuple[int, float], ...] = ()) -> RankedLaw:
    exact = rank_laws(RATIOS, [0, 1, 2, 3, 4], [RAYLEIGH]).laws[0]
    return replace(exact, law=CaugheySeries(name, (0,)), bic=bic, named=named)


def test_what_a_user_must_know_of_the_first_law() -> None:
    first, better, same = law("first", 30.0), law("better", 19.9), law("same", 19.9 + 4e-7)
    assert LawRanking((first, law("fair", 20.0))).findings() == []
    assert LawRanking((first, better, same)).preferred is same
    assert [each.text for each in LawRanking((first, better)).findings()] == [
        "the first law is inadequate for this damping; the evidence prefers better (BIC 19.9"
        " against 30.0)"
    ]
    missing = law("first", 10.0, ((2, -0.381), (5, 0.2)))
    assert [each.text for each in LawRanking((missing, better)).findings()] == [
        "the first law is inadequate for this damping: it misses mode 2 by -38 %, mode 5 by +20 %"
    ]
