"""VTK's unstructured grids to elements by set (Kitware, The VTK User's Guide, 11th ed., 19); its
legacy files.

These are read in the versions 1 to 5, text or binary (Kitware, VTK File Formats).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from modalbase.formats.cell_types import CELL_TYPES, SOLIDS
from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import MeshFile
from modalbase.formats.models.meshes.cells import (
    SOLID,
    CellKind,
    Gathering,
    plain,
    whole_numbers,
)
from modalbase.formats.models.model import LARGEST, Floats, Integers

_KINDS = {
    **{at: CellKind(one.name, n) for one in CELL_TYPES.values() for at, n in one.vtk.items()},
    **{at: CellKind(SOLID, one.nodes) for one in SOLIDS for at in one.vtk},
}
_PIXEL, _POLYGON = 8, 7
SETS = ("set", "gmsh:physical", "CellEntityIds", "PartId", "MaterialIds")
"""Arrays of cell data by which writers name what belongs together; the first that is there is
taken.
"""


@dataclass
class Grid:
    """What a file says."""

    points: Floats | None = None  # (n, 3)
    connectivity: Integers | None = None  # points of all cells, from 0
    ends: Integers | None = None  # (c,) where each cell's points end in it
    types: Integers | None = None  # (c,) of cells
    data: dict[str, Floats] = field(default_factory=dict)  # arrays of cells by name
    # of sets by their number, where the file has them
    names: Mapping[int, str] = field(default_factory=dict)


def mesh_of(grid: Grid) -> MeshFile:
    """Elements by the cell array that says the set; one set where none does. Points and cells are
    numbered from 1.

    Raises:
        FormatError: an array is missing or does not fit the others; names it and the cell.
    """
    points, connectivity, ends, types = grid.points, grid.connectivity, grid.ends, grid.types
    if points is None or connectivity is None or ends is None or types is None:
        raise FormatError("", "lacks points, or the connectivity, offsets or types of cells")
    if not np.all(np.abs(points) < LARGEST):
        raise FormatError("points", f"hold what is no number below {LARGEST:g}")
    if connectivity.size and not (connectivity.min() >= 0 and connectivity.max() < len(points)):
        raise FormatError(
            "connectivity", f"names points that are not among the {len(points)} from 0"
        )
    starts = np.concatenate([[0], ends])[:-1].astype(np.int64)
    if (
        len(ends) != len(types)
        or np.any(ends < starts)
        or (ends[-1] if ends.size else 0) != connectivity.size
    ):
        raise FormatError(
            "offsets", f"do not part {connectivity.size} points into {len(types)} cells"
        )
    gathered = Gathering()
    for number, place in enumerate(points.tolist(), start=1):
        gathered.node(number, place, f"point {number}")
    names = _sets(grid, len(types))
    cells = zip(types.tolist(), starts.tolist(), ends.tolist(), names, strict=True)
    for number, (kind, start, end, name) in enumerate(cells, start=1):
        rows = connectivity[start:end].tolist()
        known = _kind(number, kind, len(rows))
        rows = [rows[k] for k in (0, 1, 3, 2)] if kind == _PIXEL else rows[: known.taken]
        gathered.element(known.name, name, number, [row + 1 for row in rows], 0)
    return gathered.mesh()


def _kind(number: int, kind: int, count: int) -> CellKind:
    if (kind == _POLYGON and count in (3, 4)) or (kind == _PIXEL and count == 4):
        return CellKind("tri3" if count == 3 else "quad4", count)
    known = _KINDS.get(kind)
    if known is None:
        raise FormatError(
            f"cell {number}",
            f"is of type {kind} with {count} points; shells of 3, 4, 6, 8 or 9 are read",
        )
    if known.nodes != count:
        raise FormatError(
            f"cell {number}", f"of type {kind} has {count} points, expected {known.nodes}"
        )
    return known


def _sets(grid: Grid, count: int) -> list[str]:
    """The set of each cell."""
    array = next((name for name in SETS if name in grid.data), None)
    if array is None:
        whole = [name for name, values in grid.data.items() if _parts(values)]
        if len(whole) > 1:
            raise FormatError(
                "cell data",
                f"{', '.join(whole)} part the cells: call the array that says the set of each"
                f" {SETS[0]!r}",
            )
        array = whole[0] if whole else None
    if array is None:
        return ["mesh"] * count
    values = grid.data[array]
    if values.shape != (count,) or (numbers := whole_numbers(values)) is None:
        raise FormatError(f"cell data {array}", f"is no whole number for each of {count} cells")
    return [plain(grid.names.get(number, "")) or f"set_{number}" for number in numbers.tolist()]


def _parts(values: Floats) -> bool:
    """Whether an array of cells is whole numbers of which several are alike."""
    return (
        values.ndim == 1
        and bool(np.all(values == np.round(values)))
        and len(np.unique(values)) < max(len(values), 2)
    )


_TYPES = {
    "char": "i1", "unsigned_char": "u1", "short": ">i2", "unsigned_short": ">u2", "int": ">i4", "unsigned_int": ">u4",
    "long": ">i8", "unsigned_long": ">u8", "float": ">f4", "double": ">f8", "vtkidtype": ">i8", "vtktypeint64": ">i8",
    "vtktypeint32": ">i4", "vtktypeuint64": ">u8",
}  # fmt: skip


def read_vtk(content: bytes) -> MeshFile:
    """Cells of an unstructured grid by set.

    Raises:
        FormatError: it is another file or data set, cut or damaged; says the line, or the byte of
            binary data.
    """
    return mesh_of(_VtkReading(content).grid())


class _VtkReading:
    """One pass through a file."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at, self._count = content, 0, 0
        self._grid = Grid()
        self._on_cells, self._rows, self._binary = False, 0, False

    def grid(self) -> Grid:
        if not self._line().startswith("# vtk DataFile Version"):
            raise self._fault("is not '# vtk DataFile Version', with which such a file begins")
        self._line(blank=True)
        if (form := self._line().upper()) not in ("ASCII", "BINARY"):
            raise self._fault(f"is {form[:40]!r}, expected ASCII or BINARY")
        self._binary = form == "BINARY"
        if (kind := self._line().upper().split()) != ["DATASET", "UNSTRUCTURED_GRID"]:
            raise self._fault(f"is {' '.join(kind)[:40]!r}; save it as DATASET UNSTRUCTURED_GRID")
        while fields := self._line(last=True).split():
            self._section(fields[0], *[*fields[1:], "", "", ""][:3])
        return self._grid

    def _section(self, word: str, first: str, second: str, third: str) -> None:
        """What a word begins, by the three that stand behind it."""
        match kind := word.upper():
            case "POINTS":
                self._grid.points = self._values(3 * self._whole(first), second, "points").reshape(
                    -1, 3
                )
            case "CELLS":
                self._cells(self._whole(first), self._whole(second))
            case "CELL_TYPES":
                self._grid.types = self._indices(self._whole(first), "int", "types of cells")
            case "CELL_DATA" | "POINT_DATA":
                self._on_cells, self._rows = kind == "CELL_DATA", self._whole(first)
            case "SCALARS":
                self._expect("LOOKUP_TABLE")
                self._keep(first, self._rows, self._whole(third or "1"), second)
            case "VECTORS" | "NORMALS" | "TENSORS" | "GLOBAL_IDS" | "PEDIGREE_IDS":
                self._keep(
                    first,
                    self._rows,
                    {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9}.get(kind, 1),
                    second,
                )
            case "FIELD":
                self._fields(self._whole(second))
            case "METADATA":
                self._pass_metadata()
            case "LOOKUP_TABLE":
                self._values(
                    4 * self._whole(second),
                    "unsigned_char" if self._binary else "float",
                    "a table of colours",
                )
            case _:
                raise self._fault(f"is {word[:40]!r}, which begins no section that is read")

    def _expect(self, word: str) -> list[str]:
        """The next line's words, of which the first is this one."""
        words = self._line().split()
        if words[0].upper() != word:
            raise self._fault(f"is {words[0][:40]!r}, expected {word}")
        return [*words, ""]

    def _cells(self, first: int, second: int) -> None:
        here, mark = (self._at, self._count), self._line().split()
        if mark[0].upper() == "OFFSETS":
            self._grid.ends = self._indices(first, (*mark, "")[1], "offsets")[1:]
            self._grid.connectivity = self._indices(
                second, self._expect("CONNECTIVITY")[1], "connectivity"
            )
            return
        self._at, self._count = here
        self._grid.connectivity, self._grid.ends = self._counted(
            first, self._indices(second, "int", "cells")
        )

    def _counted(self, count: int, flat: Integers) -> tuple[Integers, Integers]:
        """Connectivity and ends of cells that each begin with a count."""
        at, heads = 0, []
        for _ in range(count):
            if at >= len(flat) or flat[at] < 0:
                raise self._fault(f"{count} cells do not fill {len(flat)} numbers")
            heads.append(at)
            at += 1 + int(flat[at])
        if at != len(flat):
            raise self._fault(f"{count} cells do not fill {len(flat)} numbers")
        return np.delete(flat, heads), np.cumsum(flat[heads], dtype=np.int64)

    def _fields(self, count: int) -> None:
        for _ in range(count):
            name, *rest = self._line().split()
            if name.upper() == "METADATA":
                self._pass_metadata()
                name, *rest = self._line().split()
            width, rows, kind = [*rest, "", "", ""][:3]
            self._keep(name, self._whole(rows), self._whole(width), kind)

    def _keep(self, name: str, rows: int, width: int, kind: str) -> None:
        if width < 1:
            raise self._fault(f"the array {name} has no component")
        values = self._values(rows * width, kind, f"the array {name}")
        if self._on_cells:
            self._grid.data[name] = values if width == 1 else values.reshape(-1, width)

    def _pass_metadata(self) -> None:
        while self._line(blank=True):
            pass

    def _line(self, *, blank: bool = False, last: bool = False) -> str:
        """The next line, which is not blank unless it may be; at the end of the file empty, where
        it may be the last.
        """
        while self._at < len(self._content):
            end = self._content.find(b"\n", self._at)
            end = len(self._content) if end < 0 else end
            text = self._content[self._at : end].decode("latin-1").strip()
            self._at, self._count = end + 1, self._count + 1
            if text or blank:
                return text
        if last or blank:
            return ""
        raise self._fault("the file ends; it seems to be cut")

    def _fault(self, message: str) -> FormatError:
        return FormatError(f"byte {self._at}" if self._binary else f"line {self._count}", message)

    def _whole(self, text: str) -> int:
        if not (text.isascii() and text.isdigit() and len(text) < 12):
            raise self._fault(f"{text[:40]!r} is no count")
        return int(text)

    def _indices(self, count: int, kind: str, what: str) -> Integers:
        if (numbers := whole_numbers(self._values(count, kind, what))) is None:
            raise self._fault(f"{what} hold what is no whole number")
        return numbers

    def _values(self, count: int, kind: str, what: str) -> Floats:
        """So many numbers of a type."""
        item = _TYPES.get(kind.lower())
        if item is None:
            raise self._fault(
                f"{what} are of the type {kind[:40]!r}, expected one of {', '.join(_TYPES)}"
            )
        if not self._binary:
            return self._typed(count, what)
        size = count * np.dtype(item).itemsize
        if self._at + size > len(self._content):
            raise self._fault(
                f"{what} take {size} bytes, which the file has not; it seems to be cut"
            )
        numbers = np.frombuffer(self._content, item, count, self._at).astype(float)
        self._at += size
        return numbers

    def _typed(self, count: int, what: str) -> Floats:
        numbers: list[float] = []
        while len(numbers) < count:
            for text in self._line().split():
                try:
                    numbers.append(float(text))
                except ValueError:
                    raise self._fault(f"{what}: {text[:40]!r} is no number") from None
        if len(numbers) > count:
            raise self._fault(f"has more than the {count} numbers of {what}")
        return np.array(numbers)
