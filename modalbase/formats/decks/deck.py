"""What a deck says, and the meshes that it is written on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from modalbase.formats.types import FloatArray

IntArray = NDArray[np.int64]

ALONG, ACROSS, THROUGH = 60, 6, 2
"""Quadratic elements along the length of a strip, at least across its width, and through its thickness."""

MOST_ACROSS = 30
ON_PLANE = 1e-9
"""Nearer than this, in lengths, a node lies on a plane."""


@dataclass(frozen=True)
class Mass:
    """A point mass in kg at (x, y) in m on the middle surface."""

    x: float
    y: float
    mass: float


@dataclass(frozen=True)
class Deck:
    """A strip with its material: x along the length from the clamped end, y from −b/2 to b/2, z out of plane; SI.

    Attributes:
        length, width, thickness: m.
        moduli: Ex, Ey, Gxy, Gxz, Gyz in Pa.
        nu_xy: Poisson's ratio of a contraction along y under stress along x.
        density: kg/m³.
        boundary: `cantilever`, `free` or `simply_supported`.
        modes: how many are asked for.
        rayleigh: ALPHA in 1/s and BETA in s of C = ALPHA M + BETA K; None where the damping has another law.
        masses: what it carries.
        remarks: lines that the deck begins with, as comments.
    """

    length: float
    width: float
    thickness: float
    moduli: tuple[float, float, float, float, float]
    nu_xy: float
    density: float
    boundary: str
    modes: int
    rayleigh: tuple[float, float] | None = None
    masses: tuple[Mass, ...] = ()
    remarks: tuple[str, ...] = field(default=())

    @property
    def divisions(self) -> tuple[int, int]:
        """Elements along the length and across the width, of about equal sides on a plate."""
        return ALONG, int(np.clip(round(ALONG * self.width / self.length), ACROSS, MOST_ACROSS))

    def lines(self) -> tuple[FloatArray, FloatArray]:
        """Coordinates of the lines of half elements along x and y; corner lines pass through the point masses."""
        nx, ny = self.divisions
        x = _through(np.linspace(0, self.length, nx + 1), [mass.x for mass in self.masses])
        y = _through(np.linspace(-self.width / 2, self.width / 2, ny + 1), [mass.y for mass in self.masses])
        return _halved(x), _halved(y)


@dataclass(frozen=True)
class Mesh:
    """Nodes and elements, numbered from 1.

    Attributes:
        nodes: (n, 3) coordinates, m.
        elements: (m, k) nodes of each element, in the order that CalculiX and Abaqus have.
    """

    nodes: FloatArray
    elements: IntArray

    def at(self, axis: int, value: float) -> IntArray:
        """Numbers of the nodes where a coordinate has a value."""
        close = np.abs(self.nodes[:, axis] - value) < ON_PLANE * np.ptp(self.nodes[:, 0])
        return np.flatnonzero(close) + 1

    def nearest(self, x: float, y: float) -> int:
        """The node of the middle surface next to a place."""
        return int(np.argmin(np.linalg.norm(self.nodes - [x, y, 0.0], axis=1))) + 1


CORNERS = ((0, 0), (2, 0), (2, 2), (0, 2))
SIDES = ((1, 0), (2, 1), (1, 2), (0, 1))


def shells(deck: Deck) -> Mesh:
    """Quadratic shells of eight nodes on the middle surface."""
    return _quadratic((*deck.lines(), np.zeros(1)), [(*one, 0) for one in (*CORNERS, *SIDES)])


def solids(deck: Deck) -> Mesh:
    """Quadratic bricks of twenty nodes, with nodes on the middle surface."""
    z = np.linspace(-deck.thickness / 2, deck.thickness / 2, 2 * THROUGH + 1)
    rings = ((CORNERS, 0), (CORNERS, 2), (SIDES, 0), (SIDES, 2), (CORNERS, 1))
    return _quadratic((*deck.lines(), z), [(*one, level) for ring, level in rings for one in ring])


def _quadratic(lines: tuple[FloatArray, FloatArray, FloatArray], places: list[tuple[int, int, int]]) -> Mesh:
    """Elements on a grid of lines, of which every second one passes through their corners.

    Args:
        lines: along x, y and z.
        places: of an element's nodes, in lines from its first corner.
    """
    at = np.indices([line.size for line in lines])
    real = (at % 2).sum(axis=0) < 2  # corners and the middles of sides
    number = np.where(real, np.cumsum(real.ravel()).reshape(real.shape), 0)
    nodes = np.column_stack([line[own[real]] for line, own in zip(lines, at, strict=True)])
    corners = 2 * np.indices([max(line.size // 2, 1) for line in lines]).reshape(3, -1).T
    i, j, k = np.moveaxis(corners[:, None] + np.array(places), -1, 0)
    return Mesh(nodes, number[i, j, k])


def _through(lines: FloatArray, places: list[float]) -> FloatArray:
    """Lines of which the nearest has moved to each place; the outermost stay."""
    moved = lines.copy()
    for place in places:
        nearest = int(np.argmin(np.abs(lines - place)))
        if 0 < nearest < lines.size - 1:
            moved[nearest] = place
    return moved


def _halved(lines: FloatArray) -> FloatArray:
    halves = np.empty(2 * lines.size - 1)
    halves[::2], halves[1::2] = lines, (lines[1:] + lines[:-1]) / 2
    return halves
