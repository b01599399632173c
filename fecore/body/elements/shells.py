"""What a shell element is: its shape functions, and its strains at the points where it is
integrated.

An element knows no section: it gives rows of eight strains (ε₁₁ ε₂₂ γ₁₂, κ₁₁ κ₂₂ κ₁₂, γ₁₃ γ₂₃) over
its degrees of freedom, and the area that each of its points stands for, so that ∫BᵀCB dA is a sum
of products. The drilling has points of its own.
"""

from typing import NamedTuple, Protocol

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.elements.surface import Surface, normals

Rule = tuple[FloatArray, FloatArray]
"""(p, 2) points in natural coordinates and their (p,) weights."""


class Halving(NamedTuple):
    """How a quadratic element is halved."""

    amid: list[tuple[int, int]]  # new points, each amid two of its nodes, numbered after these
    parts: list[list[int]]  # nodes of its parts by these


class Shell(Protocol):
    """A shell element; natural coordinates are (p, 2)."""

    @property
    def name(self) -> str:
        """By which blocks of a mesh have it."""
        ...

    @property
    def raised(self) -> str:
        """Name of the element of one order higher; empty where this is quadratic."""
        ...

    @property
    def halving(self) -> Halving | None:
        """Its parts on a finer mesh; None of a linear one."""
        ...

    @property
    def corners(self) -> FloatArray:
        """(n, 2) natural coordinates of the nodes: corners first, in order around the element, then
        sides.
        """
        ...

    @property
    def sides(self) -> tuple[tuple[int, ...], ...]:
        """Nodes of each side, its ends first."""
        ...

    @property
    def strain_rule(self) -> Rule:
        """Points and weights of the strains."""
        ...

    @property
    def mass_rule(self) -> Rule:
        """Points and weights that integrate products of two shape functions."""
        ...

    def functions(self, natural: FloatArray) -> FloatArray:
        """(p, n) shape functions."""
        ...

    def derivatives(self, natural: FloatArray) -> FloatArray:
        """(p, 2, n) their derivatives."""
        ...

    def inside(self, natural: FloatArray) -> FloatArray:
        """(p, 2) the nearest natural coordinates inside the element."""
        ...

    def strains(self, x: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(e, p, 8, n, 6) strains of (e, n, 3) elements, (e, p) areas of the points, and their (p,
        n) shape functions.
        """
        ...


def surface(shell: Shell, x: FloatArray, natural: FloatArray, axis: FloatArray) -> Surface:
    """An element's surface at natural points, with its own normals at the nodes as directors."""
    directors = normals(x, shell.derivatives(shell.corners))
    return Surface.at(x, shell.functions(natural), shell.derivatives(natural), directors, axis)


def drilling(
    shell: Shell, x: FloatArray, axis: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(e, p, 1, n, 6) rotation about the normal beyond that of the surface, (e, p) areas and (p, n)
    shape functions.

    At the points of the mass: at fewer, the rotations about the normal could move between them.
    """
    natural, weights = shell.mass_rule
    own = surface(shell, x, natural, axis)
    return own.drilling(), own.area * weights, own.N


def displacement_strains(
    shell: Shell, x: FloatArray, axis: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Strains of the interpolated motion itself, with no assumption."""
    natural, weights = shell.strain_rule
    geometry = surface(shell, x, natural, axis)
    return (
        np.concatenate([geometry.membrane(), geometry.curvature(), geometry.shear()], axis=2),
        geometry.area * weights,
        geometry.N,
    )


def bent_sides(plain: Shell, rows: FloatArray, own: Surface, x: FloatArray) -> FloatArray:
    """Rows over (e, n, 3) corners alone of rows by displacements, of an element with mid-side
    nodes, as its sides bend.

    In the surface a side from i to j is a parabola (Allman 1984): u_m = ½(u_i + u_j) + ⅛ (ω_i −
    ω_j) n × (x_j − x_i), ω = θ · n.
    """
    n = x.shape[1]
    bent = np.array(rows[..., :n, :])
    for m, (i, j) in enumerate(plain.sides, start=n):
        normal = own.directors[:, i] + own.directors[:, j]
        normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        bow = np.cross(normal, x[:, j] - x[:, i]) / 8
        middle = rows[..., m, :3]
        turn = np.einsum("eprk,ek->epr", middle, bow)[..., None] * normal[:, None, None]
        bent[..., i, :3] += middle / 2
        bent[..., j, :3] += middle / 2
        bent[..., i, 3:] += turn
        bent[..., j, 3:] -= turn
    return bent


def with_middles(plain: Shell, x: FloatArray) -> FloatArray:
    """(e, n + sides, 3) nodes of elements with a node amid each side too."""
    middles = [(x[:, i] + x[:, j]) / 2 for i, j in plain.sides]
    return np.concatenate([x, np.stack(middles, axis=1)], axis=1)
