"""A strip through the general body, with the dofs of its own, is the plate model: frequencies and measured shapes to 1e-8."""

from __future__ import annotations

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.layered import LayeredSpecimen
from fecore.body.profile import Piece, profile_of
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.body.supports import Spring as EdgeSpring
from fecore.dynamics.eigen import normal_modes
from fecore.dynamics.reduction import ReducedModel
from fecore.space.generators import strip
from fecore.space.sections import ShellSection
from fecore.space.structure import Structure
from fecore.space.supports import Mass, Spring, Support
from tests.support.plates import PAPER

SIDE = ("v", "w", "rx")
BOUNDARIES = {
    "cantilever": (Support("start"),),
    "free": (),
    "simply_supported": (Support("start", SIDE), Support("end", SIDE)),
}
CARBON = OrthotropicMaterial(130e9, 9e9, 5e9, 5e9, 3e9, 0.3, 1550.0)


def structure_of(specimen: Specimen | LayeredSpecimen, plies: tuple[Ply, ...], dofs: tuple[int, ...]) -> Structure:
    """The specimen as a mesh, section, supports, springs and masses."""
    along, across = specimen.divisions or (40, 4)
    shape = profile_of(specimen.length, specimen.thickness, specimen.pieces)
    lines = sorted({*specimen.zones, *(shape.breaks if shape else ())})
    mesh = strip(specimen.length, specimen.width, along, across, lines)
    # In each set by itself the thickness is that of its own side of a step.
    ratio = {}
    for block in mesh.blocks if shape else ():
        x = mesh.nodes[block.nodes, 0]
        inside = np.clip(x, x.min() + 1e-9, x.max() - 1e-9)
        ratio[block.set] = np.ones(len(mesh.nodes))
        ratio[block.set][block.nodes] = shape.ratio(inside)
    springs = tuple(
        Spring(s.name, s.stiffness, s.direction, s.edge if s.point is None else (*s.point, 0.0))
        for s in specimen.springs
    )
    masses = tuple(Mass(m.mass, (m.x, m.y, 0.0), m.rotary_inertia) for m in specimen.masses)
    return Structure(
        mesh,
        dict.fromkeys(mesh.sets, ShellSection(plies)),
        BOUNDARIES[specimen.boundary],
        springs,
        masses,
        thickness=ratio,
        dofs=dofs,
    )


def both(specimen: Specimen | LayeredSpecimen, structure: Structure):
    """(K, M) of the plate model, and of the structure's with the specimen's coefficients."""
    q = np.array(list(specimen.nominal.values()))
    springs = [spring.stiffness for spring in specimen.springs]
    c, m = np.append(specimen.stiffness_coefficients(q), springs), specimen.mass_coefficients(q)
    old, new = specimen.model, structure.model
    stiffness = dict(zip(old.stiffness.names, c, strict=True))
    inertia = dict(zip(old.mass.names, m, strict=True))
    mass = {"I0": "I0", "I2": "I2rx", "I2_1": "I2ry", "I0_1": "I0u", "I1": "I1v", "I1_1": "I1u", "1": "point_masses"}

    def find(name: str) -> float:
        set_name, _, term = name.rpartition(".")
        zone = f" in zone {set_name[6:]}" if specimen.zones else ""
        return float(stiffness[term + zone] if set_name else stiffness[term])

    ours = (
        new.stiffness.at(np.array([find(name) for name in new.stiffness.names])),
        new.mass.at(np.array([inertia[mass[name.rpartition(".")[2]]] for name in new.mass.names])),
    )
    return (old.stiffness.at(c), old.mass.at(m)), ours


def check(specimen: Specimen | LayeredSpecimen, structure: Structure) -> None:
    theirs, ours = both(specimen, structure)
    rigid = structure.model.rigid_modes
    assert rigid.shape == specimen.model.rigid_modes.shape
    old = normal_modes(*theirs, 10 + rigid.shape[1], specimen.model.rigid_modes)
    new = normal_modes(*ours, 10 + rigid.shape[1], rigid)
    np.testing.assert_allclose(new.frequency_hz, old.frequency_hz, rtol=1e-8)
    points = np.array([[x, y] for x in np.linspace(0.01, specimen.length, 7) for y in (-0.4, 0.1)]) * [
        1,
        specimen.width,
    ]
    up = np.tile([0.0, 0, 1], (len(points), 1))
    seen: FloatArray = structure.model.observe(np.column_stack([points, 0 * points[:, 0]]), up) @ new.shapes
    known = specimen.model.deflection(points) @ old.shapes
    elastic = slice(rigid.shape[1], None)
    np.testing.assert_allclose(np.abs(seen[:, elastic]), np.abs(known[:, elastic]), atol=1e-5 * np.abs(known).max())


@pytest.mark.parametrize("boundary", list(BOUNDARIES))
@pytest.mark.parametrize("angle", [0.0, 0.2])
def test_boundaries_and_angles(boundary, angle) -> None:
    specimen = Specimen(0.5, 0.04, 0.01, PAPER, boundary, fibre_angle=angle)
    check(specimen, structure_of(specimen, (Ply(PAPER, 0.01, float(np.degrees(angle))),), (2, 3, 4)))


def test_springs_and_masses() -> None:
    specimen = Specimen(
        *(0.5, 0.04, 0.01, PAPER, "free"),
        masses=(PointMass(0.49, 0.015, 0.0048, 1e-6), PointMass(0.21, -0.01, 0.002)),
        springs=(EdgeSpring("root", 2e4, 5, edge="start"), EdgeSpring("foot", 3e4, 3, point=(0.21, 0.01))),
    )
    check(specimen, structure_of(specimen, (Ply(PAPER, 0.01),), (2, 3, 4)))


def test_zones() -> None:
    specimen = Specimen(0.5, 0.04, 0.01, PAPER, zones=(0.1, 0.33))
    check(specimen, structure_of(specimen, (Ply(PAPER, 0.01),), (2, 3, 4)))


def test_steps_and_tapers() -> None:
    pieces = (Piece(0.1, 0.2, 0.008, 0.008), Piece(0.3, 0.4, 0.01, 0.007))
    specimen = Specimen(0.5, 0.04, 0.01, PAPER, pieces=pieces)
    check_pieces = structure_of(specimen, (Ply(PAPER, 0.01),), (2, 3, 4))
    theirs = specimen.model
    q = np.array(list(specimen.nominal.values()))
    old = normal_modes(
        theirs.stiffness.at(specimen.stiffness_coefficients(q)), theirs.mass.at(specimen.mass_coefficients(q)), 10
    )
    own = np.array(list(check_pieces.nominal.values()))
    model = check_pieces.model
    new = normal_modes(
        model.stiffness.at(check_pieces.stiffness_coefficients(own)),
        model.mass.at(check_pieces.mass_coefficients(own)),
        10,
    )
    np.testing.assert_allclose(new.frequency_hz, old.frequency_hz, rtol=1e-8)


def test_a_laminate_that_couples() -> None:
    plies = (Ply(CARBON, 0.001, 0.0), Ply(CARBON, 0.001, 30.0))
    specimen = LayeredSpecimen(0.3, 0.04, 0.002, plies, 1550.0)
    check(specimen, structure_of(specimen, plies, (0, 1, 2, 3, 4)))


def test_the_section_has_the_specimens_coefficients() -> None:
    plies = (Ply(CARBON, 0.001, 0.0), Ply(PAPER, 0.002, 30.0), Ply(CARBON, 0.001, -45.0))
    specimen = LayeredSpecimen(0.3, 0.04, 0.004, plies, 1700.0)
    section = ShellSection(plies)
    c = dict(zip(section.terms, section.coefficients(section.nominal), strict=False))
    known = dict(
        zip(
            specimen.model.stiffness.names,
            specimen.stiffness_coefficients(np.array(list(specimen.nominal.values()))),
            strict=True,
        )
    )
    for name, value in known.items():
        assert c[name] == pytest.approx(
            value, rel=1e-10, abs=1e-12 * abs(known[name[0] + "11"] if name[0] != "S" else known["S55"])
        )


def test_a_reduced_basis_is_of_either() -> None:
    # `ReducedModel` asks a model for stiffness, mass and rigid modes alone.
    structure = Structure(strip(0.5, 0.04, 12, 2), {"strip": ShellSection((Ply(PAPER, 0.01),))}, (Support("start"),))
    q = np.array(list(structure.nominal.values()))
    reduced = ReducedModel(structure.model, structure.stiffness_coefficients(q), structure.mass_coefficients(q), 8)  # type: ignore[arg-type]
    q[:6] *= [1.05, 0.97, 1.1, 1.0, 0.9, 1.0]
    c, m = structure.stiffness_coefficients(q), structure.mass_coefficients(q)
    model = structure.model
    full = normal_modes(model.stiffness.at(c), model.mass.at(m), 8, model.rigid_modes)
    np.testing.assert_allclose(reduced.modes(c, m).frequency_hz, full.frequency_hz, rtol=1e-6)
