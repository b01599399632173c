"""Coordinate systems and grids."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter

import numpy as np

from modalbase.formats.coordinates import Kind, cartesian
from modalbase.formats.models.bdf.card import Card, numbered
from modalbase.formats.models.model import Floats, IncompleteError, Integers


@dataclass(frozen=True)
class System:
    """A coordinate system: its origin, its axes as rows, and its kind."""

    origin: Floats
    axes: Floats
    kind: Kind = "cartesian"

    def place(self, points: Floats) -> Floats:
        """(n, 3) places in the model's frame of (n, 3) coordinates; angles in degrees."""
        return np.asarray(self.origin + cartesian(self.kind, points) @ self.axes)

    def axes_at(self, place: Floats) -> Floats:
        """(3, 3) the axes, as rows, in which vectors at a place are stated."""
        if self.kind == "cartesian":
            return self.axes
        x, y, z = self.axes @ (place - self.origin)
        radius = float(np.hypot(x, y))
        c, s = (x / radius, y / radius) if radius > 0 else (1.0, 0.0)
        rows = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        if self.kind == "spherical":
            length = float(np.hypot(radius, z))
            up, out = (z / length, radius / length) if length > 0 else (1.0, 0.0)
            rows = np.array([[out * c, out * s, up], [up * c, up * s, -out], [-s, c, 0.0]])
        return np.asarray(rows @ self.axes)


_KINDS: dict[str, Kind] = {"R": "cartesian", "C": "cylindrical", "S": "spherical"}
BASIC = System(np.zeros(3), np.eye(3))


@dataclass
class Grids:
    """The grids of a deck."""

    numbers: Integers  # (n,) the user's, ascending
    places: Floats  # (n, 3) in the model's frame
    rows: dict[int, int]  # of each number
    by_text: dict[str, int]  # the same by the number as text
    systems: dict[int, System]  # by number, with the model's as 0
    displacement: dict[int, int] = field(default_factory=dict)  # CD of the rows that have one
    # PS of the rows that have one, with the card
    held: dict[int, tuple[tuple[int, ...], Card]] = field(default_factory=dict)
    superelements: list[Card] = field(default_factory=list)
    repeated: list[Card] = field(default_factory=list)  # that say of a grid what another has said

    def row(self, card: Card, index: int, what: str) -> int:
        """The row of the grid that a field names."""
        number = card.integer(index, what)
        row = self.rows.get(number)
        if row is None:
            raise IncompleteError(
                card.wrong(index, what, f"a grid of the deck; there is no GRID {number}").faults
            )
        return row

    def axes(self, row: int) -> Floats:
        """(3, 3) axes, as rows, of the displacements of a grid."""
        system = self.displacement.get(row)
        return BASIC.axes if system is None else self.systems[system].axes_at(self.places[row])

    def system(self, card: Card, index: int, what: str) -> System:
        """The coordinate system that a field names."""
        number = card.integer(index, what, 0)
        if number not in self.systems:
            raise card.wrong(
                index, what, f"a coordinate system of the deck; there is no CORD {number}"
            )
        return self.systems[number]


def read_grids(cards: Iterable[Card], defaults: Card | None, frames: Iterable[Card]) -> Grids:
    """Grids in the model's frame.

    Args:
        cards: GRID.
        defaults: GRDSET.
        frames: CORD1R … CORD2S.

    Raises:
        FormatError: a grid stands twice and differs, or a system twice; one refers to one that is
            not there, or to itself in a circle.
    """
    first: dict[tuple[str | float, ...], Card] = {}
    cards = list(cards)
    repeated = [card for card in cards if first.setdefault(card.content, card) is not card]
    by_number = numbered(first.values(), "grid", "ID")
    numbers = np.array(sorted(by_number), dtype=np.int64)
    ordered = [by_number[number] for number in numbers.tolist()]
    points = np.array(
        [[card.real(2 + k, f"X{k + 1}", 0.0) for k in range(3)] for card in ordered]
    ).reshape(-1, 3)
    rows = {number: row for row, number in enumerate(numbers.tolist())}
    in_system = [_inherited(card, 1, "CP", defaults) for card in ordered]
    grids = Grids(
        numbers, points.copy(), rows, {str(number): row for number, row in rows.items()}, {0: BASIC}
    )
    grids.repeated = repeated
    stated = _stated(frames)
    _resolve(stated, grids, in_system, ordered)
    for system in set(in_system) - {0}:
        own = np.flatnonzero(np.array(in_system) == system)
        if system not in grids.systems:
            raise ordered[own[0]].wrong(
                1, "CP", f"a coordinate system of the deck; there is no CORD {system}"
            )
        grids.places[own] = grids.systems[system].place(points[own])
    for row, card in enumerate(ordered):
        _constrain(grids, row, card, defaults)
    return grids


def _inherited(card: Card, index: int, what: str, defaults: Card | None) -> int:
    if card.text(index) or defaults is None:
        return card.integer(index, what, 0)
    return defaults.integer(index, what, 0)


def _constrain(grids: Grids, row: int, card: Card, defaults: Card | None) -> None:
    """Take a grid's CD and PS."""
    system = _inherited(card, 5, "CD", defaults)
    if system:
        if system not in grids.systems:
            raise card.wrong(5, "CD", f"a coordinate system of the deck; there is no CORD {system}")
        grids.displacement[row] = system
    source = card if card.text(6) or defaults is None else defaults
    if source.text(6):
        dofs = source.dofs(6, "PS")
        if dofs:
            grids.held[row] = (dofs, card)
    if card.integer(7, "SEID", 0):
        grids.superelements.append(card)


def _stated(frames: Iterable[Card]) -> dict[int, tuple[Card, int]]:
    """Each system's card, and the field where it begins: two CORD1R may share a card."""
    by_number: dict[int, tuple[Card, int]] = {}
    for card in frames:
        starts = [0] if card.name.startswith("CORD2") else [at for at in (0, 4) if card.text(at)]
        for at in starts or [0]:
            number = card.integer(at, "CID")
            if number <= 0:
                raise card.wrong(at, "CID", "a number above zero")
            if number in by_number:
                raise card.error(
                    f"the coordinate system {number} is there twice, first in"
                    f" {by_number[number][0].where}"
                )
            by_number[number] = (card, at)
    return by_number


def _resolve(
    stated: dict[int, tuple[Card, int]], grids: Grids, in_system: list[int], ordered: list[Card]
) -> None:
    """Build the systems in an order in which each finds those that it needs."""
    needs: dict[int, set[int]] = {}
    for number, (card, at) in stated.items():
        if card.name.startswith("CORD2"):
            needs[number] = {card.integer(1, "RID", 0)}
            unknown = needs[number] - {0, *stated}
            if unknown:
                raise card.wrong(
                    1, "RID", f"a coordinate system of the deck; there is no CORD {unknown.pop()}"
                )
        else:
            needs[number] = {in_system[grids.row(card, at + i, f"G{i}")] for i in (1, 2, 3)}
    try:
        order = list(TopologicalSorter(needs).static_order())
    except CycleError as error:
        circle = error.args[1]
        card = stated[circle[0]][0]
        raise card.error(
            f"coordinate systems refer to one another in a circle: {' → '.join(map(str, circle))}"
        ) from error
    for number in order:
        if number not in stated:
            if number:
                row = in_system.index(number)
                raise ordered[row].wrong(
                    1, "CP", f"a coordinate system of the deck; there is no CORD {number}"
                )
            continue
        card, at = stated[number]
        if card.name.startswith("CORD2"):
            values = [card.real(2 + k, f"{'ABC'[k // 3]}{k % 3 + 1}") for k in range(9)]
            corners = grids.systems[card.integer(1, "RID", 0)].place(np.array(values).reshape(3, 3))
        else:
            rows = [grids.row(card, at + i, f"G{i}") for i in (1, 2, 3)]
            corners = np.vstack(
                [grids.systems[in_system[row]].place(grids.places[row : row + 1]) for row in rows]
            )
        grids.systems[number] = _system(card, corners)


def _system(card: Card, corners: Floats) -> System:
    """The system with origin A, z through B, and x in the half plane of C."""
    origin, on_z, in_xz = corners
    z = on_z - origin
    y = np.cross(z, in_xz - origin)
    scale = np.linalg.norm(z) * np.linalg.norm(in_xz - origin)
    if not np.linalg.norm(y) > 1e-12 * scale or not np.isfinite(scale):
        raise card.error("the points A, B and C lie on a line; expected three that span a plane")
    z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
    return System(origin, np.array([np.cross(y, z), y, z]), _KINDS[card.name[5]])
