"""Sets 58 and 58b: a function at nodal degrees of freedom, read by its columns or its bytes and
held to its header.
"""

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from modalbase.formats.types import FloatArray
from modalbase.formats.uff.content import (
    COHERENCE,
    FRF_TYPE,
    FUNCTION_NAMES,
    HEADER_LINES,
    ORDINATE_TYPES,
    Axis,
    OfDofs,
    Samples,
)
from modalbase.formats.uff.scan import Frame, binary_header
from modalbase.formats.uff.text import Cursor, Refusal, decoded, real_block, shown
from modalbase.formats.units import NO_UNIT, unit_in_name

_KINDS = {number: kind for kind, number in ORDINATE_TYPES.items()}
_ABSURD_DECADES = 24.0
_ENOUGH_POINTS = 16
_NO_REFERENCE = "the reference point is -1, read as 0: the file states none"


@dataclass(frozen=True)
class AxisDescription:
    """Records 8 to 11: what an axis holds, by type, unit exponents and labels."""

    data_type: int
    exponents: tuple[int, ...]  # of length, force and temperature
    name: str
    unit: str


@dataclass(frozen=True, eq=False)
class RawFunction(OfDofs):
    """Set 58 as the file states it, in the file's units."""

    id_lines: tuple[str, str, str, str, str]
    function_type: int
    load_case: int
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    abscissa: AxisDescription
    ordinate: AxisDescription
    denominator: AxisDescription
    axis: Axis
    values: Samples
    ordinate_type: int
    notes: tuple[str, ...]
    names: tuple[str, str]  # of the response and the reference in record 6


@dataclass(frozen=True)
class _Shape:
    """Record 7: ordinate type, number of points, and the even abscissa or none."""

    ordinate_type: int
    points: int
    even: bool
    start: float
    step: float

    @property
    def complex_values(self) -> bool:
        return _KINDS[self.ordinate_type][0] == "c"

    @property
    def double(self) -> bool:
        return _KINDS[self.ordinate_type][1]

    @property
    def parts(self) -> int:
        """Reals an ordinate takes."""
        return 2 if self.complex_values else 1

    def behind_first(self) -> "_Shape":
        """The same without its first point."""
        return replace(self, points=self.points - 1, start=self.start + self.step)


def read_58(frame: Frame, body: bytes) -> RawFunction:
    """A set 58 or 58b.

    Raises:
        Refusal: a header field is not what the format allows, or the data are not what the header
            declares.
    """
    cut = _end_of_header(body)
    cursor = Cursor(body[:cut] + b"-")  # a last character keeps header lines that are blank
    ids = tuple(decoded(cursor.next("the ID lines")) for _ in range(5))
    dofs, names, notes = _degrees_of_freedom(cursor)
    shape = _shape(cursor)
    abscissa, ordinate, denominator, _ = (_axis_description(cursor) for _ in range(4))
    read = _binary_data if frame.type == "58b" else _text_data
    table, note = read(frame, body[cut:], shape)
    gap = _gap_at_start(table, shape)
    if gap and dofs[0] not in (FRF_TYPE, COHERENCE):
        raise Refusal(gap, HEADER_LINES)
    axis, values, more = _assembled(
        table[1:] if gap else table, shape.behind_first() if gap else shape
    )
    if shape.complex_values and dofs[0] in (6, 26, 21):
        notes.append(f"a {FUNCTION_NAMES[dofs[0]]} with complex ordinates")
    return RawFunction(
        (ids[0], ids[1], ids[2], ids[3], ids[4]),
        *dofs,
        abscissa,
        ordinate,
        denominator,
        axis,
        values,
        shape.ordinate_type,
        (*notes, *([f"{gap}: this line is left out"] if gap else []), *filter(None, [note]), *more),
        names,
    )


def _end_of_header(body: bytes) -> int:
    """Byte after the eleventh line."""
    position = 0
    for _ in range(HEADER_LINES):
        position = body.find(b"\n", position) + 1
        if position == 0:
            raise Refusal(f"ends inside its {HEADER_LINES} header lines")
    return position


def _degrees_of_freedom(
    cursor: Cursor,
) -> tuple[tuple[int, int, int, int, int, int], tuple[str, str], list[str]]:
    """Record 6, FORMAT(2(I5,I10),2(1X,10A1,I10,I4)): function type, load case, response and
    reference, and their names.
    """
    row = cursor.next("the degrees of freedom")
    fields = {
        "function type": (0, 5),
        "load case": (20, 10),
        "response point": (41, 10),
        "response direction": (51, 4),
        "reference point": (66, 10),
        "reference direction": (76, 4),
    }
    notes: list[str] = []
    values: list[int] = []
    for name, (start, width) in fields.items():
        if name != "function type" and not row[start : start + width].strip():
            notes.append(f"the {name} is blank, read as 0")
            values.append(0)
        else:
            values += cursor.integers(row, [name], width, start)
    if row[80:].strip():
        raise cursor.refuse(f"record 6 goes beyond column 80 with {shown(row[80:].strip())}")
    kind, load_case, response_point, response_direction, reference_point, reference_direction = (
        values
    )
    if kind not in FUNCTION_NAMES:
        raise cursor.refuse(f"the function type is {kind}, expected 0 to {max(FUNCTION_NAMES)}")
    for name, direction in (("response", response_direction), ("reference", reference_direction)):
        if abs(direction) > 6:
            raise cursor.refuse(f"the {name} direction is {direction}, expected -6 to 6")
    if reference_point == -1:
        reference_point = 0
        notes.append(_NO_REFERENCE)
    if response_point < 0 or reference_point < 0:
        raise cursor.refuse(
            f"the grid points are {response_point} and {reference_point}, expected positive labels"
        )
    dofs = (
        kind,
        load_case,
        response_point,
        response_direction,
        reference_point,
        reference_direction,
    )
    return dofs, (decoded(row[31:41]), decoded(row[56:66])), notes


def _shape(cursor: Cursor) -> _Shape:
    """Record 7, FORMAT(3I10,3E13.5)."""
    row = cursor.next("the data form")
    kind, points, spacing = cursor.integers(
        row, ["ordinate data type", "number of points", "abscissa spacing"]
    )
    if kind not in _KINDS:
        raise cursor.refuse(f"the ordinate data type is {kind}, expected 2, 4, 5 or 6")
    if points < 1:
        raise cursor.refuse(f"the number of points is {points}, expected at least 1")
    if spacing not in (0, 1):
        raise cursor.refuse(f"the abscissa spacing is {spacing}, expected 0 (uneven) or 1 (even)")
    start, step = 0.0, 0.0
    if spacing == 1:
        start, step = cursor.reals(
            row[:56].rstrip(), 2, 13, "abscissa minimum and increment", start=30
        )
        if step <= 0 and points > 1:
            raise cursor.refuse(f"the abscissa increment is {step:g}, expected a positive number")
    return _Shape(kind, points, spacing == 1, start, step)


def _axis_description(cursor: Cursor) -> AxisDescription:
    """Records 8 to 11, FORMAT(I10,3I5,2(1X,20A1)).

    A label in UTF-8 may be padded by characters or by bytes, so the columns of the unit label are
    sought in both.
    """
    row = cursor.next("the axis descriptions")
    (kind,) = cursor.integers(row, ["data type"])
    exponents = tuple(cursor.integers(row, ["", "", ""], 5, 10))
    name, unit = decoded(row[26:46]), decoded(row[47:67])
    if row[25:26].strip() or row[46:47].strip():
        try:
            text = row.decode("utf-8")
        except UnicodeDecodeError:
            text = ""
        if text and not text[25:26].strip() and not text[46:47].strip():
            name, unit = text[26:46].strip(), text[47:67].strip()
        elif re.search(rb"\s{2,}", row[25:].strip()):
            name, unit = (
                decoded(part) for part in re.split(rb"\s{2,}", row[25:].strip(), maxsplit=1)
            )
    if unit.lower() in NO_UNIT:  # some programs write it into the name
        unit = unit_in_name(name)[1] or unit
    return AxisDescription(kind, exponents, name, unit)


def _gap_at_start(table: FloatArray, shape: _Shape) -> str:
    """What to say of a first line at 0 Hz that is no number, as double integration writes it (0/0);
    "" where it is one.

    Raises:
        Refusal: another line is no number.
    """
    bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if not bad.size:
        return ""
    points = shape.start + shape.step * bad if shape.even else table[bad, 0]
    if bad.size > 1 or points[0] != 0 or shape.points == 1:
        raise Refusal(
            f"{bad.size} points are NaN or infinite, the first is number {bad[0] + 1} (at"
            f" {points[0]:g}); only one at 0 Hz can be left out"
        )
    return "its value at 0 Hz is NaN or infinite"


def _text_data(_: Frame, body: bytes, shape: _Shape) -> tuple[FloatArray, str]:
    """Ordinates in columns: 6E13.5, 4E20.12, 2(E13.5,E20.12) or (E13.5,2E20.12)."""
    columns = shape.parts + (0 if shape.even else 1)
    if shape.points * columns > len(body):
        raise Refusal(f"declares {shape.points} points but holds only {len(body)} bytes of data", 6)
    if not shape.double:
        widths: tuple[int, ...] = (13,) * 6
    elif shape.even:
        widths = (20,) * 4
    else:
        widths = (13, 20, 20) if shape.complex_values else (13, 20, 13, 20)
    first = 0 if shape.even else 1
    flat, note = real_block(
        body, widths, shape.points * columns, HEADER_LINES, range(first, first + shape.parts)
    )
    return flat.reshape(shape.points, columns), note


def _binary_data(frame: Frame, data: bytes, shape: _Shape) -> tuple[FloatArray, str]:
    """Ordinates as IEEE 754 numbers; an uneven abscissa in single or double precision, as the byte
    count says.
    """
    header = binary_header(frame.type_line)
    if header.float_format != 2:
        raise Refusal(
            f"the floating point format is {header.float_format}; only 2 (IEEE 754) is read"
        )
    order = "<" if header.little_endian else ">"
    item = f"{order}f8" if shape.double else f"{order}f4"
    layouts = [[("y", item, (shape.parts,))]]
    if not shape.even:
        layouts = [[("x", x, (1,)), *layouts[0]] for x in dict.fromkeys((item, f"{order}f4"))]
    for layout in layouts:
        if np.dtype(layout).itemsize * shape.points == len(data):
            break
    else:
        size = np.dtype(layouts[0]).itemsize
        raise Refusal(
            f"declares {shape.points} points of {size} bytes but holds {len(data)} bytes:"
            f" {len(data) / size:g} points",
            6,
        )
    table = np.frombuffer(data, np.dtype(layout))
    flat = _doubles(table)
    if _swapped(table):
        raise Refusal(
            f"its numbers make no sense as {'little' if header.little_endian else 'big'} endian,"
            " and do the other way round: the byte order in its header is wrong"
        )
    return flat, (
        ""
        if layout == layouts[0]
        else "its abscissa is in single precision, its ordinates in double"
    )


def _doubles(table: NDArray[np.void]) -> FloatArray:
    """Rows of a binary table as doubles."""
    with np.errstate(invalid="ignore"):  # a signalling NaN warns; NaNs are refused by name
        columns = [table[name].astype(np.float64, copy=False) for name in table.dtype.names or ()]
    return columns[0] if len(columns) == 1 else np.hstack(columns)


def _swapped(table: NDArray[np.void]) -> bool:
    """Whether the bytes are in the other order: as read, the magnitudes are strewn over all
    exponents.
    """
    some = table[:: max(1, len(table) // 64)]
    if len(some) < _ENOUGH_POINTS:
        return False
    return (
        _decades(_doubles(some)) > _ABSURD_DECADES
        and _decades(_doubles(some.byteswap())) < _ABSURD_DECADES / 2
    )


def _decades(values: FloatArray) -> float:
    """Scatter of the magnitudes, decades between the 10th and the 90th percentile; infinite where
    most are no numbers.
    """
    sizes = np.sort(np.abs(values[np.isfinite(values) & (values != 0)]))
    if sizes.size * 2 < np.count_nonzero(values):
        return float("inf")
    tenth = sizes.size // 10
    return float(np.log10(sizes[-1 - tenth]) - np.log10(sizes[tenth])) if sizes.size else 0.0


def fits_single(values: FloatArray) -> bool:
    """Whether single precision holds the values to its full six digits, neither too large nor too
    small for it.
    """
    with np.errstate(over="ignore"):
        back = values.astype(np.float32).astype(np.float64)
    return bool(np.all(np.abs(back - values) <= 1e-6 * np.abs(values)))


def _assembled(table: FloatArray, shape: _Shape) -> tuple[Axis, Samples, list[str]]:
    """Abscissa and ordinates from rows of (abscissa,) real part (, imaginary part)."""
    notes: list[str] = []
    ordinates = table if shape.even else table[:, 1:]
    axis = Axis(shape.start, shape.step if shape.points > 1 else 0.0, shape.points)
    if not shape.even:
        x = np.ascontiguousarray(table[:, 0])
        if np.any(np.diff(x) <= 0):
            raise Refusal(
                f"the abscissa does not increase at point {int(np.argmax(np.diff(x) <= 0)) + 2}"
            )
        axis = Axis(float(x[0]), 0.0, shape.points, x)
    values = (
        np.ascontiguousarray(ordinates).view(np.complex128)[:, 0]
        if shape.complex_values
        else ordinates[:, 0].copy()
    )
    if shape.double:
        return axis, values, notes
    if not fits_single(ordinates):
        notes.append("ordinates of single precision that only a double holds were kept as doubles")
        return axis, values, notes
    single = values.astype(np.complex64) if shape.complex_values else values.astype(np.float32)
    return axis, single, notes
