"""Numbers and units as testing machines write them: decimal point or comma, thousands grouped or not; and factors to SI."""

import re
from collections.abc import Callable, Sequence
from typing import Literal

from modalbase.formats.constants import POUND_FORCE, STANDARD_GRAVITY
from modalbase.formats.errors import FormatError

_NUMBER = re.compile(r"[+-]?(\d[\d.,]*|[.,]\d+)([eE](-\d{1,3}|\+?0?\d{1,2}))?")
_GROUPED = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}(\{mark}\d{{3}})+") for mark in ".,"}
_OTHER = {".": ",", ",": "."}


def is_number(cell: str) -> bool:
    """Whether a cell is written as a number, whatever its decimal sign.

    >>> is_number("1,25e-3"), is_number("2.5E+003"), is_number("12 kN"), is_number("1e999")
    (True, True, False, False)
    """
    return _NUMBER.fullmatch(cell) is not None


def number_reader(cells: Sequence[str], decimal: str | None, delimiter: str) -> tuple[str, Callable[[str], float]]:
    """The decimal sign of a table, and a function that reads its cells; an empty cell is NaN.

    A point alone is a decimal point. Commas are decimal unless all of them could be grouped thousands, as in `1,234`; that
    a reader cannot know, so it must be stated.

    Raises:
        FormatError: the sign is ambiguous, or (from the function) a cell does not fit it.
    """
    sign = decimal or _decimal_sign(cells, delimiter)
    other = _OTHER[sign]

    def read(cell: str) -> float:
        if not cell:
            return float("nan")
        mantissa = re.split("[eE]", cell)[0]
        whole, _, fraction = mantissa.partition(sign)
        if other in fraction or sign in fraction or (other in whole and not _GROUPED[other].fullmatch(whole)):
            raise FormatError("decimal", f"{cell!r} is not a number with a decimal {sign!r}; state decimal")
        return float(cell.replace(other, "").replace(sign, "."))

    return sign, read


def _decimal_sign(cells: Sequence[str], delimiter: str) -> str:
    if delimiter == "," and not any("," in cell for cell in cells):
        return "."
    both = {"," if cell.rfind(",") > cell.rfind(".") else "." for cell in cells if "," in cell and "." in cell}
    if len(both) > 1:
        raise FormatError("decimal", "some numbers have a decimal point and some a decimal comma; state decimal")
    if both:
        return both.pop()
    commas = [cell for cell in cells if "," in cell]
    if not commas:
        return "."
    if all(_GROUPED[","].fullmatch(cell) for cell in commas):
        if any("." in cell for cell in cells) or any(cell.count(",") > 1 for cell in commas):
            return "."
        raise FormatError("decimal", f"{commas[0]!r} may be a decimal comma or grouped thousands; state decimal")
    return ","


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
