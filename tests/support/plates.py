"""Plates and closed forms that several tests share."""

from collections.abc import Sequence

import numpy as np

from fecore.body.generators import strip
from fecore.body.laminate import OrthotropicMaterial, Ply, balanced_shear
from fecore.body.sections import Section, ShellSection, section
from fecore.body.structure import Structure
from fecore.body.supports import Mass, PointMass, Spring, Support
from fecore.dynamics.eigen import NormalModes, normal_modes

PAPER = OrthotropicMaterial(31.66e9, 31.80e9, 6.30e9, 5.37e9, 5.37e9, 0.15, 2012.0)
"""Table 4's updated constants of the paper's cantilever."""


def paper_section(thickness: float = 0.010) -> Section:
    return section([Ply(PAPER, thickness)])


def plate(
    size: tuple[float, float],
    divisions: tuple[int, int],
    supports: tuple[Support, ...] = (),
    masses: Sequence[PointMass] = (),
    springs: Sequence[Spring] = (),
    *,
    membrane: bool = False,
) -> Structure:
    """A rectangle for any laminate, whose coefficients `matrices` sets."""
    mesh = strip(*size, *divisions)
    # as closed forms of shear theory have it
    stack = ShellSection((Ply(PAPER, 0.01),), turning=True, thins=False)
    carried = tuple(Mass(each.mass, (each.x, each.y, 0.0), each.rotary_inertia) for each in masses)
    dofs = (0, 1, 2, 3, 4) if membrane else (2, 3, 4)
    return Structure(mesh, {"strip": stack}, supports, tuple(springs), carried, dofs=dofs)


def integrated(plies: Sequence[Ply], shear_correction: float | None = None) -> Section:
    """The section of plies by turned tensors of the fourth order, C_ijkl = R_ia R_jb R_kc R_ld
    C_abcd, each by its heights.

    S is from equilibrium, or κ ∫C̄ dz as published solutions of first order have it.
    """
    thicknesses = [ply.thickness for ply in plies]
    z = np.cumsum([-sum(thicknesses) / 2, *thicknesses])
    Q, C, pairs = [], [], ((0, 0), (1, 1), (0, 1))
    for ply in plies:
        m, c, s = ply.material, np.cos(np.radians(ply.angle_deg)), np.sin(np.radians(ply.angle_deg))
        R, own = np.array([[c, -s], [s, c]]), np.zeros((2, 2, 2, 2))
        plane = np.linalg.inv(
            [[1 / m.Ex, -m.nu_xy / m.Ex, 0], [-m.nu_xy / m.Ex, 1 / m.Ey, 0], [0, 0, 1 / m.Gxy]]
        )
        for (i, j), row in zip(pairs, plane, strict=True):
            for (k, n), value in zip(pairs, row, strict=True):
                own[i, j, k, n] = own[j, i, k, n] = own[i, j, n, k] = own[j, i, n, k] = value
        turned = np.einsum("ia,jb,kc,ld,abcd->ijkl", R, R, R, R, own)
        Q.append(np.array([[turned[(*a, *b)] for b in pairs] for a in pairs]))
        C.append(R @ np.diag([m.Gxz, m.Gyz]) @ R.T)
    moments = np.array([(z[1:] ** n - z[:-1] ** n) / n for n in (1, 2, 3)])
    A, B, D = np.tensordot(moments, Q, 1)
    inertia = np.sum(moments * [ply.material.density for ply in plies], axis=1)
    flexibility = np.linalg.inv(np.block([[A, B], [B, D]]))[:, 3:]
    S = balanced_shear(np.array(Q), np.array(C), z, flexibility)
    if shear_correction is not None:
        S = shear_correction * np.tensordot(moments[0], C, 1)
    return Section(A, B, D, S, tuple(inertia), z[-1] - z[0])


def entries(laminate: Section) -> dict[str, float]:
    """The entries of A, B, D and S by name: A11, B16, D66, S55 (γxz), S44 (γyz) and so on."""
    voigt = {"11": (0, 0), "12": (0, 1), "22": (1, 1), "66": (2, 2), "16": (0, 2), "26": (1, 2)}
    plane = {
        letter + index: float(getattr(laminate, letter)[at])
        for letter in "ABD"
        for index, at in voigt.items()
    }
    S = laminate.S
    return plane | {"S55": float(S[0, 0]), "S44": float(S[1, 1]), "S45": float(S[0, 1])}


def coefficients(body: Structure, laminate: Section) -> tuple[np.ndarray, np.ndarray]:
    """Of stiffness and mass, with those of a laminate by their names."""
    own = entries(laminate) | {spring.name: spring.stiffness for spring in body.springs}
    inertia = {
        f"I{n}_{axis}": value for n, value in enumerate(laminate.inertia) for axis in (1, 2, 3)
    } | {"1": 1.0}
    model = body.model
    stiffness = np.array([own[name.rpartition(".")[2]] for name in model.stiffness.names])
    return stiffness, np.array([inertia[name.rpartition(".")[2]] for name in model.mass.names])


def matrices(body: Structure, laminate: Section):
    """K and M with a laminate."""
    stiffness, mass = coefficients(body, laminate)
    return body.model.stiffness.at(stiffness), body.model.mass.at(mass)


def solve(body: Structure, laminate: Section, count: int) -> NormalModes:
    return normal_modes(*matrices(body, laminate), count, body.model.rigid_modes)


def navier_hz(laminate: Section, a: float, b: float, count: int) -> np.ndarray:
    """Natural frequencies of the simply supported plate a × b by first-order theory, rotary inertia
    included.

    Navier's solution (Reddy, Mechanics of Laminated Composite Plates and Shells, 2nd ed., sections
    6.3 and 6.5): u ~ cos αx sin βy, v ~ sin αx cos βy, w ~ sin αx sin βy, φx ~ cos αx sin βy, φy ~
    sin αx cos βy, for laminates with A16 = A26 = D16 = D26 = B16 = B26 = S45 = 0.
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
                return np.array(
                    [[C[0, 0] * p**2 + C[2, 2] * q**2, off], [off, C[2, 2] * p**2 + C[1, 1] * q**2]]
                )

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
