"""Case control: which sets of a deck hold."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from modalbase.formats.models.bdf.card import Line
from modalbase.formats.uff.text import decoded

_ORDER = re.compile(r"\s*([A-Z0-9]+)\s*(?:\([^)]*\))?\s*=\s*(.*?)\s*$")
_SELECTORS = ("SPC", "MPC", "NSM", "METHOD", "K2GG", "M2GG", "B2GG", "K2PP", "M2PP", "STATSUB", "TEMPERATURE", "A2GG")


@dataclass
class Case:
    """What the subcase of the modes selects.

    Attributes:
        is_stated: whether there is any case control; a deck of bulk data alone selects nothing.
        title: of the deck.
        selected: sets by the name of the order, such as `SPC`.
        others: other sets of the same kind that further subcases select, with the line.
        params: lines PARAM of the case control.
    """

    is_stated: bool = False
    title: str = ""
    selected: dict[str, str] = field(default_factory=dict)
    others: dict[str, list[tuple[str, int]]] = field(default_factory=dict)
    params: list[Line] = field(default_factory=list)

    def number(self, order: str) -> int | None:
        """The set that an order selects."""
        text = self.selected.get(order, "")
        return int(text) if text.isdecimal() and text.isascii() and len(text) < 12 else None


def read_case(lines: Sequence[Line]) -> Case:
    """The case control of the lines before BEGIN BULK.

    Orders above the first subcase hold in all. Of several subcases the first with a METHOD of its own is taken, else the
    first; what others select instead is noted.
    """
    found = Case(is_stated=bool(lines))
    common: dict[str, tuple[str, int]] = {}
    subcases: list[dict[str, tuple[str, int]]] = []
    for line in lines:
        text = line.text
        if text.lstrip().startswith("SUBCASE"):
            subcases.append({})
            continue
        if text.replace(",", " ").split(None, 1)[:1] == ["PARAM"]:
            found.params.append(line)
            continue
        match = _ORDER.match(text)
        if match is None:
            continue
        order, value = match.groups()
        if order == "TITLE" and not found.title:
            found.title = decoded(line.raw.partition("=")[2].encode("latin-1"))[:200]
        for name in _SELECTORS:
            if order == name or (len(order) >= 4 and name.startswith(order)):
                (subcases[-1] if subcases else common)[name] = (value, line.number)
    chosen = next((case for case in subcases if "METHOD" in case), subcases[0] if subcases else {})
    found.selected = {name: value for name, (value, _) in {**common, **chosen}.items()}
    for case in subcases:
        for name, (value, number) in case.items():
            if value != found.selected.get(name):
                found.others.setdefault(name, []).append((value, number))
    return found
