import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fecore.dynamics.damping_laws import (
    RAYLEIGH,
    CaugheySeries,
    GeneralisedProportional,
    ModalDamping,
    damping_rate,
    damping_ratio,
    fit_ratios,
    negative_band,
)
from fecore.errors import InputError

OMEGA = 2 * np.pi * np.array([25.61, 160.85, 399.28, 442.65, 867.96])
LAWS = [
    RAYLEIGH,
    CaugheySeries("three", (-1, 0, 1)),
    CaugheySeries("four", (-1, 0, 1, 2)),
    GeneralisedProportional(("constant", "root", "stiffness"), 1500.0),
    GeneralisedProportional(("saturating", "logarithm", "arctangent"), 1500.0),
    ModalDamping(tuple(OMEGA)),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_ratios_and_coefficients_convert_both_ways(law) -> None:
    count = len(law.coefficient_names)
    ratio = np.array([0.15, 0.03, 0.025, 0.02, 0.028])[:count]
    coefficients = fit_ratios(law, OMEGA[:count], ratio)
    # Round-off times the condition of a Caughey series in powers of ω².
    np.testing.assert_allclose(damping_ratio(law, coefficients, OMEGA[:count]), ratio, rtol=1e-9)
    assert len(law.coefficient_units) == count


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_slopes_against_differences(law) -> None:
    omega = np.array([100.0, 700.0, 1200.0, 3000.0])
    h = 1e-4 * omega
    numeric = (law.basis(omega + h) - law.basis(omega - h)) / (2 * h)[:, None]
    np.testing.assert_allclose(law.slope(omega), numeric, rtol=1e-6, atol=1e-12)


@settings(max_examples=40)
@given(st.floats(0.1, 500), st.floats(1e-7, 1e-3))
def test_rayleigh_is_equation_9_in_radians(a0: float, a1: float) -> None:
    expected = (a0 / OMEGA + a1 * OMEGA) / 2
    np.testing.assert_allclose(
        damping_ratio(RAYLEIGH, np.array([a0, a1]), OMEGA), expected, rtol=1e-14
    )
    np.testing.assert_allclose(fit_ratios(RAYLEIGH, OMEGA, expected), [a0, a1], rtol=1e-9)


@pytest.mark.parametrize("law", LAWS[:5], ids=lambda law: law.name)
def test_the_rate_is_that_of_the_damping_matrix(law) -> None:
    """C = M β(M⁻¹K), built by a matrix function, has φᵀCφ = c(ω)."""
    rng = np.random.default_rng(0)
    A, B = rng.standard_normal((2, 6, 6))
    K, M = A @ A.T * 1e5 + 1e5 * np.eye(6), B @ B.T + np.eye(6)
    from scipy.linalg import eigh

    value, phi = eigh(K, M)
    coefficients = (
        np.linspace(1, 2, len(law.coefficient_names))
        * 1e-2
        / np.abs(law.basis(np.sqrt(value))).max(axis=0)
    )
    w, V = np.linalg.eig(np.linalg.solve(M, K))
    C = M @ (V @ np.diag(damping_rate(law, coefficients, np.sqrt(w.real))) @ np.linalg.inv(V)).real
    np.testing.assert_allclose(C, C.T, atol=1e-10 * np.abs(C).max())
    np.testing.assert_allclose(
        phi.T @ C @ phi,
        np.diag(damping_rate(law, coefficients, np.sqrt(value))),
        atol=1e-10 * np.abs(C).max(),
    )


def test_rigid_body_modes_keep_mass_proportional_damping_only() -> None:
    rate = damping_rate(
        CaugheySeries("all", (-1, 0, 1)), np.array([1e4, 3.0, 1e-5]), np.array([0.0, 100.0])
    )
    assert rate[0] == 3.0
    with pytest.raises(InputError, match="omega"):
        damping_ratio(RAYLEIGH, np.array([1.0, 1e-5]), np.array([0.0]))


def test_negative_damping_is_found_in_a_band_and_not_outside_it() -> None:
    coefficients = np.array([-20.0, 1e-4])
    crossing = np.sqrt(20 / 1e-4)
    assert negative_band(RAYLEIGH, coefficients, 1.01 * crossing, 5000.0) is None
    assert negative_band(RAYLEIGH, coefficients, 100.0, 5000.0) == pytest.approx(
        (100.0, crossing), rel=0.01
    )
