"""What is lost of a deck, gathered by card and loss."""

from __future__ import annotations

from collections import defaultdict
from typing import Protocol

from modalbase.formats.models.model import Ignored


class Placed(Protocol):
    """What stands in a line: a card, or a row of one."""

    @property
    def line(self) -> int:
        """Where it begins."""


class Losses:
    """Cards that were not used, or not as their solver would."""

    def __init__(self) -> None:
        self._lines: defaultdict[tuple[str, str, bool], list[int]] = defaultdict(list)

    def add(self, where: Placed | int, card: str, loss: str, changes: bool = False) -> None:
        """Note a card, or a line of one, under a name."""
        self._lines[card, loss, changes].append(where if isinstance(where, int) else where.line)

    @property
    def found(self) -> tuple[Ignored, ...]:
        """All of it, what changes modes first."""
        every = [Ignored(card, tuple(lines), loss, changes) for (card, loss, changes), lines in self._lines.items()]
        return tuple(sorted(every, key=lambda each: not each.changes))
