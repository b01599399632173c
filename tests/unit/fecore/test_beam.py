"""Strips as beams: their section, closed forms, the plate, and the same updating."""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.beam_specimen import BEAM_CONSTANTS, BeamSpecimen
from fecore.body.beams import BeamSection, rectangle_torsion
from fecore.body.constants import Parameter
from fecore.body.kinds import mode_kinds
from fecore.body.supports import PointMass, of_boundary
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.parameters import parametrise
from tests.support.bodies import modes
from tests.support.cantilever import grid
from tests.support.fits import forward_model, update_elastic
from tests.support.plates import PAPER, paper_section, plate, solve

ALL = (0, 1, 2, 3, 4, 5)
BAR = BeamSpecimen(0.5, 0.04, 0.01, 30e9, 0.3, 2012.0, dofs=ALL)


def hz_and_kinds(body: BeamSpecimen, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the elastic modes."""
    found = modes(body, count)
    return found.frequency_hz[found.rigid :], np.array(
        mode_kinds(body.model, found.shapes[:, found.rigid :])
    )


def section_of(body: BeamSpecimen) -> tuple[dict[str, float], dict[str, float]]:
    """Coefficients of stiffness and mass by name."""
    q = np.array(list(body.nominal.values()))
    names = (
        [name.rpartition(".")[2] for name in matrix.names]
        for matrix in (body.model.stiffness, body.model.mass)
    )
    values = body.stiffness_coefficients(q), body.mass_coefficients(q)
    stiffness, mass = (dict(zip(n, v, strict=True)) for n, v in zip(names, values, strict=True))
    return stiffness, mass


def simply_supported_hz(body: BeamSpecimen, count: int) -> np.ndarray:
    """Timoshenko's simply supported beam: w ~ sin, θ ~ cos, a 2 × 2 eigenproblem for each half wave
    number.
    """
    stiffness, inertia = section_of(body)
    shear, bending, mass, rotary = stiffness["GA2"], stiffness["EI1"], inertia["m"], inertia["mI1"]
    found = []
    for n in range(1, count + 1):
        k = n * np.pi / body.length
        K = np.array([[shear * k**2, shear * k], [shear * k, bending * k**2 + shear]])
        found.append(np.min(np.linalg.eigvals(K / np.array([[mass], [rotary]])).real))
    return np.sqrt(found) / (2 * np.pi)


def test_convergence_to_timoshenkos_closed_form_is_of_fourth_order() -> None:
    body = replace(BAR, width=0.03, thickness=0.04, boundary="simply_supported")
    exact = simply_supported_hz(body, 3)
    sizes = np.array([4, 6, 8, 12])
    errors = []
    for n in sizes:
        hz, kinds = hz_and_kinds(replace(body, elements=int(n)), 12)
        errors.append(np.abs(hz[kinds == "bending"][:3] / exact - 1))
    slope = -np.polyfit(np.log(sizes), np.log(np.array(errors)), 1)[0]
    assert np.all(slope > 3.7), slope
    assert errors[-1].max() < 1e-3  # the third mode has four elements a half wave


def test_axial_and_torsional_frequencies_are_those_of_bars() -> None:
    body = replace(BAR, boundary="free")
    hz, kinds = hz_and_kinds(body, 20)
    stiffness, inertia = section_of(body)
    torsion = hz[kinds == "torsion"]
    # Free bars: f = n/2L √(stiffness/inertia); 40 quadratic elements are exact to 1e-6 for the
    # first two.
    np.testing.assert_allclose(
        torsion[:2], np.array([1, 2]) * np.sqrt(stiffness["GJ"] / inertia["mJ"]), rtol=1e-6
    )
    assert np.min(np.abs(hz / np.sqrt(stiffness["EA"] / inertia["m"]) - 1)) < 1e-6


def test_torsion_stiffness_of_known_sections() -> None:
    def torsion(Gxy: float, Gxz: float, width: float, thickness: float) -> float:
        return float(rectangle_torsion(*(np.array(each) for each in (Gxy, Gxz, width, thickness))))

    # Square: J = 0.140577 a⁴; 10:1 rectangle: 0.312 b t³ (Timoshenko and Goodier, section 109).
    assert torsion(1, 1, 0.02, 0.02) / 0.02**4 == pytest.approx(0.140577, rel=1e-5)
    assert torsion(1, 1, 0.1, 0.01) / (0.1 * 0.01**3) == pytest.approx(0.312, abs=5e-4)
    # Turned by 90 degrees with its moduli it is the same bar.
    assert torsion(4e9, 2e9, 0.03, 0.01) == pytest.approx(torsion(2e9, 4e9, 0.01, 0.03), rel=1e-8)


def test_beam_and_plate_agree_on_the_papers_strip() -> None:
    mass, one = PointMass(0.49, 0.015, 0.0048), np.ones(())
    plain = replace(BAR, masses=(mass,), dofs=(2, 3, 4)).structure
    torsion = (
        rectangle_torsion(PAPER.Gxy * one, PAPER.Gxz * one, 0.04 * one, 0.01 * one) / PAPER.Gxy
    )
    part = replace(
        BeamSection.rectangle(0.04, 0.01, PAPER.Ex, PAPER.Gxy, PAPER.density),
        torsion=float(torsion),
    )
    beam = replace(
        plain, sections={"beam": replace(part, shear=(5 / 6, 5 / 6 * PAPER.Gxz / PAPER.Gxy))}
    )
    ours = modes(beam, 5)
    shell = plate((0.5, 0.04), (40, 4), of_boundary("cantilever"), [mass])
    theirs = solve(shell, paper_section(), 5)
    # A beam's clamp holds no anticlastic bending (1e-3) and lets the section warp, which the
    # plate's does not (2 %).
    np.testing.assert_allclose(
        ours.frequency_hz[[0, 1, 3, 4]], theirs.frequency_hz[[0, 1, 3, 4]], rtol=2e-3
    )
    assert 0.97 < ours.frequency_hz[2] / theirs.frequency_hz[2] < 1
    corner, up = np.array([[0.5, 0.02, 0.0]]), np.array([[0.0, 0, 1]])
    seen = np.abs(beam.model.observe(corner, up) @ ours.shapes[:, :3])
    np.testing.assert_allclose(
        seen, np.abs(shell.model.observe(corner, up) @ theirs.shapes[:, :3]), rtol=3e-2
    )


BEAM = BeamSpecimen(0.5, 0.04, 0.010, modulus=30e9, poisson=0.3, density=2012.0)
EVERYTHING = [Parameter(name) for name in BEAM_CONSTANTS]
NAMES = BEAM.model.stiffness.names, BEAM.model.mass.names


def test_derivatives_agree_with_closed_forms_and_differences() -> None:
    theta = np.array([70e9, 0.33, 2700.0, 0.03, 0.004, 0.5])
    E, nu, density, width, thickness, _ = theta
    parametrisation = parametrise(BEAM, EVERYTHING)
    found = parametrisation.coefficients(theta)
    bends = NAMES[0].index("beam.EI1")
    shears = [row for row, name in enumerate(NAMES[0]) if "G" in name]
    np.testing.assert_allclose(found.stiffness_by[:, 0], found.stiffness / E, rtol=1e-14)
    np.testing.assert_allclose(
        found.stiffness_by[shears, 1], -found.stiffness[shears] / (1 + nu), rtol=1e-14
    )
    by_size = found.stiffness[bends] * np.array([1 / width, 3 / thickness])
    np.testing.assert_allclose(found.stiffness_by[bends, 3:5], by_size)
    np.testing.assert_allclose(found.mass_by[:, 2], found.mass / density, rtol=1e-14)
    for p, value in enumerate(theta):  # the torsion series, which has no short derivative
        step = 1e-5 * value * np.eye(6)[p]
        up, down = (parametrisation.coefficients(theta + sign * step) for sign in (1, -1))
        difference = (up.stiffness - down.stiffness) / (2e-5 * value)
        # Central differences err by 1e-10 relative and round-off/step, 1e-11 of the value.
        np.testing.assert_allclose(
            found.stiffness_by[:, p],
            difference,
            rtol=1e-8,
            atol=1e-9 * found.stiffness.max() / value,
        )


def test_bending_and_torsion_give_both_constants_back() -> None:
    forward = forward_model(
        BEAM, 9, Parameter("E", prior_mean=25e9), Parameter("nu", prior_sd=0.3), points=grid()
    )
    truth = np.array([31e9, 0.22])
    state = forward.solve(truth)
    dofs = tuple(Dof(point, 3) for point in forward.points)
    modes = MeasuredModes(
        state.frequency_hz[:5], np.full(5, 0.02), state.shapes[:5].astype(complex), dofs
    )
    result = update_elastic(forward, modes)
    sd = np.sqrt(np.diag(result.covariance))
    # priors of 30 % may pull a little, no more
    assert np.all(np.abs(result.theta - truth) < 0.5 * sd)
    np.testing.assert_allclose(result.theta, truth, rtol=5e-3)
    assert all(verdict.identifiable for verdict in result.identifiability)
