"""What may differ from element to element, or hangs on nodes: axes, offsets, springs, links along
axes of their own.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.beams import BeamSection
from fecore.body.generators import profile, strip
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import Link, NodeSpring, Spring, Support
from tests.support.bodies import hz, modes

GFRP = OrthotropicMaterial(23e9, 8.5e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)
WALL = ShellSection((Ply(GFRP, 0.006),))


def test_two_halves_with_axes_of_their_own_are_not_taken_for_alike() -> None:
    mesh = strip(0.5, 0.1, 10, 2)
    (block,) = mesh.blocks
    left = mesh.nodes[block.nodes, 0].mean(axis=1) < 0.25
    axes = np.where(left[:, None], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    turned = replace(WALL, axis=(0.0, 1.0, 0.0))
    halves = Mesh(
        mesh.nodes,
        (CellBlock("quad8", block.nodes[left], "a"), CellBlock("quad8", block.nodes[~left], "b")),
    )
    expected = hz(Structure(halves, {"a": WALL, "b": turned}))
    found = hz(Structure(replace(mesh, blocks=(replace(block, axes=axes),)), {"strip": WALL}))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_beams_axes_and_offsets_by_element_are_those_of_its_section() -> None:
    section = BeamSection.rectangle(0.01, 0.03, 20e9, 4e9, 1800.0)
    nodes = np.column_stack([np.linspace(0, 1, 11), np.zeros(11), np.zeros(11)])
    ends = np.column_stack([np.arange(10), np.arange(1, 11)])
    whole = replace(section, axis=(0.0, 0.6, 0.8), offset=(0.0, 0.02, -0.01))
    expected = hz(Structure(Mesh(nodes, (CellBlock("beam2", ends, "b"),)), {"b": whole}))
    block = CellBlock(
        "beam2", ends, "b",
        axes=np.tile([0.0, 0.6, 0.8], (10, 1)), offsets=np.broadcast_to([0.0, 0.02, -0.01], (10, 2, 3)).copy(),
    )  # fmt: skip
    np.testing.assert_allclose(
        hz(Structure(Mesh(nodes, (block,)), {"b": section})), expected, rtol=1e-9
    )


def test_a_shell_may_lie_off_its_nodes() -> None:
    mesh = strip(0.5, 0.1, 10, 2)
    up = np.zeros((len(mesh.blocks[0].nodes), 8, 3))
    up[..., 2] = 0.02
    moved = replace(mesh, blocks=(replace(mesh.blocks[0], offsets=up),))
    held = (Support("start"),)
    by_offset = hz(Structure(moved, {"strip": WALL}, held))
    by_section = hz(Structure(mesh, {"strip": replace(WALL, offset=0.02)}, held))
    # The section's rotary inertia about its own middle is the same; both are the same plate on
    # rigid arms.
    np.testing.assert_allclose(by_offset, by_section, rtol=2e-3)


def test_a_spring_at_a_node_is_that_at_its_point() -> None:
    mesh = strip(0.5, 0.1, 10, 2)
    number = int(np.argmin(np.linalg.norm(mesh.nodes - [0.5, 0.0, 0.0], axis=1)))
    row = np.zeros((1, 1, 6))
    row[..., 2] = 1
    held = (Support("start"),)
    at_node = NodeSpring("tip", 5e3, np.array([[number]]), row)
    at_point = Spring("tip", 5e3, 3, point=(0.5, 0.0))
    assert at_node.unit == at_point.unit == "N/m"
    found = [
        hz(Structure(mesh, {"strip": WALL}, held, (spring,)), 4) for spring in (at_node, at_point)
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)
    assert found[0][0] > 1.2 * hz(Structure(mesh, {"strip": WALL}, held))[0]
    turn = np.zeros((1, 1, 6))
    turn[..., 4] = 1
    assert replace(at_node, rows=turn).unit == "N·m/rad"


def test_a_link_leads_along_axes_of_its_own() -> None:
    c, s = np.cos(0.4), np.sin(0.4)
    axes = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    link = Link(1, (0,), dofs=(0, 3), axes=axes)
    nodes = np.array([[0.0, 0, 0], [0.2, 0.1, 0.3]])
    rigid = Link(1, (0,)).matrices(nodes)[0]
    along = np.array([*axes[0], 0, 0, 0])
    np.testing.assert_allclose(along @ link.matrices(nodes)[0], along @ rigid, atol=1e-15)
    across = np.array([*axes[1], 0, 0, 0])
    np.testing.assert_allclose(across @ link.matrices(nodes)[0], 0, atol=1e-15)


def test_a_support_along_axes_of_its_own_is_that_of_the_turned_body() -> None:
    """A profile whose end slides along its own axis, and the same lying askew in space."""
    mesh, held = profile("i", 0.9, 0.12, 0.06, 0.006, 0.006, elements=2), ("v", "w", "rx")
    walls = dict.fromkeys(("flange", "web"), WALL)
    straight = Structure(mesh, walls, (Support("start", held), Support("end", "clamped")))
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)  # columns: the body's x, y and z in space
    askew = Structure(
        replace(mesh, nodes=mesh.nodes @ turn.T),
        dict.fromkeys(walls, replace(WALL, axis=tuple(turn[:, 0]))),
        (Support("end", "clamped"),),
        links=tuple(Link(int(n), (), (1, 2, 3), axes=turn.T) for n in mesh.node_sets["start"]),
    )
    np.testing.assert_allclose(hz(askew), hz(straight), rtol=1e-8)
    assert hz(Structure(mesh, walls, (Support("end", "clamped"),)))[0] < 0.5 * hz(straight)[0]
    points, along = (
        np.array([[0.003, 0.01, 0.06], [0.02, 0.003, 0.0]]),
        np.array([[0, 0, 1.0], [0, 1.0, 0]]),
    )
    here = straight.model.observe(points, along) @ straight.model.motions
    there = askew.model.observe(points @ turn.T, along @ turn.T) @ askew.model.motions
    # What the supports leave of a rigid motion along and about the body's axes: all that each row
    # sees, one by one.
    both = np.kron(np.eye(2), turn)
    np.testing.assert_allclose(there @ both, here, atol=1e-9)


@pytest.mark.parametrize("dofs", [(0, 1, 2, 3, 4, 5), (0, 1, 2, 3, 5)])
def test_points_on_led_walls_move_with_their_leaders(dofs: tuple[int, ...]) -> None:
    """A strip in two halves, the nodes of one edge led by those of the other; and all but one turn,
    a hinge with a spring.
    """
    mesh = strip(0.4, 0.05, 16, 2)
    (block,) = mesh.blocks
    right = mesh.nodes[block.nodes][..., 0].mean(axis=1) > 0.2
    seam = np.flatnonzero(np.abs(mesh.nodes[:, 0] - 0.2) < 1e-9)
    number = np.arange(len(mesh.nodes))
    number[seam] = len(mesh.nodes) + np.arange(seam.size)
    halves = (
        replace(block, nodes=block.nodes[~right]),
        CellBlock("quad8", number[block.nodes[right]], "strip"),
    )
    links = tuple(Link(int(number[n]), (int(n),), dofs) for n in seam)
    turn = np.zeros((seam.size, 2, 6))
    turn[:, :, 4] = 1, -1
    hinge = NodeSpring("hinge", 1e7, np.column_stack([seam, number[seam]]), turn)
    springs = (hinge,) if len(dofs) < 6 else ()
    nodes = np.vstack([mesh.nodes, mesh.nodes[seam]])
    parted = Structure(
        Mesh(nodes, halves, mesh.node_sets), {"strip": WALL}, links=links, springs=springs
    )
    shapes = []
    for body in (Structure(mesh, {"strip": WALL}), parted):
        found = modes(body, 3)
        point = body.model.observe(np.array([[0.21, 0.02, 0.0]]), np.array([[0, 0, 1.0]]))
        shapes.append((found.frequency_hz[6:], np.abs(point @ found.shapes[:, 6:])[0]))
        # the last node is led
        assert body.model.at_nodes(found.shapes)[:, [0, -1]].any(axis=(1, 2)).all()
    np.testing.assert_allclose(shapes[1][0], shapes[0][0], rtol=2e-4)
    np.testing.assert_allclose(shapes[1][1], shapes[0][1], rtol=1e-3, atol=1e-3)
