"""Numbers as testing machines write them: decimal point or comma, thousands grouped or not."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

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
