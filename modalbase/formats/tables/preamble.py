"""What lines above the data of a table state: units and factors of its columns, references of
decibels, a sampling rate, how many lines there are.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from modalbase.formats.errors import FormatError
from modalbase.formats.factors import REFERENCE, changes
from modalbase.formats.tables.numbers import is_number, number_reader
from modalbase.formats.units import (
    NO_UNIT,
    decibels_in,
    factor_of,
    level_of,
    read_unit,
    unit_in_name,
)

_LABEL = re.compile(r"unit|einheit|unité|unidad", re.IGNORECASE)
_LABELLED = re.compile(rf"(?:{_LABEL.pattern})\w*\s*[:=]", re.IGNORECASE)
_AXIS_LABEL = re.compile(
    rf"(?:(x|y|z|amplitude|ordinate|abscissa|data|signal|value|frf)[ _-]*)?(?:axis|achse)?[ _-]*"
    rf"(?:amplitude[ _-]*)?(?:{_LABEL.pattern})(?:s|en)?[ _-]*(?:label|string)?[ _-]*(x|y|z)?",
    re.IGNORECASE,
)
_COUNT = re.compile(
    r"(?:(?:number|no\.?|#|anzahl|nombre)[ _-]*(?:of|der|de)?[ _-]*)?"
    r"(?:(?:data|spectral|frequency)[ _-]*)?(?:lines|samples|points|werte|linien|punkte|scans)",
    re.IGNORECASE,
)
_MOST = 500  # lines above the data that are looked at, those next to it
_WINDOW = re.compile(r"window|fenster|fenêtre|weighting", re.IGNORECASE)
_LINE_STEP = re.compile(
    r"(?:delta|d|Δ)[ _-]*f|(?:freq\w*|line)?[ _.-]*(?:resolution|spacing|increment)"
    r"|(?:frequenz)?auflösung|linienabstand",
    re.IGNORECASE,
)
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


@dataclass(frozen=True)
class Statement:
    """What a line above a table states: a name, and its value, or one of each column."""

    line: int  # from 1
    name: str
    values: tuple[str, ...]  # those that are empty at the end left out

    @property
    def words(self) -> str:
        """The same in a sentence."""
        return f"line {self.line} states {' '.join((f'{self.name}:', *self.values))[:60]!r}"

    def of_columns(self, width: int, places: Sequence[int]) -> dict[int, str]:
        """The value of each column: one alone is of all but the first, or of the first where it is
        said to be of the x axis; others stand in the order of the columns, with or without that of
        the first.

        Args:
            width: of the table, cells.
            places: of its columns of numbers.
        """
        match = _AXIS_LABEL.fullmatch(self.name)
        if len(self.values) == 1:
            of_x = match and {"x", "abscissa"} & {str(word).lower() for word in match.groups()}
            return dict.fromkeys(places[:1] if of_x else places[1:] or places, self.values[0])
        if len(self.values) in (len(places), len(places) - 1):
            return dict(zip(places[len(places) - len(self.values) :], self.values, strict=True))
        return dict(zip(range(1, width), self.values, strict=False))

    def numbers(self, separator: str) -> Iterator[tuple[float, str]]:
        """Its numbers, each with the unit behind it or in its name."""
        in_name = unit_in_name(self.name)[1]
        behind = next((cell for cell in self.values[1:] if not is_number(cell)), "")
        for text in [*self.values[:1], *filter(is_number, self.values[1:])]:
            match = re.match(r"([0-9.,eE+-]+)\s*(\S*)", text.strip())
            if match is not None and is_number(match[1]):
                decimal = "," if "," in match[1] else "."
                try:
                    value = number_reader([match[1]], decimal, separator)[1](match[1])
                except FormatError:  # a date, a version
                    continue
                yield value, in_name or match[2] or behind


def statements_of(preamble: Sequence[Row], separator: str) -> list[Statement]:
    """What lines above a table state.

    >>> rows = [Row(1, ["X Unit: Hz", "Y Unit: g/N"]), Row(2, ["Scale", "1", "2", ""])]
    >>> [(stated.name, stated.values) for stated in statements_of(rows, ",")]
    [('X Unit', ('Hz',)), ('Y Unit', ('g/N',)), ('Scale', ('1', '2'))]
    """
    stated = []
    for row in preamble[-_MOST:]:
        cells = [" ".join(row.cells)] if separator == " " else row.cells[: row.width]
        parts = [re.split(r"\s*[:=]\s*", cell, maxsplit=1) for cell in cells if cell]
        if all(len(part) == 2 and part[1] for part in parts):
            stated += [Statement(row.line, name.strip(), (value,)) for name, value in parts]
        else:
            stated.append(Statement(row.line, cells[0].rstrip(":= "), tuple(cells[1:])))
    return stated


def cells_of_units(row: Row | None, width: int) -> list[str]:
    """Cells of a line of units by column, without a label before them."""
    if row is not None and row.width > width and _LABEL.search(row.cells[0]):
        row = Row(row.line, row.cells[1:])
    return padded(row, width)


def columns_stated(
    statements: Sequence[Statement], names: Sequence[str], units: list[str], places: Sequence[int]
) -> tuple[list[str], list[str]]:
    """Units of columns and factors beside them, "" where there are none.

    Units are those that the columns have themselves, and where they have none those of a line such
    as LabVIEW's `Y_Unit_Label`; decibels without a reference get that of a line.
    """
    units, factors = list(units), [""] * len(units)
    for stated in statements:
        one = len(stated.values) == 1 and _AXIS_LABEL.fullmatch(stated.name)
        of_units = one or (len(stated.values) > 1 and _LABEL.search(stated.name))
        is_reference = REFERENCE.fullmatch(stated.name)
        if not (of_units or is_reference or any(changes(stated.name, v) for v in stated.values)):
            continue
        for place, cell in stated.of_columns(len(units), places).items():
            if is_reference:
                reference = f"dB re {cell}"
                own = level_of(units[place] or decibels_in(names[place]) or names[place])
                if own == "":
                    units[place] = reference
                elif own and read_unit(level_of(reference) or "") not in (None, read_unit(own)):
                    units[place] = units[place] or decibels_in(names[place])
                    factors[place] = f"reference = {cell}"
            elif changes(stated.name, cell):
                factors[place] = f"{stated.name} = {cell}"
            elif of_units and not units[place] and read_unit(bare_unit(cell)):
                units[place] = "" if unit_in_name(names[place])[1] else bare_unit(cell)
    return units, factors


def rate_of(statements: Sequence[Statement], separator: str) -> float | None:
    """The sampling rate in Hz that a preamble states; None where it states none, or several."""
    rates = set()
    for stated in statements:
        bare = unit_in_name(stated.name)[0]
        is_step = _STEP.fullmatch(bare)
        if not (is_step or _RATE.fullmatch(bare)):
            continue
        for value, unit in stated.numbers(separator):
            if not is_step and (per_second := _PER_SECOND.fullmatch(unit)):
                unit = f"{per_second[1].lower()}Hz"
            factor = factor_of("time" if is_step else "frequency", unit) if unit else 1.0
            if factor and value > 0:
                rates.add(float(f"{1 / (value * factor) if is_step else value * factor:.9g}"))
    return rates.pop() if len(rates) == 1 else None


def windows_of(statements: Sequence[Statement]) -> list[str]:
    """What to say of an exponential window that a preamble states."""
    return [
        f"{each.words}, which is not used: state it as `window_rate_per_s` of channels of hits, and"
        " mind it in damping ratios of FRFs"
        for each in statements
        if _WINDOW.search(each.name) and "exp" in " ".join((each.name, *each.values)).lower()
    ]


def count_of(statements: Sequence[Statement], separator: str) -> tuple[int, Statement] | None:
    """How many lines a preamble says that its table has, and where; None where it says none."""
    stated = (
        (int(value), each)
        for each in statements
        if _COUNT.fullmatch(each.name)
        for value, unit in each.numbers(separator)
        if not unit
    )
    return next(stated, None)


def units_above(statements: Sequence[Statement]) -> tuple[str, ...]:
    """What lines state of units, such as `Force unit: N`, whatever they are of."""
    return tuple(
        each.words
        for each in statements
        if _LABEL.search(each.name) and any(read_unit(bare_unit(value)) for value in each.values)
    )


def line_step_of(statements: Sequence[Statement], separator: str) -> tuple[float, Statement] | None:
    """The step in Hz between lines of a spectrum that a preamble states, and where."""
    stated = (
        (value * factor, each)
        for each in statements
        if _LINE_STEP.fullmatch(unit_in_name(each.name)[0])
        for value, unit in each.numbers(separator)
        if (factor := factor_of("frequency", unit or "Hz")) and value > 0
    )
    return next(stated, None)
