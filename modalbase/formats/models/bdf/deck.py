"""A deck's cards, and what all readers of them need."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.card import Card, numbered
from modalbase.formats.models.bdf.case import read_case
from modalbase.formats.models.bdf.frames import Grids, read_grids
from modalbase.formats.models.bdf.labels import PLATES, PROFILES, Labels
from modalbase.formats.models.bdf.lines import cards_of, split_deck
from modalbase.formats.models.bdf.materials import Materials
from modalbase.formats.models.bdf.unused import note_params, refuse_solids
from modalbase.formats.models.losses import Losses

_FRAMES = tuple(f"CORD{number}{kind}" for number in "12" for kind in "RCS")
_MATERIALS = ("MAT1", "MAT2", "MAT8", "MAT3", "MAT9", "MAT10")


class Deck:
    """A deck whose readers take the cards that they read; what stays is not used.

    Attributes:
        case: which sets hold.
        labels: names of sets.
        notes: what is lost.
        mass_factor: PARAM WTMASS, by which masses and densities are multiplied.
        grids, materials: of the deck.
        plates: properties of shells by number.
        profiles: properties of bars, beams and rods by kind of card and number.
    """

    def __init__(self, content: bytes, included: Mapping[str, bytes]) -> None:
        split = split_deck(content, included)
        self.labels, self.notes = Labels(), Losses()
        self.cards: dict[str, list[Card]] = defaultdict(list)
        for one in cards_of(split.bulk):
            if isinstance(one, Card):
                self.labels.see(one)
                self.cards[one.name].append(one)
            else:
                self.labels.hear(one.raw)
        self.case = read_case(split.control)
        params = [*(card for card in cards_of(self.case.params) if isinstance(card, Card)), *self.take("PARAM")]
        note_params(params, self.notes)
        self.mass_factor = next((card.positive(1, "V1") for card in params if card.text(0) == "WTMASS"), 1.0)
        self.all = [card for group in self.cards.values() for card in group]
        defaults, grids = self.take("GRDSET"), self.take("GRID")
        refuse_solids(self.cards)
        if not grids:
            raise FormatError("", "the deck has no GRID; expected Nastran bulk data")
        self.grids: Grids = read_grids(grids, defaults[0] if defaults else None, self.take(*_FRAMES))
        materials = numbered(self.take(*_MATERIALS), "material", "MID")
        self.materials = Materials(materials, self.mass_factor, self.notes)
        plates = self.take(*PLATES)
        self.profiles = {name: numbered(self.take(name), "property", "PID") for name in PROFILES}
        self.plates = numbered(plates, "property", "PID")

    def take(self, *names: str) -> list[Card]:
        """Cards of these names, which no other reader gets."""
        return [card for name in names for card in self.cards.pop(name, ())]

    def elements(self, *names: str) -> list[Card]:
        """Cards of elements, in the deck's order; numbers may not repeat among them."""
        found = self.take(*names)
        seen: dict[str, Card] = {}
        for card in found:
            if seen.setdefault(card.text(0), card) is not card:
                raise card.error(f"the element is there twice, first in line {seen[card.text(0)].line}", 0)
        return sorted(found, key=lambda card: card.line) if len(names) > 1 else found
