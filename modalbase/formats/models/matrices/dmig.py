"""Matrices as Nastran punches them: DMIG, with the grids where the punch has them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from modalbase.formats.models.bdf.card import Card
from modalbase.formats.models.bdf.frames import read_grids
from modalbase.formats.models.bdf.lines import cards_of, split_deck
from modalbase.formats.models.matrices.model import Entries, code
from modalbase.formats.models.model import Floats, Integers

_SQUARE, _SYMMETRIC = 1, 6


def read_dmig(content: bytes) -> tuple[dict[str, Entries], tuple[Integers, Floats] | None]:
    """Entries by the matrix's name, and numbers and places of the grids.

    Raises:
        FormatError: a card is wrong, with its line; a matrix is complex or not square; a grid has axes of its own.
    """
    cards = [card for card in cards_of(split_deck(content, None).bulk) if isinstance(card, Card)]
    heads: dict[str, bool] = {}
    found: dict[str, list[tuple[int, int, float]]] = {}
    for card in cards:
        if card.name != "DMIG":
            continue
        name = card.text(0)
        if card.text(1) == "0" and name not in heads:
            heads[name] = _is_half(card)
            found[name] = []
        elif name not in heads:
            raise card.wrong(0, "NAME", "a matrix whose header, with 0 in field 3, stands before")
        else:
            found[name] += _column(card)
    matrices = {name: _entries(rows, heads[name]) for name, rows in found.items()}
    return matrices, _places(cards)


def _is_half(card: Card) -> bool:
    form = card.integer(2, "IFO")
    if form not in (_SQUARE, _SYMMETRIC):
        raise card.wrong(2, "IFO", "1 or 6, a square or symmetric matrix")
    if card.integer(3, "TIN") not in (1, 2):
        raise card.wrong(3, "TIN", "1 or 2, real numbers")
    return form == _SYMMETRIC


def _column(card: Card) -> Iterable[tuple[int, int, float]]:
    """Codes of row and column, and value, of a card."""
    column = _dof(card, 1, "GJ")
    for at in range(4, len(card), 4):
        if card.text(at):
            yield _dof(card, at, "G"), column, card.real(at + 2, "A")


def _dof(card: Card, index: int, what: str) -> int:
    grid, component = card.integer(index, what), card.integer(index + 1, f"C of {what}", 0)
    if not 0 <= component <= 6:
        raise card.wrong(index + 1, f"C of {what}", "a component of 1 … 6")
    return int(code(np.int64(grid), np.int64(max(component, 1) - 1)))  # type: ignore[arg-type]


def _entries(rows: list[tuple[int, int, float]], is_half: bool) -> Entries:
    codes = np.array([row[:2] for row in rows], dtype=np.int64).reshape(-1, 2)
    values = np.array([row[2] for row in rows], dtype=float)
    return Entries(codes[:, 0], codes[:, 1], values, is_labelled=True, is_half=is_half)


def _places(cards: list[Card]) -> tuple[Integers, Floats] | None:
    own = [card for card in cards if card.name == "GRID"]
    if not own:
        return None
    defaults = next((card for card in cards if card.name == "GRDSET"), None)
    grids = read_grids(own, defaults, [card for card in cards if card.name[:5] in ("CORD1", "CORD2")])
    for row in grids.displacement:
        card = next(card for card in own if card.integer(0, "ID") == grids.numbers[row])
        raise card.wrong(5, "CD", "none: rows of the matrices must lie along the axes of the model")
    return grids.numbers, grids.places
