"""The strip of a wall in front of a line: its elements from the line on, found from side to side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.junctions import Sides, sides_of
from fecore.body.mesh import SHELLS, Mesh

_PROGRESS = 1e-6  # cosine of a step's direction to the wall's above which it leads on, and not along the line


@dataclass(frozen=True)
class Line:
    """A straight line of nodes."""

    origin: FloatArray  # (3,) m
    tangent: FloatArray  # (3,)
    places: FloatArray  # (n,) of its nodes along the tangent, rising
    length: float  # of its edges, m
    beyond: float  # how far an element's middle may lie beside the nearest node, m


@dataclass(frozen=True)
class Strip:
    """Elements of a wall in front of a line."""

    elements: IntArray  # (e,) numbers among all blocks'
    distance: FloatArray  # (e, 4) of their corners from the line, m; a triangle's first stands twice
    width: float  # m, as far as it was followed


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
        """Neighbours over edges of two stacks, of which one goes on as the other; in stacks, layer by layer."""
        names = [block.set for block in self.mesh.blocks]
        number = np.array([names.index(name) for name in names])[sides.places[:, 0]]
        _, edge = np.unique(sides.ends, axis=0, return_inverse=True)
        edge = edge.ravel()
        stacks = np.bincount(np.unique(np.column_stack([edge, sides.same]), axis=0)[:, 0])
        order = np.lexsort((sides.element, number, sides.same, edge))
        starts = np.any(np.diff(np.column_stack([edge, sides.same, number])[order], axis=0, prepend=-1) != 0, axis=1)
        at = np.arange(len(order))
        layer = np.empty_like(at)
        layer[order] = at - np.maximum.accumulate(np.where(starts, at, 0))
        order = np.lexsort((sides.same, layer, number, edge))
        keys = np.column_stack([edge, number, layer])[order]
        alike = np.flatnonzero(np.all(keys[1:] == keys[:-1], axis=1) & (stacks[keys[1:, 0]] == 2))
        one, other = order[alike], order[alike + 1]
        goes_on = np.einsum("ij,ij->i", sides.away[one], sides.away[other]) < 0
        for here, there in ((one[goes_on], other[goes_on]), (other[goes_on], one[goes_on])):
            place = sides.element[here], sides.places[here, 2]
            self._next[place], self._onward[place] = sides.element[there], sides.away[there]

    def strip(self, line: Line, first: Sequence[int], away: FloatArray, limit: float) -> Strip:
        """From elements at a line, along a direction, as far as elements begin nearer than a limit in m."""
        elements = frontier = np.unique(np.array(first, dtype=np.int64))
        while frontier.size:
            following = self._next[frontier].ravel()
            leads = (following >= 0) & (self._onward[frontier].reshape(-1, 3) @ away > _PROGRESS)
            frontier = np.setdiff1d(following[leads], elements)
            frontier = frontier[self._distance(line, frontier, away).min(axis=1, initial=np.inf) < limit]
            elements = np.concatenate([elements, frontier])
        arms = self.mesh.nodes[self._corners[elements]] - line.origin
        along = arms @ line.tangent
        middles = (line.places[1:] + line.places[:-1]) / 2
        beside = (along - line.places[np.searchsorted(middles, along)]).mean(axis=1)
        kept = np.abs(beside) < line.beyond
        area = self._area[elements[kept]]
        # As they are seen along the direction's normal: of what turns away from it, less.
        size = np.sqrt(np.maximum(np.sum(area**2, axis=1) - (area @ away) ** 2, 0.0)).sum()
        return Strip(elements[kept], (arms @ away)[kept], float(size) / line.length)

    def _distance(self, line: Line, elements: IntArray, away: FloatArray) -> FloatArray:
        return np.asarray((self.mesh.nodes[self._corners[elements]] - line.origin) @ away)
