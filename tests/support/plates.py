"""Plates and closed forms that several tests share."""

import numpy as np

from fecore.body.laminate import OrthotropicMaterial, Ply, Section, section
from fecore.body.model import PlateModel
from fecore.dynamics.eigen import NormalModes, normal_modes

PAPER = OrthotropicMaterial(31.66e9, 31.80e9, 6.30e9, 5.37e9, 5.37e9, 0.15, 2012.0)
"""Table 4's updated constants of the paper's cantilever."""


def paper_section(thickness: float = 0.010) -> Section:
    return section([Ply(PAPER, thickness)])


def solve(model: PlateModel, laminate: Section, count: int) -> NormalModes:
    K = model.stiffness.at(model.stiffness_coefficients(laminate))
    M = model.mass.at(model.mass_coefficients(laminate))
    return normal_modes(K, M, count, model.rigid_modes)


def navier_hz(laminate: Section, a: float, b: float, count: int) -> np.ndarray:
    """Natural frequencies of the simply supported plate a × b by first-order theory, rotary inertia included.

    Navier's solution (Reddy, Mechanics of Laminated Composite Plates and Shells, 2nd ed., sections 6.3 and 6.5):
    u ~ cos αx sin βy, v ~ sin αx cos βy, w ~ sin αx sin βy, φx ~ cos αx sin βy, φy ~ sin αx cos βy, for laminates with
    A16 = A26 = D16 = D26 = B16 = B26 = S45 = 0.
    """
    A, B, D, S = laminate.A, laminate.B, laminate.D, laminate.S
    i0, i1, i2 = laminate.inertia
    inertia = np.diag([i0, i0, i0, i2, i2])
    inertia[0, 3] = inertia[3, 0] = inertia[1, 4] = inertia[4, 1] = i1
    found = []
    for m in range(1, 9):
        for n in range(1, 9):
            p, q = m * np.pi / a, n * np.pi / b

            def block(C: np.ndarray, p: float = p, q: float = q) -> np.ndarray:
                off = (C[0, 1] + C[2, 2]) * p * q
                return np.array([[C[0, 0] * p**2 + C[2, 2] * q**2, off], [off, C[2, 2] * p**2 + C[1, 1] * q**2]])

            K = np.zeros((5, 5))
            K[:2, :2], K[3:, 3:] = block(A), block(D)
            K[:2, 3:] = block(B)
            K[3:, :2] = block(B).T
            K[2, 2] = S[0, 0] * p**2 + S[1, 1] * q**2
            K[2, 3] = K[3, 2] = S[0, 0] * p
            K[2, 4] = K[4, 2] = S[1, 1] * q
            K[3, 3] += S[0, 0]
            K[4, 4] += S[1, 1]
            found.append(np.min(np.linalg.eigvals(np.linalg.solve(inertia, K)).real))
    return np.sqrt(np.sort(found)[:count]) / (2 * np.pi)
