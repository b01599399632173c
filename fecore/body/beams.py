"""Sections of beams: their constants to the coefficients of stiffness and mass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.constants import Parameter, of_beams
from fecore.errors import InputError

LEAST_SHEAR = 1e-3
"""Shear factor that no section falls below; thin walls across the force leave some 0.01."""


@dataclass(frozen=True)
class BeamSection:
    """A beam's section; axes 1 and 2 lie across the beam, axis 2 = tangent × axis 1."""

    # E, G: nominal moduli, Pa
    E: float
    G: float
    density: float  # nominal, kg/m³
    area: float  # m²
    # ∫z² dA, ∫y² dA and ∫yz dA, m⁴, of places y n₁ + z n₂ from the centroid
    inertia: tuple[float, float, float]
    torsion: float  # J, m⁴
    shear: tuple[float, float] = (5 / 6, 5 / 6)  # shear factors κ along axes 1 and 2
    # direction whose projection across the beam is axis 1, in the structure's frame
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    # from the nodes to the centroid, m, in the structure's frame
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    terms = ("EA", "GA1", "GA2", "GJ", "EI1", "EI2", "EI12")
    motions = ("m_1", "m", "mJ", "mI1", "mI2", "mI12")
    blocks: ClassVar[tuple[IntArray, ...]] = (
        *(np.array([[k]]) for k in range(4)),
        np.array([[4, 6], [6, 5]]),
    )
    motion_blocks: ClassVar[tuple[IntArray, ...]] = (
        *(np.array([[k]]) for k in range(3)),
        np.array([[3, 5], [5, 4]]),
    )

    def __post_init__(self) -> None:
        for name in ("E", "G", "density", "area", "torsion"):
            value = getattr(self, name)
            if not (np.isfinite(value) and (value > 0 or (name == "density" and value == 0))):
                raise InputError(f"section.{name}", f"is {value}, expected a positive number")
        first, second, mixed = self.inertia
        if not (first > 0 and second > 0 and mixed**2 < first * second):
            raise InputError(
                "section.inertia", f"is {self.inertia}, expected ∫z², ∫y² and ∫yz of a real section"
            )

    @property
    def is_rod(self) -> bool:
        """Whether it resists stretch and twist alone: shear factors of next to nothing. Parts of it
        would give way between its ends.
        """
        return max(self.shear) < LEAST_SHEAR

    @classmethod
    def rectangle(
        cls, width: float, height: float, E: float, G: float, density: float
    ) -> BeamSection:
        """A rectangle, `width` along axis 1 and `height` along axis 2."""
        one = np.ones(())
        torsion = float(rectangle_torsion(one, one, width * one, height * one))
        inertia = (width * height**3 / 12, height * width**3 / 12, 0.0)
        return cls(E, G, density, width * height, inertia, torsion)

    def default_parameters(self) -> tuple[Parameter, ...]:
        """What is updated of it: its E, which G follows where both are of one material."""
        return of_beams(self.nominal)

    @property
    def nominal(self) -> dict[str, float]:
        """E, G and density, area, I1 = ∫z² dA and I2 = ∫y² dA, J, and a factor of all stiffness."""
        first, second, _ = self.inertia
        section = {"area": self.area, "I1": first, "I2": second, "J": self.torsion}
        return {"E": self.E, "G": self.G, "density": self.density, **section, "factor": 1.0}

    @property
    def matrices(self) -> FloatArray:
        """(7, 6, 6) by `terms` on the strains of a beam."""
        matrices = np.zeros((7, 6, 6))
        for k in range(6):
            matrices[k, k, k] = 1
        matrices[6, 4, 5] = matrices[6, 5, 4] = -1
        return matrices

    @property
    def mass_matrices(self) -> FloatArray:
        """(6, 6, 6) by `motions` on the motions of a beam; along it, and of turns across it, they
        are apart.
        """
        matrices = np.zeros((6, 6, 6))
        matrices[0, 0, 0] = matrices[1, 1, 1] = matrices[1, 2, 2] = matrices[2, 3, 3] = matrices[
            3, 4, 4
        ] = matrices[4, 5, 5] = 1
        matrices[5, 4, 5] = matrices[5, 5, 4] = -1
        return matrices

    def coefficients(self, constants: Mapping[str, FloatArray]) -> FloatArray:
        """(7, …) of `terms`."""
        factor = constants["factor"]
        E, G, area = factor * constants["E"], factor * constants["G"], constants["area"]
        first, second = constants["I1"], constants["I2"]
        shears = [shear * G * area for shear in self.shear]
        return np.stack(
            [E * area, *shears, G * constants["J"], E * first, E * second, self.inertia[2] * E]
        )

    def inertias(self, constants: Mapping[str, FloatArray]) -> FloatArray:
        """(6, …) of `motions`."""
        density, area, first, second = (constants[name] for name in ("density", "area", "I1", "I2"))
        rows = [area, area, first + second, first, second, self.inertia[2] + 0 * area]
        return np.stack([density * row for row in rows])

    @property
    def reach(self) -> float:
        """Half the width of the thin rectangle with this area and polar inertia, m: how far from
        the axis material lies.
        """
        return float(np.sqrt(3 * (self.inertia[0] + self.inertia[1]) / self.area))


def rectangle_torsion(
    Gxy: FloatArray, Gxz: FloatArray, width: FloatArray, thickness: FloatArray
) -> FloatArray:
    """GJ in N·m², by St-Venant's series for an orthotropic rectangle (Lekhnitskii, *Theory of
    Elasticity of an Anisotropic Body*, section 35):

        GJ = Gxy b t³/3 [1 - 192 t/(π⁵ b') Σ_odd tanh(nπb'/2t)/n⁵],   b' = b √(Gxz/Gxy)
    """
    n = np.arange(1, 200, 2)
    slenderness = width / thickness * np.sqrt(Gxz / Gxy)
    series = np.sum(np.tanh(n * np.pi * slenderness[..., None] / 2) / n**5.0, axis=-1)
    return np.asarray(
        Gxy * width * thickness**3 / 3 * (1 - 192 / (np.pi**5 * slenderness) * series)
    )
