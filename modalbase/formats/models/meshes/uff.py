"""Sets 15 or 2411, 2412 and 2467 of a Universal File: grid points in the global system, elements by
property table, groups.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from modalbase.formats.cell_types import CELL_TYPES, shells
from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import MeshFile
from modalbase.formats.models.meshes.cells import SOLID, CellKind, Gathering, plain
from modalbase.formats.models.meshes.groups import GROUPS, RawGroup, read_groups
from modalbase.formats.uff import DatasetReport, Element, GridPoint, UffError, Units, read_file
from modalbase.formats.uff.geometry import BEAMS
from modalbase.formats.uff.text import Refusal

_FAMILIES = (4, 6, 7, 9)  # plane stress, plates, membranes, thin shells
_KINDS = {
    10 * family + one.uff % 10: CellKind(one.name, one.nodes)
    for one in shells()
    for family in _FAMILIES
}
_SOLIDS = range(101, 120)
_DELIMITER = re.compile(rb"^ {4}-1[ \t]*\r?$", re.MULTILINE)
_NEEDED = ("15", "18", "164", "2411", "2412", "2420")
"""Datasets that a mesh is of; another may be damaged."""


def read_uff_mesh(content: bytes) -> MeshFile:
    """Elements of set 2412 by the number of their property table: `set_3`, of beams `line_3`; and
    groups, by name.

    Raises:
        FormatError: the file is none, cut or damaged, or has an element that is not read; says the
            dataset, or the line.
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
    groups: list[tuple[RawGroup, str]] = []
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
                raise FormatError(
                    f"dataset {each.number} (set {each.type}, byte {each.offset})",
                    each.reason or "",
                )
            if each.type in GROUPS:
                groups += _groups(each, content)
            begins = content.count(b"\n", 0, each.offset) + 2
            elements += [(element, begins + element.line) for element in here]
            here = []
    gathered = Gathering()
    for point in points.values():
        gathered.node(point.number, [x / (length_m or 1) for x in point.xyz_m], "")
    for element, line in elements:
        _take(gathered, element, line)
    for group, where in groups:
        gathered.group(
            plain(group.name) or f"group_{group.number}", group.elements, group.nodes, where
        )
    return gathered.mesh(length_m)


def _groups(report: DatasetReport, content: bytes) -> Iterator[tuple[RawGroup, str]]:
    """Groups of a dataset that the reader of campaigns has no use for, and where they stand."""
    dataset = f"dataset {report.number} (set {report.type})"
    start = content.index(b"\n", content.index(b"\n", report.offset) + 1) + 1
    end = _DELIMITER.search(content, start)
    body = content[start : end.start() if end else len(content)]
    try:
        for group in read_groups(report.type, body):
            yield group, f"{dataset} line {group.line}"
    except Refusal as error:
        raise FormatError(f"{dataset} line {(error.line or 0) + 1}", error.reason) from None


def _take(gathered: Gathering, element: Element, line: int) -> None:
    count = len(element.points)
    if element.descriptor in _SOLIDS:
        kind: CellKind | None = CellKind(SOLID, count)
    elif element.descriptor in BEAMS:
        kind = CellKind("beam3", 3) if count == 3 else CellKind("beam2", 2)
    else:
        kind = _KINDS.get(element.descriptor)
    if kind is None:
        raise FormatError(
            f"line {line}",
            f"element {element.number} has the descriptor {element.descriptor}; shells of 3, 4, 6"
            " or 8 nodes are read",
        )
    if count != kind.nodes:
        raise FormatError(
            f"line {line}",
            f"element {element.number} has {count} nodes; descriptor {element.descriptor} expects"
            f" {kind.nodes}",
        )
    order = list(range(count)) if kind.name == SOLID else CELL_TYPES[kind.name].around
    nodes = [0] * count
    for place, own in enumerate(order):
        nodes[own] = element.points[place]
    prefix = {SOLID: "solid", "beam2": "line", "beam3": "line"}.get(kind.name, "set")
    gathered.element(kind.name, f"{prefix}_{element.properties}", element.number, nodes, line)
