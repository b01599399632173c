"""gmsh's `.msh`, text of the versions 2.2 and 4.1 (Geuzaine and Remacle, gmsh's reference manual,
File formats).

Physical groups are sets. Lines and points in none of them are left out: they are of the geometry.
"""

from collections.abc import Iterator

from modalbase.formats.cell_types import CELL_TYPES, SOLIDS
from modalbase.formats.meshes import MeshFile
from modalbase.formats.models.meshes.cells import SOLID, CellKind, Gathering, Lines, name_of, plain

_KINDS = {
    **{at: CellKind(one.name, n) for one in CELL_TYPES.values() for at, n in one.gmsh.items()},
    **{at: CellKind(SOLID, one.nodes) for one in SOLIDS for at in one.gmsh},
}


def read_gmsh(content: bytes) -> MeshFile:
    """Nodes, and elements by physical group.

    Raises:
        FormatError: it is binary or of another version, cut or damaged, or has elements of higher
            order; says the line.
    """
    return _GmshReading(Lines(content)).mesh()


class _GmshReading:
    """One pass through a file."""

    def __init__(self, lines: Lines) -> None:
        self._lines, self._gathered = lines, Gathering()
        self._names: dict[tuple[int, int], str] = {}
        self._groups: dict[tuple[int, int], list[int]] = {}
        """Names of physical groups, and groups of entities, by dimension and tag."""

    def mesh(self) -> MeshFile:
        lines = self._lines
        if lines.text("$MeshFormat") != "$MeshFormat":
            raise lines.fault("is not $MeshFormat, with which a file of gmsh begins")
        is_new = self._version() == "4.1"
        while (section := lines.more()) is not None:
            if not section.startswith("$"):
                raise lines.fault(
                    f"is {section[:40]!r}, expected the beginning of a section such as $Nodes"
                )
            if section == "$PhysicalNames":
                self._names |= self._read_names()
            elif section == "$Entities":
                self._groups |= self._entities()
            elif section == "$Nodes":
                for number, place in self._nodes() if is_new else self._nodes_2():
                    self._gathered.node(number, place, lines.where)
            elif section == "$Elements":
                self._elements() if is_new else self._elements_2()
            else:
                self._pass(section)
                continue
            self._end(section)
        return self._gathered.mesh()

    def _version(self) -> str:
        version, binary, *_ = (*self._lines.text("the version").split(), "", "")
        if binary != "0":
            raise self._lines.fault(
                "says that the file is binary; save it as text (Mesh.Binary = 0)"
            )
        if version not in ("2", "2.1", "2.2", "4.1"):
            raise self._lines.fault(
                f"says version {version[:20]}; save it as 4.1 or 2.2 (Mesh.MshFileVersion)"
            )
        self._end("$MeshFormat")
        return version

    def _end(self, section: str) -> None:
        if (line := self._lines.text(f"$End{section[1:]}")) != f"$End{section[1:]}":
            raise self._lines.fault(
                f"is {line[:40]!r}, expected $End{section[1:]}; a count before it is wrong"
            )

    def _pass(self, section: str) -> None:
        """Leave out a section that says nothing of the mesh."""
        if section in ("$Periodic", "$PartitionedEntities"):
            raise self._lines.fault(f"{section} is not read: its nodes would lack what joins them")
        while self._lines.text(f"$End{section[1:]}") != f"$End{section[1:]}":
            pass

    def _counted(self, what: str) -> range:
        return range(self._lines.wholes(f"the number of {what}", 1)[0])

    def _read_names(self) -> Iterator[tuple[tuple[int, int], str]]:
        before: dict[tuple[str, str], str] = {}
        for _ in self._counted("names"):
            dimension, tag, name = (*self._lines.text("a name").split(maxsplit=2), "", "", "")[:3]
            other = before.setdefault((dimension, plain(name)), name)
            if other != name:
                raise self._lines.fault(
                    f"{other} and {name} are one name, as capitals and signs do not count"
                )
            yield (
                (
                    self._lines.whole(dimension, "a dimension"),
                    self._lines.whole(tag, "a tag of a name"),
                ),
                name,
            )

    def _entities(self) -> Iterator[tuple[tuple[int, int], list[int]]]:
        lines, counts = (
            self._lines,
            self._lines.wholes("the numbers of points, curves, surfaces and volumes", 4),
        )
        for dimension, count in enumerate(counts[:4]):
            for _ in range(count):
                fields = lines.text("an entity").split()
                at = 4 if dimension == 0 else 7
                number = lines.whole(
                    fields[at] if at < len(fields) else "", "the number of an entity's groups"
                )
                groups = fields[at + 1 : at + 1 + number]
                if len(groups) != number:
                    raise lines.fault(f"has {len(groups)} groups and says {number}")
                key = dimension, lines.whole(fields[0], "an entity")
                yield key, [abs(lines.whole(each, "a group")) for each in groups]

    def _place(self, fields: list[str]) -> list[float]:
        if len(fields) < 3:
            raise self._lines.fault(f"has {len(fields)} coordinates, expected 3")
        return [self._lines.real(field, "a coordinate") for field in fields[:3]]

    def _nodes_2(self) -> Iterator[tuple[int, list[float]]]:
        for _ in self._counted("nodes"):
            number, *place = self._lines.text("a node").split()
            yield self._lines.whole(number, "a node"), self._place(place)

    def _nodes(self) -> Iterator[tuple[int, list[float]]]:
        for _ in self._counted("blocks of nodes"):
            count = self._lines.wholes(
                "dimension, tag, parametric and number of a block of nodes", 4
            )[3]
            numbers = [self._lines.wholes("a node's number", 1)[0] for _ in range(count)]
            for number in numbers:
                yield number, self._place(self._lines.text("a node's coordinates").split())

    def _elements_2(self) -> None:
        for _ in self._counted("elements"):
            number, kind, count, *rest = self._lines.wholes(
                "an element: number, type, number of tags, tags, nodes", 3
            )
            self._take(
                self._kind(kind),
                [tag for tag in rest[: min(count, 1)] if tag],
                number,
                rest[count:],
            )

    def _elements(self) -> None:
        for _ in self._counted("blocks of elements"):
            dimension, entity, kind, count, *_ = self._lines.wholes(
                "dimension, tag, type and number of a block of elements", 4
            )
            known, tags = self._kind(kind), self._groups.get((dimension, entity), [])
            for _ in range(count):
                number, *nodes = self._lines.wholes("an element: number, nodes", 2)
                self._take(known, tags, number, nodes)

    def _kind(self, number: int) -> CellKind:
        if number not in _KINDS:
            raise self._lines.fault(
                f"is of the element type {number}; shells of 3, 4, 6, 8 or 9 nodes are read"
            )
        return _KINDS[number]

    def _take(self, kind: CellKind, tags: list[int], number: int, nodes: list[int]) -> None:
        """Put an element into the set of its group."""
        if len(nodes) != kind.nodes:
            raise self._lines.fault(
                f"element {number} has {len(nodes)} nodes, expected {kind.nodes}"
            )
        dimension = 3 if kind.name == SOLID else CELL_TYPES[kind.name].dimension
        if dimension < 2 and not tags:
            return
        if dimension == 2 and len(tags) > 1:
            both = " and ".join(name_of(tag, dimension, self._names) for tag in tags)
            raise self._lines.fault(
                f"element {number} is in the groups {both}; a shell has one section, so one group"
                " is expected"
            )
        for tag in tags or [0]:
            name = name_of(tag, dimension, self._names)
            self._gathered.element(kind.name, name, number, nodes[: kind.taken], self._lines.line)
