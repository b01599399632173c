"""The documents and the guide: links lead somewhere, what they name is there, every page, setting
and field is described.
"""

import importlib.util
import re
from dataclasses import dataclass, field, fields
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from benchmarks.__main__ import TABLES
from fecore.updating.result import HeldOut, ModeComparison, ParameterEstimate
from service.nouns.search.nouns import NOUNS
from service.nouns.updates.result_schemas import ResultOut
from service.nouns.updates.schemas import HoldOutIn, ParameterIn, RecipeIn
from service.pages.guide.contents import render
from service.platform.settings import MIB, Settings
from tests.support.places import ROOT
from tools.guide import write

DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [*DOCS, ROOT / "README.md"]
CODE = ("fecore", "modalbase", "service", "tests", "benchmarks", "examples", "migrations")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_what_a_page_links_to_or_names_exists(page: Path) -> None:
    text = page.read_text()
    links = [page.parent / target for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)]
    files = [ROOT / path for path in re.findall(rf"`((?:{'|'.join(CODE)})/[\w/.-]*)`", text)]
    assert [path for path in (*links, *files) if not path.exists()] == []
    modules = re.findall(r"`((?:fecore|modalbase|service)(?:\.\w+)+)`", text)
    assert [dotted for dotted in modules if not found(dotted)] == []


def found(dotted: str) -> bool:
    """Whether it is a module, or a member of one."""
    parent, _, member = dotted.rpartition(".")
    if importlib.util.find_spec(parent) is None:
        return False
    if not hasattr(importlib.import_module(parent), "__path__"):
        return hasattr(importlib.import_module(parent), member)
    return importlib.util.find_spec(dotted) is not None or hasattr(
        importlib.import_module(parent), member
    )


def test_a_benchmark_that_a_page_names_is_a_case() -> None:
    cases = {case.name for table in TABLES.values() for case in table}
    for page in PAGES:
        text = page.read_text()
        named = re.findall(r"python\s+-m benchmarks (?:quick )?(\w+)", text)
        if page.stem in ("accuracy", "benchmarks"):
            named += re.findall(r"^\| `(?!python)(\w+)[^|]*` \|", text, re.MULTILINE)
        assert set(named) <= {*cases, *TABLES}, page


def test_an_index_names_every_page_and_a_decision_says_why_and_what_enforces_it() -> None:
    index, decisions = (
        (ROOT / "docs" / page).read_text() for page in ("index.md", "decisions/README.md")
    )
    for page in DOCS:
        if page.parent.name == "decisions" and page.name != "README.md":
            assert f"({page.name})" in decisions, page
            assert all(
                f"**{part}.**" in page.read_text() for part in ("Decision", "Why", "Enforced by")
            ), page
        elif page.name != "index.md":
            assert f"({page.relative_to(ROOT / 'docs')})" in index, page


@pytest.mark.parametrize("folder", CODE)
def test_nothing_refers_to_a_place_outside_the_repository(folder: str) -> None:
    for path in (ROOT / folder).rglob("*.py"):
        if path.name not in ("places.py", "test_docs.py"):
            assert not re.search(r"\.\./shared|SCIENCE|DESIGN\.md", path.read_text()), path


def test_the_glossary_is_in_alphabetical_order() -> None:
    text = (ROOT / "docs/glossary.md").read_text()
    terms = [term.lower() for term in re.findall(r"^\*\*([^*]+)\*\*:", text, flags=re.MULTILINE)]
    assert len(terms) > 60
    assert terms == sorted(terms)


# --- docs/operating.md names every setting, with its default and its meaning
# --------------------------------------------

PAGE = (ROOT / "docs/operating.md").read_text()


def row(name: str, field: Any) -> str:
    factory = field.default_factory
    default = (
        factory.__doc__.splitlines()[0].rstrip(".") if factory else written(name, field.default)
    )
    return f"| `MODALBASE_{name.upper()}` | {default} | {field.description} |"


def written(name: str, default: object) -> str:
    if default is None or default == "":
        return ""
    if isinstance(default, bool):
        return "on" if default else "off"
    if isinstance(default, int) and default % MIB == 0 and "bytes" in name:
        return f"{default // MIB} MiB"
    return f"{default:g}" if isinstance(default, float) else str(default)


def test_every_setting_is_described_and_no_other() -> None:
    lines = [line for line in PAGE.splitlines() if line.startswith("| `MODALBASE_")]
    assert sorted(lines) == sorted(
        row(name, field) for name, field in Settings.model_fields.items()
    )


# --- docs/search.md names every field that can be searched
# ---------------------------------------------------------------

EVERY_NOUN = {"id", "created_at", "tag", "meta"}


@pytest.mark.parametrize("noun", [name for name, noun in NOUNS.items() if noun.fields])
def test_every_field_of_a_search_is_named(noun: str) -> None:
    (row,) = re.findall(
        rf"^\| `{noun}` \|.*$", (ROOT / "docs/search.md").read_text(), flags=re.MULTILINE
    )
    wanted = {field.name for field in NOUNS[noun].fields} - EVERY_NOUN
    ends = "_(sd|low|high)$" if noun == "result" else "$"
    assert {re.sub(ends, "", name) for name in wanted} <= set(re.findall(r"`(\w+)`", row))


# --- the pages of updating and of its result name every field of a recipe and of a result document
# ----------------------

GUIDE = "".join((ROOT / "docs" / name).read_text() for name in ("updating.md", "results.md"))


def named(name: str) -> bool:
    return re.search(rf"`[^`\n]*\b{name}\b[^`\n]*`", GUIDE) is not None


@pytest.mark.parametrize(
    "document",
    [RecipeIn, ParameterIn, HoldOutIn, ResultOut, ParameterEstimate, ModeComparison, HeldOut],
)
def test_every_field_of_a_recipe_and_of_a_result_is_explained(document: Any) -> None:
    names = getattr(document, "model_fields", None) or [field.name for field in fields(document)]
    assert [name for name in names if name != "agreement" and not named(name)] == []


def test_defaults_are_as_stated() -> None:
    recipe = RecipeIn()
    for name in ("method", "weighting", "posterior"):
        assert f'| `{name}` | `"{getattr(recipe, name)}"`' in GUIDE
    assert f"| `damping_models` | {', '.join(recipe.damping_models)} |" in GUIDE
    assert f"| `seed` | {recipe.seed} |" in GUIDE
    assert f"| `use_shapes` | `{str(recipe.use_shapes).lower()}` |" in GUIDE


# --- the guide as files
# -------------------------------------------------------------------------------------------------

FETCHED = {
    "link": "href",
    "img": "src",
    "script": "src",
    "iframe": "src",
    "source": "src",
    "object": "data",
}


@dataclass
class Seen(HTMLParser):
    """What a page links to, what it loads, which anchors it has, and what a strict policy would
    refuse.
    """

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
    links = (
        "[code](../setup.py), [other](sub/b.md#two-words), [drawn](c.svg), <https://example.org>"
    )
    text = f"# A <b>b</b>\n\n{links}\n\n| a | b |\n|---|---:|\n| 1 | 2 |\n"
    page = render(text, "a.md", {"a.md", "sub/b.md", "c.svg"})
    assert page.title == "A <b>b</b>"
    assert "<b>" not in page.body
    assert (
        '<span class="source">code</span>, <a href="sub/b.html#two-words">other</a>, <a'
        ' href="c.svg">drawn</a>' in page.body
    )
    assert '<td class="num">2</td>' in page.body
