"""Cells of a table: numbers with their decimal sign and groups, times of day, dates, words."""

import re
from collections.abc import Callable, Sequence
from typing import Literal

from modalbase.formats.errors import FormatError

Kind = Literal["number", "time", "date", "empty", "text"]
"""What a cell holds."""

_SIGNS = str.maketrans(
    {"−": "-", "’": "'", "‘": "'", "\u00a0": " ", "\u2007": " ", "\u2009": " ", "\u202f": " "}
)
_NUMBER = re.compile(
    r"[+-]?(?:\d{1,3}(?:['"
    r" ]\d{3})+(?:[.,]\d*)?|\d[\d.,]*|[.,]\d+)(?<!,)(?:[eEdD](?:-\d{1,3}|\+?0?\d{1,2}))?"
)
_GROUPED = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}(\{mark}\d{{3}})+") for mark in ".,"}
_OTHER = {".": ",", ",": "."}
_DATE = (
    r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2}(?:\d{2})?|\d{1,2}[-"
    r" ][A-Za-z]{3}[- ]\d{2,4}"
)
_ONLY_DATE = re.compile(_DATE)
_TIME = re.compile(
    rf"(?:(?:{_DATE})[T\s]\s*)?(?:(\d{{1,3}}):)?(\d{{1,3}}):(\d{{1,2}})(?:[.,](\d+))?\s*([ap]m)?(?:Z|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
_NOTHING = {"", "nan", "-nan", "n/a", "#n/a"}
_INFINITE = re.compile(r"[+-]?inf(?:inity)?", re.IGNORECASE)  # as dB of 0 are written
_PART = r"\d[\d.,]*(?:e[+-]?\d+)?"
_COMPLEX = re.compile(rf"\(?[+-]?{_PART}[+-]{_PART}\*?[ij]\)?", re.IGNORECASE)
_HALF_DAY = 43_200.0


def is_number(cell: str) -> bool:
    """Whether a cell is written as a number, whatever its decimal sign.

    >>> is_number("1,25e-3"), is_number("1'234.50"), is_number("2.5E+003"), is_number("12 kN"), is_number("1e999")
    (True, True, True, False, False)
    """
    return _NUMBER.fullmatch(cell.translate(_SIGNS)) is not None


def is_complex(cell: str) -> bool:
    """Whether a cell is a complex number, as Matlab, Python and Excel write one.

    >>> [is_complex(cell) for cell in ("1.5e-3-2i", "(1+2j)", "1,5 + 2,0*i", "1-2", "2i", "12-X")]
    [True, True, True, False, False, False]
    """
    return _COMPLEX.fullmatch(cell.replace(" ", "")) is not None


def kind_of(cell: str) -> Kind:
    """What a cell holds.

    >>> [kind_of(cell) for cell in ("1.5", "10:00:00,25", "3.3.2024 10:00:00.1", "03.03.2024", "NaN", "-inf", "OVER")]
    ['number', 'time', 'time', 'date', 'empty', 'number', 'text']
    """
    if _ONLY_DATE.fullmatch(cell):
        return "date"
    if is_number(cell) or _INFINITE.fullmatch(cell):
        return "number"
    if cell.lower() in _NOTHING:
        return "empty"
    match = _TIME.fullmatch(cell) if ":" in cell else None
    return "time" if match and (match[1] or match[4]) else "text"  # 10:30 may be hours or minutes


def seconds_of(cell: str) -> float:
    """Seconds since midnight of a time of day, or since 0 of a stop watch.

    >>> seconds_of("10:00:00,25"), seconds_of("01:30.5"), seconds_of("2024-03-03T01:00:00 PM")
    (36000.25, 90.5, 46800.0)
    """
    match = _TIME.fullmatch(cell)
    if match is None:
        raise ValueError(cell)
    hours = int(match[1] or 0)
    if match[5]:
        hours = hours % 12 + 12 * (match[5].lower() == "pm")
    return 3600.0 * hours + 60.0 * int(match[2]) + float(f"{match[3]}.{match[4] or 0}")


class Clock:
    """Seconds since the first of a column of times, over midnight."""

    def __init__(self) -> None:
        self._first: float | None = None
        self._last = 0.0

    def seconds(self, cell: str) -> float:
        """Seconds of the next cell."""
        now = seconds_of(cell)
        if self._first is None:
            self._first = self._last = now
        while now < self._last - _HALF_DAY:
            now += 2 * _HALF_DAY
        self._last = now
        return now - self._first


def number_reader(
    cells: Sequence[str], decimal: str | None, separator: str
) -> tuple[str, Callable[[str], float]]:
    """The decimal sign of a table, and a function that reads its cells; an empty cell is NaN.

    A point alone is a decimal point. Commas are decimal unless all of them could be grouped
    thousands, as in `1,234`; that a reader cannot know, so it must be stated. Apostrophes and
    blanks only group.

    Args:
        cells: of the table.
        decimal: sign that is stated; None where it is not.
        separator: of the cells.

    Raises:
        FormatError: the sign is ambiguous, or (from the function) a cell does not fit it.
    """
    sign = decimal or _decimal_sign([_ungrouped(cell) for cell in cells], separator)

    def read(cell: str) -> float:
        if _INFINITE.fullmatch(cell):
            return float(cell)
        return float("nan") if cell.lower() in _NOTHING else float(number_text(cell, sign))

    return sign, read


def number_text(cell: str, decimal: str) -> str:
    """A number with a decimal point and without groups.

    >>> number_text("1'234,5", ",")
    '1234.5'

    Raises:
        FormatError: it is none with this decimal sign.
    """
    other = _OTHER[decimal]
    bare = _ungrouped(cell).replace("D", "E").replace("d", "e")
    mantissa = re.split("[eE]", bare)[0]
    integer, _, fraction = mantissa.partition(decimal)
    misplaced = (
        other in fraction
        or decimal in fraction
        or (other in integer and not _GROUPED[other].fullmatch(integer))
    )
    if misplaced or not is_number(cell):
        raise FormatError(
            "decimal", f"{cell[:40]!r} is not a number with a decimal {decimal!r}; state decimal"
        )
    return bare.replace(other, "").replace(decimal, ".")


def _ungrouped(cell: str) -> str:
    """A number without apostrophes and blanks between its digits."""
    return cell.translate(_SIGNS).replace("'", "").replace(" ", "")


def _decimal_sign(cells: Sequence[str], separator: str) -> str:
    if separator == "," and not any("," in cell for cell in cells):
        return "."
    both = {
        "," if cell.rfind(",") > cell.rfind(".") else "."
        for cell in cells
        if "," in cell and "." in cell
    }
    if len(both) > 1:
        raise FormatError(
            "decimal", "some numbers have a decimal point and some a decimal comma; state decimal"
        )
    if both:
        return both.pop()
    commas = [cell for cell in cells if "," in cell]
    if not commas:
        return "."
    if all(_GROUPED[","].fullmatch(cell) for cell in commas):
        if any("." in cell for cell in cells) or any(cell.count(",") > 1 for cell in commas):
            return "."
        raise FormatError(
            "decimal", f"{commas[0]!r} may be a decimal comma or grouped thousands; state decimal"
        )
    return ","


def whole(cell: str, place: str) -> int:
    """The whole number in a cell.

    Raises:
        FormatError: it holds none.
    """
    try:
        return int(cell)
    except ValueError:
        raise FormatError(place, f"is {cell.strip()[:40]!r}, expected a whole number") from None


def real(cell: str, place: str) -> float:
    """The number in a cell with a decimal point.

    Raises:
        FormatError: it holds none.
    """
    try:
        return float(cell)
    except ValueError:
        raise FormatError(
            place, f"is {cell.strip()[:40]!r}, expected a number with a decimal point"
        ) from None
