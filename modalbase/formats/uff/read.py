"""A UFF file as a stream of contents and reports.

The framing of the whole file is checked first (`scan`). Units, coordinate systems and the points
that are not measured along global axes are gathered next, for they may stand anywhere in the file.
Then each dataset is read by our own columns and counts, held against pyuff's reading of the same
set (the first megabytes of each type), and yielded.

pyuff is the second reader: a dataset alone, from a temporary file of just that set. Our own reading
accounts for every column, count and byte, so damage is found without pyuff. What a second reader
adds is the guard against a dialect that both the file and our reader state consistently and that
others understand otherwise. A file comes from one program, so its first datasets of each type show
that, and the rest need not be read twice.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyuff

from modalbase.formats.uff.channels import (
    AUTO_SPECTRUM,
    CROSS_SPECTRUM,
    TIME_RESPONSE,
    spectrum_of,
    time_of,
)
from modalbase.formats.uff.content import (
    Content,
    CoordinateSystem,
    DatasetReport,
    GridPoint,
    Limits,
    UffError,
    Units,
)
from modalbase.formats.uff.frf import FRF_TYPE, frf_of, function_of
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

_TAG = b"    -1\n"
_UNREADABLE = "pyuff cannot read this dataset; it was read by its columns alone"


class SecondReader:
    """Reads one dataset at a time with pyuff and holds it against what was read from it already.

    Args:
        folder: a folder for the temporary file.
        budget: bytes to read of each dataset type.
    """

    def __init__(self, folder: Path, budget: int) -> None:
        self._file = folder / "dataset.uff"
        self._budget = budget
        self._spent: dict[str, int] = {}

    def has_time_for(self, frame: Frame) -> bool:
        """Whether a dataset is within the budget of its type, which it then uses up."""
        spent = self._spent.get(frame.type, 0) + frame.end - frame.start
        if spent > self._budget:
            return False
        self._spent[frame.type] = spent
        return True

    def compare(self, frame: Frame, body: bytes, claims: dict[str, object]) -> str:
        """A note where pyuff cannot read the dataset, else "".

        Raises:
            Refusal: pyuff reads it, but differently.
        """
        if frame.type == "58b" and b"    -1" in body:
            return (
                "its data hold the bytes of a delimiter, which pyuff cannot read past; read by its"
                " byte count alone"
            )
        # truncating to nothing first would wait for the disk
        mode = "r+b" if self._file.exists() else "w+b"
        with self._file.open(mode) as file:
            file.write(_TAG + frame.type_line + body + _TAG)
            file.truncate()
        try:
            reading = pyuff.UFF(str(self._file)).read_sets()
        except Exception:  # noqa: BLE001 - pyuff raises bare Exception for whatever went wrong
            return _UNREADABLE
        if not isinstance(reading, dict):
            return _UNREADABLE
        for key, expected in claims.items():
            if key not in reading:
                raise Refusal(f"pyuff finds no '{key}' in it")
            if not _equal(reading[key], expected):
                raise Refusal(f"pyuff reads another '{key}' from it than its columns hold")
        return ""


def _equal(reading: object, expected: object) -> bool:
    """Whether two readings are the same; text is compared where it is plain, for pyuff decodes it
    otherwise.
    """
    if isinstance(expected, str):
        return not expected.isascii() or str(reading).strip() == expected
    ours, theirs = np.asarray(expected), np.asarray(reading)
    return ours.shape == theirs.shape and bool(np.array_equal(theirs.astype(ours.dtype), ours))


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

    def stream(self) -> Iterator[Content | DatasetReport]:
        """Contents and reports, in the order of the file."""
        self._gather()
        with TemporaryDirectory(prefix="modalbase-uff-") as folder:
            second = SecondReader(Path(folder), self._limits.cross_check_bytes)
            for frame in self._frames:
                yield from self._dataset(frame, second)

    def _dataset(self, frame: Frame, second: SecondReader) -> Iterator[Content | DatasetReport]:
        """All contents of one dataset and its report."""
        framing = (frame.note,) if frame.note else ()
        body = b""
        try:
            body = self._body(frame)
            parsed = self._parse(frame, body)
            if parsed.claims is not None and second.has_time_for(frame):
                parsed.notes += filter(None, [self._second_opinion(second, frame, body, parsed)])
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

    def _second_opinion(
        self, second: SecondReader, frame: Frame, body: bytes, parsed: Parsed
    ) -> str:
        """What pyuff has to say; where the set was read in a way that it does not know, it cannot
        object.
        """
        try:
            return second.compare(frame, body, parsed.claims or {})
        except Refusal:
            if parsed.free_form:
                return "pyuff misreads this dataset; it was read by its columns alone"
            raise

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
            factors: dict[str, object] = {
                "length": units.length,
                "force": units.force,
                "temp": units.temperature,
            }
            return Parsed([units], notes, factors)
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
        raw, notes_on_names = placed(stated := read_58(frame, body))
        content: Content
        if raw.function_type == FRF_TYPE:
            content, notes = frf_of(
                raw, frame.number, self._units_for(frame), self._geometry, self._limits
            )
            notes += unplaced(raw)
        else:
            content, notes = self._channels(raw, frame) or (function_of(raw, frame.number), [])
        claims = None if stated.has_gap else _claims(stated)
        return Parsed([content], [*raw.notes, *notes_on_names, *notes], claims, raw.free_form)

    def _channels(self, raw: RawFunction, frame: Frame) -> tuple[Content, list[str]] | None:
        """A time block or a power spectrum of force or motion; None where it is another
        function.
        """
        if raw.function_type == TIME_RESPONSE:
            return time_of(raw, frame.number, self._units_for(frame), self._geometry)
        if raw.function_type in (AUTO_SPECTRUM, CROSS_SPECTRUM):
            return spectrum_of(raw, frame.number, self._units_for(frame), self._geometry)
        return None


def _claims(raw: RawFunction) -> dict[str, object]:
    """What pyuff must find in a set 58, by its names."""
    plain = (raw.ordinate.name + raw.ordinate.unit).isascii()  # else pyuff's columns are shifted
    return {
        "func_type": raw.function_type,
        "ord_data_type": raw.ordinate_type,
        "num_pts": raw.axis.count,
        "rsp_node": raw.response_point,
        "rsp_dir": raw.response_direction,
        "ref_node": -1 if raw.unstated_reference else raw.reference_point,
        "ref_dir": raw.reference_direction,
        **({"ordinate_axis_units_lab": raw.ordinate.unit} if plain else {}),
        "x": raw.axis.points(),
        "data": raw.values,
    }


def _located(refusal: Refusal, frame: Frame, body: bytes) -> str:
    """The reason with its line and byte, where one line is at fault."""
    if refusal.line is None:
        return refusal.reason
    position = 0
    for _ in range(refusal.line):
        position = body.find(b"\n", position) + 1
    return f"line {refusal.line + 1} (byte {frame.start + position}): {refusal.reason}"
