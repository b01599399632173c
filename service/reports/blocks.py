"""What a report is made of. A report is a list of blocks; `as_html` and `as_pdf` write the same
list.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from service.figures.marks import Figure

Tone = Literal["plain", "good", "careful", "bad", "small", "code"]


@dataclass(frozen=True)
class Heading:
    """A heading; level 1 is the report's title, 2 a section's."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Paragraph:
    """Words; a tone other than `plain` is a box in its colour, small print, or text as it stands in
    a file.
    """

    text: str
    tone: Tone = "plain"


@dataclass(frozen=True)
class Bullets:
    """Sentences of equal rank."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """Columns and rows of text."""

    columns: Sequence[str]  # headings; empty for a list of names and values
    rows: Sequence[Sequence[str]]  # of as many cells
    numeric: Sequence[bool]  # of each column, whether it stands to the right


@dataclass(frozen=True)
class Picture:
    """A figure."""

    figure: Figure  # of `service.figures`.
    width: float = 1.0  # as a share of the text's


@dataclass(frozen=True)
class Signatures:
    """Lines to sign and date, with who signs."""

    roles: Sequence[str]


@dataclass(frozen=True)
class PageBreak:
    """What follows starts on a new page."""


@dataclass(frozen=True)
class Letterhead:
    """Who reports, on top of the first page."""

    name: str  # of the laboratory
    address: Sequence[str] = ()  # lines
    logo: bytes | None = None  # PNG or JPEG


Block = Letterhead | Heading | Paragraph | Bullets | Table | Picture | Signatures | PageBreak


@dataclass(frozen=True)
class Report:
    """A report."""

    title: str  # of the document
    footer: str  # at the foot of every page, before its number
    blocks: Sequence[Block]  # in order
