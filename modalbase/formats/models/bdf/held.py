"""Rigid elements and constraints."""

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from modalbase.formats.models.bdf.card import Card, whole
from modalbase.formats.models.bdf.deck import BdfDeck
from modalbase.formats.models.bdf.frames import BASIC, Grids
from modalbase.formats.models.equations import Equation, Term
from modalbase.formats.models.model import ALL_DOFS, Floats, Link, Support, Where


def listed(card: Card, first: int, grids: Grids, what: str) -> Iterator[int]:
    """Rows of the grids that fields list from one on, `7`, `1 THRU 9`; ends at a field that is no
    grid, such as ALPHA.

    Of a range those count that are there, as Nastran has it.
    """
    fields = list(card.words(first))
    at = 0
    while at < len(fields):
        index, text = fields[at]
        if whole(text) is None:
            if at == len(fields) - 1 and at > 0:
                return
            raise card.wrong(index, what, "a grid's number or THRU")
        rows, taken = _span(card, fields[at : at + 3], grids, what)
        yield from rows
        at += taken


def _span(
    card: Card, fields: list[tuple[int, str]], grids: Grids, what: str
) -> tuple[Iterable[int], int]:
    """Rows of the grid, or of the range, that begins a list of fields, and how many of these it
    takes.
    """
    index = fields[0][0]
    if len(fields) < 3 or fields[1][1] != "THRU":
        return [grids.row(card, index, what)], 1
    low, high = card.integer(index, what), card.integer(fields[2][0], what)
    if high < low:
        raise card.wrong(fields[2][0], what, f"a number above {low}, where the range begins")
    return range(*np.searchsorted(grids.numbers, [low, high + 1]).tolist()), 3


def _turned(grids: Grids, row: int, dofs: tuple[int, ...]) -> Floats | None:
    """Axes of a grid's own; None where they are the model's, or all dofs of a kind are meant."""
    if row not in grids.displacement:
        return None
    kinds = {dof // 3 for dof in dofs}
    if all({3 * kind, 3 * kind + 1, 3 * kind + 2} <= set(dofs) for kind in kinds):
        return None
    axes = grids.axes(row)
    return None if np.allclose(axes, BASIC.axes, atol=1e-12) else axes


def read_links(deck: BdfDeck) -> Iterator[Link]:
    """RBE2, RBE3, RBAR, and RBE1 that one grid leads."""
    for card in deck.elements(*_READERS):
        card.integer(0, "EID")
        yield from _READERS[card.name](card, deck)


def _rbe2(card: Card, deck: BdfDeck) -> Iterator[Link]:
    grids = deck.grids
    independent, dofs = grids.row(card, 1, "GN"), card.dofs(2, "CM")
    rows = dict.fromkeys(listed(card, 3, grids, "GM"))
    if not rows:
        raise card.wrong(3, "GM1", "a grid that is led")
    for row in rows:
        yield Link(row, (independent,), dofs, card.where, axes=_turned(grids, row, dofs))


def _rbar(card: Card, deck: BdfDeck) -> Iterator[Link]:
    grids = deck.grids
    ends = grids.row(card, 1, "GA"), grids.row(card, 2, "GB")
    lead = [card.dofs(3 + k, name, "0") for k, name in enumerate(("CNA", "CNB"))]
    for independent, dependent, index in ((0, 1, 6), (1, 0, 5)):
        if lead[independent] == ALL_DOFS and not lead[dependent]:
            dofs = card.dofs(index, "CM", "123456") or ALL_DOFS
            yield Link(
                ends[dependent],
                (ends[independent],),
                dofs,
                card.where,
                axes=_turned(grids, ends[dependent], dofs),
            )
            return
    # six dofs of both ends that lead all the others say the same: both move as one body
    if len(lead[0]) + len(lead[1]) == len(ALL_DOFS) and not any(map(card.text, (5, 6))):
        yield Link(ends[1], (ends[0],), ALL_DOFS, card.where)
        return
    deck.notes.add(card, "rbar")


def _rbe3(card: Card, deck: BdfDeck) -> Iterator[Link]:
    grids = deck.grids
    node, dofs = grids.row(card, 2, "REFGRID"), card.dofs(3, "REFC")
    weights: dict[int, float] = {}
    weight, expects = 0.0, "weight"
    fields = list(card.words(4))
    at = 0
    while at < len(fields):
        index, text = fields[at]
        at += 1
        if text in ("UM", "ALPHA"):
            break
        if whole(text) is None or expects == "weight":
            weight, expects = card.real(index, "WT"), "component"
        elif expects == "component":
            components = card.dofs(index, "C")
            expects = "grid"
            if not {0, 1, 2} <= set(components):
                deck.notes.add(card, "rbe3_components")
            elif len(components) > 3:
                deck.notes.add(card, "rbe3_rotations")
        else:
            rows, taken = _span(card, fields[at - 1 : at + 2], grids, "G")
            at += taken - 1
            for row in rows:
                weights[row] = weights.get(row, 0.0) + weight
    if not weights or not min(weights.values()) > 0:
        raise card.error("it has no leaders with a weight above zero")
    values = tuple(weights.values())
    equal = len(set(values)) == 1
    yield Link(
        node, tuple(weights), dofs, card.where, () if equal else values, _turned(grids, node, dofs)
    )


def _rbe1(card: Card, deck: BdfDeck) -> Iterator[Link]:
    grids = deck.grids
    fields = [(index, text) for index, text in card.words(1) if text != "ALPHA"]
    at = next((k for k, (_, text) in enumerate(fields) if text == "UM"), len(fields))
    dependent = fields[at + 1 :]
    dependent = dependent[: len(dependent) // 2 * 2]  # without a coefficient of expansion
    if at != 2 or card.dofs(fields[1][0], "CN1") != ALL_DOFS or not dependent:
        deck.notes.add(card, "rbe1")
        return
    leader = grids.row(card, fields[0][0], "GN1")
    for (index, _), (component, _) in zip(dependent[::2], dependent[1::2], strict=True):
        row, dofs = grids.row(card, index, "GM"), card.dofs(component, "CM")
        yield Link(row, (leader,), dofs, card.where, axes=_turned(grids, row, dofs))


_READERS = {"RBE2": _rbe2, "RBE3": _rbe3, "RBAR": _rbar, "RBE1": _rbe1}


def read_supports(deck: BdfDeck) -> list[Support]:
    """Constraints of the set that holds, and those that grids state themselves."""
    grids, cards = deck.grids, deck.take("SPC", "SPC1")
    holding = _holding(deck, "SPC", cards)
    rows: dict[tuple[Where, tuple[int, ...]], list[int]] = {}
    single: dict[tuple[int, ...], Where] = {}  # of SPC, of which pre-processors write one a grid
    for card in cards:
        if card.integer(0, "SID") not in holding:
            deck.notes.add(card, "set_not_selected", card.name)
        elif card.name == "SPC":
            for at in (1, 4):
                if at == 1 or card.text(at):
                    row, dofs = grids.row(card, at, "G"), card.dofs(at + 1, "C", "0")
                    rows.setdefault((single.setdefault(dofs, card.where), dofs), []).append(row)
        else:
            rows.setdefault((card.where, card.dofs(1, "C", "0")), []).extend(
                listed(card, 2, grids, "G")
            )
    first: dict[tuple[int, ...], Where] = {}
    for row, (dofs, card) in grids.held.items():
        rows.setdefault((first.setdefault(dofs, card.where), dofs), []).append(row)
    return [
        support
        for (where, dofs), own in rows.items()
        if dofs
        for support in _by_frame(grids, own, dofs, where)
    ]


def _by_frame(
    grids: Grids, rows: list[int], dofs: tuple[int, ...], where: Where
) -> Iterator[Support]:
    """Nodes that are held in the model's frame together, others by themselves."""
    plain = []
    for row in rows:
        axes = _turned(grids, row, dofs)
        if axes is None:
            plain.append(row)
        else:
            yield Support(np.array([row]), dofs, where, axes)
    if plain:
        yield Support(np.array(plain, dtype=np.int64), dofs, where)


def read_equations(deck: BdfDeck) -> Iterator[Equation]:
    """MPC of the set that holds; those between scalar points too are noted."""
    grids, cards = deck.grids, deck.take("MPC")
    holding = _holding(deck, "MPC", cards)
    for card in cards:
        if card.integer(0, "SID") not in holding:
            deck.notes.add(card, "set_not_selected", card.name)
            continue
        at = [start for start in range(1, len(card), 8) if card.text(start)]
        terms = [
            _term(grids, card, first)
            for start in at
            for first in (start, start + 3)
            if card.text(first)
        ]
        if not terms or not terms[0].factor:
            raise card.wrong(3, "A1", "a coefficient that is not zero, of the dof that depends")
        yield Equation(card.where, terms)


def _term(grids: Grids, card: Card, at: int) -> Term:
    dofs = card.dofs(at + 1, "C")
    if len(dofs) != 1:
        raise card.wrong(at + 1, "C", "one component of 1 … 6")
    return Term(grids.row(card, at, "G"), dofs[0], card.real(at + 2, "A"))


def _holding(deck: BdfDeck, order: str, cards: list[Card]) -> set[int]:
    """Numbers of the sets that hold, with those that an SPCADD or MPCADD joins."""
    case, notes, joining = deck.case, deck.notes, deck.take(f"{order}ADD")
    joined: dict[int, list[Card]] = defaultdict(list)
    for card in joining:
        joined[card.integer(0, "SID")].append(card)
    stated = {card.integer(0, "SID") for card in cards}
    for value, where in case.others.get(order, ()):
        known = case.selected.get(order, "none")
        notes.add(where, "set_of_subcase", order, selected=known, other=value)
    selected = case.number(order)
    if selected is None:
        if case.is_stated or not stated:
            return set()
        if len(joined) == 1:
            selected = next(iter(joined))
        elif len(stated) == 1:
            return stated
        else:
            names = ", ".join(map(str, sorted(stated)))
            notes.add(cards[0], "sets_not_selected", order, sets=names)
            return stated
    by = {whole(text) or 0: card for card in joined[selected] for _, text in card.words(1)}
    holding = set(by) or {selected}
    for missing in sorted(holding - stated):
        who = f"{by[missing].title} joins" if by else "the case control selects"
        notes.add(by.get(missing, Where(1)), "set_missing", order, who=who, missing=missing)
    return holding
