"""gmsh's `.msh`, text of the versions 2.2 and 4.1 (Geuzaine and Remacle, gmsh's reference manual, File formats).

Physical groups are sets. Lines and points in none of them are left out: they are of the geometry.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from modalbase.formats.meshes import MeshFile
from modalbase.formats.models.meshes.cells import SOLID, Gathering, Kind, Lines, name_of

_KINDS = {
    1: Kind("beam2", 2), 2: Kind("tri3", 3), 3: Kind("quad4", 4), 8: Kind("beam3", 3), 9: Kind("tri6", 6),
    10: Kind("quad8", 9), 15: Kind("point", 1), 16: Kind("quad8", 8),
    4: Kind(SOLID, 4), 5: Kind(SOLID, 8), 6: Kind(SOLID, 6), 7: Kind(SOLID, 5), 11: Kind(SOLID, 10), 12: Kind(SOLID, 27),
    13: Kind(SOLID, 18), 14: Kind(SOLID, 14), 17: Kind(SOLID, 20), 18: Kind(SOLID, 15), 19: Kind(SOLID, 13),
}  # fmt: skip
_DIMENSIONS = {"point": 0, "beam2": 1, "beam3": 1, SOLID: 3}
_Groups = Mapping[tuple[int, int], list[int]]


def read_gmsh(content: bytes) -> MeshFile:
    """Nodes, and elements by physical group.

    Raises:
        FormatError: it is binary or of another version, cut or damaged, or has elements of higher order; says the line.
    """
    lines, found = Lines(content), Gathering()
    names: dict[tuple[int, int], str] = {}
    groups: dict[tuple[int, int], list[int]] = {}
    if lines.text("$MeshFormat") != "$MeshFormat":
        raise lines.fault("is not $MeshFormat, with which a file of gmsh begins")
    version = _version(lines)
    while (section := lines.more()) is not None:
        if not section.startswith("$"):
            raise lines.fault(f"is {section[:40]!r}, expected the beginning of a section such as $Nodes")
        if section == "$PhysicalNames":
            names |= _names(lines)
        elif section == "$Entities":
            groups |= _entities(lines)
        elif section == "$Nodes":
            for number, place in (_nodes if version == "4.1" else _nodes_2)(lines):
                found.node(number, place, lines.where)
        elif section == "$Elements":
            (_elements if version == "4.1" else _elements_2)(lines, found, names, groups)
        else:
            _pass(lines, section)
            continue
        _end(lines, section)
    return found.mesh()


def _version(lines: Lines) -> str:
    version, binary, *_ = (*lines.text("the version").split(), "", "")
    if binary != "0":
        raise lines.fault("says that the file is binary; save it as text (Mesh.Binary = 0)")
    if version not in ("2", "2.1", "2.2", "4.1"):
        raise lines.fault(f"says version {version[:20]}; save it as 4.1 or 2.2 (Mesh.MshFileVersion)")
    _end(lines, "$MeshFormat")
    return version


def _end(lines: Lines, section: str) -> None:
    if (found := lines.text(f"$End{section[1:]}")) != f"$End{section[1:]}":
        raise lines.fault(f"is {found[:40]!r}, expected $End{section[1:]}; a count before it is wrong")


def _pass(lines: Lines, section: str) -> None:
    """Leave out a section that says nothing of the mesh."""
    if section in ("$Periodic", "$PartitionedEntities"):
        raise lines.fault(f"{section} is not read: its nodes would lack what joins them")
    while lines.text(f"$End{section[1:]}") != f"$End{section[1:]}":
        pass


def _names(lines: Lines) -> Iterator[tuple[tuple[int, int], str]]:
    for _ in range(lines.wholes("the number of names", 1)[0]):
        dimension, tag, name = (*lines.text("a name").split(maxsplit=2), "", "", "")[:3]
        key = lines.whole(dimension, "a dimension"), lines.whole(tag, "a tag of a name")
        yield key, name


def _entities(lines: Lines) -> Iterator[tuple[tuple[int, int], list[int]]]:
    """Physical groups of each entity by dimension and tag."""
    counts = lines.wholes("the numbers of points, curves, surfaces and volumes", 4)
    for dimension, count in enumerate(counts[:4]):
        for _ in range(count):
            fields = lines.text("an entity").split()
            at = 4 if dimension == 0 else 7
            number = lines.whole(fields[at] if at < len(fields) else "", "the number of an entity's groups")
            groups = fields[at + 1 : at + 1 + number]
            if len(groups) != number:
                raise lines.fault(f"has {len(groups)} groups and says {number}")
            yield (
                (dimension, lines.whole(fields[0], "an entity")),
                [abs(lines.whole(each, "a group")) for each in groups],
            )


def _place(lines: Lines, fields: list[str]) -> list[float]:
    if len(fields) < 3:
        raise lines.fault(f"has {len(fields)} coordinates, expected 3")
    return [lines.real(field, "a coordinate") for field in fields[:3]]


def _nodes_2(lines: Lines) -> Iterator[tuple[int, list[float]]]:
    for _ in range(lines.wholes("the number of nodes", 1)[0]):
        number, *place = lines.text("a node").split()
        yield lines.whole(number, "a node"), _place(lines, place)


def _nodes(lines: Lines) -> Iterator[tuple[int, list[float]]]:
    for _ in range(lines.wholes("the number of blocks of nodes", 1)[0]):
        count = lines.wholes("dimension, tag, parametric and number of a block of nodes", 4)[3]
        numbers = [lines.wholes("a node's number", 1)[0] for _ in range(count)]
        for number in numbers:
            yield number, _place(lines, lines.text("a node's coordinates").split())


def _kind(lines: Lines, number: int) -> Kind:
    if number not in _KINDS:
        raise lines.fault(f"is of the element type {number}; shells of 3, 4, 6, 8 or 9 nodes are read")
    return _KINDS[number]


def _take(
    lines: Lines, found: Gathering, kind: Kind, names: Mapping[tuple[int, int], str], *,
    tags: list[int], number: int, nodes: list[int],
) -> None:  # fmt: skip
    """Put an element into the set of its group."""
    if len(nodes) != kind.nodes:
        raise lines.fault(f"element {number} has {len(nodes)} nodes, expected {kind.nodes}")
    dimension = _DIMENSIONS.get(kind.name, 2)
    if dimension < 2 and not tags:
        return
    if dimension == 2 and len(tags) > 1:
        both = " and ".join(name_of(tag, dimension, names) for tag in tags)
        raise lines.fault(
            f"element {number} is in the groups {both}; a shell has one section, so one group is expected"
        )
    for tag in tags or [0]:
        found.element(kind.name, name_of(tag, dimension, names), number, nodes[: kind.taken], lines.line)


def _elements_2(lines: Lines, found: Gathering, names: Mapping[tuple[int, int], str], groups: _Groups) -> None:
    del groups  # each element states its own
    for _ in range(lines.wholes("the number of elements", 1)[0]):
        number, kind, count, *rest = lines.wholes("an element: number, type, number of tags, tags, nodes", 3)
        tags = [tag for tag in rest[: min(count, 1)] if tag]
        _take(lines, found, _kind(lines, kind), names, tags=tags, number=number, nodes=rest[count:])


def _elements(lines: Lines, found: Gathering, names: Mapping[tuple[int, int], str], groups: _Groups) -> None:
    for _ in range(lines.wholes("the number of blocks of elements", 1)[0]):
        dimension, entity, kind, count, *_ = lines.wholes("dimension, tag, type and number of a block of elements", 4)
        known, tags = _kind(lines, kind), groups.get((dimension, entity), [])
        for _ in range(count):
            number, *nodes = lines.wholes("an element: number, nodes", 2)
            _take(lines, found, known, names, tags=tags, number=number, nodes=nodes)
