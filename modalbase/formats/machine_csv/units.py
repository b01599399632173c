"""Units that testing machines write, and their factors to SI."""

from __future__ import annotations

from typing import Literal

from modalbase.formats.constants import POUND_FORCE, STANDARD_GRAVITY
from modalbase.formats.errors import FormatError

Quantity = Literal["force", "stress", "strain", "length", "time"]

_INCH = 0.0254
_PSI = POUND_FORCE / _INCH**2

FACTORS: dict[Quantity, dict[str, float]] = {
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6, "lbf": POUND_FORCE, "lb": POUND_FORCE, "kip": 1e3 * POUND_FORCE,
              "klbf": 1e3 * POUND_FORCE, "kgf": STANDARD_GRAVITY},
    "stress": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "N/mm²": 1e6, "N/mm2": 1e6, "GPa": 1e9, "psi": _PSI, "ksi": 1e3 * _PSI,
               "Msi": 1e6 * _PSI},
    "strain": {"m/m": 1.0, "mm/mm": 1.0, "in/in": 1.0, "1": 1.0, "%": 1e-2, "µε": 1e-6, "µm/m": 1e-6, "um/m": 1e-6,
               "ue": 1e-6, "µstrain": 1e-6, "microstrain": 1e-6, "ustrain": 1e-6, "strain": 1.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "um": 1e-6, "in": _INCH, "inch": _INCH, "mil": 1e-3 * _INCH},
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
}  # fmt: skip
"""SI value of one unit, by quantity. MN and mN, Msi and msi differ, so capitals count."""


def factor(quantity: Quantity, unit: str, field: str) -> float:
    """The SI value of one unit of a quantity. Capitals count: MN and mN differ.

    >>> factor("force", "kN", "columns.load.unit"), factor("strain", "µε", "columns.gauge.unit")
    (1000.0, 1e-06)

    Args:
        quantity: what is measured.
        unit: as the file or the caller states it, with or without brackets.
        field: where it was stated, for the error.

    Raises:
        FormatError: the unit is none of the quantity's; lists them.
    """
    known = FACTORS[quantity]
    name = plain(unit)
    if name not in known and quantity == "strain" and name in FACTORS["length"]:
        raise FormatError(field, f"{unit!r} is an elongation, not a strain; state the gauge length")
    if name not in known:
        raise FormatError(field, f"{unit!r} is no unit of {quantity} that is known here; use one of {', '.join(known)}")
    return known[name]


def plain(unit: str) -> str:
    """A unit without its brackets, with one kind of micro sign and epsilon.

    >>> plain("[με]")
    'µε'
    """
    bare = unit.strip().strip("[](){}").strip()
    return bare.replace("μ", "µ").replace("ɛ", "ε").replace("µe", "µε") if bare != "µstrain" else bare
