"""Eight-node serendipity plate element with first-order shear deformation (the family of Abaqus' S8R).

Dofs a node: u, v, w, θx, θy, with u(z) = u + z θy and v(z) = v - z θx. Membrane strains, curvatures, transverse shears:

    εx = ∂u/∂x,    εy = ∂v/∂y,     γxy = ∂u/∂y + ∂v/∂x
    κx = ∂θy/∂x,   κy = -∂θx/∂y,   κxy = ∂θy/∂y - ∂θx/∂x,   γxz = ∂w/∂x + θy,   γyz = ∂w/∂y - θx

A bending element has w, θx, θy and the last five strains alone.

The stiffness is integrated with 2×2 Gauss points, which avoids shear locking and, with eight nodes, leaves no spurious
zero-energy mode that two elements can share (Hughes, *The Finite Element Method*, section 5.3); the mass in full, with
3×3. Stiffness is linear in the section's coefficients, so the element returns one matrix a coefficient, each the
derivative of the element stiffness by that coefficient.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fecore.arrays import FloatArray, IntArray

DISPLACEMENTS = ("u", "v", "w", "rx", "ry")
"""All dofs of a node; a bending element has the last three."""

_VOIGT = {"11": (0, 0), "12": (0, 1), "22": (1, 1), "66": (2, 2), "16": (0, 2), "26": (1, 2)}
_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_NODES = np.vstack([_CORNERS, [[0, -1], [1, 0], [0, 1], [-1, 0]]]).astype(float)


def shape_functions(natural: FloatArray) -> FloatArray:
    """(p, 8) serendipity shape functions at (p, 2) natural coordinates."""
    xi, eta = natural[:, :1], natural[:, 1:]
    xn, en = _NODES[:, 0], _NODES[:, 1]
    corner = (1 + xi * xn) * (1 + eta * en) * (xi * xn + eta * en - 1) / 4
    on_horizontal = (1 - xi**2) * (1 + eta * en) / 2
    on_vertical = (1 + xi * xn) * (1 - eta**2) / 2
    functions: FloatArray = np.where(xn == 0, on_horizontal, np.where(en == 0, on_vertical, corner))
    return functions


def shape_function_derivatives(natural: FloatArray) -> FloatArray:
    """(p, 2, 8) derivatives of the shape functions by the natural coordinates."""
    xi, eta = natural[:, :1], natural[:, 1:]
    xn, en = _NODES[:, 0], _NODES[:, 1]
    corner_xi = xn * (1 + eta * en) * (2 * xi * xn + eta * en) / 4
    corner_eta = en * (1 + xi * xn) * (xi * xn + 2 * eta * en) / 4
    by_xi = np.where(xn == 0, -xi * (1 + eta * en), np.where(en == 0, xn * (1 - eta**2) / 2, corner_xi))
    by_eta = np.where(xn == 0, en * (1 - xi**2) / 2, np.where(en == 0, -eta * (1 + xi * xn), corner_eta))
    return np.stack([by_xi, by_eta], axis=1)


@cache
def gauss(order: int) -> tuple[FloatArray, FloatArray]:
    """(order², 2) Gauss points of the square and their (order²,) weights."""
    x, w = np.polynomial.legendre.leggauss(order)
    points = np.array([(a, b) for b in x for a in x])
    return points, np.outer(w, w).ravel()


@dataclass(frozen=True)
class Shell8:
    """The element with membrane dofs, or for bending alone.

    Attributes:
        membrane: whether u and v are among the dofs.
    """

    membrane: bool = False

    @property
    def displacements(self) -> tuple[str, ...]:
        """Names of the dofs of a node."""
        return DISPLACEMENTS if self.membrane else DISPLACEMENTS[2:]

    @property
    def terms(self) -> tuple[str, ...]:
        """Section coefficients in the order of the stiffness terms: (A11 … A26, B11 … B26,) D11 … D26, S55, S44, S45."""
        sets = "ABD" if self.membrane else "D"
        return (*(letter + index for letter in sets for index in _VOIGT), "S55", "S44", "S45")

    @property
    def mass_terms_names(self) -> tuple[str, ...]:
        """Section inertias in the order of the mass terms, one for each dof, so that dofs can be scaled each by itself; in
        bending alone I0 is that of w.
        """
        return ("I0u", "I0v", "I0", "I1u", "I1v", "I2rx", "I2ry") if self.membrane else ("I0", "I2rx", "I2ry")

    @property
    def blocks(self) -> tuple[IntArray, ...]:
        """Where the coefficients stand in the section's stiffness: [[A, B], [B, D]] or D, and S."""
        at = {name: number for number, name in enumerate(self.terms)}

        def square(letter: str) -> IntArray:
            return np.array([[at[letter + index] for index in row] for row in _SYMMETRIC])

        bending = square("D")
        if self.membrane:
            bending = np.block([[square("A"), square("B")], [square("B"), bending]])
        return bending, np.array([[at["S55"], at["S45"]], [at["S45"], at["S44"]]])

    @property
    def mass_blocks(self) -> tuple[IntArray, ...]:
        """Where the inertias stand in the mass: I0 and I2, coupled by I1 with membrane dofs."""
        if not self.membrane:
            return tuple(np.array([[k]]) for k in range(3))
        return np.array([[0, 3], [3, 6]]), np.array([[1, 4], [4, 5]]), np.array([[2]])

    def _pairs(self, name: str) -> list[tuple[int, int]]:
        """Rows of the strain matrix that a coefficient couples."""
        shift = 3 if self.membrane else 0
        if name[0] == "S":
            first = shift + 3
            return [{"S55": (first, first), "S44": (first + 1, first + 1), "S45": (first, first + 1)}[name]]
        i, j = _VOIGT[name[1:]]
        if name[0] == "A":
            return [(i, j)]
        if name[0] == "D":
            return [(i + shift, j + shift)]
        return [(i, j + 3)] if i == j else [(i, j + 3), (j, i + 3)]

    def strain_matrix(self, coordinates: FloatArray, natural: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Strains from the dofs of an element, node by node.

        Args:
            coordinates: (e, 8, 2) node coordinates of each element, m.
            natural: (p, 2) natural coordinates.

        Returns:
            (e, p, strains, dofs) strain matrices and (e, p) Jacobian determinants.
        """
        by_xy, determinant = _jacobians(coordinates, natural)
        N = shape_functions(natural)
        by_x, by_y = by_xy[:, :, 0], by_xy[:, :, 1]
        B = np.zeros((*by_xy.shape[:2], 8, 8, 5))
        u, v, w, rx, ry = range(5)
        for strain, entries in enumerate(
            (
                ((u, by_x),),
                ((v, by_y),),
                ((u, by_y), (v, by_x)),
                ((ry, by_x),),
                ((rx, -by_y),),
                ((rx, -by_x), (ry, by_y)),
                ((w, by_x), (ry, N)),
                ((w, by_y), (rx, -N)),
            )
        ):
            for dof, values in entries:
                B[:, :, strain, :, dof] = values
        if not self.membrane:
            B = B[:, :, 3:, :, 2:]
        return B.reshape(*B.shape[:3], -1), determinant

    def stiffness_terms(self, coordinates: FloatArray, ratio: Ratio | None = None) -> FloatArray:
        """(k, e, d, d) element stiffness by each section coefficient of `terms`, for (e, 8, 2) node coordinates.

        Where all elements are congruent one stands for all: (k, 1, d, d). The same holds for `mass_terms`. With a relative
        thickness r(x) the coefficients are those where r = 1 (`fecore.body.profile`).
        """
        natural, weights = gauss(2)
        coordinates = _distinct(coordinates) if ratio is None else coordinates
        B, determinant = self.strain_matrix(coordinates, natural)
        r = _ratios(coordinates, natural, ratio)
        right = B.transpose(0, 2, 1, 3)
        # (e, strain, d, p) for A and S, B, D: as many powers of r
        lefts = {
            power: (B * (determinant * weights * r**power)[:, :, None, None]).transpose(0, 2, 3, 1)
            for power in set(_POWERS.values())
        }
        terms = np.empty((len(self.terms), len(coordinates), B.shape[3], B.shape[3]))
        for k, name in enumerate(self.terms):
            pairs, left = self._pairs(name), lefts[_POWERS[name[0]]]
            half = np.sum([left[:, i] @ right[:, j] for i, j in pairs], axis=0)
            alike = all(i == j for i, j in pairs)
            terms[k] = half if alike else half + half.transpose(0, 2, 1)
        return terms

    def mass_terms(self, coordinates: FloatArray, ratio: Ratio | None = None) -> FloatArray:
        """(j, e, d, d) consistent element mass by each inertia of `mass_terms_names`, rotary inertia included."""
        natural, weights = gauss(3)
        coordinates = _distinct(coordinates) if ratio is None else coordinates
        _, determinant = _jacobians(coordinates, natural)
        N = shape_functions(natural)
        r = _ratios(coordinates, natural, ratio)
        plain = {power: (N.T * (determinant * weights * r**power)[:, None, :]) @ N for power in (1, 2, 3)}
        at = {name: place for place, name in enumerate(self.displacements)}
        coupled = {
            "I0u": [("u", "u", 1)],
            "I0v": [("v", "v", 1)],
            "I0": [("w", "w", 1)],
            "I1u": [("u", "ry", 1), ("ry", "u", 1)],
            "I1v": [("v", "rx", -1), ("rx", "v", -1)],
            "I2rx": [("rx", "rx", 1)],
            "I2ry": [("ry", "ry", 1)],
        }
        d = len(at)
        terms = np.zeros((len(self.mass_terms_names), len(coordinates), 8, d, 8, d))
        for term, name in zip(terms, self.mass_terms_names, strict=True):
            for left, right, sign in coupled[name]:
                term[:, :, at[left], :, at[right]] = sign * plain[int(name[1]) + 1]
        return terms.reshape(*terms.shape[:2], 8 * d, 8 * d)


Ratio = Callable[[FloatArray], FloatArray]
"""The relative thickness r at places x, m."""

_POWERS = {"A": 1, "S": 1, "B": 2, "D": 3}
"""Of the relative thickness, by the first letter of a section coefficient."""


def _ratios(coordinates: FloatArray, natural: FloatArray, ratio: Ratio | None) -> FloatArray:
    """(e, p) relative thickness at the natural points of each element; (1, 1) of 1 without any."""
    if ratio is None:
        return np.ones((1, 1))
    return ratio(coordinates[:, :, 0] @ shape_functions(natural).T)


_SYMMETRIC = (("11", "12", "16"), ("12", "22", "26"), ("16", "26", "66"))


def _distinct(coordinates: FloatArray) -> FloatArray:
    """One element for all where all are congruent (up to round-off), else all."""
    placed = coordinates - coordinates[:, :1]
    size = np.abs(placed).max() + np.abs(coordinates).max()
    return coordinates if np.abs(placed - placed[0]).max() > 1e-12 * size else placed[:1]


def _jacobians(coordinates: FloatArray, natural: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(e, p, 2, 8) derivatives by x, y and (e, p) determinants at the natural points of each element."""
    by_natural = shape_function_derivatives(natural)
    jacobian = np.einsum("pan,enx->epax", by_natural, coordinates)
    by_xy: FloatArray = np.einsum("epxa,pan->epxn", np.linalg.inv(jacobian), by_natural)
    return by_xy, np.linalg.det(jacobian)
