"""A rectangular specimen as a laboratory describes it, and its finite element model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.errors import InputError
from fecore.laminate import OrthotropicMaterial, Ply, Section, section
from fecore.mesh import rectangle
from fecore.model import PlateModel, plate
from fecore.supports import Boundary, PointMass, Spring, Supports


@dataclass(frozen=True)
class Specimen:
    """A strip of a homogenised orthotropic material; x along its length from the clamped end, z out of plane.

    Attributes:
        length, width, thickness: m.
        material: nominal constants and density.
        boundary: how it is held.
        masses: what it carries, such as a sensor.
        divisions: elements along the length and across the width.
        springs: elastic supports; their stiffnesses can be updating parameters, by their names.
        supports: held edges, where they are not those of the boundary's name.
    """

    length: float
    width: float
    thickness: float
    material: OrthotropicMaterial
    boundary: Boundary = "cantilever"
    masses: tuple[PointMass, ...] = ()
    divisions: tuple[int, int] = (40, 4)
    springs: tuple[Spring, ...] = ()
    supports: Supports | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise InputError("geometry.thickness_m", f"is {self.thickness}, expected a positive number of metres")

    @property
    def section(self) -> Section:
        """The nominal section."""
        return section([Ply(self.material, self.thickness)])

    @cached_property
    def model(self) -> PlateModel:
        """The affine finite element model, which holds for any constants and thickness.

        Raises:
            InputError: the geometry, or the place of a mass or a spring, is wrong.
        """
        held = Supports.of(self.boundary) if self.supports is None else self.supports
        return plate(rectangle(self.length, self.width, *self.divisions), held, self.masses, self.springs)
