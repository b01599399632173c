"""Lines of a deck to cards, whose fields are numbers with their places."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.lines import Line
from modalbase.formats.models.model import FieldPlace, Where

_REAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[ED][+-]?\d+|[+-]\d+)?")
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?")
_SHORT = re.compile(r"(?<=[\d.])(?=[+-])")
_LONGEST_INTEGER = 12
_LARGEST = 1e60  # beyond which a number is a slip in any unit, and its fourth power none


def number(text: str) -> float | None:
    """A real as Nastran writes it, `1.5`, `4.3-5`, `7.E+3`, `1.D3`; None where the text is none or
    beyond all sense.
    """
    if not _REAL.fullmatch(text):
        return None
    value = float(
        text if _PLAIN.fullmatch(text) else _SHORT.sub("E", text.replace("D", "E"), count=1)
    )
    return value if abs(value) < _LARGEST else None


def whole(text: str) -> int | None:
    """An integer; None where the text is none."""
    digits = text[1:] if text[:1] in ("+", "-") else text
    return (
        int(text)
        if digits.isdecimal() and digits.isascii() and len(digits) <= _LONGEST_INTEGER
        else None
    )


@dataclass(slots=True)
class CardLine:
    """One line of a card."""

    start: int  # the card's field that its first field is
    text: str  # the line in capitals, without its comment
    where: Where

    @property
    def is_free(self) -> bool:
        """Whether commas part its fields."""
        return "," in self.text

    @property
    def is_large(self) -> bool:
        """Whether its fields have 16 columns."""
        return "*" in (self.text.split(",", 1)[0] if self.is_free else self.text[:8])

    def place(self, column: int) -> FieldPlace:
        """Where its field of a number from 0, the name not counted, stands."""
        if not self.is_free:
            width = 16 if self.is_large else 8
            return FieldPlace(
                self.where.line, 8 + width * column, 8 + width * (column + 1), self.where.file
            )
        parts = self.text.split(",")
        parts += [""] * (column + 2 - len(parts))
        start = sum(len(part) + 1 for part in parts[: column + 1])
        return FieldPlace(self.where.line, start, start + len(parts[column + 1]), self.where.file)


@dataclass(slots=True)
class Card:
    """One card."""

    name: str  # in capitals, without the mark of large fields
    fields: list[str]  # from the one behind the name; eight stand on a line of small fields
    rows: list[CardLine]  # its lines
    # fields that were read as reals although Nastran asks a decimal point of these
    integers_for_reals: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.fields)

    @property
    def where(self) -> Where:
        """Where it begins."""
        return self.rows[0].where

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

    def positive(self, index: int, what: str) -> float:
        """A field as a real above zero."""
        value = self.real(index, what)
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
        text = self.text(index).replace(" ", "") or default
        if text is None or not text.isdecimal() or not set(text) <= set("0123456"):
            raise self.wrong(index, what, "components of 1 … 6 such as 123")
        return tuple(sorted({int(letter) - 1 for letter in text if letter != "0"}))

    def words(self, first: int) -> Iterator[tuple[int, str]]:
        """Index and text of each field from one on that is not empty."""
        return (
            (index, self.fields[index])
            for index in range(first, len(self.fields))
            if self.fields[index]
        )

    def row(self, index: int) -> CardLine:
        """The line of a field."""
        return next((row for row in reversed(self.rows) if row.start <= index), self.rows[0])

    def has_room(self, index: int) -> bool:
        """Whether a line of it has room for a field."""
        row = self.row(index)
        return index - row.start < (4 if row.is_large else 8)

    def place(self, index: int) -> FieldPlace:
        """Where a field stands."""
        row = self.row(index)
        return row.place(index - row.start)

    @property
    def content(self) -> tuple[str | float, ...]:
        """Its fields, numbers by their values; empty ones at the end do not count."""
        filled = max((index + 1 for index, _ in self.words(0)), default=0)
        return tuple(
            text if (value := number(text)) is None else value for text in self.fields[:filled]
        )

    @property
    def title(self) -> str:
        """Its name and number."""
        return f"{self.name} {self.text(0)}".rstrip()

    def error(self, message: str, index: int | None = None) -> FormatError:
        """An error at this card, or at one of its fields."""
        row = self.rows[0] if index is None else self.row(index)
        return FormatError(str(row.where), f"{self.title}: {message}")

    def wrong(self, index: int, what: str, expected: str) -> FormatError:
        """An error at a field that does not hold what it should."""
        text, field = self.text(index), index - self.row(index).start + 2
        actual = f"is {text[:40]!r}" if text else "is empty"
        return self.error(f"{what} (field {field}) {actual}, expected {expected}", index)


def numbered(cards: Iterable[Card], noun: str, field: str) -> dict[int, Card]:
    """Cards by the number in their first field.

    Raises:
        FormatError: a number stands twice.
    """
    by_number: dict[int, Card] = {}
    for card in cards:
        number = card.integer(0, field)
        if by_number.setdefault(number, card) is not card:
            raise card.error(f"the {noun} is there twice, first in {by_number[number].where}", 0)
    return by_number


_SMALL = tuple(range(8, 72, 8))
_MOST_COMMAS = 10  # of a line of fields; more are prose
_NAME = 16  # letters of a name with its star or of a continuation, and some to spare
_LARGE = tuple(range(8, 72, 16))
_PROSE = re.compile(r"\s*DEQATN\b")
"""Cards of text that no commas part into fields."""
_CARD = re.compile(r"\s{1,7}[A-Z][A-Z0-9]*\*?\s*(,|\s\d|$)")
"""A card that begins behind blanks."""


def cards_of(lines: Sequence[Line]) -> Iterator[Card | Line]:
    """Cards in their order, whole, each after the comments that stand before it.

    Raises:
        FormatError: a continuation continues nothing, or a card has more fields than a line holds.
    """
    cards: list[Card | Line] = []
    waiting: dict[str, Card] = {}
    orphans: list[tuple[str, Line, list[str], str]] = []
    card: Card | None = None
    tail = ""

    @cache
    def names() -> set[str]:
        return {
            _joint(_fields(line)[2])
            for line in lines
            if line.text and line.text.count(",") < _MOST_COMMAS
        }

    for line in lines:
        text = line.text
        if not text:
            cards.append(line)
            continue
        if _PROSE.match(text):
            card = Card(
                "DEQATN", [text.lstrip()[8:16].strip(" ,")], [CardLine(0, text, line.where)]
            )
            cards.append(card)
            continue
        if (
            card is not None
            and _PROSE.match(card.name)
            and text[0] in "+*, "
            and not _CARD.match(text)
        ):
            card.rows.append(CardLine(len(card), text, line.where))
            continue
        head, fields, mark = _fields(line)
        if head and head[0] not in "+*":
            name = head.rstrip("* ")
            if head[0] == "=":
                raise FormatError(
                    str(line.where), "replication by = is not read; write the cards out"
                )
            card = Card(name, fields, [CardLine(0, text, line.where)])
            cards.append(card)
            tail = mark
            if _joint(mark):
                waiting[_joint(mark)] = card
            continue
        own = head[1:].strip()
        if card is not None and (not own or own in (_joint(tail), tail)):
            _continue(card, fields, line)
        elif own in waiting:
            card = waiting.pop(own)
            _continue(card, fields, line)
        elif card is not None and not _joint(tail) and own not in names():
            _continue(card, fields, line)
        else:
            orphans.append((own, line, fields, mark))
            continue
        tail = mark
        if _joint(mark):
            waiting[_joint(mark)] = card
    _join(orphans, waiting)
    return iter(cards)


def _join(orphans: list[tuple[str, Line, list[str], str]], waiting: dict[str, Card]) -> None:
    """Continue cards by lines that stand before them."""
    while orphans:
        fitting = [orphan for orphan in orphans if orphan[0] in waiting]
        if not fitting:
            own, line, _, _ = orphans[0]
            place = str(line.where)
            named = f"+{own}" if own else line.text[:20]
            raise FormatError(
                place,
                f"the continuation {named!r} continues no card; behind its first character it has"
                " to be as field 10 of one",
            )
        orphans = [orphan for orphan in orphans if orphan[0] not in waiting]
        for own, line, fields, mark in fitting:
            if own not in waiting:
                raise FormatError(str(line.where), f"a second continuation +{own}")
            card = waiting.pop(own)
            _continue(card, fields, line)
            if _joint(mark):
                waiting[_joint(mark)] = card


def _joint(mark: str) -> str:
    """The name of a continuation in the last field of a line, whose first character does not
    count.
    """
    return mark[1:].lstrip("+* ")


def _fields(line: Line) -> tuple[str, list[str], str]:
    """The name, the fields, and the field that names the continuation."""
    text = line.text
    if "," in text:
        parts = [part.strip() for part in text.split(",")]
        count = 5 if "*" in parts[0] else 9
        if len(parts) > count + 1 and any(parts[count + 1 :]):
            message = (
                f"{parts[0]} has {len(parts) - 1} fields; a line holds {count - 1}, and the rest"
                " goes on the next"
            )
            raise FormatError(str(line.where), message)
        fields = parts[1:count]
        mark = parts[count] if len(parts) > count else ""
        if len(fields) < count - 1:
            fields += [""] * (count - 1 - len(fields))
        if len(parts[0]) > _NAME:
            message = (
                f"no card has the name {parts[0][:40]!r}; commas part fields, so a decimal comma"
                " has to be a point"
            )
            raise FormatError(str(line.where), message)
        return parts[0], fields, mark
    head = text[:8].strip()
    starts, width = (_LARGE, 16) if "*" in head else (_SMALL, 8)
    fields = [text[at : at + width].strip() for at in starts]
    return head, fields, text[72:80].rstrip()


def _continue(card: Card, fields: list[str], line: Line) -> None:
    width = len(fields)
    missing = -len(card.fields) % width
    if missing and any(fields):
        raise FormatError(
            str(line.where), "the second half of a line of large fields begins with *"
        )
    card.fields += [""] * missing
    card.rows.append(CardLine(len(card.fields), line.text, line.where))
    card.fields += fields
