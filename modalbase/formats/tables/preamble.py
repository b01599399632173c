"""What lines above the data of a table say: units of its columns, and a sampling rate."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from modalbase.formats.tables.numbers import is_number, number_reader
from modalbase.formats.units import NO_UNIT, factor_of, level_of, read_unit, unit_in_name

_LABEL = re.compile(r"unit|einheit|unité|unidad", re.IGNORECASE)
_LABELLED = re.compile(rf"(?:{_LABEL.pattern})\w*\s*[:=]\s*\S", re.IGNORECASE)
_RATE = re.compile(
    r"(?:sampl\w*|scan|abtast\w*|mess)[ _-]*(?:rate|freq\w*)|fr[eé]quence"
    r" d.[eé]chantillonnage|fs|sr",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"delta[ _]?[xt]|d[xt]|(?:sampl\w*|time)[ _-]*(?:interval|period|step|increment)|abtastintervall",
    re.IGNORECASE,
)
_PER_SECOND = re.compile(r"(k?)(?:(?:sa?|samples?|scans?)/s(?:ec)?|sps)", re.IGNORECASE)


@dataclass(frozen=True)
class Row:
    """A line that is not blank."""

    line: int  # from 1
    cells: list[str]  # without blanks around them
    is_comment: bool = False

    @property
    def width(self) -> int:
        """Number of cells, those that are empty at the end apart."""
        return max((i for i, cell in enumerate(self.cells, 1) if cell), default=0)


def padded(row: Row | None, width: int) -> list[str]:
    """So many cells of a line, those that it lacks empty."""
    cells = [] if row is None else row.cells[:width]
    return [*cells, *[""] * (width - len(cells))]


def bare_unit(cell: str) -> str:
    """A unit without brackets around it.

    >>> bare_unit("(mm)"), bare_unit("(1/N)*(m/s²)")
    ('mm', '(1/N)*(m/s²)')
    """
    return cell[1:-1].strip() if re.fullmatch(r"[(\[{<][^()\[\]{}<>]*[)\]}>]", cell) else cell


def is_units(row: Row) -> bool:
    """Whether half of the words of a line, or more, are units; "Y-Unit: N" says one of no
    column.
    """
    if row.cells and _LABELLED.search(row.cells[0]):
        return False
    words = [bare_unit(cell) for cell in row.cells if cell]
    units = sum(read_unit(word) is not None or level_of(word) is not None for word in words)
    none = sum(word.lower() in NO_UNIT for word in words)
    return units > 0 and 2 * (units + none) >= len(words)


def labelled_units(preamble: Sequence[Row], units: list[str]) -> list[str]:
    """Units of columns, and where they have none those of a line that begins with a label, such as
    `Y_Unit_Label`.
    """
    for row in preamble:
        cells = padded(row, len(units))
        labels = [cell for cell in row.cells if _LABEL.search(cell)]  # two: one of each axis
        is_labelled = labels == row.cells[:1] and labels and not _LABELLED.search(labels[0])
        if is_labelled and any(read_unit(cell) for cell in cells[1:]):
            units = [
                own or (bare_unit(cell) if i and read_unit(cell) else "")
                for i, (own, cell) in enumerate(zip(units, cells, strict=True))
            ]
    return units


def rate_of(preamble: Sequence[Row], separator: str) -> float | None:
    """The sampling rate in Hz that a preamble states; None where it states none, or several."""
    rates = set()
    for row in preamble:
        cells = row.cells
        if len(cells) == 1 or separator == " ":
            cells = re.split(r"[:=]\s*", " ".join(cells), maxsplit=1)
        bare, in_name = unit_in_name(cells[0].strip().rstrip(":= "))
        is_step = _STEP.fullmatch(bare)
        if not (is_step or _RATE.fullmatch(bare)):
            continue
        behind = " ".join(cell for cell in cells[2:3] if not is_number(cell))
        for text in [*cells[1:2], *filter(is_number, cells[2:])]:  # one, or one of each column
            match = re.match(r"([0-9.,eE+-]+)\s*(\S*)", text.strip())
            if match is None or not is_number(match[1]):
                continue
            unit = in_name or match[2] or behind
            if not is_step and (per_second := _PER_SECOND.fullmatch(unit)):
                unit = f"{per_second[1].lower()}Hz"
            factor = factor_of("time" if is_step else "frequency", unit) if unit else 1.0
            decimal = "," if "," in match[1] else "."
            value = number_reader([match[1]], decimal, separator)[1](match[1])
            if factor and value > 0:
                rates.add(float(f"{1 / (value * factor) if is_step else value * factor:.9g}"))
    return rates.pop() if len(rates) == 1 else None
