"""Non-structural mass that stands apart from the properties: NSM and NSM1."""

from __future__ import annotations

from collections.abc import Iterable

from modalbase.formats.models.bdf.card import Card, whole
from modalbase.formats.models.bdf.case import Case
from modalbase.formats.models.bdf.unused import Notes

_OF_SHELLS = ("PSHELL", "PCOMP", "PCOMPG")
_OF_BEAMS = ("PBAR", "PBARL", "PBEAM", "PBEAML", "PROD", "PTUBE")
CARDS = ("NSM", "NSM1", "NSML", "NSML1", "NSMADD")


def read_nonstructural(
    cards: dict[str, list[Card]], case: Case, known: dict[str, set[int]], mass_factor: float, notes: Notes
) -> tuple[dict[int, float], dict[int, float]]:
    """Mass per area by property of shells, and per length by property of beams, of the set that the case control selects.

    Args:
        cards: of the deck by name.
        case: its case control.
        known: numbers of properties by their cards' name.
        mass_factor: PARAM WTMASS.
        notes: what is lost.
    """
    shells: dict[int, float] = {}
    beams: dict[int, float] = {}
    selected = _selected(cards.get("NSMADD", ()), case)
    for card in (card for name in CARDS for card in cards.get(name, ())):
        if card.name == "NSMADD":
            continue
        if case.is_stated and card.integer(0, "SID") not in selected:
            notes.add(
                card, f"{card.name} of another set", "non-structural mass that the deck does not select is not used"
            )
            continue
        kind = card.text(1)
        if card.name.startswith("NSML") or kind not in (*_OF_SHELLS, *_OF_BEAMS):
            notes.add(card, card.name, f"non-structural mass by {kind or 'nothing'} is not used", True)
            continue
        target = shells if kind in _OF_SHELLS else beams
        for number, value in _values(card, known.get(kind, set())):
            target[number] = target.get(number, 0.0) + value * mass_factor
    return shells, beams


def _selected(joined: Iterable[Card], case: Case) -> set[int]:
    number = case.number("NSM")
    if number is None:
        return set()
    for card in joined:
        if card.integer(0, "SID") == number:
            return {whole(text) or 0 for _, text in card.words(1)}
    return {number}


def _values(card: Card, known: set[int]) -> list[tuple[int, float]]:
    """Number and mass of each property of a card."""
    if card.name == "NSM":
        return [(card.integer(at, "ID"), card.real(at + 1, "VALUE")) for at in range(2, len(card), 2) if card.text(at)]
    value = card.real(2, "VALUE")
    fields = list(card.words(3))
    if fields and fields[0][1] == "ALL":
        return [(number, value) for number in known]
    if len(fields) >= 3 and fields[1][1] == "THRU":
        low, high = card.integer(fields[0][0], "ID"), card.integer(fields[2][0], "ID")
        return [(number, value) for number in known if low <= number <= high]
    return [(card.integer(index, "ID"), value) for index, _ in fields]
