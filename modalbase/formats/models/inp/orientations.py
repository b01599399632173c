"""Local axes of elements and nodes: *ORIENTATION and *TRANSFORM."""

from dataclasses import dataclass, field

import numpy as np

from modalbase.formats.models.check import axis_without_system
from modalbase.formats.models.inp.lines import DataLine, Keyword, folded
from modalbase.formats.models.inp.mesh import AT_REST, InpMesh, Move, frame
from modalbase.formats.models.model import Floats, Integers


@dataclass(frozen=True)
class Orientation:
    """A rectangular or cylindrical system."""

    cylindrical: bool  # axes are radial, tangential and along axis 3
    origin: Floats  # of it, in the model's frame
    axes: Floats  # (3, 3) rows
    # axis (0 … 2) about which the others are turned, which lies along the normal of shells
    about: int | None = None
    turn: float = 0.0  # that turn, rad
    # axes of elements that have their own, by their place
    own: dict[int, Floats] = field(default_factory=dict)

    def at(self, points: Floats) -> Floats:
        """(p, 3, 3) axes as rows at (p, 3) points."""
        axes = np.broadcast_to(self.axes, (len(points), 3, 3))
        if self.cylindrical:
            along = self.axes[2]
            radial = points - self.origin
            radial = radial - (radial @ along)[:, None] * along
            length = np.linalg.norm(radial, axis=1, keepdims=True)
            radial = np.where(
                length > 1e-12, radial / np.where(length > 0, length, 1), self.axes[0]
            )
            axes = np.stack(
                [radial, np.cross(along, radial), np.broadcast_to(along, radial.shape)], axis=1
            )
        return self._turned(axes)

    def of(self, elements: Integers, points: Floats) -> Floats:
        """(e, 3, 3) axes as rows of elements whose middles are at (e, 3) points."""
        axes = np.array(self.at(points))
        for row, element in enumerate(elements.tolist()):
            if element in self.own:
                axes[row] = self._turned(self.own[element][None])[0]
        return axes

    def _turned(self, axes: Floats) -> Floats:
        if not self.turn:
            return axes
        k = 2 if self.about is None else self.about
        i, j = (k + 1) % 3, (k + 2) % 3
        new = np.array(axes)
        c, s = np.cos(self.turn), np.sin(self.turn)
        new[:, i], new[:, j] = c * axes[:, i] + s * axes[:, j], c * axes[:, j] - s * axes[:, i]
        return new

    @property
    def projected(self) -> int:
        """Which axis becomes axis 1 of a shell: the one after that along its normal."""
        return 0 if self.about is None else (self.about + 1) % 3


def axis_of_shells(
    system: Orientation | None, elements: Integers, points: Floats, normals: Floats
) -> Floats:
    """(e, 3) axis 1 of shells, not projected; without a system the model's x axis, or z where x is
    their normal.
    """
    return (
        axis_without_system(normals)
        if system is None
        else system.of(elements, points)[:, system.projected]
    )


@dataclass
class Part:
    """An instance of a part, or the deck itself: its cards, and what the names in them mean."""

    mesh: InpMesh  # of all
    cards: list[Keyword]  # of it
    scope: str = ""  # name of the instance, folded
    name: str = ""  # of the part
    move: Move = AT_REST  # how it stands
    systems: dict[str, Orientation] = field(default_factory=dict)  # its orientations by folded name

    def nodes(self, name: str, where: Keyword | DataLine) -> Integers:
        """Rows of a node, or of a set of nodes."""
        return self.mesh.select("node", name, self.scope, where)

    def elements(self, name: str, where: Keyword | DataLine) -> list[int]:
        """Places of an element, or of a set of elements."""
        chosen: list[int] = self.mesh.select("element", name, self.scope, where).tolist()
        return chosen

    def named(self, *names: str) -> list[Keyword]:
        """Its cards of some names."""
        return [card for card in self.cards if card.name in names]

    def system(self, name: str, where: Keyword | DataLine) -> Orientation | None:
        """An orientation by its name.

        Raises:
            FormatError: there is none.
        """
        if not name:
            return None
        if folded(name) not in self.systems:
            there = ", ".join(self.systems) or "none"
            raise where.error(
                f"names the orientation {name!r}, which no *ORIENTATION has; there are {there}"
            )
        return self.systems[folded(name)]


def orientation(card: Keyword, part: Part, tables: dict[str, Keyword]) -> Orientation:
    """The system of *ORIENTATION.

    Raises:
        FormatError: it is none that is read, or its points do not make one.
    """
    if card.get("DEFINITION").upper() not in ("", "COORDINATES"):
        raise card.error(
            f"has DEFINITION={card.get('DEFINITION')}, expected COORDINATES; give the points by"
            " numbers"
        )
    system = card.get("SYSTEM").upper() or "RECTANGULAR"
    if system[0] not in "RCZ":
        raise card.error(f"has SYSTEM={system}, expected RECTANGULAR, Z RECTANGULAR or CYLINDRICAL")
    first = card.first
    named = first.fields[:1]
    own: dict[int, Floats] = {}
    if named and (table := tables.get(folded(named[0]))):
        values, own = _distributed(table, part)
    else:
        values = first.numbers("coordinates of two or three points", 6)
    origin, axes = _points(values, system, first)
    about, turn = _turn(card)
    move = part.move
    return Orientation(
        system[0] == "C", move.turn @ origin + move.shift, axes @ move.turn.T, about, turn, own
    )


def _points(values: list[float], system: str, row: DataLine) -> tuple[Floats, Floats]:
    """Origin and axes of a, b and c."""
    a, b = np.array(values[:3]), np.array(values[3:6])
    if system[0] == "C":
        return a, _about(b - a, row)
    c = np.array([*values[6:9], 0.0, 0.0, 0.0][:3])
    axes = frame(a - c, b - c, row)
    return c, axes[[1, 2, 0]] if system[0] == "Z" else axes


def _about(along: Floats, row: DataLine) -> Floats:
    """Axes of which the third lies along a direction."""
    return frame(along, np.eye(3)[np.argmin(np.abs(along))], row)[[1, 2, 0]]


def _turn(card: Keyword) -> tuple[int | None, float]:
    """The second line: an axis from 0, and the angle about it in rad."""
    if len(card.rows) < 2 or not card.rows[1].fields:
        return None, 0.0
    row = card.rows[1]
    about, angle, *_ = (*row.fields, "0")
    axis = row.whole(about or "1", "the axis of the turn")
    if axis not in (1, 2, 3):
        raise row.error(f"turns about axis {axis}, expected 1, 2 or 3")
    return axis - 1, float(np.radians(row.number(angle or "0", "the angle")))


def _distributed(card: Keyword, part: Part) -> tuple[list[float], dict[int, Floats]]:
    """Points that hold where elements have none of their own, and the axes of those that have."""
    default = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    own: dict[int, Floats] = {}
    for row in card.rows:
        fields = row.fields
        if len(fields) < 7:
            raise row.error(f"has {len(fields)} fields, expected an element and two points")
        values = [row.number(text or "0", "a coordinate") for text in fields[1:7]]
        if not fields[0]:
            default = values
            continue
        axes = frame(np.array(values[:3]), np.array(values[3:]), row) @ part.move.turn.T
        own |= dict.fromkeys(part.elements(fields[0], row), axes)
    return default, own


def transforms(part: Part) -> dict[int, Floats]:
    """(3, 3) axes, as rows, of the nodes that *TRANSFORM names, by row."""
    by_node: dict[int, Floats] = {}
    for card in part.named("TRANSFORM"):
        kind = card.get("TYPE").upper() or "R"
        if kind not in ("R", "C"):
            raise card.error(f"has TYPE={kind}, expected R or C")
        values = card.first.numbers("coordinates of two points", 6)
        a, b = np.array(values[:3]), np.array(values[3:6])
        axes = frame(a, b, card.first) if kind == "R" else _about(b - a, card.first)
        system = Orientation(
            kind == "C", part.move.turn @ a + part.move.shift, axes @ part.move.turn.T
        )
        nodes = part.nodes(card.needs("NSET"), card)
        by_node |= dict(
            zip(
                nodes.tolist(),
                system.at(np.array(part.mesh.places)[nodes].reshape(-1, 3)),
                strict=True,
            )
        )
    return by_node
