"""Eight-node serendipity plate element with first-order shear deformation (the family of Abaqus' S8R).

Out-of-plane dofs a node: w, θx, θy, with u(z) = z θy and v(z) = -z θx. Bending strains and transverse shears:

    κx = ∂θy/∂x,   κy = -∂θx/∂y,   κxy = ∂θy/∂y - ∂θx/∂x,   γxz = ∂w/∂x + θy,   γyz = ∂w/∂y - θx

The stiffness is integrated with 2×2 Gauss points, which avoids shear locking and, with eight nodes, leaves no spurious
zero-energy mode that two elements can share (Hughes, *The Finite Element Method*, section 5.3); the mass in full, with
3×3.

Stiffness is linear in the section's coefficients, so the element returns one matrix a coefficient (`TERMS`), each the
derivative of the element stiffness by that coefficient.
"""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray

DOFS_PER_NODE = 3
"""w, θx, θy."""

# (name, row, column) of the strain vector (κx, κy, κxy, γxz, γyz) that a section coefficient couples.
_COUPLED_STRAINS = {
    "D11": (0, 0),
    "D12": (0, 1),
    "D22": (1, 1),
    "D66": (2, 2),
    "D16": (0, 2),
    "D26": (1, 2),
    "S55": (3, 3),
    "S44": (4, 4),
    "S45": (3, 4),
}
TERMS = tuple(_COUPLED_STRAINS)
"""Section coefficients in the order of the stiffness terms."""

MASS_TERMS = ("I0", "I2")
"""Section inertias in the order of the mass terms: translation, rotation."""

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


def shape_derivatives(natural: FloatArray) -> FloatArray:
    """(p, 2, 8) derivatives of the shape functions by the natural coordinates."""
    xi, eta = natural[:, :1], natural[:, 1:]
    xn, en = _NODES[:, 0], _NODES[:, 1]
    corner_xi = xn * (1 + eta * en) * (2 * xi * xn + eta * en) / 4
    corner_eta = en * (1 + xi * xn) * (xi * xn + 2 * eta * en) / 4
    by_xi = np.where(xn == 0, -xi * (1 + eta * en), np.where(en == 0, xn * (1 - eta**2) / 2, corner_xi))
    by_eta = np.where(xn == 0, en * (1 - xi**2) / 2, np.where(en == 0, -eta * (1 + xi * xn), corner_eta))
    return np.stack([by_xi, by_eta], axis=1)


def gauss(order: int) -> tuple[FloatArray, FloatArray]:
    """(order², 2) Gauss points of the square and their (order²,) weights."""
    x, w = np.polynomial.legendre.leggauss(order)
    points = np.array([(a, b) for b in x for a in x])
    return points, np.outer(w, w).ravel()


def _jacobians(coordinates: FloatArray, natural: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(e, p, 2, 8) derivatives by x, y and (e, p) determinants at the natural points of each element."""
    by_natural = shape_derivatives(natural)
    jacobian = np.einsum("pan,enx->epax", by_natural, coordinates)
    by_xy: FloatArray = np.einsum("epxa,pan->epxn", np.linalg.inv(jacobian), by_natural)
    return by_xy, np.linalg.det(jacobian)


def strain_matrix(coordinates: FloatArray, natural: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Strains (κx, κy, κxy, γxz, γyz) from the 24 dofs (w, θx, θy node by node).

    Args:
        coordinates: (e, 8, 2) node coordinates of each element, m.
        natural: (p, 2) natural coordinates.

    Returns:
        (e, p, 5, 24) strain matrices and (e, p) Jacobian determinants.
    """
    by_xy, determinant = _jacobians(coordinates, natural)
    N = shape_functions(natural)
    B = np.zeros((*by_xy.shape[:2], 5, 8, DOFS_PER_NODE))
    B[:, :, 0, :, 2] = by_xy[:, :, 0]
    B[:, :, 1, :, 1] = -by_xy[:, :, 1]
    B[:, :, 2, :, 1] = -by_xy[:, :, 0]
    B[:, :, 2, :, 2] = by_xy[:, :, 1]
    B[:, :, 3, :, 0] = by_xy[:, :, 0]
    B[:, :, 3, :, 2] = N
    B[:, :, 4, :, 0] = by_xy[:, :, 1]
    B[:, :, 4, :, 1] = -N
    return B.reshape(*by_xy.shape[:2], 5, 24), determinant


def stiffness_terms(coordinates: FloatArray) -> FloatArray:
    """(9, e, 24, 24) element stiffness by each section coefficient of `TERMS`, for (e, 8, 2) node coordinates."""
    natural, weights = gauss(2)
    B, determinant = strain_matrix(coordinates, natural)
    scale = determinant * weights
    terms = np.empty((len(TERMS), len(coordinates), 24, 24))
    for k, (row, column) in enumerate(_COUPLED_STRAINS.values()):
        half = np.einsum("ep,epi,epj->eij", scale, B[:, :, row], B[:, :, column], optimize=True)
        terms[k] = half if row == column else half + half.transpose(0, 2, 1)
    return terms


def mass_terms(coordinates: FloatArray) -> FloatArray:
    """(2, e, 24, 24) consistent element mass by each inertia of `MASS_TERMS`, rotary inertia included."""
    natural, weights = gauss(3)
    _, determinant = _jacobians(coordinates, natural)
    N = shape_functions(natural)
    plain = np.einsum("ep,pi,pj->eij", determinant * weights, N, N, optimize=True)
    terms = np.zeros((len(MASS_TERMS), len(coordinates), 8, DOFS_PER_NODE, 8, DOFS_PER_NODE))
    terms[0, :, :, 0, :, 0] = plain
    terms[1, :, :, 1, :, 1] = plain
    terms[1, :, :, 2, :, 2] = plain
    return terms.reshape(len(MASS_TERMS), len(coordinates), 24, 24)
