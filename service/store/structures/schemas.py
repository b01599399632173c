"""What a client sends and gets about structures; every value is checked for physical sense here.

Units are part of the names: m, kg/m³, Pa, degrees.
"""

from __future__ import annotations

import math
from datetime import datetime
from typing import Annotated, Self
from uuid import UUID

from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from fecore.body import generators as core
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.laminate import Ply as CorePly
from fecore.errors import InputError
from service.web import Name, StrictModel, example
from service.web.quantities import (
    DENSITY_SD,
    LENGTH,
    LENGTH_SD,
    PLY_THICKNESS,
    THICKNESS,
    THICKNESS_SD,
    WIDTH,
    Density,
    Length,
    Modulus,
)

Poisson = Annotated[float, Field(gt=-10, lt=10)]

Deviation = Annotated[float | None, Field(ge=0, le=1e9)]
"""A standard deviation: null where nobody stated it, 0 for what is exactly known."""

THICKNESS_AGREEMENT = 0.05
"""How far, relatively, the plies' thicknesses may add up to something else than the measured thickness."""


class Geometry(StrictModel):
    """A strip: x along the length, y across the width, z through the thickness."""

    length_m: Annotated[Length, LENGTH]
    width_m: Annotated[Length, WIDTH]
    thickness_m: Annotated[Length, THICKNESS]

    @field_validator("thickness_m")
    @classmethod
    def _thinner_than_long(cls, thickness: float, info: ValidationInfo) -> float:
        length = info.data.get("length_m")
        if length is not None and thickness >= length:
            raise PydanticCustomError(
                "not_a_strip", "a thickness of {t} m is not below the length of {l} m", {"t": thickness, "l": length}
            )
        return thickness


def _check_poisson(nu: float, along: float | None, across: float | None) -> float:
    """Refuse ν with ν² E_across / E_along ≥ 1: the plane-stress stiffness would not be positive definite."""
    if along is not None and across is not None and nu * nu * across / along >= 1:
        raise PydanticCustomError(
            "not_positive_definite",
            "{nu} makes the stiffness not positive definite: its magnitude must be below {limit}, the root of E1/E2",
            {"nu": nu, "limit": float(f"{math.sqrt(along / across):.6g}")},
        )
    return nu


class Material(StrictModel):
    """A homogenised orthotropic material in the specimen's axes, nominal values."""

    Ex_Pa: Modulus
    Ey_Pa: Modulus
    Gxy_Pa: Modulus
    Gxz_Pa: Modulus
    Gyz_Pa: Modulus
    nu_xy: Poisson

    @field_validator("nu_xy")
    @classmethod
    def _positive_definite(cls, nu: float, info: ValidationInfo) -> float:
        return _check_poisson(nu, info.data.get("Ex_Pa"), info.data.get("Ey_Pa"))


class Ply(StrictModel):
    """One ply; 1 is the fibre direction, at `angle_deg` from x towards y."""

    E1_Pa: Modulus
    E2_Pa: Modulus
    G12_Pa: Modulus
    G13_Pa: Modulus
    G23_Pa: Modulus
    nu_12: Poisson
    density_kg_m3: Density | None = Field(None, description="kg/m³; the structure's density where it is not given")
    thickness_m: Annotated[Length, PLY_THICKNESS]
    angle_deg: float = Field(ge=-360, le=360)

    @field_validator("nu_12")
    @classmethod
    def _positive_definite(cls, nu: float, info: ValidationInfo) -> float:
        return _check_poisson(nu, info.data.get("E1_Pa"), info.data.get("E2_Pa"))

    def material(self, density: float) -> OrthotropicMaterial:
        """The ply's material in its own axes, with a density in kg/m³."""
        return OrthotropicMaterial(
            Ex=self.E1_Pa,
            Ey=self.E2_Pa,
            Gxy=self.G12_Pa,
            Gxz=self.G13_Pa,
            Gyz=self.G23_Pa,
            nu_xy=self.nu_12,
            density=density,
        )

    def to_core(self, density: float) -> CorePly:
        """The core's ply, with the structure's density where it states none of its own."""
        return CorePly(self.material(self.density_kg_m3 or density), self.thickness_m, self.angle_deg)


class Laminate(StrictModel):
    """Plies from the bottom (z = -t/2) to the top."""

    plies: list[Ply] = Field(min_length=1, max_length=1000)


class Piece(StrictModel):
    """A stretch along x where the strip is thicker or thinner than the geometry says, on both faces alike."""

    from_m: float = Field(ge=0, le=1000, description="x of its beginning")
    to_m: Length
    thickness_m: Annotated[Length, THICKNESS] = Field(description="m, at its beginning")
    end_thickness_m: Annotated[Length, THICKNESS] | None = Field(
        None, description="m, at its end; default: as at its beginning. Between them a taper"
    )

    def to_core(self) -> core.Piece:
        """The core's piece."""
        last = self.thickness_m if self.end_thickness_m is None else self.end_thickness_m
        return core.Piece(self.from_m, self.to_m, self.thickness_m, last)


Pieces = Annotated[
    list[Piece],
    Field(
        max_length=50,
        description="steps and tapers of thickness along x, in the order of x; the geometry's thickness holds elsewhere; "
        "[]: one thickness",
    ),
]


class StructureInputs(StrictModel):
    """How well a structure's own values are known: standard deviations. null: a careful laboratory's; 0: exactly known."""

    length_sd_m: Annotated[Deviation, LENGTH_SD] = None
    width_sd_m: Annotated[Deviation, LENGTH_SD] = None
    thickness_sd_m: Annotated[Deviation, THICKNESS_SD] = None
    density_sd_kg_m3: Annotated[Deviation, DENSITY_SD] = None
    nu_xy_sd: Deviation = None
    fibre_angle_sd_deg: Deviation = Field(None, description="of the fibres' direction about the stated one")
    ply_angle_sd_deg: Deviation = Field(
        None, description="of each ply's angle about the stated one, where constants of plies are updated"
    )


class StructureIn(StrictModel):
    """A structure as a client describes it.

    A name is enough to measure and identify it. An update needs the geometry and the density of a strip or plate, and a
    laminate or a material, not both.
    """

    model_config = example(
        name="FRP beam",
        geometry={"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.010},
        density_kg_m3=2012,
        material={"Ex_Pa": 33e9, "Ey_Pa": 32e9, "Gxy_Pa": 5.7e9, "Gxz_Pa": 4.5e9, "Gyz_Pa": 4.5e9, "nu_xy": 0.15},
    )

    name: Name
    geometry: Geometry | None = Field(
        None, description="of a strip or plate; an update needs it, an identification does not"
    )
    density_kg_m3: Density | None = Field(None, description="kg/m³; an update needs it")
    laminate: Laminate | None = None
    material: Material | None = None
    inputs: StructureInputs | None = Field(
        None, description="how well geometry, density and section are known, for updates"
    )
    pieces: Pieces | None = None

    @model_validator(mode="after")
    def _pieces_on_it(self) -> Self:
        if self.pieces:
            if self.geometry is None:
                raise PydanticCustomError("pieces_of_nothing", "pieces belong to a geometry; state it too")
            try:
                pieces = tuple(piece.to_core() for piece in self.pieces)
                core.check_pieces(self.geometry.length_m, pieces)
            except InputError as error:
                raise PydanticCustomError("pieces_do_not_fit", "{why}", {"why": str(error)}) from None
        return self

    @model_validator(mode="after")
    def _one_section(self) -> Self:
        if self.laminate is not None and self.material is not None:
            raise PydanticCustomError("one_section", "state a laminate or a material, not both")
        if self.laminate is not None and self.geometry is not None:
            total, measured = sum(ply.thickness_m for ply in self.laminate.plies), self.geometry.thickness_m
            if abs(total - measured) > THICKNESS_AGREEMENT * measured:
                raise PydanticCustomError(
                    "thickness_disagrees",
                    "the plies are {total} m thick together, the geometry says {measured} m",
                    {"total": float(f"{total:.6g}"), "measured": measured},
                )
        return self


class StructurePatch(StrictModel):
    """Members to change. A laminate replaces a material and the other way round; null is not a value here."""

    model_config = example(density_kg_m3=2020)

    name: Name | None = None
    geometry: Geometry | None = None
    density_kg_m3: Density | None = None
    laminate: Laminate | None = None
    material: Material | None = None
    inputs: StructureInputs | None = Field(None, description="takes the place of the former; {} clears it")
    pieces: Pieces | None = None


class StructureOut(StrictModel):
    """A structure in its current version."""

    id: UUID
    project_id: UUID
    name: str
    version: int = Field(
        description="counts from 1; every change of geometry, density, section or inputs makes a new one"
    )
    geometry: Geometry | None
    density_kg_m3: float | None
    laminate: Laminate | None
    material: Material | None
    inputs: StructureInputs | None
    pieces: Pieces | None
    created_at: datetime
    updated_at: datetime
