"""Elements as readers meet them, gathered by kind and set; and the lines of a text file."""

import math
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import Cells, Group, MeshFile
from modalbase.formats.models.model import LARGEST, Integers
from modalbase.formats.types import FloatArray

SOLID = "solid"
"""Kind of all elements that fill space."""

_LONGEST = 60


class CellKind(NamedTuple):
    """What a format's type of element is to us: our kind, and how many nodes it has.

    Where it has more than ours, those in the middle of a face come last and are left out.
    """

    name: str
    nodes: int

    @property
    def taken(self) -> int:
        """How many of its nodes are used."""
        return self.nodes if self.name == SOLID else CELL_TYPES[self.name].nodes


def plain(name: str) -> str:
    """A set's name of small letters, digits and _ alone, as parameters have it; empty where nothing
    is left.
    """
    return re.sub(r"\W+", "_", name).strip("_").lower()[:_LONGEST]


def whole_numbers(values: FloatArray) -> Integers | None:
    """Whole numbers that were read as reals; None where one is none, or beyond what a real holds
    exactly.
    """
    is_whole = np.all((np.abs(values) < 2**53) & (values == np.round(values)))
    return values.astype(np.int64) if is_whole else None


class Gathering:
    """Nodes and elements of a file, as they come."""

    def __init__(self) -> None:
        self._nodes: dict[int, tuple[float, float, float]] = {}
        self._rows: dict[int, int] = {}
        self._sets: defaultdict[tuple[str, str], list[tuple[int, list[int], int]]] = defaultdict(
            list
        )
        self._groups: dict[str, Group] = {}

    def node(self, number: int, place: Sequence[float], where: str) -> None:
        """Take a node.

        Raises:
            FormatError: there is one of this number.
        """
        if number in self._nodes:
            raise FormatError(where, f"node {number} is there twice")
        x, y, z = place
        self._rows[number] = len(self._nodes)
        self._nodes[number] = (x, y, z)

    def element(self, kind: str, name: str, number: int, nodes: Sequence[int], line: int) -> None:
        """Take an element of a set by the numbers of its nodes.

        Raises:
            FormatError: a node is not there.
        """
        try:
            rows = [self._rows[node] for node in nodes]
        except KeyError as lost:
            raise FormatError(
                f"line {line}", f"element {number} has the node {lost}, which is not there"
            ) from None
        self._sets[kind, name].append((number, rows, line))

    def group(self, name: str, elements: Sequence[int], nodes: Sequence[int], where: str) -> None:
        """Take a group of elements and nodes by their numbers, after these.

        Raises:
            FormatError: one is not there, or the name is that of another group or of a set.
        """
        if name in self._groups or any(name == other for _, other in self._sets):
            raise FormatError(
                where, f"{name} is there twice: capitals and signs of a name do not count"
            )
        known = (
            {number for members in self._sets.values() for number, _, _ in members}
            if elements
            else set()
        )
        for what, lost in (
            ("element", set(elements) - known),
            ("node", set(nodes) - self._rows.keys()),
        ):
            if lost:
                raise FormatError(
                    where, f"the group {name} has the {what} {min(lost)}, which is not there"
                )
        self._groups[name] = Group(name, np.array(elements, dtype=np.int64), self._places(nodes))

    def _places(self, nodes: Sequence[int]) -> Integers:
        return np.array([self._rows[node] for node in nodes], dtype=np.int64)

    def mesh(self, length_m: float | None = None) -> MeshFile:
        """All that came."""
        cells = []
        for (kind, name), elements in self._sets.items():
            numbers, rows, lines = zip(*elements, strict=True)
            # solids of several types are one kind: they are counted, not used
            width = min(map(len, rows))
            nodes = np.array([row[:width] for row in rows], dtype=np.int64).reshape(
                len(elements), width
            )
            cells.append(Cells(kind, name, np.array(numbers), nodes, np.array(lines)))
        places = np.array(list(self._nodes.values()), dtype=float).reshape(-1, 3)
        return MeshFile(
            np.array(list(self._nodes), dtype=np.int64),
            places,
            cells,
            (),
            length_m,
            tuple(self._groups.values()),
        )


class Lines:
    """Lines of a text file, blank ones left out, and the fields of each.

    Attributes:
        line: number of the line that was read last, from 1.
    """

    def __init__(self, content: bytes) -> None:
        self._rows = content.decode("utf-8-sig", "replace").split("\n")
        self.line = 0

    @property
    def where(self) -> str:
        """The place of a fault."""
        return f"line {self.line}"

    def fault(self, message: str) -> FormatError:
        """A fault of the line that was read last."""
        return FormatError(self.where, message)

    def more(self) -> str | None:
        """The next line, or None at the end."""
        while self.line < len(self._rows):
            self.line += 1
            if text := self._rows[self.line - 1].strip():
                return text
        return None

    def text(self, what: str) -> str:
        """The next line, which holds `what`.

        Raises:
            FormatError: the file ends before it.
        """
        if (line := self.more()) is None:
            raise FormatError(self.where, f"the file ends before {what}; it seems to be cut")
        return line

    def wholes(self, what: str, least: int) -> list[int]:
        """The whole numbers of the next line, at least so many."""
        fields = self.text(what).split()
        if len(fields) < least:
            raise self.fault(f"has {len(fields)} fields, expected {what}")
        return [self.whole(field, what) for field in fields]

    def whole(self, field: str, what: str) -> int:
        """A whole number of at most 18 digits."""
        if not re.fullmatch(r"[+-]?[0-9]{1,18}", field):
            raise self.fault(f"{what}: {field[:40]!r} is no whole number")
        return int(field)

    def real(self, field: str, what: str) -> float:
        """A finite number."""
        try:
            value = float(field)
        except ValueError:
            value = math.nan
        if not abs(value) < LARGEST:
            raise self.fault(f"{what}: {field[:40]!r} is no number below {LARGEST:g}")
        return value


def name_of(tag: int, dimension: int, names: Mapping[tuple[int, int], str]) -> str:
    """The set of a group: the name that it was given, else `set_3`, or `line_3`, `point_3`,
    `solid_3`.
    """
    return (
        plain(names.get((dimension, tag), ""))
        or f"{('point', 'line', 'set', SOLID)[dimension]}_{tag}"
    )
