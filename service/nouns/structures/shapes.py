"""Bodies by their shape: profiles and panels of a few dimensions, with the materials or plies of
their walls.
"""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from fecore.body import generators as core
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.laminate import Ply as CorePly
from fecore.body.mesh import Mesh
from fecore.body.sections import ShellSection
from fecore.errors import InputError
from service.platform.web import RequestModel, StrictModel, example, wrong
from service.platform.web.quantities import (
    LENGTH,
    PLY_THICKNESS,
    THICKNESS,
    WIDTH,
    Density,
    Length,
    Modulus,
)

Poisson = Annotated[float, Field(gt=-10, lt=10)]

Kind = Literal["strip", "i", "box", "channel", "angle", "tee", "panel"]
WALLS: dict[Kind, tuple[str, ...]] = {"strip": ("strip",), "panel": ("plate", "rib")}
"""Walls of the kinds that have not a flange and a web."""

ELEMENTS = 4
"""Over the larger side of a section: 20 modes lie within .2 % of those of a fine mesh."""

MOST_ELEMENTS = 6000
"""Of a mesh: an update with more would take many minutes."""


def check_poisson(nu: float, along: float | None, across: float | None) -> float:
    """Refuse ν with ν² E_across / E_along ≥ 1: the plane-stress stiffness would not be positive
    definite.
    """
    if along is not None and across is not None and nu * nu * across / along >= 1:
        raise wrong(
            f"{nu} makes the stiffness not positive definite: its magnitude must be below"
            f" {math.sqrt(along / across):.6g}, the root of E1/E2"
        )
    return nu


class PlyMaterial(RequestModel):
    """The material of a ply in its own axes, nominal values; 1 is the fibre direction."""

    E1_Pa: Modulus
    E2_Pa: Modulus
    G12_Pa: Modulus
    G13_Pa: Modulus
    G23_Pa: Modulus
    nu_12: Poisson
    density_kg_m3: Density | None = Field(
        None, description="kg/m³; the structure's density where it is not given"
    )

    @field_validator("nu_12")
    @classmethod
    def _positive_definite(cls, nu: float, info: ValidationInfo) -> float:
        return check_poisson(nu, info.data.get("E1_Pa"), info.data.get("E2_Pa"))

    def material(self, density: float) -> OrthotropicMaterial:
        """The core's material, with a density in kg/m³."""
        return OrthotropicMaterial(
            Ex=self.E1_Pa,
            Ey=self.E2_Pa,
            Gxy=self.G12_Pa,
            Gxz=self.G13_Pa,
            Gyz=self.G23_Pa,
            nu_xy=self.nu_12,
            density=density,
        )


class Ply(PlyMaterial):
    """One ply; 1 is the fibre direction, at `angle_deg` from x towards y."""

    thickness_m: Annotated[Length, PLY_THICKNESS]
    angle_deg: float = Field(ge=-360, le=360)

    def to_core(self, density: float) -> CorePly:
        """The core's ply, with the structure's density where it states none of its own."""
        return CorePly(
            self.material(self.density_kg_m3 or density), self.thickness_m, self.angle_deg
        )


class IsotropicMaterial(StrictModel):
    """A material that is alike in all directions, nominal values; G = E / (2 (1 + ν))."""

    E_Pa: Modulus
    nu: float = Field(gt=-1, lt=0.5)
    density_kg_m3: Density


class Section(StrictModel):
    """What a set of a mesh is: a thickness of one material, or plies; or dofs of its nodes that are
    held.
    """

    model_config = example(
        thickness_m=0.004,
        material={"E1_Pa": 23e9, "E2_Pa": 8.5e9, "G12_Pa": 3e9, "G13_Pa": 3e9, "G23_Pa": 2.4e9, "nu_12": 0.27,
                  "density_kg_m3": 1850},
        axis=[1, 0, 0],
    )  # fmt: skip

    thickness_m: Annotated[Length, THICKNESS] | None = Field(
        None, description="m; of plies their sum"
    )
    material: PlyMaterial | None = Field(None, description="with its density; 1 lies along `axis`")
    isotropic: IsotropicMaterial | None = Field(None, description="instead of a material")
    plies: list[Ply] | None = Field(
        None,
        min_length=1,
        max_length=1000,
        description="along the elements' normals, each with its density",
    )
    axis: list[float] | None = Field(
        None,
        min_length=3,
        max_length=3,
        description="axis 1 in the mesh's frame, projected; default x, or z where x is normal",
    )
    held_dofs: list[Annotated[int, Field(ge=1, le=6)]] | None = Field(
        None,
        min_length=1,
        description=(
            "of a set of lines or points that holds the body; 1, 2, 3 along x, y, z; 4, 5, 6 about"
        ),
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        materials = [each for each in (self.material, self.isotropic) if each is not None]
        named = (
            (self.thickness_m is not None and len(materials) == 1)
            + bool(self.plies)
            + bool(self.held_dofs)
        )
        if named != 1 or (materials and self.thickness_m is None):
            raise wrong(
                "state thickness_m and a material or isotropic one, or plies, or held_dofs: one of"
                " these alone"
            )
        if any(each.density_kg_m3 is None for each in (*materials, *(self.plies or ()))):
            raise wrong("a density_kg_m3 is missing: a mesh has none, and nothing would vibrate")
        if self.axis is not None and not any(self.axis):
            raise wrong("the axis has no direction")
        return self


class Wall(RequestModel):
    """A wall of a shape: a thickness of one material, or plies."""

    thickness_m: Annotated[Length, THICKNESS] | None = Field(
        None, description="m; of plies their sum"
    )
    material: PlyMaterial | None = Field(
        None, description="where it is not the shape's; 1 lies along x"
    )
    plies: list[Ply] | None = Field(
        None,
        min_length=1,
        max_length=1000,
        description="from one face to the other, angles from x; instead of a material",
    )

    def thickness(self) -> float:
        """Nominal, m."""
        return self.thickness_m or sum(ply.thickness_m for ply in self.plies or ())


class Shape(RequestModel):
    """A body extruded along x: y and z from the middle of the outer dimensions, z up.

    A flange or a plate lies on top (of an angle below, with its web on the left); webs and ribs
    stand. A panel's ribs lie below its plate.
    """

    model_config = example(
        kind="i",
        length_m=1.5,
        width_m=0.06,
        height_m=0.12,
        material={
            "E1_Pa": 23e9,
            "E2_Pa": 8.5e9,
            "G12_Pa": 3e9,
            "G13_Pa": 3e9,
            "G23_Pa": 2.4e9,
            "nu_12": 0.27,
        },
        walls={"flange": {"thickness_m": 0.006}, "web": {"thickness_m": 0.006}},
    )

    kind: Kind = Field(
        description="what the section is: its walls, and where they lie, follow from it"
    )
    length_m: Annotated[Length, LENGTH]
    width_m: Annotated[Length, WIDTH] = Field(description="m along y, outside")
    height_m: Annotated[Length, WIDTH] | None = Field(
        None, description="m along z, outside; a strip has none"
    )
    ribs_m: list[float] = Field(
        default_factory=list,
        max_length=100,
        description="y of each rib of a panel, rising",
        validate_default=True,
    )
    material: PlyMaterial | None = Field(
        None, description="of the walls that state none of their own; 1 lies along x"
    )
    walls: dict[str, Wall] = Field(
        max_length=2,
        description="by name: flange and web; of a panel plate and rib; of a strip strip",
    )

    @field_validator("height_m")
    @classmethod
    def _only_strips_are_flat(cls, height: float | None, info: ValidationInfo) -> float | None:
        if info.data.get("kind") == "strip" and height is not None:
            raise wrong("a strip has no height; its wall has a thickness")
        return height

    @field_validator("ribs_m")
    @classmethod
    def _only_panels_have_ribs(cls, ribs: list[float], info: ValidationInfo) -> list[float]:
        kind = info.data.get("kind")
        if kind is not None and bool(ribs) != (kind == "panel"):
            raise wrong(
                "a panel has at least one rib" if kind == "panel" else f"{kind} has no ribs"
            )
        return ribs

    @field_validator("walls")
    @classmethod
    def _each_wall_once(cls, walls: dict[str, Wall], info: ValidationInfo) -> dict[str, Wall]:
        if (kind := info.data.get("kind")) is None:
            return walls
        expected = WALLS.get(kind, ("flange", "web"))
        if set(walls) != set(expected):
            raise wrong(f"are {', '.join(walls) or 'none'}; {kind} has {' and '.join(expected)}")
        for name, wall in walls.items():
            _check_wall(name, wall, common=info.data.get("material") is not None)
        return {name: walls[name] for name in expected}

    @field_validator("walls")
    @classmethod
    def _walls_fit(cls, walls: dict[str, Wall], info: ValidationInfo) -> dict[str, Wall]:
        # what is wrong with another member is said there
        if len(info.data) < len(cls.model_fields) - 1:
            return walls
        try:
            cls.model_construct(**info.data, walls=walls).mesh()
        except InputError as error:
            raise wrong(str(error)) from None
        return walls

    def mesh(self, elements: int = ELEMENTS) -> Mesh:
        """The core's mesh.

        Raises:
            InputError: a dimension leaves no wall.
        """
        t = [wall.thickness() for wall in self.walls.values()]
        L, b, h = self.length_m, self.width_m, self.height_m or 0.0
        if not h and self.kind != "strip":
            raise InputError("height_m", f"is missing: {self.kind} needs one")
        across = 3 * elements if self.kind == "panel" else elements
        walls = {"strip": b, "panel": b + len(self.ribs_m) * h}.get(self.kind, 2 * (b + h))
        side = (b if self.kind in WALLS else max(b, h)) / across
        if (number := L * walls / side**2) > MOST_ELEMENTS:
            raise InputError(
                "length_m",
                f"of {L:g} m takes {number:.0f} elements of {1e3 * side:.3g} mm, at most"
                f" {MOST_ELEMENTS} are taken; are all dimensions in m?",
            )
        if self.kind == "strip":
            return core.strip(L, b, math.ceil(across * L / b), across)
        if self.kind == "panel":
            return core.panel(L, b, h, plate=t[0], rib=t[1], ribs=self.ribs_m, elements=across)
        return core.profile(self.kind, L, h, b, flange=t[0], web=t[1], elements=elements)

    def sections(self, density: float | None) -> dict[str, ShellSection]:
        """The core's section of each wall.

        Args:
            density: of walls whose material states none, kg/m³.

        Raises:
            InputError: a wall's density is stated nowhere.
        """
        sections = {}
        for name, wall in self.walls.items():
            material = wall.material or self.material
            plies = wall.plies or (
                [] if material is None else
                [Ply(**material.model_dump(), thickness_m=wall.thickness(), angle_deg=0.0)]
            )  # fmt: skip
            if density is None and any(ply.density_kg_m3 is None for ply in plies):
                raise InputError(
                    "density_kg_m3",
                    f"is stated neither by the structure nor for its wall {name}: a model needs it",
                )
            sections[name] = ShellSection(tuple(ply.to_core(density or 0.0) for ply in plies))
        return sections

    @property
    def size(self) -> tuple[float, ...]:
        """Length, width and, where it has one, height, m."""
        return (self.length_m, self.width_m, *(() if self.height_m is None else (self.height_m,)))


def _check_wall(name: str, wall: Wall, *, common: bool) -> None:
    """A wall has plies, or a thickness and a material."""
    if wall.plies and (wall.material or wall.thickness_m):
        raise wrong(f"{name}: state plies, or a thickness of one material, not both")
    if not wall.plies and wall.thickness_m is None:
        raise wrong(f"{name} states neither thickness_m nor plies")
    if not wall.plies and not wall.material and not common:
        raise wrong(f"{name} states no material, and the shape states none for all walls")
