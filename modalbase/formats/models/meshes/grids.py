"""VTK's unstructured grids as arrays, to elements by set (Kitware, The VTK User's Guide, 11th ed., 19)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import MeshFile
from modalbase.formats.models.meshes.cells import LARGEST, SOLID, Gathering, Kind, plain, whole_numbers
from modalbase.formats.models.model import Floats, Integers

_KINDS = {
    1: Kind("point", 1), 3: Kind("beam2", 2), 5: Kind("tri3", 3), 9: Kind("quad4", 4), 21: Kind("beam3", 3),
    22: Kind("tri6", 6), 23: Kind("quad8", 8), 28: Kind("quad8", 9), 34: Kind("tri6", 7),
    10: Kind(SOLID, 4), 11: Kind(SOLID, 8), 12: Kind(SOLID, 8), 13: Kind(SOLID, 6), 14: Kind(SOLID, 5), 24: Kind(SOLID, 10),
    25: Kind(SOLID, 20), 26: Kind(SOLID, 15), 27: Kind(SOLID, 13), 29: Kind(SOLID, 27), 32: Kind(SOLID, 18),
}  # fmt: skip
_PIXEL, _POLYGON = 8, 7
SETS = ("set", "gmsh:physical", "CellEntityIds", "PartId", "MaterialIds")
"""Arrays of cell data by which writers name what belongs together; the first that is there is taken."""


@dataclass
class Grid:
    """What a file says.

    Attributes:
        points: (n, 3).
        connectivity: points of all cells, from 0.
        ends: (c,) where each cell's points end in it.
        types: (c,) of cells.
        data: arrays of cells by name.
        names: of sets by their number, where the file has them.
    """

    points: Floats | None = None
    connectivity: Integers | None = None
    ends: Integers | None = None
    types: Integers | None = None
    data: dict[str, Floats] = field(default_factory=dict)
    names: Mapping[int, str] = field(default_factory=dict)


def mesh_of(grid: Grid) -> MeshFile:
    """Elements by the cell array that says the set; one set where none does. Points and cells are numbered from 1.

    Raises:
        FormatError: an array is missing or does not fit the others; names it and the cell.
    """
    points, connectivity, ends, types = grid.points, grid.connectivity, grid.ends, grid.types
    if points is None or connectivity is None or ends is None or types is None:
        raise FormatError("", "lacks points, or the connectivity, offsets or types of cells")
    if not np.all(np.abs(points) < LARGEST):
        raise FormatError("points", f"hold what is no number below {LARGEST:g}")
    if connectivity.size and not (connectivity.min() >= 0 and connectivity.max() < len(points)):
        raise FormatError("connectivity", f"names points that are not among the {len(points)} from 0")
    starts = np.concatenate([[0], ends])[:-1].astype(np.int64)
    if len(ends) != len(types) or np.any(ends < starts) or (ends[-1] if ends.size else 0) != connectivity.size:
        raise FormatError("offsets", f"do not part {connectivity.size} points into {len(types)} cells")
    found = Gathering()
    for number, place in enumerate(points.tolist(), start=1):
        found.node(number, place, f"point {number}")
    names = _sets(grid, len(types))
    cells = zip(types.tolist(), starts.tolist(), ends.tolist(), names, strict=True)
    for number, (kind, start, end, name) in enumerate(cells, start=1):
        rows = connectivity[start:end].tolist()
        known = _kind(number, kind, len(rows))
        rows = [rows[k] for k in (0, 1, 3, 2)] if kind == _PIXEL else rows[: known.taken]
        found.element(known.name, name, number, [row + 1 for row in rows], 0)
    return found.mesh()


def _kind(number: int, kind: int, count: int) -> Kind:
    if (kind == _POLYGON and count in (3, 4)) or (kind == _PIXEL and count == 4):
        return Kind("tri3" if count == 3 else "quad4", count)
    known = _KINDS.get(kind)
    if known is None:
        raise FormatError(
            f"cell {number}", f"is of type {kind} with {count} points; shells of 3, 4, 6, 8 or 9 are read"
        )
    if known.nodes != count:
        raise FormatError(f"cell {number}", f"of type {kind} has {count} points, expected {known.nodes}")
    return known


def _sets(grid: Grid, count: int) -> list[str]:
    """The set of each cell."""
    array = next((name for name in SETS if name in grid.data), None)
    if array is None:
        whole = [name for name, values in grid.data.items() if _parts(values)]
        if len(whole) > 1:
            raise FormatError(
                "cell data", f"{', '.join(whole)} part the cells: call the array that says the set of each {SETS[0]!r}"
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
        values.ndim == 1 and bool(np.all(values == np.round(values))) and len(np.unique(values)) < max(len(values), 2)
    )
