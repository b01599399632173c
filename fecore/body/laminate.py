"""Plies to section stiffness and inertia, by first-order shear deformation theory of an equivalent single layer.

A laminate is a stack of orthotropic plies from bottom (z = -t/2) to top. With the plane-stress stiffness Q̄ of each
ply in the specimen's axes (Reddy, *Mechanics of Laminated Composite Plates and Shells*, 2nd ed., sections 2.4 and 3.4):

    A = ∫ Q̄ dz,   B = ∫ Q̄ z dz,   D = ∫ Q̄ z² dz        (force and moment resultants)
    S = κ ∫ [[C̄55, C̄45], [C̄45, C̄44]] dz                 (transverse shear, on γxz and γyz)

and the inertias per area I0 = ∫ρ dz, I1 = ∫ρz dz, I2 = ∫ρz² dz. A homogenised orthotropic material is the one-ply case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Literal

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError

_TWIST_TOLERANCE = 1e-9  # D16, D26 over D11 below which they are round-off
SHEAR_CORRECTION = 5 / 6
"""κ of a homogeneous rectangular section (Reissner 1945)."""


@dataclass(frozen=True)
class OrthotropicMaterial:
    """Engineering constants of an orthotropic material in its own axes: moduli in Pa, density in kg/m³.

    `nu_xy` is the Poisson's ratio of a contraction along y under stress along x, so nu_yx = nu_xy Ey / Ex.

    Raises:
        InputError: a modulus or the density is not positive, or the plane-stress stiffness is not positive definite
            (nu_xy² Ey / Ex ≥ 1).
    """

    Ex: float
    Ey: float
    Gxy: float
    Gxz: float
    Gyz: float
    nu_xy: float
    density: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not np.isfinite(value):
                raise InputError(f"material.{field.name}", f"is {value}, expected a finite number")
            if field.name != "nu_xy" and value <= 0:
                raise InputError(f"material.{field.name}", f"is {value:g}, expected a positive number")
        if self.nu_xy**2 * self.Ey / self.Ex >= 1:
            raise InputError(
                "material.nu_xy",
                f"nu_xy² Ey/Ex is {self.nu_xy**2 * self.Ey / self.Ex:.3g}, expected below 1: "
                "the material would not be positive definite",
            )

    def plane_stress(self) -> FloatArray:
        """(3, 3) plane-stress stiffness Q on (εx, εy, γxy), Pa."""
        factor = 1 / (1 - self.nu_xy**2 * self.Ey / self.Ex)
        return np.array(
            [
                [self.Ex * factor, self.nu_xy * self.Ey * factor, 0],
                [self.nu_xy * self.Ey * factor, self.Ey * factor, 0],
                [0, 0, self.Gxy],
            ]
        )

    def transverse_shear(self) -> FloatArray:
        """(2, 2) shear stiffness on (γxz, γyz), Pa."""
        return np.diag([self.Gxz, self.Gyz])


@dataclass(frozen=True)
class Ply:
    """One ply: a material turned by `angle_deg` about z from the specimen's x axis, of a thickness in m."""

    material: OrthotropicMaterial
    thickness: float
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise InputError("ply.thickness", f"is {self.thickness}, expected a positive number of metres")
        if not np.isfinite(self.angle_deg):
            raise InputError("ply.angle_deg", f"is {self.angle_deg}, expected a finite angle")

    def plane_stress(self) -> FloatArray:
        """(3, 3) stiffness Q̄ = T⁻¹ Q T⁻ᵀ in the specimen's axes, Pa (Reddy eq. 2.4.8)."""
        c, s = np.cos(np.radians(self.angle_deg)), np.sin(np.radians(self.angle_deg))
        strain = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
        turned: FloatArray = strain.T @ self.material.plane_stress() @ strain
        return turned

    def transverse_shear(self) -> FloatArray:
        """(2, 2) shear stiffness on (γxz, γyz) in the specimen's axes, Pa."""
        c, s = np.cos(np.radians(self.angle_deg)), np.sin(np.radians(self.angle_deg))
        turn = np.array([[c, s], [-s, c]])
        turned: FloatArray = turn.T @ self.material.transverse_shear() @ turn
        return turned


@dataclass(frozen=True)
class Section:
    """Stiffness and inertia of a laminate per unit of its area.

    Attributes:
        A, B, D: (3, 3) membrane, coupling and bending stiffness, N/m, N, N·m.
        S: (2, 2) transverse shear stiffness on (γxz, γyz), κ included, N/m.
        inertia: (I0, I1, I2) in kg/m², kg/m, kg.
        thickness: total thickness, m.
    """

    A: FloatArray
    B: FloatArray
    D: FloatArray
    S: FloatArray
    inertia: tuple[float, float, float]
    thickness: float

    def coefficients(self) -> dict[str, float]:
        """The entries of A, B, D and S by name: A11, B16, D66, S55 (γxz), S44 (γyz) and so on."""
        voigt = {"11": (0, 0), "12": (0, 1), "22": (1, 1), "66": (2, 2), "16": (0, 2), "26": (1, 2)}
        plane = {
            letter + index: float(getattr(self, letter)[place]) for letter in "ABD" for index, place in voigt.items()
        }
        return plane | {"S55": float(self.S[0, 0]), "S44": float(self.S[1, 1]), "S45": float(self.S[0, 1])}

    def bending_stiffness(self, width: float) -> float:
        """EI = b / d11 in N·m² of a strip along x, free to twist and to bend across; d = (D - B A⁻¹ B)⁻¹, `width` b in m."""
        return float(width / np.linalg.inv(self.D - self.B @ np.linalg.inv(self.A) @ self.B)[0, 0])

    @property
    def is_coupled(self) -> bool:
        """Whether bending and membrane forces couple (B ≠ 0 beyond round-off, or I1 ≠ 0)."""
        scale = np.sqrt(np.abs(self.A).max() * np.abs(self.D).max())
        inertia_scale = self.inertia[0] * self.thickness
        return bool(np.abs(self.B).max() > 1e-10 * scale or abs(self.inertia[1]) > 1e-10 * inertia_scale)


def section(
    plies: Sequence[Ply],
    shear_correction: float = SHEAR_CORRECTION,
    shear: Literal["correction", "equilibrium"] = "correction",
) -> Section:
    """Integrate a stack of plies, bottom to top, to its section stiffness and inertia.

    Args:
        plies: the stack.
        shear_correction: κ.
        shear: `correction` for S = κ ∫C̄ dz; `equilibrium` for S from the shear stresses that balance bending ply by
            ply (`equilibrium_shear`), which laminates of very unlike plies and sandwiches need.

    Raises:
        InputError: there is no ply.
    """
    if not plies:
        raise InputError("laminate.plies", "is empty, expected at least one ply")
    total = sum(ply.thickness for ply in plies)
    A, B, D = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    S: FloatArray = np.zeros((2, 2))
    inertia = np.zeros(3)
    low = -total / 2
    for ply in plies:
        high = low + ply.thickness
        moments = np.array([high - low, (high**2 - low**2) / 2, (high**3 - low**3) / 3])
        Q = ply.plane_stress()
        A, B, D = A + moments[0] * Q, B + moments[1] * Q, D + moments[2] * Q
        S = S + shear_correction * moments[0] * ply.transverse_shear()
        inertia += moments * ply.material.density
        low = high
    if shear == "equilibrium":
        S = equilibrium_shear(plies, A, B, D)
    return Section(A, B, D, S, (float(inertia[0]), float(inertia[1]), float(inertia[2])), total)


def homogenise(laminate: Section) -> OrthotropicMaterial:
    """The single-layer material with the same bending stiffness, shear stiffness, mass and thickness as a laminate.

    With d = D⁻¹ and thickness t: Ex = 12/(t³ d11), Ey = 12/(t³ d22), Gxy = 12/(t³ d66), ν = -d12/d11, and Gxz = S55/(κt),
    Gyz = S44/(κt) (Jones, *Mechanics of Composite Materials*, for flexural engineering constants).

    Raises:
        InputError: bending couples with membrane forces or with twisting, which no orthotropic layer does.
    """
    D, t = laminate.D, laminate.thickness
    if laminate.is_coupled:
        raise InputError("laminate", "couples bending and membrane forces (B ≠ 0): it has no equivalent single layer")
    if max(abs(D[0, 2]), abs(D[1, 2])) > _TWIST_TOLERANCE * D[0, 0] or abs(laminate.S[0, 1]) > 1e-9 * laminate.S[0, 0]:
        raise InputError(
            "laminate", "couples bending and twisting (D16, D26 ≠ 0): it has no equivalent orthotropic layer"
        )
    d = np.linalg.inv(D)
    bending, shear = 12 / t**3, SHEAR_CORRECTION * t
    return OrthotropicMaterial(
        Ex=float(bending / d[0, 0]),
        Ey=float(bending / d[1, 1]),
        Gxy=float(bending / d[2, 2]),
        Gxz=float(laminate.S[0, 0] / shear),
        Gyz=float(laminate.S[1, 1] / shear),
        nu_xy=float(-d[0, 1] / d[0, 0]),
        density=laminate.inertia[0] / t,
    )


def equilibrium_shear(plies: Sequence[Ply], A: FloatArray, B: FloatArray, D: FloatArray) -> FloatArray:
    """(2, 2) transverse shear stiffness from the equilibrium of stresses over the plies.

    Under pure bending moments that change along x (then along y) the in-plane stresses σ = Q̄(ε + zκ) change too, and
    equilibrium gives τ(z) = -∫ ∂σ dz from the bottom, so τ = f(z) V with V the shear force. Equal energies,

        V S⁻¹ V = ∫ τᵀ C̄⁻¹ τ dz,

    make S (Whitney, J. Appl. Mech. 40, 1973; Rohwer 1988). For one ply it is 5/6 C̄ t. Cylindrical bending in the two
    directions is taken one at a time, as is usual.
    """
    flexibility = np.linalg.inv(np.block([[A, B], [B, D]]))[:, 3:]
    thicknesses = np.array([ply.thickness for ply in plies])
    levels = np.concatenate([[0.0], np.cumsum(thicknesses)]) - thicknesses.sum() / 2
    Q = np.array([ply.plane_stress() for ply in plies])
    return balanced_shear(Q, np.array([ply.transverse_shear() for ply in plies]), levels, flexibility)


def balanced_shear(Q: FloatArray, C: FloatArray, levels: FloatArray, flexibility: FloatArray) -> FloatArray:
    """(…, 2, 2) transverse shear stiffness of n plies, as `equilibrium_shear`; complex values too.

    Args:
        Q: (n, …, 3, 3) plane-stress stiffness of each ply in the specimen's axes.
        C: (n, …, 2, 2) transverse shear stiffness of each ply.
        levels: (n + 1, …) heights z of the plies' faces, bottom to top.
        flexibility: (…, 6, 3) strains and curvatures by the moments.
    """
    points, weights = np.polynomial.legendre.leggauss(3)  # τ is a parabola in a ply, its energy a quartic
    compliance = np.zeros_like(C[0])
    below = np.zeros_like(C[0])

    def stress(ply: int, z: FloatArray) -> FloatArray:
        """∫ from the ply's bottom to z of (σx by Mx,x, σy by My,y; the shears by the same)."""
        low = levels[ply]
        first, second = (z - low)[..., None, None], ((z**2 - low**2) / 2)[..., None, None]
        by_moment = Q[ply] @ (flexibility[..., :3, :] * first + flexibility[..., 3:, :] * second)
        integral: FloatArray = by_moment[..., [0, 2, 2, 1], [0, 1, 0, 1]].reshape(below.shape)
        return integral

    for ply, (low, high) in enumerate(pairwise(levels)):
        give = np.linalg.inv(C[ply])
        for x, w in zip(points, weights, strict=True):
            shear = below + stress(ply, low + (high - low) * (1 + x) / 2)
            energy = np.swapaxes(shear, -1, -2) @ give @ shear
            compliance = compliance + (w * (high - low) / 2)[..., None, None] * energy
        below = below + stress(ply, high)
    stiffness: FloatArray = np.linalg.inv(compliance)
    return stiffness
