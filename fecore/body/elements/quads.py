"""Quadrilaterals: of eight nodes with reduced integration, and of four with assumed shears and
sides that bend.

Quad8 is the serendipity element with 2 × 2 points for all strains (the family of Abaqus' S8R),
which avoids locking of shear and membrane and leaves no zero-energy mode that two elements can
share (Hughes, *The Finite Element Method*, section 5.3).

Quad4 interpolates the shears of the middles of its sides (MITC4: Dvorkin and Bathe, Eng. Comput. 1,
1984), and its sides bend in the surface as the rotations about the normal at their ends ask
(Allman, Comput. Struct. 19, 1984): it is Quad8 in the membrane, its mid-side nodes dependent on
the corners.
"""

from functools import cache

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.elements.shells import (
    Halving,
    Rule,
    bent_sides,
    displacement_strains,
    surface,
    with_middles,
)

_CORNERS: FloatArray = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


@cache
def gauss(order: int) -> tuple[FloatArray, FloatArray]:
    """(order², 2) Gauss points of the square and their (order²,) weights."""
    x, w = np.polynomial.legendre.leggauss(order)
    return np.array([(a, b) for b in x for a in x]), np.outer(w, w).ravel()


class Quad8:
    """Eight nodes: corners, then the middles of the sides from the first."""

    name, raised = "quad8", ""
    halving: Halving | None = Halving(
        [
            *((0, 4), (4, 1), (1, 5), (5, 2), (2, 6), (6, 3), (3, 7), (7, 0)),
            *((4, 6), (4, 16), (5, 16), (6, 16), (7, 16)),
        ],
        [
            [
                *(k, 4 + k, 16, 4 + (k + 3) % 4),
                *(8 + 2 * k, 17 + k, 17 + (k + 3) % 4, 9 + 2 * ((k + 3) % 4)),
            ]
            for k in range(4)
        ],
    )
    corners: FloatArray = np.vstack([_CORNERS, np.array([[0.0, -1], [1, 0], [0, 1], [-1, 0]])])
    sides: tuple[tuple[int, ...], ...] = ((0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7))

    @property
    def strain_rule(self) -> Rule:
        """2 × 2 points."""
        return gauss(2)

    @property
    def mass_rule(self) -> Rule:
        """3 × 3 points."""
        return gauss(3)

    def functions(self, natural: FloatArray) -> FloatArray:
        """(p, 8) serendipity shape functions."""
        xi, eta = natural[:, :1], natural[:, 1:]
        xn, en = self.corners.T
        corner = (1 + xi * xn) * (1 + eta * en) * (xi * xn + eta * en - 1) / 4
        along = (1 - xi**2) * (1 + eta * en) / 2
        across = (1 + xi * xn) * (1 - eta**2) / 2
        return np.asarray(np.where(xn == 0, along, np.where(en == 0, across, corner)))

    def derivatives(self, natural: FloatArray) -> FloatArray:
        """(p, 2, 8) their derivatives."""
        xi, eta = natural[:, :1], natural[:, 1:]
        xn, en = self.corners.T
        corner_xi = xn * (1 + eta * en) * (2 * xi * xn + eta * en) / 4
        corner_eta = en * (1 + xi * xn) * (xi * xn + 2 * eta * en) / 4
        by_xi = np.where(
            xn == 0, -xi * (1 + eta * en), np.where(en == 0, xn * (1 - eta**2) / 2, corner_xi)
        )
        by_eta = np.where(
            xn == 0, en * (1 - xi**2) / 2, np.where(en == 0, -eta * (1 + xi * xn), corner_eta)
        )
        return np.stack([by_xi, by_eta], axis=1)

    def inside(self, natural: FloatArray) -> FloatArray:
        """(p, 2) the nearest natural coordinates inside the square."""
        return np.clip(natural, -1, 1)

    def strains(self, x: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """All at 2 × 2 points."""
        return displacement_strains(self, x, axis)


class Quad4:
    """Four nodes, in order around the element."""

    name, raised = "quad4", "quad8"
    halving: Halving | None = None
    corners: FloatArray = _CORNERS
    sides: tuple[tuple[int, ...], ...] = ((0, 1), (1, 2), (2, 3), (3, 0))

    @property
    def strain_rule(self) -> Rule:
        """2 × 2 points."""
        return gauss(2)

    @property
    def mass_rule(self) -> Rule:
        """2 × 2 points."""
        return gauss(2)

    def functions(self, natural: FloatArray) -> FloatArray:
        """(p, 4) bilinear shape functions."""
        xn, en = self.corners.T
        return np.asarray((1 + natural[:, :1] * xn) * (1 + natural[:, 1:] * en) / 4)

    def derivatives(self, natural: FloatArray) -> FloatArray:
        """(p, 2, 4) their derivatives."""
        xn, en = self.corners.T
        return np.stack(
            [xn * (1 + natural[:, 1:] * en) / 4, en * (1 + natural[:, :1] * xn) / 4], axis=1
        )

    def inside(self, natural: FloatArray) -> FloatArray:
        """(p, 2) the nearest natural coordinates inside the square."""
        return np.clip(natural, -1, 1)

    def strains(self, x: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Membrane with bent sides, bending, assumed shears, at 2 × 2 points."""
        natural, weights = self.strain_rule
        own = surface(self, x, natural, axis)
        full = surface(_QUAD8, with_middles(self, x), natural, axis)
        membrane = bent_sides(self, full.membrane(), own, x)
        tied = surface(self, x, _TIES, axis).natural_shear()
        xi, eta = natural[:, 0, None, None], natural[:, 1, None, None]
        first = (1 - eta) / 2 * tied[:, None, 0, 0] + (1 + eta) / 2 * tied[:, None, 1, 0]
        second = (1 - xi) / 2 * tied[:, None, 2, 1] + (1 + xi) / 2 * tied[:, None, 3, 1]
        shear = own.along_axes(np.stack([first, second], axis=2))
        rows = [membrane, own.curvature(), shear]
        return np.concatenate(rows, axis=2), own.area * weights, own.N


_QUAD8 = Quad8()
_TIES = np.array([[0.0, -1], [0, 1], [-1, 0], [1, 0]])  # where γ of ξ is read (first two), and of η
QUADS = Quad8(), Quad4()
