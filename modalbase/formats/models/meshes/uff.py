"""Sets 15 or 2411 and 2412 of a Universal File: grid points in the global system, elements by their property table."""

from pathlib import Path
from tempfile import TemporaryDirectory

from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import MeshFile, around
from modalbase.formats.models.meshes.cells import SOLID, Gathering, Kind
from modalbase.formats.uff import DatasetReport, Element, GridPoint, UffError, Units, read_file

_SHELLS = {1: Kind("tri3", 3), 2: Kind("tri6", 6), 4: Kind("quad4", 4), 5: Kind("quad8", 8)}
_FAMILIES = (4, 6, 7, 9)  # plane stress, plates, membranes, thin shells
_BEAMS = {11: Kind("beam2", 2), 21: Kind("beam2", 2), 22: Kind("beam2", 2), 23: Kind("beam2", 2), 24: Kind("beam3", 3)}
_KINDS = _BEAMS | {10 * family + last: kind for family in _FAMILIES for last, kind in _SHELLS.items()}
_SOLIDS = range(101, 120)
_NEEDED = ("15", "18", "164", "2411", "2412", "2420")
"""Datasets that a mesh is of; another may be damaged."""


def read_uff_mesh(content: bytes) -> MeshFile:
    """Elements of set 2412 by the number of their property table: `set_3`, of beams `line_3`.

    Raises:
        FormatError: the file is none, cut or damaged, or has an element that is not read; says the dataset, or the line.
    """
    with TemporaryDirectory(prefix="modalbase-mesh-") as folder:
        path = Path(folder) / "mesh.uff"
        path.write_bytes(content)
        try:
            return _mesh(path, content)
        except UffError as error:
            raise FormatError(f"byte {error.offset}", error.reason) from None


def _mesh(path: Path, content: bytes) -> MeshFile:
    points: dict[int, GridPoint] = {}
    elements: list[tuple[Element, int]] = []
    length_m, here = None, []
    for each in read_file(path):
        if isinstance(each, GridPoint):
            points[each.number] = each
        elif isinstance(each, Element):
            here.append(each)
        elif isinstance(each, Units):
            length_m = 1 / each.length
        elif isinstance(each, DatasetReport):
            if each.outcome == "refused" and each.type in _NEEDED:
                raise FormatError(f"dataset {each.number} (set {each.type}, byte {each.offset})", each.reason or "")
            begins = content.count(b"\n", 0, each.offset) + 2
            elements += [(element, begins + element.line) for element in here]
            here = []
    found = Gathering()
    for point in points.values():
        found.node(point.number, [x / (length_m or 1) for x in point.xyz_m], "")
    for element, line in elements:
        _take(found, element, line)
    return found.mesh(length_m)


def _take(found: Gathering, element: Element, line: int) -> None:
    kind = Kind(SOLID, len(element.points)) if element.descriptor in _SOLIDS else _KINDS.get(element.descriptor)
    if kind is None:
        raise FormatError(
            f"line {line}",
            f"element {element.number} has the descriptor {element.descriptor}; shells of 3, 4, 6 or 8 nodes are read",
        )
    if len(element.points) != kind.nodes:
        raise FormatError(
            f"line {line}",
            f"element {element.number} has {len(element.points)} nodes; descriptor {element.descriptor} expects {kind.nodes}",
        )
    order = [0] * kind.nodes
    for place, own in enumerate(range(kind.nodes) if kind.name == SOLID else around(kind.name)):
        order[own] = element.points[place]
    prefix = {SOLID: "solid", "beam2": "line", "beam3": "line"}.get(kind.name, "set")
    found.element(kind.name, f"{prefix}_{element.properties}", element.number, order, line)
