"""Bulk data to the neutral model."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from modalbase.formats.models.bdf.beams import Beams
from modalbase.formats.models.bdf.carried import Springs, nonstructural_masses, read_masses
from modalbase.formats.models.bdf.deck import BdfDeck, note_unread, note_unused
from modalbase.formats.models.bdf.held import read_equations, read_links, read_supports
from modalbase.formats.models.bdf.shells import Shells
from modalbase.formats.models.check import check, gathered, on_independent_nodes
from modalbase.formats.models.equations import links_of
from modalbase.formats.models.model import FiniteElementModel, IncompleteError

_DIRECT = ("K2GG", "M2GG", "K2PP", "M2PP", "A2GG")


def read_bdf(content: bytes, included: Mapping[str, bytes] | None = None) -> FiniteElementModel:
    """A deck of Nastran, with executive and case control or of bulk data alone.

    Numbers stay in the deck's units, but masses and densities are multiplied by PARAM WTMASS, so
    that they belong to its lengths and forces.

    Args:
        content: the deck.
        included: files that it INCLUDEs, by name.

    Raises:
        FormatError: a card is wrong, in the words of the manual, with its line.
    """
    deck = BdfDeck(content, included or {})
    note_unread(deck)
    try:
        model = _model(deck)
    except IncompleteError as error:
        raise error.after(deck.notes.skipped) from None
    check(model)
    return model


def _model(deck: BdfDeck) -> FiniteElementModel:
    """All that readers of its cards take, and what stays."""
    extra = nonstructural_masses(deck)
    shells, beams = Shells(deck, extra), Beams(deck, extra)
    elements = sorted([*shells.blocks(), *beams.blocks()], key=lambda block: int(block.lines[0]))
    places, axes = deck.grids.places, {row: deck.grids.axes(row) for row in deck.grids.displacement}
    equations = links_of(read_equations(deck), places, axes)
    links, springs = gathered([*read_links(deck), *equations, *beams.links]), Springs(deck)
    last, nodes = int(deck.grids.numbers[-1]), np.vstack([places, *beams.ends])
    model = FiniteElementModel(
        "bdf",
        deck.case.title,
        np.append(deck.grids.numbers, last + 1 + np.arange(len(beams.ends))),
        nodes,
        tuple(elements),
        {**shells.sections, **beams.sections},
        deck.materials.by_name,
        node_axes=axes,
        links=links,
        supports=tuple(on_independent_nodes(read_supports(deck), links, nodes)),
        springs=tuple(springs.read()),
        masses=(*read_masses(deck), *springs.masses),
    )
    _note_rest(deck)
    return replace(model, ignored=deck.notes.skipped)


def _note_rest(deck: BdfDeck) -> None:
    """Note what was not read, or not as Nastran would."""
    for card in deck.grids.repeated:
        deck.notes.add(card, "grid_twice")
    for card in deck.grids.superelements:
        deck.notes.add(card, "superelement")
    if "STATSUB" in deck.case.places:
        deck.notes.add(deck.case.places["STATSUB"], "prestress_of_subcase")
    matrices = any(deck.case.selected.get(name) for name in _DIRECT)
    for card in deck.take("DMIG"):
        deck.notes.add(card, "dmig" if matrices else "dmig_not_selected")
    note_unused(deck)
    for card in deck.all:
        if card.integers_for_reals:
            deck.notes.add(card, "integers_for_reals")
