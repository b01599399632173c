"""The same body on a finer mesh: elements of one order higher where they are linear, elements
halved where they are not.

New nodes lie amid the sides; facets that turn little are a curved surface (`fecore.body.facets`).

Nodes of the body keep their numbers, so all that names nodes stays; new ones come after them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.beams import BeamSection
from fecore.body.facets import bows, find, is_straight, sides_of
from fecore.body.mesh import BEAMS, SHELLS, CellBlock, Mesh
from fecore.body.structure import Structure
from fecore.body.supports import DISPLACEMENTS, Link, Support

_ALIKE = 0.5  # least cosine between two nodes' axes of which a node between has the mean


@dataclass(frozen=True)
class Refined:
    """A body on a finer mesh."""

    body: Structure  # the body
    # (fine nodes, nodes) where the new nodes lie by the old ones, and how a motion of these goes on
    interpolation: scipy.sparse.csr_array


def refined(body: Structure, *, curved: bool = True) -> Refined:
    """The body with its linear elements raised by an order or, where shells are quadratic, all
    halved. Rods stay whole.

    Args:
        body: of shells and beams.
        curved: whether facets that turn little are a curved surface; else they stay flat.
    """
    mesh = body.mesh
    halve = is_quadratic(mesh) or not any(
        block.element and block.element.raised for block in mesh.blocks
    )
    work = _Work(
        mesh,
        bows(mesh) if curved else np.zeros((0, 3)),
        sides_of(mesh) if curved else np.zeros((0, 2), int),
    )
    rods = [
        isinstance(section := body.sections[block.set], BeamSection) and section.is_rod
        for block in mesh.blocks
    ]
    blocks = [
        block if rod else work.raised(block) for block, rod in zip(mesh.blocks, rods, strict=True)
    ]
    if halve:
        was = [block.kind for block in mesh.blocks]
        blocks = [
            new if old == "beam2" else work.halved(new)
            for old, new in zip(was, blocks, strict=True)
        ]
    return Refined(work.carried(body, tuple(blocks)), work.interpolation())


def is_quadratic(mesh: Mesh) -> bool:
    """Whether a mesh has shells with middles of sides."""
    return any(block.is_shell and not SHELLS[block.kind].raised for block in mesh.blocks)


def element_size(mesh: Mesh) -> float:
    """Median length of the sides of elements, m."""
    lengths = []
    for block in mesh.blocks:
        if block.element is None:
            continue
        ends = np.array([side[:2] for side in block.element.sides])
        x = mesh.nodes[block.nodes]
        lengths.append(np.linalg.norm(x[:, ends[:, 1]] - x[:, ends[:, 0]], axis=2).ravel())
    return float(np.median(np.concatenate(lengths)))


class _Work:
    """Nodes as they come, each with its weights by the old ones and the two nodes that it lies
    amid.
    """

    def __init__(self, mesh: Mesh, bows: FloatArray, sides: IntArray) -> None:
        self._mesh, self._old = mesh, len(mesh.nodes)
        self._places = [mesh.nodes]
        self._weights: list[scipy.sparse.csr_array] = [
            scipy.sparse.eye_array(self._old, format="csr")
        ]
        self._amid: list[IntArray] = [np.zeros((0, 2), dtype=np.int64)]  # of the new nodes
        # Linear elements and beams beside quadratic ones have the middles of these.
        self._known = {
            (min(a, b), max(a, b)): m
            for block in mesh.blocks
            for ends in _ends_and_middles(block)
            for a, b, m in block.nodes[:, ends].tolist()
        }
        self._count = self._old
        self._bows, self._sides = bows, sides

    def raised(self, block: CellBlock) -> CellBlock:
        """A block of linear elements with nodes amid their sides; a quadratic one with its middles
        on the curved surface.
        """
        element = block.element
        if element is None or not element.raised:
            if block.is_shell and len(self._bows):
                self._bend(block, SHELLS[block.kind].sides)
            return block
        sides = element.sides
        ends = block.nodes[:, np.array([side[:2] for side in sides])]
        middles = self._between(ends.reshape(-1, 2)).reshape(ends.shape[:2])
        local = np.vstack(
            [
                np.eye(block.nodes.shape[1]),
                *(_half(side[:2], block.nodes.shape[1]) for side in sides),
            ]
        )
        return _of_parts(
            block,
            element.raised,
            np.hstack([block.nodes, middles]),
            local,
            [list(range(len(local)))],
        )

    def halved(self, block: CellBlock) -> CellBlock:
        """A block of quadratic elements, each in parts half as large."""
        element = block.element
        if element is None or (halving := element.halving) is None:
            return block
        count, amid = block.nodes.shape[1], halving.amid
        natural = list(element.corners)
        for a, b in amid:
            natural.append((natural[a] + natural[b]) / 2)
        at = np.array(natural)
        local = (
            SHELLS[block.kind].functions(at)
            if block.is_shell
            else BEAMS[block.kind].functions(at[:, 0])
        )
        nodes = np.hstack([block.nodes, np.zeros((len(block.nodes), len(amid)), dtype=np.int64)])
        for place, (a, b) in enumerate(amid, start=count):
            nodes[:, place] = self._between(nodes[:, [a, b]], block.nodes, local[place])
        return _of_parts(block, block.kind, nodes, local, halving.parts)

    def _between(
        self, pairs: IntArray, nodes: IntArray | None = None, weights: FloatArray | None = None
    ) -> IntArray:
        """(p,) numbers of the nodes amid (p, 2) others, new where there was none: at (n,) weights
        of (p, n) nodes, or half-way between old nodes, with the bow of that side.
        """
        pairs = np.sort(pairs, axis=1)
        first: dict[tuple[int, int], int] = {}
        between = np.zeros(len(pairs), dtype=np.int64)
        fresh: list[int] = []
        for row, (a, b) in enumerate(pairs.tolist()):
            if a == b:  # a side of no length, of a quadrilateral that is a triangle
                between[row] = a
                continue
            number = self._known.get((a, b), first.get((a, b), -1))
            if number < 0:
                number = first[a, b] = self._count + len(fresh)
                fresh.append(row)
            between[row] = number
        if fresh:
            whole, places = (
                scipy.sparse.vstack(self._weights, format="csr"),
                np.vstack(self._places),
            )
            if nodes is None or weights is None:
                nodes, weights = pairs, np.array([0.5, 0.5])
            chosen = nodes[fresh]
            x = np.einsum("n,pnk->pk", weights, places[chosen])
            if len(self._bows) and chosen.shape[1] == 2:
                x += self._bow_of(chosen)
            rows = np.repeat(np.arange(len(fresh)), chosen.shape[1])
            values = np.tile(weights, len(fresh))
            by = (
                scipy.sparse.csr_array(
                    (values, (rows, chosen.ravel())), shape=(len(fresh), whole.shape[0])
                )
                @ whole
            )
            self._places, self._weights = [places, x], [whole, by]
            self._amid.append(pairs[fresh])
            self._count += len(fresh)
        self._known |= first
        return between

    def _bow_of(self, pairs: IntArray) -> FloatArray:
        """(p, 3) bows of pairs of nodes; 0 of those that are no sides of shells."""
        ends = np.sort(pairs, axis=1)
        place = np.minimum(find(self._sides, ends), len(self._sides) - 1)
        there = np.all(self._sides[place] == ends, axis=1)
        return np.where(there[:, None], self._bows[place], 0.0)

    def _bend(self, block: CellBlock, sides: tuple[tuple[int, ...], ...]) -> None:
        """Move the middles of straight sides onto the curved surface."""
        places = self._places[0] = np.array(self._places[0])
        for i, j, m in sides:
            a, b, middle = (block.nodes[:, k] for k in (i, j, m))
            bow = self._bow_of(np.column_stack([a, b]))
            straight = is_straight(self._mesh.nodes, a, b, middle) & bow.any(axis=1)
            moved = (places[a] + places[b]) / 2 + bow
            places[middle[straight]] = moved[straight]

    def interpolation(self) -> scipy.sparse.csr_array:
        """(fine nodes, nodes) weights."""
        return scipy.sparse.vstack(self._weights, format="csr")

    def carried(self, body: Structure, blocks: tuple[CellBlock, ...]) -> Structure:
        """The body with its supports and links on the new nodes too, where both nodes that they lie
        amid have them.
        """
        amid, mesh = np.vstack(self._amid), self._mesh
        edge = self._free_edges(blocks)
        sets = {name: self._joined(nodes, amid, edge) for name, nodes in mesh.node_sets.items()}
        links = (*body.links, *self._links(body.links, amid), *self._held(body, amid, edge))
        fine = Mesh(np.vstack(self._places), blocks, sets)
        between = tuple(self._between_supports(body.supports, fine, amid, edge))
        own = tuple(Support(name, dofs) for name, dofs, _ in between)
        return replace(
            body,
            mesh=replace(fine, node_sets={**sets, **{name: nodes for name, _, nodes in between}}),
            supports=(*body.supports, *own),
            links=links,
        )

    def _between_supports(
        self, supports: tuple[Support, ...], fine: Mesh, amid: IntArray, edge: BoolArray
    ) -> Iterator[tuple[str, tuple[str, ...], IntArray]]:
        """Name, dofs and nodes of supports amid two nodes that different supports hold, in what
        both hold.
        """
        held = np.zeros((self._count, len(DISPLACEMENTS)), dtype=bool)
        for support in supports:
            held[fine.select(support.where)[:, None], list(support.dofs)] = True
        both = held.copy()
        for number, (a, b) in enumerate(amid.tolist(), start=self._old):
            if not (edge[a] and edge[b] and not edge[number]):
                both[number] |= both[a] & both[b]
        missing = both & ~held
        for dofs in np.unique(missing[missing.any(axis=1)], axis=0):
            names = tuple(np.array(DISPLACEMENTS)[dofs].tolist())
            nodes = np.flatnonzero((missing == dofs).all(axis=1))
            yield f"amid supports: {' '.join(names)}, {self._count} nodes", names, nodes

    def _free_edges(self, blocks: tuple[CellBlock, ...]) -> BoolArray:
        """(fine nodes,) whether a node lies on a side of one shell alone."""
        free = np.zeros(self._count, dtype=bool)
        shells = [b for b in blocks if b.is_shell]
        if not shells:
            return free
        rows = np.concatenate(
            [
                np.sort(b.nodes[:, list(side)], axis=1)[:, :3]
                for b in shells
                for side in SHELLS[b.kind].sides
            ]
        )
        sides, count = np.unique(rows, axis=0, return_counts=True)
        free[sides[count == 1].ravel()] = True
        return free

    def _joined(self, nodes: IntArray, amid: IntArray, edge: BoolArray) -> IntArray:
        """A set of nodes with the new ones amid two of it, but not those across a strip of which
        both edges are in it.
        """
        inside = np.zeros(self._count, dtype=bool)
        inside[nodes] = True
        for number, (a, b) in enumerate(amid.tolist(), start=self._old):
            across = edge[a] and edge[b] and not edge[number]
            inside[number] = inside[a] and inside[b] and not across
        return np.concatenate([nodes, self._old + np.flatnonzero(inside[self._old :])])

    def _held(self, body: Structure, amid: IntArray, edge: BoolArray) -> Iterator[Link]:
        """What holds new nodes along axes of their own: amid two that are held, in what both hold,
        along the mean of their axes.
        """
        held: dict[int, tuple[FloatArray, frozenset[int]]] = {}
        for support in body.supports:
            for node in self._mesh.select(support.where).tolist():
                _, others = held.get(node, (None, frozenset()))
                held[node] = np.eye(3), others.union(support.dofs)
        held |= {
            link.node: (link.turn[:3, :3], frozenset(link.dofs))
            for link in body.links
            if not link.independent and link.equations is None
        }
        for number, (a, b) in enumerate(amid.tolist(), start=self._old):
            across = edge[a] and edge[b] and not edge[number]
            if a not in held or b not in held or across:
                continue
            axes, dofs = _mean_axes(held[a], held[b]), held[a][1] & held[b][1]
            if axes is None or not dofs:
                continue
            held[number] = axes, dofs
            if not np.array_equal(axes, np.eye(3)):  # else a support holds it
                yield Link(number, (), tuple(sorted(dofs)), axes=axes)

    def _links(self, links: tuple[Link, ...], amid: IntArray) -> Iterator[Link]:
        """Links of new nodes amid two that depend alike: on one node, or on nodes with a node amid
        them.
        """
        known = {
            link.node: link
            for link in links
            if len(link.independent) == 1 and link.equations is None
        }
        number_of = {(a, b): self._old + row for row, (a, b) in enumerate(amid.tolist())}
        for number, (a, b) in enumerate(amid.tolist(), start=self._old):
            if a not in known or b not in known:
                continue
            one, two = known[a], known[b]
            same = one.dofs == two.dofs and len(one.independent) == len(two.independent)
            dofs = frozenset(one.dofs)
            axes = _mean_axes((one.turn[:3, :3], dofs), (two.turn[:3, :3], dofs))
            if not same or axes is None:
                continue
            if one.independent == two.independent:
                known[number] = replace(one, node=number, axes=axes)
            elif (
                leader := number_of.get(
                    (min(one.independent + two.independent), max(one.independent + two.independent))
                )
            ) is not None:
                known[number] = replace(one, node=number, independent=(leader,), axes=axes)
            else:
                continue
            yield known[number]


def _mean_axes(
    one: tuple[FloatArray, frozenset[int]], two: tuple[FloatArray, frozenset[int]]
) -> FloatArray | None:
    """(3, 3) axes between those of two nodes, of which each has its held dofs too; None where they
    are not alike.

    All displacements, or all rotations, are held along whichever axes.
    """
    (own, _), (other, _) = one, two
    for (_, dofs), axes in ((one, other), (two, own)):
        if all(dofs.isdisjoint(each) or dofs.issuperset(each) for each in ((0, 1, 2), (3, 4, 5))):
            return axes
    if np.array_equal(own, other):
        return own
    if np.einsum("ik,ik->i", own, other).min() < _ALIKE:
        return None
    u, _, v = np.linalg.svd(own + other)
    return np.asarray(u @ v)


def _ends_and_middles(block: CellBlock) -> list[list[int]]:
    """Places of the ends and the middle of each side of a quadratic element."""
    if block.kind == "beam3":
        return [[0, 1, 2]]
    return (
        [list(side) for side in SHELLS[block.kind].sides if len(side) == 3]
        if block.is_shell
        else []
    )


def _half(side: tuple[int, ...], count: int) -> FloatArray:
    """(n,) half of each end."""
    return np.isin(np.arange(count), side) / 2


def _of_parts(
    block: CellBlock, kind: str, nodes: IntArray, local: FloatArray, parts: list[list[int]]
) -> CellBlock:
    """The block's elements in parts, from (e, p) nodes of points with (p, n) weights by the
    element's own nodes.
    """
    chosen = np.array(parts)

    def of_nodes(values: FloatArray | None) -> FloatArray | None:
        if values is None:
            return None
        each = np.einsum("cpn,en...->ecp...", local[chosen], values)
        return np.asarray(each.reshape(-1, chosen.shape[1], *values.shape[2:]))

    return replace(
        block,
        kind=kind,
        nodes=nodes[:, chosen].reshape(-1, chosen.shape[1]),
        thickness=of_nodes(block.thickness),
        offsets=of_nodes(block.offsets),
        axes=None if block.axes is None else np.repeat(block.axes, len(parts), axis=0),
    )
