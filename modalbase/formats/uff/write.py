"""UFF out: what was read, or computed, as a file that our own reader and pyuff read back.

Everything is written in SI units under a set 164 that says so. What survives the way out and back:

- binary FRFs and functions (58b): every bit of the ordinates, and of the abscissa; an even abscissa
  whose start or step has no decimal of 13 characters is written value by value.
- ASCII FRFs and functions (58): 13 significant digits of doubles (E20.12), 6 or more of single
  precision and abscissae.
- grid points: every bit in set 2411 (D25.16), 6 digits or more in set 15.
- mode shapes (55): 6 digits or more, whatever the format's columns of 13 hold.
"""

import sys
from collections.abc import Iterable, Iterator
from itertools import groupby, islice
from pathlib import Path
from typing import Literal

import numpy as np

from modalbase.formats.types import FloatArray
from modalbase.formats.uff.content import (
    HEADER_LINES,
    ORDINATE_TYPES,
    Axis,
    Content,
    Element,
    FileHeader,
    Frf,
    Function,
    GridPoint,
    ModeShape,
    Units,
)
from modalbase.formats.uff.geometry import BEAMS

_TAG = b"    -1\n"
_RESPONSES = {
    "accelerance": (12, "Acceleration", "/s^2"),
    "mobility": (11, "Velocity", "/s"),
    "receptance": (8, "Displacement", ""),
}
_LINES = 4096  # that are text at a time
_PER_ROW = 8  # points of an element
_NO_AXIS = "         0    0    0    0 NONE                 NONE                "


def write_file(
    path: Path | str,
    contents: Iterable[Content],
    *,
    binary: bool = True,
    points: Literal["2411", "15"] = "2411",
) -> None:
    """Write contents to a UFF file, in SI. Reading it gives the same contents; the binary form
    keeps every bit.

    >>> import pathlib, tempfile
    >>> from modalbase.formats.uff import GridPoint, read_file
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "points.uff"
    >>> write_file(path, [GridPoint(7, (0.25, 0.02, 0.0))])
    >>> [item for item in read_file(path) if isinstance(item, GridPoint)]
    [GridPoint(number=7, xyz_m=(0.25, 0.02, 0.0))]

    Args:
        path: where to; a file that is there is replaced.
        contents: header, grid points, elements, FRFs, functions and mode shapes, as `encode` takes
            them.
        binary: FRFs and functions as set 58b (exact) or as text.
        points: the set for grid points.

    Raises:
        ValueError: a value is NaN, infinite, or too wide for its columns.
        TypeError: a content that is not written (coordinate systems, trace lines).
    """
    with Path(path).open("wb") as file:
        file.writelines(encode(contents, binary=binary, points=points))


def encode(
    contents: Iterable[Content], *, binary: bool = True, points: Literal["2411", "15"] = "2411"
) -> Iterator[bytes]:
    """The bytes of a UFF file, dataset by dataset.

    Args:
        contents: header, grid points, elements, FRFs, functions and mode shapes; units are left
            out, for all is written in SI.
        binary: FRFs and functions as set 58b (exact) or as text.
        points: the set for grid points.

    Raises:
        ValueError: a value is NaN, infinite, or too wide for its columns.
        TypeError: a content that is not written (coordinate systems, trace lines).
    """
    header_done = False
    for kind, group in groupby(contents, key=lambda content: type(content)):
        if kind is not FileHeader and not header_done:
            yield _set_164()
            header_done = True
        if kind is GridPoint:
            yield from _in_parts(
                points,
                _grid_points((each for each in group if isinstance(each, GridPoint)), points),
            )
        elif kind is Element:
            yield from _in_parts(
                "2412", _elements(each for each in group if isinstance(each, Element))
            )
        elif kind is not Units:
            yield from (_content(content, binary=binary) for content in group)
    if not header_done:
        yield _set_164()


def _content(content: Content, *, binary: bool) -> bytes:
    """One dataset."""
    if isinstance(content, FileHeader):
        lines = [
            content.model_name,
            content.description,
            "NONE",
            "",
            "",
            content.program,
            content.written,
        ]
        return _dataset("151", "".join(_line(text) for text in lines))
    if isinstance(content, Frf):
        return _function(
            content, _frf_axes(content), 4, content.frequency, content.load_case, binary=binary
        )
    if isinstance(content, Function):
        return _function(
            content,
            _function_axes(content),
            content.function_type,
            content.abscissa,
            0,
            binary=binary,
        )
    if isinstance(content, ModeShape):
        return _mode_shape(content)
    raise TypeError(f"{type(content).__name__} is not written to UFF files")


def _dataset(kind: str, text: str) -> bytes:
    """A text dataset between its delimiters."""
    return _TAG + f"{kind:>6}\n".encode() + text.encode() + _TAG


def _in_parts(kind: str, lines: Iterator[str]) -> Iterator[bytes]:
    """A text dataset of any number of lines, some at a time."""
    yield _TAG + f"{kind:>6}\n".encode()
    while text := "".join(islice(lines, _LINES)):
        yield text.encode()
    yield _TAG


def _line(text: str) -> str:
    """A line of 80 columns; line breaks in it become blanks."""
    clean = "".join(c if c.isprintable() else " " for c in text).strip()
    while len(clean.encode()) > 80:
        clean = clean[:-1]
    return f"{clean:<80}\n"


def _fixed(value: float, width: int = 13) -> str:
    """A real in `width` columns, with as many digits as they hold."""
    if not np.isfinite(value):
        raise ValueError(f"{value} cannot be written to a UFF file")
    # One digit takes eight columns at most; the point stays, as FORTRAN would imply one elsewhere.
    forms = (f"{value:#.{digits}g}".partition("e") for digits in range(17, 0, -1))
    shortest = (m.rstrip("0") + e + exponent for m, e, exponent in forms)
    return next(f"{text:>{width}}" for text in shortest if len(text) <= width)


def _apart(value: float) -> str:
    """A real in 13 columns of which the first is blank, for readers that split at blanks."""
    return " " + _fixed(value, 12)


def _whole(value: int, width: int) -> str:
    """A whole number in `width` columns.

    Raises:
        ValueError: it is wider.
    """
    text = f"{value:>{width}d}"
    if len(text) > width:
        raise ValueError(f"{value} does not fit into {width} columns of a UFF file")
    return text


def _set_164() -> bytes:
    """Units: SI."""
    row = "".join(f"{factor:25.16e}".replace("e", "D") for factor in (1.0, 1.0, 1.0))
    offset = f"{273.15:25.16e}".replace("e", "D")
    return _dataset("164", f"{1:10d}{'SI: Meter (newton)':<20}{1:10d}\n{row}\n{offset}\n")


def _grid_points(points: Iterable[GridPoint], kind: str) -> Iterator[str]:
    """The lines of set 2411, or 15."""
    for point in points:
        if not all(np.isfinite(point.xyz_m)):
            raise ValueError(f"grid point {point.number} is at {point.xyz_m}")
        labels = _whole(point.number, 10) + _whole(0, 10) * 2 + _whole(1, 10)
        if kind == "15":
            yield labels + "".join(_apart(x) for x in point.xyz_m) + "\n"
        else:
            yield (
                labels + "\n" + "".join(f"{x:25.16e}".replace("e", "D") for x in point.xyz_m) + "\n"
            )


def _elements(elements: Iterable[Element]) -> Iterator[str]:
    """The lines of set 2412; material and colour are 1."""
    for each in elements:
        fields = each.number, each.descriptor, each.properties, 1, 1, len(each.points)
        yield "".join(_whole(n, 10) for n in fields) + "\n"
        if each.descriptor in BEAMS:
            yield "".join(_whole(n, 10) for n in (0, 1, 1)) + "\n"
        labels = [_whole(point, 10) for point in each.points]
        yield from (
            "".join(labels[k : k + _PER_ROW]) + "\n" for k in range(0, len(labels), _PER_ROW)
        )


def _frf_axes(frf: Frf) -> list[str]:
    """Records 8 to 10 of an FRF in SI."""
    kind, name, per_time = _RESPONSES[frf.quantity]
    turned, moment = abs(frf.response_direction) > 3, abs(frf.reference_direction) > 3
    return [
        f"{18:10d}    0    0    0 {'Frequency':<20} {'Hz':<20}",
        (
            f"{kind:10d}{int(not turned):5d}    0    0 {name:<20}"
            f" {('rad' if turned else 'm') + per_time:<20}"
        ),
        (
            f"{13:10d}{int(moment):5d}    1    0 {'Moment' if moment else 'Force':<20}"
            f" {'N*m' if moment else 'N':<20}"
        ),
    ]


def _function_axes(function: Function) -> list[str]:
    """Records 8 to 10 of another function, with the units that it came with."""
    axes = []
    for unit in (function.abscissa_unit, function.unit):
        clean = "".join(c if c.isprintable() else " " for c in unit).strip() or "NONE"
        if len(clean) > 20:
            raise ValueError(f"the unit '{clean}' does not fit into 20 columns")
        axes.append(f"{0:10d}    0    0    0 {'NONE':<20} {clean:<20}")
    return [*axes, _NO_AXIS]


def _function(
    content: Frf | Function,
    axes: list[str],
    function_type: int,
    axis: Axis,
    load_case: int,
    *,
    binary: bool,
) -> bytes:
    """Set 58 or 58b."""
    if not np.isfinite(content.values).all():
        raise ValueError(f"'{content.label}' holds NaN or infinite ordinates")
    even = axis.values is None and (
        not binary or all(float(_fixed(x)) == x for x in (axis.start, axis.step))
    )
    table = _table(content, axis, even=even)
    double = table.dtype == np.float64
    kind = ORDINATE_TYPES[content.values.dtype.kind, double]
    dofs = (
        f"{_whole(function_type, 5)}{_whole(0, 10)}{_whole(0, 5)}{_whole(load_case, 10)}"
        f" {'NONE':<10}{_whole(content.response_point, 10)}{_whole(content.response_direction, 4)}"
        f" {'NONE':<10}{_whole(content.reference_point, 10)}{_whole(content.reference_direction, 4)}"
    )
    form = f"{kind:10d}{axis.count:10d}{int(even):10d}"
    form += (_fixed(axis.start) + _fixed(axis.step) if even else _fixed(0.0) * 2) + _fixed(0.0)
    ids = (content.label, *content.id_lines[1:])
    header = "".join(_line(text) for text in ids) + "\n".join([dofs, form, *axes, _NO_AXIS]) + "\n"
    if binary:
        data = table.tobytes()
        order = 1 if sys.byteorder == "little" else 2
        type_line = (
            f"    58b{order:6d}{2:6d}{HEADER_LINES:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}\n"
        )
        return _TAG + type_line.encode() + header.encode() + data + _TAG
    return _dataset("58", header + _rows(table, double=double, even=even))


def _table(content: Frf | Function, axis: Axis, *, even: bool) -> FloatArray:
    """Rows of (abscissa,) real part (, imaginary part), in doubles where the ordinates or the
    abscissa take them.
    """
    values = np.ascontiguousarray(content.values)
    parts = values.view(values.real.dtype).reshape(len(values), -1)
    if even:
        return parts
    x = axis.points()
    single = parts.dtype == np.float32 and bool(np.all(x.astype(np.float32) == x))
    return np.column_stack((x, parts)).astype(np.float32 if single else np.float64)


def _rows(table: FloatArray, *, double: bool, even: bool) -> str:
    """The table in the columns of the format."""
    wide, narrow = "%20.12e", "%13.5e"
    if not double:
        row = [narrow] * 6
    elif even:
        row = [wide] * 4
    else:
        row = [narrow, wide] * 2 if table.shape[1] == 2 else [narrow, wide, wide]
    flat: list[float | str] = [*table.ravel().tolist()]
    if not even:
        flat[:: table.shape[1]] = [_apart(x) for x in table[:, 0].tolist()]
        row = ["%13s" if i % table.shape[1] == 0 else form for i, form in enumerate(row)]
    full = len(flat) // len(row)
    text = ("".join(row) + "\n") * full % tuple(flat[: full * len(row)])
    left = flat[full * len(row) :]
    return text + ("".join(row[: len(left)]) % tuple(left) + "\n" if left else "")


def _mode_shape(mode: ModeShape) -> bytes:
    """Set 55."""
    if not np.isfinite(mode.values).all():
        raise ValueError(f"mode {mode.mode} holds NaN or infinite values")
    complex_values = bool(mode.values.imag.any())
    components = mode.values.shape[1]
    analysis = 2 if mode.kind == "normal" else 3
    damping = 0.0 if np.isnan(mode.damping_ratio) else mode.damping_ratio
    if analysis == 2:
        parameters = [mode.frequency_hz, 0.0, damping, 0.0]
    else:
        omega = 2 * np.pi * mode.frequency_hz
        parameters = [-damping * omega, omega * np.sqrt(1 - damping**2), 0.0, 0.0, 0.0, 0.0]
    definition = (
        1,
        analysis,
        2 if components == 3 else 3,
        8,
        5 if complex_values else 2,
        components,
    )
    lines = [
        _line(mode.label) + _line("NONE") * 4,
        "".join(_whole(number, 10) for number in definition) + "\n",
        "".join(_whole(number, 10) for number in (2, len(parameters), 1, mode.mode)) + "\n",
        "".join(_apart(number) for number in parameters) + "\n",
    ]
    for point, values in zip(mode.points.tolist(), mode.values, strict=True):
        row = np.ascontiguousarray(values).view(np.float64) if complex_values else values.real
        lines.append(_whole(point, 10) + "\n")
        lines += ["".join(_apart(x) for x in row[i : i + 6]) + "\n" for i in range(0, len(row), 6)]
    return _dataset("55", "".join(lines))
