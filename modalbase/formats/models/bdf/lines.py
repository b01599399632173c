"""A deck and its INCLUDE files to lines, and these to its sections."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from modalbase.formats.errors import FormatError
from modalbase.formats.foreign import require_text
from modalbase.formats.models.files import DEEPEST_INCLUDE, included_file, lines_of
from modalbase.formats.models.model import Where

_CONTROL = re.compile(
    r"\s*(SOL\s+\w+|CEND|(SPC|METHOD|SUBCASE|LOAD|DISP\w*(\([^)]*\))?|MPC)\s*=.*|SUBCASE\s+\d+)\s*$"
)
"""An order of executive or case control."""
_QUOTED = re.compile(r"['\"]([^'\"]*)")


@dataclass(frozen=True, slots=True)
class Line:
    """A line: as it stands, and in capitals without its comment."""

    where: Where
    raw: str
    text: str


@dataclass
class DeckSections:
    """A deck's lines: control before BEGIN BULK, and bulk data up to ENDDATA."""

    control: list[Line] = field(default_factory=list)
    bulk: list[Line] = field(default_factory=list)
    unended: Where | None = None  # its last line, where no ENDDATA follows BEGIN BULK


def split_deck(content: bytes, included: Mapping[str, bytes] | None) -> DeckSections:
    """The lines of a deck by section; a deck that has neither CEND nor BEGIN BULK is bulk data
    alone.

    INCLUDE files are left out where `included` is None.

    Raises:
        FormatError: the deck is not text, is cut, or an INCLUDE file is missing. ENDDATA may be
            missing (MSC Nastran) where the last line is whole.
    """
    require_text(content, "the text of a Nastran deck")
    sections = DeckSections()
    current = sections.control
    controlled = ended = False
    for line in _lines(content, ("",), included, set()):
        word = line.text.replace(",", " ").split(None, 1)[:1]
        if word == ["ENDDATA"]:
            ended = True
            break
        begins = bool(word) and word[0].startswith("BEGI")
        if begins and current is sections.control:
            current, controlled = sections.bulk, True
        elif begins:
            raise FormatError(
                str(line.where),
                "a second BEGIN: superelements are not read; send the whole as one model",
            )
        else:
            controlled |= word == ["CEND"]
            current.append(line)
    if current is sections.control:
        grid = next((line for line in sections.control if line.text.startswith("GRID")), None)
        controlled |= any(_CONTROL.match(line.text) for line in sections.control)
        if controlled and grid:
            raise FormatError(
                str(grid.where),
                "a card stands before any BEGIN BULK; add this line before the first card",
            )
        if controlled:
            raise FormatError(
                _last(sections.control), "the deck ends before BEGIN BULK; it seems to be cut"
            )
        return DeckSections([], sections.control)
    if not ended:
        if not content.endswith((b"\n", b"\r")):
            raise FormatError(
                _last(sections.bulk or sections.control),
                "the deck ends within a line and without ENDDATA; it seems to be cut. Add the line"
                " ENDDATA if it is whole",
            )
        sections.unended = (sections.bulk or sections.control)[-1].where
    return sections


def _last(lines: list[Line]) -> str:
    return str(lines[-1].where) if lines else ""


def _lines(
    content: bytes, within: tuple[str, ...], included: Mapping[str, bytes] | None, seen: set[str]
) -> Iterator[Line]:
    """Lines of a file with those of the files that it includes in their place; `within` names what
    leads to it.
    """
    raws, texts = lines_of(content), lines_of(content.upper())
    number, file = 0, within[-1]
    while number < len(raws):
        raw, text = raws[number], texts[number].split("$", 1)[0].rstrip()
        number += 1
        if not text.startswith("INCLUDE") and text.lstrip()[:8].rstrip() != "INCLUDE":
            if text or raw[:1] == "$":
                yield Line(Where(number, file), raw, text.expandtabs(8) if "\t" in text else text)
            continue
        where, name = str(Where(number, file)), raw.strip()[7:]
        first = number
        # a long path goes on
        while name.count("'") == 1 and number < len(raws) and number < first + 10:
            name += raws[number].strip()
            number += 1
        if included is None:
            continue
        quoted = _QUOTED.search(name)
        name = (quoted.group(1) if quoted else name.partition("$")[0]).strip(" \t,=")
        inner = included_file(name, included)
        if inner is None:
            raise FormatError(where, f"INCLUDE {name!r} is not here; send that file with the deck")
        if inner in seen:
            raise FormatError(
                where,
                f"INCLUDE {name!r} stands for the second time; its cards would be there twice",
            )
        if len(within) > DEEPEST_INCLUDE:
            raise FormatError(
                where,
                f"INCLUDE {name!r} lies more than {DEEPEST_INCLUDE} files deep, which is the most"
                " that is read",
            )
        seen.add(inner)
        yield from _lines(included[inner], (*within, inner), included, seen)
