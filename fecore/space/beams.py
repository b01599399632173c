"""Sections of beams: linear in their constants, so the constants are the coefficients."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.errors import InputError


@dataclass(frozen=True)
class BeamSection:
    """A beam's section; axes 1 and 2 lie across the beam, axis 2 = tangent × axis 1.

    Attributes:
        E, G: nominal moduli, Pa.
        density: nominal, kg/m³.
        area: m².
        inertia: ∫z² dA, ∫y² dA and ∫yz dA, m⁴, of places y n₁ + z n₂ from the centroid.
        torsion: J, m⁴.
        shear: shear factors κ along axes 1 and 2.
        axis: direction whose projection across the beam is axis 1, in the structure's frame.
        offset: from the nodes to the centroid, m, in the structure's frame.
    """

    E: float
    G: float
    density: float
    area: float
    inertia: tuple[float, float, float]
    torsion: float
    shear: tuple[float, float] = (5 / 6, 5 / 6)
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    terms = ("E", "G")
    blocks: tuple[IntArray, ...] = (np.array([[0]]), np.array([[1]]))

    def __post_init__(self) -> None:
        for name in ("E", "G", "density", "area", "torsion"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"section.{name}", f"is {value}, expected a positive number")
        first, second, mixed = self.inertia
        if not (first > 0 and second > 0 and mixed**2 < first * second):
            raise InputError("section.inertia", f"is {self.inertia}, expected ∫z², ∫y² and ∫yz of a real section")

    @classmethod
    def rectangle(cls, width: float, height: float, E: float, G: float, density: float) -> BeamSection:
        """A rectangle, `width` along axis 1 and `height` along axis 2 (torsion by Roark, good to .4 %)."""
        a, b = max(width, height), min(width, height)
        torsion = a * b**3 * (1 / 3 - 0.21 * b / a * (1 - b**4 / (12 * a**4)))
        inertia = (width * height**3 / 12, height * width**3 / 12, 0.0)
        return cls(E, G, density, width * height, inertia, torsion)

    @property
    def nominal(self) -> dict[str, float]:
        """E, G and density."""
        return {"E": self.E, "G": self.G, "density": self.density}

    @cached_property
    def matrices(self) -> FloatArray:
        """(2, 6, 6) by E and G on the strains of a beam."""
        first, second, mixed = self.inertia
        found = np.zeros((2, 6, 6))
        found[0, 0, 0] = self.area
        found[0, 4:, 4:] = [[first, -mixed], [-mixed, second]]
        found[1, 1, 1], found[1, 2, 2] = self.shear[0] * self.area, self.shear[1] * self.area
        found[1, 3, 3] = self.torsion
        return found

    @cached_property
    def mass_matrix(self) -> FloatArray:
        """(6, 6) by the density on the motions of a beam."""
        first, second, mixed = self.inertia
        found = np.diag([self.area] * 3 + [first + second, first, second])
        found[4, 5] = found[5, 4] = -mixed
        return found

    def coefficients(self, constants: Mapping[str, FloatArray]) -> FloatArray:
        """(2, …) E and G."""
        return np.stack([constants["E"], constants["G"]])
