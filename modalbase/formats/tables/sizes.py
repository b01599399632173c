"""Sizes of a specimen that lines above its curve state."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from modalbase.formats.tables.preamble import Statement
from modalbase.formats.units import LENGTH, factor_of, read_unit, unit_in_name

Size = Literal["width", "thickness", "gauge_length", "area"]
_OF = r"(?:(?:specimen|sample|initial|original|proben?)[ _-]*)?"
_NAMES: dict[Size, str] = {
    "width": r"(?:width|breite|largeur|ancho)(?:[ _-]*b[0o]?)?|b[0o]",
    "thickness": r"(?:thickness|dicke|épaisseur|espesor)(?:[ _-]*a[0o]?)?|a[0o]",
    "gauge_length": r"(?:ga(?:u)?ge[ _-]*length|(?:anfangs)?messlänge)(?:[ _-]*l[0o]?)?|l[0o]",
    "area": r"(?:cross[ _-]*section(?:al)?[ _-]*)?area(?:[ _-]*[sa][0o]?)?|querschnitt(?:s?fläche)?(?:[ _-]*s[0o]?)?|s[0o]",
}
_PATTERNS = {
    size: re.compile(_OF + f"(?:{names})", re.IGNORECASE) for size, names in _NAMES.items()
}


@dataclass(frozen=True)
class StatedSize:
    """A size that a line states, for one specimen or several."""

    size: Size
    values: tuple[float, ...]  # m, m² of an area
    words: str  # of the line


def sizes_of(statements: Iterable[Statement], separator: str) -> tuple[StatedSize, ...]:
    """The sizes that statements state with a unit.

    >>> stated = sizes_of([Statement(1, "Breite b0", ("20,0", "mm"))], ";")[0]
    >>> stated.size, stated.values, stated.words
    ('width', (0.02,), "line 1 states 'Breite b0: 20,0 mm'")
    """
    sizes = []
    for stated in statements:
        name = unit_in_name(stated.name)[0]
        size = next((size for size, own in _PATTERNS.items() if own.fullmatch(name)), None)
        values = [
            value * factor
            for value, unit in stated.numbers(separator)
            if size and (factor := _factor(size, unit)) is not None and value > 0
        ]
        if size and values:
            sizes.append(StatedSize(size, tuple(values), stated.words))
    return tuple(sizes)


def _factor(size: Size, unit: str) -> float | None:
    if size != "area":
        return factor_of("length", unit)
    read = read_unit(unit)
    return read.factor if read is not None and read.dimension == LENGTH.times(LENGTH) else None
