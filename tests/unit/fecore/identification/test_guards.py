"""What refuses a pole or makes it doubtful: each reason on either side of its bound."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fecore.frf import Dof, FrfSet
from fecore.identification import guards
from fecore.identification.arrangement import Arrangement, arrange
from fecore.identification.basis import Terms
from fecore.identification.compression import compress
from fecore.identification.error_model import ErrorModel
from fecore.identification.refinement import Fit, evaluate
from fecore.identification.search import Search
from fecore.identification.sifting import Need, Sifted, _fails, _within_drift, without_twins
from fecore.identification.subsets import Again

RANDOM = np.random.default_rng(3)
SHAPES = RANDOM.standard_normal((12, 2))


def measured(count: int = 12, first_hz: float = 60.0) -> Arrangement:
    """Receptances of two modes with real shapes, 1 Hz from line to line, with little noise."""
    lines = first_hz + np.arange(161.0)
    omega, zeta = 2 * np.pi * np.array([101.3, 160.7]), np.array([0.01, 0.02])
    s = 2j * np.pi * lines[:, None]
    values = SHAPES[:count] @ (1 / (s**2 + 2 * zeta * omega * s + omega**2)).T
    white = np.random.default_rng(7).standard_normal((2, *values.shape))
    dofs = tuple(Dof(i + 1, 3) for i in range(count))
    return arrange(FrfSet(lines, values + 1e-7 * (white[0] + 1j * white[1]), dofs, (Dof(99, 3),) * count, "receptance"))


def fitted(
    hz: float = 101.3,
    zeta: float = 0.01,
    sd: tuple[float, float] = (1e-4, 1e-4),
    arrangement: Arrangement | None = None,
) -> tuple[Arrangement, Fit]:
    """A fit whose first pole is the one in question; standard deviations of its ln ω and of its ζ are given."""
    arrangement = arrangement or measured()
    fit = evaluate(
        arrangement,
        Terms(np.array([hz, 160.7]), np.array([zeta, 0.02]), (0,)),
        np.full(arrangement.values.shape, 2e-14),
    )
    known = np.diag(1 / np.array([sd[0], 1e-4, sd[1], 1e-4]) ** 2)
    return arrangement, replace(fit, information=known, chi_squared=0.0)


def with_residues(fit: Fit, residues: np.ndarray) -> Fit:
    """The fit with other (N, n) residues, and nothing beside them."""
    coefficients = np.zeros_like(fit.linear.coefficients)
    coefficients[:, 0 : 2 * residues.shape[1] : 2] = residues.real
    coefficients[:, 1 : 2 * residues.shape[1] : 2] = residues.imag
    return replace(fit, linear=replace(fit.linear, coefficients=coefficients))


def need(evidence: float, ratio: float, fit: Any = None) -> Need:
    return Need(evidence, 0.5, ratio, fit)


def impossible(arrangement: Arrangement, fit: Fit, evidence: float | None = 100.0) -> str | None:
    needs = {} if evidence is None else {0: need(evidence, 100.0)}
    return guards._impossible(arrangement, fit, 0, needs)


@pytest.mark.parametrize(
    ("how", "evidence", "reason"),
    [
        ({}, 1.0, None),
        ({}, 0.99, "lowers the misfit by less"),
        ({}, None, "lowers the misfit by less"),
        ({"zeta": 0.59}, 100.0, None),
        ({"zeta": 0.61}, 100.0, "damping of 61 % is a trend"),
        ({"sd": (0.029, 1e-4)}, 100.0, None),
        ({"sd": (0.031, 1e-4)}, 100.0, "the data hardly determine it"),
        ({"sd": (0.0996, 1e-4)}, 100.0, "the data hardly determine it (± 10.0 % in frequency, ± 1 % of its damping)"),
        ({"sd": (1e-4, 0.0049)}, 100.0, None),
        ({"sd": (1e-4, 0.0051)}, 100.0, "the data hardly determine it (± 0.0 % in frequency, ± 51 % of its damping)"),
        ({"zeta": 0.002, "sd": (1e-4, 0.0049)}, 100.0, None),  # no width is known better than a line
        ({"zeta": 0.002, "sd": (1e-4, 0.0051)}, 100.0, "the data hardly determine it"),
    ],
)
def test_a_pole_that_cannot_be_a_mode(how: dict[str, Any], evidence: float | None, reason: str | None) -> None:
    found = impossible(*fitted(**how), evidence)
    assert found is reason is None or (found is not None and reason is not None and reason in found)


def test_drift_lies_within_three_lines_of_zero() -> None:
    near_zero = measured(first_hz=1.0)
    for hz, refused in ((2.9, True), (3.1, False)):
        found = impossible(*fitted(hz, 0.1, arrangement=near_zero))
        assert (found == "it lies within 3 lines of 0 Hz, as drift and rigid-body motion do") is refused


@pytest.mark.parametrize(
    ("count", "shown", "reason"),
    [
        (12, 2, None),
        (12, 1, "only 2+Z/99+Z shows it: a fault of that record rather than a mode of the structure"),
        (12, 0, "no single FRF shows it: a fault of that record rather than a mode of the structure"),
        (3, 1, "only 2+Z/99+Z shows it: a fault of that record rather than a mode of the structure"),
        (2, 1, None),
    ],
)
def test_a_mode_is_seen_in_two_frfs_where_there_are_three(count: int, shown: int, reason: str | None) -> None:
    arrangement, fit = fitted(arrangement=measured(count))
    residues = np.zeros((count, 2), dtype=complex)
    residues[1 : 1 + shown, 0] = -1e-3j
    found = impossible(arrangement, with_residues(fit, residues))
    if found is not None and shown == 1:
        found = found.replace(arrangement.label(1), "2+Z/99+Z")
    assert found == reason


@pytest.mark.parametrize("k", [0, 1])
def test_an_frf_shows_a_pole_whose_residue_pays_for_itself(k: int) -> None:
    _, fit = fitted()
    part = fit.linear.covariance[4, 2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
    pays = np.log(2 * 12 * 161) * (2 * 12 + 2) / 12
    for share, seen in ((1.01, [4]), (0.99, [])):
        coefficients = np.zeros_like(fit.linear.coefficients)
        coefficients[4, 2 * k] = np.sqrt(share * pays / np.linalg.inv(part)[0, 0])
        assert guards._seen_in(replace(fit, linear=replace(fit.linear, coefficients=coefficients)), k) == seen


COMPLEX = np.exp(2j * np.pi * np.arange(12) / 12)[:, None] * np.array([1.0, 0])  # of no phase of its own
EQUAL = np.ones((12, 1)) * np.array([-1e-3j, 0])


def doubt(
    evidence: float = 1000.0,
    ratio: float = 1000.0,
    size: float = 2.0,
    stable: float = 1.0,
    found: bool = True,
    residues: np.ndarray = EQUAL,
    **how: Any,
) -> str | None:
    arrangement, fit = fitted(**how)
    again = Again("halves", np.array([[100.0], [102.0]]), np.array([[0.01], [0.03]]), np.array([found, True]))
    witnesses = guards.Witnesses({0: need(evidence, ratio)}, again, np.array([stable, 1.0]))
    return guards._doubt(arrangement, with_residues(fit, residues[: len(arrangement.pairs)]), 0, witnesses, size)


SMALL = {"evidence": 19.0, "ratio": 49.0, "size": 0.99}


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ({}, None),
        ({"evidence": 4.9, "ratio": 2.9}, "what it explains is 2.9 times the errors"),
        ({"evidence": 4.9, "ratio": 3.1}, None),
        ({"evidence": 5.1, "ratio": 2.9}, None),
        ({"residues": 1e-3 * COMPLEX, "ratio": 99.0}, "hardly that of a mode (modal phase collinearity 0.00)"),
        ({"residues": 1e-3 * COMPLEX, "ratio": 101.0}, None),
        ({"found": False}, "halves do not both find it again (100.00 Hz with 1.00 % and 102.00 Hz with 3.00 %)"),
        ({"evidence": 9.9, "stable": 0.49}, "it is not stable: 49 % of the orders"),
        ({"evidence": 9.9, "stable": 0.51}, None),
        ({"evidence": 10.1, "stable": 0.49}, None),
        (SMALL, "it is small, 99 % as high as a distortion"),
        (
            SMALL | {"stable": 0.7, "ratio": 49.4},
            "explains 49 times the errors of the FRFs: a weak non-linearity may look like it"
            " (it comes back in 70 % of the orders)",
        ),
        (SMALL | {"evidence": 21.0}, None),
        (SMALL | {"ratio": 51.0}, None),
        (SMALL | {"size": 1.01}, None),
        ({"evidence": 9.9, "hz": 60.58}, "it lies at the end of the band"),  # within half a half bandwidth
        ({"evidence": 9.9, "hz": 60.7}, None),
        ({"evidence": 9.9, "hz": 219.42}, "it lies at the end of the band"),
        ({"evidence": 10.1, "hz": 219.42}, None),
        ({"evidence": 9.9, "hz": 60.45, "zeta": 0.001}, "it lies at the end of the band"),  # within half a line
        ({"evidence": 9.9, "hz": 60.55, "zeta": 0.001}, None),
    ],
)
def test_what_speaks_against_a_mode(how: dict[str, Any], reason: str | None) -> None:
    how = {"zeta": 0.02, **how} if "hz" in how and "zeta" not in how else how
    found = doubt(**how)
    assert found is reason is None or (found is not None and reason is not None and reason in found)


@pytest.mark.parametrize("count", [12, 4, 3])
def test_a_weak_mode_is_doubtful_unless_the_evidence_is_strong(count: int) -> None:
    """Less than a quarter of all FRFs at its own frequency, or than half of any one, where there are four of them."""
    arrangement, fit = fitted(159.7, 0.02, arrangement=measured(count))  # beside another, larger mode
    again = Again("halves", np.zeros((2, 2)), np.zeros((2, 2)), np.array([True, True]))
    seen = set()
    for size in np.geomspace(0.05, 3.0, 15):
        for largest_size in (size, 10.0):
            residues = np.ones((count, 1)) * np.array([-1e-3j * size, -1e-3j])
            residues[0, 0] *= largest_size / size
            thin = with_residues(fit, residues)
            largest, share = guards.shares(arrangement, thin, 0)
            weak = (2 * share if count < 4 else min(largest, 2 * share)) < 0.5
            seen.add((weak, largest < 0.5, share < 0.25))
            for evidence in (9.9, 10.1):
                witnesses = guards.Witnesses({0: need(evidence, 1000.0)}, again, np.ones(2))
                found = guards._doubt(arrangement, thin, 0, witnesses, 2.0)
                said = found == f"it is weak, {100 * share:.0f} % of the FRFs at its own frequency"
                assert said is (weak and evidence < 10)
    assert {each[0] for each in seen} == {True, False}


@pytest.mark.parametrize("k", [0, 1])
def test_shares_are_of_the_response_at_the_modes_own_frequency(k: int) -> None:
    hz, zeta = np.array([101.0, 160.0]), np.array([0.01, 0.02])
    arrangement = measured()
    fit = evaluate(arrangement, Terms(hz, zeta, (0,)), np.full(arrangement.values.shape, 2e-14))
    residues = np.array([[-1e-3j, -2e-3j]] * 12)
    residues[0] = [-3e-3j, -1e-3j]
    s, omega = 2j * np.pi * hz[k], 2 * np.pi * hz
    pole = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    each = residues / (s - pole) + residues.conj() / (s - pole.conj())
    mode, whole = np.abs(each[:, k]), np.abs(each.sum(axis=1))
    largest, share = guards.shares(arrangement, with_residues(fit, residues), k)
    assert largest == pytest.approx(np.max(mode / whole))
    assert share == pytest.approx(np.linalg.norm(mode) / np.linalg.norm(whole))


def test_heights_are_those_of_resonances_over_the_highest_in_band() -> None:
    arrangement, fit = fitted(50.0)  # out of band
    residues = np.array([[-1e-3j, -2e-3j]] * 12)
    high = guards.heights(arrangement, with_residues(fit, residues))
    assert high == pytest.approx([1e-3 / 50 / 0.01 / (2e-3 / 160.7 / 0.02), 1.0])
    none = evaluate(arrangement, Terms(np.empty(0), np.empty(0), (0,)), fit.variance)
    assert guards.heights(arrangement, none).size == 0


def test_a_tone_of_the_mains_between_lines_may_look_narrow() -> None:
    def hum(first_hz: float, hz: float) -> float | None:
        return guards._hum(measured(first_hz=first_hz), hz)

    assert (hum(60.3, 100.49), hum(60.3, 100.51), hum(60.3, 99.51)) == (100.0, None, 100.0)
    assert hum(60.3, 119.6) == 120.0
    assert hum(60.09, 100.1) is None  # on a line, but for what the mains wander
    assert hum(60.11, 100.1) == 100.0
    assert hum(0.3, 0.2) is None  # 0 Hz is no multiple
    narrow = {"hz": 100.2, "arrangement": measured(first_hz=60.3)}
    assert (
        doubt(zeta=0.0049, **narrow)
        == "it is as narrow as a tone and lies at 100 Hz, a multiple of the mains frequency"
    )
    assert doubt(zeta=0.0051, **narrow) is None


def distorted(hz: float, likeness: float, count: int = 12, high: tuple[float, ...] = (1.0, 0.5, 0.1)) -> str | None:
    """What is said of a pole whose shape has this MAC with the product of two others, at 70 and 90 Hz."""
    arrangement = measured(count)
    fit = evaluate(
        arrangement, Terms(np.array([70.0, 90.0, hz]), np.full(3, 0.01), ()), np.full(arrangement.values.shape, 2e-14)
    )
    shapes = np.random.default_rng(1).standard_normal((count, 3)).astype(complex)
    product = shapes[:, 0] * (shapes[:, 0] if hz < 150 else shapes[:, 1])
    aside = shapes[:, 2] - product * (product.conj() @ shapes[:, 2]) / (product.conj() @ product)
    unit = [part / np.linalg.norm(part) for part in (product, aside)]
    shapes[:, 2] = np.sqrt(likeness) * unit[0] + np.sqrt(1 - likeness) * unit[1]
    return guards._distortion(arrangement, with_residues(fit, shapes), 2, np.array(high))


def test_a_product_of_two_shapes_at_their_sum_is_their_distortion() -> None:
    said = "it lies at the sum of 70.00 and 90.00 Hz with the product of their shapes"
    assert str(distorted(160.0, 0.81)).startswith(said)
    assert str(distorted(161.5, 0.81)).startswith(said)  # within the half bandwidth
    assert distorted(161.7, 0.81) is None
    assert distorted(160.0, 0.79) is None
    assert str(distorted(140.0, 0.9)).startswith("it lies at the sum of 70.00 and 70.00 Hz")
    assert str(distorted(160.0, 0.9, 6)).startswith(said)
    assert distorted(160.0, 0.9, 5) is None  # too few FRFs
    assert distorted(160.0, 0.9, high=(1.0, 0.05, 0.1)) is None  # of a mode that is no higher


def test_the_height_of_a_hidden_distortion_is_the_root_of_the_errors() -> None:
    for relative, height in ((4e-4, 0.02), (0.0, 1e-3)):
        search: Any = SimpleNamespace(errors=SimpleNamespace(relative=relative))
        assert guards.hidden_distortion(search) == pytest.approx(height)


def test_three_lines_about_a_frequency() -> None:
    arrangement = measured()
    assert [guards._lines_about(arrangement, hz) for hz in (60.2, 61.4, 219.8, 218.6)] == [
        [0, 1],
        [0, 1, 2],
        [159, 160],
        [158, 159, 160],
    ]


@pytest.mark.parametrize(
    ("hz", "zeta", "evidence", "ratio", "reason"),
    [
        (101.5, 0.01, 0.99, 9.0, "it lowers the misfit by less than its unknowns are worth"),
        (101.5, 0.01, 1.49, 9.0, "it is a part of the mode at 101.30 Hz"),
        (101.5, 0.01, 1.51, 1.99, "it is a part of the mode at 101.30 Hz"),
        (101.5, 0.01, 1.51, 2.0, None),
        (105.1, 0.01, 1.2, 1.2, "it is a part of the mode at 101.30 Hz"),  # 1.5 summed half bandwidths
        (105.3, 0.01, 1.2, 1.2, None),
        (
            102.3,
            1e-4,
            1.2,
            1.2,
            "it is a part of the mode at 101.30 Hz",
        ),  # four half bandwidths of the narrower, and a line
        (102.4, 1e-4, 1.2, 1.2, None),
    ],
)
def test_a_pole_beside_another_is_needed_more_than_one_alone(
    hz: float, zeta: float, evidence: float, ratio: float, reason: str | None
) -> None:
    arrangement = measured()
    variance = np.full(arrangement.values.shape, 2e-14)
    fit = evaluate(arrangement, Terms(np.array([101.3, hz, 160.7]), np.array([0.01, zeta, 0.02]), (0,)), variance)
    search = Search(compress(arrangement, variance), ErrorModel(variance, np.abs(arrangement.values) ** 2))
    found = _fails(search, fit, 1, need(evidence, ratio))
    assert found is reason is None or (found is not None and reason is not None and reason in found)


def test_two_poles_nearer_than_the_sessions_drift_are_one_mode() -> None:
    """Each FRF here has a session of its own, in which no shape can be seen."""
    arrangement = measured()
    variance = np.full(arrangement.values.shape, 2e-14)
    terms = Terms(np.array([80.0, 100.3, 102.3, 160.7]), np.array([0.01, 0.01, 0.01, 0.02]), (0,))
    fit = evaluate(arrangement, terms, variance)
    both = with_residues(fit, np.array([0.0, 2.0, 1.0, 0.0]) * np.ones((12, 1)))
    search = Search(compress(arrangement, variance), ErrorModel(variance, np.abs(arrangement.values) ** 2))
    sifted = Sifted(fit, {k: need(5.0 + k, 9.0, fit) for k in range(4)}, ())
    assert without_twins(search, sifted, arrangement, both, drift=0.0199) is None
    found = without_twins(search, sifted, arrangement, both, drift=0.0201)
    assert found is not None
    # Twelve receptances with noise of 1e-3 of their peaks fix a frequency to some 1e-5.
    assert found.fit.terms.frequency_hz[1:] == pytest.approx([101.3, 160.7], rel=1e-4)
    assert (found.needs[0], found.needs[2]) == (sifted.needs[0], sifted.needs[3])
    assert found.needs[1].ratio > 100  # the mode itself, and no half of it
    ((hz, _, reason),) = found.dropped
    assert hz == 102.3  # the weaker
    assert "it is a part of the mode at 100.30 Hz" in reason


def test_two_modes_with_sensor_ratios_of_their_own_are_no_drift() -> None:
    pairs = [(Dof(100 + sensor, 3), Dof(1 + hit, 3)) for hit in range(20) for sensor in range(3)]
    values = np.ones((60, 40), dtype=complex)
    arrangement = arrange(FrfSet(np.arange(1.0, 41.0), values, *zip(*pairs, strict=True)))
    fit = evaluate(arrangement, Terms(np.array([20.0, 20.4]), np.array([0.01, 0.01]), (0,)), np.ones((60, 40)))
    hits = np.random.default_rng(5).standard_normal((2, 20))
    sensors = np.array([[1.0, 0.4, -0.7], [0.2, 1.0, 0.5]])
    halves = 1j * np.stack([np.outer(hits[0], sensors[0]).ravel(), np.outer(2 * hits[0], sensors[0]).ravel()], axis=1)
    modes = 1j * np.stack([np.outer(hit, sensor).ravel() for hit, sensor in zip(hits, sensors, strict=True)], axis=1)
    assert _within_drift(arrangement, with_residues(fit, halves), 0.05) == (0, 1)
    assert _within_drift(arrangement, with_residues(fit, halves[:, ::-1]), 0.05) == (1, 0)
    assert _within_drift(arrangement, with_residues(fit, modes), 0.05) is None
