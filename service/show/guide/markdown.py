"""A page of Markdown to HTML: titles become anchors, links to other pages lead to their HTML, and what is wide scrolls."""

from __future__ import annotations

import itertools
import posixpath
import re
from collections.abc import Iterator, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)
_WIDE = ("table", "fence", "code_block")  # a reader scrolls these, not the page


@dataclass(frozen=True)
class Heading:
    """A title within a page."""

    anchor: str  # its `id`
    text: str  # without marks


@dataclass(frozen=True)
class Rendered:
    """A page."""

    title: str  # its first heading
    body: str  # HTML
    sections: tuple[Heading, ...]  # the headings of the second level


def render(text: str, name: str, names: Set[str]) -> Rendered:
    """HTML of a page.

    Args:
        text: Markdown (CommonMark with tables); HTML in it is shown as it is written.
        name: the page's path below the guide's root.
        names: of all files of the guide. A link to another place of the source tree becomes plain text, as nothing of it is
            served.
    """
    from markdown_it import MarkdownIt  # only here: an API that nobody asks for the guide starts without

    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = markdown.parse(_COMMENT.sub("", text))
    for token in _all(tokens):
        if token.type == "link_open":
            _lead(token, name, names)
        if token.type in ("th_open", "td_open") and "style" in token.attrs:  # the policy allows no style in place
            token.attrs = {"class": "num"} if "right" in str(token.attrs["style"]) else {}
    _close_alike(tokens)
    headings = list(_headings(tokens))
    body = "".join(
        f'<div class="scroll" tabindex="0">{html}</div>\n' if wide else html for wide, html in _pieces(markdown, tokens)
    )
    sections = tuple(heading for level, heading in headings if level == "h2")
    return Rendered(headings[0][1].text, body, sections)


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
        token.attrs["href"] = path.removesuffix(".md") + ".html" + (f"#{fragment}" if fragment else "")


def _close_alike(tokens: list[Token]) -> None:
    """Each link's end gets the tag of its beginning; links do not nest."""
    tag = "a"
    for token in _all(tokens):
        if token.type == "link_open":
            tag = token.tag
        elif token.type == "link_close":
            token.tag = tag


def _headings(tokens: list[Token]) -> Iterator[tuple[str, Heading]]:
    """Each heading with its level; its token gets the anchor."""
    for opening, inline in itertools.pairwise(tokens):
        if opening.type == "heading_open":
            text = "".join(part.content for part in inline.children or [])
            opening.attrs["id"] = anchor(text)
            yield opening.tag, Heading(anchor(text), text)


def _pieces(markdown: MarkdownIt, tokens: list[Token]) -> Iterator[tuple[bool, str]]:
    """The page's HTML in pieces, each with whether it is wide."""
    piece: list[Token] = []
    for token in tokens:
        outermost = token.level == 0 and token.type.removesuffix("_open").removesuffix("_close") in _WIDE
        if outermost and not token.type.endswith("_close"):
            yield False, markdown.renderer.render(piece, markdown.options, {})
            piece = []
        piece.append(token)
        if outermost and not token.type.endswith("_open"):
            yield True, markdown.renderer.render(piece, markdown.options, {})
            piece = []
    yield False, markdown.renderer.render(piece, markdown.options, {})
