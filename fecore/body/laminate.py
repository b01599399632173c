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


@dataclass(frozen=True)
class AlongNormal:
    """How the points of a wall move with its strains, beyond first-order shear theory."""

    # (3,) c̄: strain along the normal by strains of the middle, with the sign turned
    by_strain: FloatArray
    by_curvature: FloatArray  # (3,) s: motion of the mass along the normal by curvatures, m²
    spread: float  # I2 by I0, m²
    offset: float  # of the middle, m


def along_normal(
    Q: FloatArray, give: FloatArray, density: FloatArray, levels: FloatArray
) -> AlongNormal:
    """How far a stack's motion along the normal is from that of first-order shear theory, by its
    strains and curvatures.

    A wall that is bent grows thinner where it is stretched, ε_z = -c (ε + ζκ) with c of each ply's
    plane stress. So its points move along the normal by p(ζ)κ = -∫cζ dζ κ beyond the w that goes
    with the shear force, which is the mean by the shear stress f(ζ) = -∫Qζ dζ; the mass moves by
    the mean by its density, and its rotation by that of the strains:

        u_z = w + s κ + ζ (-c̄ ε),      s = ∫ρp dζ/∫ρ dζ - ∫fp dζ/∫f dζ.

    One ply has s = -c t²/60. With it waves of an isotropic plate have 5/(6 - ν) in place of κ = 5/6
    (Stephen 1997), narrow beams 5(1 + ν)/(6 + 5ν) (Timoshenko 1922), and waves in the plane the
    lateral inertia of Love.

    Args:
        Q: (n, 3, 3) plane-stress stiffness of each ply.
        give: (n, 3) strain ε_z of each ply by its stresses, with the sign turned.
        density: (n,) of each ply.
        levels: (n + 1,) heights of the plies' faces, bottom to top.
    """
    c = np.einsum("ni,nij->nj", give, Q)
    t, middle = np.diff(levels), (levels[1:] + levels[:-1]) / 2
    stiff = Q[:, 0, 0] + Q[:, 1, 1]
    spread = density @ np.diff(levels**3) / (3 * (density @ t or 1.0))
    offset = float(levels[0] + levels[-1]) / 2
    levels = levels - (stiff * t) @ middle / (stiff @ t)
    x, w = np.polynomial.legendre.leggauss(3)
    p, f, sums = np.zeros(3), 0.0, np.zeros((2, 4))
    for ply, (low, high) in enumerate(pairwise(levels)):
        z = (low + high + (high - low) * x) / 2
        square = np.append(z**2, high**2) / 2 - low**2 / 2
        moved, stress = p - c[ply] * square[:, None], f - stiff[ply] * square
        for row, by in zip(sums, (np.full(3, density[ply]), stress[:3]), strict=True):
            row += (high - low) / 2 * (w * by) @ np.column_stack([moved[:3], np.ones(3)])
        p, f = moved[3], stress[3]
    weight, shear = sums[:, :3] / np.where(sums[:, 3:] == 0, 1, sums[:, 3:])
    return AlongNormal(t @ c / t.sum(), weight - shear, float(spread), offset)
