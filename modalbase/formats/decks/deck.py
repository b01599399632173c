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
    x, y = deck.lines()
    i, j = np.indices((x.size, y.size))
    real = (i % 2) + (j % 2) < 2  # corners and sides
    number = np.where(real, np.cumsum(real.ravel()).reshape(real.shape), 0)
    nodes = np.column_stack([x[i[real]], y[j[real]], np.zeros(int(real.sum()))])
    corner = 2 * np.indices(((x.size - 1) // 2, (y.size - 1) // 2)).reshape(2, -1).T
    at = corner[:, None] + np.array((*CORNERS, *SIDES))
    return Mesh(nodes, number[at[..., 0], at[..., 1]])


def solids(deck: Deck) -> Mesh:
    """Quadratic bricks of twenty nodes, with nodes on the middle surface."""
    x, y = deck.lines()
    z = np.linspace(-deck.thickness / 2, deck.thickness / 2, 2 * THROUGH + 1)
    i, j, k = np.indices((x.size, y.size, z.size))
    real = (i % 2) + (j % 2) + (k % 2) < 2
    number = np.where(real, np.cumsum(real.ravel()).reshape(real.shape), 0)
    nodes = np.column_stack([x[i[real]], y[j[real]], z[k[real]]])
    corner = 2 * np.indices(((x.size - 1) // 2, (y.size - 1) // 2, THROUGH)).reshape(3, -1).T
    places = [
        (*one, level)
        for ring, level in ((CORNERS, 0), (CORNERS, 2), (SIDES, 0), (SIDES, 2), (CORNERS, 1))
        for one in ring
    ]
    at = corner[:, None] + np.array(places)
    return Mesh(nodes, number[at[..., 0], at[..., 1], at[..., 2]])


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
