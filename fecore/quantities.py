"""The table of quantities: each row says all that anything else needs to know of a kind of number.

Bodies, parameters of an update, inputs of a laboratory, coupons, monitors, search, pages and
sentences look their units, signs, usual ranges and tolerances up here. A new kind of parameter is a
row, and the body that has it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

CLAMP = "clamp_compliance"
"""Name of the compliance EI/kL of a clamp that may yield: a half-normal about nothing, so that a
firm one surprises nobody.
"""


@dataclass(frozen=True)
class Quantity:
    """What one kind of number measures."""

    unit: str  # of SI
    meaning: str = ""  # in words
    signed: bool = False  # whether it may be negative
    factor: bool = False  # whether it scales the stiffness of a zone or set, expected to be 1
    # lowest and highest magnitude that is taken without question, 0 always is; None where any is
    usual: tuple[float, float] | None = None
    likely: tuple[float, float] = (0.0, 0.0)  # where what was meant is looked for first
    mistaken: tuple[float, ...] = ()  # factors from units that people write in its place to `unit`
    # the same two ranges of its standard deviation
    sd_usual: tuple[float, float] | None = None
    sd_likely: tuple[float, float] = (0.0, 0.0)
    input: str = ""  # which of a laboratory's inputs it is, as a constant of a body
    # standard deviation of a careful laboratory, and whether it is a share of the value
    tolerance: tuple[float, bool] | None = None
    # standard deviation of its prior in an update where none is stated, as a share of the mean
    prior_sd: float = 0.30
    # mean and standard deviation of its relative change, 1/K
    per_k: tuple[float, float] | None = None

    @property
    def sd(self) -> Quantity | None:
        """What its standard deviation measures; None where any is usual."""
        if self.sd_usual is None:
            return None
        return replace(self, usual=self.sd_usual, likely=self.sd_likely)


SHOWN = {
    "Pa": (1e-9, "GPa"),
    "m": (1e3, "mm"),
    "s": (1e6, "µs"),
    "1/K": (100.0, "%/K"),
    "1": (1.0, "–"),
}
"""Factor and unit in which tables and figures show a value of an SI unit; others as they are."""

WRITTEN = {
    **{unit: SHOWN[unit] for unit in ("Pa", "m", "1/K")},
    "kg": (1e3, "g"),
    "rad": (180 / np.pi, "°"),
    "1": (1.0, ""),
}
"""The same in sentences and fields."""

FIBRES_PER_K, MATRIX_PER_K = (-0.0005, 0.0005), (-0.002, 0.0015)
EITHER_PER_K = (
    (FIBRES_PER_K[0] + MATRIX_PER_K[0]) / 2,
    float(
        np.sqrt(
            (FIBRES_PER_K[1] ** 2 + MATRIX_PER_K[1] ** 2) / 2
            + (FIBRES_PER_K[0] - MATRIX_PER_K[0]) ** 2 / 4
        )
    ),
)
"""Mean and standard deviation of the relative change of a modulus that fibres carry, of one that
the matrix carries, and of one of either kind, 1/K.
"""

_MM_CM, _G_CM3_T_MM3 = (1e-3, 1e-2), (1e3, 1e12)
_LENGTH = Quantity(
    "m", "length", False, False, (0.02, 100), (0.05, 20), _MM_CM, (0, 0.1), (1e-5, 0.02)
)
_WIDTH = replace(_LENGTH, meaning="width", usual=(1e-3, 30), likely=(5e-3, 5))
_THICKNESS = Quantity(
    "m", "thickness", False, False, (5e-5, 0.3), (2e-4, 0.1), _MM_CM, (0, 5e-3), (1e-6, 1e-3)
)
_MODULUS = Quantity(
    "Pa",
    "modulus",
    usual=(1e6, 1.2e12),
    likely=(1e8, 1e12),
    mistaken=(1e9, 1e6),
    sd_usual=(1e4, 1.2e12),
    sd_likely=(1e7, 5e11),
)
_POISSON = Quantity("1", "Poisson's ratio", signed=True, input="nu_xy")
_ALONG = replace(_MODULUS, meaning="Young's modulus along the fibres", per_k=FIBRES_PER_K)
_ACROSS = replace(_MODULUS, meaning="Young's modulus across the fibres", per_k=MATRIX_PER_K)
_SHEAR = replace(_MODULUS, meaning="shear modulus", per_k=MATRIX_PER_K)
_DEGREE = (float(np.radians(1.0)), False)

CONSTANTS: dict[str, Quantity] = {
    **dict.fromkeys(("Ex", "E1"), _ALONG),
    **dict.fromkeys(("Ey", "E2"), _ACROSS),
    **dict.fromkeys(("Gxy", "Gxz", "Gyz", "G12", "G13", "G23"), _SHEAR),
    "E": Quantity("Pa", "Young's modulus of a beam", per_k=FIBRES_PER_K),
    "G": Quantity("Pa", "shear modulus of a beam", per_k=MATRIX_PER_K),
    "nu_xy": replace(_POISSON, tolerance=(0.05, False)),
    **dict.fromkeys(("nu", "nu12"), _POISSON),
    "density": Quantity(
        "kg/m³",
        "density",
        usual=(10, 25_000),
        likely=(400, 9000),
        mistaken=_G_CM3_T_MM3,
        sd_usual=(0.1, 5000),
        sd_likely=(1, 500),
        input="density",
        tolerance=(0.015, True),
    ),
    "length": replace(_LENGTH, input="length", tolerance=(0.5e-3, False)),
    "width": replace(_WIDTH, input="width", tolerance=(0.2e-3, False)),
    "height": Quantity("m", "height of a body", input="height", tolerance=(0.2e-3, False)),
    "thickness": replace(_THICKNESS, input="thickness", tolerance=(0.012, True)),
    "t": Quantity("m", "thickness of a wall", input="thickness"),
    "fibre_angle": Quantity(
        "rad", "angle of the fibres", signed=True, input="fibre_angle", tolerance=_DEGREE
    ),
    "angle": Quantity("rad", "angle of a ply", signed=True, input="ply_angle"),
    "zone": Quantity("1", "factor of the stiffness of a zone", factor=True),
    "factor": Quantity("1", "factor of the stiffness of a set", factor=True, per_k=EITHER_PER_K),
    "mass_factor": Quantity("1", "factor of the mass of a set"),
    CLAMP: Quantity("1", "compliance EI/kL of a clamp", tolerance=(0.0075, False)),
    "area": Quantity("m²", "area of a beam's section"),
    **dict.fromkeys(("I1", "I2"), Quantity("m⁴", "second moment of area of a beam's section")),
    "J": Quantity("m⁴", "torsion constant of a beam's section"),
    "per_K": Quantity("1/K", "relative change per kelvin", signed=True),
    "temperature": Quantity("°C", "temperature", signed=True),
}
"""Constants of bodies by their names, which parameters of an update have."""

QUANTITIES: dict[str, Quantity] = {
    **CONSTANTS,
    "modulus": _MODULUS,
    "ply_thickness": replace(
        _THICKNESS, meaning="thickness of a ply", usual=(5e-6, 0.1), likely=(5e-5, 0.03)
    ),
    "coupon_size": replace(_THICKNESS, meaning="size of a coupon", likely=(5e-4, 0.1)),
    "ply_angle": Quantity("rad", "angle of a ply", signed=True, tolerance=_DEGREE),
    "sensor_mass": Quantity(
        "kg",
        "mass of the sensor",
        usual=(0, 0.5),
        likely=(1e-4, 0.1),
        mistaken=(1e-3,),
        tolerance=(0.05, True),
    ),
    "delay": Quantity("s", "delay between channels", signed=True, tolerance=(30e-6, False)),
    "strength": Quantity(
        "Pa", "strength", usual=(1e5, 2e10), likely=(1e6, 1e10), mistaken=(1e6, 1e9)
    ),
    "strain": Quantity(
        "m/m", "strain at failure", usual=(1e-4, 0.5), likely=(1e-3, 0.1), mistaken=(1e-2, 1e-6)
    ),
}
"""Every kind of number by its name, with what inputs and coupons measure."""


def kind_of(constant: str) -> str:
    """A constant's name without its set and the number of its material or ply: E1 of flange.E1_2,
    angle of angle_3.
    """
    return re.sub(r"_\d+$", "", constant.rpartition(".")[2])


def quantity_of(constant: str) -> Quantity | None:
    """What a constant of a body measures; None of a name that is free, such as a spring's."""
    return CONSTANTS.get(kind_of(constant))


def usual_prior_sd(constant: str, mean: float) -> float:
    """Standard deviation of a constant's prior where none is stated; that of what has no row, such
    as a spring, is of a row's default.
    """
    return (quantity_of(constant) or Quantity).prior_sd * mean


def is_of_stiffness(constant: str) -> bool:
    """Whether a constant is a modulus, or a factor of stiffness."""
    quantity = quantity_of(constant)
    return quantity is not None and (quantity.unit == "Pa" or quantity.factor)


def is_signed(constant: str) -> bool:
    """Whether a constant may be negative: Poisson's ratio, an angle, a coefficient of temperature."""
    quantity = quantity_of(constant)
    return quantity is not None and quantity.signed
