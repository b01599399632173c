"""What the guide has: its pages and pictures, and the order in which `index.md` lists them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fecore import __version__
from service.show.guide.markdown import Rendered, render
from service.web.templates import templates_in

FOLDER = Path(__file__).parent / "pages"
"""The Markdown; in a checkout a link to `docs`, in the wheel the files themselves."""

PICTURES = {".svg": "image/svg+xml", ".png": "image/png"}
INDEX = "index.html"
_ENTRY = re.compile(r"^(?:## (?P<part>.+)|- \[(?P<title>[^\]]+)\]\((?P<page>[^)]+)\.md\))", re.MULTILINE)


@dataclass(frozen=True)
class Part:
    """A part of the guide."""

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
def parts() -> tuple[Part, ...]:
    """The parts, as `index.md` has them."""
    found: list[tuple[str, list[tuple[str, str]]]] = []
    for entry in _ENTRY.finditer(files()["index.md"].read_text(encoding="utf-8")):
        if entry["part"]:
            found.append((entry["part"], []))
        else:
            found[-1][1].append((entry["title"], f"{entry['page']}.html"))
    return tuple(Part(title, tuple(pages)) for title, pages in found)


@cache
def _rendered(name: str) -> Rendered:
    return render(files()[name].read_text(encoding="utf-8"), name, files().keys())


def whole_page(address: str, root: str, styles: tuple[str, ...], *, service: bool) -> str | None:
    """HTML of the page at an address below the guide; None where there is none.

    Args:
        address: relative to the guide's root, with `.html`.
        root: the way from the page to the place that `styles` are relative to.
        styles: addresses of style sheets.
        service: whether the service's own pages are at hand, so that links to them lead somewhere.
    """
    name = address.removesuffix(".html") + ".md"
    if not address.endswith(".html") or name not in files():
        return None
    home = "../" * address.count("/")
    return (
        templates_in(Path(__file__).parent / "templates")
        .get_template("guide.html")
        .render(
            page=_rendered(name),
            parts=parts(),
            home=home,
            here="decisions/README.html" if address.startswith("decisions/") else address,
            styles=[root + style for style in styles],
            root=root if service else None,
            version=__version__,
        )
    )
