"""Strips as beams: their section, closed forms, and the plate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.beam_specimen import BeamSpecimen
from fecore.body.beams import BeamSection, rectangle_torsion
from fecore.body.kinds import mode_kinds
from fecore.body.supports import PointMass, of_boundary
from fecore.dynamics.eigen import NormalModes, normal_modes
from tests.support.plates import PAPER, paper_section, plate, solve

ALL = (0, 1, 2, 3, 4, 5)
BAR = BeamSpecimen(0.5, 0.04, 0.01, 30e9, 0.3, 2012.0, dofs=ALL)


def modes_of(body: BeamSpecimen, count: int) -> tuple[NormalModes, np.ndarray]:
    q, model = np.array(list(body.nominal.values())), body.model
    K, M = model.stiffness.at(body.stiffness_coefficients(q)), model.mass.at(body.mass_coefficients(q))
    modes = normal_modes(K, M, count, model.rigid_modes)
    return modes, np.array(mode_kinds(model, modes.shapes))


def section_of(body: BeamSpecimen) -> tuple[dict[str, float], dict[str, float]]:
    """Coefficients of stiffness and mass by name."""
    q = np.array(list(body.nominal.values()))
    names = ([name.rpartition(".")[2] for name in matrix.names] for matrix in (body.model.stiffness, body.model.mass))
    values = body.stiffness_coefficients(q), body.mass_coefficients(q)
    stiffness, mass = (dict(zip(n, v, strict=True)) for n, v in zip(names, values, strict=True))
    return stiffness, mass


def simply_supported_hz(body: BeamSpecimen, count: int) -> np.ndarray:
    """Timoshenko's simply supported beam: w ~ sin, θ ~ cos, a 2 × 2 eigenproblem for each half wave number."""
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
        modes, kinds = modes_of(replace(body, elements=int(n)), 12)
        errors.append(np.abs(modes.frequency_hz[kinds == "bending"][:3] / exact - 1))
    slope = -np.polyfit(np.log(sizes), np.log(np.array(errors)), 1)[0]
    assert np.all(slope > 3.7), slope
    assert errors[-1].max() < 1e-3  # the third mode has four elements a half wave


def test_axial_and_torsional_frequencies_are_those_of_bars() -> None:
    body = replace(BAR, boundary="free")
    modes, kinds = modes_of(body, 26)
    stiffness, inertia = section_of(body)
    torsion = modes.frequency_hz[6:][kinds[6:] == "torsion"]
    # Free bars: f = n/2L √(stiffness/inertia); 40 quadratic elements are exact to 1e-6 for the first two.
    np.testing.assert_allclose(torsion[:2], np.array([1, 2]) * np.sqrt(stiffness["GJ"] / inertia["mJ"]), rtol=1e-6)
    assert np.min(np.abs(modes.frequency_hz / np.sqrt(stiffness["EA"] / inertia["m"]) - 1)) < 1e-6


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
    torsion = rectangle_torsion(PAPER.Gxy * one, PAPER.Gxz * one, 0.04 * one, 0.01 * one) / PAPER.Gxy
    part = replace(BeamSection.rectangle(0.04, 0.01, PAPER.Ex, PAPER.Gxy, PAPER.density), torsion=float(torsion))
    beam = replace(plain, sections={"beam": replace(part, shear=(5 / 6, 5 / 6 * PAPER.Gxz / PAPER.Gxy))})
    q, model = np.array(list(beam.nominal.values())), beam.model
    ours = normal_modes(model.stiffness.at(beam.stiffness_coefficients(q)), model.mass.at(beam.mass_coefficients(q)), 5)
    shell = plate((0.5, 0.04), (40, 4), of_boundary("cantilever"), [mass])
    theirs = solve(shell, paper_section(), 5)
    # A beam's clamp holds no anticlastic bending (1e-3) and lets the section warp, which the plate's does not (2 %).
    np.testing.assert_allclose(ours.frequency_hz[[0, 1, 3, 4]], theirs.frequency_hz[[0, 1, 3, 4]], rtol=2e-3)
    assert 0.97 < ours.frequency_hz[2] / theirs.frequency_hz[2] < 1
    corner, up = np.array([[0.5, 0.02, 0.0]]), np.array([[0.0, 0, 1]])
    seen = np.abs(model.observe(corner, up) @ ours.shapes[:, :3])
    np.testing.assert_allclose(seen, np.abs(shell.model.observe(corner, up) @ theirs.shapes[:, :3]), rtol=3e-2)
