"""Tables of text: a header, and rows of as many cells. FRFs, time blocks and grid points are read by it.

Files of testing machines, which have preambles, units and restarts, are read by `modalbase.formats.machine_csv`.
"""

import csv
import itertools
from collections.abc import Iterable, Iterator

from modalbase.formats.errors import FormatError

Row = tuple[int, list[str]]
"""Number of a line, and its cells."""


def read_columns(
    lines: Iterable[str], delimiters: str = ";\t,", decimal_commas: str = ";"
) -> tuple[list[str], Iterator[Row]]:
    r"""The header of a table and its rows, blank ones left out.

    Cells are parted by the delimiter that the header has most often. A decimal comma becomes a point.

    >>> header, rows = read_columns(["time_s; force\n", "0,5;12\n"])
    >>> header, list(rows)
    (['time_s', 'force'], [(2, ['0.5', '12'])])

    Args:
        lines: of the text.
        delimiters: those that are tried; the first of those that are as frequent.
        decimal_commas: delimiters beside which a comma is a decimal comma.

    Raises:
        FormatError: a line cannot be parted, or has more or fewer cells than the header; the rows raise it when they come.
    """
    lines = iter(lines)
    first = next(lines, "")
    delimiter = max(delimiters, key=first.count)
    decimal = delimiter in decimal_commas
    reader = csv.reader(itertools.chain([first], lines), delimiter=delimiter, strict=True)

    def rows() -> Iterator[Row]:
        try:
            for row in reader:
                if not any(cell.strip() for cell in row):
                    continue
                if len(row) != len(header):
                    place = f"line {reader.line_num}"
                    raise FormatError(place, f"has {len(row)} cells, the header has {len(header)}")
                yield reader.line_num, [cell.replace(",", ".") for cell in row] if decimal else row
        except csv.Error as error:
            raise FormatError("", f"the CSV cannot be read: {error}") from None

    try:
        header = [cell.strip() for cell in next(reader, [])]
    except csv.Error as error:
        raise FormatError("line 1", f"the CSV cannot be read: {error}") from None
    return header, rows()


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
    """The number in a cell.

    Raises:
        FormatError: it holds none.
    """
    try:
        return float(cell)
    except ValueError:
        raise FormatError(place, f"is {cell.strip()[:40]!r}, expected a number with a decimal point") from None
