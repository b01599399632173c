"""A specimen as it is laid up: plies whose own constants are updated, with all couplings of the stack.

The constants are those of the ply materials in the plies' axes, so the section is a function of them,

    q → Q_m(E1, E2, G12, nu12) → Q̄_k (turned by ply k's angle) → A, B, D = ∫ Q̄ (1, z, z²) dz,

and S follows from the equilibrium of the stresses over the plies (`laminate.balanced_shear`), which for plies alike is κ = 5/6.
A, B, D and S are the coefficients of the affine model, which therefore stays as it is; their derivatives by the ply constants
are complex steps through these closed forms.

A stack that couples bending with membrane forces (B ≠ 0) gets a model with membrane dofs. A stack that does not by its nominal
angles has bending dofs alone, and the little B that errors of single plies' angles make enters by the reduced bending
stiffness D - B A⁻¹ B (Reddy, section 5.2), which differs from D in the second order of the errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.body.laminate import OrthotropicMaterial, Ply, Section, balanced_shear, section
from fecore.body.model import PlateModel, plate
from fecore.body.profile import Piece, profile_of
from fecore.body.specimen import check_zones, in_zones, strip_mesh, turned_stiffness, zone_factors
from fecore.body.supports import Boundary, PointMass, Spring, Supports
from fecore.errors import InputError

PLY_CONSTANTS = ("E1", "E2", "G12", "G13", "G23", "nu12")
"""Constants of a ply's material in its own axes; those of a second material from the bottom are E1_2 and so on."""

MOST_ANGLES = 40
"""Plies up to which each ply's angle is a constant, `angle_1` from the bottom."""

_OF_MATERIAL = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy")
_WHOLE = ("density", "thickness", "length", "width")


@dataclass(frozen=True)
class LayeredSpecimen:
    """A strip or plate of plies; x along its length from the clamped end, z out of plane.

    Attributes:
        length, width, thickness: of the whole, m; the plies' thicknesses are taken in proportion to it.
        plies: the stack from the bottom to the top, with nominal constants.
        density: of the whole, kg/m³; the plies' densities say how it is spread over the thickness.
        boundary: how it is held.
        masses: what it carries, such as a sensor.
        divisions: elements along the length and across the width; None leaves them to who knows the band, and is 40 × 4 else.
        springs: elastic supports.
        supports: held edges, where they are not those of the boundary's name.
        fibre_angle: of the whole stack about z, beside the plies' angles, rad.
        pieces: steps and tapers of thickness along x, of all plies alike; the thickness is that where no piece lies.
        zones: as of `Specimen`.
    """

    length: float
    width: float
    thickness: float
    plies: tuple[Ply, ...]
    density: float
    boundary: Boundary = "cantilever"
    masses: tuple[PointMass, ...] = ()
    divisions: tuple[int, int] | None = None
    springs: tuple[Spring, ...] = ()
    supports: Supports | None = None
    fibre_angle: float = 0.0
    pieces: tuple[Piece, ...] = ()
    zones: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_zones(self.zones, self.length)
        for name, unit in (("thickness", "metres"), ("density", "kg/m³")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(name, f"is {value}, expected a positive number of {unit}")
        if not self.plies:
            raise InputError("laminate.plies", "is empty, expected at least one ply")

    @cached_property
    def materials(self) -> tuple[OrthotropicMaterial, ...]:
        """The plies' materials that differ in more than density, in their order from the bottom."""
        return tuple(dict.fromkeys(replace(ply.material, density=1.0) for ply in self.plies))

    @cached_property
    def _first_constant(self) -> tuple[int, ...]:
        """Of each ply's material among the constants."""
        numbers = [self.materials.index(replace(ply.material, density=1.0)) for ply in self.plies]
        return tuple(len(PLY_CONSTANTS) * number for number in numbers)

    @cached_property
    def section(self) -> Section:
        """The nominal section, with the whole's thickness and density."""
        ratio = self.thickness / sum(ply.thickness for ply in self.plies)
        plies = [
            Ply(ply.material, ratio * ply.thickness, ply.angle_deg + float(np.degrees(self.fibre_angle)))
            for ply in self.plies
        ]
        stack = section(plies, shear="equilibrium")
        heavier = self.density * self.thickness / stack.inertia[0]
        I0, I1, I2 = (heavier * part for part in stack.inertia)
        return replace(stack, inertia=(I0, I1, I2))

    @property
    def nominal(self) -> dict[str, float]:
        """The materials' constants, density and dimensions, and the plies' angles in rad."""
        found = {}
        for number, material in enumerate(self.materials, start=1):
            suffix = "" if number == 1 else f"_{number}"
            for name, stored in zip(PLY_CONSTANTS, _OF_MATERIAL, strict=True):
                found[name + suffix] = float(getattr(material, stored))
        found |= {name: float(getattr(self, name)) for name in _WHOLE}
        if len(self.plies) <= MOST_ANGLES:
            found |= {f"angle_{k}": float(np.radians(ply.angle_deg)) for k, ply in enumerate(self.plies, start=1)}
        return found | zone_factors(self.zones)

    @cached_property
    def model(self) -> PlateModel:
        """The affine finite element model, with membrane dofs where the stack couples.

        Raises:
            InputError: the geometry, or the place of a mass or a spring, is wrong.
        """
        held = Supports.of(self.boundary) if self.supports is None else self.supports
        profile = profile_of(self.length, self.thickness, self.pieces)
        mesh = strip_mesh((self.length, self.width), self.divisions, profile, self.zones)
        coupled = self.section.is_coupled
        return plate(mesh, held, self.masses, self.springs, membrane=coupled, profile=profile, zones=self.zones)

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) as `PlateModel.stiffness_coefficients` orders them, for the mesh with its own dimensions.

        With dofs u' = αu, v' = βv, θx' = βθx, θy' = αθy on a body α times as long and β times as wide, strains, curvatures and
        shears are those of the mesh times powers of α and β.
        """
        A, B, D, S = self._stiffness(constants)
        _, _, length, width = self._dimensions(constants)
        a, b = length / self.length, width / self.width
        mixed = 1 / (a * b)
        places = ((0, 0, b / a**3), (0, 1, mixed), (1, 1, a / b**3), (2, 2, mixed), (0, 2, 1 / a**2), (1, 2, 1 / b**2))
        if self.section.is_coupled:
            rows = [each[..., i, j] * power for each in (A, B, D) for i, j, power in places]
        else:
            reduced = D - B @ np.linalg.inv(A) @ B
            rows = [reduced[..., i, j] * power for i, j, power in places]
        whole = np.stack([*rows, S[..., 0, 0] * b / a, S[..., 1, 1] * a / b, S[..., 0, 1]])
        return in_zones(whole, self._factors(constants))

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) as `PlateModel.mass_coefficients` orders them."""
        density, t, length, width = self._dimensions(constants)
        a, b = length / self.length, width / self.width
        nominal = np.array(self.section.inertia) / (self.density * self.thickness ** np.arange(1, 4))
        I0, I1, I2 = (share * density * t**power for power, share in enumerate(nominal, start=1))
        one = np.ones_like(t)
        if not self.section.is_coupled:
            return np.stack([I0 * a * b, I2 * a / b, I2 * b / a, one])
        return np.stack([I0 * b / a, I0 * a / b, I0 * a * b, I1 * b / a, I1 * a / b, I2 * a / b, I2 * b / a, one])

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) moduli, density and dimensions positive, and each material's plane-stress stiffness positive definite."""
        count = len(PLY_CONSTANTS) * len(self.materials)
        moduli = constants[:count].reshape(len(self.materials), len(PLY_CONSTANTS), *constants.shape[1:])
        E1, E2, nu = moduli[:, 0], moduli[:, 1], moduli[:, 5]
        stable = np.all(moduli[:, :5] > 0, axis=(0, 1)) & np.all(nu**2 * E2 < 0.99 * E1, axis=0)
        zoned = np.all(self._factors(constants) > 0, axis=0)
        physical: BoolArray = stable & zoned & np.all(constants[count : count + len(_WHOLE)] > 0, axis=0)
        return physical

    def bending_stiffness(self, constants: FloatArray) -> float:
        """EI = b / d11 of the strip along x in N·m², free to twist and to bend across; d = (D - B A⁻¹ B)⁻¹."""
        A, B, D, _ = self._stiffness(constants)
        width = self._dimensions(constants)[3]
        return float(width / np.linalg.inv(D - B @ np.linalg.inv(A) @ B)[0, 0])

    def _dimensions(self, constants: FloatArray) -> FloatArray:
        """(4, …) density, thickness, length and width."""
        first = len(PLY_CONSTANTS) * len(self.materials)
        return constants[first : first + len(_WHOLE)]

    def _factors(self, constants: FloatArray) -> FloatArray:
        """(z, …) factors of the zones; none where there are no zones."""
        count = len(self.zones) + 1 if self.zones else 0
        return constants[len(constants) - count :]

    def _stiffness(self, constants: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(…, 3, 3) A, B, D and (…, 2, 2) S."""
        t = self._dimensions(constants)[1]
        thicknesses = np.array([ply.thickness for ply in self.plies])
        heights = np.concatenate([[0.0], np.cumsum(thicknesses)]) / thicknesses.sum() - 0.5
        levels = heights.reshape(-1, *(1,) * t.ndim) * t
        Q, C = self._plies(constants)
        low, high = levels[:-1, ..., None, None], levels[1:, ..., None, None]
        A, B, D = (np.sum(Q * (high**n - low**n) / n, axis=0) for n in (1, 2, 3))
        whole = np.concatenate([np.concatenate([A, B], axis=-1), np.concatenate([B, D], axis=-1)], axis=-2)
        return A, B, D, balanced_shear(Q, C, levels, np.linalg.inv(whole)[..., 3:])

    def _plies(self, constants: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, …, 3, 3) plane-stress and (n, …, 2, 2) transverse shear stiffness of each ply in the specimen's axes."""
        first = len(PLY_CONSTANTS) * len(self.materials) + len(_WHOLE)
        Q, C = [], []
        for k, ply in enumerate(self.plies):
            place = self._first_constant[k]
            E1, E2, G12, G13, G23, nu = constants[place : place + len(PLY_CONSTANTS)]
            own = np.radians(ply.angle_deg) if len(self.plies) > MOST_ANGLES else constants[first + k]
            angle = own + self.fibre_angle + 0 * E1
            rest = E1 - nu**2 * E2
            Q11, Q22 = E1**2 / rest, E1 * E2 / rest
            q11, q12, q22, q66, q16, q26 = turned_stiffness(Q11, nu * Q22, Q22, G12, angle)
            c, s = np.cos(angle), np.sin(angle)
            s55, s44, s45 = G13 * c**2 + G23 * s**2, G23 * c**2 + G13 * s**2, (G13 - G23) * c * s
            Q.append(_matrix([[q11, q12, q16], [q12, q22, q26], [q16, q26, q66]]))
            C.append(_matrix([[s55, s45], [s45, s44]]))
        return np.array(Q), np.array(C)


def _matrix(rows: list[list[FloatArray]]) -> FloatArray:
    """(…, n, n) from rows of entries (…)."""
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
