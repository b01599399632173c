"""Names of constants, their units and signs; and what updating asks of a body."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Protocol

from fecore.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    from fecore.body.model import Model
    from fecore.body.supports import NodeSpring, Spring

UNITS = {
    **dict.fromkeys(("Ex", "Ey", "Gxy", "Gxz", "Gyz", "E", "G"), "Pa"),
    **dict.fromkeys(("E1", "E2", "G12", "G13", "G23"), "Pa"),
    **dict.fromkeys(
        ("nu_xy", "nu", "nu12", "zone", "factor", "mass_factor", "clamp_compliance"), "1"
    ),
    "density": "kg/m³",
    **dict.fromkeys(("length", "width", "height", "thickness", "t"), "m"),
    **dict.fromkeys(("fibre_angle", "angle"), "rad"),
    "area": "m²",
    "I1": "m⁴",
    "I2": "m⁴",
    "J": "m⁴",
    "per_K": "1/K",
    "temperature": "°C",
}
"""SI unit of each kind of constant."""

SIGNED = frozenset({"nu_xy", "nu", "nu12", "fibre_angle", "angle", "per_K", "temperature"})
"""Kinds of constants that may be negative: Poisson's ratios, angles, coefficients of
temperature.
"""


FACTORS = frozenset({"zone", "factor"})
"""Kinds of constants that scale the stiffness of a zone or a set: nearly all of them are expected
to be 1.
"""


def kind_of(constant: str) -> str:
    """A constant's name without its set and the number of its material or ply: E1 of flange.E1_2,
    angle of angle_3.
    """
    return re.sub(r"_\d+$", "", constant.rpartition(".")[2])


class Body(Protocol):
    """What updating asks of a body.

    Closed forms take (c, …) constants in the order of `nominal`, and complex ones too: their
    derivatives are complex steps.
    """

    @property
    def nominal(self) -> dict[str, float]:
        """Constants that can be parameters, by name, SI."""
        ...

    @property
    def springs(self) -> tuple[Spring | NodeSpring, ...]:
        """Elastic supports, the last coefficients of the model's stiffness."""
        ...

    @property
    def model_error(self) -> float:
        """Relative error of a natural frequency that the model is known to have, independent from
        mode to mode.
        """
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
