"""ASTM D3039: the hand-worked examples of docs/coupons.md, to the digits, and what is refused."""

import numpy as np
import pytest

from fecore.coupons import d3039
from fecore.coupons.curves import Curve, jump, restarts, split_runs
from fecore.coupons.d3039 import transition_strain
from fecore.errors import InputError

WIDTH = (25.02e-3, 25.00e-3, 24.98e-3)
THICKNESS = (2.01e-3, 2.00e-3, 1.99e-3)

# docs/coupons.md, example 1: strain in µε, force in N, transverse strain in µε, back face in µε
STRAIN = np.array([0, 495, 990, 1510, 2015, 2490, 3020, 5000, 8000, 10000]) * 1e-6
FORCE = np.array([0, 990.0, 1980.0, 3012.0, 4012.0, 4950.0, 5990.0, 9800.0, 15300.0, 19000.0])
TRANSVERSE = np.array([0, -124, -248, -377, -503, -622, -754, -1240, -1960, -2440]) * 1e-6


def example(**others: np.ndarray) -> Curve:
    return Curve(FORCE, STRAIN, **others)


def steady(n: int = 201, modulus: float = 40e9, ultimate: float = 0.01) -> Curve:
    strain = np.linspace(0, ultimate, n)
    return Curve(modulus * strain * 50e-6, strain, transverse_strain=-0.25 * strain)


def test_the_first_worked_example() -> None:
    result = d3039.reduce(example(transverse_strain=TRANSVERSE), WIDTH, THICKNESS)
    assert result.area_m2 == pytest.approx(50e-6, rel=1e-12)
    assert result.strength_pa == pytest.approx(380e6, rel=1e-12)
    assert result.ultimate_strain == pytest.approx(0.010, rel=1e-12)
    assert result.chord_range == pytest.approx((990e-6, 3020e-6), rel=1e-12)
    assert result.modulus_pa == pytest.approx((5990 - 1980) / 50e-6 / 2030e-6, rel=1e-12)
    assert f"{result.modulus_pa / 1e9:.4f}" == "39.5074"
    assert result.poisson_ratio == pytest.approx((754 - 248) / 2030, rel=1e-12)
    assert f"{result.poisson_ratio:.4f}" == "0.2493"
    assert result.bending_percent is None
    assert result.warnings == ()


def test_interpolated_ends_of_the_same_example() -> None:
    result = d3039.reduce(example(), WIDTH, THICKNESS, ends="interpolated")
    low = 1980 + (3012 - 1980) * 10 / 520
    high = 4950 + (5990 - 4950) * 510 / 530
    assert result.chord_range == pytest.approx((1000e-6, 3000e-6), rel=1e-12)
    assert result.modulus_pa == pytest.approx((high - low) / 50e-6 / 2000e-6, rel=1e-12)
    assert f"{result.modulus_pa / 1e9:.4f}" == "39.5091"


def test_a_specimen_that_fails_early_takes_a_quarter_to_a_half_of_its_strain() -> None:
    strain = np.arange(0, 4001, 200) * 1e-6
    stress = 40e9 * strain - 1e12 * strain**2
    result = d3039.reduce(Curve(stress * 50e-6, strain), WIDTH, THICKNESS)
    assert result.chord_range == pytest.approx((1000e-6, 2000e-6))
    # chord of a parabola: 40e9 − 1e12 (ε₁ + ε₂)
    assert result.modulus_pa == pytest.approx(40e9 - 1e12 * 3000e-6, rel=1e-12)
    assert "below 6000" in result.warnings[0]


def test_two_faces_give_the_mean_strain_and_the_bending() -> None:
    curve = steady()
    bent = Curve(curve.force_n, curve.strain * 1.06, strain_back=curve.strain * 0.94)
    result = d3039.reduce(bent, WIDTH, THICKNESS)
    assert result.modulus_pa == pytest.approx(40e9, rel=1e-12)
    assert result.bending_percent == pytest.approx(6.0, rel=1e-12)
    assert "bending" in result.warnings[0]


def test_a_gauge_taken_off_before_failure_leaves_no_ultimate_strain() -> None:
    curve = steady()
    strain = curve.strain.copy()
    strain[150:] = np.nan
    result = d3039.reduce(Curve(curve.force_n, strain), WIDTH, THICKNESS)
    assert result.ultimate_strain is None
    assert result.modulus_pa == pytest.approx(40e9, rel=1e-12)
    assert result.strength_pa == pytest.approx(400e6, rel=1e-12)
    assert "ends at 7450 µε" in result.warnings[0]
    early = np.where(curve.strain > 0.004, np.nan, curve.strain)
    with pytest.raises(InputError, match="chord_range"):
        d3039.reduce(Curve(curve.force_n / 2 * np.where(curve.strain > 0.004, 1.1, 2), early), WIDTH, THICKNESS)


def test_what_comes_after_the_maximum_force_does_not_count() -> None:
    curve = steady()
    force = np.concatenate([curve.force_n, [50.0, 20.0, 0.0]])
    strain = np.concatenate([curve.strain, [0.001, 0.0, -0.002]])
    result = d3039.reduce(Curve(force, strain), WIDTH, THICKNESS)
    assert result.modulus_pa == pytest.approx(40e9, rel=1e-12)
    assert result.ultimate_strain == pytest.approx(0.01)


def test_a_knee_is_found_where_it_is_and_nowhere_else() -> None:
    rng = np.random.default_rng(3)
    strain = np.linspace(0, 0.012, 400)
    bilinear = 20e9 * np.minimum(strain, 0.0042) + 14e9 * np.maximum(strain - 0.0042, 0)
    assert transition_strain(strain, bilinear) == pytest.approx(0.0042, rel=1e-9)
    noisy = bilinear + 0.3e6 * rng.standard_normal(strain.size)
    assert transition_strain(strain, noisy) == pytest.approx(0.0042, rel=0.02)
    for smooth in (20e9 * strain, 20e9 * strain - 2e11 * strain**2):
        assert transition_strain(strain, smooth) is None
        assert transition_strain(strain, smooth + 0.3e6 * rng.standard_normal(strain.size)) is None


def test_restarts_are_found_refused_and_split() -> None:
    first, second = steady(61, ultimate=0.003), steady()
    both = Curve(
        np.concatenate([first.force_n, second.force_n]),
        np.concatenate([first.strain, second.strain]),
    )
    assert restarts(both) == (61,)
    with pytest.raises(InputError, match=r"restarted at point 62 \(0 N\)"):
        d3039.reduce(both, WIDTH, THICKNESS)
    runs = split_runs(both)
    assert [len(run) for run in runs] == [61, 201]
    assert d3039.reduce(runs[1], WIDTH, THICKNESS).modulus_pa == pytest.approx(40e9, rel=1e-12)


def test_time_that_goes_back_is_a_restart_too() -> None:
    curve = steady(50)
    timed = Curve(curve.force_n, curve.strain, time_s=np.r_[np.arange(20.0), np.arange(30.0)])
    assert restarts(timed) == (20,)


def test_cracks_that_drop_the_force_but_not_the_strain_are_no_restart() -> None:
    curve = steady()
    force = curve.force_n.copy()
    force[120:130] *= 0.8
    assert restarts(Curve(force, curve.strain)) == ()


def test_the_regression_modulus_is_the_least_squares_slope_of_the_chords_points() -> None:
    result = d3039.reduce(example(), WIDTH, THICKNESS)
    inside = slice(2, 7)  # 990 to 3020 µε
    assert result.regression_modulus_pa == pytest.approx(
        np.polyfit(STRAIN[inside], FORCE[inside] / result.area_m2, 1)[0], rel=1e-12
    )
    assert result.regression_modulus_pa == pytest.approx(result.modulus_pa, rel=2e-3)  # a straight curve, by hand


def test_a_knee_within_the_chord_is_named_with_its_strain() -> None:
    strain = np.linspace(0, 0.01, 501)
    stress = np.where(strain < 2000e-6, 40e9 * strain, 80e6 + 30e9 * (strain - 2000e-6))
    result = d3039.reduce(Curve(stress * 50e-6, strain), WIDTH, THICKNESS)
    assert result.modulus_pa == pytest.approx(35e9, rel=1e-9)  # of neither part: that is why it is said
    (warning,) = result.warnings
    assert "knee at 2000 µε" in warning
    below = d3039.reduce(Curve(stress * 50e-6, strain), WIDTH, THICKNESS, chord_range=(500e-6, 1500e-6))
    assert (below.modulus_pa, below.warnings) == (pytest.approx(40e9, rel=1e-9), ())


def test_a_knee_that_a_later_bend_hides_in_the_whole_curve_is_found_near_the_chord() -> None:
    strain = np.linspace(0, 0.02, 2001)
    stress = np.minimum(40e9 * strain, 80e6 + 30e9 * (strain - 2000e-6))
    stress = stress - 4e11 * np.maximum(strain - 8000e-6, 0) ** 2
    (warning,) = d3039.reduce(Curve(stress * 50e-6, strain), WIDTH, THICKNESS).warnings
    assert "knee at 20" in warning


def test_an_extensometer_that_jumps_leaves_no_ultimate_strain_and_the_same_modulus() -> None:
    curve = steady()
    strain = curve.strain.copy()
    strain[150:] += 0.19
    result = d3039.reduce(Curve(curve.force_n, strain), WIDTH, THICKNESS)
    assert result.ultimate_strain is None
    assert result.modulus_pa == pytest.approx(40e9, rel=1e-12)
    assert "jumps at point 151" in result.warnings[0]


def test_noise_yield_and_a_machine_that_changes_its_rate_are_no_jumps() -> None:
    rng = np.random.default_rng(3)
    noisy = np.linspace(0, 0.012, 400) + rng.normal(0, 20e-6, 400)
    rates = np.concatenate([np.linspace(0, 0.002, 200), np.linspace(0.0029, 0.02, 20)])
    yielding = np.concatenate([np.linspace(0, 0.004, 200), 0.004 + 0.03 * np.linspace(0.005, 1, 200) ** 2])
    assert [jump(x) for x in (noisy, rates, yielding, STRAIN)] == [None] * 4


def test_exchanged_dimensions_are_asked_about() -> None:
    result = d3039.reduce(steady(), THICKNESS, WIDTH)
    assert "are they exchanged" in result.warnings[0]
