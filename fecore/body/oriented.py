"""A specimen cut from a material at an angle, whose angle and clamp are constants too.

Several specimens of one material share its moduli in the material's own axes; each has an angle of its own, which the saw has
missed by a degree, and a clamp that yields. Both become constants of the body, with the moduli and the dimensions.

The clamp is a hinge at x = 0 with a rotational spring k along the edge. Its constant is the compliance C = EI/kL, with the
nominal bending stiffness EI along the strip, so that C = 0 is a rigid clamp and C = 0.01 lowers the first bending mode by 2 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.body.mesh import rectangle
from fecore.body.model import PlateModel, plate
from fecore.body.profile import profile_of
from fecore.body.specimen import Specimen
from fecore.body.supports import Spring, Supports
from fecore.errors import InputError

_ANGLE = 10  # one row of the constants that a `Specimen` has not
_CLAMP = 11  # ... and the other


@dataclass(frozen=True)
class OrientedSpecimen(Specimen):
    """A `Specimen` with the further constants `fibre_angle`, rad, and, where its clamp may yield, `clamp_compliance`.

    Attributes:
        clamp_compliance: nominal EI/kL of the clamped edge; 0 for one that is rigid, or for a body that is not clamped.
    """

    clamp_compliance: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (np.isfinite(self.clamp_compliance) and self.clamp_compliance >= 0):
            raise InputError("clamp_compliance", f"is {self.clamp_compliance}, expected EI/kL, not negative")
        if self.clamp_compliance and self.boundary != "cantilever":
            raise InputError("clamp_compliance", f"belongs to a clamp; the boundary is {self.boundary}")
        if self.zones:
            raise InputError("zones_m", "are of a single update; an oriented specimen has none")
        if self.springs or self.supports is not None:
            raise InputError("springs", "and supports of an oriented specimen are those of its boundary and clamp")

    @property
    def nominal(self) -> dict[str, float]:
        """The material's constants, the dimensions, the angle, and the clamp's compliance where it has one."""
        own = {"fibre_angle": self.fibre_angle}
        if self.clamp_compliance:
            own["clamp_compliance"] = self.clamp_compliance
        return {**super().nominal, **own}

    @cached_property
    def model(self) -> PlateModel:
        """The affine finite element model; the clamp's spring is the last term of its stiffness.

        Raises:
            InputError: the geometry, or the place of a mass, is wrong.
        """
        profile = profile_of(self.length, self.thickness, self.pieces)
        mesh = rectangle(self.length, self.width, *(self.divisions or (40, 4)), profile.breaks if profile else ())
        if not self.clamp_compliance:
            return plate(mesh, Supports.of(self.boundary), self.masses, profile=profile)
        hinged, clamp = Supports(start="simply_supported"), (Spring("clamp", 1.0, 5, edge="start"),)
        return plate(mesh, hinged, self.masses, clamp, profile=profile)

    @property
    def bending_modulus(self) -> float:
        """Nominal Young's modulus along the strip, Pa: 1/E = c⁴/Ex + s⁴/Ey + (1/Gxy - 2ν/Ex) s²c²."""
        m, c, s = self.material, np.cos(self.fibre_angle), np.sin(self.fibre_angle)
        return float(1 / (c**4 / m.Ex + s**4 / m.Ey + (1 / m.Gxy - 2 * m.nu_xy / m.Ex) * s**2 * c**2))

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(9, …) of the shell at the angle among the constants, and the spring per metre of edge, k = EI/(C L b)."""
        shell = self.stiffness_at(constants[:_ANGLE], constants[_ANGLE])
        if not self.clamp_compliance:
            return shell
        per_metre = self.bending_modulus * self.thickness**3 / (12 * self.length * constants[_CLAMP])
        return np.concatenate([shell, per_metre[None]])

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) those of the specimen, and a positive compliance."""
        physical = super().are_physical(constants[:_ANGLE])
        return physical & (constants[_CLAMP] > 0) if self.clamp_compliance else physical
