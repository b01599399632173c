"""Fixed columns, as FORTRAN writes them: every character accounted for, or a refusal that names the
line.

A real may have a decimal comma, an exponent with E or D, or (three digits) with neither, as in `1.0-101`; neighbours
may run together, for a column ends where its width ends. Blanks inside a number, asterisks, NaN and
infinities are refused.
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from modalbase.formats.types import FloatArray

_REAL = re.compile(
    rb"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[eEdD]([+-]?[0-9]{1,4})|([+-][0-9]{3}))?"
)
_NO_NUMBER = re.compile(
    rb"[+-]?(?:nan(?:\(\w*\))?|inf(?:inity)?|1\.?#(?:qnan|snan|ind|inf)\w*)", re.IGNORECASE
)
_WHOLE = re.compile(rb"[+-][0-9]+")
_PLAIN = b"0123456789+-.eE \r\n"
_D_TO_E = bytes.maketrans(b"dD", b"eE")
_GB2312 = re.compile(rb"(?:[\x00-\x7f]|[\xa1-\xf7][\xa1-\xfe])*")


class Refusal(Exception):  # noqa: N818 - a verdict about one dataset, not about the file
    """A dataset is damaged or ambiguous.

    Attributes:
        reason: what was found and expected.
        line: index of the line in the dataset, 0 for the first one after the type line; None where
            none is at fault.
    """

    def __init__(self, reason: str, line: int | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.line = line


class SkippedDataset(Exception):  # noqa: N818 - a verdict, not an error
    """A dataset is sound but of no use here; the message says why."""


def decoded(raw: bytes) -> str:
    """The text of a header.

    Programs state no encoding: it is UTF-8 where that decodes, else GBK where all high bytes pair
    up as Chinese text does, else cp1252.

    >>> decoded("Träger".encode("cp1252"))
    'Träger'
    """
    try:
        return raw.decode("utf-8").strip()
    except UnicodeDecodeError:
        pass
    try:
        return raw.decode("gbk" if _GB2312.fullmatch(raw) else "cp1252").strip()
    except UnicodeDecodeError:
        return raw.decode("latin-1").strip()


def shown(raw: bytes) -> str:
    """A piece of the file for a message: quoted, printable and short."""
    text = "".join(c if c.isprintable() else "�" for c in decoded(raw[:60]))
    return f"'{text[:40]}…'" if len(text) > 40 else f"'{text}'"


def rows_of(body: bytes) -> list[bytes]:
    r"""The lines of a dataset without line ends and trailing blanks; blank lines at its end are
    dropped.

    >>> rows_of(b"  1  \r\n\n  2\n\n")
    [b'  1', b'', b'  2']
    """
    return [row.rstrip() for row in body.rstrip().split(b"\n")] if body.strip() else []


def real(field: bytes) -> float:
    """A real number in any form that FORTRAN writes.

    Raises:
        ValueError: it is none, or it is too large for a double.
    """
    match = _REAL.fullmatch(field.strip().replace(b",", b"."))
    if match is None:
        raise ValueError(f"{shown(field.strip())} is not a number")
    value = float(match[1] + b"e" + (match[2] or match[3] or b"0"))
    if not np.isfinite(value):
        raise ValueError(f"{shown(field.strip())} is beyond double precision")
    return value


class Cursor:
    """Walks the lines of a dataset and reads their fields by column."""

    def __init__(self, body: bytes) -> None:
        self.rows = rows_of(body)
        self.line = 0

    def __bool__(self) -> bool:
        return self.line < len(self.rows)

    def next(self, what: str) -> bytes:
        """The next line, which holds `what`."""
        if self.line >= len(self.rows):
            raise Refusal(f"ends before {what}", self.line)
        self.line += 1
        return self.rows[self.line - 1]

    def refuse(self, reason: str) -> Refusal:
        """A refusal that names the line read last."""
        return Refusal(reason, self.line - 1)

    def integers(
        self, row: bytes, names: Sequence[str], width: int = 10, start: int = 0
    ) -> list[int]:
        """Consecutive integer fields of one width; an empty name takes a field that may be blank,
        read as 0.
        """
        values = []
        for index, name in enumerate(names):
            text = row[start + index * width : start + (index + 1) * width].strip()
            if not text.isdigit() and not _WHOLE.fullmatch(text) and (name or text):
                raise self.refuse(f"{name or 'a field'} is {shown(text)}, expected a whole number")
            values.append(int(text or 0))
        return values

    def reals(self, row: bytes, count: int, width: int, what: str, start: int = 0) -> list[float]:
        """Consecutive real fields of one width; nothing may follow them."""
        try:
            values = [real(row[start + i * width : start + (i + 1) * width]) for i in range(count)]
        except ValueError as error:
            raise self.refuse(f"{what}: {error}") from None
        if row[start + count * width :].strip():
            raise self.refuse(f"{what}: more than {count} values in the line")
        return values

    def real_rows(self, count: int, width: int, per_row: int, what: str) -> list[float]:
        """`count` reals over as many lines as they take."""
        values: list[float] = []
        while len(values) < count:
            take = min(per_row, count - len(values))
            values += self.reals(self.next(what), take, width, what)
        return values


def real_block(
    body: bytes, widths: Sequence[int], count: int, first_line: int, gap: range = range(0)
) -> tuple[FloatArray, str]:
    """`count` reals in rows of the given columns, and a note where the rows had to be read
    otherwise.

    Args:
        body: the rows; the last may be short, padded with blanks, or filled up with zeros.
        widths: columns of a full row.
        count: number of reals declared.
        first_line: index of the first row in the dataset, for messages.
        gap: fields of the first row that may be no numbers: they become NaN.

    Raises:
        Refusal: a value is none, or there are more or fewer than declared.
    """
    if (blanked := _blanked(body, widths, gap)) is not None:
        filled, note = real_block(blanked, widths, count, first_line)
        filled[gap.start : gap.stop] = np.nan
        return filled, note
    if not (unusual := body.translate(None, _PLAIN)).strip(b"dD"):
        plain = body.translate(_D_TO_E) if unusual else body
        values = _plain_block(plain, widths, count)
        if values is not None:
            return values, ""
    try:
        return _fortran_block(body, widths, count, first_line)
    except Refusal:
        # Rows of other widths are taken where blanks stand between exactly as many values as
        # declared.
        separated = _separated(body, count)
        if separated is None:
            raise
        return (
            separated,
            "its rows are not in the standard columns; its values were read as separated by blanks",
        )


def _blanked(body: bytes, widths: Sequence[int], gap: range) -> bytes | None:
    """The rows with zeros where a field of `gap` is NaN or infinite; None where none is."""
    edges = np.concatenate(([0], np.cumsum(widths)))
    spans = [(int(edges[i]), int(edges[i + 1])) for i in gap]
    row = body[: body.find(b"\n") + 1 or len(body)]
    if not any(_NO_NUMBER.fullmatch(row[a:b].strip()) for a, b in spans):
        return None
    for a, b in spans:
        row = row[:a] + b"0.0".rjust(b - a) + row[b:]
    return row + body[len(row) :]


def _separated(body: bytes, count: int) -> FloatArray | None:
    """`count` values with blanks between them; None where there are more, fewer, or anything
    else.
    """
    tokens = body.split()
    if len(tokens) != count:
        return None
    try:
        return np.array([real(token) for token in tokens])
    except ValueError:
        return None


def _plain_block(body: bytes, widths: Sequence[int], count: int) -> FloatArray | None:
    """The block by whole-array operations, where all full rows are alike and plain; None where they
    are not.
    """
    rows = -(-count // len(widths))
    stride = body.find(b"\n") + 1
    full, width = rows - 1, sum(widths)
    if full * stride > len(body) or (full and stride <= width):
        return None
    table = np.frombuffer(body, np.uint8, full * stride).reshape(full, stride)
    tail = body[full * stride :].rstrip()
    left = count - full * len(widths)
    if b"\n" in tail or len(tail) > sum(widths[:left]):
        return None
    if full and (np.any(table[:, -1] != 10) or not np.isin(table[:, width:-1], (13, 32)).all()):
        return None
    edges = np.concatenate(([0], np.cumsum(widths)))
    last = [tail[edges[i] : edges[i + 1]] for i in range(left)]
    try:
        columns = (
            [_column(table[:, edges[i] : edges[i + 1]]) for i in range(len(widths))] if full else []
        )
        values = np.concatenate((np.array(columns).T.ravel(), np.array(last).astype(np.float64)))
    except ValueError:
        return None
    return values if np.isfinite(values).all() else None


def _column(characters: NDArray[np.uint8]) -> FloatArray:
    """Reals of one column, given as its characters row by row."""
    return np.ascontiguousarray(characters).view(f"S{characters.shape[1]}")[:, 0].astype(np.float64)


def _fortran_block(
    body: bytes, widths: Sequence[int], count: int, first_line: int
) -> tuple[FloatArray, str]:
    """The block field by field: D exponents, exponents without a letter, padded rows, and zeros
    that fill the last one.
    """
    edges = np.concatenate(([0], np.cumsum(widths)))
    values: list[float] = []
    note = ""
    rows = rows_of(body)
    for index, row in enumerate(rows):
        take = min(len(widths), count - len(values))
        if (
            index == len(rows) - 1
            and 0 < take < len(widths)
            and _is_filled(row[edges[take] :], widths[take:])
        ):
            note = "its last row is filled up with zeros behind the declared number of values"
            row = row[: edges[take]]
        if take == 0 or len(row) > edges[take]:
            raise Refusal(
                f"holds more ordinates than the {count} values declared, or rows too wide",
                first_line + index,
            )
        try:
            values += [real(row[edges[i] : edges[i + 1]]) for i in range(take)]
        except ValueError as error:
            raise Refusal(str(error), first_line + index) from None
    if len(values) != count:
        raise Refusal(
            f"holds {len(values)} values where its header declares {count}", first_line + len(rows)
        )
    return np.array(values), note


def _is_filled(rest: bytes, widths: Sequence[int]) -> bool:
    """Whether some columns hold zeros alone."""
    edges = np.concatenate(([0], np.cumsum(widths)))
    fields = [rest[edges[i] : edges[i + 1]].strip() for i in range(len(widths))]
    zeros = [_REAL.fullmatch(field) is not None and real(field) == 0 for field in fields if field]
    return bool(zeros) and all(zeros) and not rest[edges[-1] :].strip()
