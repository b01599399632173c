"""Specimens as a laboratory describes them, and how their finite element models follow from constants.

A specimen has constants q that can be updated, and closed forms from q to the coefficients c(q) and m(q) of its affine model
K(c), M(m). That is all that updating asks of it (`Body`), so a plate and a beam are updated alike.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.body import beam
from fecore.body.laminate import SHEAR_CORRECTION, OrthotropicMaterial, Ply, Section, section
from fecore.body.mesh import RectangleMesh, rectangle
from fecore.body.model import Model, PlateModel, plate
from fecore.body.profile import Piece, Profile, profile_of
from fecore.body.supports import Boundary, PointMass, Spring, Supports
from fecore.errors import InputError

CONSTANTS = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy", "density", "thickness", "length", "width")
"""Constants of a `Specimen`."""

BEAM_CONSTANTS = ("E", "nu", "density", "width", "thickness", "length")
"""Constants of a `BeamSpecimen`."""

UNITS = {
    **dict.fromkeys(("Ex", "Ey", "Gxy", "Gxz", "Gyz", "E"), "Pa"),
    **dict.fromkeys(("E1", "E2", "G12", "G13", "G23"), "Pa"),
    **dict.fromkeys(("nu_xy", "nu", "nu12"), "1"),
    "density": "kg/m³",
    **dict.fromkeys(("length", "width", "thickness"), "m"),
    "fibre_angle": "rad",
    "angle": "rad",
    "zone": "1",
    "clamp_compliance": "1",
}
"""SI unit of each constant, without a number at its end."""

_DIMENSIONS = ("thickness", "length", "width")

SIGNED = frozenset({"nu_xy", "nu", "nu12", "fibre_angle", "angle"})
"""Constants that may be negative, without a number at their end: Poisson's ratios and angles."""


def kind_of(constant: str) -> str:
    """A constant's name without the number of its material or ply: E1 of E1_2, angle of angle_3."""
    return re.sub(r"_\d+$", "", constant)


class Body(Protocol):
    """What updating asks of a specimen, whatever its model.

    Closed forms take (c, …) constants in the order of `nominal`, and complex ones too: their derivatives are complex steps.
    """

    @property
    def nominal(self) -> dict[str, float]:
        """Constants that can be parameters, by name, SI."""
        ...

    @property
    def springs(self) -> tuple[Spring, ...]:
        """Elastic supports, the last coefficients of the model's stiffness."""
        ...

    @property
    def model(self) -> Model:
        """The affine finite element model, which holds for any constants."""
        ...

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) coefficients of the model's stiffness, springs apart."""
        ...

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) coefficients of the model's mass."""
        ...

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) whether the constants are those of a stable material and a real section."""
        ...


@dataclass(frozen=True)
class Specimen:
    """A strip of a homogenised orthotropic material; x along its length from the clamped end, z out of plane.

    Attributes:
        length, width, thickness: m.
        material: nominal constants and density.
        boundary: how it is held.
        masses: what it carries, such as a sensor.
        divisions: elements along the length and across the width; None leaves them to who knows the band, and is 40 × 4 else.
        springs: elastic supports; their stiffnesses can be updating parameters, by their names.
        supports: held edges, where they are not those of the boundary's name.
        fibre_angle: of the material's x axis about z from the specimen's, rad.
        pieces: steps and tapers of thickness along x; the thickness is that where no piece lies.
        zones: x in m of the lines between zones, each with a factor of its stiffness among the constants: `zone_1` and so on.
    """

    length: float
    width: float
    thickness: float
    material: OrthotropicMaterial
    boundary: Boundary = "cantilever"
    masses: tuple[PointMass, ...] = ()
    divisions: tuple[int, int] | None = None
    springs: tuple[Spring, ...] = ()
    supports: Supports | None = None
    fibre_angle: float = 0.0
    pieces: tuple[Piece, ...] = ()
    zones: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise InputError("geometry.thickness_m", f"is {self.thickness}, expected a positive number of metres")
        check_zones(self.zones, self.length)

    @property
    def section(self) -> Section:
        """The nominal section."""
        return section([Ply(self.material, self.thickness, float(np.degrees(self.fibre_angle)))])

    @property
    def nominal(self) -> dict[str, float]:
        """The material's constants and the dimensions."""
        own = {name: float(getattr(self if name in _DIMENSIONS else self.material, name)) for name in CONSTANTS}
        return own | zone_factors(self.zones)

    def with_constants(self, constants: FloatArray) -> Specimen:
        """The specimen with other constants, in the order of `CONSTANTS`."""
        values = dict(zip(CONSTANTS, map(float, constants), strict=True))
        dimensions = {name: values.pop(name) for name in _DIMENSIONS}
        return replace(self, material=replace(self.material, **values), **dimensions)  # type: ignore[arg-type]

    @cached_property
    def model(self) -> PlateModel:
        """The affine finite element model, which holds for any constants and thickness.

        Raises:
            InputError: the geometry, or the place of a mass or a spring, is wrong.
        """
        held = Supports.of(self.boundary) if self.supports is None else self.supports
        profile = profile_of(self.length, self.thickness, self.pieces)
        mesh = strip_mesh((self.length, self.width), self.divisions, profile, self.zones)
        return plate(mesh, held, self.masses, self.springs, profile=profile, zones=self.zones)

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(9, …) as `PlateModel.stiffness_coefficients` orders them, once for each zone. With Q = Ex / (Ex - ν² Ey) they are

        D11 = Ex Q t³/12,  D22 = Ey Q t³/12,  D12 = ν D22,  D66 = Gxy t³/12,  S55 = κ Gxz t,  S44 = κ Gyz t,

        turned by the fibres' angle. The mesh keeps its dimensions: with x = αx', y = βy' and rotations θx' = βθx, θy' = αθy
        the strains of a body α times as long and β times as wide are those of the mesh times powers of α and β.
        """
        count = len(CONSTANTS)
        return in_zones(self.stiffness_at(constants[:count], self.fibre_angle), constants[count:])

    def stiffness_at(self, constants: FloatArray, angle: float | FloatArray) -> FloatArray:
        """(9, …) the same where the material's axes are turned by an angle (…) about z, rad."""
        Ex, Ey, Gxy, Gxz, Gyz, nu, _, t, length, width = constants
        bending, shear, rest = t**3 / 12, SHEAR_CORRECTION * t, Ex - nu**2 * Ey
        Q11, Q22 = Ex**2 / rest, Ex * Ey / rest
        turned = turned_stiffness(Q11, nu * Q22, Q22, Gxy, angle)
        c, s = np.cos(angle), np.sin(angle)
        a, b = length / self.length, width / self.width
        powers = (b / a**3, 1 / (a * b), a / b**3, 1 / (a * b), 1 / a**2, 1 / b**2)
        shears = (Gxz * c**2 + Gyz * s**2) * b / a, (Gyz * c**2 + Gxz * s**2) * a / b, (Gxz - Gyz) * c * s
        rows = [bending * row * power for row, power in zip(turned, powers, strict=True)]
        return np.stack([*rows, *(shear * row for row in shears)])

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(4, …) as `PlateModel.mass_coefficients` orders them: I0 = ρ t, I2 = ρ t³/12 of the rotations rx and ry, and 1 for
        the point masses.
        """
        density, t, length, width = constants[6:10]
        a, b = length / self.length, width / self.width
        rotary = density * t**3 / 12
        return np.stack([density * t * a * b, rotary * a / b, rotary * b / a, np.ones_like(t)])

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) all but ν positive, and the plane-stress stiffness positive definite: ν² Ey < Ex."""
        Ex, Ey, nu = constants[0], constants[1], constants[5]
        zoned = np.all(constants[len(CONSTANTS) :] > 0, axis=0)
        physical: BoolArray = _positive(CONSTANTS, constants) & (nu**2 * Ey < 0.99 * Ex) & zoned
        return physical


@dataclass(frozen=True)
class BeamSpecimen:
    """An isotropic strip as three-node Timoshenko beam elements, in out-of-plane bending and torsion.

    Attributes:
        length, width, thickness: m.
        modulus: nominal Young's modulus E, Pa.
        poisson: nominal Poisson's ratio ν; the shear modulus is E / 2(1 + ν).
        density: nominal, kg/m³.
        boundary: how it is held.
        masses: what it carries, such as a sensor.
        elements: along the length.
    """

    length: float
    width: float
    thickness: float
    modulus: float
    poisson: float
    density: float
    boundary: Boundary = "cantilever"
    masses: tuple[PointMass, ...] = ()
    elements: int = 40

    def __post_init__(self) -> None:
        constants = np.array(list(self.nominal.values()))
        if not (np.all(np.isfinite(constants)) and self.are_physical(constants)):
            stated = ", ".join(f"{name} = {value:g}" for name, value in self.nominal.items())
            raise InputError("beam", f"has {stated}; expected positive numbers and -1 < nu < 0.5")

    @property
    def nominal(self) -> dict[str, float]:
        """E, ν, density and section."""
        values = (self.modulus, self.poisson, self.density, self.width, self.thickness, self.length)
        return dict(zip(BEAM_CONSTANTS, values, strict=True))

    @property
    def springs(self) -> tuple[Spring, ...]:
        """None: the beam model has no elastic supports."""
        return ()

    @cached_property
    def model(self) -> beam.BeamModel:
        """The affine finite element model without in-plane motion.

        Raises:
            InputError: the geometry, or the place of a mass, is wrong.
        """
        return beam.beam(self.length, self.elements, self.boundary, self.masses, in_plane=False)

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(6, …) EA, GAy, GAz, GJ, EIy, EIz of an isotropic rectangle."""
        E, nu, _, width, thickness, length = constants
        shear, a = E / (2 * (1 + nu)), length / self.length
        plain = beam.section_stiffness(E, shear, shear, width, thickness)
        return np.stack([row / a**power for row, power in zip(plain, (1, 1, 1, 1, 3, 3), strict=True)])

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(5, …) ρA, ρ(Iy + Iz), ρIy, ρIz, and 1 for the point masses."""
        a = constants[5] / self.length
        plain = beam.section_inertia(*constants[2:5])
        return np.stack([row * a**power for row, power in zip(plain, (1, 1, -1, -1, 0), strict=True)])

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) all but ν positive, and -1 < ν < ½."""
        physical: BoolArray = _positive(BEAM_CONSTANTS, constants) & (constants[1] > -1) & (constants[1] < 0.5)
        return physical


def strip_mesh(
    size: tuple[float, float], divisions: tuple[int, int] | None, profile: Profile | None, zones: tuple[float, ...]
) -> RectangleMesh:
    """The mesh of a specimen's length and width, with lines where its thickness or its zones change.

    Raises:
        InputError: the geometry is wrong.
    """
    breaks = sorted({*zones, *(profile.breaks if profile else ())})
    return rectangle(*size, *(divisions or (40, 4)), breaks)


def check_zones(zones: tuple[float, ...], length: float) -> None:
    """Refuse lines between zones that are not inside the specimen, one beyond the other.

    Raises:
        InputError: as said.
    """
    ends = np.array([0.0, *zones, length])
    if not np.all(np.isfinite(ends)) or np.any(np.diff(ends) <= 1e-6 * length):
        raise InputError("zones_m", f"are at {list(zones)}, expected rising places between 0 and {length:g} m")


def zone_factors(zones: tuple[float, ...]) -> dict[str, float]:
    """The constants of the zones between such lines, nominally 1; none where there is no line."""
    return {f"zone_{number}": 1.0 for number in range(1, len(zones) + 2)} if zones else {}


def in_zones(coefficients: FloatArray, factors: FloatArray) -> FloatArray:
    """(z·k, …) coefficients of each of z zones, by (k, …) of the section and (z, …) factors; as they are without any."""
    return np.concatenate([coefficients * factor for factor in factors]) if len(factors) else coefficients


def turned_stiffness(
    Q11: FloatArray, Q12: FloatArray, Q22: FloatArray, Q66: FloatArray, angle: float | FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Q̄11, Q̄12, Q̄22, Q̄66, Q̄16 and Q̄26 of a material turned by an angle (Reddy, Eq. 2.4.8)."""
    c, s = np.cos(angle), np.sin(angle)
    even, sloped, steep = Q11 + Q22, Q11 - Q12 - 2 * Q66, Q12 - Q22 + 2 * Q66
    return (
        Q11 * c**4 + 2 * (Q12 + 2 * Q66) * s**2 * c**2 + Q22 * s**4,
        (even - 4 * Q66) * s**2 * c**2 + Q12 * (s**4 + c**4),
        Q11 * s**4 + 2 * (Q12 + 2 * Q66) * s**2 * c**2 + Q22 * c**4,
        (even - 2 * Q12 - 2 * Q66) * s**2 * c**2 + Q66 * (s**4 + c**4),
        sloped * s * c**3 + steep * s**3 * c,
        sloped * s**3 * c + steep * s * c**3,
    )


def _positive(names: tuple[str, ...], constants: FloatArray) -> BoolArray:
    positive: BoolArray = np.all(constants[[row for row, name in enumerate(names) if name not in SIGNED]] > 0, axis=0)
    return positive
