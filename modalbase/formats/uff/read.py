"""A UFF file as a stream of contents and reports.

The framing of the whole file is checked first (`scan`). Units, coordinate systems and the points
that are not measured along global axes are gathered next, for they may stand anywhere in the file.
Then each dataset is read by its columns and counts, and yielded.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from modalbase.formats.uff.channels import (
    AUTO_SPECTRUM,
    CROSS_SPECTRUM,
    TIME_RESPONSE,
    Hits,
    spectrum_of,
    time_of,
)
from modalbase.formats.uff.content import (
    FRF_TYPE,
    Content,
    CoordinateSystem,
    DatasetReport,
    GridPoint,
    Limits,
    UffError,
    Units,
)
from modalbase.formats.uff.frf import frf_of, function_of
from modalbase.formats.uff.function import RawFunction, read_58
from modalbase.formats.uff.geometry import (
    Geometry,
    Parsed,
    PointRow,
    grid_points,
    read_18,
    read_82,
    read_151,
    read_2412,
    read_2420,
    rows_15,
    rows_2411,
)
from modalbase.formats.uff.names import placed, unplaced
from modalbase.formats.uff.scan import Frame, scan
from modalbase.formats.uff.shapes import read_55, read_2414
from modalbase.formats.uff.text import Refusal, SkippedDataset
from modalbase.formats.uff.units import read_164

DEFAULT_LIMITS = Limits()
_POINT_ROWS: dict[str, Callable[[bytes], list[PointRow]]] = {"15": rows_15, "2411": rows_2411}
_SWALLOWED = re.compile(rb"\n    -1[^\n]*-1[ \t]*\r?\n {0,5}[0-9]{1,6}[bB \t\r\n]")
_SHORT_LINES = 8


def read_file(
    path: Path | str, limits: Limits = DEFAULT_LIMITS
) -> Iterator[Content | DatasetReport]:
    """Content of a UFF file, dataset by dataset: all contents of one, then its `DatasetReport`.

    The framing of the whole file is checked before this returns; a dataset is parsed when it is
    asked for, so memory is bounded by the largest dataset. A dataset that is refused or ignored
    yields its report alone.

    Raises:
        UffError: the framing of the file is broken. It is raised by the call itself, before
            anything is yielded.
    """
    return _UffReading(Path(path), scan(Path(path), limits), limits).stream()


class _UffReading:
    """One pass through a file whose framing is sound."""

    def __init__(self, path: Path, frames: list[Frame], limits: Limits) -> None:
        self._path = path
        self._frames = frames
        self._limits = limits
        self._units: dict[int, Units | Refusal] = {}
        self._geometry = Geometry()
        self._points: dict[int, GridPoint] = {}
        self._hits = Hits()
        self._names: dict[tuple[int, ...], tuple[int, tuple[str, str]]] = {}

    def stream(self) -> Iterator[Content | DatasetReport]:
        """Contents and reports, in the order of the file."""
        self._gather()
        for frame in self._frames:
            yield from self._dataset(frame)

    def _dataset(self, frame: Frame) -> Iterator[Content | DatasetReport]:
        """All contents of one dataset and its report."""
        framing = (frame.note,) if frame.note else ()
        body = b""
        try:
            body = self._body(frame)
            parsed = self._parse(frame, body)
        except Refusal as refusal:
            yield DatasetReport(
                frame.number,
                frame.type,
                frame.offset,
                "refused",
                _located(refusal, frame, body),
                framing,
            )
        except SkippedDataset as skipped:
            yield DatasetReport(
                frame.number, frame.type, frame.offset, "ignored", str(skipped), framing
            )
        else:
            yield from parsed.contents
            notes = (*framing, *parsed.notes)
            yield DatasetReport(frame.number, frame.type, frame.offset, "read", None, notes)

    def _body(self, frame: Frame) -> bytes:
        """The bytes of a dataset after its type line.

        Raises:
            Refusal: they are too many, mostly line ends, or hold another dataset whose delimiters
                are lost.
        """
        size = frame.end - frame.start
        if size > self._limits.dataset_bytes:
            raise Refusal(
                f"is {size} bytes long, more than the {self._limits.dataset_bytes} allowed"
            )
        with self._path.open("rb") as file:
            file.seek(frame.start)
            body = file.read(size)
        if len(body) != size:
            raise UffError("the file became shorter while it was read", frame.offset)
        if frame.type == "58b":
            return body
        if (lines := body.count(b"\n")) > 10_000 and lines * _SHORT_LINES > size:
            raise Refusal(f"is {lines} lines in {size} bytes: nearly all are blank")
        if swallowed := _SWALLOWED.search(body):
            raise Refusal(
                "holds what was the beginning of another dataset",
                body.count(b"\n", 0, swallowed.start() + 1),
            )
        return body

    def _gather(self) -> None:
        """Units, coordinate systems and displacement systems of the whole file."""
        for frame in self._of_types("164"):
            try:
                self._units[frame.number] = read_164(self._body(frame), frame.number)[0]
            except Refusal:
                self._units[frame.number] = Refusal(
                    f"its units (set 164, dataset {frame.number}) were refused"
                )
        for frame in self._of_types("18", "2420"):
            try:
                systems = self._systems(frame, self._body(frame)).contents
            except Refusal:
                self._geometry.systems_lost = True
            else:
                self._geometry.systems.update(
                    (s.label, s) for s in systems if isinstance(s, CoordinateSystem)
                )
        for frame in self._of_types(*_POINT_ROWS):
            try:
                rows = _POINT_ROWS[frame.type](self._body(frame))
            except Refusal:
                self._geometry.points_lost = True
            else:
                self._geometry.displacement.update(
                    (r.label, r.displacement_system) for r in rows if r.displacement_system
                )

    def _of_types(self, *types: str) -> list[Frame]:
        """The frames of some dataset types."""
        return [frame for frame in self._frames if frame.type in types]

    def _units_for(self, frame: Frame) -> Units | None:
        """The units that hold for a dataset: those stated last before it, else the first after it,
        else None for SI.
        """
        if not self._units:
            return None
        before = [number for number in self._units if number < frame.number]
        units = self._units[before[-1] if before else min(self._units)]
        if isinstance(units, Refusal):
            raise units
        return units

    def _systems(self, frame: Frame, body: bytes) -> Parsed:
        """Coordinate systems of a set 18 or 2420."""
        units = self._units_for(frame)
        if frame.type == "18":
            return read_18(body, frame.number, units, self._geometry.systems)
        return read_2420(body, frame.number, units)

    def _parse(self, frame: Frame, body: bytes) -> Parsed:
        """A dataset by its type.

        Raises:
            Refusal: it is damaged or ambiguous.
            Ignored: it is sound, but of no use here.
        """
        kind = frame.type
        if kind in ("58", "58b"):
            return self._function(frame, body)
        if kind in _POINT_ROWS:
            parsed = grid_points(
                _POINT_ROWS[kind](body), self._units_for(frame), self._geometry, self._points
            )
            if not self._units:
                parsed.notes.append("the file has no set 164: coordinates taken as metres")
            return parsed
        if kind in ("18", "2420"):
            return self._systems(frame, body)
        if kind == "164":
            units, notes = read_164(body, frame.number)
            return Parsed([units], notes)
        if kind == "2412":
            return read_2412(body)
        readers = {"55": read_55, "2414": read_2414, "82": read_82, "151": read_151}
        if kind not in readers:
            raise SkippedDataset(f"set {kind} is not among those that are read")
        return readers[kind](body, frame.number)

    def _function(self, frame: Frame, body: bytes) -> Parsed:
        """Set 58 or 58b: an FRF, a time block or a power spectrum in SI, or another function as it
        is.
        """
        raw, notes_on_names = placed(read_58(frame, body))
        content: Content
        if raw.function_type == FRF_TYPE:
            content, notes = frf_of(
                raw, frame.number, self._units_for(frame), self._geometry, self._limits
            )
            notes += unplaced(raw)
            other, names = self._names.setdefault(raw.dofs, (frame.number, raw.names))
            if names != raw.names:
                notes.append(
                    f"dataset {other} has the same points and directions under the names"
                    f" {', '.join(names)}, here they are {', '.join(raw.names)}: do two components"
                    " number their points alike? Number them apart"
                )
        else:
            content, notes = self._channels(raw, frame) or (function_of(raw, frame.number), [])
        return Parsed([content], [*raw.notes, *notes_on_names, *notes])

    def _channels(self, raw: RawFunction, frame: Frame) -> tuple[Content, list[str]] | None:
        """A time block or a power spectrum of force or motion; None where it is another
        function.
        """
        if raw.function_type == TIME_RESPONSE:
            block = time_of(raw, frame.number, self._units_for(frame), self._geometry)
            if block is not None:
                self._hits.take(block[0], raw.axis)
            return block
        if raw.function_type in (AUTO_SPECTRUM, CROSS_SPECTRUM):
            return spectrum_of(raw, frame.number, self._units_for(frame), self._geometry)
        return None


def _located(refusal: Refusal, frame: Frame, body: bytes) -> str:
    """The reason with its line and byte, where one line is at fault."""
    if refusal.line is None:
        return refusal.reason
    position = 0
    for _ in range(refusal.line):
        position = body.find(b"\n", position) + 1
    return f"line {refusal.line + 1} (byte {frame.start + position}): {refusal.reason}"
