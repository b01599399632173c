"""The rows of a table, line by line in memory that does not grow with it, and its columns as
arrays.
"""

import codecs
import io
import itertools
import re
from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, BinaryIO

from modalbase.formats.errors import FormatError
from modalbase.formats.factors import with_factor
from modalbase.formats.tables.layout import (
    SEPARATORS,
    Layout,
    Stated,
    TableColumn,
    joined_brackets,
    layout_of,
    row_of,
)
from modalbase.formats.tables.numbers import Clock, is_number, number_reader, number_text
from modalbase.formats.tables.preamble import Row
from modalbase.formats.units import unit_in_name

_HEAD_LINES = 4000  # by which the layout is found
_PART_BYTES = 1 << 20
_LONGEST_LINE = 1 << 20
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


WORKBOOK = re.compile(
    rb"PK\x03\x04.{26}(?:\[Content_Types\]|_rels/|docProps/|xl/|mimetypeapplication/vnd\.oasis)"
    rb"|\xd0\xcf\x11\xe0",
    re.DOTALL,
)
"""How a workbook of Excel or LibreOffice begins."""


def encoding_of(file: BinaryIO) -> str:
    """The encoding of a text: by its mark, by the zeros of UTF-16, UTF-8 where all of it is that,
    else cp1252.

    Raises:
        FormatError: it is none of these.
    """
    head = file.read(4096)
    file.seek(0)
    if WORKBOOK.match(head):
        raise FormatError("file", "is a workbook, no text; save its sheet as CSV")
    marked = next((name for mark, name in _MARKS if head.startswith(mark)), None)
    if marked is None and b"\0" in head:
        odd, even = head[1::2].count(0), head[::2].count(0)
        marked = (
            "utf-16-le"
            if odd > 0.9 * len(head) / 2
            else "utf-16-be"
            if even > 0.9 * len(head) / 2
            else None
        )
    for name in (marked,) if marked else ("utf-8", "cp1252"):
        try:
            decoder = codecs.getincrementaldecoder(name)()
            for part in iter(partial(file.read, _PART_BYTES), b""):
                if "\0" in decoder.decode(part):
                    raise FormatError("file", "holds NUL bytes; it is not text, export it as CSV")
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            file.seek(0)
            continue
        file.seek(0)
        return name
    raise FormatError("file", f"is not the {marked} text that it begins as" if marked else
                      "is neither UTF-8, UTF-16 nor cp1252 text; export it as UTF-8, or state its `encoding`, such as"
                      " shift_jis")  # fmt: skip


@dataclass(frozen=True)
class TextTable:
    """A table of text in a file."""

    open_text: Callable[[], IO[str]]
    encoding: str
    layout: Layout
    notes: list[str]  # what was noticed; that of a reading to the end is added by it

    @property
    def names(self) -> list[str]:
        """Of the columns that hold numbers."""
        return [column.name for column in self.layout.columns]

    @property
    def units(self) -> dict[str, str]:
        """Units of columns in the file's words, where a line of units states them, or a factor
        beside them.
        """
        stated = {
            column.name: with_factor(column.unit or unit_in_name(column.name)[1], column.factor)
            for column in self.layout.columns
            if column.unit or column.factor
        }
        return stated | {column.name: "s" for column in self.layout.columns if column.is_time}

    def parts(self, names: list[str], rows: int = 1 << 16) -> Iterator["array[float]"]:
        """Numbers of some columns, row after row, so many rows at a time. NaN where a cell is
        empty.

        Raises:
            FormatError: a line is no row of the table; with its number and what to do.
        """
        by_name = {column.name: column for column in self.layout.columns}
        columns = [by_name[name] for name in names]
        numbers = array("d")
        with self.open_text() as text:
            reader = _Reader(self.layout, columns, self.notes)
            for values in reader.rows(text):
                numbers.extend(values)
                if len(numbers) >= rows * len(columns):
                    yield numbers
                    numbers = array("d")
        if numbers:
            yield numbers


def open_table(source: Path | bytes, stated: Stated = Stated()) -> TextTable:  # noqa: B008 - frozen
    """A table, and what its lines are.

    Raises:
        FormatError: it is no text, or no table; says what was expected.
    """
    encoding, open_text = _text(source, stated.encoding)
    try:
        with open_text() as text:
            head = list(
                itertools.islice(iter(partial(text.readline, _LONGEST_LINE), ""), _HEAD_LINES + 1)
            )
    except UnicodeError:
        raise FormatError("encoding", f"is stated as {encoding}, and the file is not") from None
    is_whole = len(head) <= _HEAD_LINES
    layout = layout_of(list(enumerate(head[:_HEAD_LINES], 1)), stated, is_whole=is_whole)
    return TextTable(open_text, encoding, layout, list(layout.notes))


def read_rows(
    source: Path | bytes,
    required: Collection[str],
    name_of: Callable[[str], str] = str,
    expected: str = "",
) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    r"""The header of a table whose columns have known names, and the lines below it: their numbers
    and cells.

    Numbers get a decimal point. Blank lines and comments are left out, and so is what stands above
    the header.

    >>> header, rows = read_rows(b"Points of June\n\nlabel;x_mm\n7;0,5\n", {"label", "x_mm"})
    >>> header, list(rows)
    (['label', 'x_mm'], [(4, ['7', '0.5'])])

    Args:
        source: the file.
        required: names that the header has, or more.
        name_of: the name that a cell of the header means.
        expected: the header in words.

    Raises:
        FormatError: it is no text, or no line has these names.
    """
    _, open_text = _text(source, None)
    with open_text() as text:
        head = list(itertools.islice(iter(partial(text.readline, _LONGEST_LINE), ""), _HEAD_LINES))
    best: tuple[int, int, str, list[str]] = (0, 0, ",", [])
    for separator in SEPARATORS.values():
        for number, line in enumerate(head, 1):
            cells = (
                joined_brackets(row_of(line, number, separator), separator).cells
                if line.strip()
                else []
            )
            if (known := len(set(required) & set(map(name_of, cells)))) > best[0]:
                best = known, number, separator, cells
    known, at, separator, header = best
    if known < len(set(required)):
        first = next((line.strip() for line in head if line.strip()), "")
        wrong = ",".join(header) or first
        raise FormatError(
            f"line {at or 1}", f"is {wrong[:200]!r}, expected {expected or ','.join(required)}"
        )
    below = [row_of(line, n, separator) for n, line in enumerate(head[at:], at + 1) if line.strip()]
    decimal, _ = number_reader(
        [c for row in below for c in row.cells if is_number(c)], None, separator
    )

    def rows() -> Iterator[tuple[int, list[str]]]:
        with open_text() as text:
            for number, line in enumerate(text, 1):
                row = row_of(line, number, separator)
                if number <= at or row.is_comment or not any(row.cells):
                    continue
                cells = row.cells[: max(len(header), row.width)]
                yield number, [_with_point(cell, decimal) for cell in cells]

    return header, rows()


def _with_point(cell: str, decimal: str) -> str:
    """A number with a decimal point; what is none stays, so that its line is named where a number
    is needed.
    """
    try:
        return number_text(cell, decimal)
    except FormatError:
        return cell


def whole_rows(
    header: Sequence[str], rows: Iterable[tuple[int, list[str]]]
) -> Iterator[tuple[int, list[str]]]:
    """Rows that have as many cells as the header.

    Raises:
        FormatError: one has more or fewer; names its line.
    """
    for line, cells in rows:
        if len(cells) != len(header):
            raise FormatError(
                f"line {line}", f"has {len(cells)} cells, the header has {len(header)}"
            )
        yield line, cells


def _text(source: Path | bytes, encoding: str | None) -> tuple[str, Callable[[], IO[str]]]:
    """The encoding of a text, found out where it is not stated, and a function that opens it."""

    def open_bytes() -> BinaryIO:
        return io.BytesIO(source) if isinstance(source, bytes) else source.open("rb")

    if encoding is None:
        with open_bytes() as file:
            encoding = encoding_of(file)
    return encoding, lambda: io.TextIOWrapper(open_bytes(), encoding)


class _Reader:
    """Rows of numbers; lines behind the data that are none are noted, those between data
    refused.
    """

    def __init__(self, layout: Layout, columns: list[TableColumn], notes: list[str]) -> None:
        self._layout, self._columns, self._notes = layout, columns, notes
        _, self._number = number_reader([], layout.decimal, layout.separator)
        self._clocks = {column.place: Clock() for column in columns}
        self._remark: tuple[int, str] | None = None
        self._remarks = 0

    def rows(self, text: IO[str]) -> Iterator[list[float]]:
        layout = self._layout
        separator, is_point = layout.separator, layout.decimal == "."
        places = [column.place for column in self._columns]
        is_plain = not any(column.is_time for column in self._columns)
        least = max(column.place for column in layout.columns) + 1
        blank_separated, number = separator == " ", 0
        for number, line in enumerate(text, 1):
            if number < layout.first_line:
                continue
            if is_plain and (is_point or "." not in line):
                plain = line if is_point else line.replace(",", ".")
                cells = plain.split() if blank_separated else plain.split(separator)
                if least <= len(cells) <= layout.width and self._remark is None:
                    try:
                        yield [float(cells[place]) for place in places]
                        continue
                    except ValueError:  # groups, quotes, empty cells or words: looked at below
                        pass
            if line.strip() and (values := self._row(number, line)) is not None:
                yield values
        if self._remark is not None:
            more = f", and {self._remarks - 1} more such lines" if self._remarks > 1 else ""
            self._note(f"line {self._remark[0]}: {self._remark[1]!r} stands behind the data{more}")
        rows = number - layout.first_line + 1
        if layout.count and rows < layout.count[0] - 1:
            self._note(f"{layout.count[1].words}, and the table has {rows}: was it cut?")

    def _note(self, note: str) -> None:
        self._notes.extend([] if note in self._notes else [note])

    def _row(self, number: int, line: str) -> list[float] | None:
        row = row_of(line, number, self._layout.separator)
        known = [
            column
            for column in self._layout.columns
            if column.place < len(row.cells) and row.cells[column.place]
        ]
        first = next((cell for cell in row.cells if cell), "")
        if row.is_comment or not first:
            return None
        fits = [
            column for column in known if self._read(column, row.cells[column.place]) is not None
        ]
        is_remark = (
            not fits
            or (known[0] not in fits)
            or (row.cells.index(first) < known[0].place and len(fits) < len(known))
        )
        if is_remark:
            self._remark = self._remark or (number, " ".join(line.split())[:60])
            self._remarks += 1
            return None
        if self._remark is not None:
            at, words = self._remark
            raise FormatError(
                f"line {at}",
                f"{words!r} is no row of the table, and data follow it in line {number}; send each"
                " table as a file of its own",
            )
        self._require_whole(row, known, fits)
        return [self._value(column, row) for column in self._columns]

    def _require_whole(self, row: Row, known: list[TableColumn], fits: list[TableColumn]) -> None:
        layout = self._layout
        if row.width > layout.width:
            why = (
                "; decimal commas between comma-separated cells?" if layout.separator == "," else ""
            )
            raise FormatError(
                f"line {row.line}", f"has {row.width} cells, the table has {layout.width}{why}"
            )
        for column in known:
            if column not in fits:
                cell = row.cells[column.place]
                place = f"line {row.line}, {column.name}"
                kind = (
                    "time of day" if column.is_time else f"number with a decimal {layout.decimal!r}"
                )
                raise FormatError(
                    place,
                    f"{cell[:40]!r} is no {kind}; correct it, or state `decimal` of the table",
                )
        last = max(layout.columns, key=lambda column: column.place)
        if len(row.cells) <= last.place:
            raise FormatError(
                f"line {row.line}",
                f"has {len(row.cells)} cells, {last.name} is number {last.place + 1}; was it cut?",
            )

    def _value(self, column: TableColumn, row: Row) -> float:
        cell = row.cells[column.place]
        if column.is_time:
            return self._clocks[column.place].seconds(cell) if cell else float("nan")
        return self._number(cell)

    def _read(self, column: TableColumn, cell: str) -> float | None:
        """What a cell holds; None where it does not fit its column."""
        try:
            return Clock().seconds(cell) if column.is_time else self._number(cell)
        except (FormatError, ValueError):
            return None
