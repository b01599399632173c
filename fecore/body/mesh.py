"""Structured meshes of 8-node serendipity quadrilaterals on a rectangle, and where in them a point lies.

The rectangle spans x from 0 to `length` and y from -width/2 to width/2: the specimen's own axes. Element nodes are
numbered corners first, counter-clockwise from (-1, -1), then mid-sides from the bottom edge, as in most texts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.errors import InputError, OffSpecimenError

BEYOND_EDGE = 0.02
"""Share of a dimension by which a point may lie beyond the edge and count as on it: tapes differ from callipers."""

EDGE_ROUNDING = 1e-6
"""Share of a dimension by which rounding moves a point."""


def off_specimen(points: FloatArray, length: float, width: float) -> BoolArray:
    """Which of (p, 2) points lie off a specimen of these dimensions, further than `BEYOND_EDGE`."""
    share = points / np.array([length, width]) + np.array([0, 0.5])  # 0 … 1 on the specimen
    off: BoolArray = np.any((share < -BEYOND_EDGE) | (share > 1 + BEYOND_EDGE), axis=1)
    return off


@dataclass(frozen=True)
class RectangleMesh:
    """`nx` by `ny` equal elements on a rectangle.

    Attributes:
        length, width: m.
        nx, ny: number of elements along x and y.
        lines: (nx + 1,) x of the lines between columns of elements, m; equally spaced unless breaks were asked for.
        nodes: (n, 2) node coordinates, m.
        elements: (nx·ny, 8) node numbers of each element; element j·nx + i is column i of row j.
    """

    length: float
    width: float
    nx: int
    ny: int
    nodes: FloatArray
    elements: IntArray
    lines: FloatArray

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Element in which each point lies, and its natural coordinates there; of one just beyond an edge, those on the edge.

        Args:
            points: (p, 2) coordinates, m.

        Returns:
            (p,) element numbers and (p, 2) natural coordinates in [-1, 1].

        Raises:
            OffSpecimenError: a point lies off the specimen by more than `BEYOND_EDGE`.
        """
        low, high = np.array([0, -self.width / 2]), np.array([self.length, self.width / 2])
        outside = off_specimen(points, self.length, self.width)
        if outside.any():
            index = int(np.flatnonzero(outside)[0])
            x, y = points[index]
            raise OffSpecimenError(
                index,
                f"({x:g}, {y:g}) m lies off the specimen, which spans x 0 … {self.length:g} m, "
                f"y {low[1]:g} … {high[1]:g} m",
            )
        counts = np.array([self.nx, self.ny])
        scaled = (np.clip(points, low, high) - low) / (high - low) * counts
        scaled[:, 0] = np.interp(np.clip(points[:, 0], *self.lines[[0, -1]]), self.lines, np.arange(self.nx + 1))
        cell = np.minimum(scaled.astype(np.int64), counts - 1)
        return cell[:, 1] * self.nx + cell[:, 0], 2 * (scaled - cell) - 1

    def edge_quadrature(self, edge: str) -> tuple[FloatArray, FloatArray]:
        """(p, 2) Gauss points along the edge `start`, `end`, `lower` or `upper`, and their (p,) weights in m."""
        x, w = np.polynomial.legendre.leggauss(3)
        along_y = edge in ("start", "end")
        lines = np.linspace(0, self.width, self.ny + 1) if along_y else self.lines
        size, steps = lines[-1], np.diff(lines)
        places = (lines[:-1, None] + steps[:, None] * (x + 1) / 2).ravel()
        weights = (steps[:, None] * w / 2).ravel()
        if along_y:
            return np.column_stack([np.full_like(places, self.length * (edge == "end")), places - size / 2]), weights
        return np.column_stack([places, np.full_like(places, self.width * ((edge == "upper") - 0.5))]), weights

    def nodes_at_x(self, x: float) -> IntArray:
        """Numbers of the nodes on the line at `x`."""
        return np.flatnonzero(np.abs(self.nodes[:, 0] - x) < 1e-9 * self.length)

    def nodes_at_y(self, y: float) -> IntArray:
        """Numbers of the nodes on the line at `y`."""
        return np.flatnonzero(np.abs(self.nodes[:, 1] - y) < 1e-9 * self.length)


def rectangle(length: float, width: float, nx: int = 40, ny: int = 4, breaks: Sequence[float] = ()) -> RectangleMesh:
    """Mesh a rectangle with nx × ny equal 8-node elements; with lines between elements at some x where `breaks` are given,
    which then are as equal as these allow, and at least nx.

    Raises:
        InputError: a dimension or a number of elements is not positive.
    """
    for name, size in (("length_m", length), ("width_m", width)):
        if not (np.isfinite(size) and size > 0):
            raise InputError(f"geometry.{name}", f"is {size}, expected a positive number of metres")
    for name, divisions in (("nx", nx), ("ny", ny)):
        if divisions < 1:
            raise InputError(f"mesh.{name}", f"is {divisions}, expected at least one element")
    lines = _lines(length, nx, breaks)
    nx = lines.size - 1
    halves = np.interp(np.arange(2 * nx + 1) / 2, np.arange(nx + 1), lines)
    column, row = np.meshgrid(np.arange(2 * nx + 1), np.arange(2 * ny + 1))
    real = (column % 2 == 0) | (row % 2 == 0)  # the serendipity element has no centre node
    # Numbered along the side with fewer elements first, which keeps the matrices' band narrow.
    order: Literal["F", "C"] = "F" if ny <= nx else "C"
    number = np.where(real, np.cumsum(real.ravel(order)).reshape(real.shape, order=order) - 1, -1)
    nodes = np.empty((int(real.sum()), 2))
    nodes[number[real]] = np.column_stack([halves[column[real]], row[real] * width / (2 * ny) - width / 2])
    first_column, first_row = (start.ravel() for start in np.meshgrid(2 * np.arange(nx), 2 * np.arange(ny)))
    corners_and_sides = ((0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0))
    elements = np.column_stack([number[first_row + dy, first_column + dx] for dy, dx in corners_and_sides])
    return RectangleMesh(length, width, nx, ny, nodes, elements, lines=lines)


def _lines(length: float, nx: int, breaks: Sequence[float]) -> FloatArray:
    """(n + 1,) x of the lines between columns of elements."""
    if not breaks:
        return np.linspace(0, length, nx + 1)
    ends = np.array([0.0, *breaks, length])
    counts = np.ceil(np.diff(ends) / length * nx - 1e-9).astype(np.int64)
    parts = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True)]
    return np.concatenate([*parts, [length]])
