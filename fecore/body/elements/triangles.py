"""Triangles, which users' meshes contain: of six nodes, and of three with assumed shears and sides
that bend.

Tri6 takes all strains at three points inside. Tri3 interpolates the shears of the middles of its
sides (MITC3: Lee and Bathe, Comput. Struct. 82, 2004); its membrane strain is constant. Sides that
bend as the rotations at their ends ask would make it better in its plane, and lock it in a twisted
thin shell (.02 of the deflection in place of .6).
"""

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.elements.shells import Halving, Rule, displacement_strains, surface

_CORNERS = np.array([[0.0, 0], [1, 0], [0, 1]])
_THREE = np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.full(3, 1 / 6)  # exact to the second degree
# Dunavant, Int. J. Numer. Methods Eng. 21, 1985: to the fourth
_A, _B = 0.445948490915965, 0.091576213509771
_SIX = (
    np.array(
        [[_A, _A], [1 - 2 * _A, _A], [_A, 1 - 2 * _A], [_B, _B], [1 - 2 * _B, _B], [_B, 1 - 2 * _B]]
    ),
    np.repeat([0.223381589678011, 0.109951743655322], 3) / 2,
)


def _inside(natural: FloatArray) -> FloatArray:
    """The nearest natural coordinates inside the triangle."""
    beyond = np.maximum(natural.sum(axis=1, keepdims=True) - 1, 0) / 2
    kept = np.clip(natural - beyond, 0, 1)
    return np.asarray(kept / np.maximum(kept.sum(axis=1, keepdims=True), 1))


class Tri6:
    """Six nodes: corners, then the middles of the sides from the first."""

    name, raised = "tri6", ""
    halving: Halving | None = Halving(
        [(0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0), (3, 4), (4, 5), (5, 3)],
        [
            *(
                [k, 3 + k, 3 + (k + 2) % 3, 6 + 2 * k, 12 + (k + 2) % 3, 7 + 2 * ((k + 2) % 3)]
                for k in range(3)
            ),
            [3, 4, 5, 12, 13, 14],
        ],
    )
    corners = np.vstack([_CORNERS, [[0.5, 0], [0.5, 0.5], [0, 0.5]]])
    sides: tuple[tuple[int, ...], ...] = ((0, 1, 3), (1, 2, 4), (2, 0, 5))

    @property
    def strain_rule(self) -> Rule:
        """Three points."""
        return _THREE

    @property
    def mass_rule(self) -> Rule:
        """Six points."""
        return _SIX

    def functions(self, natural: FloatArray) -> FloatArray:
        """(p, 6) quadratic shape functions."""
        r, s = natural.T
        t = 1 - r - s
        return np.column_stack(
            [t * (2 * t - 1), r * (2 * r - 1), s * (2 * s - 1), 4 * t * r, 4 * r * s, 4 * s * t]
        )

    def derivatives(self, natural: FloatArray) -> FloatArray:
        """(p, 2, 6) their derivatives."""
        r, s = natural.T
        t, none = 1 - r - s, np.zeros_like(r)
        by_r = np.column_stack([1 - 4 * t, 4 * r - 1, none, 4 * (t - r), 4 * s, -4 * s])
        by_s = np.column_stack([1 - 4 * t, none, 4 * s - 1, -4 * r, 4 * r, 4 * (t - s)])
        return np.stack([by_r, by_s], axis=1)

    def inside(self, natural: FloatArray) -> FloatArray:
        """(p, 2) the nearest natural coordinates inside the triangle."""
        return _inside(natural)

    def strains(self, x: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """All at three points."""
        return displacement_strains(self, x, axis)


class Tri3:
    """Three nodes, in order around the element."""

    name, raised = "tri3", "tri6"
    halving: Halving | None = None
    corners = _CORNERS
    sides: tuple[tuple[int, ...], ...] = ((0, 1), (1, 2), (2, 0))

    @property
    def strain_rule(self) -> Rule:
        """Three points."""
        return _THREE

    @property
    def mass_rule(self) -> Rule:
        """Three points."""
        return _THREE

    def functions(self, natural: FloatArray) -> FloatArray:
        """(p, 3) linear shape functions."""
        return np.column_stack([1 - natural.sum(axis=1), natural])

    def derivatives(self, natural: FloatArray) -> FloatArray:
        """(p, 2, 3) their derivatives."""
        return np.tile(np.array([[-1.0, 1, 0], [-1, 0, 1]]), (len(natural), 1, 1))

    def inside(self, natural: FloatArray) -> FloatArray:
        """(p, 2) the nearest natural coordinates inside the triangle."""
        return _inside(natural)

    def strains(self, x: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Membrane, bending, assumed shears, at three points."""
        natural, weights = self.strain_rule
        own = surface(self, x, natural, axis)
        tied = surface(self, x, _TRI6.corners[3:], axis).natural_shear()
        r, s = natural[:, 0, None, None], natural[:, 1, None, None]
        twist = (
            tied[:, None, 2, 1] - tied[:, None, 0, 0] - tied[:, None, 1, 1] + tied[:, None, 1, 0]
        )
        first, second = tied[:, None, 0, 0] + s * twist, tied[:, None, 2, 1] - r * twist
        shear = own.along_axes(np.stack([first, second], axis=2))
        rows = [own.membrane(), own.curvature(), shear]
        return np.concatenate(rows, axis=2), own.area * weights, own.N


_TRI6 = Tri6()
TRIANGLES = _TRI6, Tri3()
