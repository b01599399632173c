"""Timoshenko beams in space, of two nodes or three, straight or curved.

With the tangent t, a displacement u of the axis and a rotation θ, along axes (t, n₁, n₂) of the
section,

    (ε, γ₁, γ₂) = u' − θ × t,     (τ, κ₁, κ₂) = θ'

which vanish in any rigid motion. One Gauss point with two nodes and two with three avoid shear
locking; the mass takes one more. The strain of a fibre at r = y n₁ + z n₂ is ε + z κ₁ − y κ₂.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.elements.shells import Halving
from fecore.errors import InputError


@dataclass(frozen=True)
class Beam:
    """A beam of two nodes, or of three with the middle one last."""

    count: int

    @property
    def name(self) -> str:
        """By which blocks of a mesh have it."""
        return f"beam{self.count}"

    @property
    def raised(self) -> str:
        """Name of the element of one order higher; empty where this is quadratic."""
        return "beam3" if self.count == 2 else ""

    @property
    def halving(self) -> Halving | None:
        """Its parts on a finer mesh; None of a linear one."""
        return None if self.raised else Halving([(0, 2), (2, 1)], [[0, 2, 3], [2, 1, 4]])

    @property
    def corners(self) -> FloatArray:
        """(n, 1) natural coordinates of the nodes: the ends, then the middle."""
        return np.array([[-1.0], [1], [0]])[: self.count]

    @property
    def sides(self) -> tuple[tuple[int, ...], ...]:
        """Its ends, and its middle where it has one."""
        return (tuple(range(self.count)),)

    def functions(self, natural: FloatArray) -> FloatArray:
        """(p, n) shape functions at (p,) natural coordinates."""
        x = natural
        if self.count == 2:
            return np.column_stack([(1 - x) / 2, (1 + x) / 2])
        return np.column_stack([x * (x - 1) / 2, x * (x + 1) / 2, 1 - x**2])

    def derivatives(self, natural: FloatArray) -> FloatArray:
        """(p, n) their derivatives."""
        x = natural
        if self.count == 2:
            return np.column_stack([np.full_like(x, -0.5), np.full_like(x, 0.5)])
        return np.column_stack([x - 0.5, x + 0.5, -2 * x])

    def strains(self, x: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(e, p, 6, n, 6) strains of (e, n, 3) elements, (e, p) lengths of the points, (p, n) shape
        functions.

        Args:
            x: nodes.
            axis: (e, 3) or (3,) the direction whose projection across the beam is n₁.
        """
        N, along, frame, length = self._geometry(x, axis, self.count - 1)
        rows = np.zeros((*length.shape, 6, self.count, 6))
        by = along[:, :, None, :, None]
        rows[:, :, :3, :, :3] = by * frame[:, :, :, None]
        # a · (θ × t) = θ · (t × a)
        rows[:, :, :3, :, 3:] = (
            -N[None, :, None, :, None] * np.cross(frame[:, :, :1], frame)[:, :, :, None]
        )
        rows[:, :, 3:, :, 3:] = by * frame[:, :, :, None]
        return rows, length, N

    def motions(self, x: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(e, p, 6, n, 6) u and θ along the axes, (e, p) lengths of the points, (p, n) shape
        functions.
        """
        N, _, frame, length = self._geometry(x, axis, self.count)
        rows = np.zeros((*length.shape, 6, self.count, 6))
        rows[:, :, :3, :, :3] = N[None, :, None, :, None] * frame[:, :, :, None]
        rows[:, :, 3:, :, 3:] = rows[:, :, :3, :, :3]
        return rows, length, N

    def _geometry(
        self, x: FloatArray, axis: FloatArray, order: int
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """N, its derivatives along the beam, (e, p, 3, 3) axes, and lengths of the points."""
        natural, weights = np.polynomial.legendre.leggauss(order)
        N, by = self.functions(natural), self.derivatives(natural)
        tangent = np.einsum("pn,enk->epk", by, x)
        length = np.linalg.norm(tangent, axis=-1)
        if not np.all(length > 0):
            raise InputError("mesh", "a beam has no length")
        t = tangent / length[..., None]
        across = np.broadcast_to(axis, (len(x), 3))[:, None]
        across = across - np.sum(across * t, axis=-1, keepdims=True) * t
        size = np.linalg.norm(across, axis=-1, keepdims=True)
        if not np.all(size > 0):
            raise InputError("section.axis", "is along the beam; give a direction across it")
        n1 = across / size
        frame = np.stack([t, n1, np.cross(t, n1)], axis=2)
        return N, by / length[..., None], frame, length * weights


def fibre(place: FloatArray) -> FloatArray:
    """(…, 3, 6) motion u + θ × r of the fibre at (…, 2) places (y, z) by the rows of u and θ, or
    its strains by those of a beam.
    """
    y, z = place[..., 0], place[..., 1]
    rows = np.zeros((*place.shape[:-1], 3, 6))
    rows[..., 0, 0] = rows[..., 1, 1] = rows[..., 2, 2] = 1
    rows[..., 0, 4], rows[..., 0, 5] = z, -y
    rows[..., 1, 3], rows[..., 2, 3] = -z, y
    return rows
