"""Materials, plies and their transverse shear, by first-order shear deformation theory of an
equivalent single layer.

A laminate is a stack of orthotropic plies from bottom (z = -t/2) to top. With the plane-stress
stiffness Q̄ of each ply in the specimen's axes (Reddy, *Mechanics of Laminated Composite Plates and
Shells*, 2nd ed., sections 2.4 and 3.4):

    A = ∫ Q̄ dz,   B = ∫ Q̄ z dz,   D = ∫ Q̄ z² dz        (force and moment resultants)

and the inertias per area I0 = ∫ρ dz, I1 = ∫ρz dz, I2 = ∫ρz² dz (`fecore.body.sections`). The
transverse shear stiffness S, on γxz and γyz, follows from equilibrium (`balanced_shear`).
"""

from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError

SHEAR_CORRECTION = 5 / 6
"""κ of a homogeneous rectangular section (Reissner 1945)."""


@dataclass(frozen=True)
class OrthotropicMaterial:
    """Engineering constants of an orthotropic material in its own axes: moduli in Pa, density in
    kg/m³.

    `nu_xy` is the Poisson's ratio of a contraction along y under stress along x, so nu_yx = nu_xy
    Ey / Ex.

    Raises:
        InputError: a modulus is not positive, the density negative (0 is of what weighs nothing),
            or the plane-stress stiffness not positive definite (nu_xy² Ey / Ex ≥ 1).
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
            if field.name == "density" and value < 0:
                raise InputError(
                    "material.density", f"is {value:g}, expected a number that is not negative"
                )
            if field.name not in ("nu_xy", "density") and value <= 0:
                raise InputError(
                    f"material.{field.name}", f"is {value:g}, expected a positive number"
                )
        if self.nu_xy**2 * self.Ey / self.Ex >= 1:
            raise InputError(
                "material.nu_xy",
                f"nu_xy² Ey/Ex is {self.nu_xy**2 * self.Ey / self.Ex:.3g}, expected below 1: "
                "the material would not be positive definite",
            )


@dataclass(frozen=True)
class Ply:
    """One ply: a material turned by `angle_deg` about z from the specimen's x axis, of a thickness
    in m.
    """

    material: OrthotropicMaterial
    thickness: float
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise InputError(
                "ply.thickness", f"is {self.thickness}, expected a positive number of metres"
            )
        if not np.isfinite(self.angle_deg):
            raise InputError("ply.angle_deg", f"is {self.angle_deg}, expected a finite angle")


def balanced_shear(
    Q: FloatArray, C: FloatArray, levels: FloatArray, flexibility: FloatArray
) -> FloatArray:
    """(…, 2, 2) transverse shear stiffness from the equilibrium of stresses over n plies; complex
    values too.

    Under pure bending moments that change along x (then along y) the in-plane stresses σ = Q̄(ε +
    zκ) change too, and equilibrium gives τ(z) = -∫ ∂σ dz from the bottom, so τ = f(z) V with V the
    shear force. Equal energies,

        V S⁻¹ V = ∫ τᵀ C̄⁻¹ τ dz,

    make S (Whitney, J. Appl. Mech. 40, 1973; Rohwer 1988). For one ply it is 5/6 C̄ t. Cylindrical
    bending in the two directions is taken one at a time, as is usual.

    Args:
        Q: (n, …, 3, 3) plane-stress stiffness of each ply in the specimen's axes.
        C: (n, …, 2, 2) transverse shear stiffness of each ply.
        levels: (n + 1, …) heights z of the plies' faces, bottom to top.
        flexibility: (…, 6, 3) strains and curvatures by the moments.
    """
    # τ is a parabola in a ply, its energy a quartic
    points, weights = np.polynomial.legendre.leggauss(3)
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
