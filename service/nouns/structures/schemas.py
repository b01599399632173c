"""What a client sends and gets about structures; every value is checked for physical sense here.

Units are part of the names: m, kg/m³, Pa, degrees.
"""

from datetime import datetime
from typing import Annotated, Any, Self
from uuid import UUID

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from fecore.body import generators as core
from fecore.body.laminate import OrthotropicMaterial
from fecore.errors import InputError
from service.nouns.structures.shapes import Ply, Poisson, Shape, check_poisson
from service.platform.web import Id, Name, RequestModel, StrictModel, example, wrong
from service.platform.web.bodies import Meta, Tags, whole
from service.platform.web.quantities import (
    DENSITY_SD,
    LENGTH,
    LENGTH_SD,
    THICKNESS,
    THICKNESS_SD,
    WIDTH,
    Density,
    Length,
    Modulus,
)

Deviation = Annotated[float | None, Field(ge=0, le=1e9)]
"""A standard deviation: null where nobody stated it, 0 for what is exactly known."""

THICKNESS_AGREEMENT = 0.05
"""How far, relatively, the plies' thicknesses may add up to something else than the measured
thickness.
"""


class Geometry(RequestModel):
    """A strip: x along the length, y across the width, z through the thickness."""

    length_m: Annotated[Length, LENGTH]
    width_m: Annotated[Length, WIDTH]
    thickness_m: Annotated[Length, THICKNESS]

    @field_validator("thickness_m")
    @classmethod
    def _thinner_than_long(cls, thickness: float, info: ValidationInfo) -> float:
        length = info.data.get("length_m")
        if length is not None and thickness >= length:
            raise wrong(f"a thickness of {thickness} m is not below the length of {length} m")
        return thickness


class Material(RequestModel):
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
        return check_poisson(nu, info.data.get("Ex_Pa"), info.data.get("Ey_Pa"))

    def to_core(self, density: float) -> OrthotropicMaterial:
        """The core's material, with a density in kg/m³."""
        constants = {name.removesuffix("_Pa"): value for name, value in self}
        return OrthotropicMaterial(**constants, density=density)


class Laminate(RequestModel):
    """Plies from the bottom (z = -t/2) to the top."""

    plies: list[Ply] = Field(min_length=1, max_length=1000)


class Piece(RequestModel):
    """A stretch along x where the strip is thicker or thinner than the geometry says, on both faces
    alike.
    """

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
        description=(
            "steps and tapers of thickness along x, in the order of x; the geometry's thickness"
            " holds elsewhere; []: one thickness"
        ),
    ),
]


_RETENTION = (
    "days after its import after which a file is deleted, and so are time blocks, once FRFs or"
    " spectra were made of them; their SHA-256, spectra, FRFs, modes and results stay"
)
RetentionDays = Annotated[int | None, Field(ge=1, le=36_500), BeforeValidator(whole)]


class StructureInputs(RequestModel):
    """How well a structure's own values are known: standard deviations. null: a careful
    laboratory's; 0: exactly known.
    """

    length_sd_m: Annotated[Deviation, LENGTH_SD] = None
    width_sd_m: Annotated[Deviation, LENGTH_SD] = None
    height_sd_m: Annotated[Deviation, LENGTH_SD] = None
    thickness_sd_m: Annotated[Deviation, THICKNESS_SD] = None
    density_sd_kg_m3: Annotated[Deviation, DENSITY_SD] = None
    nu_xy_sd: Deviation = None
    fibre_angle_sd_deg: Deviation = Field(
        None, description="of the fibres' direction about the stated one"
    )
    ply_angle_sd_deg: Deviation = Field(
        None,
        description=(
            "of each ply's angle about the stated one, where constants of plies are updated"
        ),
    )


class StructureIn(RequestModel):
    """A structure as a client describes it.

    A name is enough to measure and identify it. An update needs the geometry and the density of a
    strip or plate, and a laminate or a material, not both; or a shape.
    """

    model_config = example(
        name="FRP beam",
        geometry={"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.010},
        density_kg_m3=2012,
        material={
            "Ex_Pa": 33e9,
            "Ey_Pa": 32e9,
            "Gxy_Pa": 5.7e9,
            "Gxz_Pa": 4.5e9,
            "Gyz_Pa": 4.5e9,
            "nu_xy": 0.15,
        },
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
    shape: Shape | None = Field(
        None, description="a profile, a panel or a strip by its dimensions; instead of a geometry"
    )

    model: Id | None = Field(
        None,
        description=(
            "id of a model that was sent to the structure: the body that it is; instead of a"
            " geometry or shape"
        ),
    )
    retention_days: RetentionDays = Field(None, description=f"{_RETENTION}; null: never")
    tags: Tags = Field([])
    meta: Meta = Field({})

    @model_validator(mode="after")
    def _one_body(self) -> Self:
        named = [
            name
            for name in ("shape", "model", "geometry", "laminate", "material", "pieces")
            if getattr(self, name)
        ]
        if len(named) > 1 and named[0] in ("shape", "model"):
            raise wrong(f"a {named[0]} has its own {' and '.join(named[1:])}")
        return self

    @model_validator(mode="after")
    def _pieces_on_it(self) -> Self:
        if self.pieces:
            if self.geometry is None:
                raise wrong("pieces belong to a geometry; state it too")
            try:
                pieces = tuple(piece.to_core() for piece in self.pieces)
                core.check_pieces(self.geometry.length_m, pieces)
            except InputError as error:
                raise wrong(str(error)) from None
        return self

    @model_validator(mode="after")
    def _one_section(self) -> Self:
        if self.laminate is not None and self.material is not None:
            raise wrong("state a laminate or a material, not both")
        if self.laminate is not None and self.geometry is not None:
            total, measured = (
                sum(ply.thickness_m for ply in self.laminate.plies),
                self.geometry.thickness_m,
            )
            if abs(total - measured) > THICKNESS_AGREEMENT * measured:
                raise wrong(
                    f"the plies are {total:.6g} m thick together, the geometry says {measured} m"
                )
        return self


class StructurePatch(RequestModel):
    """Members to change; null is not a value here, but of `retention_days`. A laminate takes the place of a material, and a
    geometry, a shape or a model that of the other two, with all that was stated of them.
    """

    model_config = example(density_kg_m3=2020)

    name: Name | None = None
    geometry: Geometry | None = None
    density_kg_m3: Density | None = None
    laminate: Laminate | None = None
    material: Material | None = None
    inputs: StructureInputs | None = Field(
        None, description="takes the place of the former; {} clears it"
    )
    pieces: Pieces | None = None
    shape: Shape | None = None
    model: Id | None = Field(
        None, description="an earlier model of the structure, to go back to it"
    )
    retention_days: RetentionDays = Field(None, description=f"{_RETENTION}; null ends the rule")
    tags: Tags | None = None
    meta: Meta | None = None


class StructureOut(StrictModel):
    """A structure in its current version."""

    id: UUID
    project_id: UUID
    name: str
    version: int = Field(
        description=(
            "counts from 1; every change of geometry, density, section or inputs makes a new one"
        )
    )
    geometry: Geometry | None
    density_kg_m3: float | None
    laminate: Laminate | None
    material: Material | None
    inputs: StructureInputs | None
    pieces: Pieces | None
    shape: Shape | None
    model: UUID | None = Field(description="id of the model that it is; null where it is none")
    retention_days: int | None = Field(description=f"{_RETENTION}; null: never")
    replaced: list[str] = Field(
        description=(
            "what the version before had and another member has taken the place of, such as `shape`"
        )
    )
    tags: list[str]
    meta: dict[str, Any]
    created_at: datetime
    updated_at: datetime
