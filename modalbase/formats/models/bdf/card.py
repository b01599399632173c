"""One card of bulk data: its fields as numbers, each with its place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import Place, where

_REAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[ED][+-]?\d+|[+-]\d+)?")
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?")
_SHORT = re.compile(r"(?<=[\d.])(?=[+-])")
_LONGEST_INTEGER = 12
_LARGEST = 1e60  # beyond which a number is a slip in any unit, and its fourth power none


def number(text: str) -> float | None:
    """A real as Nastran writes it, `1.5`, `4.3-5`, `7.E+3`, `1.D3`; None where the text is none or beyond all sense."""
    if not _REAL.fullmatch(text):
        return None
    value = float(text if _PLAIN.fullmatch(text) else _SHORT.sub("E", text.replace("D", "E"), count=1))
    return value if abs(value) < _LARGEST else None


def whole(text: str) -> int | None:
    """An integer; None where the text is none."""
    digits = text[1:] if text[:1] in ("+", "-") else text
    return int(text) if digits.isdecimal() and digits.isascii() and len(digits) <= _LONGEST_INTEGER else None


@dataclass(slots=True)
class Row:
    """One line of a card.

    Attributes:
        start: the card's field that its first field is.
        line: from 1, of its file.
        text: the line in capitals, without its comment.
        file: of an INCLUDE, else empty.
    """

    start: int
    line: int
    text: str
    file: str

    @property
    def is_free(self) -> bool:
        """Whether commas part its fields."""
        return "," in self.text

    @property
    def is_large(self) -> bool:
        """Whether its fields have 16 columns."""
        return "*" in (self.text.split(",", 1)[0] if self.is_free else self.text[:8])

    def place(self, column: int) -> Place:
        """Where its field of a number from 0, the name not counted, stands."""
        if not self.is_free:
            width = 16 if self.is_large else 8
            return Place(self.line, 8 + width * column, 8 + width * (column + 1), self.file)
        parts = self.text.split(",")
        parts += [""] * (column + 2 - len(parts))
        start = sum(len(part) + 1 for part in parts[: column + 1])
        return Place(self.line, start, start + len(parts[column + 1]), self.file)


@dataclass(slots=True)
class Card:
    """One card.

    Attributes:
        name: in capitals, without the mark of large fields.
        fields: from the one behind the name; eight stand on a line of small fields.
        rows: its lines.
        integers_for_reals: fields that were read as reals although Nastran asks a decimal point of these.
    """

    name: str
    fields: list[str]
    rows: list[Row]
    integers_for_reals: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.fields)

    @property
    def line(self) -> int:
        """Where it begins."""
        return self.rows[0].line

    @property
    def file(self) -> str:
        """That it stands in; empty for the deck itself."""
        return self.rows[0].file

    def text(self, index: int) -> str:
        """A field; empty where there is none."""
        return self.fields[index] if index < len(self.fields) else ""

    def real(self, index: int, what: str, default: float | None = None) -> float:
        """A field as a real.

        Args:
            index: of the field, from 0 behind the name.
            what: the field's name in the manual.
            default: of an empty field; without any it must be given.
        """
        text = self.text(index)
        value = number(text) if text else default
        if value is None:
            raise self.wrong(index, what, "a real number such as 1.5 or 4.3-5")
        if text.isdecimal():
            self.integers_for_reals.append(index)
        return value

    def positive(self, index: int, what: str, default: float | None = None) -> float:
        """A field as a real above zero."""
        value = self.real(index, what, default)
        if not value > 0:
            raise self.wrong(index, what, "a number above zero")
        return value

    def integer(self, index: int, what: str, default: int | None = None) -> int:
        """A field as an integer."""
        text = self.text(index)
        value = whole(text) if text else default
        if value is None:
            raise self.wrong(index, what, "a whole number")
        return value

    def is_integer(self, index: int) -> bool:
        """Whether a field, which may hold a real too, holds an integer."""
        return whole(self.text(index)) is not None

    def dofs(self, index: int, what: str, default: str | None = None) -> tuple[int, ...]:
        """A field of components such as 1346 as dofs 0 … 5; component 0 is none."""
        text = self.text(index) or default
        if text is None or not text.isdecimal() or not set(text) <= set("0123456"):
            raise self.wrong(index, what, "components of 1 … 6 such as 123")
        return tuple(sorted({int(letter) - 1 for letter in text if letter != "0"}))

    def words(self, first: int) -> Iterator[tuple[int, str]]:
        """Index and text of each field from one on that is not empty."""
        return ((index, self.fields[index]) for index in range(first, len(self.fields)) if self.fields[index])

    def row(self, index: int) -> Row:
        """The line of a field."""
        return next((row for row in reversed(self.rows) if row.start <= index), self.rows[0])

    def has_room(self, index: int) -> bool:
        """Whether a line of it has room for a field."""
        row = self.row(index)
        return index - row.start < (4 if row.is_large else 8)

    def place(self, index: int) -> Place:
        """Where a field stands."""
        row = self.row(index)
        return row.place(index - row.start)

    @property
    def title(self) -> str:
        """Its name and number."""
        return f"{self.name} {self.text(0)}".rstrip()

    def error(self, message: str, index: int | None = None) -> FormatError:
        """An error at this card, or at one of its fields."""
        row = self.rows[0] if index is None else self.row(index)
        return FormatError(where(row.line, row.file), f"{self.title}: {message}")

    def wrong(self, index: int, what: str, expected: str) -> FormatError:
        """An error at a field that does not hold what it should."""
        text, field = self.text(index), index - self.row(index).start + 2
        found = f"is {text[:40]!r}" if text else "is empty"
        return self.error(f"{what} (field {field}) {found}, expected {expected}", index)


def numbered(cards: Iterable[Card], noun: str, field: str) -> dict[int, Card]:
    """Cards by the number in their first field.

    Raises:
        FormatError: a number stands twice.
    """
    found: dict[int, Card] = {}
    for card in cards:
        number = card.integer(0, field)
        if found.setdefault(number, card) is not card:
            raise card.error(f"the {noun} is there twice, first in line {found[number].line}", 0)
    return found
