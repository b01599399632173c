"""The joint model: what shells that overlap at a junction miss of the body.

Middle surfaces run to the junction's line, so walls overlap there, and the corner is stiffer than its lines. So each wall of
thickness t begins at

    d = (T/2) / (1 + 3 (t/T)^p)

from the line, by a rigid link, with T the other wall's thickness, and p = 1.7 for a wall that passes, 3 for one that ends at a
wall that passes, 2 at a corner of two. At other than right angles d, and all that follows, is scaled with the angle
(`fecore.body.corners`). Nodes near the line make room, evenly over 2.5 d or one element. Where another wall is beyond d,
elements give up mass and stiffness along the line (`fecore.body.overlaps`).

Along the line a bead, a beam, carries what is then missing: the moments of the wall's true area between the line and where its
elements are whole, with its modulus along the line and density (so mass is exact); the shear and twist of the strips that were
taken away; and a torsion 0.1 G t⁴, t⁴ the geometric mean of the walls'. No part is ever negative, so stiffness and mass are
positive whatever the size of the elements. All is linear in E, G and density; d is nominal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.corners import Corner
from fecore.body.elements.beams import fibre
from fecore.body.junctions import Edge, Junction, Wall, are_alike
from fecore.body.laminate import SHEAR_CORRECTION
from fecore.body.mesh import SHELLS, Mesh
from fecore.body.overlaps import MOST, Overlap
from fecore.body.strips import Line, Strips

TORSION = 0.1
"""Torsion of a bead by G t⁴."""

_DEEPEST = 0.4  # share of the wall over which its nodes make room for where it begins
_FAR = 30  # overlaps beyond which a wall's width plays no part
_ANGLES = (1, 5, 25, 75, 225, 450, 900, 1800)  # into how many the half circle is parted at least
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
    def _pieces(self) -> list["Piece"]:
        strips = Strips(self.mesh) if self.junctions else None
        edges = (piece for junction in self.junctions for piece in straight(junction.edges))
        return [piece_of(strips, some) for some in edges if strips is not None]

    @cached_property
    def corners(self) -> list[tuple[Corner, Corner]]:
        """Of all straight pieces of lines their corners as they are, and as far as they are modelled."""
        return [(piece.edges[0].corner, piece.corner) for piece in self._pieces]

    @cached_property
    def shifts(self) -> tuple[FloatArray, ...]:
        """(e, n, 3) of each block: from the mesh's nodes to the elements', m."""
        found = tuple(
            np.zeros((*block.nodes.shape, 3)) if block.offsets is None else block.offsets.copy()
            for block in self.mesh.blocks
        )
        for piece in self._pieces:
            for start in piece.starts:
                for block, (elements, distance) in start.elements.items():
                    room = start.begin * np.maximum(1 - distance / start.reach, 0)
                    found[block][elements] += room[..., None] * start.wall.away
        return found

    @cached_property
    def overlaps(self) -> tuple[tuple[Overlap, ...], ...]:
        """Of each block, where its elements lie inside other walls."""
        found: tuple[list[Overlap], ...] = tuple([] for _ in self.mesh.blocks)
        for piece in self._pieces:
            for start in piece.starts:
                for number, (elements, distance) in start.elements.items():
                    block = self.mesh.blocks[number]
                    corners = len(SHELLS[block.kind].sides)
                    place = (distance + self.shifts[number][elements] @ start.wall.away)[:, :corners]
                    end = start.begin + (start.whole - start.begin) / MOST
                    near = place.min(axis=1) < end * (1 - _ROUNDING)
                    if start.whole > start.begin and near.any():
                        angle, tangent = self._angle(start.wall, piece), piece.edges[0].tangent
                        found[number].append(Overlap(elements[near], place[near], end, tangent, angle))
        return tuple(tuple(some) for some in found)

    @cached_property
    def beads(self) -> tuple[Bead, ...]:
        """The beads of all lines, piece by piece."""
        return tuple(bead(piece, [self._angle(start.wall, piece) for start in piece.starts]) for piece in self._pieces)

    def _angle(self, wall: Wall, piece: "Piece") -> float:
        """From axis 1 on a wall to the line, about the wall's normal: rad, from 0 to π, rounded to a tenth of a degree.

        The less a wall turns at the line, the less it matters, and the coarser it is.
        """
        tangent = piece.edges[0].tangent
        axis = np.array(self.axes[wall.set]) if wall.axis is None else wall.axis
        x = self.mesh.nodes[self.mesh.blocks[wall.block].nodes[wall.element, :3]]
        normal = np.cross(tangent, wall.away)
        normal = normal * np.sign(normal @ np.cross(x[1] - x[0], x[2] - x[0]))
        flat = axis - (axis @ normal) * normal
        angle = np.degrees(np.arctan2(normal @ np.cross(flat, tangent), flat @ tangent)) % 180
        parts = next(n for n in _ANGLES if n >= _ANGLES[-1] * piece.edges[0].corner.turn * (1 - _ROUNDING))
        return float(np.radians(round(round(float(angle) * parts / 180) * 180 / parts, 1) % 180))


@dataclass(frozen=True)
class Piece:
    """A straight piece of a junction's line."""

    edges: Sequence[Edge]
    corner: Corner  # as far as it is modelled
    starts: Sequence[Start]  # of its walls


def straight(edges: Sequence[Edge]) -> list[list[Edge]]:
    """Edges of a line that are alike in direction and in number of nodes, together."""
    left, found = list(edges), []
    while left:
        alike = [len(edge.nodes) == len(left[0].nodes) and are_alike(left[0], edge) for edge in left]
        found.append([edge for edge, same in zip(left, alike, strict=True) if same])
        left = [edge for edge, same in zip(left, alike, strict=True) if not same]
    return found


def piece_of(strips: Strips, edges: Sequence[Edge]) -> Piece:
    """How each wall begins at a straight piece of a line."""
    mesh, first = strips.mesh, edges[0]
    nodes = np.unique([node for edge in edges for node in edge.nodes])
    along = np.sort((mesh.nodes[nodes] - mesh.nodes[nodes[0]]) @ first.tangent)
    lengths = [float(np.linalg.norm(np.subtract(*mesh.nodes[list(edge.nodes[:2])]))) for edge in edges]
    beyond = 0.49 * max(lengths) / (len(first.nodes) - 1)  # the end of the line
    line = Line(mesh.nodes[nodes[0]], first.tangent, along, sum(lengths), beyond)
    own = list(zip(*(_matched(first.walls, edge.walls) for edge in edges), strict=True))
    found, depths = [], []
    for wall, alike in zip(first.walls, own, strict=True):
        depths.append(max(w.depth for w in alike))
        limit = max(_FAR * first.corner.overlap(wall.stack), depths[-1] * (1 - _ROUNDING))
        elements = [int(strips.first[w.block]) + w.element for w in alike]
        found.append(strips.strip(line, elements, wall.away, limit))
    widths = np.full(len(first.corner.thickness), np.inf)
    for wall, strip in zip(first.walls, found, strict=True):
        widths[wall.stack] = min(widths[wall.stack], strip.width)
    corner = first.corner.cut(widths.tolist())
    starts = []
    for wall, strip, depth in zip(first.walls, found, depths, strict=True):
        begin = corner.begin(wall.stack)
        half = wall.thickness / 2 * np.array([-1.0, 1])
        whole = max(begin, float(corner.true_start(wall.stack, half, _goes_on(wall, first)).max()))
        reach = max(begin / _DEEPEST, depth)
        near = strip.distance.min(axis=1) < max(reach, whole / MOST) * (1 - _ROUNDING)
        blocks = np.searchsorted(strips.first, strip.elements[near], side="right") - 1
        inside = {}
        for number in np.unique(blocks).tolist():
            numbers = np.sort(strip.elements[near][blocks == number] - strips.first[number])
            arms = mesh.nodes[mesh.blocks[number].nodes[numbers]] - line.origin
            inside[number] = numbers, np.maximum(arms @ wall.away, 0.0)
        starts.append(Start(wall, begin, whole, reach, inside))
    return Piece(edges, corner, starts)


def _matched(walls: Sequence[Wall], others: Sequence[Wall]) -> list[Wall]:
    """Of each wall that of another edge which is it: of the same set, in the nearest direction."""
    left, found = list(others), []
    for wall in walls:
        best = max(left, key=lambda other: (other.set == wall.set, float(other.away @ wall.away)))
        left.remove(best)
        found.append(best)
    return found


def _goes_on(wall: Wall, edge: Edge) -> int:
    """At a corner of two sets whether the first set's wall goes on to the outer face, 1, or ends there, −1; else 0."""
    ranks = [min(w.rank for w in edge.walls if w.stack == stack) for stack in range(len(edge.corner.thickness))]
    if not edge.corner.is_simple or ranks[0] == ranks[1]:
        return 0
    return 1 if ranks[wall.stack] == min(ranks) else -1


def bead(piece: Piece, angles: Sequence[float]) -> Bead:
    """The bead of a straight piece, given the angles from its walls' axes 1 to the line."""
    edges, corner = piece.edges, piece.corner
    walls, tangent = edges[0].walls, edges[0].tangent
    axis = walls[0].away
    frame = np.array([axis, np.cross(tangent, axis)])
    of = [(wall.set, angle) for wall, angle in zip(walls, angles, strict=True)]
    kinds = tuple(dict.fromkeys(of))
    stiffness, mass = np.zeros((len(kinds), 3, 6, 6)), np.zeros((len(kinds), 3, 6, 6))
    count = len(corner.thickness)
    torsion = TORSION * corner.scale * float(np.prod(corner.thickness)) ** (4 / count) / count
    for start, kind in zip(piece.starts, of, strict=True):
        k, s = kinds.index(kind), frame @ start.wall.away
        places, weight = _missing(start, piece, s)
        rows = fibre(places)
        stiffness[k, 0] += np.einsum("g,ga,gb->ab", weight, rows[:, 0], rows[:, 0])
        mass[k] += np.einsum("g,gra,grb->rab", weight, rows, rows)
        stiffness[k, 1:] += _strip(start.begin, start.wall.thickness, s)
        stiffness[k, 1, 3, 3] += torsion * start.wall.thickness / corner.thickness[start.wall.stack]
    # Every edge of the line runs the way of the first.
    nodes = [
        edge.nodes if edge.tangent @ tangent > 0 else (edge.nodes[1], edge.nodes[0], *edge.nodes[2:]) for edge in edges
    ]
    return Bead(np.array(nodes), axis, kinds, stiffness, mass)


def _missing(start: Start, piece: Piece, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(g, 2) places and (g,) weights that integrate from where the wall truly begins to where its elements are whole."""
    points, weights = _GAUSS
    t = start.wall.thickness
    zeta = points * t / 2
    begin = piece.corner.true_start(start.wall.stack, zeta, _goes_on(start.wall, piece.edges[0]))
    half = np.maximum(start.whole - begin, 0) / 2
    along = begin[:, None] + half[:, None] * (1 + points)
    places = along[..., None] * s + zeta[:, None, None] * np.array([-s[1], s[0]])
    weight = (weights * t / 2)[:, None] * half[:, None] * weights
    return places.reshape(-1, 2), weight.ravel()


def _strip(d: float, t: float, s: FloatArray) -> FloatArray:
    """(2, 6, 6) shear in the plane and twist, by G along, and shear across, by the other G, of a strip of width d."""
    plane, across = np.zeros((6, 6)), np.zeros((6, 6))
    normal = np.array([-s[1], s[0]])
    plane[1:3, 1:3] = t * d * np.outer(s, s)
    plane[3, 3] = t**3 * d / 3
    across[1:3, 1:3] = SHEAR_CORRECTION * t * d * np.outer(normal, normal)
    return np.array([plane, across])
