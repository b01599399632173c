"""The guide as files: every page is there, every link leads somewhere, and nothing is fetched from another place."""

from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from service.show.guide.markdown import render
from tests.support.places import ROOT
from tools.guide import write

FETCHED = {"link": "href", "img": "src", "script": "src", "iframe": "src", "source": "src", "object": "data"}


@dataclass
class Seen(HTMLParser):
    """What a page links to, what it loads, which anchors it has, and what a strict policy would refuse."""

    links: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)
    anchors: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    text: str = ""

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id":
                self.anchors.append(str(value))
            elif tag == "a" and name == "href":
                self.links.append(str(value))
            elif FETCHED.get(tag) == name:
                self.fetched.append(str(value))
            elif name == "style" or name.startswith("on"):
                self.refused.append(f"{tag} {name}")
        if tag in ("script", "style"):
            self.refused.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def seen(page: Path) -> Seen:
    found = Seen()
    found.feed(page.read_text())
    return found


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Seen]:
    return {page: seen(page) for page in write(tmp_path_factory.mktemp("guide"))}


def test_every_page_of_the_documents_is_a_page_of_the_guide(pages: dict[Path, Seen]) -> None:
    assert len(pages) == len(list((ROOT / "docs").rglob("*.md"))) > 40
    for page, found in pages.items():
        assert "modalbase" in found.text, page
        assert "](" not in found.text, page  # Markdown that was not understood
        assert len(set(found.anchors)) == len(found.anchors), page
        assert found.refused == [], page


def test_every_link_leads_somewhere(pages: dict[Path, Seen]) -> None:
    count = 0
    for page, found in pages.items():
        for link in found.links:
            parts = urlsplit(link)
            if not parts.scheme:
                target = (page.parent / parts.path).resolve() if parts.path else page
                assert target.is_file(), f"{page.name}: {link}"
                if parts.fragment and target in pages:
                    assert parts.fragment in pages[target].anchors, f"{page.name}: {link}"
                count += 1
    assert count > 1500


def test_nothing_is_fetched_from_elsewhere(pages: dict[Path, Seen]) -> None:
    for page, found in pages.items():
        assert found.fetched, page
        for source in found.fetched:
            assert not urlsplit(source).scheme, page
            assert not urlsplit(source).netloc, page
            assert (page.parent / source).is_file(), f"{page.name}: {source}"
    for style in next(iter(pages)).parent.glob("static/*.css"):
        assert "url(" not in style.read_text()
        assert "@import" not in style.read_text()


def test_each_part_lists_pages_and_marks_the_one_that_is_open(pages: dict[Path, Seen]) -> None:
    (theory,) = (page for page in pages if page.name == "theory.html")
    (decision,) = (page for page in pages if page.name == "queue.html")
    for part in ("Tasks", "Reference", "Theory", "Decisions"):
        assert f"<summary>{part}</summary>" in theory.read_text()
    assert '<a href="theory.html" aria-current="page">' in theory.read_text()
    assert '<a href="../decisions/README.html" aria-current="page">' in decision.read_text()


def test_html_in_a_page_is_shown_and_links_out_of_the_guide_are_text() -> None:
    links = "[code](../setup.py), [other](sub/b.md#two-words), <https://example.org>"
    text = f"# A <b>b</b>\n\n{links}\n\n| a | b |\n|---|---:|\n| 1 | 2 |\n"
    page = render(text, "a.md", {"a.md", "sub/b.md"})
    assert page.title == "A <b>b</b>"
    assert "<b>" not in page.body
    assert '<span class="source">code</span>, <a href="sub/b.html#two-words">other</a>' in page.body
    assert '<td class="num">2</td>' in page.body
