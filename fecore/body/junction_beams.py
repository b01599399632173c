"""Junction beams, along lines where walls meet: what each wall adds there, by its moduli
along the line and its density.

A wall's moduli are those at its line's angle from axis 1. They are taken between those at a few
angles, the coarser the less its corner turns and so the less they matter: a curve meshed by any
number of lines has the same few coefficients.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.affine import distinct
from fecore.body.elements.beams import fibre
from fecore.body.laminate import SHEAR_CORRECTION
from fecore.body.operators import Operators

_PARTS = np.array([2, 4, 12, 36, 180])  # into which the half circle is parted
_FINE = 90  # parts at a right angle at least; the error goes with their square, and with the turn
_SNAP = 3  # decimals of a part
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
HEIGHTS = _POINTS
"""Of Gauss points in a wall by half its thickness."""


@dataclass(frozen=True)
class JunctionBeams:
    """Beams along lines, and what walls add to each."""

    nodes: IntArray  # (e, 2) or (e, 3) their nodes
    axes: FloatArray  # (e, 3) n₁ of their sections
    beam: IntArray  # (w,) of each wall at each beam, which beam
    rank: IntArray  # (w,) number of its set among the mesh's
    angle: FloatArray  # (w,) from its axis 1 to the line, rad
    turn: FloatArray  # (w,) how much of a right angle the corner is
    # (w, 3, 6, 6) matrices by the set's E and G along the line and G across, on the strains of a
    # beam
    stiffness: FloatArray
    # (w, 3, 6, 6) by the set's density, on its motions: of motion along the line, and across it
    # nearer to y, and to z
    mass: FloatArray

    @cached_property
    def by_set(self) -> list[tuple[int, int, IntArray, FloatArray, FloatArray]]:
        """Rank of a set, angle in degrees, (k,) beams and their (k, 3, 6, 6) stiffness and mass by
        what it is made of.
        """
        which, degrees, share = between(self.angle, self.turn)
        keys, place = np.unique(
            np.column_stack([self.rank[which], degrees, self.beam[which]]),
            axis=0,
            return_inverse=True,
        )
        sums = np.zeros((2, len(keys), 3, 6, 6))
        for total, own in zip(sums, (self.stiffness, self.mass), strict=True):
            np.add.at(total, place.ravel(), share[:, None, None, None] * own[which])
        sums_by_set = []
        for rank, angle in np.unique(keys[:, :2], axis=0).tolist():
            own = (keys[:, 0] == rank) & (keys[:, 1] == angle)
            sums_by_set.append((rank, angle, keys[own, 2], sums[0, own], sums[1, own]))
        return sums_by_set


def between(angle: FloatArray, turn: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Numbers of (n,) angles in rad, angles in degrees that they lie between, and the share of each
    in them.
    """
    least = np.searchsorted(_PARTS, _FINE * np.sqrt(turn) * (1 - 1e-9))
    parts = _PARTS[np.minimum(least, len(_PARTS) - 1)]
    place = np.round(angle * parts / np.pi, _SNAP)
    low = np.floor(place).astype(np.int64)
    share = np.concatenate([1 - (place - low), place - low])
    degrees = np.concatenate([low, low + 1]) % np.tile(parts, 2) * np.tile(180 // parts, 2)
    used = share > 0
    return np.tile(np.arange(len(angle)), 2)[used], degrees[used], share[used]


def weighed(
    operators: Operators, nodes: IntArray, elements: IntArray, forms: FloatArray
) -> Operators:
    """Operators of some elements whose squares are those of (k, r, r) forms, positive semidefinite,
    of theirs.
    """
    roots = np.einsum(
        "kab,kpbnd->kpand", _roots(forms), operators.rows[operators.which[elements]], optimize=True
    )
    chosen, which = distinct(roots)
    return Operators(nodes, which, roots[chosen])


def _roots(forms: FloatArray) -> FloatArray:
    """(k, r, r) R with RᵀR each form; lengths and turns apart by their own sizes."""
    size = np.sqrt(np.diagonal(forms, axis1=1, axis2=2))
    unit = np.where(size > 0, size, 1.0)
    value, vectors = np.linalg.eigh(forms / unit[:, :, None] / unit[:, None])
    root = (vectors * np.sqrt(np.maximum(value, 0.0))[:, None]) @ vectors.transpose(0, 2, 1)
    return np.asarray(root * size[:, None])


def wall_matrices(
    across: FloatArray,
    thickness: FloatArray,
    begin: FloatArray,
    whole: FloatArray,
    truly: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass of walls at their lines, as `Bead` has them, torsion of the line apart.

    Args:
        across: (w, 2) directions of the walls by n₁ and n₂.
        thickness: (w,) m.
        begin: (w,) where their elements begin, m from the line.
        whole: (w,) where these have all that is the wall's.
        truly: (w, 3) where the walls begin at `HEIGHTS`.
    """
    up = np.stack([-across[:, 1], across[:, 0]], axis=1)
    half = np.maximum(whole[:, None] - truly, 0) / 2
    along = truly[..., None] + half[..., None] * (1 + _POINTS)
    zeta = HEIGHTS * thickness[:, None] / 2
    places = along[..., None] * across[:, None, None] + zeta[..., None, None] * up[:, None, None]
    weight = _WEIGHTS[:, None] * thickness[:, None, None] / 2 * half[..., None] * _WEIGHTS
    rows = fibre(places)
    mass = np.einsum("wgh,wghra,wghrb->wrab", weight, rows, rows, optimize=True)
    stiffness = np.zeros_like(mass)
    stiffness[:, 0] = mass[:, 0]
    area = (thickness * begin)[:, None, None]
    stiffness[:, 1, 1:3, 1:3] = area * across[:, :, None] * across[:, None]
    stiffness[:, 1, 3, 3] = thickness**3 * begin / 3
    stiffness[:, 2, 1:3, 1:3] = SHEAR_CORRECTION * area * up[:, :, None] * up[:, None]
    return stiffness, mass


def joint_prefix(name: str, degrees: int) -> str:
    """Prefix of the coefficients of a set's beams along lines at an angle, in degrees, from its
    axis 1.
    """
    return f"{name}.joint at {degrees}°" if degrees else f"{name}.joint"
