"""Nodes, elements and sets of a deck, of each instance of a part and of the whole.

Names and numbers belong to a scope: that of an instance, or the deck's own, which is the empty one. `Bolt-1.5` and
`Bolt-1.Edge` name what lies in an instance.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from modalbase.formats.coordinates import cartesian
from modalbase.formats.models.inp.lines import Card, Row, folded
from modalbase.formats.models.inp.types import ElementType, type_of
from modalbase.formats.models.model import Floats, Integers

MOST_NODES = 300_000
MOST_ELEMENTS = 300_000
"""Three times what the core solves; a deck of 250 000 of each takes 0.5 GB to read."""
MOST_MEMBERS = 3_000_000
"""Of all sets together, as often as cards name them, since a line names as many as it likes."""
DEEPEST_SET = 50


class Element(NamedTuple):
    """An element."""

    type: ElementType  # what its type is
    number: int  # the user's
    nodes: tuple[int, ...]  # rows of the table of nodes, as the deck orders them
    row: Row  # where it begins


class Move(NamedTuple):
    """How an instance stands: x = R x' + t."""

    turn: Floats
    shift: Floats


AT_REST = Move(np.eye(3), np.zeros(3))


class Source(NamedTuple):
    """What puts members into a set: a card with the scope of the names in it, or one that has them itself."""

    card: Card
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


class Mesh:
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
        self.node_rows: list[Row] = []
        self.elements: list[Element] = []
        self.scopes: dict[str, Scope] = {"": Scope()}
        self._system: tuple[Floats, Floats] | None = None
        self._spent = 0

    def read(self, cards: list[Card], scope: str, move: Move = AT_REST) -> None:
        """Take the nodes, elements and sets of cards into a scope."""
        own = self.scopes.setdefault(scope, Scope())
        self._system = None
        for card in cards:
            if card.name == "SYSTEM":
                self._system = system_of(card)
            elif card.name == "NODE":
                _name(own.node_sets, card.get("NSET"), Source(card, scope, self._nodes(card, own, move)))
        for card in cards:
            if card.name == "ELEMENT":
                _name(own.element_sets, card.get("ELSET"), Source(card, scope, self._elements(card, own, scope)))
            elif card.name in ("NSET", "ELSET"):
                inside = folded(card.get("INSTANCE")) or scope
                if inside not in self.scopes:
                    raise card.error(f"names the instance {card.get('INSTANCE')!r}, which is not there")
                sets = own.node_sets if card.name == "NSET" else own.element_sets
                _name(sets, card.needs(card.name), Source(card, inside))

    def _nodes(self, card: Card, own: Scope, move: Move) -> set[int]:
        """Take nodes; their rows."""
        taken = set()
        system = card.get("SYSTEM").upper()[:1] or "R"
        still = self._system is None and move is AT_REST and system == "R"
        for row in card.rows:
            fields = row.fields
            if not 2 <= len(fields) <= 7:
                raise row.error(f"has {len(fields)} fields, expected a number and three coordinates")
            number = row.whole(fields[0], "the node's number")
            values = [row.number(text or "0", "xyz"[k]) for k, text in enumerate(fields[1:4])]
            x, y, z = (*values, 0.0, 0.0)[:3]
            if not still:
                x, y, z = self._placed((x, y, z), system, move, row)
            if max(abs(x), abs(y), abs(z)) > 1e12:
                raise row.error(f"puts node {number} at ({x:g}, {y:g}, {z:g}), expected coordinates below 1e12")
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
                    f"puts node {number} at ({x:g}, {y:g}, {z:g}), and line {before.line} at "
                    f"({', '.join(f'{v:g}' for v in self.places[at])}); take one of the two out"
                )

        return taken

    def _placed(self, x: tuple[float, ...], system: str, move: Move, row: Row) -> tuple[float, float, float]:
        """A node's place in the deck's frame."""
        if system not in ("R", "C"):
            raise row.error(f"is in SYSTEM={system}, expected R or C; write the coordinates in a rectangular system")
        (point,) = cartesian("cylindrical" if system == "C" else "cartesian", np.array([x]))
        if self._system is not None:
            origin, axes = self._system
            point = origin + point @ axes
        a, b, c = (move.turn @ point + move.shift).tolist()
        return a, b, c

    def _elements(self, card: Card, own: Scope, scope: str) -> set[int]:
        """Take elements; their places."""
        kind = type_of(card)
        begun = len(self.elements)
        for row, fields in joined(card, kind.most):
            number = row.whole(fields[0] if fields else "", "the element's number")
            nodes = tuple(self._node(text, scope, row, number) for text in fields[1:])
            if not kind.least <= len(nodes) <= kind.most:
                wanted = f"{kind.least}" if kind.least == kind.most else f"{kind.least} to {kind.most}"
                raise row.error(f"gives element {number} {len(nodes)} nodes, expected {wanted} of {card.get('TYPE')}")
            if len(set(nodes)) < len(nodes):
                raise row.error(f"gives element {number} a node twice")
            if number in own.elements:
                before = self.elements[own.elements[number]].row
                raise row.error(f"has element {number} again, which line {before.line} has; give it another number")
            own.elements[number] = len(self.elements)
            self.elements.append(Element(kind, number, nodes, row))
            if len(self.elements) > MOST_ELEMENTS:
                raise row.error(f"is element {MOST_ELEMENTS + 1}; at most {MOST_ELEMENTS} are read")

        return set(range(begun, len(self.elements)))

    def _node(self, text: str, scope: str, row: Row, number: int) -> int:
        own = self.scopes[scope].nodes
        if text.isdigit() and text.isascii() and len(text) < 10 and (found := own.get(int(text))) is not None:
            return found
        inside, dot, last = folded(text).rpartition(".")
        at = self.scopes[inside] if dot and inside in self.scopes else self.scopes[scope]
        found = at.nodes.get(row.whole(last if dot else text, "a node's number"))
        if found is None:
            raise row.error(f"gives element {number} the node {text}, which no *NODE has")
        return found

    def select_nodes(self, name: str, scope: str, row: Row | Card) -> Integers:
        """Rows of a node by its number, or of a set of nodes by its name.

        Raises:
            FormatError: there is none.
        """
        return self._selected(name, scope, row, "node")

    def select_elements(self, name: str, scope: str, row: Row | Card) -> Integers:
        """Places of an element by its number, or of a set of elements by its name."""
        return self._selected(name, scope, row, "element")

    def _selected(self, name: str, scope: str, row: Row | Card, what: str) -> Integers:
        members = self._members(folded(name), scope, row, what, 0)
        self._spend(len(members), row)
        return np.array(sorted(members), dtype=np.int64)

    def _spend(self, members: int, where: Row | Card) -> None:
        """Count members of sets.

        Raises:
            FormatError: there are too many.
        """
        self._spent += members
        if self._spent > MOST_MEMBERS:
            raise where.error(f"takes the members of all sets above {MOST_MEMBERS}, which is the most that is read")

    def _inside(self, name: str, scope: str) -> tuple[str, str]:
        """The scope and the name there of a name that may begin with that of an instance."""
        for at, letter in enumerate(name):
            if letter == "." and name[:at] in self.scopes:
                return name[:at], name[at + 1 :]
        return scope, name

    def _members(self, name: str, scope: str, row: Row | Card, what: str, depth: int) -> set[int]:
        inside, last = self._inside(name, scope)
        own = self.scopes[inside]
        if last.isdigit() and last.isascii() and len(last) < 10:
            found = (own.nodes if what == "node" else own.elements).get(int(last))
            if found is None:
                raise row.error(f"names the {what} {last}, which is not there")
            return {found}
        if (what, last) in own.members:
            return own.members[what, last]
        defined = _sets(own, what)
        if last not in defined:
            near = ", ".join(sorted(defined)[:8]) or "none"
            raise row.error(f"names the {what} set {name!r}, which is not there; there are {near}")
        if depth > DEEPEST_SET:
            raise row.error(
                f"leads to sets within sets, more than {DEEPEST_SET} deep; do they name one another in a circle?"
            )
        members: set[int] = set()
        for source in defined[last]:
            members |= self._of_card(source.card, source.scope, what, depth) if source.own is None else source.own
        own.members[what, last] = members
        return members

    def _of_card(self, card: Card, scope: str, what: str, depth: int) -> set[int]:
        """What a card of a set puts there."""
        own = self.scopes[scope]
        table = own.nodes if what == "node" else own.elements
        if "GENERATE" in card.parameters:
            found = {at for row in card.rows for at in self._generated(row, table)}
        elif what == "node" and card.get("ELSET"):
            chosen = self._members(folded(card.get("ELSET")), scope, card, "element", depth + 1)
            found = {node for at in chosen for node in self.elements[at].nodes}
        else:
            found = set()
            for row in card.rows:
                for text in row.fields:
                    if text:
                        found |= self._members(folded(text), scope, row, what, depth + 1)
        self._spend(len(found), card)
        return found

    def _generated(self, row: Row, table: dict[int, int]) -> Iterator[int]:
        """Those of first, last and step that are there."""
        fields = row.fields
        if not 2 <= len(fields) <= 3:
            raise row.error(f"has {len(fields)} fields, expected first, last and step")
        first, last, step = (row.whole(text, "of first, last and step one") for text in [*fields, "1"][:3])
        if step < 1 or last < first:
            raise row.error(f"generates {first} to {last} by {step}, expected first ≤ last and a step of at least 1")
        self._spend(min((last - first) // step + 1, len(table)), row)
        if (last - first) // step < len(table):
            return (table[n] for n in range(first, last + 1, step) if n in table)
        return (at for n, at in table.items() if first <= n <= last and (n - first) % step == 0)


def joined(card: Card, most: int) -> Iterator[tuple[Row, list[str]]]:
    """Each element of a card: its first line, and its fields over as many lines as it takes.

    A line that ends with a comma goes on; so does one of a 3-D element that is short, as both solvers read it.
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


def _sets(scope: Scope, what: str) -> dict[str, list[Source]]:
    return scope.node_sets if what == "node" else scope.element_sets


def _name(sets: dict[str, list[Source]], name: str, source: Source) -> None:
    if name:
        sets.setdefault(folded(name), []).append(source)


def system_of(card: Card) -> tuple[Floats, Floats]:
    """Origin and axes (rows) of *SYSTEM."""
    values = [number for row in card.rows for number in row.numbers("coordinates")]
    a, b, c = (np.array([*values, *[0.0] * 9][k : k + 3]) for k in (0, 3, 6))
    if len(values) <= 3:
        return a, np.eye(3)
    if len(values) <= 6:
        c = a + np.cross([0.0, 0.0, 1.0], b - a)
    return a, frame(b - a, c - a, card.first)


def frame(first: Floats, second: Floats, row: Row) -> Floats:
    """Axes (rows): 1 along the first direction, 2 in the plane of both.

    Raises:
        FormatError: both lie along one line.
    """
    third = np.cross(first, second)
    lengths = np.linalg.norm(first), np.linalg.norm(third)
    if not (np.all(np.isfinite(third)) and lengths[1] > 1e-9 * lengths[0] * np.linalg.norm(second) > 0):
        raise row.error("gives points on one line, expected three that span a plane")
    x, z = first / lengths[0], third / lengths[1]
    return np.array([x, np.cross(z, x), z])
