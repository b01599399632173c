"""What the lines of a table are, by its first lines.

1. Each separator splits the lines. The one under which most columns hold numbers or times, in most
   lines, is the table's.
2. Data begin at the first line that is alike to those numbers and is followed by another such line.
3. The lines right above are headings: names, and a line of units below or above them; a second line
   of names counts where names are missing or come twice. Without any, columns are called "column
   1", "column 2" ….
4. What stands above is a preamble: what it states of the columns and of the whole table is used,
   see `preamble`.

Comment signs (#, %) before a line do not count, so that a heading may be a comment; a number behind
one is no datum.
"""

import csv
import itertools
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from modalbase.formats.errors import FormatError
from modalbase.formats.tables.numbers import Kind, is_complex, is_number, kind_of, number_reader
from modalbase.formats.tables.preamble import (
    Row,
    Statement,
    bare_unit,
    cells_of_units,
    columns_stated,
    count_of,
    is_units,
    line_step_of,
    padded,
    rate_of,
    statements_of,
    units_above,
    windows_of,
)
from modalbase.formats.units import level_of, read_unit

SEPARATORS = {"tab": "\t", "semicolon": ";", "blank": " ", "comma": ","}
"""Names of separators, the likelier first: where two split a table alike, the first counts."""

Encoding = Literal[
    "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1250", "cp1251", "cp1252", "latin-1", "cp850",
    "shift_jis", "gbk", "big5", "euc_kr"
]  # fmt: skip
"""What a text may be stated to be written in."""

_COMMENTS = "#%"
_MOST_WORDS = 200  # of a preamble that are looked at
_MOST_HEADINGS = 5
_MOST_ACROSS = 32  # columns of a table whose few lines begin with words, and hold a value of each
_DATA: tuple[Kind, ...] = ("number", "time", "date")


@dataclass(frozen=True)
class Stated:
    """What is stated of a table beside its file; None where the file shows it."""

    separator: str | None = None  # as `SEPARATORS` names it
    decimal: str | None = None  # . or ,
    encoding: str | None = None
    first_line: int | None = None  # of the data, from 1

    @classmethod
    def of(cls, document: Any, place: str) -> "Stated":
        """The same of JSON.

        Raises:
            FormatError: a member is unknown or wrong.
        """
        if document is None:
            return cls()
        if not isinstance(document, dict):
            raise FormatError(place, "is not an object")
        expected = {
            "separator": tuple(SEPARATORS),
            "decimal": (".", ","),
            "encoding": get_args(Encoding),
        }
        faults = [
            (f"{place}.{name}", f"is unknown; it has {', '.join((*expected, 'first_line'))}")
            for name in sorted(document.keys() - {*expected, "first_line"})
        ]
        faults += [
            (f"{place}.{name}", f"is {document[name]!r}, expected {', '.join(values)}")
            for name, values in expected.items()
            if document.get(name) is not None and document[name] not in values
        ]
        line = document.get("first_line")
        if line is not None and (isinstance(line, bool) or not isinstance(line, int) or line < 1):
            faults.append(
                (f"{place}.first_line", f"is {line!r}, expected the number of a line, from 1")
            )
        if faults:
            raise FormatError(faults)
        return cls(**document)


@dataclass(frozen=True)
class TableColumn:
    """A column with numbers or times."""

    place: int  # in a line, from 0
    name: str
    unit: str = ""  # in the file's words, of a line of units; one in the heading stays in the name
    is_time: bool = False  # times of day, which become seconds since the first
    factor: str = ""  # that a line above states beside the unit, see `modalbase.formats.factors`


@dataclass(frozen=True)
class Layout:
    """What the lines of a table are."""

    separator: str
    decimal: str
    width: int  # cells of a line of data
    columns: tuple[TableColumn, ...]
    heading_lines: tuple[int, ...]  # numbers of lines, from 1
    units_line: int | None
    first_line: int  # of the data
    preamble: tuple[str, ...] = ()  # its cells, and those of headings
    # what the preamble states: a sampling rate; and with its line the step between lines of a
    # spectrum, Hz, and how many lines there are
    sample_rate_hz: float | None = None
    line_step_hz: tuple[float, Statement] | None = None
    count: tuple[int, Statement] | None = None
    units_above: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def described(self, encoding: str) -> dict[str, Any]:
        """The same as JSON has it."""
        return {
            "encoding": encoding,
            "separator": next(name for name, sign in SEPARATORS.items() if sign == self.separator),
            "decimal": self.decimal,
            "heading_lines": list(self.heading_lines),
            "units_line": self.units_line,
            "first_line": self.first_line,
            "columns": [
                {"name": column.name, "unit": column.unit or None} for column in self.columns
            ],
        }


def split(line: str, separator: str, number: int = 0) -> list[str]:
    """Cells of a line, without blanks around them.

    Raises:
        FormatError: it cannot be split.
    """
    if separator == " " and '"' not in line:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        reader = csv.reader(
            [line.strip("\r\n")], delimiter=separator, skipinitialspace=separator in ", "
        )
        return [cell.strip() for cell in next(reader, [])]
    except csv.Error as error:
        raise FormatError(f"line {number}", f"cannot be split into cells: {error}") from None


def row_of(line: str, number: int, separator: str) -> Row:
    """A line as cells; a comment sign before them is taken off, unless it is a cell of its own,
    such as the unit %.
    """
    bare = line.strip() if separator == " " else line.strip("\r\n")
    lead = bare.lstrip()[:1]
    if lead and lead in _COMMENTS:
        rest = bare.lstrip().lstrip(_COMMENTS)
        if rest.strip() and not (separator != " " and rest.lstrip(" ").startswith(separator)):
            return Row(number, split(rest.strip(" "), separator, number), is_comment=True)
    return Row(number, split(bare, separator, number))


def joined_brackets(row: Row, separator: str) -> Row:
    """A heading of a table parted by blanks, where a unit in brackets belongs to the name before
    it.
    """
    if separator != " " or not row.cells or row.cells[0][:1] in "([":
        return row
    cells: list[str] = []
    for cell in row.cells:
        if cells and cell[:1] in "([":
            cells[-1] += f" {cell}"
        else:
            cells.append(cell)
    return Row(row.line, cells, row.is_comment)


def layout_of(
    lines: Sequence[tuple[int, str]], stated: Stated = Stated(), *, is_whole: bool = True
) -> Layout:
    """What lines are.

    Args:
        lines: the first lines of a table with their numbers, blank ones too.
        stated: what its sender says of it.
        is_whole: they are all lines; else the last may be cut.

    Raises:
        FormatError: no line holds numbers, the decimal sign cannot be known, or what is stated does
            not fit; says what to state.
    """
    lines = lines if is_whole else lines[:-1]
    signs = (
        list(SEPARATORS.values()) if stated.separator is None else [SEPARATORS[stated.separator]]
    )
    splits = [split for sign in signs if (split := _Split.of(lines, sign)) is not None]
    if not splits:
        first = next((line.strip() for _, line in lines if line.strip()), "")
        why = f"it begins {first[:60]!r}" if first else "it is empty"
        raise FormatError(
            "",
            f"no line of it holds numbers in columns ({', '.join(SEPARATORS)} between them): {why}",
        )
    best = max(splits, key=lambda each: each.score)
    return best.layout(stated)


@dataclass(frozen=True)
class _Split:
    """Lines as one separator splits them."""

    separator: str
    rows: list[Row]  # without blank ones
    blank: set[int]  # numbers of blank lines
    kinds: list[Kind]  # what the columns hold

    @classmethod
    def of(cls, lines: Sequence[tuple[int, str]], separator: str) -> "_Split | None":
        rows = [row_of(line, number, separator) for number, line in lines if line.strip()]
        candidates = []
        for row in rows:
            kinds = [kind_of(cell) for cell in row.cells]  # empty ones at the end may be a column's
            if not row.is_comment and any(kind in ("number", "time") for kind in kinds):
                candidates.append(kinds)
        if not candidates:
            return None
        ((width, _),) = Counter(map(len, candidates)).most_common(1)
        columns = list(zip(*(kinds for kinds in candidates if len(kinds) == width), strict=True))
        kinds = list(map(_kind_of_column, columns))
        blank = {number for number, line in lines if not line.strip()}
        split_ = cls(separator, [row for row in rows if any(row.cells)], blank, kinds)
        return split_ if any(map(split_.is_data, rows)) else None

    @property
    def score(self) -> tuple[bool, float, int, int]:
        """Several columns before one; then the share of them that holds numbers, the lines, and the
        likelier separator.
        """
        pure = sum(kind in _DATA for kind in self.kinds) / len(
            [k for k in self.kinds if k != "empty"]
        )
        order = -list(SEPARATORS.values()).index(self.separator)
        return len(self.kinds) > 1, pure, sum(map(self.is_data, self.rows)), order

    def is_data(self, row: Row) -> bool:
        """Whether a line is alike to those with numbers."""
        if row.is_comment or row.width > len(self.kinds):
            return False
        known = False
        for cell, kind in zip(row.cells, self.kinds, strict=False):
            own = kind_of(cell)
            if kind != "text" and own not in (kind, "empty"):
                return False
            known |= kind in ("number", "time") and own == kind
        return known

    def layout(self, stated: Stated) -> Layout:
        first = self._first(stated)
        data = [row for row in self.rows[first:] if self.is_data(row)]
        if not data:
            raise FormatError(
                "first_line",
                f"is {stated.first_line}; no line from there on holds numbers as columns",
            )
        places = [i for i, kind in enumerate(self.kinds) if kind in ("number", "time")]
        cells = [
            row.cells[i]
            for row in data
            for i in places
            if i < len(row.cells) and self.kinds[i] == "number"
        ]
        decimal, _ = number_reader(cells, stated.decimal, self.separator)
        headings = self._headings(first)
        if not headings and self.separator == "," and not stated.separator:
            _refuse_commas_both(data[0], cells)
        _refuse_complex(data[0])
        if not headings and self.kinds[0] == "text" and len(data) < len(places) > _MOST_ACROSS:
            raise FormatError(
                f"line {data[0].line}",
                f"has {len(places)} numbers behind {data[0].cells[0][:40]!r}, and so have"
                f" {len(data)} lines: values run along lines; export the table transposed",
            )
        names, units, units_row = self._names(headings)
        top = min((row.line for row in headings), default=data[0].line)
        preamble = [row for row in self.rows[:first] if row.line < top]
        stated_above = statements_of(preamble, self.separator)
        units, factors = columns_stated(stated_above, names, units, places)
        columns = tuple(
            TableColumn(i, names[i], units[i], self.kinds[i] == "time", factors[i]) for i in places
        )
        left_out = [
            f"column {names[i]!r} holds {k}s, and is left out"
            for i, k in enumerate(self.kinds)
            if k in ("text", "date")
        ]
        return Layout(
            separator=self.separator,
            decimal=decimal,
            width=max([len(self.kinds), *(row.width for row in headings)]),
            columns=columns,
            heading_lines=tuple(sorted(row.line for row in headings if row is not units_row)),
            units_line=None if units_row is None else units_row.line,
            first_line=data[0].line,
            preamble=tuple(cell for row in self.rows[:first] for cell in row.cells if cell)[
                :_MOST_WORDS
            ],
            sample_rate_hz=rate_of(stated_above, self.separator),
            line_step_hz=line_step_of(stated_above, self.separator),
            units_above=units_above(stated_above),
            count=count_of(stated_above, self.separator),
            notes=(*left_out, *windows_of(stated_above)),
        )

    def _first(self, stated: Stated) -> int:
        if stated.first_line is not None:
            return next(
                (i for i, row in enumerate(self.rows) if row.line >= (stated.first_line or 0)),
                len(self.rows),
            )
        are_data = list(map(self.is_data, self.rows))
        both = (i for i, pair in enumerate(itertools.pairwise(are_data)) if all(pair))
        return next(both, are_data.index(True))

    def _headings(self, first: int) -> list[Row]:
        """Lines of words right above the data, the nearest first: at most one of units and two of
        names.

        What stands between units and data, such as rates and sensors, is left out.
        """
        above: list[Row] = []
        width, below = len(self.kinds), None
        for row in reversed(self.rows[:first]):
            if above and below is not None and below - row.line > 1:
                break
            below = row.line
            fitted = joined_brackets(row, self.separator)
            if row.is_comment and fitted.width == 1 < width:  # a remark
                continue
            mixed = any(
                is_number(c) for c, k in zip(fitted.cells, self.kinds, strict=False) if k in _DATA
            )
            if (
                mixed
                or not min(width, max(2, width - 1)) <= fitted.width <= width + 1
                or len(above) == _MOST_HEADINGS
            ):
                break
            above.append(fitted)
        at = next((i for i, row in enumerate(above) if is_units(row)), None)
        if at is None:
            return above[
                : (
                    2
                    if above
                    and _is_doubtful(above[0], self.kinds)
                    and above[1:]
                    and above[1].width >= width
                    else 1
                )
            ]
        has_names = len(above) > at + 1 and not is_units(above[at + 1])
        if has_names and (at > 1 or (at == 1 and _holds_values(above[0], self.kinds))):
            above = above[at:]
        return above[: 3 if len(above) > 2 and _is_doubtful(_names_row(above), self.kinds) else 2]

    def _names(self, headings: Sequence[Row]) -> tuple[list[str], list[str], Row | None]:
        """Names and units of all columns, and the line of units."""
        units_row = next((row for row in headings[:2] if is_units(row)), None)
        named = [row for row in headings if row is not units_row]
        width = len(self.kinds)
        cells = padded(named[0] if named else units_row, width)
        if len(named) > 1:
            upper: list[str] = []
            for cell in padded(named[1], width):  # a name may stand over several columns
                upper.append(cell or (upper[-1] if upper else ""))
            cells = [" ".join(filter(None, pair)) for pair in zip(upper, cells, strict=True)]
        seen: Counter[str] = Counter()
        names = []
        for i, cell in enumerate(cells, 1):
            name = cell or f"column {i}"
            seen[name] += 1
            names.append(name if seen[name] == 1 else f"{name} {seen[name]}")
        units = [
            cell if read_unit(cell) or level_of(cell) is not None else ""
            for cell in cells_of_units(units_row, width)
        ]
        return names, [bare_unit(unit) for unit in units], units_row


def _kind_of_column(kinds: Sequence[Kind]) -> Kind:
    """What most cells of a column hold; words only where they are in most lines, since some are of
    the preamble.
    """
    counts = Counter(kinds)
    filled: list[Kind] = [kind for kind, _ in counts.most_common() if kind != "empty"]
    if 2 * counts["text"] < len(kinds):
        filled = [kind for kind in filled if kind != "text"]
    return filled[0] if filled else "empty"


def _names_row(headings: Sequence[Row]) -> Row:
    return next((row for row in headings if not is_units(row)), headings[0])


def _is_doubtful(row: Row, kinds: Sequence[Kind]) -> bool:
    """Whether names are missing above numbers, or come twice."""
    names = [
        cell
        for cell, kind in zip(padded(row, len(kinds)), kinds, strict=True)
        if kind in ("number", "time")
    ]
    return not all(names) or len(set(names)) < len(names)


def _holds_values(row: Row, kinds: Sequence[Kind]) -> bool:
    """Whether a line holds settings rather than names: "2048 Hz", "SENSOR=a", or one word twice."""
    return _is_doubtful(row, kinds) or any(
        re.match(r"\d+[.,]?\d*\s|[^(\[]*=", cell) for cell in row.cells
    )


def _refuse_complex(row: Row) -> None:
    """Refuse complex numbers in one cell, which no column of numbers holds."""
    if (cell := next(filter(is_complex, row.cells), None)) is not None:
        raise FormatError(
            f"line {row.line}",
            f"has the complex number {cell[:40]!r} in one cell; write real and imaginary parts as"
            " columns of their own",
        )


def _refuse_commas_both(row: Row, cells: Sequence[str]) -> None:
    """Refuse a table without headings whose commas may be decimal signs as well as separators."""
    if not any("." in cell for cell in cells) and any(
        re.fullmatch(r"0\d+", cell) for cell in cells
    ):
        raise FormatError(
            f"line {row.line}",
            f"{','.join(row.cells)[:40]!r} may have decimal commas between commas; export it with"
            " another separator, or state that separator is comma",
        )
