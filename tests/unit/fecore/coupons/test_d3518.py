"""ASTM D3518: the hand-worked example of docs/coupons.md and what is refused."""

import numpy as np
import pytest

from fecore.coupons import d3518
from fecore.coupons.curves import Curve

WIDTH, THICKNESS = (25e-3,), (2e-3,)  # A = 50 mm², so τ in MPa is P / 100 N

# docs/coupons.md, example 3: γ in µε (ε_x = 0.6 γ, ε_y = −0.4 γ), τ in MPa
GAMMA = (
    np.array([0, 1000, 2000, 3000, 4000, 5000, 6000, 8000, 12000, 16000, 30000, 49000, 60000])
    * 1e-6
)
TAU = np.array([0, 5.0, 10.0, 15.0, 19.6, 24.0, 28.0, 34.0, 42.0, 48.0, 60.0, 70.0, 74.0]) * 1e6


def curve(gamma: np.ndarray = GAMMA, tau: np.ndarray = TAU) -> Curve:
    return Curve(tau * 100e-6, 0.6 * gamma, transverse_strain=-0.4 * gamma)


def test_the_worked_example() -> None:
    result = d3518.reduce(curve(), WIDTH, THICKNESS)
    assert result.modulus_pa == pytest.approx(18e6 / 4000e-6, rel=1e-12)  # 4.5 GPa
    assert result.chord_range == pytest.approx((2000e-6, 6000e-6), rel=1e-12)
    # τ = 4.5e9 (γ − 0.002) against 34 + 2000 MPa (γ − 0.008) per unit: 4500 γ − 9 = 34 + 2000 γ −
    # 16
    gamma = (34 - 16 + 9) / 2500
    assert result.offset_strain == pytest.approx(gamma, rel=1e-12)
    assert gamma == pytest.approx(0.0108)
    assert result.offset_strength_pa == pytest.approx(39.6e6, rel=1e-12)
    assert result.maximum_stress_pa == pytest.approx(70e6, rel=1e-12)
    assert result.maximum_stress_strain == pytest.approx(0.049, rel=1e-12)
    assert result.reached_limit


def test_a_specimen_that_fails_before_five_per_cent() -> None:
    result = d3518.reduce(curve(GAMMA[:10], TAU[:10]), WIDTH, THICKNESS)
    assert (result.maximum_stress_pa, result.reached_limit) == (pytest.approx(48e6), False)


def test_a_specimen_that_fails_before_the_offset_line() -> None:
    result = d3518.reduce(curve(GAMMA[:8], TAU[:8]), WIDTH, THICKNESS)
    assert result.offset_strength_pa is None
    assert "offset" in result.warnings[0]


def test_interpolated_ends_reach_a_range_without_points_at_its_ends() -> None:
    moved = d3518.reduce(curve(), WIDTH, THICKNESS, chord_start=2500e-6, ends="interpolated")
    assert moved.modulus_pa == pytest.approx((29.5e6 - 12.5e6) / 4000e-6, rel=1e-12)
    # with points at its ends it is theirs
    there = d3518.reduce(curve(), WIDTH, THICKNESS, ends="interpolated")
    assert there.modulus_pa == pytest.approx(4.5e9, rel=1e-12)


def test_a_gauge_that_is_lost_after_the_chord_leaves_the_modulus() -> None:
    lost = np.where(GAMMA > 0.02, np.nan, GAMMA)
    result = d3518.reduce(
        Curve(TAU * 100e-6, 0.6 * lost, transverse_strain=-0.4 * lost), WIDTH, THICKNESS
    )
    assert result.modulus_pa == pytest.approx(4.5e9, rel=1e-12)
    assert result.maximum_stress_pa == pytest.approx(48e6)
    assert (
        "a strain was lost before the maximum force; stresses after it are left out"
        in result.warnings
    )
