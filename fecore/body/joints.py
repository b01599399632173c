"""The joint model: what shells that overlap at a junction miss of the body.

Middle surfaces run to the junction's line, so walls overlap there, and the corner is stiffer than
its lines. So each wall of thickness t begins at

    d = (T/2) / (1 + 3 (t/T)^p)

from the line, by a rigid link, with T the other wall's thickness, and p = 1.7 for a wall that
passes, 3 for one that ends at a wall that passes, 2 at a corner of two. At other than right angles
d, and all that follows, is scaled with the angle (`fecore.body.corners`). Nodes near the line make
room, evenly over 2.5 d or one element. Where another wall is beyond d, elements give up mass and
stiffness along the line (`fecore.body.overlaps`).

Along the line a junction beam carries what is then missing: the moments of the wall's true area
between the line and where its elements are whole, with its modulus along the line and density (so
mass is exact); the shear and twist of the strips that were taken away; and a torsion 0.1 G t⁴, t⁴
the geometric mean of the walls'. No part is ever negative, so stiffness and mass are positive
whatever the size of the elements. All is linear in E, G and density; d is nominal. Matrices of
elements and junction beams carry what differs from place to place, so a set has the same few
coefficients however many lines a curve is meshed by.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import ROUND_OFF, FloatArray, IntArray
from fecore.body.corners import Corner
from fecore.body.junction_beams import HEIGHTS, JunctionBeams, wall_matrices
from fecore.body.junctions import Edge, Junction, Wall, are_alike
from fecore.body.mesh import SHELLS, Mesh
from fecore.body.overlaps import MOST, Overlap
from fecore.body.strips import NodeLine, Strips, StripStarts

TORSION = 0.1
"""Torsion of a junction beam by G t⁴."""

JOINTS_ERROR, HARD_JOINTS_ERROR, NAIVE_ERROR, UNLIKE_WALLS = 0.003, 0.0045, 0.016, 1.5
"""Relative errors of a frequency by joints, as `Joints.frequency_error`, and from which ratio of
thicknesses they are hard.
"""

_DEEPEST = 0.4  # share of the wall over which its nodes make room for where it begins
_FAR = 30  # overlaps beyond which a wall's width plays no part
_FACES_TOO = np.array([-1.0, 1.0, *HEIGHTS])


@dataclass(frozen=True)
class LineSegment:
    """A straight segment of a junction's line."""

    edges: Sequence[Edge]
    whole: Corner  # as it is; no overlap is wider than a wall
    corner: Corner  # as far as it is modelled
    starts: Sequence["Start"]  # of its walls

    @property
    def torsion(self) -> float:
        """Of its beam by G, m⁴."""
        thickness = self.corner.thickness
        mean = float(np.prod(thickness) ** (1 / len(thickness)))
        return TORSION * self.corner.scale * mean**4 / len(thickness)


@dataclass(frozen=True)
class Start:
    """How a wall begins at a straight segment of a junction's line."""

    wall: Wall
    begin: float  # d, m
    whole: float  # from where its elements have all that is the wall's, m
    reach: float  # over which its nodes make room, m
    truly: FloatArray  # (g,) where the wall begins at `HEIGHTS`, m
    elements: IntArray  # numbers among all blocks' of its elements within reach


@dataclass(frozen=True)
class Starts:
    """The starts of many walls, row by row."""

    segment: IntArray  # (s,) number of its segment
    rank: IntArray  # (s,) of its set
    # (s,) as of `Start` and `Wall`, m; the part of its segment's torsion, m⁴; and the turn of its
    # corner
    thickness: FloatArray
    begin: FloatArray
    whole: FloatArray
    reach: FloatArray
    torsion: FloatArray
    turn: FloatArray
    truly: FloatArray  # (s, g) as of `Start`
    # (s, 3) as of `Wall` and `Edge`
    direction: FloatArray
    tangent: FloatArray
    origin: IntArray  # (s,) a node of the line
    start: IntArray  # (n,) which start
    element: IntArray  # (n,) each of its elements is of

    @classmethod
    def of(cls, segments: Sequence[LineSegment]) -> "Starts":
        """Of all segments, one after the other."""
        every = [(segment, start) for segment in segments for start in segment.starts]
        starts = [start for _, start in every]
        thickness, begin, whole, reach = (
            np.array(
                [(start.wall.thickness, start.begin, start.whole, start.reach) for start in starts]
            )
            .reshape(-1, 4)
            .T
        )
        share = [
            start.wall.thickness / segment.corner.thickness[start.wall.stack]
            for segment, start in every
        ]
        return cls(
            segment=np.repeat(
                np.arange(len(segments)), [len(segment.starts) for segment in segments]
            ),
            rank=np.array([start.wall.rank for start in starts], dtype=np.int64),
            thickness=thickness,
            begin=begin,
            whole=whole,
            reach=reach,
            torsion=np.array([segment.torsion for segment, _ in every]) * share,
            turn=np.array([segment.edges[0].corner.turn for segment, _ in every]),
            truly=np.array([start.truly for start in starts]).reshape(len(starts), len(HEIGHTS)),
            direction=np.array([start.wall.direction for start in starts]).reshape(-1, 3),
            tangent=np.array([segment.edges[0].tangent for segment, _ in every]).reshape(-1, 3),
            origin=np.array([segment.edges[0].nodes[0] for segment, _ in every], dtype=np.int64),
            start=np.repeat(np.arange(len(starts)), [start.elements.size for start in starts]),
            element=np.concatenate(
                [np.zeros(0, dtype=np.int64), *(start.elements for start in starts)]
            ),
        )


@dataclass(frozen=True)
class Joints:
    """The joint model of a mesh's junctions."""

    mesh: Mesh
    junctions: tuple[Junction, ...]
    axes: Mapping[str, tuple[float, float, float]]

    @cached_property
    def _segments(self) -> list[LineSegment]:
        groups = [segment for junction in self.junctions for segment in straight(junction.edges)]
        return segments_of(Strips(self.mesh), groups) if groups else []

    @cached_property
    def corners(self) -> list[tuple[Corner, Corner]]:
        """Of all straight segments of lines their corners as they are, and as far as they are
        modelled.
        """
        return [(segment.whole, segment.corner) for segment in self._segments]

    def frequency_error(self, *, hard: bool) -> float:
        """Relative error of a natural frequency by the model of joints, the worst of all; `hard`
        where walls enclose a cell.

        Fixed beforehand, by solids of another code: .3 %, and .45 % where walls enclose a cell or
        their thicknesses differ by more than half. Of lines at which two walls turn by less than a
        right angle it is as much less as what is modelled, and of sharp edges as much more; with
        1.6 % of what is not.
        """
        errors = []
        for whole, modelled in self.corners:
            unlike = whole.thickness.max() > UNLIKE_WALLS * whole.thickness.min()
            own = HARD_JOINTS_ERROR if hard or unlike else JOINTS_ERROR
            errors.append(own * modelled.size + NAIVE_ERROR * whole.left(modelled))
        return max(errors)

    @cached_property
    def _starts(self) -> Starts:
        return Starts.of(self._segments)

    @cached_property
    def _near(self) -> tuple[tuple[IntArray, IntArray, FloatArray], ...]:
        """Of each block (k,) starts, its (k,) elements within their reach, and the (k, n) distances
        of their nodes, m.
        """
        starts, near, first = self._starts, [], 0
        for block in self.mesh.blocks:
            own = (starts.element >= first) & (starts.element < first + len(block.nodes))
            which, elements = starts.start[own], starts.element[own] - first
            arms = (
                self.mesh.nodes[block.nodes[elements]] - self.mesh.nodes[starts.origin[which], None]
            )
            near.append(
                (
                    which,
                    elements,
                    np.maximum(np.einsum("enk,ek->en", arms, starts.direction[which]), 0.0),
                )
            )
            first += len(block.nodes)
        return tuple(near)

    @cached_property
    def shifts(self) -> tuple[FloatArray, ...]:
        """(e, n, 3) of each block: from the mesh's nodes to the elements', m."""
        starts = self._starts
        shifts = tuple(
            np.zeros((*block.nodes.shape, 3)) if block.offsets is None else block.offsets.copy()
            for block in self.mesh.blocks
        )
        for own, (which, elements, distance) in zip(shifts, self._near, strict=True):
            room = starts.begin[which, None] * np.maximum(
                1 - distance / starts.reach[which, None], 0
            )
            np.add.at(own, elements, room[..., None] * starts.direction[which, None])
        return shifts

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Of each block, where its elements lie inside other walls."""
        starts, overlaps = self._starts, []
        ends = starts.begin + (starts.whole - starts.begin) / MOST
        for block, shift, (which, elements, distance) in zip(
            self.mesh.blocks, self.shifts, self._near, strict=True
        ):
            corners = len(SHELLS[block.kind].sides) if block.is_shell else 1
            moved = distance + np.einsum("enk,ek->en", shift[elements], starts.direction[which])
            ratio = moved[:, :corners] / np.maximum(ends[which, None], 1e-300)
            near = (starts.whole > starts.begin)[which] & (ratio.min(axis=1) < 1 - ROUND_OFF)
            of = which[near]
            overlap = Overlap(
                elements[near], ratio[near], starts.tangent[of], self._angles[of], starts.turn[of]
            )
            overlaps.append(overlap)
        return tuple(overlaps)

    @cached_property
    def junction_beams(self) -> tuple[JunctionBeams, ...]:
        """The walls' shares of the beams of all lines, those of beams of two nodes and of three."""
        starts, segments = self._starts, self._segments
        axes = np.array([segment.starts[0].wall.direction for segment in segments]).reshape(-1, 3)[
            starts.segment
        ]
        frame = np.stack([axes, np.cross(starts.tangent, axes)], axis=1)
        across = np.einsum("sij,sj->si", frame, starts.direction)
        stiffness, mass = wall_matrices(
            across, starts.thickness, starts.begin, starts.whole, starts.truly
        )
        stiffness[:, 1, 3, 3] += starts.torsion
        # Of motion along z where n₁ lies nearer to it, and y the other way.
        turned = np.abs(axes[:, 1]) <= np.abs(axes[:, 2])
        mass[turned] = mass[turned][:, [0, 2, 1]]
        edges = [segment.edges for segment in segments]
        counts = np.array([len(own[0].nodes) for own in edges], dtype=np.int64)
        groups = []
        for count in np.unique(counts).tolist():
            chosen = np.flatnonzero(counts == count)
            nodes = [_one_way(edge, edges[k][0]) for k in chosen for edge in edges[k]]
            beams = np.repeat(chosen, [len(edges[k]) for k in chosen])
            # Each of a segment's walls has all its beams; starts lie segment by segment.
            first, after = (
                np.searchsorted(starts.segment, beams, side=side) for side in ("left", "right")
            )
            beam = np.repeat(np.arange(len(beams)), after - first)
            wall = np.concatenate(
                [np.arange(low, high) for low, high in zip(first, after, strict=True)]
            )
            groups.append(
                JunctionBeams(
                    nodes=np.array(nodes),
                    axes=axes[first],
                    beam=beam,
                    rank=starts.rank[wall],
                    angle=self._angles[wall],
                    turn=starts.turn[wall],
                    stiffness=stiffness[wall],
                    mass=mass[wall],
                )
            )
        return tuple(groups)

    @cached_property
    def _angles(self) -> FloatArray:
        """(s,) from axis 1 on each wall to the line, about the wall's normal: rad, from 0 to π."""
        walls, starts = (
            [start.wall for segment in self._segments for start in segment.starts],
            self._starts,
        )
        axes = [self.axes[wall.set] if wall.axis is None else wall.axis for wall in walls]
        corners = [self.mesh.blocks[wall.block].nodes[wall.element, :3] for wall in walls]
        axis, x = (
            np.array(axes).reshape(-1, 3),
            self.mesh.nodes[np.array(corners, dtype=np.int64).reshape(-1, 3)],
        )
        normal = np.cross(starts.tangent, starts.direction)
        up = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        normal *= np.sign(np.sum(normal * up, axis=1, keepdims=True))
        flat = axis - np.sum(axis * normal, axis=1, keepdims=True) * normal
        sine = np.sum(normal * np.cross(flat, starts.tangent), axis=1)
        return np.asarray(np.arctan2(sine, np.sum(flat * starts.tangent, axis=1)) % np.pi)


def _one_way(edge: Edge, first: Edge) -> tuple[int, ...]:
    """Nodes of an edge that runs the way of the first of its line."""
    a, b, *middle = edge.nodes
    return edge.nodes if edge.tangent @ first.tangent > 0 else (b, a, *middle)


def straight(edges: Sequence[Edge]) -> list[list[Edge]]:
    """Edges of a line that are alike in direction and in number of nodes, together."""
    left, groups = list(edges), []
    while left:
        alike = [
            len(edge.nodes) == len(left[0].nodes) and are_alike(left[0], edge) for edge in left
        ]
        groups.append([edge for edge, same in zip(left, alike, strict=True) if same])
        left = [edge for edge, same in zip(left, alike, strict=True) if not same]
    return groups


def segments_of(strips: Strips, groups: Sequence[Sequence[Edge]]) -> list[LineSegment]:
    """How each wall begins at straight segments of lines."""
    walls: list[Wall] = []
    line, depth, limit, first = [], [], [], []
    for k, edges in enumerate(groups):
        own = zip(*(_matched(edges[0].walls, edge.walls) for edge in edges), strict=True)
        for wall, alike in zip(edges[0].walls, own, strict=True):
            first += [(len(walls), int(strips.first[w.block]) + w.element) for w in alike]
            depth.append(max(w.depth for w in alike))
            limit.append(
                max(_FAR * edges[0].corner.overlap(wall.stack), depth[-1] * (1 - ROUND_OFF))
            )
            walls.append(wall)
            line.append(k)
    at, elements = np.array(first).T
    lines = [_line(strips.mesh, edges) for edges in groups]
    direction = np.array([wall.direction for wall in walls])
    strip = strips.strips(
        StripStarts(lines, np.array(line), direction, np.array(limit), at, elements)
    )
    bounds = np.searchsorted(strip.wall, np.arange(len(walls) + 1))
    segments, number = [], 0
    for edges in groups:
        own_walls = edges[0].walls
        numbers = range(number, number + len(own_walls))
        number += len(own_walls)
        widths = [math.inf] * len(edges[0].corner.thickness)
        for wall, k in zip(own_walls, numbers, strict=True):
            widths[wall.stack] = min(widths[wall.stack], float(strip.width[k]))
        corner, starts = edges[0].corner.cut(widths), []
        for wall, k in zip(own_walls, numbers, strict=True):
            begin = corner.begin(wall.stack)
            truly = corner.true_start(
                wall.stack, wall.thickness / 2 * _FACES_TOO, _goes_on(wall, edges[0])
            )
            whole = max(begin, float(truly[:2].max()))
            reach = max(begin / _DEEPEST, depth[k])
            own_part = slice(bounds[k], bounds[k + 1])
            near = strip.nearest[own_part] < max(reach, whole / MOST) * (1 - ROUND_OFF)
            starts.append(
                Start(wall, begin, whole, reach, truly[2:], strip.elements[own_part][near])
            )
        segments.append(LineSegment(edges, edges[0].corner.cut(widths, 1.0), corner, starts))
    return segments


def _line(mesh: Mesh, edges: Sequence[Edge]) -> NodeLine:
    first = edges[0]
    nodes = sorted({node for edge in edges for node in edge.nodes})
    along = np.sort((mesh.nodes[nodes] - mesh.nodes[nodes[0]]) @ first.tangent)
    lengths = [math.dist(mesh.nodes[edge.nodes[0]], mesh.nodes[edge.nodes[1]]) for edge in edges]
    beyond = 0.49 * max(lengths) / (len(first.nodes) - 1)  # the end of the line
    return NodeLine(mesh.nodes[nodes[0]], first.tangent, along, sum(lengths), beyond)


def _matched(walls: Sequence[Wall], others: Sequence[Wall]) -> list[Wall]:
    """Of each wall that of another edge which is it: of the same set, in the nearest direction."""
    left, matched = list(others), []
    for wall in walls:
        best = max(
            left, key=lambda other: (other.set == wall.set, float(other.direction @ wall.direction))
        )
        left.remove(best)
        matched.append(best)
    return matched


def _goes_on(wall: Wall, edge: Edge) -> int:
    """At a corner of two sets whether the first set's wall goes on to the outer face, 1, or ends
    there, −1; else 0.
    """
    ranks = [
        min(w.rank for w in edge.walls if w.stack == stack)
        for stack in range(len(edge.corner.thickness))
    ]
    if not edge.corner.is_simple or ranks[0] == ranks[1]:
        return 0
    return 1 if ranks[wall.stack] == min(ranks) else -1
