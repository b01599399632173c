"""The framing of a UFF file, checked in one streaming pass before anything in it is parsed.

A file is a chain of datasets. Each opens with a delimiter line (-1 in columns 5 and 6), then a line
with its type in columns 1 to 6, and closes with another delimiter. Between two datasets may stand
blank lines, and words that can be no data (some programs write the name of the part there). In a
binary set 58b the length of the data is declared in the type line, and the closing delimiter must
stand right behind it; some programs count the line ends about the data too.

A delimiter that is lost, added or moved shifts the roles of all that follow, so it always ends at a
line that cannot be what its place demands, and the whole file is refused.
"""

import re
from codecs import BOM_UTF8
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from modalbase.formats.foreign import NO_UTF_16, UTF_16
from modalbase.formats.uff.content import HEADER_LINES, Limits, UffError
from modalbase.formats.uff.text import shown

SMALL_CHUNK, LARGE_CHUNK = 1 << 13, 1 << 20
ODD_DELIMITERS = 1000
_WORDS_BETWEEN = 4
_WORDS = re.compile(rb"[A-Za-z][A-Za-z _.,:;()-]*")
# bytes by which a binary set's count may exceed its data: line ends, and blanks after them
_COUNTED_ENDS = 16
_DELIMITER_LINE = re.compile(rb"\n([ \t]*)-1[ \t]*\r?(?=\n|\Z)")
_TYPE_LINE = re.compile(rb"( {0,5}[0-9]{1,6})([bB].*|[ \t]*)")
# others below 100 are rather the label of a node
_SHORT_TYPES = (15, 18, 55, 56, 57, 58, 82, 90, 91, 95)


@dataclass(frozen=True, slots=True)
class Frame:
    """Where a dataset stands in the file."""

    number: int  # 1 for the first dataset
    type: str  # "15", "58", "58b" ...
    offset: int  # byte of the opening delimiter
    start: int  # first byte after the type line
    end: int  # byte after the last one of its content
    type_line: bytes  # the line with the type, which in set 58b carries the binary header
    note: str = ""  # what was odd about the framing and how it was taken, or ""


@dataclass(frozen=True, slots=True)
class BinaryHeader:
    """Type line of set 58b: FORMAT(I6,A1,I6,I6,I12,I12,I6,I6,I12,I12)."""

    little_endian: bool
    float_format: int
    data_bytes: int


def scan(path: Path, limits: Limits) -> list[Frame]:
    """The frames of all datasets of a file.

    Raises:
        UffError: the file is empty, is no UFF file, is cut short, or its delimiters do not pair.
    """
    size = path.stat().st_size
    if size == 0:
        raise UffError("the file is empty, expected a Universal File Format file")
    frames: list[Frame] = []
    with path.open("rb") as file:
        position = _begin(file.read(SMALL_CHUNK))
        words: list[bytes] = []
        while (
            opening := _opening(file, position, size, limits, first=not frames, words=words)
        ) is not None:
            if len(frames) == limits.datasets:
                raise UffError(f"the file holds more than {limits.datasets} datasets", opening[0])
            frame, position = _dataset(file, len(frames) + 1, *opening, size, limits)
            if words:
                remark = (
                    f"before it stands the text {', '.join(map(shown, words))}, which is no dataset"
                    " and was passed over"
                )
                frame = replace(frame, note="; ".join(filter(None, [frame.note, remark])))
                words.clear()
            frames.append(frame)
    if not frames:
        raise UffError(
            "the file holds nothing but blank lines, expected a Universal File Format file"
        )
    return frames


def _begin(head: bytes) -> int:
    """The first byte behind a mark of byte order.

    Raises:
        UffError: it is text of a kind that no UFF is; says how to save it.
    """
    if head.startswith(UTF_16):
        raise UffError(NO_UTF_16)
    if b"\r" in head and b"\n" not in head:
        raise UffError("its lines end in CR alone; save them with LF, or with CR and LF")
    return len(BOM_UTF8) if head.startswith(BOM_UTF8) else 0


def _line(file: BinaryIO, position: int, limits: Limits) -> bytes:
    """The line that begins at `position`, with its line end; empty at the end of the file."""
    file.seek(position)
    line = file.readline(limits.line_bytes + 1)
    if len(line) > limits.line_bytes:
        raise UffError(
            f"a line is longer than {limits.line_bytes} bytes, so this is no sound UFF file",
            position,
        )
    return line


def _opening(
    file: BinaryIO,
    position: int,
    size: int,
    limits: Limits,
    *,
    first: bool,
    words: list[bytes] | None = None,
) -> tuple[int, int] | None:
    """Offset of the next opening delimiter and of the line after it; None where only blanks are
    left.

    Lines of words alone are passed over and put into `words`: they hold no digit, so they are
    neither data nor a type line.
    """
    blanks_from = position
    while position < size:
        line = _line(file, position, limits)
        content = line.strip(b" \t\r\n")
        if content == b"-1":
            return position, position + len(line)
        if (
            words is not None
            and not first
            and len(words) < _WORDS_BETWEEN
            and _WORDS.fullmatch(content)
        ):
            words.append(content)
        elif content.strip(b"\x1a"):
            what = "not a UFF file: it opens with" if first else "between two datasets stands"
            raise UffError(
                f"{what} {shown(content)}, expected a delimiter line '    -1'"
                + (
                    "; delete what stands before it, if the file is one"
                    if first
                    else "; a delimiter is lost, added or damaged nearby"
                ),
                position,
            )
        position += len(line)
        if position - blanks_from > limits.blank_bytes:
            raise UffError(f"more than {limits.blank_bytes} bytes of blank lines", blanks_from)
    return None


def _dataset(
    file: BinaryIO, number: int, offset: int, position: int, size: int, limits: Limits
) -> tuple[Frame, int]:
    """The frame of the dataset whose type line begins at `position`, and the byte after its closing
    delimiter.
    """
    line = _line(file, position, limits)
    if not line.strip():
        raise UffError(
            "the file ends or is blank after an opening delimiter, expected a dataset type", offset
        )
    match = _TYPE_LINE.fullmatch(line.rstrip(b"\r\n"))
    if match is None or not 0 < (kind := int(match[1])) < 10_000:
        raise UffError(
            f"after the delimiter of dataset {number} stands {shown(line.strip())}, expected its"
            " type in columns 1 to 6; a delimiter is lost or added nearby",
            position,
        )
    start = position + len(line)
    if not match[2].strip():
        end, after, note = _closing(file, number, start, offset, size, limits)
        frame = Frame(
            number=number,
            type=str(kind),
            offset=offset,
            start=start,
            end=end,
            type_line=line,
            note=note,
        )
        return frame, after
    if kind != 58:
        raise UffError(
            f"dataset {number} has type {shown(line.strip())}; of the binary sets only 58b is"
            " known",
            position,
        )
    end, after, note = _binary_end(file, number, line, start, offset, limits)
    frame = Frame(
        number=number, type="58b", offset=offset, start=start, end=end, type_line=line, note=note
    )
    return frame, after


def _closing(
    file: BinaryIO, number: int, start: int, offset: int, size: int, limits: Limits
) -> tuple[int, int, str]:
    """Byte of the closing delimiter of a text dataset, the byte after it, and a note where it is
    oddly placed.
    """
    position, odd = start - 1, 0  # from the line end before, so that each line has one
    size_read = SMALL_CHUNK  # growing, so that many small datasets are not read many times over
    while position < size:
        file.seek(position)
        chunk = file.read(size_read)
        size_read = min(2 * size_read, LARGE_CHUNK)
        last = position + len(chunk) >= size
        if not last and not (chunk := chunk[: chunk.rfind(b"\n") + 1])[1:]:
            raise UffError(
                f"a line is longer than {limits.line_bytes} bytes, so this is no sound UFF file",
                position,
            )
        for match in _DELIMITER_LINE.finditer(chunk):
            begin, after = position + match.start() + 1, min(position + match.end() + 1, size)
            if match[1] == b"    ":
                return begin, after, ""
            if _closes(file, after, size, limits):
                return begin, after, "its closing delimiter is not in columns 5 and 6"
            if (odd := odd + 1) > ODD_DELIMITERS:
                raise UffError(
                    f"more than {ODD_DELIMITERS} lines of -1 in dataset {number}", offset
                )
        position = size if last else position + len(chunk) - 1
    raise UffError(
        f"the file ends inside dataset {number}, which begins at byte {offset}: it was cut short,"
        " or its closing delimiter is damaged",
        size,
    )


def _closes(file: BinaryIO, position: int, size: int, limits: Limits) -> bool:
    """Whether an oddly placed -1 before `position` closes a dataset: what follows is a new dataset
    or nothing.
    """
    try:
        opening = _opening(file, position, size, limits, first=False)
    except UffError:
        return False
    if opening is None:
        return True
    match = _TYPE_LINE.fullmatch(_line(file, opening[1], limits).rstrip(b"\r\n"))
    return match is not None and (int(match[1]) in _SHORT_TYPES or int(match[1]) >= 100)


def binary_header(line: bytes) -> BinaryHeader:
    """Fields of a type line of set 58b.

    Raises:
        ValueError: a field is not what the format allows; the message names it.
    """
    fields: list[int] = []
    column = 7
    for name, width in (
        ("byte order", 6),
        ("floating point format", 6),
        ("ASCII line count", 12),
        ("byte count", 12),
    ):
        text = line[column : column + width].strip()
        if not text.isdigit():
            raise ValueError(f"the {name} is {shown(text)}, expected a number")
        fields.append(int(text))
        column += width
    order, float_format, ascii_lines, data_bytes = fields
    if order not in (1, 2):
        raise ValueError(f"the byte order is {order}, expected 1 (little endian) or 2 (big endian)")
    if ascii_lines != HEADER_LINES:
        raise ValueError(
            f"the count of ASCII header lines is {ascii_lines}, expected {HEADER_LINES}"
        )
    return BinaryHeader(order == 1, float_format, data_bytes)


def _binary_end(
    file: BinaryIO, number: int, line: bytes, start: int, offset: int, limits: Limits
) -> tuple[int, int, str]:
    """Byte after the data of a set 58b, the byte after its closing delimiter, and a note."""
    try:
        header = binary_header(line)
    except ValueError as error:
        raise UffError(f"binary header of dataset {number}: {error}", offset) from None
    position = start
    record_7 = b""
    for index in range(HEADER_LINES):
        text = _line(file, position, limits)
        if not text.endswith(b"\n"):
            raise UffError(f"the file ends inside the header of dataset {number}", position)
        record_7 = text if index == 6 else record_7
        position += len(text)
    declared, sizes = header.data_bytes, _bytes_by_record_7(record_7)
    counted = [
        (actual, ", line ends included")
        for _, actual in sizes
        if 0 < declared - actual <= _COUNTED_ENDS
    ]
    # pyuff writes 8 (or 4) bytes a point into the header even where a point takes 16 or 24.
    by_pyuff = [(actual, "") for stated, actual in sizes if stated == declared]
    for actual, how in dict.fromkeys([*counted, (declared, ""), *by_pyuff]):
        if (after := _delimiter_after(file, position + actual)) is not None:
            note = (
                f"its header declares {declared} bytes of data{how}; the {actual} bytes that its"
                " type and number of points make were read, for its delimiter stands behind them"
            )
            return position + actual, after, "" if actual == declared else note
    raise UffError(
        f"dataset {number} declares {header.data_bytes} bytes of binary data, but no delimiter"
        " stands behind them: the file was cut or changed, or the count is wrong",
        offset,
    )


def _bytes_by_record_7(record_7: bytes) -> list[tuple[int, int]]:
    """Pairs (bytes that pyuff declares, bytes that it writes) for the points that record 7
    states.
    """
    fields = [record_7[i : i + 10].strip() for i in (0, 10, 20)]
    if not all(field.isdigit() for field in fields):
        return []
    kind, points, even = (int(field) for field in fields)
    item = {2: 4, 4: 8, 5: 4, 6: 8}.get(kind, 0)
    columns = (2 if kind in (5, 6) else 1) + (0 if even else 1)
    return [(points * item, points * columns * width) for width in {item, 8}]


def _delimiter_after(file: BinaryIO, position: int) -> int | None:
    """Byte after the delimiter line that begins at `position`, or behind one or two line ends; None
    where there is none.
    """
    file.seek(position)
    match = re.match(rb"(?:[ \t\x00]{0,8}\r{0,2}\n){0,2}    -1[ \t]*(?:\r?\n|\Z)", file.read(160))
    return None if match is None else position + match.end()
