"""Nodes, elements and sets of a deck, of each instance of a part and of the whole.

Names and numbers belong to a scope: that of an instance, or the deck's own, which is the empty one.
`Bolt-1.5` and `Bolt-1.Edge` name what lies in an instance.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from modalbase.formats.cell_types import CELL_TYPES, CellType
from modalbase.formats.coordinates import cartesian
from modalbase.formats.models.inp.lines import DataLine, Keyword, folded
from modalbase.formats.models.model import Floats, Integers

Role = Literal["shell", "beam", "mass", "inertia", "spring", "rigid", "other"]


@dataclass(frozen=True)
class ElementType:
    """A type of elements."""

    name: str  # as both solvers have it
    role: Role  # what it is for
    # least, most: numbers of its nodes, a node more for a beam's direction
    least: int
    most: int
    kind: str = ""  # of the model's elements
    order: tuple[int, ...] = ()  # of the deck's nodes in the model's
    loss: str = ""  # of a type that is not used: what is lost
    changes: bool = False  # whether modes change by that


def _element(cell_type: CellType) -> dict[str, ElementType]:
    """A beam's nodes may have one more, for its direction."""
    n = cell_type.nodes
    role: Role = "beam" if cell_type.dimension == 1 else "shell"
    most, order = n + (role == "beam"), cell_type.abaqus_order or tuple(range(n))
    return {
        name: ElementType(name, role, n, most, cell_type.name, order) for name in cell_type.abaqus
    }


def _special(
    role: Role, least: int, most: int, names: str, loss: str = "", changes: bool = False
) -> dict[str, ElementType]:
    return {
        name: ElementType(name, role, least, most, loss=loss, changes=changes)
        for name in names.split()
    }


TYPES: dict[str, ElementType] = {
    **{name: one for each in CELL_TYPES.values() for name, one in _element(each).items()},
    **_special("mass", 1, 1, "MASS"),
    **_special("inertia", 1, 1, "ROTARYI"),
    **_special("spring", 2, 2, "SPRINGA SPRING2"),
    **_special("spring", 1, 1, "SPRING1"),
    **_special("rigid", 2, 4, "R3D3 R3D4 RB3D2"),
    **_special("other", 1, 2, "DASHPOTA DASHPOT1 DASHPOT2", "dashpots: damping is measured"),
    **_special(
        "other",
        1,
        8,
        "SFM3D3 SFM3D4 SFM3D4R SFM3D6 SFM3D8 SFM3D8R",
        "surface elements, their mass too",
        True,
    ),
    **_special("other", 1, 2, "CONN3D2", "connectors between nodes", True),
    **_special("other", 1, 1, "DCOUP3D"),
}
"""By name."""

SLENDER = ("B33", "B33H")
"""Beams that are rigid in shear."""

_REFUSED = (
    ("C3D SC6R SC8R CSS8 AC3D DC3D COH3D", "solid elements are not updated by sets"),
    ("CPS CPE CAX DC2D", "elements of a plane or about an axis do not bend in space"),
    ("T2D T3D", "trusses have no stiffness across; use B31 with a small section"),
    ("M3D", "membranes have no stiffness across; use a shell"),
    ("B21 B22 B23", "beams of a plane; use B31"),
    ("B31OS B32OS", "open sections with warping; use B31"),
    ("PIPE ELBOW", "pipes that ovalise; use B31 with SECTION=PIPE"),
    ("F3D", "fluids do not vibrate here"),
    ("S9R5 SAX", "9-node and axisymmetric shells; use S8R"),
)
MATRICES = (
    "another model comes in as matrices: write K and M with *MATRIX GENERATE or MATRIXSTORAGE and"
    " import those"
)


def type_of(card: Keyword) -> ElementType:
    """The type of a card's elements.

    Raises:
        FormatError: it is none that is read.
    """
    name = card.needs("TYPE").upper()
    if known := TYPES.get(name):
        return known
    for prefixes, reason in _REFUSED:
        if name.startswith(tuple(prefixes.split())):
            raise card.error(f"TYPE={name[:20]}: {reason}; {MATRICES}")
    raise card.error(
        f"TYPE={name[:20]} is unknown; shells (S3 S4 S6 S8R), beams (B31 B32), MASS, ROTARYI and"
        " SPRING are read"
    )


MOST_NODES = MOST_ELEMENTS = 300_000
"""Three times what the core solves; a deck of 250 000 of each takes 0.5 GB to read."""
MOST_MEMBERS = 3_000_000
"""Of all sets together, as often as cards name them, since a line names as many as it likes."""
DEEPEST_SET = 50


class InpElement(NamedTuple):
    """An element."""

    type: ElementType  # what its type is
    number: int  # the user's
    nodes: tuple[int, ...]  # rows of the table of nodes, as the deck orders them
    row: DataLine  # where it begins


class Move(NamedTuple):
    """How an instance stands: x = R x' + t."""

    turn: Floats
    shift: Floats


AT_REST = Move(np.eye(3), np.zeros(3))


class Source(NamedTuple):
    """What puts members into a set: a card with the scope of the names in it, or one that has them
    itself.
    """

    card: Keyword
    scope: str
    own: set[int] | None = None


@dataclass
class Scope:
    """What one instance, or the deck itself, has."""

    nodes: dict[int, int] = field(default_factory=dict)
    elements: dict[int, int] = field(default_factory=dict)
    node_sets: dict[str, list[Source]] = field(default_factory=dict)
    element_sets: dict[str, list[Source]] = field(default_factory=dict)
    members: dict[tuple[str, str], set[int]] = field(default_factory=dict)


class InpMesh:
    """Nodes and elements as they are read.

    Attributes:
        places: coordinates in the deck's frame.
        numbers: the user's, of the nodes.
        node_rows: where each node stands.
        elements: all.
        scopes: by the folded name of the instance; the empty one is the deck's own.
    """

    def __init__(self) -> None:
        self.places: list[tuple[float, float, float]] = []
        self.numbers: list[int] = []
        self.node_rows: list[DataLine] = []
        self.elements: list[InpElement] = []
        self.scopes: dict[str, Scope] = {"": Scope()}
        self._system: tuple[Floats, Floats] | None = None
        self._spent = 0

    def read(self, cards: list[Keyword], scope: str, move: Move = AT_REST) -> None:
        """Take the nodes, elements and sets of cards into a scope."""
        own = self.scopes.setdefault(scope, Scope())
        self._system = None
        for card in cards:
            if card.name == "SYSTEM":
                self._system = system_of(card)
            elif card.name == "NODE":
                _name(
                    own.node_sets,
                    card.get("NSET"),
                    Source(card, scope, self._nodes(card, own, move)),
                )
        for card in cards:
            if card.name == "ELEMENT":
                _name(
                    own.element_sets,
                    card.get("ELSET"),
                    Source(card, scope, self._elements(card, own, scope)),
                )
            elif card.name in ("NSET", "ELSET"):
                inside = folded(card.get("INSTANCE")) or scope
                if inside not in self.scopes:
                    raise card.error(
                        f"names the instance {card.get('INSTANCE')!r}, which is not there"
                    )
                sets = own.node_sets if card.name == "NSET" else own.element_sets
                _name(sets, card.needs(card.name), Source(card, inside))

    def _nodes(self, card: Keyword, own: Scope, move: Move) -> set[int]:
        """Take nodes; their rows."""
        taken = set()
        system = card.get("SYSTEM").upper()[:1] or "R"
        untransformed = self._system is None and move is AT_REST and system == "R"
        for row in card.rows:
            fields = row.fields
            if not 2 <= len(fields) <= 7:
                raise row.error(
                    f"has {len(fields)} fields, expected a number and three coordinates"
                )
            number = row.whole(fields[0], "the node's number")
            values = [row.number(text or "0", "xyz"[k]) for k, text in enumerate(fields[1:4])]
            x, y, z = (*values, 0.0, 0.0)[:3]
            if not untransformed:
                x, y, z = self._placed((x, y, z), system, move, row)
            if max(abs(x), abs(y), abs(z)) > 1e12:
                raise row.error(
                    f"puts node {number} at ({x:g}, {y:g}, {z:g}), expected coordinates below 1e12"
                )
            at = own.nodes.get(number)
            taken.add(len(self.places) if at is None else at)
            if at is None:
                own.nodes[number] = len(self.places)
                self.places.append((x, y, z))
                self.numbers.append(number)
                self.node_rows.append(row)
                if len(self.places) > MOST_NODES:
                    raise row.error(f"is node {MOST_NODES + 1}; at most {MOST_NODES} are read")
            elif self.places[at] != (x, y, z):
                before = self.node_rows[at]
                raise row.error(
                    f"puts node {number} at ({x:g}, {y:g}, {z:g}), and {before.where} at "
                    f"({', '.join(f'{v:g}' for v in self.places[at])}); take one of the two out"
                )

        return taken

    def _placed(
        self, x: tuple[float, ...], system: str, move: Move, row: DataLine
    ) -> tuple[float, float, float]:
        """A node's place in the deck's frame."""
        if system not in ("R", "C"):
            raise row.error(
                f"is in SYSTEM={system}, expected R or C; write the coordinates in a rectangular"
                " system"
            )
        (point,) = cartesian("cylindrical" if system == "C" else "cartesian", np.array([x]))
        if self._system is not None:
            origin, axes = self._system
            point = origin + point @ axes
        a, b, c = (move.turn @ point + move.shift).tolist()
        return a, b, c

    def _elements(self, card: Keyword, own: Scope, scope: str) -> set[int]:
        """Take elements; their places."""
        kind = type_of(card)
        begun = len(self.elements)
        for row, fields in joined(card, kind.most):
            number = row.whole(fields[0] if fields else "", "the element's number")
            nodes = tuple(self._node(text, scope, row, number) for text in fields[1:])
            if not kind.least <= len(nodes) <= kind.most:
                expected = (
                    f"{kind.least}" if kind.least == kind.most else f"{kind.least} to {kind.most}"
                )
                raise row.error(
                    f"gives element {number} {len(nodes)} nodes, expected {expected} of"
                    f" {card.get('TYPE')}"
                )
            if len(set(nodes)) < len(nodes):
                raise row.error(f"gives element {number} a node twice")
            if number in own.elements:
                before = self.elements[own.elements[number]].row
                raise row.error(
                    f"has element {number} again, which {before.where} has; give it another number"
                )
            own.elements[number] = len(self.elements)
            self.elements.append(InpElement(kind, number, nodes, row))
            if len(self.elements) > MOST_ELEMENTS:
                raise row.error(f"is element {MOST_ELEMENTS + 1}; at most {MOST_ELEMENTS} are read")

        return set(range(begun, len(self.elements)))

    def _node(self, text: str, scope: str, row: DataLine, number: int) -> int:
        own = self.scopes[scope].nodes
        if (
            text.isdigit()
            and text.isascii()
            and len(text) < 10
            and (index := own.get(int(text))) is not None
        ):
            return index
        inside, dot, last = folded(text).rpartition(".")
        at = self.scopes[inside] if dot and inside in self.scopes else self.scopes[scope]
        index = at.nodes.get(row.whole(last if dot else text, "a node's number"))
        if index is None:
            raise row.error(f"gives element {number} the node {text}, which no *NODE has")
        return index

    def select(
        self, what: Literal["node", "element"], name: str, scope: str, row: DataLine | Keyword
    ) -> Integers:
        """Rows of a node, or places of an element, by its number, or of a set of them by its name.

        Raises:
            FormatError: there is none.
        """
        members = self._members(folded(name), scope, row, what, 0)
        self._spend(len(members), row)
        return np.array(sorted(members), dtype=np.int64)

    def _spend(self, members: int, where: DataLine | Keyword) -> None:
        """Count members of sets.

        Raises:
            FormatError: there are too many.
        """
        self._spent += members
        if self._spent > MOST_MEMBERS:
            raise where.error(
                f"takes the members of all sets above {MOST_MEMBERS}, which is the most that is"
                " read"
            )

    def _inside(self, name: str, scope: str) -> tuple[str, str]:
        """The scope and the name there of a name that may begin with that of an instance."""
        for at, letter in enumerate(name):
            if letter == "." and name[:at] in self.scopes:
                return name[:at], name[at + 1 :]
        return scope, name

    def _members(
        self, name: str, scope: str, row: DataLine | Keyword, what: str, depth: int
    ) -> set[int]:
        inside, last = self._inside(name, scope)
        own = self.scopes[inside]
        if last.isdigit() and last.isascii() and len(last) < 10:
            index = (own.nodes if what == "node" else own.elements).get(int(last))
            if index is None:
                raise row.error(f"names the {what} {last}, which is not there")
            return {index}
        if (what, last) in own.members:
            return own.members[what, last]
        defined = own.node_sets if what == "node" else own.element_sets
        if last not in defined:
            near = ", ".join(sorted(defined)[:8]) or "none"
            raise row.error(f"names the {what} set {name!r}, which is not there; there are {near}")
        if depth > DEEPEST_SET:
            raise row.error(
                f"leads to sets within sets, more than {DEEPEST_SET} deep; do they name one another"
                " in a circle?"
            )
        members: set[int] = set()
        for source in defined[last]:
            members |= (
                self._of_card(source.card, source.scope, what, depth)
                if source.own is None
                else source.own
            )
        own.members[what, last] = members
        return members

    def _of_card(self, card: Keyword, scope: str, what: str, depth: int) -> set[int]:
        """What a card of a set puts there."""
        own = self.scopes[scope]
        table = own.nodes if what == "node" else own.elements
        if "GENERATE" in card.parameters:
            members = {at for row in card.rows for at in self._generated(row, table)}
        elif what == "node" and card.get("ELSET"):
            chosen = self._members(folded(card.get("ELSET")), scope, card, "element", depth + 1)
            members = {node for at in chosen for node in self.elements[at].nodes}
        else:
            members = set()
            for row in card.rows:
                for text in row.fields:
                    if text:
                        members |= self._members(folded(text), scope, row, what, depth + 1)
        self._spend(len(members), card)
        return members

    def _generated(self, row: DataLine, table: dict[int, int]) -> Iterator[int]:
        """Those of first, last and step that are there."""
        fields = row.fields
        if not 2 <= len(fields) <= 3:
            raise row.error(f"has {len(fields)} fields, expected first, last and step")
        first, last, step = (
            row.whole(text, "of first, last and step one") for text in [*fields, "1"][:3]
        )
        if step < 1 or last < first:
            raise row.error(
                f"generates {first} to {last} by {step}, expected first ≤ last and a step of at"
                " least 1"
            )
        self._spend(min((last - first) // step + 1, len(table)), row)
        if (last - first) // step < len(table):
            return (table[n] for n in range(first, last + 1, step) if n in table)
        return (at for n, at in table.items() if first <= n <= last and (n - first) % step == 0)


def joined(card: Keyword, most: int) -> Iterator[tuple[DataLine, list[str]]]:
    """Each element of a card: its first line, and its fields over as many lines as it takes.

    A line that ends with a comma goes on; so does one of a 3-D element that is short, as both
    solvers read it.
    """
    rows = iter(card.rows)
    for row in rows:
        text = row.text
        fields = row.fields
        while len(fields) < most + 1 and text.endswith(","):
            following = next(rows, None)
            if following is None:
                break
            text = following.text
            fields = fields + following.fields
        yield row, fields


def _name(sets: dict[str, list[Source]], name: str, source: Source) -> None:
    if name:
        sets.setdefault(folded(name), []).append(source)


def system_of(card: Keyword) -> tuple[Floats, Floats]:
    """Origin and axes (rows) of *SYSTEM."""
    values = [number for row in card.rows for number in row.numbers("coordinates")]
    a, b, c = (np.array([*values, *[0.0] * 9][k : k + 3]) for k in (0, 3, 6))
    if len(values) <= 3:
        return a, np.eye(3)
    if len(values) <= 6:
        c = a + np.cross([0.0, 0.0, 1.0], b - a)
    return a, frame(b - a, c - a, card.first)


def frame(first: Floats, second: Floats, row: DataLine) -> Floats:
    """Axes (rows): 1 along the first direction, 2 in the plane of both.

    Raises:
        FormatError: both lie along one line.
    """
    third = np.cross(first, second)
    lengths = np.linalg.norm(first), np.linalg.norm(third)
    if not (
        np.all(np.isfinite(third)) and lengths[1] > 1e-9 * lengths[0] * np.linalg.norm(second) > 0
    ):
        raise row.error("gives points on one line, expected three that span a plane")
    x, z = first / lengths[0], third / lengths[1]
    return np.array([x, np.cross(z, x), z])
