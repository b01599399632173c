"""Specimens as a laboratory describes them: flat strips and plates, each a `Structure` whose
constants have names of their own.

A specimen names its constants as coupons do (`Ex`, `thickness`); `strip.E1` and `strip.t` of its
structure follow from them.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.body.clamps import Root
from fecore.body.generators import Piece, relative_thickness, strip
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.named import BENDING, BEYOND_EDGE, OfStructure
from fecore.body.sections import PLY_CONSTANTS, Section, ShellSection, section
from fecore.body.structure import Structure
from fecore.body.supports import (
    Boundary,
    Clamp,
    PointMass,
    Spring,
    Support,
    edges,
    of_boundary,
)
from fecore.errors import InputError
from fecore.quantities import CLAMP

CONSTANTS = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy", "density", "thickness", "length", "width")
"""Constants of a `Specimen`."""

EDGE_ROUNDING = 1e-6
"""Share of a dimension by which rounding moves a point."""

_DIMENSIONS = ("thickness", "length", "width")


def off_specimen(points: FloatArray, length: float, width: float) -> BoolArray:
    """Which of (p, 2) points lie off a specimen of these dimensions, further than `BEYOND_EDGE`."""
    share = points / np.array([length, width]) + np.array([0, 0.5])  # 0 … 1 on the specimen
    off: BoolArray = np.any((share < -BEYOND_EDGE) | (share > 1 + BEYOND_EDGE), axis=1)
    return off


class FlatBody(OfStructure):
    """What strips and plates of one layer or of plies have in common."""

    length: float
    width: float
    thickness: float
    boundary: Boundary
    masses: tuple[PointMass, ...]
    divisions: tuple[int, int] | None
    supports: tuple[Support, ...] | None
    fibre_angle: float
    pieces: tuple[Piece, ...]
    zones: tuple[float, ...]
    profile: tuple[float, ...]

    def _structure(
        self, plies: tuple[Ply, ...], dofs: tuple[int, ...], clamps: tuple[Clamp, ...] = ()
    ) -> Structure:
        """The structure of plies with the specimen's shape and supports, hinged where a clamp
        yields.
        """
        lines = divided(self.zones, self.length, self.parts)
        mesh = strip(
            *(
                self.length,
                self.width,
                *(self.divisions or (40, 4)),
                lines,
                self.pieces,
                self.thickness,
            )
        )
        held = of_boundary(self.boundary) if self.supports is None else self.supports
        return Structure(
            mesh,
            dict.fromkeys(mesh.sets, ShellSection(plies, turning=True, thins=False)),
            edges("simply_supported") if clamps else held,
            self.springs,
            tuple(each.on_surface() for each in self.masses),
            dofs=dofs,
            size=(self.length, self.width),
            clamps=clamps,
            # z may be from a table, say
            reach=(BEYOND_EDGE * self.length, BEYOND_EDGE * self.width, self.length),
        )

    def row(self, name: str, own: dict[str, FloatArray]) -> FloatArray | float | None:
        """A constant of the structure: those of plies have the same name, those of one layer names
        of the axes x and y.
        """
        set_name, _, constant = name.rpartition(".")
        if constant == "factor":
            return self._factor(set_name, own)
        if constant == "angle":
            return own.get("fibre_angle", self.fibre_angle)
        return own.get(
            _NAMES.get(constant, constant) if "Ex" in own else _WHOLE.get(constant, constant)
        )

    def _factor(self, set_name: str, own: dict[str, FloatArray]) -> FloatArray | None:
        """The factor of a zone, or of a part of one by its share of the zone's change of
        compliance.
        """
        if not self.zones:
            return None
        part = int(set_name.removeprefix("strip_")) - 1
        zone = own[f"zone_{part // self.parts + 1}"]
        return zone / (zone + self.profile[part] * (1 - zone)) if self.profile else zone

    @property
    def parts(self) -> int:
        """Parts of equal length that each zone is divided into."""
        return max(1, len(self.profile) // (len(self.zones) + 1))

    @property
    @abstractmethod
    def section(self) -> Section:
        """The nominal section."""

    @property
    def even_thickness(self) -> float:
        """Its thickness, m."""
        return self.thickness

    @property
    def unmeshed(self) -> Self | None:
        """The body, rigidly clamped, where nobody has chosen its elements."""
        return self.yielding(0.0) if self.divisions is None else None

    def with_mesh(self, divisions: tuple[int, int]) -> Self:
        """The body with so many elements along and across."""
        return replace(self, divisions=divisions)  # type: ignore[type-var]

    def divided(self, parts: int) -> Self:
        """The body with each of its zones in so many equal ones."""
        zones = divided(self.zones, self.length, parts)
        return replace(self, zones=zones)  # type: ignore[type-var]

    def turned(self, angle: float) -> Self:
        """The body with its fibres turned about z by an angle, rad."""
        return replace(self, fibre_angle=self.fibre_angle + angle)  # type: ignore[type-var]

    def root(self, constants: FloatArray) -> Root | None:
        """The clamped end at some constants; None where there is none, springs hold it too, or its
        compliance is a parameter.
        """
        clamped = self.boundary == "cantilever" and self.supports is None and not self.springs
        if not clamped or CLAMP in self.nominal:
            return None
        own = dict(zip(self.nominal, constants, strict=False))
        EI = self.bending_stiffness(constants) * self.root_thickness**3
        return Root(EI, *(float(own[name]) for name in ("length", "width", "thickness")))

    @abstractmethod
    def bending_stiffness(self, constants: FloatArray) -> float:
        """EI along x at the own thickness and some constants, N·m²."""

    @property
    def root_thickness(self) -> float:
        """Thickness at x = 0 by the specimen's own."""
        if not self.pieces:
            return 1.0
        return float(
            relative_thickness(
                np.array([[0.0, 1e-9]]) * self.length, self.length, self.thickness, self.pieces
            )[0, 0]
        )


_WHOLE = {"t": "thickness"}
_NAMES = {
    **_WHOLE,
    "E1": "Ex",
    "E2": "Ey",
    "G12": "Gxy",
    "G13": "Gxz",
    "G23": "Gyz",
    "nu12": "nu_xy",
}


@dataclass(frozen=True)
class Specimen(FlatBody):
    """A strip of a homogenised orthotropic material; x along its length from the clamped end, z out
    of plane.

    Its stiffness is one layer's; its mass lies where the layers of the stack have it, as a
    sandwich's does in its faces.
    """

    # length, width, thickness: m
    length: float
    width: float
    thickness: float
    material: OrthotropicMaterial  # nominal constants and density
    boundary: Boundary = "cantilever"  # how it is held
    masses: tuple[PointMass, ...] = ()  # what it carries, such as a sensor
    # elements along the length and across the width; None leaves them to who knows the band, and is
    # 40 × 4 else
    divisions: tuple[int, int] | None = None
    # elastic supports; their stiffnesses can be updating parameters, by their names
    springs: tuple[Spring, ...] = ()
    # what holds it, where that is not by the boundary's name
    supports: tuple[Support, ...] | None = None
    fibre_angle: float = 0.0  # of the material's x axis about z from the specimen's, rad
    # steps and tapers of thickness along x; the thickness is that where no piece lies
    pieces: tuple[Piece, ...] = ()
    # x in m of the lines between zones, each with a factor s of its stiffness among the constants:
    # `zone_1` and so on
    zones: tuple[float, ...] = ()
    # changes of compliance 1/s - 1 of equal parts of each zone, over their mean in the zone; even
    # by default
    profile: tuple[float, ...] = ()
    # (thickness, density) of layers from the bottom to the top, such as a sandwich's: how the mass
    # is spread over the thickness. Their ratios count alone; evenly by default
    layers: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise InputError(
                "geometry.thickness_m", f"is {self.thickness}, expected a positive number of metres"
            )
        check_zones(self.zones, self.length)
        if self.layers and self.section.is_coupled:
            raise InputError(
                "layers",
                "are heavier on one side, so that bending moves the middle: update the plies",
            )

    @property
    def section(self) -> Section:
        """The nominal section."""
        turn = float(np.degrees(self.fibre_angle))
        return section([replace(ply, angle_deg=turn) for ply in self._plies])

    @property
    def _plies(self) -> tuple[Ply, ...]:
        """The one material, in layers of their own densities."""
        t, rho = np.array(self.layers or ((1.0, 1.0),)).T
        t, rho = self.thickness * t / t.sum(), self.material.density * rho * t.sum() / (t @ rho)
        rows = zip(t.tolist(), rho.tolist(), strict=True)
        return tuple(
            Ply(replace(self.material, density=density), thickness) for thickness, density in rows
        )

    def bending_stiffness(self, constants: FloatArray) -> float:
        """EI = Ex b t³/12 along x at some constants, N·m²."""
        own = dict(zip(self.nominal, constants, strict=False))
        return float(own["Ex"] * own["width"] * own["thickness"] ** 3 / 12)

    @property
    def one_layer(self) -> Specimen | None:
        """Itself where it is one homogenised layer of one thickness."""
        return None if self.pieces or self.layers else self

    @property
    def is_mirrored(self) -> bool:
        """Whether it and its supports are alike on both sides of its middle line."""
        plain = not self.fibre_angle and not self.springs and self.supports is None
        return plain and all(mass.y == 0 for mass in self.masses)

    @property
    def nominal(self) -> dict[str, float]:
        """The material's constants and the dimensions."""
        own = {
            name: float(getattr(self if name in _DIMENSIONS else self.material, name))
            for name in CONSTANTS
        }
        return own | zone_factors(self.zones)

    @cached_property
    def structure(self) -> Structure:
        """The strip with the dofs w, θx and θy."""
        return self._structure(self._plies, BENDING)


@dataclass(frozen=True)
class OrientedSpecimen(Specimen):
    """A `Specimen` with the further constants `fibre_angle`, rad, and, where its clamp may yield,
    `CLAMP`.

    Several specimens of one material share its moduli in the material's own axes; each has an angle
    of its own, which the saw has missed by a degree, and a clamp that yields: a hinge at x = 0 with
    a rotational spring along the edge.
    """

    # nominal EI/kL of the clamped edge; 0 for one that is rigid, or for a body that is not clamped
    clamp_compliance: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (np.isfinite(self.clamp_compliance) and self.clamp_compliance >= 0):
            raise InputError(CLAMP, f"is {self.clamp_compliance}, expected EI/kL, not negative")
        if self.clamp_compliance and self.boundary != "cantilever":
            raise InputError(CLAMP, f"belongs to a clamp; the boundary is {self.boundary}")
        if self.zones:
            raise InputError("zones_m", "are of a single update; an oriented specimen has none")
        if self.springs or self.supports is not None:
            raise InputError(
                "springs",
                "and supports of an oriented specimen are those of its boundary and clamp",
            )

    @property
    def nominal(self) -> dict[str, float]:
        """The material's constants, the dimensions, the angle, and the clamp's compliance where it
        has one.
        """
        own = {"fibre_angle": self.fibre_angle}
        if self.clamp_compliance:
            own[CLAMP] = self.clamp_compliance
        return {**super().nominal, **own}

    @cached_property
    def structure(self) -> Structure:
        """The strip, with a clamp of k = EI/L per width."""
        if not self.clamp_compliance:
            return self._structure(self._plies, BENDING)
        per_metre = self.bending_modulus * self.thickness**3 / (12 * self.length)
        clamps = (Clamp(self.clamp_compliance, Spring(CLAMP, per_metre, 5, edge="start")),)
        return self._structure(self._plies, BENDING, clamps)

    @property
    def shares_material(self) -> bool:
        """Yes."""
        return True

    def yielding(self, compliance: float) -> Self:
        """The specimen with a clamp of that EI/kL, 0 for a rigid one; as it is where it is not
        clamped, or yields already.
        """
        if self.boundary != "cantilever" or (compliance and self.clamp_compliance):
            return self
        return replace(self, clamp_compliance=compliance)

    @property
    def bending_modulus(self) -> float:
        """Nominal Young's modulus along the strip, Pa: 1/E = c⁴/Ex + s⁴/Ey + (1/Gxy - 2ν/Ex)
        s²c².
        """
        m, c, s = self.material, np.cos(self.fibre_angle), np.sin(self.fibre_angle)
        return float(
            1 / (c**4 / m.Ex + s**4 / m.Ey + (1 / m.Gxy - 2 * m.nu_xy / m.Ex) * s**2 * c**2)
        )


@dataclass(frozen=True)
class LayeredSpecimen(FlatBody):
    """A strip or plate of plies whose own constants are updated, with all couplings of the stack.

    A stack that couples bending with membrane forces (B ≠ 0) gets a model with u and v. A stack
    that does not by its nominal angles bends alone, and the little B that errors of single plies'
    angles make enters by the reduced bending stiffness.
    """

    # length, width, thickness: of the whole, m; the plies' thicknesses are taken in proportion to
    # it
    length: float
    width: float
    thickness: float
    plies: tuple[Ply, ...]  # the stack from the bottom to the top, with nominal constants
    # of the whole, kg/m³; the plies' densities say how it is spread over the thickness
    density: float
    # boundary, masses, divisions, springs, supports: as of `Specimen`
    boundary: Boundary = "cantilever"
    masses: tuple[PointMass, ...] = ()
    divisions: tuple[int, int] | None = None
    springs: tuple[Spring, ...] = ()
    supports: tuple[Support, ...] | None = None
    fibre_angle: float = 0.0  # of the whole stack about z, beside the plies' angles, rad
    # steps and tapers of thickness along x, of all plies alike; the thickness is that where no
    # piece lies
    pieces: tuple[Piece, ...] = ()
    # zones, profile: as of `Specimen`
    zones: tuple[float, ...] = ()
    profile: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_zones(self.zones, self.length)
        for name, unit in (("thickness", "metres"), ("density", "kg/m³")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(name, f"is {value}, expected a positive number of {unit}")
        if not self.plies:
            raise InputError("laminate.plies", "is empty, expected at least one ply")

    @cached_property
    def section(self) -> Section:
        """The nominal section, with the whole's thickness and density."""
        ratio = self.thickness / sum(ply.thickness for ply in self.plies)
        turn = float(np.degrees(self.fibre_angle))
        plies = [
            Ply(ply.material, ratio * ply.thickness, ply.angle_deg + turn) for ply in self.plies
        ]
        stack = section(plies)
        heavier = self.density * self.thickness / stack.inertia[0]
        I0, I1, I2 = (heavier * part for part in stack.inertia)
        return replace(stack, inertia=(I0, I1, I2))

    @cached_property
    def nominal(self) -> dict[str, float]:
        """The materials' constants, density and dimensions, and the plies' angles in rad."""
        stack = ShellSection(self.plies, turning=True).nominal
        nominal = {
            name: value
            for name, value in stack.items()
            if re.sub(r"_\d+$", "", name) in PLY_CONSTANTS
        }
        nominal |= {name: float(getattr(self, name)) for name in ("density", *_DIMENSIONS)}
        nominal |= {name: value for name, value in stack.items() if name.startswith("angle_")}
        return nominal | zone_factors(self.zones)

    @cached_property
    def structure(self) -> Structure:
        """The strip, with u and v where the stack couples."""
        return self._structure(self.plies, (0, 1, *BENDING) if self.section.is_coupled else BENDING)

    def bending_stiffness(self, constants: FloatArray) -> float:
        """EI = b / d11 of the strip along x in N·m², free to twist and to bend across; d = (D - B
        A⁻¹ B)⁻¹.
        """
        own = dict(zip(self.nominal, constants, strict=False))
        stack = ShellSection(self.plies, turning=True)
        of = {
            name: value if (row := self.row(name, own)) is None else row
            for name, value in stack.nominal.items()
        }
        A, B, D, _ = stack.stiffness({name: np.asarray(value) for name, value in of.items()})
        return float(own["width"] / np.linalg.inv(D - B @ np.linalg.inv(A) @ B)[0, 0])


def check_zones(zones: tuple[float, ...], length: float) -> None:
    """Refuse lines between zones that are not inside the specimen, one beyond the other.

    Raises:
        InputError: as said.
    """
    ends = np.array([0.0, *zones, length])
    if not np.all(np.isfinite(ends)) or np.any(np.diff(ends) <= 1e-6 * length):
        raise InputError(
            "zones_m", f"are at {list(zones)}, expected rising places between 0 and {length:g} m"
        )


def divided(zones: tuple[float, ...], length: float, parts: int) -> tuple[float, ...]:
    """The lines between zones, and those that divide each into equal parts, m."""
    if not zones:
        return ()
    within = [np.linspace(a, b, parts + 1)[1:] for a, b in pairwise((0.0, *zones, length))]
    return tuple(np.concatenate(within)[:-1].tolist())


def zone_factors(zones: tuple[float, ...]) -> dict[str, float]:
    """The constants of the zones between such lines, nominally 1; none where there is no line."""
    return {f"zone_{number}": 1.0 for number in range(1, len(zones) + 2)} if zones else {}
