"""Bulk data to the neutral model."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf import beams, carried, held, materials, sections, shells
from modalbase.formats.models.bdf.card import Card, numbered
from modalbase.formats.models.bdf.case import Case, read_case
from modalbase.formats.models.bdf.frames import Grids, read_grids
from modalbase.formats.models.bdf.labels import Labels
from modalbase.formats.models.bdf.lines import Line, cards_of, split_deck
from modalbase.formats.models.bdf.unused import Notes, note_params, note_unused, refuse_solids
from modalbase.formats.models.check import check
from modalbase.formats.models.model import FiniteElementModel, Spring

_FRAMES = tuple(f"CORD{number}{kind}" for number in "12" for kind in "RCS")
_MATERIALS = ("MAT1", "MAT2", "MAT8", "MAT3", "MAT9", "MAT10")
_DIRECT = ("K2GG", "M2GG", "K2PP", "M2PP")


def read_bdf(content: bytes, included: Mapping[str, bytes] | None = None) -> FiniteElementModel:
    """A deck of Nastran, with executive and case control or of bulk data alone.

    Numbers stay in the deck's units, but masses and densities are multiplied by PARAM WTMASS, so that they belong to its
    lengths and forces.

    Args:
        content: the deck.
        included: files that it INCLUDEs, by name.

    Raises:
        FormatError: a card is wrong, in the words of the manual, with its line.
    """
    split = split_deck(content, included or {})
    labels, notes, cards = _sorted(cards_of(split.bulk))
    case = read_case(split.control)
    params = [*(card for card in cards_of(case.params) if isinstance(card, Card)), *cards.pop("PARAM", [])]
    note_params(params, notes)
    return _Reader(cards, case, labels, notes, _mass_factor(params)).model()


def _sorted(found: Iterable[Card | Line]) -> tuple[Labels, Notes, dict[str, list[Card]]]:
    """Cards by name, and the names that comments give."""
    labels, cards = Labels(), defaultdict(list)
    for one in found:
        if isinstance(one, Card):
            labels.see(one)
            cards[one.name].append(one)
        else:
            labels.hear(one.raw)
    return labels, Notes(), dict(cards)


def _mass_factor(params: Iterable[Card]) -> float:
    for card in params:
        if card.text(0) == "WTMASS":
            return card.positive(1, "V1")
    return 1.0


class _Reader:
    """Takes the cards that it reads from those of the deck; what stays is not used."""

    def __init__(
        self, cards: dict[str, list[Card]], case: Case, labels: Labels, notes: Notes, mass_factor: float
    ) -> None:
        self.cards, self.case, self.labels, self.notes, self.mass_factor = cards, case, labels, notes, mass_factor
        self.all = [card for group in cards.values() for card in group]
        defaults = self._take("GRDSET")
        grids = self._take("GRID")
        refuse_solids(cards)
        if not grids:
            raise FormatError("", "the deck has no GRID; expected Nastran bulk data")
        self.grids: Grids = read_grids(grids, defaults[0] if defaults else None, self._take(*_FRAMES))
        self.materials = materials.Materials(numbered(self._take(*_MATERIALS), "material", "MID"), mass_factor, notes)
        self.plates = self._take(*shells.PROPERTIES)
        self.profiles = {name: numbered(self._take(name), "property", "PID") for name in sections.PROPERTIES}

    def _take(self, *names: str) -> list[Card]:
        return [card for name in names for card in self.cards.pop(name, ())]

    def model(self) -> FiniteElementModel:
        """All of it."""
        of_shells, of_beams = self._properties()
        elements = sorted(
            [*of_shells.blocks(self._elements(*shells.LAYOUTS)), *of_beams.blocks(self._elements(*beams.ELEMENTS))],
            key=lambda block: int(block.lines[0]),
        )
        masses = carried.read_masses(self._elements("CONM2"), self.grids, self.mass_factor)
        links = held.read_links(self._elements("RBE2", "RBE3", "RBAR"), self.grids, self.notes)
        constraints = {name: self.cards.pop(name, []) for name in ("SPC", "SPC1", "SPCADD")}
        supports = held.read_supports(constraints, self.case, self.grids, self.notes)
        model = FiniteElementModel(
            "bdf",
            self.case.title,
            self.grids.numbers,
            self.grids.places,
            tuple(elements),
            {**of_shells.sections, **of_beams.sections},
            self.materials.found,
            node_axes={row: self.grids.axes(row) for row in self.grids.displacement},
            masses=tuple(masses),
            springs=tuple(self._springs()),
            links=tuple(links),
            supports=tuple(supports),
        )
        self._note_rest()
        check(model)
        return replace(model, ignored=self.notes.ignored())

    def _elements(self, *names: str) -> list[Card]:
        """Cards of elements, in the deck's order; numbers may not repeat among them."""
        found = self._take(*names)
        seen: dict[str, Card] = {}
        for card in found:
            if seen.setdefault(card.text(0), card) is not card:
                raise card.error(f"the element is there twice, first in line {seen[card.text(0)].line}", 0)
        return sorted(found, key=lambda card: card.line) if len(names) > 1 else found

    def _properties(self) -> tuple[shells.Shells, beams.Beams]:
        of_shells = numbered(self.plates, "property", "PID")
        known = {
            name: {number for number, card in of_shells.items() if card.name == name} for name in shells.PROPERTIES
        }
        known |= {name: set(cards) for name, cards in self.profiles.items()}
        apart = {name: self.cards.pop(name, []) for name in carried.SPREAD}
        per_area, per_length = carried.read_nonstructural(apart, self.case, known, self.mass_factor, self.notes)
        plates = shells.Shells(of_shells, self.materials, self.grids, self.labels, self.notes, per_area)
        profiles = sections.Sections(self.profiles, self.materials, self.labels, self.notes, per_length)
        defaults = {
            element: card for element, name in (("CBAR", "BAROR"), ("CBEAM", "BEAMOR")) for card in self._take(name)
        }
        return plates, beams.Beams(profiles, self.grids, self.notes, defaults)

    def _springs(self) -> Iterable[Spring]:
        bushes = numbered(self._take("PBUSH"), "property", "PID")
        springs = carried.Springs(self.grids, self.notes, carried.spring_properties(self._take("PELAS")), bushes)
        for card in self._elements("CELAS1", "CELAS2", "CBUSH"):
            yield from springs.bush(card) if card.name == "CBUSH" else springs.scalar(card)

    def _note_rest(self) -> None:
        """Note what was not read, or not as Nastran would."""
        if self.case.is_stated and self.case.number("MPC") is None:
            self._take("MPC", "MPCADD")
        for card in self.grids.superelements:
            self.notes.add(card, "GRID SEID", "superelements are read as one model")
        matrices = [name for name in _DIRECT if self.case.selected.get(name)]
        for card in self._take("DMIG"):
            loss = "stiffness and mass by matrices" if matrices else "matrices that the deck does not select"
            self.notes.add(card, "DMIG", f"{loss} are not used", bool(matrices))
        note_unused(self.cards, self.notes)
        for card in self.all:
            if card.integers_for_reals:
                self.notes.add(card, "integers for reals", "read as the same number; Nastran asks for a decimal point")
