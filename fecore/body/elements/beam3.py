"""Three-node quadratic Timoshenko beam (the family of Abaqus' B32): axial, torsion and bending in both planes.

Dofs a node: u, v, w, θx, θy, θz. Of a beam along x:

    ε = u',   γxy = v' - θz,   γxz = w' + θy,   τ = θx',   κy = θy',   κz = θz'

with the section stiffnesses EA, GAy, GAz (shear, κ included), GJ, EIy (bending in the xz plane, θy) and EIz (in the xy
plane, θz). Stiffness by two Gauss points, which avoids shear locking; consistent mass by three, rotary inertia included.
"""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray

DISPLACEMENTS = ("u", "v", "w", "rx", "ry", "rz")
"""Dofs of a node."""

TERMS = ("EA", "GAy", "GAz", "GJ", "EIy", "EIz")
"""Section coefficients in the order of the stiffness terms."""

MASS_TERMS = ("m", "mx", "my", "mz")
"""Inertias per length in the order of the mass terms: mass ρA, ρ(Iy + Iz) about x, ρIy about y, ρIz about z."""

_NODES = np.array([-1.0, 0.0, 1.0])


def shape_functions(natural: FloatArray) -> FloatArray:
    """(p, 3) shape functions at (p,) natural coordinates, nodes at -1, 0, 1."""
    x = np.asarray(natural, dtype=float)
    return np.column_stack([x * (x - 1) / 2, 1 - x**2, x * (x + 1) / 2])


def shape_function_derivatives(natural: FloatArray) -> FloatArray:
    """(p, 3) derivatives of the shape functions by the natural coordinate."""
    x = np.asarray(natural, dtype=float)
    return np.column_stack([x - 0.5, -2 * x, x + 0.5])


def stiffness_terms(length: float) -> FloatArray:
    """(6, 18, 18) stiffness of one element by each coefficient of `TERMS`."""
    points, weights = np.polynomial.legendre.leggauss(2)
    N, by_x = shape_functions(points), shape_function_derivatives(points) * 2 / length
    strains = {
        "EA": (("u", by_x),),
        "GAy": (("v", by_x), ("rz", -N)),
        "GAz": (("w", by_x), ("ry", N)),
        "GJ": (("rx", by_x),),
        "EIy": (("ry", by_x),),
        "EIz": (("rz", by_x),),
    }
    terms = np.empty((len(TERMS), 18, 18))
    for k, name in enumerate(TERMS):
        B = np.zeros((2, 3, 6))
        for dof, values in strains[name]:
            B[:, :, DISPLACEMENTS.index(dof)] = values
        flat = B.reshape(2, 18)
        terms[k] = flat.T @ (flat * (weights * length / 2)[:, None])
    return terms


def mass_terms(length: float) -> FloatArray:
    """(4, 18, 18) mass of one element by each inertia of `MASS_TERMS`."""
    points, weights = np.polynomial.legendre.leggauss(3)
    N = shape_functions(points)
    plain = N.T @ (N * (weights * length / 2)[:, None])
    terms = np.zeros((len(MASS_TERMS), 3, 6, 3, 6))
    for term, dofs in zip(terms, (("u", "v", "w"), ("rx",), ("ry",), ("rz",)), strict=True):
        for dof in dofs:
            place = DISPLACEMENTS.index(dof)
            term[:, place, :, place] = plain
    return terms.reshape(len(MASS_TERMS), 18, 18)
