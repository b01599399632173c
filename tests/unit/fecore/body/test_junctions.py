"""Junctions: found on any mesh, and a joint model that has the body's mass."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy

from fecore.body.generators import panel, profile
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from tests.support.bodies import hz, pencil
from tests.support.lengths import long
from tests.support.shells import grid, isotropic

GFRP = OrthotropicMaterial(25e9, 9e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)


def wall(t: float) -> ShellSection:
    return ShellSection((Ply(GFRP, t),))


def mass(structure: Structure) -> np.ndarray:
    """(6, 6) mass matrix of the rigid body about its nodes' centre."""
    motions = structure.model.motions
    return motions.T @ (pencil(structure)[1] @ motions)


@pytest.mark.parametrize(
    ("shape", "lines", "area"),
    [
        ("i", 2, 2 * 0.04 * 0.005 + 0.05 * 0.004),
        ("box", 4, 2 * 0.04 * 0.005 + 2 * 0.05 * 0.004),
        ("channel", 2, 2 * 0.04 * 0.005 + 0.05 * 0.004),
        ("angle", 1, 0.04 * 0.005 + 0.055 * 0.004),
        ("tee", 1, 0.04 * 0.005 + 0.055 * 0.004),
    ],
)
def test_profiles_have_their_lines_and_their_mass(shape, lines, area) -> None:
    mesh = profile(shape, 0.3, 0.06, 0.04, 0.005, 0.004, elements=3)
    structure = Structure(mesh, {"flange": wall(0.005), "web": wall(0.004)})
    found = structure.junctions
    assert len(found) == lines
    for junction in found:
        assert junction.length == pytest.approx(0.3)
        assert {name for name, _, _ in junction.walls} == {"flange", "web"}
        passing = [name for name, _, passes in junction.walls if passes]
        assert passing == (["flange", "flange"] if shape in ("i", "tee") else [])
    # alike elements are alike to 1e-10
    assert mass(structure)[0, 0] == pytest.approx(1850 * 0.3 * area, rel=1e-10)


def test_moments_of_inertia_are_the_solids() -> None:
    # An I of full rectangles: its rotary inertia about x is ρL (Iy + Iz), that of shells'
    # overlapping walls is not.
    h, b, tf, tw, L = 0.06, 0.04, 0.005, 0.004, 0.3
    mesh = profile("i", L, h, b, tf, tw, elements=6)
    sections = {"flange": wall(tf), "web": wall(tw)}
    Iy = b * h**3 / 12 - (b - tw) * (h - 2 * tf) ** 3 / 12
    Iz = 2 * tf * b**3 / 12 + (h - 2 * tf) * tw**3 / 12
    exact = 1850 * L * (Iy + Iz)
    with_joints, without = (
        mass(Structure(mesh, sections, with_joints=on))[3, 3] for on in (True, False)
    )
    # The drilling inertia is a little more than none.
    assert with_joints == pytest.approx(exact, rel=3e-4)
    assert abs(without / exact - 1) > 5e-3


SHAPES = ("i", "box", "channel", "angle", "panel")


def short_body(
    shape: str, size: float, flange: float, web: float, height: float, length: float
) -> Structure:
    """A body of elements of a size in m, of GFRP."""
    if shape == "panel":
        ribs = (-0.2 * height, 0.2 * height)
        mesh = panel(length, height, 0.6 * height, flange, web, ribs, round(height / size))
        return Structure(mesh, {"plate": wall(flange), "rib": wall(web)})
    mesh = profile(shape, length, height, 0.8 * height, flange, web, round(height / size))
    return Structure(mesh, {"flange": wall(flange), "web": wall(web)})


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("walls", "other", "height", "length"), [(0.5, 2.0, 5, 1), long(8, 2.0, 24, 24)]
)
def test_elements_of_any_size_have_definite_matrices(shape, walls, other, height, length) -> None:
    t = 0.01
    structure = short_body(shape, walls * t, other * t, t, height * t, length * t)
    lowest = []
    for A in pencil(structure):
        scale = scipy.sparse.diags_array(1 / np.sqrt(A.diagonal()))
        lowest.append(np.linalg.eigvalsh((scale @ A @ scale).toarray())[:7])
    assert lowest[0][0] > -1e-13  # six rigid motions, and nothing below them
    assert lowest[0][6] > 1e-6
    assert lowest[1][0] > 1e-6


def test_frequencies_converge_as_elements_become_smaller_than_walls() -> None:
    t, found = 0.01, []
    for walls in (2, 1, 0.5):
        structure = short_body("angle", walls * t, 2 * t, t, 6 * t, 4 * t)
        found.append(hz(structure, 4))
    coarse, fine = (np.abs(a / b - 1).max() for a, b in pairwise(found))
    assert coarse > 2.5 * fine
    assert fine < 2e-3


@pytest.mark.parametrize("shape", [long("box"), "panel"])
def test_energies_of_shapes_have_exact_derivatives(shape) -> None:
    """By every constant: a complex step of the coefficients with forms from strains, against the
    matrices' differences.
    """
    structure = short_body(shape, 0.02, 0.012, 0.01, 0.08, 0.06)
    q = np.array(list(structure.nominal.values()))
    shapes = np.random.default_rng(5).standard_normal((structure.model.stiffness.size, 2))
    for matrix, of in (
        (structure.model.stiffness, structure.stiffness_coefficients),
        (structure.model.mass, structure.mass_coefficients),
    ):
        forms = matrix.project(shapes, slice(None))
        for k, value in enumerate(q):
            step = np.zeros(len(q))
            step[k] = 1e-4 * value
            by_step = np.tensordot(of(q + 1e-30j * step).imag / 1e-30, forms, 1)
            ahead, behind = (
                shapes.T @ (matrix.at(of(q + sign * step)) @ shapes) for sign in (1, -1)
            )
            whole = np.abs(shapes.T @ (matrix.at(of(q)) @ shapes)).max()
            np.testing.assert_allclose(by_step, (ahead - behind) / 2, atol=3e-11 * whole)


def test_ribs_end_at_the_plate() -> None:
    mesh = panel(0.4, 0.3, 0.05, 0.004, 0.006, (-0.08, 0.08), elements=6)
    structure = Structure(mesh, {"plate": wall(0.004), "rib": wall(0.006)})
    assert [sorted(j.walls) for j in structure.junctions] == [
        [("plate", 0.004, True), ("plate", 0.004, True), ("rib", 0.006, False)]
    ] * 2
    assert structure.junctions[0].angles == pytest.approx((90, 180, 90), abs=1e-6) or sorted(
        structure.junctions[0].angles
    ) == pytest.approx([90, 90, 180], abs=1e-6)


@pytest.mark.parametrize("kind", ["quad4", "tri3", "tri6"])
def test_junctions_are_found_on_users_meshes(kind) -> None:
    floor = grid(kind, 4, 3, lambda st: np.column_stack([st, 0 * st[:, 0]]), "floor")
    side = grid(
        kind, 4, 2, lambda st: np.column_stack([st[:, 0], 0 * st[:, 0], 0.5 * st[:, 1]]), "side"
    )
    number = np.concatenate(
        [np.arange(len(floor.nodes)), len(floor.nodes) + np.arange(len(side.nodes))]
    )
    for node, place in enumerate(side.nodes):
        same = np.flatnonzero(np.abs(floor.nodes - place).max(axis=1) < 1e-12)
        if same.size:
            number[len(floor.nodes) + node] = same[0]
    blocks = (
        *floor.blocks,
        CellBlock(kind, number[side.blocks[0].nodes + len(floor.nodes)], "side"),
    )
    mesh = Mesh(np.concatenate([floor.nodes, side.nodes]), blocks)
    structure = Structure(
        mesh, {"floor": isotropic(70e9, 0.3, 0.02), "side": isotropic(70e9, 0.3, 0.01)}
    )
    (junction,) = structure.junctions
    assert junction.length == pytest.approx(1)
    assert junction.angles == pytest.approx((90, 90))
    assert structure.model.rigid_modes.shape[1] == 6


def test_a_curve_of_curved_elements_has_none() -> None:
    def bent(st: np.ndarray) -> np.ndarray:
        return np.column_stack([np.cos(3 * st[:, 0]), np.sin(3 * st[:, 0]), st[:, 1]])

    section = ShellSection((Ply(GFRP, 0.01),), axis=(0.0, 0.0, 1.0))
    faceted, curved = (
        Structure(grid(kind, 12, 2, bent), {"plate": section}) for kind in ("quad4", "quad8")
    )
    assert [junction.angles for junction in faceted.junctions] == [
        pytest.approx((180 - np.degrees(0.25),) * 2)
    ] * 11
    # Of curved elements what turns is what parabolas miss of a circle.
    assert faceted.model_error == pytest.approx(0.003 * np.tan(0.125), rel=1e-3)
    half = 0.125  # rad of an element's arc: at its ends a parabola's slope is less by half³/4
    assert curved.model_error == pytest.approx(0.003 * half**3 / 4, rel=0.02)


@pytest.mark.parametrize(
    ("shape", "stretch", "joints", "rtol"),
    [
        # How walls grow thinner is of the nominal dimensions.
        ("i", (1.1,), True, 2e-5),
        ("box", (1.01, 0.98, 1.02), False, 1e-5),
        # their sections are nominal: .1 % of a frequency at stretches of 2 %
        ("box", (1.01, 0.98, 1.02), True, 3e-3),
    ],
)
def test_length_width_and_height_are_exact_constants_but_for_the_joints(
    shape, stretch, joints, rtol
) -> None:
    sections, size = {"flange": wall(0.005), "web": wall(0.004)}, (0.3, 0.04, 0.06)
    nominal = Structure(
        profile(shape, 0.3, 0.06, 0.04, 0.005, 0.004, elements=2),
        sections,
        size=size[: len(stretch)],
    )
    nominal = replace(nominal, with_joints=joints)
    nodes = nominal.mesh.nodes * (*stretch, 1.0, 1.0)[:3]
    built = Structure(replace(nominal.mesh, nodes=nodes), sections, with_joints=joints)
    q = np.array(list(nominal.nominal.values()))
    q[-len(stretch) :] *= stretch
    np.testing.assert_allclose(hz(nominal, 10, q), hz(built, 10), rtol=rtol)


def test_a_box_encloses_a_cell_and_has_the_larger_error() -> None:
    sections = {"flange": wall(0.005), "web": wall(0.004)}
    for shape, error in (
        ("i", 0.003),
        ("box", 0.0045),
        ("channel", 0.003),
        ("angle", 0.003),
        ("tee", 0.003),
    ):
        body = Structure(profile(shape, 0.3, 0.06, 0.04, 0.005, 0.004, elements=2), sections)
        assert body.model_error == pytest.approx(error, rel=1e-6)
        assert replace(body, with_joints=False).model_error == 0.016
    thick = {"flange": wall(0.008), "web": wall(0.004)}
    assert Structure(
        profile("i", 0.3, 0.06, 0.04, 0.008, 0.004, elements=2), thick
    ).model_error == pytest.approx(0.0045, rel=1e-6)
