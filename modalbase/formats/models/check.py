"""What a model must satisfy before it is solved: elements that have a shape, and parts that hang
together.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter

import numpy as np
import scipy

from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import (
    Elements,
    FiniteElementModel,
    Floats,
    IncompleteError,
    Integers,
    Link,
    ShellSection,
    Support,
)


def sizes(block: Elements, places: Floats) -> Floats:
    """(e,) area of shells by their corners, length of beams by their ends."""
    x = places[block.nodes[:, : CELL_TYPES[block.kind].corners]]
    if block.kind.startswith("beam"):
        return np.asarray(np.linalg.norm(x[:, 1] - x[:, 0], axis=1))
    return np.asarray(np.linalg.norm(normals_of(x), axis=1) / 2)


def mean_thickness(model: FiniteElementModel, name: str) -> float:
    """Of a set of shells; where elements state thicknesses of their own, the mean of these over the
    set's area.
    """
    section = model.sections[name]
    assert isinstance(section, ShellSection), "beams have none"
    nominal = sum(ply.thickness for ply in section.plies)
    blocks = [block for block in model.elements if block.set == name]
    if all(block.thickness is None for block in blocks):
        return nominal
    areas = [sizes(block, model.nodes) for block in blocks]
    volume = sum(
        float(area.sum() * nominal if b.thickness is None else area @ b.thickness.mean(axis=1))
        for area, b in zip(areas, blocks, strict=True)
    )
    return volume / sum(float(area.sum()) for area in areas)


def normals_of(x: Floats) -> Floats:
    """(e, 3) twice the area along the normal, of (e, n, 3) corners."""
    first, second = (
        (x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        if x.shape[1] == 3
        else (x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    )
    return np.asarray(np.cross(first, second))


ALONG_NORMAL = np.cos(np.radians(0.1))
"""An axis lies along a normal from here on (Abaqus and CalculiX)."""


def unit(x: Floats) -> Floats:
    """(e, 3) vectors of length 1 along others; those of no length stay."""
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300))


def axis_without_system(normals: Floats) -> Floats:
    """(e, 3) axis 1 of shells that have none of their own, not projected: x, or z where x is their
    normal.
    """
    along = np.abs(normals[:, 0]) > ALONG_NORMAL
    return np.where(along[:, None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])


def worst_corner(block: Elements, places: Floats) -> Floats:
    """(e,) the least Jacobian at the corners of shells by that of their mean, ≤ 0 where an element
    folds over.

    The Jacobian is that of the sides' tangents, which those with a node amid bend; of a beam, the
    least share of its length between its nodes.
    """
    n = CELL_TYPES[block.kind].corners
    x = places[block.nodes]
    middles = x[:, n:] if x.shape[1] > n else None
    if n == 2:
        if middles is None:
            return np.ones(len(x))
        along = x[:, 1] - x[:, 0]
        share = np.einsum("ei,ei->e", middles[:, 0] - x[:, 0], along) / np.einsum(
            "ei,ei->e", along, along
        )
        return np.asarray(4 * np.minimum(share, 1 - share) - 1)
    normals = normals_of(x[:, :n])
    least = np.full(len(x), np.inf)
    for k in range(n):
        here, after, before = x[:, k], x[:, (k + 1) % n], x[:, k - 1]
        if middles is None:
            out, back = after - here, before - here
        else:
            out = 4 * middles[:, k] - 3 * here - after
            back = 4 * middles[:, k - 1] - 3 * here - before
        least = np.minimum(least, np.einsum("ei,ei->e", np.cross(out, back), normals))
    return np.asarray(least / np.maximum(np.einsum("ei,ei->e", normals, normals), 1e-300))


NAMED = 5
"""At most so many elements, nodes or parts are named in a message."""
LEAST = 1e-9
"""Size of an element by its extent, and Jacobian of a corner by their mean, below which there is
none.
"""


def check(model: FiniteElementModel) -> None:
    """Look for faults that no single line shows.

    Raises:
        FormatError: there is no element; elements have no size or fold over; a section weighs less
            than nothing; a node is led twice, or by itself in a circle, or held where it is led.
        IncompleteError: masses or springs hang on nothing; the model falls into parts, of which one
            is free. What was not read comes first.
    """
    if not model.elements:
        raise FormatError("", "the model has no shell or beam element; nothing would vibrate")
    faults = [fault for block in model.elements for fault in _shapes(model, block)]
    if faults:
        raise FormatError(faults[:NAMED])
    _weigh(model)
    _constrained_once(model)
    try:
        _hangs_together(model)
    except IncompleteError as error:
        raise error.after(model.ignored) from None
    _held_or_dependent(model)


def _weigh(model: FiniteElementModel) -> None:
    """Non-structural mass may be negative, to correct a density, but no more than that."""
    for name, section in model.sections.items():
        density = {
            each: model.materials[each].constants.get("density", 0.0) for each in section.materials
        }
        if isinstance(section, ShellSection):
            mass = section.extra_mass + sum(
                ply.thickness * density[ply.material] for ply in section.plies
            )
        else:
            mass = section.extra_mass + section.area * density[section.material]
        if mass < 0:
            raise FormatError(
                str(section.where),
                f"the set {name} weighs {mass:.4g} with its non-structural mass, expected not"
                " below 0",
            )


def _constrained_once(model: FiniteElementModel) -> None:
    links: dict[int, Link] = {}
    for link in model.links:
        first = links.setdefault(link.node, link)
        if first is not link:
            raise FormatError(
                str(link.where),
                f"leads node {model.numbers[link.node]}, which {first.where} leads already; "
                "have one constraint lead all its dofs",
            )
    try:
        TopologicalSorter({node: link.leaders for node, link in links.items()}).prepare()
    except CycleError as error:
        circle = error.args[1]
        named = " → ".join(str(model.numbers[node]) for node in circle)
        first = links[circle[0]]
        raise FormatError(
            str(first.where), f"nodes lead one another in a circle: {named}"
        ) from error


def gathered(links: Iterable[Link]) -> tuple[Link, ...]:
    """Links of one node to the same independent ones along the same axes as one, which leads the
    dofs of all.
    """
    merged: dict[object, Link] = {}
    for link in links:
        key = (
            link.node,
            link.leaders,
            link.weights,
            None if link.axes is None else link.axes.tobytes(),
            id(link) if link.equations is not None else None,
        )
        before = merged.get(key, link)
        merged[key] = replace(before, dofs=tuple(sorted({*before.dofs, *link.dofs})))
    return tuple(merged.values())


def nearness(places: Floats) -> float:
    """The distance up to which nodes are at one place."""
    return 1e-6 * float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 0.0


def on_independent_nodes(
    supports: Iterable[Support], links: Iterable[Link], places: Floats
) -> Iterator[Support]:
    """Supports, of which what holds a dependent node holds the independent one, where both lie at
    one place.
    """
    near = nearness(places)
    ties = {
        link.node: link
        for link in links
        if len(link.leaders) == 1
        and link.equations is None
        and np.linalg.norm(places[link.node] - places[link.leaders[0]]) <= near
    }
    for support in supports:
        held: dict[tuple[int, ...], list[int]] = defaultdict(list)
        for node in support.nodes.tolist():
            tie = ties.get(node)
            dependent = (
                set(tie.dofs)
                if tie and (len(tie.dofs) == 6 or tie.axes is support.axes is None)
                else set()
            )
            for at, some in (
                (node, set(support.dofs) - dependent),
                (tie.leaders[0] if tie else node, dependent & set(support.dofs)),
            ):
                if some:
                    held[tuple(sorted(some))].append(at)
        for dofs, nodes in held.items():
            yield replace(support, nodes=np.array(nodes), dofs=dofs)


def directions(of: Link | Support) -> Floats:
    """(d, 6) along or about which dofs are, as rows over displacements and turns in the model's
    frame.
    """
    return np.asarray(np.kron(np.eye(2), np.eye(3) if of.axes is None else of.axes)[list(of.dofs)])


def free_motions(supports: Iterable[Support], nodes: Iterable[int]) -> dict[int, Floats]:
    """(6, f) motions, as orthonormal columns, that supports leave to each of these nodes."""
    held: dict[int, list[Floats]] = {node: [np.zeros((1, 6))] for node in nodes}
    for support in supports:
        for node in held.keys() & set(support.nodes.tolist()):
            held[node].append(directions(support))
    return {node: scipy.linalg.null_space(np.concatenate(rows)) for node, rows in held.items()}


def _held_or_dependent(model: FiniteElementModel) -> None:
    """A dependent node moves as the independent ones do: to hold it there holds nothing, unless these
    are held in that motion too.
    """
    links = {link.node: link for link in model.links}
    free = free_motions(model.supports, {other for link in model.links for other in link.leaders})
    for support in model.supports:
        for node in links.keys() & set(support.nodes.tolist()):
            link, dependent = links[node], directions(links[node])
            rows = directions(support) @ dependent.T @ dependent
            if link.equations is not None and np.abs(rows).max(initial=0.0) > LEAST:
                raise FormatError(
                    str(support.where),
                    f"holds node {model.numbers[node]} in what the equation of {link.where} has others"
                    " lead; hold another node of it, or let it begin with another",
                )
            for other in link.leaders:
                if len(link.leaders) == 1:  # d · (u + θ × r) = d · u + θ · (r × d)
                    arm = np.cross(model.nodes[node] - model.nodes[other], rows[:, :3])
                    moved = np.hstack([rows[:, :3], rows[:, 3:] + arm])
                else:
                    moved = np.eye(6)[:3] * np.abs(rows).max(initial=0.0)
                if np.abs(moved @ free[other]).max(initial=0.0) > LEAST:
                    raise FormatError(
                        str(support.where),
                        f"holds node {model.numbers[node]} in what {link.where} has node"
                        f" {model.numbers[other]} lead; hold the one that leads",
                    )


def _shapes(model: FiniteElementModel, block: Elements) -> Iterable[tuple[str, str]]:
    corners = model.nodes[block.nodes[:, : CELL_TYPES[block.kind].corners]]
    extent = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    is_beam = block.kind.startswith("beam")
    has_size = sizes(block, model.nodes) > LEAST * extent ** (1 if is_beam else 2)
    worst = worst_corner(block, model.nodes)
    for k in np.flatnonzero(~has_size | ~(worst > LEAST))[:NAMED].tolist():
        if not has_size[k]:
            what = "has no size: its nodes lie at one place or on one line, or its sides cross"
        elif is_beam:
            what = "has its middle node outside the middle half between its ends"
        else:
            what = (
                f"folds over (Jacobian {worst[k]:.2g} of the mean): nodes in wrong order or place,"
                " or two at one"
            )
        yield block.where(k), f"element {block.numbers[k]} of the set {block.set} {what}"


def _parts(model: FiniteElementModel) -> Integers:
    """(n,) the first node of the part that each belongs to; nodes hang together by elements, links
    and springs.
    """
    pairs = [
        np.stack([np.repeat(b.nodes[:, 0], b.nodes.shape[1]), b.nodes.ravel()])
        for b in model.elements
    ]
    joined = [(link.node, independent) for link in model.links for independent in link.leaders]
    joined += [
        (spring.node, spring.second) for spring in model.springs if spring.second is not None
    ]
    rows, columns = np.concatenate(
        [*pairs, np.array(joined, dtype=np.int64).reshape(-1, 2).T], axis=1
    )
    graph = scipy.sparse.coo_array(
        (np.ones(len(rows)), (rows, columns)), shape=(len(model.nodes),) * 2
    )
    _, part = scipy.sparse.csgraph.connected_components(graph, directed=False)
    _, first = np.unique(part, return_index=True)
    return np.asarray(first[part])


def _hangs_together(model: FiniteElementModel) -> None:
    part = _parts(model)
    has_element = np.zeros(len(model.nodes), dtype=bool)
    for block in model.elements:
        has_element[part[block.nodes].ravel()] = True
    for where, node, what in [
        *((mass.where, mass.node, "a mass") for mass in model.masses),
        *((spring.where, spring.node, "a spring") for spring in model.springs),
    ]:
        if not has_element[part[node]]:
            raise IncompleteError(
                str(where),
                f"{what} is on node {model.numbers[node]}, which no element, link or spring joins"
                " to the model",
            )
    roots = np.flatnonzero(has_element & (part == np.arange(len(part))))
    if len(roots) == 1:
        return
    held = {int(part[node]) for support in model.supports for node in support.nodes.tolist()}
    held |= {int(part[spring.node]) for spring in model.springs if spring.second is None}
    free = [root for root in roots.tolist() if root not in held]
    if free:
        named = "; ".join(_described(model, part, root) for root in roots.tolist()[:NAMED])
        raise IncompleteError(
            "",
            f"the model falls into {len(roots)} parts that nothing joins, and nothing holds"
            f" {len(free)} of them: {named}. Give them common nodes, or join them by a constraint",
        )


def _described(model: FiniteElementModel, part: Integers, root: int) -> str:
    """A part by one of its elements."""
    for block in model.elements:
        chosen = np.flatnonzero(part[block.nodes[:, 0]] == root)
        if chosen.size:
            where = block.where(int(chosen[0]))
            return f"element {block.numbers[chosen[0]]} of the set {block.set}" + (
                f" ({where})" if where else ""
            )
    raise AssertionError(root)
