"""Where walls meet: edges of a mesh at which its surface turns, found from the elements alone.

At an edge every element has a direction s, in its surface and away from the edge. Two elements whose directions are
opposite within `TURN` are one wall that passes; any other element is a wall that ends there. An edge is a junction where a
wall ends at another, or more than two elements meet. Edges with the same walls that touch make a line.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.body.mesh import SHELLS, Mesh

TURN = 20.0
"""Degrees by which the surface turns at a junction, at least."""

_SAME = 0.02  # of directions of one line


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
    away: FloatArray  # (3,) unit direction s
    passes: bool  # whether the wall goes on beyond the edge
    depth: float  # how far the element reaches from the edge, m
    axis: FloatArray | None = None  # (3,) axis 1 of the element where it is not its set's


@dataclass(frozen=True)
class Edge:
    """An edge at which walls meet: its nodes (ends first, then the middle where it has one), and the walls around it."""

    nodes: tuple[int, ...]
    tangent: FloatArray
    walls: tuple[Wall, ...]


@dataclass(frozen=True)
class Junction:
    """A line along which walls meet, as an engineer checks it."""

    nodes: IntArray  # numbers of its nodes
    walls: tuple[tuple[str, float, bool], ...]  # (set, thickness in m, whether it passes) of each wall
    angles: tuple[float, ...]  # degrees between each wall and the next around the line
    length: float  # m
    edges: tuple[Edge, ...]  # what it is made of


def find_junctions(mesh: Mesh, thickness: Mapping[str, float]) -> tuple[Junction, ...]:
    """The junctions of a mesh of shells, given each set's thickness in m."""
    sides = _sides(mesh)
    order = np.lexsort(sides.ends.T)
    ends = sides.ends[order]
    first = np.flatnonzero(np.any(np.diff(ends, axis=0, prepend=-1) != 0, axis=1))
    count = np.diff(first, append=len(ends))
    # Most edges are of two elements of one wall.
    other = order[np.minimum(first + 1, len(order) - 1)]
    opposite = np.einsum("ij,ij->i", sides.away[order[first]], sides.away[other]) < -np.cos(np.radians(TURN))
    chosen = (count > 2) | ((count == 2) & ~opposite)
    edges = [_edge(mesh, sides, order[a : a + n], thickness) for a, n in zip(first[chosen], count[chosen], strict=True)]
    return tuple(_junction(mesh, group) for group in _lines(edges))


def encloses(mesh: Mesh, junctions: Sequence[Junction]) -> bool:
    """Whether walls enclose a cell: going from wall to wall over junctions one comes back another way.

    Walls and junctions are the nodes of a graph, and its links their meetings; it has a ring where there are more links than a
    tree has.
    """
    sides = _sides(mesh)
    lines = {tuple(sorted(edge.nodes[:2])): k for k, junction in enumerate(junctions) for edge in junction.edges}
    first = np.cumsum([0, *(len(block.nodes) for block in mesh.blocks)])
    element = first[sides.places[:, 0]] + sides.places[:, 1]
    at = np.array([lines.get(tuple(ends), -1) for ends in sides.ends.tolist()], dtype=np.int64)
    _, edge = np.unique(sides.ends[at < 0], axis=0, return_inverse=True)
    count = int(first[-1])
    pairs = scipy.sparse.coo_array((np.ones(edge.size), (element[at < 0], edge)), shape=(count, int(edge.max()) + 1))
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
class _Sides:
    """All sides of all shells: (s, 3) block, element and side; (s, 2) ends, rising; (s, 3) away; (s,) depth."""

    places: IntArray
    ends: IntArray
    away: FloatArray
    depth: FloatArray


def _sides(mesh: Mesh) -> _Sides:
    found = []
    for number, block in enumerate(mesh.blocks):
        if not block.is_shell:
            continue
        corners = len(SHELLS[block.kind].sides)
        x = mesh.nodes[block.nodes[:, :corners]]
        for side in range(corners):
            a, b = x[:, side], x[:, (side + 1) % corners]
            tangent = _unit(b - a)
            others = np.delete(x, [side, (side + 1) % corners], axis=1) - a[:, None]
            reach = others - np.einsum("enk,ek->en", others, tangent)[..., None] * tangent[:, None]
            places = np.column_stack([np.full(len(x), number), np.arange(len(x)), np.full(len(x), side)])
            ends = np.sort(block.nodes[:, [side, (side + 1) % corners]], axis=1)
            found.append((places, ends, _unit(reach.mean(axis=1)), np.linalg.norm(reach, axis=2).min(axis=1)))
    if not found:
        return _Sides(np.zeros((0, 3), int), np.zeros((0, 2), int), np.zeros((0, 3)), np.zeros(0))
    places, ends, away, depth = (np.concatenate(parts) for parts in zip(*found, strict=True))
    real = ends[:, 0] != ends[:, 1]
    return _Sides(places[real], ends[real], away[real], depth[real])


def _edge(mesh: Mesh, sides: _Sides, around: IntArray, thickness: Mapping[str, float]) -> Edge:
    """The walls around an edge, in the order of their angles about it."""
    ends = tuple(sides.ends[around[0]].tolist())
    tangent = _unit(mesh.nodes[ends[1]] - mesh.nodes[ends[0]])
    s = sides.away[around]
    passes = (s @ s.T < -np.cos(np.radians(TURN))).any(axis=1)
    angle = np.arctan2(s @ np.cross(tangent, s[0]), s @ s[0])
    middle: tuple[int, ...] = ()
    walls = []
    for i in np.argsort(angle % (2 * np.pi)):
        number, element, side = sides.places[around[i]].tolist()
        block = mesh.blocks[number]
        middle = tuple(block.nodes[element, list(SHELLS[block.kind].sides[side][2:])].tolist()) or middle
        rank, depth = mesh.sets.index(block.set), float(sides.depth[around[i]])
        t, goes_on = thickness[block.set], bool(passes[i])
        wall = Wall(
            number,
            element,
            side,
            set=block.set,
            rank=rank,
            thickness=t,
            away=s[i],
            passes=goes_on,
            depth=depth,
            axis=None if block.axes is None else block.axes[element],
        )
        walls.append(wall)
    return Edge((*ends, *middle), tangent, tuple(walls))


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
    return all(
        any(w.set == v.set and w.passes == v.passes and w.away @ v.away > 1 - _SAME for v in other.walls)
        for w in one.walls
    )


def _junction(mesh: Mesh, edges: Sequence[Edge]) -> Junction:
    walls = edges[0].walls
    around = [
        np.degrees(np.arccos(np.clip(a.away @ b.away, -1, 1)))
        for a, b in zip(walls, (*walls[1:], walls[0]), strict=True)
    ]
    ends = np.array([edge.nodes[:2] for edge in edges])
    return Junction(
        nodes=np.unique([node for edge in edges for node in edge.nodes]),
        walls=tuple((wall.set, wall.thickness, wall.passes) for wall in walls),
        angles=tuple(float(angle) for angle in around),
        length=float(np.linalg.norm(mesh.nodes[ends[:, 1]] - mesh.nodes[ends[:, 0]], axis=1).sum()),
        edges=tuple(edges),
    )
