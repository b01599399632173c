"""What the guide has: its pages and pictures, and the order in which `index.md` lists them; and a
page of Markdown as HTML.

Titles become anchors, links to other pages lead to their HTML, and what is wide scrolls.
"""

from __future__ import annotations

import itertools
import posixpath
import re
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from fecore import __version__
from service.platform.web.templates import templates_in

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)
_WIDE = ("table", "fence", "code_block")  # a reader scrolls these, not the page


@dataclass(frozen=True)
class PageHeading:
    """A title within a page."""

    anchor: str  # its `id`
    text: str  # without marks


@dataclass(frozen=True)
class Rendered:
    """A page."""

    title: str  # its first heading
    body: str  # HTML
    sections: tuple[PageHeading, ...]  # the headings of the second level
    texts: tuple[tuple[PageHeading, str], ...]  # each heading with the text below it


def render(text: str, name: str, names: Set[str]) -> Rendered:
    """HTML of a page.

    Args:
        text: Markdown (CommonMark with tables); HTML in it is shown as it is written.
        name: the page's path below the guide's root.
        names: of all files of the guide. A link to another place of the source tree becomes plain
            text, as nothing of it is served.
    """
    # only here: an API that nobody asks for the guide starts without
    from markdown_it import MarkdownIt

    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = markdown.parse(_COMMENT.sub("", text))
    for token in _all(tokens):
        if token.type == "link_open":
            _lead(token, name, names)
        # the policy allows no style in place
        if token.type in ("th_open", "td_open") and "style" in token.attrs:
            token.attrs = {"class": "num"} if "right" in str(token.attrs["style"]) else {}
    _close_alike(tokens)
    headings, texts = list(_headings(tokens)), tuple(_texts(tokens))
    body = "".join(
        f'<div class="scroll" tabindex="0">{html}</div>\n' if wide else html
        for wide, html in _pieces(markdown, tokens)
    )
    sections = tuple(heading for level, heading in headings if level == "h2")
    return Rendered(headings[0][1].text, body, sections, texts)


def anchor(text: str) -> str:
    """The anchor of a heading, as forges make it from its text.

    >>> anchor("Stage 2: damping, or `a0`")
    'stage-2-damping-or-a0'
    """
    return re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")


def _all(tokens: list[Token]) -> Iterator[Token]:
    for token in tokens:
        yield token
        yield from _all(token.children or [])


def _lead(token: Token, name: str, names: Set[str]) -> None:
    """Have a link lead to the HTML of a page, or make it plain text."""
    path, _, fragment = str(token.attrs["href"]).partition("#")
    if not path or _ELSEWHERE.match(path):
        return
    target = posixpath.normpath(posixpath.join(posixpath.dirname(name), path))
    if target not in names:
        token.tag, token.attrs = "span", {"class": "source"}
    elif path.endswith(".md"):
        token.attrs["href"] = (
            path.removesuffix(".md") + ".html" + (f"#{fragment}" if fragment else "")
        )


def _close_alike(tokens: list[Token]) -> None:
    """Each link's end gets the tag of its beginning; links do not nest."""
    tag = "a"
    for token in _all(tokens):
        if token.type == "link_open":
            tag = token.tag
        elif token.type == "link_close":
            token.tag = tag


def _headings(tokens: list[Token]) -> Iterator[tuple[str, PageHeading]]:
    """Each heading with its level; its token gets the anchor."""
    for opening, inline in itertools.pairwise(tokens):
        if opening.type == "heading_open":
            text = "".join(part.content for part in inline.children or [])
            opening.attrs["id"] = anchor(text)
            yield opening.tag, PageHeading(anchor(text), text)


def _texts(tokens: list[Token]) -> Iterator[tuple[PageHeading, str]]:
    """Each heading with the text below it, without marks."""
    heading, words, within = PageHeading("", ""), list[str](), False
    for token in tokens:
        if token.type == "heading_open":
            if heading.text:
                yield heading, " ".join(words)
            heading, words, within = PageHeading(str(token.attrs["id"]), ""), [], True
        elif within:
            text = "".join(part.content for part in token.children or [])
            heading, within = PageHeading(heading.anchor, text), False
        elif token.type in ("inline", "fence", "code_block"):
            parts = token.children or [token]
            words += "".join(part.content or " " for part in parts).split()
    yield heading, " ".join(words)


def _pieces(markdown: MarkdownIt, tokens: list[Token]) -> Iterator[tuple[bool, str]]:
    """The page's HTML in pieces, each with whether it is wide."""
    piece: list[Token] = []
    for token in tokens:
        outermost = (
            token.level == 0 and token.type.removesuffix("_open").removesuffix("_close") in _WIDE
        )
        if outermost and not token.type.endswith("_close"):
            yield False, markdown.renderer.render(piece, markdown.options, {})
            piece = []
        piece.append(token)
        if outermost and not token.type.endswith("_open"):
            yield True, markdown.renderer.render(piece, markdown.options, {})
            piece = []
    yield False, markdown.renderer.render(piece, markdown.options, {})


FOLDER = Path(__file__).parent / "pages"
"""The Markdown; in a checkout a link to `docs`, in the wheel the files themselves."""

PICTURES = {".svg": "image/svg+xml", ".png": "image/png"}
INDEX = "index.html"
_ENTRY = re.compile(
    r"^(?:## (?P<part>.+)|- \[(?P<title>[^\]]+)\]\((?P<page>[^)]+)\.md\))", re.MULTILINE
)


@dataclass(frozen=True)
class Chapter:
    """A chapter of the guide."""

    title: str  # its name
    pages: tuple[tuple[str, str], ...]  # title and address of each page, in order


@cache
def files() -> dict[str, Path]:
    """Every file of the guide by its path: Markdown and pictures."""
    kinds = {".md", *PICTURES}
    return {
        file.relative_to(FOLDER).as_posix(): file
        for folder in (FOLDER, *(one for one in sorted(FOLDER.iterdir()) if one.is_dir()))
        for file in sorted(folder.iterdir())
        if file.suffix in kinds
    }


def addresses() -> list[str]:
    """Where each page is, relative to the guide's root."""
    return [name.removesuffix(".md") + ".html" for name in files() if name.endswith(".md")]


@cache
def chapters() -> tuple[Chapter, ...]:
    """The chapters, as `index.md` has them."""
    entries: list[tuple[str, list[tuple[str, str]]]] = []
    for entry in _ENTRY.finditer(files()["index.md"].read_text(encoding="utf-8")):
        if entry["part"]:
            entries.append((entry["part"], []))
        else:
            entries[-1][1].append((entry["title"], f"{entry['page']}.html"))
    return tuple(Chapter(title, tuple(pages)) for title, pages in entries)


def rendered(address: str) -> Rendered:
    """The page at an address that it has."""
    return _rendered(address.removesuffix(".html") + ".md")


@cache
def _rendered(name: str) -> Rendered:
    return render(files()[name].read_text(encoding="utf-8"), name, files().keys())


def whole_page(
    address: str,
    root: str,
    styles: tuple[str, ...],
    *,
    service: bool,
    search: bool,
    answer: Mapping[str, object] | None = None,
) -> str | None:
    """HTML of the page at an address below the guide; None where there is none.

    Args:
        address: relative to the guide's root, with `.html`.
        root: the way from the page to the place that `styles` are relative to.
        styles: addresses of style sheets.
        service: whether the service's own pages are at hand, so that links to them lead somewhere.
        search: whether a search is at hand.
        answer: the question and hits of a search, shown in place of a page.
    """
    name = address.removesuffix(".html") + ".md"
    if answer is None and (not address.endswith(".html") or name not in files()):
        return None
    home = "../" * address.count("/")
    return (
        templates_in(Path(__file__).parent / "templates")
        .get_template("guide.html")
        .render(
            page=None if answer else _rendered(name),
            answer=answer,
            search=search,
            chapters=chapters(),
            home=home,
            here="decisions/README.html" if address.startswith("decisions/") else address,
            styles=[root + style for style in styles],
            root=root if service else None,
            version=__version__,
        )
    )
