"""Fields of a deck's lines, changed in place and in their own format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from textwrap import wrap

from modalbase.formats.models.bdf.card import Card, number

SMALL, LARGE = 8, 16
_REMARK = 70


def fitted(value: float, width: int) -> str:
    """A real in at most so many columns, as near to the value as these allow; it has a point, as Nastran asks."""
    best, distance = "", float("inf")
    for text in _candidates(value, width):
        found = number(text)
        if len(text) <= width and found is not None and abs(found - value) < distance:
            best, distance = text, abs(found - value)
    if not best:
        raise ValueError(f"{value} does not fit into {width} columns")
    return best


def _candidates(value: float, width: int) -> list[str]:
    """Fixed, then with an exponent, each from few digits to many."""
    fixed, exponential = [], []
    for digits in range(width):
        text = f"{value:.{digits}f}"
        text = text if "." in text else text + "."
        fixed.append(text.replace("0.", ".", 1) if text.lstrip("-").startswith("0.") and digits else text)
        mantissa, exponent = f"{value:.{digits}e}".split("e")
        mantissa = mantissa if "." in mantissa else mantissa + "."
        exponential.append(f"{mantissa}{int(exponent):+d}")
    return fixed + exponential


def has_field(card: Card, index: int) -> bool:
    """Whether a line of the card has room for a field."""
    row = max((row for row in card.rows if row.start <= index), key=lambda row: row.start)
    return index - row.start < (4 if row.is_large else 8)


@dataclass
class Edits:
    """Changes of a deck, line by line.

    Attributes:
        raws: its lines with their ends.
    """

    raws: list[str]
    _fields: dict[int, list[tuple[int, str, bool]]] = field(default_factory=dict)
    _before: dict[int, list[str]] = field(default_factory=dict)

    @classmethod
    def of(cls, content: bytes) -> Edits:
        """Of a deck without any changes."""
        return cls([line.decode("latin-1") for line in content.splitlines(keepends=True)])

    def real(self, card: Card, index: int, value: float) -> str:
        """Put a real into a field; gives its text."""
        text = fitted(value, self._width(card, index))
        self._put(card, index, text)
        return text

    def integer(self, card: Card, index: int, value: int) -> None:
        """Put an integer into a field."""
        self._put(card, index, str(value))

    def remark(self, card: Card, text: str) -> None:
        """Put a comment before a card."""
        self._before.setdefault(card.line, []).extend(f"$ {row}" for row in wrap(text, _REMARK))

    def _width(self, card: Card, index: int) -> int:
        row = max((row for row in card.rows if row.start <= index), key=lambda row: row.start)
        return LARGE if row.is_large else SMALL

    def _put(self, card: Card, index: int, text: str) -> None:
        row = max((row for row in card.rows if row.start <= index), key=lambda row: row.start)
        self._fields.setdefault(row.line, []).append((index - row.start, text, row.is_large))

    def result(self, header: Sequence[str], appended: Sequence[str], end: int | None) -> bytes:
        """The deck with its changes.

        Args:
            header: comments at its top.
            appended: lines to stand before a line.
            end: this line, from 1; None for the end of the deck.
        """
        first = self.raws[0] if self.raws else "\n"
        newline = first[len(first.rstrip("\r\n")) :] or "\n"
        found = [f"{line}{newline}" for line in header]
        for at, raw in enumerate(self.raws, start=1):
            found += [f"{line}{newline}" for line in (appended if at == end else ())]
            found += [f"{line}{newline}" for line in self._before.get(at, ())]
            found.append(self._line(raw, self._fields[at]) if at in self._fields else raw)
        if end is None and appended:
            if found and not found[-1].endswith(("\n", "\r")):
                found[-1] += newline
            found += [f"{line}{newline}" for line in appended]
        return "".join(found).encode("latin-1", "replace")

    def _line(self, raw: str, fields: Sequence[tuple[int, str, bool]]) -> str:
        body = raw.rstrip("\r\n")
        code, mark, comment = body.partition("$")
        rest = mark + comment + raw[len(body) :]
        for column, text, is_large in fields:
            code = _in_free(code, column, text) if "," in code else _in_columns(code, column, text, is_large)
        return code + rest


def _in_free(code: str, column: int, text: str) -> str:
    parts = code.split(",")
    parts += [""] * (column + 2 - len(parts))
    old = parts[column + 1]
    parts[column + 1] = old[: len(old) - len(old.lstrip())] + text
    return ",".join(parts)


def _in_columns(code: str, column: int, text: str, is_large: bool) -> str:
    width = LARGE if is_large else SMALL
    code = code.expandtabs(8)
    start = 8 + width * column
    old = code[start : start + width].ljust(width)
    new = text.ljust(width) if old[0] != " " or not old.strip() else text.rjust(width)
    rest = code[start + width :]
    return code[:start].ljust(start) + (new + rest if rest else new.rstrip())
