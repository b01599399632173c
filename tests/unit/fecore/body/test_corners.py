"""Corners at any angle: continuous, so that a faceted curve is a curve; stacks, sharp edges, walls
that end on others.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fecore.body.corners import Corner
from fecore.body.generators import Segment, extrude
from fecore.body.joints import NAIVE_ERROR
from fecore.body.junction_beams import between
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from tests.support.bodies import hz, pencil
from tests.support.lengths import long
from tests.support.shells import grid

GFRP = OrthotropicMaterial(25e9, 9e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)
ALONG = np.array([1.0, 0.0, 0.0])


def around(*degrees: float) -> np.ndarray:
    """Directions at angles about the line along x."""
    angles = np.radians(degrees)
    return np.column_stack([0 * angles, np.cos(angles), np.sin(angles)])


def two_walls(
    degrees: float,
    t: tuple[float, float] = (0.006, 0.004),
    names: tuple[str, str] = ("a", "b"),
    length: float = 0.2,
    element: float = 0.025,
) -> Structure:
    """Walls of 50 mm, of which the second turns by an angle."""
    turn = np.radians(degrees)
    segments = [
        Segment(names[0], (-0.05, 0.0), (0.0, 0.0)),
        Segment(names[1], (0.0, 0.0), (0.05 * np.cos(turn), 0.05 * np.sin(turn))),
    ]
    sections = {name: ShellSection((Ply(GFRP, own),)) for name, own in zip(names, t, strict=True)}
    return Structure(extrude(segments, length, element), sections)


@pytest.mark.long
@pytest.mark.parametrize(
    ("t", "names"), [((0.006, 0.004), ("a", "b")), ((0.006, 0.006), ("a", "a"))]
)
def test_matrices_have_no_jump_at_any_angle(t: tuple[float, float], names: tuple[str, str]) -> None:
    """What the joints add to a fixed motion's energy, by steps of the angle: its derivative changes
    little by little. In short a right angle is as it was and others are scaled, below.
    """
    degrees = np.arange(0, 93, 3.0)
    motion, added = np.random.default_rng(3), []
    shape = motion.standard_normal(two_walls(45.0, t, names, 0.05, 0.05).model.stiffness.size)
    for angle in degrees:
        on = two_walls(float(angle), t, names, 0.05, 0.05)
        with_joints, without = (pencil(each) for each in (on, replace(on, with_joints=False)))
        added.append(
            [
                shape @ (A @ shape) / (shape @ (B @ shape)) - 1
                for A, B in zip(with_joints, without, strict=True)
            ]
        )
    slope = np.diff(added, axis=0)
    assert added[0] == pytest.approx([0, 0], abs=1e-12)
    assert np.abs(np.diff(slope, axis=0)).max() < 0.15 * np.abs(slope).max()
    assert np.abs(added[-2]).max() > 1e-3


def test_a_right_angle_is_as_it_was_and_others_are_scaled() -> None:
    right, other = (Corner.of(ALONG, around(0, 180 - turn), (0.006, 0.004)) for turn in (90, 30))
    assert right.begin(0) == pytest.approx(0.002 / (1 + 3 * (6 / 4) ** 2))
    assert right.begin(1) == pytest.approx(0.003 / (1 + 3 * (4 / 6) ** 2))
    assert right.scale == pytest.approx(1)
    for stack in (0, 1):
        assert other.begin(stack) == pytest.approx(right.begin(stack) * np.tan(np.radians(15)))
    assert other.scale == pytest.approx(np.tan(np.radians(15)))


@pytest.mark.parametrize("beta", [90.0, 60.0, 20.0, 120.0])
def test_a_wall_that_ends_on_one_that_passes_begins_at_its_face(beta: float) -> None:
    corner = Corner.of(ALONG, around(0, beta, 180), (0.006, 0.004, 0.006))
    np.testing.assert_allclose(corner.straight[[0, 0, 1], [2, 1, 2]], [1, 0, 0], atol=1e-12)
    sine, cosine = np.sin(np.radians(beta)), np.cos(np.radians(beta))
    heights = np.array([-0.002, 0.0, 0.002])
    # A point at a along the wall and ζ beside it lies a sin β + ζ cos β above the middle of the one
    # that passes.
    np.testing.assert_allclose(
        corner.true_start(1, heights) * sine + heights * cosine, 0.003, rtol=1e-9
    )
    assert corner.begin(1) == pytest.approx(0.003 / sine / (1 + 3 * (4 / 6) ** 3))
    np.testing.assert_allclose(corner.true_start(0, heights), 0, atol=1e-12)


def test_three_alike_walls_are_mitred_alike() -> None:
    corner = Corner.of(ALONG, around(0, 120, 240), (0.005,) * 3)
    assert corner.straight.max() < 1e-12
    begins = [corner.begin(stack) for stack in range(3)]
    np.testing.assert_allclose(begins, 0.0025 / 4 * np.tan(np.radians(30)), rtol=1e-12)


@pytest.mark.parametrize("degrees", [179.0, 179.9999, 180.0])
def test_an_overlap_takes_a_third_of_a_wall_at_most(degrees: float) -> None:
    whole = Corner.of(ALONG, around(0, 180 - degrees), (0.003, 0.003))
    cut = whole.cut((0.1, 0.06))
    assert 0.95 * 0.02 < cut.overlap(0) <= 0.02
    # Of a wall that lies on the other all that is beyond a third is left, and no more than there
    # is.
    assert whole.cut((0.1, 0.06), 1.0).left(cut) == pytest.approx(2 / 3 * 0.06 / 0.0015, rel=0.05)
    sharp = Corner.of(ALONG, around(0, 100), (0.003, 0.003))
    assert sharp.left(sharp.cut((0.1, 0.06))) < 1e-9


def test_what_is_not_repaired_is_in_the_error() -> None:
    errors, changes = [], []
    for degrees in (90, 150, 160, 170, 175):
        body = two_walls(degrees, (0.004, 0.004))
        errors.append(body.model_error)
        changes.append(np.abs(hz(body, 6) / hz(replace(body, with_joints=False), 6) - 1).max())
    assert errors[0] == pytest.approx(0.003, rel=1e-6)
    assert sorted(errors) == errors
    # As the joints' own share of a frequency grows; and far more where a part of the overlap stays.
    assert np.all(np.array(errors) > 0.14 * np.array(changes))
    assert errors[1] == pytest.approx(0.003 * np.tan(np.radians(75)), rel=1e-3)
    assert errors[-1] > NAIVE_ERROR


def tube(facets: int) -> Structure:
    """Four elements a facet."""
    angles = 2 * np.pi * np.arange(facets + 1) / facets
    places = np.round(0.05 * np.column_stack([np.cos(angles), np.sin(angles)]), 12) + 0.0
    places[-1] = places[0]
    walls = []
    for a, b in pairwise(places):
        line = [a + (b - a) * k / 4 for k in range(5)]
        walls += [Segment("tube", tuple(p), tuple(q)) for p, q in pairwise(line)]
    return Structure(extrude(walls, 0.1, 0.05), {"tube": ShellSection((Ply(GFRP, 0.002),))})


@pytest.mark.parametrize("most", [32, long(64)])
def test_facets_of_a_tube_converge_to_one_set_of_frequencies(most: int) -> None:
    counts = [facets for facets in (8, 16, 32, 64) if facets <= most]
    found = np.array([hz(tube(facets), 6) for facets in counts])
    steps = np.diff(found, axis=0)
    assert (steps < 0).all()
    # The turns go with the square of their number, as an inscribed polygon's length does.
    assert (np.abs(steps[1:]) < 0.35 * np.abs(steps[:-1])).all()
    assert (
        np.abs(found[-1] / found[-2] - 1) < 4e-3 * (64 / most) ** 2
    ).all()  # what is left is a third of this


def dome(n: int, kind: str) -> Structure:
    """Curved both ways, so that every edge of flat elements turns by an angle of its own, along a
    direction of its own.
    """

    def surface(st: np.ndarray) -> np.ndarray:
        x, y = st[:, 0] - 0.5, st[:, 1] - 0.5
        return np.column_stack([x, y, 0.15 * (1 - 4 * x**2) * (1 - 3 * y**2)])

    return Structure(grid(kind, n, n, surface), {"plate": ShellSection((Ply(GFRP, 0.004),))})


@pytest.mark.parametrize("kind", ["quad4", long("tri3")])
def test_coefficients_of_a_curve_are_as_many_as_its_angles_at_most_however_fine_its_mesh(
    kind: str,
) -> None:
    models = [dome(n, kind).model for n in (5, 12)]
    # a junction beam's by E, G and Gt, and of what is given up EA, ES and EI; a junction beam's mass along three axes
    of_set = 3 + 3 + 3
    for model in models:
        joints = [n for n in (*model.stiffness.names, *model.mass.names) if ".joint" in n]
        assert len(joints) <= 36 * of_set
        assert len(model.stiffness.groups) <= 3 + 4 * 36


def test_a_dome_of_facets_has_exact_derivatives() -> None:
    body = dome(4, "quad4")
    q = np.array(list(body.nominal.values()))
    shapes = np.random.default_rng(5).standard_normal((body.model.stiffness.size, 2))
    for matrix, of in (
        (body.model.stiffness, body.stiffness_coefficients),
        (body.model.mass, body.mass_coefficients),
    ):
        forms = matrix.project(shapes, slice(None))
        for name in ("plate.E1", "plate.G12", "plate.G13", "plate.density"):
            step = np.where(np.array(list(body.nominal)) == name, 1e-4 * q, 0.0)
            by_step = np.tensordot(of(q + 1e-30j * step).imag / 1e-30, forms, 1)
            ahead, behind = (
                shapes.T @ (matrix.at(of(q + sign * step)) @ shapes) for sign in (1, -1)
            )
            whole = np.abs(shapes.T @ (matrix.at(of(q)) @ shapes)).max()
            np.testing.assert_allclose(by_step, (ahead - behind) / 2, atol=1e-10 * whole)


@pytest.mark.parametrize(
    ("turn", "angle"), [(1.0, 0.4321), (0.1, 1.234), (1e-6, 3.1), (1.0, np.pi / 2), (0.3, 0.0)]
)
def test_angles_lie_between_those_of_the_coefficients(turn: float, angle: float) -> None:
    which, degrees, share = between(np.array([angle]), np.array([turn]))
    assert share.sum() == pytest.approx(1)
    assert (share > 0).all()
    assert (which == 0).all()
    # Wherever the half circle begins anew.
    assert (share @ np.exp(2j * np.radians(degrees))).real == pytest.approx(
        np.cos(2 * angle), abs=turn**-1 * 1e-3
    )
    if angle in (0.0, np.pi / 2):
        assert degrees.tolist() == [round(np.degrees(angle))]


@pytest.mark.parametrize("split", [False, True])
def test_walls_on_the_same_nodes_are_one(split: bool) -> None:
    """Two layers of one thickness together, the second as quadrilaterals or triangles; flat and
    around a corner.
    """
    plain = two_walls(60.0, (0.004, 0.004), ("a", "a")).mesh
    corners = plain.blocks[0].nodes[:, :4]
    used, nodes = np.unique(corners, return_inverse=True)
    quads = nodes.reshape(corners.shape)
    second = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if split else quads
    mesh = Mesh(
        plain.nodes[used],
        (CellBlock("quad4", quads, "a"), CellBlock("tri3" if split else "quad4", second, "b")),
    )
    sections = {name: ShellSection((Ply(GFRP, t),)) for name, t in (("a", 0.003), ("b", 0.001))}
    body = Structure(mesh, sections)
    (junction,) = body.junctions
    assert junction.angles == pytest.approx((120, 120))
    assert sorted(name for name, _, _ in junction.walls) == ["a", "a", "b", "b"]
    one = Structure(Mesh(mesh.nodes, mesh.blocks[:1]), {"a": ShellSection((Ply(GFRP, 0.004),))})
    motions = body.model.motions[:, 0]
    masses = [float(motions @ (pencil(each)[1] @ motions)) for each in (body, one)]
    assert masses[0] == pytest.approx(masses[1], rel=1e-9)
    assert body.junctions[0].edges[0].corner.begin(0) == pytest.approx(
        one.junctions[0].edges[0].corner.begin(0)
    )
    assert np.isfinite(hz(body, 3)).all()
