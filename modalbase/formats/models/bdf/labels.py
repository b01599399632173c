"""Names of sets from the comments that pre-processors write, safe as names of parameters."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from modalbase.formats.models.bdf.card import Card
from modalbase.formats.uff.text import decoded

_NUMBERED = (
    re.compile(r"\$\s*HMNAME\s+PROP\s+(\d{1,12})\s*\"([^\"]*)\""),
    re.compile(r"\$\s*ANSA_NAME(?:_COMMENT)?;(\d{1,12});P[A-Z]+;([^;]*)"),
    re.compile(r"\$\*?\s*Property\s*:\s*(\d{1,12})\s+name\s*:\s*(.*)", re.IGNORECASE),
    re.compile(r"\$\*?\s*Femap.*\bProperty\s+(\d{1,12})\s*:\s*(.*)", re.IGNORECASE),
)
_NEXT = (
    re.compile(r"\$\s*Elements and Element Properties for region\s*:\s*(.*)", re.IGNORECASE),
    re.compile(r"\$\s*Pset:\s*\"([^\"]*)\""),
    re.compile(r"\$\*?\s.*\bProperty\s*:\s*(.*)", re.IGNORECASE),
)
PLATES = ("PSHELL", "PCOMP", "PCOMPG")
PROFILES = ("PBAR", "PBARL", "PBEAM", "PBEAML", "PROD", "PTUBE")
"""Cards of properties: of shells; of bars, beams and rods."""

_LONGEST = 60


@dataclass
class Labels:
    """Names of properties; `hear` comments and `see` cards in their order."""

    numbered: dict[int, str] = field(default_factory=dict)
    following: dict[tuple[str, str], str] = field(default_factory=dict)
    _next: str = ""
    _given: dict[str, tuple[str, int]] = field(default_factory=dict)

    def hear(self, comment: str) -> None:
        """Take a name from a comment."""
        if '"' not in comment and ":" not in comment and ";" not in comment:
            return
        for pattern in _NUMBERED:
            if match := pattern.match(comment):
                self.numbered.setdefault(int(match.group(1)), _plain(match.group(2)))
                return
        for pattern in _NEXT:
            if match := pattern.match(comment):
                self._next = _plain(match.group(1))
                return

    def see(self, card: Card) -> None:
        """Give the next property the name that stood before it."""
        if self._next and card.name in (*PLATES, *PROFILES):
            self.following[card.name, card.text(0)] = self._next
            self._next = ""

    def of(self, card_name: str, number: int) -> str:
        """The set of a property: the name that the deck gives it, else `pshell_3`; no two alike."""
        own = f"{card_name.lower()}_{number}"
        name = self.following.get((card_name, str(number))) or self.numbered.get(number) or own
        owner = self._given.setdefault(name.lower(), (card_name, number))
        return name if owner == (card_name, number) else f"{name}_{number}"


def _plain(name: str) -> str:
    """A name of letters, digits and _ alone; empty where nothing is left."""
    return re.sub(r"\W+", "_", decoded(name.encode("latin-1"))).strip("_")[:_LONGEST]
