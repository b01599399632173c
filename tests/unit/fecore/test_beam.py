from __future__ import annotations

import numpy as np
import pytest

from fecore.body.beam import BeamSection, beam
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.mesh import rectangle
from fecore.body.model import plate
from fecore.body.supports import PointMass, Supports
from fecore.dynamics.eigen import normal_modes
from tests.support.plates import PAPER, paper_section, solve

STEEL_LIKE = OrthotropicMaterial(30e9, 30e9, 30e9 / 2.6, 30e9 / 2.6, 30e9 / 2.6, 0.3, 2012.0)


def modes_of(section: BeamSection, model, count: int):
    return normal_modes(
        model.stiffness.at(section.coefficients()), model.mass.at(section.inertias()), count, model.rigid_modes
    )


def test_paper_section_3() -> None:
    section, model = BeamSection(0.04, 0.01, STEEL_LIKE), beam(0.5, 40, "cantilever")
    modes = modes_of(section, model, 8)
    bending = modes.frequency_hz[np.array(model.kinds(modes.shapes)) == "bending"]
    # Five printed digits.
    np.testing.assert_allclose(bending[:4], [24.943, 156.018, 435.523, 849.688], rtol=3e-5)


def simply_supported_hz(length: float, section: BeamSection, count: int) -> np.ndarray:
    """Timoshenko's simply supported beam: w ~ sin, θ ~ cos, a 2 × 2 eigenproblem for each half wave number."""
    _, _, shear, _, bending, _ = section.coefficients()
    mass, _, rotary, _, _ = section.inertias()
    found = []
    for n in range(1, count + 1):
        k = n * np.pi / length
        K = np.array([[shear * k**2, shear * k], [shear * k, bending * k**2 + shear]])
        found.append(np.min(np.linalg.eigvals(K / np.array([[mass], [rotary]])).real))
    return np.sqrt(found) / (2 * np.pi)


def test_convergence_to_timoshenkos_closed_form_is_of_fourth_order() -> None:
    section = BeamSection(0.03, 0.04, STEEL_LIKE)
    exact = simply_supported_hz(0.5, section, 3)
    sizes = np.array([4, 6, 8, 12])
    errors = []
    for n in sizes:
        model = beam(0.5, n, "simply_supported")
        modes = modes_of(section, model, 12)
        bending = modes.frequency_hz[np.array(model.kinds(modes.shapes)) == "bending"]
        errors.append(np.abs(bending[:3] / exact - 1))
    slope = -np.polyfit(np.log(sizes), np.log(np.array(errors)), 1)[0]
    assert np.all(slope > 3.7), slope
    assert errors[-1].max() < 1e-3  # the third mode has four elements a half wave


def test_axial_and_torsional_frequencies_are_those_of_bars() -> None:
    section, model = BeamSection(0.04, 0.01, STEEL_LIKE), beam(0.5, 40, "free")
    modes = modes_of(section, model, 26)
    ea, _, _, gj, _, _ = section.coefficients()
    mass, polar, *_ = section.inertias()
    torsion = modes.frequency_hz[6:][np.array(model.kinds(modes.shapes[:, 6:])) == "torsion"]
    # Free bars: f = n/2L √(stiffness/inertia); 40 quadratic elements are exact to 1e-6 for the first two.
    np.testing.assert_allclose(torsion[:2], np.array([1, 2]) * np.sqrt(gj / polar), rtol=1e-6)
    assert np.min(np.abs(modes.frequency_hz / np.sqrt(ea / mass) - 1)) < 1e-6


def test_torsion_stiffness_of_known_sections() -> None:
    # Square: J = 0.140577 a⁴; 10:1 rectangle: 0.312 b t³ (Timoshenko and Goodier, section 109).
    shear = STEEL_LIKE.Gxy
    assert BeamSection(0.02, 0.02, STEEL_LIKE).torsion_stiffness / (shear * 0.02**4) == pytest.approx(
        0.140577, rel=1e-5
    )
    assert BeamSection(0.1, 0.01, STEEL_LIKE).torsion_stiffness / (shear * 0.1 * 0.01**3) == pytest.approx(
        0.312, abs=5e-4
    )
    # Turned by 90 degrees with its moduli it is the same bar.
    a = BeamSection(0.03, 0.01, OrthotropicMaterial(1e9, 1e9, 4e9, 2e9, 1e9, 0.3, 1.0)).torsion_stiffness
    b = BeamSection(0.01, 0.03, OrthotropicMaterial(1e9, 1e9, 2e9, 4e9, 1e9, 0.3, 1.0)).torsion_stiffness
    assert a == pytest.approx(b, rel=1e-8)


def test_beam_and_plate_agree_on_the_papers_strip() -> None:
    section, model = BeamSection(0.04, 0.01, PAPER), beam(0.5, 40, "cantilever", [PointMass(0.49, 0.015, 0.0048)])
    shell = plate(rectangle(0.5, 0.04, 40, 4), Supports.of("cantilever"), [PointMass(0.49, 0.015, 0.0048)])
    ours, theirs = modes_of(section, model, 8), solve(shell, paper_section(), 5)
    flat = np.array(model.kinds(ours.shapes)) != "in-plane"
    found = ours.frequency_hz[flat][:5]
    # A beam's clamp holds no anticlastic bending (1e-3) and lets the section warp, which the plate's does not (2 %).
    np.testing.assert_allclose(found[[0, 1, 3, 4]], theirs.frequency_hz[[0, 1, 3, 4]], rtol=2e-3)
    assert 0.97 < found[2] / theirs.frequency_hz[2] < 1
    corner = np.array([[0.5, 0.02]])
    seen = np.abs(model.deflection(corner) @ ours.shapes[:, flat][:, :3])
    np.testing.assert_allclose(seen, np.abs(shell.deflection(corner) @ theirs.shapes[:, :3]), rtol=3e-2)
