"""Curves as testing machines write them, from bytes to SI arrays.

What machines do and what becomes of it:

- a preamble, blank lines, remarks between or after the data: passed over, remarks are quoted in the notes;
- BOM, UTF-8, UTF-16, else cp1252; tabs, semicolons or commas; decimal comma: found out, and said in the result;
- a header that comes again, or time that goes back: the machine was restarted, and each run stands alone;
- units: stated by the caller, in the header (`Load (kN)`) or in a line of units below it. Never guessed; where two of these
  disagree the file is refused;
- an empty cell is NaN; a cell that is no number is refused with its line and column.
"""

import csv
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.types import FloatArray
from modalbase.formats.units import factor_of, known_units, plain

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


def factor(quantity: Quantity, unit: str, field: str) -> float:
    """The SI value of one unit of a quantity; see `modalbase.formats.units`.

    >>> factor("force", "kN", "columns.load.unit"), factor("strain", "µε", "columns.gauge.unit")
    (1000.0, 1e-06)

    Args:
        quantity: what is measured.
        unit: as the file or the caller states it, with or without brackets.
        field: where it was stated, for the error.

    Raises:
        FormatError: the unit is none of the quantity's; lists them.
    """
    name = plain(unit)
    known = factor_of(quantity, name)
    if known is None and quantity == "strain" and factor_of("length", name) is not None:
        raise FormatError(field, f"{unit!r} is an elongation, not a strain; state the gauge length")
    if known is None:
        raise FormatError(field, f"{unit!r} is no unit of {quantity} that is known here; use {known_units(quantity)}")
    return known


_DELIMITERS = ("\t", ";", ",")
_MOST_QUOTED = 20  # remarks that are quoted in the notes
_UNIT_IN_HEADER = re.compile(r"^(.*?)\s*[\[({]([^\[\](){}]*)[\])}]\s*$")


@dataclass(frozen=True)
class Column:
    """Which column a quantity stands in."""

    header: str | int  # its name in the file, capitals and unit apart; or its number, from 1, where there is no header
    quantity: Quantity  # what it is
    unit: str | None = None  # None where the file states it


@dataclass(frozen=True)
class Run:
    """One run of the machine."""

    columns: Mapping[str, FloatArray]  # SI arrays by the caller's names; NaN where a cell was empty
    # first_line, last_line: of its data, from 1
    first_line: int
    last_line: int


@dataclass(frozen=True)
class MachineFile:
    """What was in a file."""

    runs: tuple[Run, ...]  # in the order of the file; more than one where the machine was restarted
    units: Mapping[str, str]  # as stated, by the caller's names
    # encoding, delimiter, decimal: as found or as stated
    encoding: str
    delimiter: str
    decimal: str
    notes: tuple[str, ...]  # remarks that were passed over, empty cells, restarts


@dataclass(frozen=True)
class _Layout:
    """Where the wanted columns are in the rows, and what the file says of them."""

    delimiter: str
    rows: list[list[str]]
    header_row: int  # -1 where there is none
    places: dict[str, int]


@dataclass(frozen=True)
class _Block:
    """Data rows of one run: line numbers and the wanted cells."""

    lines: list[int]
    cells: list[list[str]]


def read_machine_csv(
    data: bytes, columns: Mapping[str, Column], delimiter: str | None = None, decimal: str | None = None
) -> MachineFile:
    """Read a testing machine's text file.

    Args:
        data: the file.
        columns: the columns that are wanted, by the caller's names; a column named `time` also shows restarts.
        delimiter: tab, `;` or `,`; found out where None.
        decimal: `.` or `,`; found out where None.

    Raises:
        FormatError: the file, a line or a cell cannot be read, a unit is not stated or stated twice differently; says
            where and what to do.
    """
    if not columns:
        raise FormatError("columns", "names none, expected at least one")
    if decimal not in (None, ".", ","):
        raise FormatError("decimal", f"is {decimal!r}, expected . or ,")
    if delimiter not in (None, *_DELIMITERS):
        raise FormatError("delimiter", f"is {delimiter!r}, expected a tab, ; or ,")
    text, encoding = _decode(data)
    lines = re.split("\r\n|\n|\r", text)
    layout = _layout(lines, columns, _DELIMITERS if delimiter is None else (delimiter,))
    notes: list[str] = []
    blocks = _blocks(layout, columns, notes)
    cells = [cell for block in blocks for row in block.cells for cell in row]
    symbol, parse = number_reader(cells, decimal, layout.delimiter)
    units = _units(layout, columns)
    factors = [factor(c.quantity, units[name], f"columns.{name}.unit") for name, c in columns.items()]
    tables = [(np.array([[parse(cell) for cell in row] for row in b.cells]) * factors, b.lines) for b in blocks]
    names = list(columns)
    runs = [
        Run({name: part[:, i].copy() for i, name in enumerate(names)}, at[0], at[-1])
        for table, table_lines in tables
        for part, at in _split_at_time(table, table_lines, names)
    ]
    empty = sum(int(np.isnan(table).sum()) for table, _ in tables)
    if empty:
        notes.append(f"{empty} empty cells, taken as not measured")
    if len(runs) > 1:
        notes.append("restarted at line " + ", ".join(str(run.first_line) for run in runs[1:]))
    return MachineFile(tuple(runs), units, encoding, layout.delimiter, symbol, tuple(notes))


def _decode(data: bytes) -> tuple[str, str]:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        candidates: tuple[str, ...] = ("utf-16",)
    elif data.startswith(b"\xef\xbb\xbf"):
        candidates = ("utf-8-sig",)
    else:
        candidates = ("utf-8", "cp1252")
    for name in candidates:
        try:
            text = data.decode(name)
        except UnicodeDecodeError:
            continue
        if "\0" in text:
            raise FormatError("file", "holds NUL bytes; it is not text, export it as CSV")
        return text, name
    raise FormatError("file", "is neither UTF-8, UTF-16 nor cp1252 text; export it as UTF-8")


def _layout(lines: Sequence[str], columns: Mapping[str, Column], delimiters: Sequence[str]) -> _Layout:
    """The delimiter under which the header is found and most lines hold numbers in all wanted columns."""
    best: tuple[int, _Layout] | None = None
    reasons: list[FormatError] = []
    for delimiter in delimiters:
        rows = [_cells(line, delimiter, i) for i, line in enumerate(lines, 1)]
        try:
            layout = _find_columns(rows, delimiter, columns)
        except FormatError as error:
            reasons.append(error)
            continue
        places = layout.places.values()
        full = sum(all(p < len(row) and is_number(row[p]) for p in places) for row in rows[layout.header_row + 1 :])
        if best is None or full > best[0]:
            best = full, layout
    if best is None:
        raise next((e for e in reasons if "twice" in e.message), reasons[0])
    if best[0] == 0:
        raise FormatError("file", "has no line with a number in each of the wanted columns")
    return best[1]


def _cells(line: str, delimiter: str, number: int) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error as error:
        raise FormatError(f"line {number}", f"cannot be split into cells: {error}") from None


def _find_columns(rows: list[list[str]], delimiter: str, columns: Mapping[str, Column]) -> _Layout:
    numbered = {name: c.header - 1 for name, c in columns.items() if isinstance(c.header, int)}
    if any(place < 0 for place in numbered.values()):
        raise FormatError("columns", "are numbered from 1")
    wanted = {name: _bare(c.header) for name, c in columns.items() if isinstance(c.header, str)}
    if not wanted:
        return _Layout(delimiter, rows, -1, {name: numbered[name] for name in columns})
    nearest: set[str] = set(wanted.values())
    for i, row in enumerate(rows):
        bare = [_bare(cell) for cell in row]
        absent = {header for header in wanted.values() if header not in bare}
        if absent:
            nearest = min(nearest, absent, key=len)
            continue
        for name, header in wanted.items():
            if bare.count(header) > 1:
                raise FormatError(f"columns.{name}", f"{header!r} is in line {i + 1} twice; give the column's number")
        places = {**numbered, **{name: bare.index(header) for name, header in wanted.items()}}
        return _Layout(delimiter, rows, i, {name: places[name] for name in columns})
    raise FormatError("columns", f"no line has the header {', '.join(sorted(nearest))}")


def _bare(header: str) -> str:
    """A header without its unit, spaces and capitals."""
    match = _UNIT_IN_HEADER.match(header)
    return " ".join((match.group(1) if match else header).split()).casefold()


def _units_row(layout: _Layout, columns: Mapping[str, Column], index: int) -> dict[str, str] | None:
    """Units by column if this row is a line of units, else None.

    It is one where no wanted cell is a number and at least one is a unit of its column's quantity. Every column is read by
    itself: a cell that is no known unit says nothing of its column, and takes nothing from the others.
    """
    row = layout.rows[index]
    cells = {name: plain(row[p]) for name, p in layout.places.items() if p < len(row) and row[p]}
    if any(is_number(cell) for cell in cells.values()):
        return None
    return {name: cell for name, cell in cells.items() if factor_of(columns[name].quantity, cell) is not None} or None


def _units(layout: _Layout, columns: Mapping[str, Column]) -> dict[str, str]:
    below = (_units_row(layout, columns, layout.header_row + 1) if layout.header_row >= 0 else None) or {}
    units = {}
    for name, column in columns.items():
        stated = [] if column.unit is None else [column.unit]
        if layout.header_row >= 0:
            match = _UNIT_IN_HEADER.match(layout.rows[layout.header_row][layout.places[name]])
            stated += [match.group(2)] if match else []
        stated += [below[name]] if name in below else []
        if not stated:
            raise FormatError(
                f"columns.{name}.unit",
                f"is stated neither by you nor in the file; {column.quantity} in what?{_unread(layout, name)}",
            )
        values = {factor(column.quantity, unit, f"columns.{name}.unit") for unit in stated}
        if len(values) > 1:
            raise FormatError(f"columns.{name}.unit", f"is stated as {' and as '.join(stated)}; which is right?")
        units[name] = plain(stated[0])
    return units


def _unread(layout: _Layout, name: str) -> str:
    """What stands below the header of a column whose unit is missing, where that may have been meant as its unit."""
    index, place = layout.header_row + 1, layout.places[name]
    cell = layout.rows[index][place] if 0 < index < len(layout.rows) and place < len(layout.rows[index]) else ""
    return f" (line {index + 1} has {cell[:20]!r} there)" if cell and not is_number(cell) else ""


def _blocks(layout: _Layout, columns: Mapping[str, Column], notes: list[str]) -> list[_Block]:
    """Data rows, cut where the header comes again; remarks go to the notes."""
    blocks = [_Block([], [])]
    remarks = []
    header = layout.rows[layout.header_row] if layout.header_row >= 0 else None
    begun = layout.header_row + 1
    for i in range(begun, len(layout.rows)):
        row = layout.rows[i]
        if not any(row):
            continue
        if row == header:
            blocks.append(_Block([], []))
            begun = i + 1
        elif i == begun and header is not None and _units_row(layout, columns, i) is not None:
            continue
        elif any(p < len(row) and is_number(row[p]) for p in layout.places.values()):
            if header is not None and len(row) > len(header) and any(row[len(header) :]):
                raise FormatError(
                    f"line {i + 1}",
                    f"has {len(row)} cells, the header has {len(header)}; decimal commas between comma-separated cells?",
                )
            blocks[-1].lines.append(i + 1)
            blocks[-1].cells.append(_wanted_cells(row, layout.places, i + 1))
        elif begun > 0 or blocks[-1].lines:
            remarks.append(f"line {i + 1}: {' '.join(filter(None, row))[:80]!r} is no data")
    notes += remarks[:_MOST_QUOTED]
    if len(remarks) > _MOST_QUOTED:
        notes.append(f"and {len(remarks) - _MOST_QUOTED} more such lines")
    return [block for block in blocks if block.lines]


def _wanted_cells(row: list[str], places: Mapping[str, int], line: int) -> list[str]:
    cells = []
    for name, place in places.items():
        if place >= len(row):
            raise FormatError(f"line {line}", f"has {len(row)} cells, column {name} is number {place + 1}; was it cut?")
        if row[place] and not is_number(row[place]):
            raise FormatError(f"line {line}, column {name}", f"{row[place][:40]!r} is not a number")
        cells.append(row[place])
    return cells


def _split_at_time(
    table: FloatArray, lines: Sequence[int], names: Sequence[str]
) -> list[tuple[FloatArray, Sequence[int]]]:
    if "time" not in names:
        return [(table, lines)]
    back = np.flatnonzero(np.diff(table[:, names.index("time")]) < 0) + 1
    borders = [0, *back.tolist(), len(lines)]
    return [(table[a:b], lines[a:b]) for a, b in itertools.pairwise(borders)]
