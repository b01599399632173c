"""Where walls meet: edges of a mesh at which its surface turns, found from the elements alone.

At an edge every element has a direction s, in its surface and away from the edge. Two elements whose directions are opposite within
`TURN` are one wall that passes; any other element is a wall that ends there. An edge is a junction where a wall ends at another, or
more than two elements meet. Edges with the same walls that touch make a line.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.space.mesh import SHELLS, Mesh

TURN = 20.0
"""Degrees by which the surface turns at a junction, at least."""

_SAME = 0.02  # of directions of one line


@dataclass(frozen=True)
class Wall:
    """One element at an edge.

    Attributes:
        block, element, side: its numbers in the mesh.
        set, rank: its set, and the place of that among the mesh's sets.
        thickness: nominal, m.
        away: (3,) unit direction s.
        passes: whether the wall goes on beyond the edge.
        depth: how far the element reaches from the edge, m.
    """

    block: int
    element: int
    side: int
    set: str
    rank: int
    thickness: float
    away: FloatArray
    passes: bool
    depth: float


@dataclass(frozen=True)
class Edge:
    """An edge at which walls meet: its nodes (ends first, then the middle where it has one), and the walls around it."""

    nodes: tuple[int, ...]
    tangent: FloatArray
    walls: tuple[Wall, ...]


@dataclass(frozen=True)
class Junction:
    """A line along which walls meet, as an engineer checks it.

    Attributes:
        nodes: numbers of its nodes.
        walls: (set, thickness in m, whether it passes) of each wall.
        angles: degrees between each wall and the next around the line.
        length: m.
        edges: what it is made of.
    """

    nodes: IntArray
    walls: tuple[tuple[str, float, bool], ...]
    angles: tuple[float, ...]
    length: float
    edges: tuple[Edge, ...]


def find_junctions(mesh: Mesh, thickness: Mapping[str, float]) -> tuple[Junction, ...]:
    """The junctions of a mesh of shells, given each set's thickness in m."""
    at: dict[tuple[int, int], list[tuple[int, int, int]]] = defaultdict(list)
    for number, block in enumerate(mesh.blocks):
        if not block.is_shell:
            continue
        for side, ends in enumerate(SHELLS[block.kind].sides):
            for element, (a, b) in enumerate(np.sort(block.nodes[:, ends[:2]], axis=1).tolist()):
                at[a, b].append((number, element, side))
    edges = []
    for ends, places in at.items():
        if len(places) > 1:
            edge = _edge(mesh, ends, places, thickness)
            if len(places) > 2 or not all(wall.passes for wall in edge.walls):
                edges.append(edge)
    return tuple(_junction(mesh, group) for group in _lines(edges))


def _edge(
    mesh: Mesh, ends: tuple[int, int], places: Sequence[tuple[int, int, int]], thickness: Mapping[str, float]
) -> Edge:
    """The walls around an edge, in the order of their angles about it."""
    start, end = mesh.nodes[ends[0]], mesh.nodes[ends[1]]
    tangent = (end - start) / np.linalg.norm(end - start)
    middle: tuple[int, ...] = ()
    aways, depths = [], []
    for number, element, side in places:
        block = mesh.blocks[number]
        nodes = block.nodes[element]
        shell = SHELLS[block.kind]
        middle = tuple(nodes[list(shell.sides[side][2:])].tolist()) or middle
        corners = nodes[: len(shell.sides)]
        others = mesh.nodes[[n for n in corners if n not in ends]] - start
        reach = others - np.outer(others @ tangent, tangent)
        mean = reach.mean(axis=0)
        depths.append(float(np.linalg.norm(reach, axis=1).min()))
        aways.append(mean / np.linalg.norm(mean))
    s = np.array(aways)
    passes = (s @ s.T < -np.cos(np.radians(TURN))).any(axis=1)
    angle = np.arctan2(s @ np.cross(tangent, s[0]), s @ s[0])
    walls = []
    for i in np.argsort(angle % (2 * np.pi)):
        number, element, side = places[i]
        name = mesh.blocks[number].set
        walls.append(Wall(number, element, side, name, mesh.sets.index(name), thickness[name], s[i], bool(passes[i]), depths[i]))
    return Edge((*ends, *middle), tangent, tuple(walls))


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
                    if other in left and _alike(edges[here], edges[other]):
                        left.discard(other)
                        group.append(other)
                        stack.append(other)
        lines.append([edges[number] for number in sorted(group)])
    return lines


def _alike(one: Edge, other: Edge) -> bool:
    if len(one.walls) != len(other.walls) or abs(one.tangent @ other.tangent) < 1 - _SAME:
        return False
    return all(
        any(w.set == v.set and w.passes == v.passes and w.away @ v.away > 1 - _SAME for v in other.walls)
        for w in one.walls
    )


def _junction(mesh: Mesh, edges: Sequence[Edge]) -> Junction:
    walls = edges[0].walls
    around = [np.degrees(np.arccos(np.clip(a.away @ b.away, -1, 1))) for a, b in zip(walls, (*walls[1:], walls[0]), strict=True)]
    ends = np.array([edge.nodes[:2] for edge in edges])
    return Junction(
        nodes=np.unique([node for edge in edges for node in edge.nodes]),
        walls=tuple((wall.set, wall.thickness, wall.passes) for wall in walls),
        angles=tuple(float(angle) for angle in around),
        length=float(np.linalg.norm(mesh.nodes[ends[:, 1]] - mesh.nodes[ends[:, 0]], axis=1).sum()),
        edges=tuple(edges),
    )
