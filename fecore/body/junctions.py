"""Where walls meet: edges of a mesh at which its surface turns, found from the elements alone.

At an edge every element has a direction s, in its surface and away from the edge; elements on the
same nodes are one stack. An edge is a junction where more than two stacks meet, or two of which one
is not the other going on, by however little. Edges with the same walls that touch make a line.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.body.corners import Corner
from fecore.body.mesh import SHELLS, Mesh

_SAME = 0.02  # of directions of one line, and of its walls' factors
# of an element, by which it would begin beside the line: less than the accuracy of a frequency
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Wall:
    """One element at an edge."""

    # block, element, side: its numbers in the mesh
    block: int
    element: int
    side: int
    # set, rank: its set, and the place of that among the mesh's sets
    set: str
    rank: int
    thickness: float  # nominal, m
    direction: FloatArray  # (3,) unit direction s
    passes: bool  # whether the wall goes on beyond the edge, where more than two meet
    depth: float  # how far the element reaches from the edge, m
    stack: int  # number of its stack around the edge
    axis: FloatArray | None = None  # (3,) axis 1 of the element where it is not its set's


@dataclass(frozen=True)
class Edge:
    """An edge at which walls meet: its nodes (ends first, then the middle where it has one), and
    the walls around it.
    """

    nodes: tuple[int, ...]
    tangent: FloatArray
    walls: tuple[Wall, ...]
    corner: Corner  # of its stacks


@dataclass(frozen=True)
class Junction:
    """A line along which walls meet, as an engineer checks it."""

    nodes: IntArray  # numbers of its nodes
    # (set, thickness in m, whether it passes) of each wall
    walls: tuple[tuple[str, float, bool], ...]
    # degrees between each wall, or stack of walls, and the next around the line
    angles: tuple[float, ...]
    length: float  # m
    edges: tuple[Edge, ...]  # what it is made of


def find_junctions(mesh: Mesh, thickness: Mapping[str, float]) -> tuple[Junction, ...]:
    """The junctions of a mesh of shells, given each set's thickness in m; of two walls that only go
    on there is none.
    """
    sides = sides_of(mesh)
    own = np.array([thickness.get(block.set, 0.0) for block in mesh.blocks])[sides.places[:, 0]]
    order = np.lexsort((sides.same, *sides.ends.T))
    ends, same = sides.ends[order], sides.same[order]
    is_first = np.any(np.diff(ends, axis=0, prepend=-1) != 0, axis=1)
    first = np.flatnonzero(is_first)
    count = np.diff(first, append=len(ends))
    edge = np.cumsum(is_first) - 1
    stacks = np.bincount(edge[is_first | (np.diff(same, prepend=-1) != 0)], minlength=len(first))
    # Most edges are of two elements, of which one goes on as the other; tan(α/2) = |s₁ + s₂|/|s₁ −
    # s₂|.
    one, other = (sides.direction[order[at]] for at in (first, first + count - 1))
    turned, depth = np.linalg.norm(one + other, axis=1), sides.depth[order[first]]
    over = np.bincount(edge, own[order], minlength=len(first)) * turned
    small = over < _ROUNDING * _PART * depth * np.linalg.norm(one - other, axis=1)
    chosen = (stacks > 2) | ((stacks == 2) & ~small)
    edges = [
        _edge(mesh, sides, order[a : a + n], thickness)
        for a, n in zip(first[chosen], count[chosen], strict=True)
    ]
    return tuple(
        _junction(mesh, group) for group in _lines([edge for edge in edges if _turns(edge)])
    )


_PART = 8  # of T tan(α/2) is d, at about equal thicknesses


def _turns(edge: Edge) -> bool:
    """Whether anything is to be done at an edge."""
    corner, depth = edge.corner, min(wall.depth for wall in edge.walls)
    if len(corner.thickness) > 2:
        return True
    return (
        len(corner.thickness) == 2
        and corner.scale * corner.thickness.max() > _ROUNDING * _PART * depth
    )


def encloses(mesh: Mesh, junctions: Sequence[Junction]) -> bool:
    """Whether walls enclose a cell: going from wall to wall over junctions one comes back another
    way.

    Walls and junctions are the nodes of a graph, and its links their meetings; it has a ring where
    there are more links than a tree has.
    """
    sides = sides_of(mesh)
    lines = {
        tuple(sorted(edge.nodes[:2])): k
        for k, junction in enumerate(junctions)
        for edge in junction.edges
    }
    at = np.array([lines.get(tuple(ends), -1) for ends in sides.ends.tolist()], dtype=np.int64)
    _, edge = np.unique(sides.ends[at < 0], axis=0, return_inverse=True)
    element, count = sides.same, int(sides.same.max()) + 1
    pairs = scipy.sparse.coo_array(
        (np.ones(edge.size), (element[at < 0], edge)), shape=(count, int(edge.max(initial=0)) + 1)
    )
    _, wall = scipy.sparse.csgraph.connected_components(pairs @ pairs.T, directed=False)
    meetings = np.unique(np.column_stack([wall[element[at >= 0]], at[at >= 0]]), axis=0)
    walls = np.unique(meetings[:, 0], return_inverse=True)[1]
    size = int(walls.max()) + 1
    graph = scipy.sparse.coo_array(
        (np.ones(len(walls)), (walls, size + meetings[:, 1])), shape=(size + len(junctions),) * 2
    )
    parts, _ = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return bool(len(meetings) > size + len(junctions) - parts)


@dataclass(frozen=True)
class Sides:
    """All sides of all shells."""

    places: IntArray  # (s, 3) block, element and side
    ends: IntArray  # (s, 2) nodes, rising
    direction: FloatArray  # (s, 3) unit directions in the surface
    depth: FloatArray  # (s,) how far the elements reach, m
    element: IntArray  # (s,) number of the element among all blocks'
    same: IntArray  # (s,) number of the first element that lies on the same nodes


def sides_of(mesh: Mesh) -> Sides:
    """The sides of a mesh's shells; a curved element's direction at a side is that of its surface
    there.
    """
    blocks, first = [], 0
    for number, block in enumerate(mesh.blocks):
        if not block.is_shell:
            first += len(block.nodes)
            continue
        shell = SHELLS[block.kind]
        corners = len(shell.sides)
        x = mesh.nodes[block.nodes[:, :corners]]
        nodes = np.full((len(x), 4), -1)
        nodes[:, 4 - corners :] = np.sort(block.nodes[:, :corners], axis=1)
        natural = shell.corners[:corners]
        for side in range(corners):
            beyond = (side + 1) % corners
            a, b = x[:, side], x[:, beyond]
            tangent = _unit(b - a)
            others = np.delete(x, [side, beyond], axis=1) - a[:, None]
            reach = others - np.einsum("enk,ek->en", others, tangent)[..., None] * tangent[:, None]
            middle = (natural[side] + natural[beyond]) / 2
            by = shell.derivatives(middle[None])[0]
            inwards, along = (
                np.einsum("n,enk->ek", way @ by, mesh.nodes[block.nodes])
                for way in (natural.mean(axis=0) - middle, natural[beyond] - natural[side])
            )
            along = _unit(along)
            direction = _unit(inwards - np.sum(inwards * along, axis=1, keepdims=True) * along)
            places = np.column_stack(
                [np.full(len(x), number), np.arange(len(x)), np.full(len(x), side)]
            )
            ends = np.sort(block.nodes[:, [side, beyond]], axis=1)
            depth = np.linalg.norm(reach, axis=2).min(axis=1)
            blocks.append((places, ends, direction, depth, first + np.arange(len(x)), nodes))
        first += len(x)
    if not blocks:
        nothing = np.zeros(0, dtype=np.int64)
        return Sides(
            np.zeros((0, 3), int),
            np.zeros((0, 2), int),
            np.zeros((0, 3)),
            np.zeros(0),
            nothing,
            nothing,
        )
    places, ends, direction, depth, element, nodes = (
        np.concatenate(parts) for parts in zip(*blocks, strict=True)
    )
    _, at, which = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
    real = ends[:, 0] != ends[:, 1]
    return Sides(
        places[real],
        ends[real],
        direction[real],
        depth[real],
        element[real],
        element[at][which.ravel()][real],
    )


def _edge(mesh: Mesh, sides: Sides, around: IntArray, thickness: Mapping[str, float]) -> Edge:
    """The walls around an edge, stack by stack in the order of their angles about it."""
    ends = tuple(sides.ends[around[0]].tolist())
    tangent = _unit(mesh.nodes[ends[1]] - mesh.nodes[ends[0]])
    stacks = _stacks(mesh, sides.places[around])
    s = _unit(np.array([sides.direction[around[stack]].mean(axis=0) for stack in stacks]))
    angle = np.arctan2(s @ np.cross(tangent, s[0]), s @ s[0])
    turns = np.argsort(angle % (2 * np.pi), kind="stable").tolist()
    own = [thickness[mesh.blocks[number].set] for number in sides.places[around, 0].tolist()]
    corner = Corner.of(tangent, s[turns], [sum(own[i] for i in stacks[k]) for k in turns])
    middle: tuple[int, ...] = ()
    walls = []
    for stack, i in ((stack, i) for stack, k in enumerate(turns) for i in stacks[k]):
        number, element, side = sides.places[around[i]].tolist()
        block = mesh.blocks[number]
        middle = (
            tuple(block.nodes[element, list(SHELLS[block.kind].sides[side][2:])].tolist()) or middle
        )
        wall = Wall(
            number,
            element,
            side,
            set=block.set,
            rank=mesh.sets.index(block.set),
            thickness=own[i],
            direction=corner.directions[stack],
            passes=bool(corner.straight[stack].max() > 0.5),
            depth=float(sides.depth[around[i]]),
            stack=stack,
            axis=None if block.axes is None else block.axes[element],
        )
        walls.append(wall)
    return Edge((*ends, *middle), tangent, tuple(walls), corner)


def _stacks(mesh: Mesh, places: IntArray) -> list[list[int]]:
    """Which of (n, 3) places lie on one another: all of an element's corners are another's too."""
    corners = [
        frozenset(
            mesh.blocks[number]
            .nodes[element, : len(SHELLS[mesh.blocks[number].kind].sides)]
            .tolist()
        )
        for number, element, _ in places.tolist()
    ]
    stacks: list[list[int]] = []
    for i, own in enumerate(corners):
        stack = next(
            (s for s in stacks if any(own <= corners[k] or own >= corners[k] for k in s)), None
        )
        if stack is None:
            stacks.append([i])
        else:
            stack.append(i)
    return stacks


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))


def _lines(edges: Sequence[Edge]) -> list[list[Edge]]:
    """Edges with the same walls and directions that touch, together."""
    by_node: dict[int, list[int]] = defaultdict(list)
    for number, edge in enumerate(edges):
        for node in edge.nodes[:2]:
            by_node[node].append(number)
    left, lines = set(range(len(edges))), []
    while left:
        first = min(left)
        left.discard(first)
        group, stack = [first], [first]
        while stack:
            here = stack.pop()
            for node in edges[here].nodes[:2]:
                for other in by_node[node]:
                    if other in left and are_alike(edges[here], edges[other]):
                        left.discard(other)
                        group.append(other)
                        stack.append(other)
        lines.append([edges[number] for number in sorted(group)])
    return lines


def are_alike(one: Edge, other: Edge) -> bool:
    """Whether two edges have the same direction, and the same walls in the same directions."""
    if len(one.walls) != len(other.walls) or abs(one.tangent @ other.tangent) < 1 - _SAME:
        return False
    if abs(one.corner.scale - other.corner.scale) > _SAME * one.corner.scale:
        return False
    return all(
        any(
            w.set == v.set and w.passes == v.passes and w.direction @ v.direction > 1 - _SAME
            for v in other.walls
        )
        for w in one.walls
    )


def _junction(mesh: Mesh, edges: Sequence[Edge]) -> Junction:
    walls, directions = edges[0].walls, edges[0].corner.directions
    around = np.degrees(
        np.arccos(np.clip(np.sum(directions * np.roll(directions, -1, axis=0), axis=1), -1, 1))
    )
    ends = np.array([edge.nodes[:2] for edge in edges])
    return Junction(
        nodes=np.unique([node for edge in edges for node in edge.nodes]),
        walls=tuple((wall.set, wall.thickness, wall.passes) for wall in walls),
        angles=tuple(around.tolist()),
        length=float(np.linalg.norm(mesh.nodes[ends[:, 1]] - mesh.nodes[ends[:, 0]], axis=1).sum()),
        edges=tuple(edges),
    )
