"""Curves as testing machines write them, from bytes to SI arrays.

What machines do and what becomes of it:

- a preamble, blank lines, remarks between or after the data: passed over, remarks are quoted in the
  notes;
- encodings, separators, decimal signs, times of day: as `modalbase.formats.tables` finds them out,
  and said in the result;
- a header that comes again, with its columns in any order, other words in all wanted columns, or
  time that goes back: the machine was restarted, and each run stands alone;
- units: stated by the caller, in the header (`Load (kN)`, `Load_kN`) or in a line of units between
  it and the data, or above it. Never guessed; where two of these disagree the file is refused. A name in brackets,
  `Strain (Strain 1)`, is no unit;
- an empty cell is NaN; a cell that is no number is refused with its line and column.
"""

import io
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.factors import changes, factor_beside, question, with_factor
from modalbase.formats.tables.layout import SEPARATORS, Encoding, joined_brackets, row_of
from modalbase.formats.tables.numbers import Clock, is_number, kind_of, number_reader
from modalbase.formats.tables.preamble import Row, Statement, statements_of
from modalbase.formats.tables.reader import encoding_of, open_table
from modalbase.formats.tables.sizes import StatedSize, sizes_of
from modalbase.formats.types import FloatArray
from modalbase.formats.units import factor_of, half_width, known_units, plain, unit_in_name

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
    if known is None and quantity == "length" and factor_of("strain", name) is not None:
        raise FormatError(
            field, f"{unit!r} is a strain, not an elongation; leave the gauge length out"
        )
    if known is None:
        raise FormatError(
            field,
            f"{unit!r} is no unit of {quantity} that is known here; use {known_units(quantity)}",
        )
    return known


_MOST_QUOTED = 20  # remarks that are quoted in the notes
_IN_BRACKETS = re.compile(r"^(.*?)\s*[\[({].*[\])}]\s*$")


@dataclass(frozen=True)
class Column:
    """Which column a quantity stands in."""

    # its name in the file, capitals and unit apart; or its number, from 1, where there is no header
    header: str | int
    quantity: Quantity  # what it is
    unit: str | None = None  # None where the file states it


@dataclass(frozen=True)
class Run:
    """One run of the machine."""

    columns: Mapping[str, FloatArray]  # SI arrays by the caller's names; NaN where a cell was empty
    lines: Sequence[int]  # of the file, from 1, of each point


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
    sizes: tuple[StatedSize, ...] = ()  # of the specimen, that lines above the curve state


@dataclass(frozen=True)
class _Columns:
    """Where the wanted columns are in the rows, and what the file says of them."""

    delimiter: str
    rows: list[Row]  # of all lines, blank ones without cells
    header_row: int  # -1 where there is none
    header_cells: list[str]  # of that line, whole where a separator stands in brackets
    places: dict[str, int]

    def header(self, name: str) -> str:
        """The header of a column; "" where there is none."""
        place = self.places[name]
        return self.header_cells[place] if place < len(self.header_cells) else ""

    @cached_property
    def statements(self) -> list[Statement]:
        """What the lines above the header state."""
        above = self.rows[: max(self.header_row, 0)]
        return statements_of([row for row in above if any(row.cells)], self.delimiter)

    def factor(self, name: str) -> str:
        """A factor that the header or a line above states of a column; "" where there is none."""
        width, place = len(self.header_cells), self.places[name]
        stated = (
            f"{each.name} = {cell}"
            for each in self.statements
            if changes(each.name, cell := each.of_columns(width, range(width)).get(place, ""))
        )
        return next(stated, "") or factor_beside(self.header(name), {})

    def cells(self, index: int) -> list[str]:
        """Of a line; none beyond the ends of the file."""
        return self.rows[index].cells if 0 <= index < len(self.rows) else []


@dataclass(frozen=True)
class _Block:
    """Data rows of one run: the columns that its header names, line numbers and the wanted cells."""

    columns: _Columns
    lines: list[int] = field(default_factory=list)
    cells: list[list[str]] = field(default_factory=list)


def read_machine_csv(
    data: bytes,
    columns: Mapping[str, Column],
    delimiter: str | None = None,
    decimal: str | None = None,
    encoding: Encoding | None = None,
) -> MachineFile:
    """Read a testing machine's text file.

    Args:
        data: the file.
        columns: the columns that are wanted, by the caller's names; a column named `time` also
            shows restarts.
        delimiter: tab, `;`, `,` or a blank; found out where None.
        decimal: `.` or `,`; found out where None.
        encoding: what the text is written in; found out where None, see `encoding_of`.

    Raises:
        FormatError: the file, a line or a cell cannot be read, a unit is not stated or stated twice
            differently; says where and what to do.
    """
    if not columns:
        raise FormatError("columns", "names none, expected at least one")
    if decimal not in (None, ".", ","):
        raise FormatError("decimal", f"is {decimal!r}, expected . or ,")
    if delimiter not in (None, *SEPARATORS.values()):
        raise FormatError("delimiter", f"is {delimiter!r}, expected a tab, ; , or a blank")
    try:
        read_as = encoding or encoding_of(io.BytesIO(data))
        text = data.decode(read_as)
    except UnicodeDecodeError:
        raise FormatError("encoding", f"is stated as {encoding}, and the file is not") from None
    lines = re.split("\r\n|\n|\r", text)
    delimiters = tuple(SEPARATORS.values()) if delimiter is None else (delimiter,)
    try:
        layout = _layout(lines, columns, delimiters)
    except FormatError as error:
        if encoding is not None or read_as != "cp1252":  # which is what is left, not what is seen
            raise
        hint = "; it was read as cp1252: state its `encoding` where that is another"
        raise FormatError(error.place, error.message + hint) from error
    notes: list[str] = []
    blocks = _blocks(layout, columns, notes)
    cells = [cell for block in blocks for row in block.cells for cell in row]
    symbol, parse = number_reader(
        [cell for cell in cells if is_number(cell)], decimal, layout.delimiter
    )
    units = _units(columns, blocks)
    factors = [
        factor(c.quantity, units[name], f"columns.{name}.unit") for name, c in columns.items()
    ]
    tables = [(_numbers(block, parse) * factors, block.lines) for block in blocks]
    names = list(columns)
    runs = [
        Run({name: part[:, i].copy() for i, name in enumerate(names)}, at)
        for table, table_lines in tables
        for part, at in _split_at_time(table, table_lines, names)
    ]
    empty = sum(int(np.isnan(table).sum()) for table, _ in tables)
    if empty:
        notes.append(f"{empty} empty cells, taken as not measured")
    if len(runs) > 1:
        notes.append("restarted at line " + ", ".join(str(run.lines[0]) for run in runs[1:]))
    return MachineFile(
        runs=tuple(runs),
        units=units,
        encoding=read_as,
        delimiter=layout.delimiter,
        decimal=symbol,
        notes=tuple(notes),
        sizes=sizes_of(layout.statements, layout.delimiter),
    )


def _numbers(block: _Block, parse: Callable[[str], float]) -> FloatArray:
    """(rows, columns) of a block; times of day in seconds since its first."""
    clocks = [Clock() for _ in block.cells[0]]
    return np.array(
        [
            [
                clock.seconds(cell) if kind_of(cell) == "time" else parse(cell)
                for clock, cell in zip(clocks, row, strict=True)
            ]
            for row in block.cells
        ]
    )


def _layout(
    lines: Sequence[str], columns: Mapping[str, Column], delimiters: Sequence[str]
) -> _Columns:
    """The delimiter under which the header is found and most lines hold numbers in all wanted
    columns.
    """
    best: tuple[int, _Columns] | None = None
    reasons: list[FormatError] = []
    for delimiter in delimiters:
        rows = [
            row_of(line, i, delimiter) if line.strip() else Row(i, [])
            for i, line in enumerate(lines, 1)
        ]
        try:
            layout = _find_columns(rows, delimiter, columns)
        except FormatError as error:
            reasons.append(error)
            continue
        below = rows[layout.header_row + 1 :]
        full = sum(
            all(_is_datum(row, p, columns[name]) for name, p in layout.places.items())
            for row in below
        )
        if best is None or full > best[0]:
            best = full, layout
    if best is None:
        reason = next(
            (e for e in reasons if "twice" in e.message), min(reasons, key=lambda e: len(e.message))
        )
        raise FormatError(reason.place, reason.message + _headings("\n".join(lines)))
    if best[0] == 0:
        behind = best[1].rows[best[1].header_row + 1 :]
        first = next((row for row in behind if any(row.cells)), None)
        shown = "" if first is None else f"; line {first.line} has {', '.join(first.cells)[:80]!r}"
        raise FormatError("file", f"has no line with a number in each of the wanted columns{shown}")
    return best[1]


def _headings(text: str) -> str:
    """The columns that a table has, for a message; nothing where it is none."""
    try:
        return f"; its columns are {', '.join(open_table(text.encode()).names)}"
    except FormatError:
        return ""


def _is_datum(row: Row, place: int, column: Column) -> bool:
    """Whether a cell is a number, or a time of day where a time is wanted."""
    cell = row.cells[place] if place < len(row.cells) and not row.is_comment else ""
    return is_number(cell) or (column.quantity == "time" and kind_of(cell) == "time")


def _find_columns(rows: list[Row], delimiter: str, columns: Mapping[str, Column]) -> _Columns:
    numbered = {name: c.header - 1 for name, c in columns.items() if isinstance(c.header, int)}
    if any(place < 0 for place in numbered.values()):
        raise FormatError("columns", "are numbered from 1")
    named = {name: c for name, c in columns.items() if isinstance(c.header, str)}
    if not named:
        stated = {name: numbered[name] for name in columns}
        above = _heading_above(rows, stated, columns)
        return _Columns(delimiter, rows, above, rows[above].cells if above >= 0 else [], stated)
    nearest: set[str] = {str(c.header) for c in named.values()}
    for i, row in enumerate(rows):
        cells = joined_brackets(row, delimiter).cells
        places = {name: _places_of(cells, column) for name, column in named.items()}
        absent = {str(named[name].header) for name, at in places.items() if not at}
        if absent:
            nearest = min(nearest, absent, key=len)
            continue
        for name, at in places.items():
            if len(at) > 1:
                header = named[name].header
                raise FormatError(
                    f"columns.{name}",
                    f"{header!r} is in line {i + 1} twice; give the column's number",
                )
        positions = {**numbered, **{name: at[0] for name, at in places.items()}}
        return _Columns(delimiter, rows, i, cells, {name: positions[name] for name in columns})
    raise FormatError("columns", f"no line has the header {', '.join(sorted(nearest))}")


def _heading_above(rows: list[Row], places: dict[str, int], columns: Mapping[str, Column]) -> int:
    """Index of the line of names above the first line of data, of columns that are named by their
    numbers; -1 where none has words in all of them.
    """
    first = next(
        (
            i
            for i, row in enumerate(rows)
            if all(_is_datum(row, p, columns[n]) for n, p in places.items())
        ),
        0,
    )
    heading = -1
    for i in range(first - 1, max(first - 3, -1), -1):  # names, and units below them
        cells = rows[i].cells
        if not all(
            p < len(cells) and cells[p] and not is_number(cells[p]) for p in places.values()
        ):
            break
        heading = i
    return heading


def _places_of(cells: Sequence[str], column: Column) -> list[int]:
    """Where a header stands: as it is, or without its unit, or else without its brackets; capitals
    and blanks apart.
    """
    header = _folded(str(column.header))
    for bare in (
        _folded,
        lambda cell: _folded(unit_in_name(cell, column.quantity)[0]),
        _without_brackets,
    ):
        if at := [
            i
            for i, cell in enumerate(cells)
            if cell and bare(cell) in (header, bare(str(column.header)))
        ]:
            return at
    return []


def _folded(header: str) -> str:
    return " ".join(half_width(header).split()).casefold()


def _without_brackets(header: str) -> str:
    match = _IN_BRACKETS.match(half_width(header))
    return _folded(match[1] if match else header)


def _units_row(
    layout: _Columns, columns: Mapping[str, Column], index: int
) -> dict[str, str] | None:
    """Units by column if this row is a line of units, else None.

    It is one where no wanted cell is a number and at least one is a unit of its column's quantity.
    Every column is read by
    itself: a cell that is no known unit says nothing of its column, and takes nothing from the
    others.
    """
    row = layout.cells(index)
    cells = {name: plain(row[p]) for name, p in layout.places.items() if p < len(row) and row[p]}
    if any(is_number(cell) for cell in cells.values()):
        return None
    return {
        name: cell
        for name, cell in cells.items()
        if factor_of(columns[name].quantity, cell) is not None
    } or None


def _units(columns: Mapping[str, Column], blocks: Sequence[_Block]) -> dict[str, str]:
    """The units of the columns, which all runs have.

    Raises:
        FormatError: one is stated nowhere, or as two.
    """
    of_blocks = [_units_beside(block.columns, columns) for block in blocks]
    units = {}
    for i, (name, column) in enumerate(columns.items()):
        stated = [] if column.unit is None else [column.unit]
        factor_stated = next(filter(None, (block.columns.factor(name) for block in blocks)), "")
        for block, beside in zip(blocks, of_blocks, strict=True):
            own = unit_in_name(block.columns.header(name), column.quantity)[1]
            # there a name, as in "Tensile strain (Strain)"
            if own and not (own.lower() == "strain" and name in beside):
                stated.append(own)
            stated += [beside[name]] if name in beside else []
        if not stated and any(
            kind_of(row[i]) == "time" for block in blocks for row in block.cells[:1]
        ):
            stated = ["s"]
        if not stated:
            raise FormatError(
                f"columns.{name}.unit",
                f"is stated neither by you nor in the file; {column.quantity} in"
                f" what?{_unread(blocks[0].columns, name)}",
            )
        if factor_stated and column.unit is None:
            text = with_factor(stated[0], factor_stated)
            raise FormatError(f"columns.{name}.unit", f"is {text!r}{question(text)}")
        stated = stated[:1] if factor_stated else stated
        values = {factor(column.quantity, unit, f"columns.{name}.unit") for unit in stated}
        if len(values) > 1:
            raise FormatError(
                f"columns.{name}.unit",
                f"is stated as {' and as '.join(dict.fromkeys(stated))}; which is right? Send tables of"
                " two units as files of their own",
            )
        units[name] = plain(stated[0])
    return units


def _units_beside(layout: _Columns, columns: Mapping[str, Column]) -> dict[str, str]:
    """What lines of units between a header and its data say, or one above it."""
    at = layout.header_row
    below = range(at + 1, len(layout.rows)) if at >= 0 else ()
    for i in below:
        if _holds_data(layout.rows[i], layout.places, columns):
            break
        if (units := _units_row(layout, columns, i)) is not None:
            return units
    return (_units_row(layout, columns, at - 1) if at >= 0 else None) or {}


def _unread(layout: _Columns, name: str) -> str:
    """What stands in or below the header of a column whose unit is missing, where that may have
    been meant as its unit.
    """
    if layout.header_row < 0:
        return ""
    row = layout.cells(layout.header_row + 1)
    cell = row[layout.places[name]] if layout.places[name] < len(row) else ""
    if cell and not is_number(cell):
        return f" (line {layout.header_row + 2} has {cell[:20]!r} there)"
    header = layout.header(name)
    in_brackets = _IN_BRACKETS.match(half_width(header))
    return (
        f" (the heading is {header[:40]!r}, whose brackets hold no unit that is known here)"
        if in_brackets
        else ""
    )


def _blocks(layout: _Columns, columns: Mapping[str, Column], notes: list[str]) -> list[_Block]:
    """Data rows, cut where a header comes again, or words that stand in all wanted columns; remarks
    go to the notes.
    """
    blocks = [_Block(layout)]
    remarks = []
    for i in range(layout.header_row + 1, len(layout.rows)):
        row, current = layout.rows[i], blocks[-1].columns
        if not any(row.cells):
            continue
        if _holds_data(row, current.places, columns):
            width = len(current.header_cells)
            if 0 < width < row.width:
                raise FormatError(
                    f"line {i + 1}",
                    f"has {row.width} cells, the header has {width}; decimal commas between"
                    " comma-separated cells?",
                )
            blocks[-1].lines.append(i + 1)
            blocks[-1].cells.append(_column_cells(row, current.places, columns))
        elif (again := _header_again(layout, i, columns)) is not None:
            blocks.append(_Block(again))
        elif not blocks[-1].lines and _units_row(current, columns, i) is not None:
            continue
        elif layout.header_row >= 0 or blocks[-1].lines:
            remarks.append(f"line {i + 1}: {' '.join(filter(None, row.cells))[:80]!r} is no data")
            if blocks[-1].lines and _is_wordy(row, current.places):
                blocks.append(_Block(current))
    notes += remarks[:_MOST_QUOTED]
    if len(remarks) > _MOST_QUOTED:
        notes.append(f"and {len(remarks) - _MOST_QUOTED} more such lines")
    return [block for block in blocks if block.lines]


def _holds_data(row: Row, places: Mapping[str, int], columns: Mapping[str, Column]) -> bool:
    return any(_is_datum(row, place, columns[name]) for name, place in places.items())


def _is_wordy(row: Row, places: Mapping[str, int]) -> bool:
    """Whether words stand in all wanted columns, as a heading's do."""
    cells = [row.cells[place] if place < len(row.cells) else "" for place in places.values()]
    return all(kind_of(cell) == "text" and re.search(r"[^\W\d_]", cell) for cell in cells)


def _header_again(layout: _Columns, index: int, columns: Mapping[str, Column]) -> _Columns | None:
    """The columns where a line is the header again, maybe in another order; None where it is none."""
    cells = joined_brackets(layout.rows[index], layout.delimiter).cells
    named = {name: c for name, c in columns.items() if isinstance(c.header, str)}
    places_of = {name: _places_of(cells, column) for name, column in named.items()}
    is_same = layout.header_row >= 0 and cells == layout.header_cells
    if not is_same and not (named and all(len(at) == 1 for at in places_of.values())):
        return None
    places = layout.places if is_same else layout.places | {n: at[0] for n, at in places_of.items()}
    return replace(layout, header_row=index, header_cells=cells, places=places)


def _column_cells(row: Row, places: Mapping[str, int], columns: Mapping[str, Column]) -> list[str]:
    cells = []
    for name, place in places.items():
        if place >= len(row.cells):
            raise FormatError(
                f"line {row.line}",
                f"has {len(row.cells)} cells, column {name} is number {place + 1}; was it cut?",
            )
        cell = row.cells[place]
        if kind_of(cell) != "empty" and not _is_datum(row, place, columns[name]):
            raise FormatError(f"line {row.line}, column {name}", f"{cell[:40]!r} is not a number")
        cells.append(cell)
    return cells


def _split_at_time(
    table: FloatArray, lines: Sequence[int], names: Sequence[str]
) -> list[tuple[FloatArray, Sequence[int]]]:
    if "time" not in names:
        return [(table, lines)]
    back = np.flatnonzero(np.diff(table[:, names.index("time")]) < 0) + 1
    borders = [0, *back.tolist(), len(lines)]
    return [(table[a:b], lines[a:b]) for a, b in itertools.pairwise(borders)]
