"""A deck and its INCLUDE files to lines, and these to cards."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.card import Card, Row
from modalbase.formats.models.files import DEEPEST_INCLUDE, included_file, lines_of
from modalbase.formats.models.model import where

_SMALL = tuple(range(8, 72, 8))
_LARGE = tuple(range(8, 72, 16))
_QUOTED = re.compile(r"['\"]([^'\"]*)")


@dataclass(frozen=True, slots=True)
class Line:
    """A line: as it stands, and in capitals without its comment."""

    number: int
    file: str
    raw: str
    text: str


@dataclass
class Sections:
    """A deck's lines: control before BEGIN BULK, and bulk data up to ENDDATA."""

    control: list[Line] = field(default_factory=list)
    bulk: list[Line] = field(default_factory=list)


def split_deck(content: bytes, included: Mapping[str, bytes] | None) -> Sections:
    """The lines of a deck by section; a deck that has neither CEND nor BEGIN BULK is bulk data alone.

    INCLUDE files are left out where `included` is None.

    Raises:
        FormatError: the deck is not text, is cut, or an INCLUDE file is missing.
    """
    if b"\0" in content:
        raise FormatError("", "the file holds NUL bytes; expected the text of a Nastran deck")
    found = Sections()
    current = found.control
    controlled = ended = False
    for line in _lines(content, ("",), included, set()):
        word = line.text.replace(",", " ").split(None, 1)[:1]
        if word == ["ENDDATA"]:
            ended = True
            break
        begins = bool(word) and word[0].startswith("BEGI")
        if begins and current is found.control:
            current, controlled = found.bulk, True
        elif begins:
            raise FormatError(
                where(line.number, line.file), "a second BEGIN: superelements are not read; send the whole as one model"
            )
        else:
            controlled |= word == ["CEND"]
            current.append(line)
    if controlled and current is found.control:
        raise FormatError(_last(found.control), "the deck ends before BEGIN BULK; it seems to be cut")
    if not controlled:
        return Sections([], found.control)
    if not ended:
        place = _last(found.bulk or found.control)
        raise FormatError(
            place, "the deck ends without ENDDATA; it seems to be cut. Add the line ENDDATA if it is whole"
        )
    return found


def _last(lines: list[Line]) -> str:
    return where(lines[-1].number, lines[-1].file) if lines else ""


def _lines(
    content: bytes, within: tuple[str, ...], included: Mapping[str, bytes] | None, seen: set[str]
) -> Iterator[Line]:
    """Lines of a file with those of the files that it includes in their place; `within` names what leads to it."""
    raws, texts = lines_of(content), lines_of(content.upper())
    number, file = 0, within[-1]
    while number < len(raws):
        raw, text = raws[number], texts[number].split("$", 1)[0].rstrip()
        number += 1
        if not text.startswith("INCLUDE") and text.lstrip()[:8].rstrip() != "INCLUDE":
            if text or raw[:1] == "$":
                yield Line(number, file, raw, text.expandtabs(8) if "\t" in text else text)
            continue
        first, name = number, raw.strip()[7:]
        while name.count("'") == 1 and number < len(raws) and number < first + 10:  # a long path goes on
            name += raws[number].strip()
            number += 1
        if included is None:
            continue
        quoted = _QUOTED.search(name)
        name = (quoted.group(1) if quoted else name.partition("$")[0]).strip(" \t,=")
        inner = included_file(name, included)
        if inner is None:
            raise FormatError(where(first, file), f"INCLUDE {name!r} is not here; send that file with the deck")
        if inner in seen:
            raise FormatError(
                where(first, file), f"INCLUDE {name!r} stands for the second time; its cards would be there twice"
            )
        if len(within) > DEEPEST_INCLUDE:
            raise FormatError(
                where(first, file),
                f"INCLUDE {name!r} lies more than {DEEPEST_INCLUDE} files deep, which is the most that is read",
            )
        seen.add(inner)
        yield from _lines(included[inner], (*within, inner), included, seen)


def cards_of(lines: Iterable[Line]) -> Iterator[Card | Line]:
    """Cards in their order, whole, each after the comments that stand before it.

    Raises:
        FormatError: a continuation continues nothing, or a card has more fields than a line holds.
    """
    found: list[Card | Line] = []
    waiting: dict[str, Card] = {}
    strays: list[tuple[str, Line, list[str], str]] = []
    card: Card | None = None
    tail = ""
    for line in lines:
        text = line.text
        if not text:
            found.append(line)
            continue
        head, fields, mark = _fields(line)
        if head and head[0] not in "+*":
            name = head.rstrip("* ")
            if head[0] == "=":
                raise FormatError(where(line.number, line.file), "replication by = is not read; write the cards out")
            card = Card(name, fields, [Row(0, line.number, text, line.file)])
            found.append(card)
            tail = mark
            if mark:
                waiting[mark] = card
            continue
        own = head[1:].strip()
        if card is not None and (not own or own == tail or not tail):
            _continue(card, fields, line)
        elif own in waiting:
            card = waiting.pop(own)
            _continue(card, fields, line)
        else:
            strays.append((own, line, fields, mark))
            continue
        tail = mark
        if mark:
            waiting[mark] = card
    _join(strays, waiting)
    return iter(found)


def _join(strays: list[tuple[str, Line, list[str], str]], waiting: dict[str, Card]) -> None:
    """Continue cards by lines that stand before them."""
    while strays:
        fitting = [stray for stray in strays if stray[0] in waiting]
        if not fitting:
            own, line, _, _ = strays[0]
            place = where(line.number, line.file)
            raise FormatError(place, f"the continuation {f'+{own}' if own else line.text[:20]!r} continues no card")
        strays = [stray for stray in strays if stray[0] not in waiting]
        for own, line, fields, mark in fitting:
            if own not in waiting:
                raise FormatError(where(line.number, line.file), f"a second continuation +{own}")
            card = waiting.pop(own)
            _continue(card, fields, line)
            if mark:
                waiting[mark] = card


def _fields(line: Line) -> tuple[str, list[str], str]:
    """The name, the fields, and the name of the continuation without its mark."""
    text = line.text
    if "," in text:
        parts = [part.strip() for part in text.split(",")]
        count = 5 if "*" in parts[0] else 9
        if len(parts) > count + 1 and any(parts[count + 1 :]):
            message = f"{parts[0]} has {len(parts) - 1} fields; a line holds {count - 1}, and the rest goes on the next"
            raise FormatError(where(line.number, line.file), message)
        fields = parts[1:count]
        mark = parts[count] if len(parts) > count else ""
        if len(fields) < count - 1:
            fields += [""] * (count - 1 - len(fields))
        return parts[0], fields, mark.lstrip("+* ")
    head = text[:8].strip()
    starts, width = (_LARGE, 16) if "*" in head else (_SMALL, 8)
    fields = [text[at : at + width].strip() for at in starts]
    return head, fields, text[72:80].lstrip("+* ").rstrip()


def _continue(card: Card, fields: list[str], line: Line) -> None:
    width = len(fields)
    missing = -len(card.fields) % width
    card.fields += [""] * missing
    card.rows.append(Row(len(card.fields), line.number, line.text, line.file))
    card.fields += fields
