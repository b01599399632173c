"""The joint model: what shells that overlap at a junction miss of the body.

Middle surfaces run to the junction's line, so walls overlap there, and the corner is stiffer than its lines. So each wall of
thickness t begins at

    d = (T/2) / (1 + 3 (t/T)^p)

from the line, by a rigid link, with T the other wall's thickness over the sine of their angle, and p = 1.7 for a wall that
passes, 3 for one that ends at a wall that passes, 2 where both end. Nodes near the line make room, evenly over 2.5 d or one
element. Where another wall is beyond d, elements give up mass and stiffness along the line (`fecore.body.overlaps`).

Along the line a bead, a beam, carries what is then missing: the moments of the wall's true area between the line and where its
elements are whole, with its modulus along the line and density (so mass is exact); the shear and twist of the strips that were
taken away; and a torsion 0.1 G t⁴, t⁴ the geometric mean of the walls'. No part is ever negative, so stiffness and mass are
positive whatever the size of the elements. All is linear in E, G and density; d is nominal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.body.elements.beams import fibre
from fecore.body.junctions import TURN, Edge, Junction, Wall, are_alike
from fecore.body.laminate import SHEAR_CORRECTION
from fecore.body.mesh import SHELLS, Block, Mesh
from fecore.body.overlaps import MOST, Overlap

TORSION = 0.1
"""Torsion of a bead by G t⁴."""

# p by how a wall meets the other: found with solids whose walls are up to 2.5 times as thick as one another.
_PASSING, _ENDING, _CORNER = 1.7, 3.0, 2.0
_DEEPEST = 0.4  # share of the wall over which its nodes make room for where it begins
_PARALLEL = 0.17  # sine of 10°
_FLAT = float(np.tan(np.radians(TURN)))
_ROUNDING = 1e-9  # relative, by which places that are one may differ
_GAUSS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True)
class Bead:
    """Beams along a junction's line."""

    nodes: IntArray  # (e, 2) or (e, 3) their nodes
    axis: FloatArray  # (3,) n₁ of their section
    walls: tuple[tuple[str, float], ...]  # sets of the walls, each with the angle (rad) from its axis 1 to the line
    # (walls, 3, 6, 6) matrices by the set's E and G along the line and G across, on the strains of a beam
    stiffness: FloatArray
    # (walls, 3, 6, 6) by the set's density, on its motions: of motion along the line, along n₁, and along n₂
    mass: FloatArray


@dataclass(frozen=True)
class Start:
    """How a wall begins at a straight piece of a junction's line."""

    wall: Wall
    begin: float  # d, m
    whole: float  # from where its elements have all that is the wall's, m
    reach: float  # over which its nodes make room, m
    # of each block that has some within reach, their numbers and the (k, n) distances of their nodes, m
    elements: Mapping[int, tuple[IntArray, FloatArray]]


@dataclass(frozen=True)
class Joints:
    """The joint model of a mesh's junctions."""

    mesh: Mesh
    junctions: tuple[Junction, ...]
    axes: Mapping[str, tuple[float, float, float]]

    @cached_property
    def _pieces(self) -> list[tuple[list[Edge], list[Start]]]:
        pieces = (piece for junction in self.junctions for piece in straight(junction.edges))
        return [(piece, starts(self.mesh, piece)) for piece in pieces]

    @cached_property
    def shifts(self) -> tuple[FloatArray, ...]:
        """(e, n, 3) of each block: from the mesh's nodes to the elements', m."""
        found = tuple(
            np.zeros((*block.nodes.shape, 3)) if block.offsets is None else block.offsets.copy()
            for block in self.mesh.blocks
        )
        for _, own in self._pieces:
            for start in own:
                for block, (elements, distance) in start.elements.items():
                    room = start.begin * np.maximum(1 - distance / start.reach, 0)
                    found[block][elements] += room[..., None] * start.wall.away
        return found

    @cached_property
    def overlaps(self) -> tuple[tuple[Overlap, ...], ...]:
        """Of each block, where its elements lie inside other walls."""
        found: tuple[list[Overlap], ...] = tuple([] for _ in self.mesh.blocks)
        for piece, own in self._pieces:
            for start in own:
                for number, (elements, distance) in start.elements.items():
                    block = self.mesh.blocks[number]
                    corners = len(SHELLS[block.kind].sides)
                    place = (distance + self.shifts[number][elements] @ start.wall.away)[:, :corners]
                    end = start.begin + (start.whole - start.begin) / MOST
                    near = place.min(axis=1) < end * (1 - _ROUNDING)
                    if start.whole > start.begin and near.any():
                        angle = self._angle(start.wall, piece[0].tangent)
                        found[number].append(Overlap(elements[near], place[near], end, piece[0].tangent, angle))
        return tuple(tuple(some) for some in found)

    @cached_property
    def beads(self) -> tuple[Bead, ...]:
        """The beads of all lines, piece by piece."""
        return tuple(
            bead(piece, own, [self._angle(start.wall, piece[0].tangent) for start in own])
            for piece, own in self._pieces
        )

    def _angle(self, wall: Wall, tangent: FloatArray) -> float:
        """From axis 1 on a wall to the line, about the wall's normal: rad, from 0 to π, as rounded to a tenth of a degree."""
        axis = np.array(self.axes[wall.set]) if wall.axis is None else wall.axis
        x = self.mesh.nodes[self.mesh.blocks[wall.block].nodes[wall.element, :3]]
        normal = np.cross(tangent, wall.away)
        normal = normal * np.sign(normal @ np.cross(x[1] - x[0], x[2] - x[0]))
        flat = axis - (axis @ normal) * normal
        angle = np.arctan2(normal @ np.cross(flat, tangent), flat @ tangent) % np.pi
        return float(np.radians(round(float(np.degrees(angle)), 1) % 180))


def straight(edges: Sequence[Edge]) -> list[list[Edge]]:
    """Edges of a line that are alike in direction and in number of nodes, together."""
    left, found = list(edges), []
    while left:
        alike = [len(edge.nodes) == len(left[0].nodes) and are_alike(left[0], edge) for edge in left]
        found.append([edge for edge, same in zip(left, alike, strict=True) if same])
        left = [edge for edge, same in zip(left, alike, strict=True) if not same]
    return found


def starts(mesh: Mesh, edges: Sequence[Edge]) -> list[Start]:
    """How each wall begins at a straight piece of a line."""
    tangent = edges[0].tangent
    line = np.unique([node for edge in edges for node in edge.nodes])
    _, nearest = scipy.spatial.KDTree(mesh.nodes[line]).query(mesh.nodes)
    arms = mesh.nodes - mesh.nodes[line][nearest]
    lengths = [np.linalg.norm(np.subtract(*mesh.nodes[list(edge.nodes[:2])])) for edge in edges]
    beyond = 0.49 * float(max(lengths)) / (len(edges[0].nodes) - 1)  # the end of the line
    return [_start(mesh, edges, wall, tangent, arms, beyond) for wall in edges[0].walls]


def _start(
    mesh: Mesh, edges: Sequence[Edge], wall: Wall, tangent: FloatArray, arms: FloatArray, beyond: float
) -> Start:
    walls = edges[0].walls
    depth = max(w.depth for edge in edges for w in edge.walls if w.set == wall.set and w.away @ wall.away > 0.9)
    begin = _begin(wall, walls)
    inside = float(_true_start(wall, walls, tangent, wall.thickness / 2 * np.array([-1.0, 1])).max())
    reach = max(begin / _DEEPEST, depth)
    found = {}
    for number, block in enumerate(mesh.blocks):
        if block.set == wall.set and block.is_shell:
            elements, distance = _within(block, arms, wall.away, tangent, max(reach, inside / MOST), beyond)
            if elements.size:
                found[number] = elements, distance
    extent = max((float(distance.max()) for _, distance in found.values()), default=depth)
    reach = min(reach, extent)
    begin = min(begin, _DEEPEST * reach)
    return Start(wall, begin, min(max(begin, inside), extent), reach, found)


def _within(
    block: Block, arms: FloatArray, away: FloatArray, tangent: FloatArray, depth: float, beyond: float
) -> tuple[IntArray, FloatArray]:
    """Elements of a block that lie in a wall and in part nearer to its line than a depth, and distances of their nodes."""
    corners = arms[block.nodes[:, : len(SHELLS[block.kind].sides)]]
    x = corners @ away
    middle, aside, along = (
        x.mean(axis=1),
        (corners @ np.cross(tangent, away)).mean(axis=1),
        (corners @ tangent).mean(axis=1),
    )
    here = (np.abs(aside) < middle * _FLAT) & (np.abs(along) < beyond) & (x.min(axis=1) < depth * (1 - _ROUNDING))
    elements = np.flatnonzero(here)
    return elements, np.maximum(arms[block.nodes[elements]] @ away, 0.0)


def _begin(wall: Wall, walls: tuple[Wall, ...]) -> float:
    """d, m."""
    T = _across(wall, walls)
    power = _PASSING if wall.passes else _ENDING if any(other.passes for other in walls) else _CORNER
    return T / 2 / (1 + 3 * float((wall.thickness / T) ** power))


def _across(wall: Wall, walls: tuple[Wall, ...]) -> float:
    """T: the largest thickness of the walls that stand across, each over the sine of the angle."""
    found = []
    for other in walls:
        sine = float(np.linalg.norm(np.cross(wall.away, other.away)))
        if other is not wall and sine > _PARALLEL:
            found.append(other.thickness / sine)
    return max(found, default=wall.thickness)


def bead(edges: Sequence[Edge], own: Sequence[Start], angles: Sequence[float]) -> Bead:
    """The bead of a straight piece, given how its walls begin and the angles from their axes 1 to the line."""
    walls, tangent = edges[0].walls, edges[0].tangent
    axis = walls[0].away
    frame = np.array([axis, np.cross(tangent, axis)])
    of = [(wall.set, angle) for wall, angle in zip(walls, angles, strict=True)]
    kinds = tuple(dict.fromkeys(of))
    stiffness, mass = np.zeros((len(kinds), 3, 6, 6)), np.zeros((len(kinds), 3, 6, 6))
    t4 = np.prod([wall.thickness for wall in walls]) ** (4 / len(walls))
    for start, kind in zip(own, of, strict=True):
        k, s = kinds.index(kind), frame @ start.wall.away
        places, weight = _missing(start, walls, tangent, s)
        rows = fibre(places)
        stiffness[k, 0] += np.einsum("g,ga,gb->ab", weight, rows[:, 0], rows[:, 0])
        mass[k] += np.einsum("g,gra,grb->rab", weight, rows, rows)
        stiffness[k, 1:] += _strip(start.begin, start.wall.thickness, s)
        stiffness[k, 1, 3, 3] += TORSION * t4 / len(walls)
    # Every edge of the line runs the way of the first.
    nodes = [
        edge.nodes if edge.tangent @ tangent > 0 else (edge.nodes[1], edge.nodes[0], *edge.nodes[2:]) for edge in edges
    ]
    return Bead(np.array(nodes), axis, kinds, stiffness, mass)


def _missing(
    start: Start, walls: tuple[Wall, ...], tangent: FloatArray, s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(g, 2) places and (g,) weights that integrate from where the wall truly begins to where its elements are whole."""
    points, weights = _GAUSS
    t = start.wall.thickness
    zeta = points * t / 2
    begin = _true_start(start.wall, walls, tangent, zeta)
    half = np.maximum(start.whole - begin, 0) / 2
    along = begin[:, None] + half[:, None] * (1 + points)
    places = along[..., None] * s + zeta[:, None, None] * np.array([-s[1], s[0]])
    weight = (weights * t / 2)[:, None] * half[:, None] * weights
    return places.reshape(-1, 2), weight.ravel()


def _true_start(wall: Wall, walls: tuple[Wall, ...], tangent: FloatArray, zeta: FloatArray) -> FloatArray:
    """(g,) where the wall truly begins along s, at heights ζ along t × s.

    The thickest that passes goes through, and others begin at its face. At a corner of two sets the first set's wall goes on to
    the outer face; where the walls are of one set, or more than two end, each is mitred with its neighbours, from the line
    to the corner where their faces meet.
    """
    through = max((other for other in walls if other.passes), key=lambda other: other.thickness, default=None)
    if through is not None:
        across = wall.away - (wall.away @ through.away) * through.away
        sine = float(np.linalg.norm(across))
        if sine < _PARALLEL:
            return np.zeros_like(zeta)
        slope = float(np.cross(tangent, wall.away) @ across) / sine
        return (through.thickness / 2 - zeta * slope) / sine
    number = walls.index(wall)
    begin = np.empty_like(zeta)
    for side, other in ((1, walls[(number + 1) % len(walls)]), (-1, walls[number - 1])):
        turn = np.arctan2(tangent @ np.cross(wall.away, other.away), wall.away @ other.away) * side % (2 * np.pi)
        if len(walls) == 2 and wall.rank != other.rank:
            face = other.thickness / 2 / abs(np.sin(turn))
            return np.full_like(zeta, -face if wall.rank < other.rank else face)
        corner = (other.thickness / 2 + wall.thickness / 2 * np.cos(turn)) / np.sin(turn)
        here = zeta * side >= 0
        begin[here] = np.abs(zeta[here]) / (wall.thickness / 2) * corner
    return begin


def _strip(d: float, t: float, s: FloatArray) -> FloatArray:
    """(2, 6, 6) shear in the plane and twist, by G along, and shear across, by the other G, of a strip of width d."""
    plane, across = np.zeros((6, 6)), np.zeros((6, 6))
    normal = np.array([-s[1], s[0]])
    plane[1:3, 1:3] = t * d * np.outer(s, s)
    plane[3, 3] = t**3 * d / 3
    across[1:3, 1:3] = SHEAR_CORRECTION * t * d * np.outer(normal, normal)
    return np.array([plane, across])
