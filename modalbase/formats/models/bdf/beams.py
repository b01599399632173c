"""Bars, beams and rods."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modalbase.formats.models.bdf.card import Card
from modalbase.formats.models.bdf.deck import Deck
from modalbase.formats.models.bdf.sections import Property, Sections
from modalbase.formats.models.model import BeamSection, Elements, Floats

_RODS = {"CROD": (2, 3), "CTUBE": (2, 3), "CONROD": (1, 2)}
_ELEMENTS = ("CBAR", "CBEAM", *_RODS)
_DEFAULTS = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}


_Row = tuple[int, tuple[int, int], Card, Floats, Floats]
"""Of an element: number, rows of its ends, card, direction of axis 1, and offsets of its ends."""


class Beams:
    """Reader of beams.

    Attributes:
        sections: of the sets that elements use, by name.
    """

    def __init__(self, deck: Deck, extra: Mapping[int, float]) -> None:
        """Of a deck, and non-structural mass per length by property."""
        self.sections: dict[str, BeamSection] = {}
        self._deck, self._properties = deck, Sections(deck, extra)
        self._defaults = {element: card for element, name in _DEFAULTS.items() for card in deck.take(name)}

    def blocks(self) -> list[Elements]:
        """Elements by set, in the order in which these appear."""
        found: dict[str, list[_Row]] = {}
        for card in self._deck.elements(*_ELEMENTS):
            number = card.integer(0, "EID")
            own = self._property(card, number)
            self.sections[own.set] = own.section
            ends = _RODS.get(card.name, (2, 3))
            a, b = (self._deck.grids.row(card, index, f"G{end}") for index, end in zip(ends, "AB", strict=True))
            axis, offsets = self._rod(card, a, b) if card.name in _RODS else self._bar(card, own, a, b)
            found.setdefault(own.set, []).append((number, (a, b), card, axis, offsets))
        return [_block(name, rows) for name, rows in found.items()]

    def _property(self, card: Card, number: int) -> Property:
        if card.name == "CONROD":
            return self._properties.rod(card)
        default = self._defaults.get(card.name)
        if not card.text(1) and default is not None and default.text(1):
            number = default.integer(1, "PID")
        return self._properties.get(card, card.integer(1, "PID", number))

    def _rod(self, card: Card, a: int, b: int) -> tuple[Floats, Floats]:
        along = self._deck.grids.places[b] - self._deck.grids.places[a]
        size = _length(card, along)
        return np.cross(along / size, np.eye(3)[np.argmin(np.abs(along))]), np.zeros((2, 3))

    def _bar(self, card: Card, own: Property, a: int, b: int) -> tuple[Floats, Floats]:
        frames = self._deck.grids.axes(a), self._deck.grids.axes(b)
        default = self._defaults.get(card.name)
        source = card if any(map(card.text, (4, 5, 6))) or default is None else default
        kinds = (card.text(7) or (default.text(7) if default else "")) or "GGG"
        if len(kinds) != 3 or set(kinds) - set("GBOE"):
            kinds = "GGG"  # BIT of a beam is a number
        axis = self._orientation(card, source, a, frames[0] if kinds[0] == "G" else np.eye(3))
        along = self._deck.grids.places[b] - self._deck.grids.places[a]
        element = _axes(along, axis) if "O" in kinds[1:] or "E" in kinds[1:] else np.eye(3)
        arms = np.zeros((2, 3))
        if any(map(card.text, range(10, 16))):
            stated = [card.real(10 + k, f"W{k % 3 + 1}{'AB'[k // 3]}", 0.0) for k in range(6)]
            for end in (0, 1):
                frame = element if kinds[1 + end] in "OE" else frames[end] if kinds[1 + end] == "G" else np.eye(3)
                arms[end] = np.array(stated[3 * end : 3 * end + 3]) @ frame
        if any(card.text(index) not in ("", "0") for index in (8, 9)):
            self._deck.notes.add(card, f"{card.name} PA, PB", "a released end is not released here", True)
        return axis, _straight(card, own.centroid, along + arms[1] - arms[0], axis, arms)

    def _orientation(self, card: Card, source: Card, a: int, frame: Floats) -> Floats:
        """The direction v in the model's frame, from a grid G0 or by its components."""
        if source.is_integer(4) and not source.text(5) and not source.text(6):
            return np.asarray(
                self._deck.grids.places[self._deck.grids.row(source, 4, "G0")] - self._deck.grids.places[a]
            )
        if not any(map(source.text, (4, 5, 6))):
            raise card.wrong(4, "X1", "a direction X1, X2, X3 or a grid G0 for the section's plane 1")
        return np.array([source.real(4 + k, f"X{k + 1}", 0.0) for k in range(3)]) @ frame


def _straight(card: Card, centroid: tuple[float, float], along: Floats, axis: Floats, arms: Floats) -> Floats:
    """Offsets of the ends to the centroid of a bar whose axis 1 lies across it."""
    size = _length(card, along)
    across = np.cross(along / size, axis)
    if not np.linalg.norm(across) > 1e-8 * np.linalg.norm(axis) or not np.any(axis):
        raise card.error("the orientation vector is along the beam; give a direction across it", 4)
    _, y, z = _axes(along, axis)
    return np.asarray(arms + centroid[0] * y + centroid[1] * z)


def _length(card: Card, along: Floats) -> float:
    size = float(np.linalg.norm(along))
    if not size > 0:
        raise card.error("its length is zero; both ends are in one place")
    return size


def _axes(along: Floats, axis: Floats) -> Floats:
    """(3, 3) x, y and z of a bar, as rows."""
    x = along / (np.linalg.norm(along) or 1.0)
    y = axis - (axis @ x) * x
    y = y / (np.linalg.norm(y) or 1.0)
    return np.array([x, y, np.cross(x, y)])


def _block(name: str, rows: list[_Row]) -> Elements:
    numbers, nodes, cards, axes, arms = zip(*rows, strict=True)
    offsets = np.array(arms) if np.any(arms) else None
    lines, files = np.array([card.line for card in cards]), tuple(card.file for card in cards)
    first = np.array(numbers), np.array(nodes), name, np.array(axes), lines
    return Elements("beam2", *first, offsets=offsets, files=files)
