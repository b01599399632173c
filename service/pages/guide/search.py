"""The guide's search: sections that have all words of a question, the best first.

A word is found at the beginning of a word of the text, whatever its case. In a page's title it
counts most, in a section's heading more than in the text, and the words in a row more than apart.
"""

import re
from dataclasses import dataclass
from functools import cache

from markupsafe import Markup, escape

from service.pages.guide.contents import PageHeading, addresses, rendered

MOST_HITS = 30  # sections that are listed
_MOST_WORDS = 8  # of a question; the others are left out
_WORD = re.compile(r"\w+")
_IN_TITLE, _IN_HEADING, _IN_A_ROW = 12, 6, 10  # times what a word in the text counts
_MOST_TIMES = 5  # that a word counts in the text of a section
_AROUND = 90  # characters of a snippet on each side of the first word


@dataclass(frozen=True)
class Section:
    """A page's text from one heading to the next."""

    address: str  # of the page, relative to the guide's root
    title: str  # of the page
    heading: PageHeading
    text: str  # without marks


@dataclass(frozen=True)
class Hit:
    """A section that answers."""

    section: Section
    snippet: Markup  # text around the words in a row, or the first of them, with the words marked


@cache
def sections() -> tuple[Section, ...]:
    """All sections of the guide."""
    pages = [(address, rendered(address)) for address in addresses()]
    return tuple(
        Section(address, page.title, heading, text)
        for address, page in pages
        for heading, text in page.texts
    )


def search(question: str) -> list[Hit]:
    """Sections that have every word, the best first; none of a question without words."""
    words = [word.lower() for word in _WORD.findall(question)][:_MOST_WORDS]
    if not words:
        return []
    patterns = [re.compile(rf"\b{word}", re.IGNORECASE) for word in words]
    row = re.compile(r"\b" + r"\w*(?:'s)?\W+".join(words), re.IGNORECASE)
    ranked = [(_rank(section, patterns, row), section) for section in sections()]
    best = sorted((each for each in ranked if each[0]), key=lambda each: -each[0])[:MOST_HITS]
    return [Hit(section, _snippet(section.text, patterns, row)) for _, section in best]


def _rank(section: Section, patterns: list[re.Pattern[str]], row: re.Pattern[str]) -> int:
    """What a section is worth; 0 where it lacks a word."""
    ranks = [
        _IN_TITLE * bool(pattern.search(section.title))
        + _IN_HEADING * bool(pattern.search(section.heading.text))
        + min(len(pattern.findall(section.text)), _MOST_TIMES)
        for pattern in patterns
    ]
    in_a_row = len(patterns) > 1 and row.search(f"{section.heading.text}. {section.text}")
    return sum(ranks) + _IN_A_ROW * bool(in_a_row) if all(ranks) else 0


def _snippet(text: str, patterns: list[re.Pattern[str]], row: re.Pattern[str]) -> Markup:
    in_a_row = row.search(text)
    first = [in_a_row] if in_a_row else [pattern.search(text) for pattern in patterns]
    places = [match.start() for match in first if match]
    begin = max(min(places, default=0) - _AROUND, 0)
    part = text[begin : begin + 2 * _AROUND]
    part = part if begin == 0 else "… " + part.partition(" ")[2]
    marked, at = Markup(), 0
    for match in re.finditer("|".join(pattern.pattern for pattern in patterns), part, re.I):
        marked += escape(part[at : match.start()]) + Markup("<mark>{}</mark>").format(match[0])
        at = match.end()
    return marked + escape(part[at:]) + (" …" if begin + 2 * _AROUND < len(text) else "")
