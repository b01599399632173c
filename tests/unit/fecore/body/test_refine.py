"""A finer mesh is of the same body: its area, its surface, its supports, and frequencies that
converge as its elements do.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.beams import BeamSection
from fecore.body.facets import facet_turn, re_entrant
from fecore.body.generators import profile
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.refine import element_size, refined
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import Link, Mass, Support
from tests.support.panels import RADIUS, deck
from tests.support.stored_solids import frequencies


def _mass(body: Structure) -> float:
    moved = body.model.motions[:, 0]
    return float(
        moved
        @ body.model.mass.at(body.mass_coefficients(np.array(list(body.nominal.values()))))
        @ moved
    )


def _area(body: Structure) -> float:
    """From the mass of a body of one section."""
    section = body.sections["skin"]
    assert isinstance(section, ShellSection)
    return float(_mass(body) / section.nominal["density"] / section.thickness)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_flat_elements_keep_nodes_and_area(element: str) -> None:
    body = deck("cut-out", 6, 4, element)
    found = refined(body)
    fine = found.body.mesh
    assert np.array_equal(fine.nodes[: len(body.mesh.nodes)], body.mesh.nodes)
    assert _area(found.body) == pytest.approx(_area(body), rel=1e-12)
    assert found.interpolation @ body.mesh.nodes == pytest.approx(fine.nodes, abs=1e-15)
    assert element_size(fine) == pytest.approx(
        element_size(body.mesh) / (1 if element == "quad4" else 2)
    )
    assert facet_turn(body.mesh) == 0
    corners = body.mesh.nodes[re_entrant(body.mesh)]
    assert {tuple(np.round(each[:2], 9)) for each in corners} == {
        (x, y) for x in (0.1, 0.2) for y in (-0.05, 0.05)
    }


def test_new_nodes_of_facets_lie_on_the_cylinder_to_the_fourth_order_up_to_its_edges() -> None:
    off = []
    for across in (6, 12):
        body = deck("curved", 3, across, "quad4")
        assert facet_turn(body.mesh) == pytest.approx(0.2 * 1.25 / RADIUS / across, rel=0.01)
        fine, flat = refined(body).body.mesh.nodes, refined(body, curved=False).body.mesh.nodes
        off.append(np.abs(np.hypot(fine[:, 1], fine[:, 2]) - RADIUS).max())
        assert np.abs(np.hypot(flat[:, 1], flat[:, 2]) - RADIUS).max() > 50 * off[-1]
    assert off[1] < off[0] / 14
    assert facet_turn(deck("curved", 3, 6, "quad8").mesh) == 0  # its sides are curved already


@pytest.mark.long
def test_frequencies_converge_as_the_order_says() -> None:
    """In short a forecast has those of a finer mesh, in `test_mesh_error.py`."""
    bodies = [deck("curved", 6, 4, "quad4")]
    for _ in range(3):
        bodies.append(refined(bodies[-1]).body)
    hz = np.array([frequencies(body, 6) for body in bodies])
    off = np.abs(hz[:-1] / hz[-1] - 1).max(axis=1)
    assert off[0] > 0.03
    assert off[1] < off[0] / 4  # one order higher
    assert off[2] < off[1] / 8  # halved


def test_folds_stay_folds_and_triangles_bars_and_thickness_go_along() -> None:
    wall = ShellSection(deck("tapered", 1, 1, "quad4").sections["skin"].plies)
    body = Structure(
        profile("angle", 0.6, 0.06, 0.05, 0.006, 0.006, elements=2), {"flange": wall, "web": wall}
    )
    fine = refined(body).body
    assert len(fine.junctions) == len(body.junctions)
    assert np.abs(frequencies(fine, 6) / frequencies(body, 6) - 1).max() < 0.003
    x = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])
    blocks = (
        CellBlock(
            "tri3",
            np.array([[0, 1, 2], [0, 2, 3]]),
            "a",
            thickness=np.array([[1.0, 1, 3], [1, 3, 1]]),
        ),
        CellBlock("quad4", np.array([[1, 4, 2, 2]]), "a"),  # a triangle by its nodes
    )
    skin = Structure(Mesh(x, blocks), {"a": wall})
    raised = refined(skin).body.mesh.blocks[0]
    assert raised.kind == "tri6"
    assert raised.thickness is not None
    assert raised.thickness[0] == pytest.approx([1, 1, 3, 1, 2, 2])
    halved = refined(refined(skin).body).body.mesh.blocks[0]
    assert halved.nodes.shape == (8, 6)


def test_a_deck_of_all_sorts_stays_one_body() -> None:
    wall = ShellSection(deck("tapered", 1, 1, "quad4").sections["skin"].plies)
    bar = replace(BeamSection.rectangle(0.01, 0.02, 70e9, 26e9, 2700.0), axis=(1.0, 0.0, 0.0))
    x = np.array([[i, j, 0] for j in (0, 0.5, 1) for i in (0, 1, 1.5, 2)]) * 0.1
    quad8 = np.array([[1, 3, 11, 9, 2, 7, 10, 5]])
    blocks = (
        CellBlock(
            "quad4", np.array([[0, 1, 5, 4]]), "skin"
        ),  # two small ones beside half a side each
        CellBlock("tri3", np.array([[4, 5, 9], [4, 9, 8]]), "skin"),
        CellBlock("quad8", quad8, "skin"),
        CellBlock("beam2", np.array([[3, 11]]), "bar"),  # past the middle of the side
    )
    node = len(x)
    mesh = Mesh(np.vstack([x, [0.1, 0.05, 0.1]]), blocks)
    body = Structure(
        mesh,
        {"skin": wall, "bar": bar},
        masses=(Mass(0.3, node),),
        links=(Link(node, (0, 3, 8, 11)),),
    )
    once = refined(body).body
    coarse, fine = (each.model for each in (body, once))
    assert fine.rigid_modes.shape[1] == coarse.rigid_modes.shape[1] == 6
    assert _mass(once) == pytest.approx(_mass(body), rel=1e-12)
    used = once.mesh.nodes[
        np.unique(np.concatenate([block.nodes.ravel() for block in once.mesh.blocks]))
    ]
    assert len(np.unique(np.round(used, 9), axis=0)) == len(used)  # no slit
    assert np.all(frequencies(once, 6) < frequencies(body, 6) * 1.001)


def test_supports_hold_the_new_nodes_amid_them_and_no_others() -> None:
    body = deck("tapered", 4, 1, "quad4")  # one element across: every node lies on an edge
    across = np.flatnonzero(body.mesh.nodes[:, 0] == 0)
    both = np.arange(len(body.mesh.nodes))[body.mesh.nodes[:, 0] > 0.1]
    mesh = replace(body.mesh, node_sets={"root": across, "point": across[:1], "sides": both})
    held = refined(replace(body, mesh=mesh, supports=(Support("root"),))).body
    places = {name: held.mesh.nodes[nodes] for name, nodes in held.mesh.node_sets.items()}
    assert len(places["root"]) == 3
    assert np.all(places["root"][:, 0] == 0)
    assert len(places["point"]) == 1
    inner = (places["sides"][:, 0] < 0.29) & (np.abs(places["sides"][:, 1]) < 1e-9)
    assert not inner.any()  # strips between held edges stay free
    # a support for each node, as decks state them: between two is held what both hold
    one_each = {f"held {node}": np.array([node]) for node in across}
    how: tuple[tuple[str, ...], ...] = (("u", "v", "w"), ("v", "w", "rx"))
    single = refined(
        replace(
            body,
            mesh=replace(mesh, node_sets=one_each),
            supports=tuple(map(Support, one_each, how)),
        )
    ).body
    (between,) = single.supports[2:]
    assert between.how == ("v", "w")
    assert single.mesh.select(between.where).tolist() == [
        node for node in held.mesh.node_sets["root"] if node not in across
    ]
    links = tuple(Link(int(node), (int(both[-1]),)) for node in across)
    dependent = refined(replace(body, links=links)).body.links
    assert len(dependent) == 3
    assert all(link.independent == links[0].independent for link in dependent)


def test_supports_along_axes_of_their_own_hold_the_new_nodes_too() -> None:
    """A plate that stands askew, and an arc whose nodes each have axes of their own."""
    body = deck("tapered", 4, 3, "quad4")
    x = body.mesh.nodes
    root, side = np.flatnonzero(x[:, 0] == 0), np.flatnonzero(np.isclose(x[:, 1], x[:, 1].min()))
    sets = {"root": root, "side": side}
    along = Structure(
        replace(body.mesh, node_sets=sets),
        body.sections,
        (Support("root"), Support("side", ("w", "rx"))),
    )
    c, s = np.cos(0.5), np.sin(0.5)
    axes = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    held = {int(node): (2, 3) for node in side} | {int(node): (0, 1, 2, 3, 4, 5) for node in root}
    sections = {
        name: replace(section, axis=tuple(axes.T @ section.axis))
        for name, section in body.sections.items()
    }
    askew = Structure(
        replace(body.mesh, nodes=x @ axes),
        sections,
        links=tuple(Link(node, (), dofs, axes=axes) for node, dofs in held.items()),
    )
    hz = frequencies(refined(along).body, 6)
    assert frequencies(refined(askew).body, 6) == pytest.approx(hz, rel=1e-6)  # round-off

    arc = deck("curved", 2, 4, "quad4")
    y, z = arc.mesh.nodes[:, 1], arc.mesh.nodes[:, 2]
    end = np.flatnonzero(arc.mesh.nodes[:, 0] == 0)
    radial = [
        np.array([[1, 0, 0], [0, y[i], z[i]], [0, -z[i], y[i]]]) / [[1], [RADIUS], [RADIUS]]
        for i in end
    ]
    links = [Link(int(i), (), (1, 3), axes=own) for i, own in zip(end, radial, strict=True)]
    new = refined(replace(arc, links=tuple(links))).body
    assert len(new.links) == 2 * len(end) - 1
    for link in new.links:
        outward = new.mesh.nodes[link.node] * [0, 1, 1] / RADIUS
        assert link.turn[1, :3] == pytest.approx(outward, abs=1e-3)  # the arc is a parabola there
        assert link.dofs == (1, 3)
