"""The strip of a wall in front of a line: its elements from the line on, found from side to
side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.junctions import Sides, sides_of
from fecore.body.mesh import SHELLS, Mesh

# cosine of a step's direction to the wall's above which it leads on, and not along the line
_PROGRESS = 1e-6


@dataclass(frozen=True)
class NodeLine:
    """A straight line of nodes."""

    origin: FloatArray  # (3,) m
    tangent: FloatArray  # (3,)
    places: FloatArray  # (n,) of its nodes along the tangent, rising
    length: float  # of its edges, m
    beyond: float  # how far an element's middle may lie beside the nearest node, m


@dataclass(frozen=True)
class StripStarts:
    """Which strips are looked for: walls at lines."""

    lines: Sequence[NodeLine]
    line: IntArray  # (s,) which line
    direction: FloatArray  # (s, 3) direction of the wall
    limit: FloatArray  # (s,) m: as far as elements begin nearer
    # (k,) wall and (k,) element among all blocks' that lie at its line
    wall: IntArray
    element: IntArray


@dataclass(frozen=True)
class WallStrips:
    """Elements of walls in front of their lines."""

    wall: IntArray  # (e,) which wall, rising
    elements: IntArray  # (e,) numbers among all blocks', rising in each wall
    nearest: FloatArray  # (e,) of their corners' distances from the line, m
    width: FloatArray  # (s,) m, as far as each was followed


class Strips:
    """How elements of a mesh's shells go on, side by side, in their own set."""

    def __init__(self, mesh: Mesh) -> None:
        """Of a mesh."""
        self.mesh = mesh
        self.first = np.cumsum([0, *(len(block.nodes) for block in mesh.blocks)])
        count = int(self.first[-1])
        self._corners = np.zeros((count, 4), dtype=np.int64)
        for block, at in zip(mesh.blocks, self.first, strict=False):
            if block.is_shell:
                own = block.nodes[:, : len(SHELLS[block.kind].sides)]
                self._corners[at : at + len(own)] = np.hstack([own, own[:, :1]])[:, :4]
        x = mesh.nodes[self._corners]
        self._area = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]) / 2
        self._next = np.full((count, 4), -1)
        self._onward = np.zeros((count, 4, 3))
        self._join(sides_of(mesh))

    def _join(self, sides: Sides) -> None:
        """Neighbours over edges of two stacks, of which one goes on as the other; in stacks, layer
        by layer.
        """
        names = [block.set for block in self.mesh.blocks]
        number = np.array([names.index(name) for name in names])[sides.places[:, 0]]
        _, edge = np.unique(sides.ends, axis=0, return_inverse=True)
        edge = edge.ravel()
        stacks = np.bincount(np.unique(np.column_stack([edge, sides.same]), axis=0)[:, 0])
        order = np.lexsort((sides.element, number, sides.same, edge))
        starts = np.any(
            np.diff(np.column_stack([edge, sides.same, number])[order], axis=0, prepend=-1) != 0,
            axis=1,
        )
        at = np.arange(len(order))
        layer = np.empty_like(at)
        layer[order] = at - np.maximum.accumulate(np.where(starts, at, 0))
        order = np.lexsort((sides.same, layer, number, edge))
        keys = np.column_stack([edge, number, layer])[order]
        alike = np.flatnonzero(np.all(keys[1:] == keys[:-1], axis=1) & (stacks[keys[1:, 0]] == 2))
        one, other = order[alike], order[alike + 1]
        goes_on = np.einsum("ij,ij->i", sides.direction[one], sides.direction[other]) < 0
        for here, there in ((one[goes_on], other[goes_on]), (other[goes_on], one[goes_on])):
            place = sides.element[here], sides.places[here, 2]
            self._next[place], self._onward[place] = sides.element[there], sides.direction[there]

    def strips(self, starts: StripStarts) -> WallStrips:
        """From elements at lines, along their walls' directions."""
        count = len(self._area)
        seen = _Seen(self.mesh.nodes[self._corners], starts)
        keys = frontier = np.unique(starts.wall * count + starts.element)
        while frontier.size:
            wall, element = np.divmod(frontier, count)
            onward = np.einsum("nik,nk->ni", self._onward[element], starts.direction[wall])
            leads = (self._next[element] >= 0) & (onward > _PROGRESS)
            following = np.unique(((wall * count)[:, None] + self._next[element])[leads])
            following = np.setdiff1d(following, keys, assume_unique=True)
            distance, beside = seen.at(*np.divmod(following, count))
            beyond = seen.beyond[following // count]
            ahead = (np.abs(beside).min(axis=1) < 2 * beyond) | (
                np.abs(beside.mean(axis=1)) < beyond
            )
            frontier = following[ahead & (distance.min(axis=1) < starts.limit[following // count])]
            keys = np.concatenate([keys, frontier])
        wall, element = np.divmod(np.sort(keys), count)
        distance, beside = seen.at(wall, element)
        kept = np.abs(beside.mean(axis=1)) < seen.beyond[wall]
        wall, element = wall[kept], element[kept]
        area, direction = self._area[element], starts.direction[wall]
        # As they are seen along the direction's normal: of what turns away from it, less.
        size = np.sqrt(
            np.maximum(np.sum(area**2, axis=1) - np.sum(area * direction, axis=1) ** 2, 0.0)
        )
        lengths = np.array([line.length for line in starts.lines])[starts.line]
        width = np.bincount(wall, size, minlength=len(lengths)) / lengths
        return WallStrips(wall, element, distance[kept].min(axis=1), width)


class _Seen:
    """Where elements' corners lie, as seen from walls at lines."""

    def __init__(self, corners: FloatArray, starts: StripStarts) -> None:
        lines = starts.lines
        self.corners, self.direction, self.line = corners, starts.direction, starts.line
        self.beyond = np.array([line.beyond for line in lines])[starts.line]
        self._origin, self._tangent = (
            np.array([getattr(line, n) for line in lines]) for n in ("origin", "tangent")
        )
        # All lines' places in one rising row, line after line, as far apart as all that is there is
        # wide.
        self._apart = 4 * float(np.ptp(corners, axis=(0, 1)).max()) * np.sqrt(3)
        self._row = np.concatenate([line.places + k * self._apart for k, line in enumerate(lines)])
        self._middles = (self._row[1:] + self._row[:-1]) / 2

    def at(self, wall: IntArray, element: IntArray) -> tuple[FloatArray, FloatArray]:
        """(k, 4) distances of corners from the lines, and how far they lie beside the nearest node
        along these, m.
        """
        line = self.line[wall]
        arms = self.corners[element] - self._origin[line, None]
        along = np.einsum("nik,nk->ni", arms, self._tangent[line]) + (line * self._apart)[:, None]
        beside = along - self._row[np.searchsorted(self._middles, along)]
        return np.einsum("nik,nk->ni", arms, self.direction[wall]), beside
