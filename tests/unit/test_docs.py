"""The documents: links lead somewhere, the index is complete, and what they name of the code is there."""

import importlib.util
import re
from pathlib import Path

import pytest

from tests.support.places import ROOT

DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [*DOCS, ROOT / "README.md"]
CODE = ("fecore", "modalbase", "service", "tests", "benchmarks", "examples", "migrations")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_files_and_modules_that_a_page_names_exist(page: Path) -> None:
    text = page.read_text()
    for path in re.findall(rf"`((?:{'|'.join(CODE)})/[\w/.-]*)`", text):
        assert (ROOT / path).exists(), path
    for dotted in re.findall(r"`((?:fecore|modalbase|service)(?:\.\w+)+)`", text):
        assert found(dotted), dotted


def found(dotted: str) -> bool:
    """Whether it is a module, or a member of one."""
    parent, _, member = dotted.rpartition(".")
    if importlib.util.find_spec(parent) is None:
        return False
    if not hasattr(importlib.import_module(parent), "__path__"):
        return hasattr(importlib.import_module(parent), member)
    return importlib.util.find_spec(dotted) is not None or hasattr(importlib.import_module(parent), member)


def test_the_index_names_every_page() -> None:
    index = (ROOT / "docs/index.md").read_text()
    decisions = (ROOT / "docs/decisions/README.md").read_text()
    for page in DOCS:
        if page.parent.name == "decisions" and page.name != "README.md":
            assert f"({page.name})" in decisions, page
        elif page.name != "index.md":
            assert f"({page.relative_to(ROOT / 'docs')})" in index, page


def test_every_decision_says_why_and_what_enforces_it() -> None:
    for page in DOCS:
        if page.parent.name == "decisions" and page.name != "README.md":
            text = page.read_text()
            assert all(f"**{part}.**" in text for part in ("Decision", "Why", "Enforced by")), page


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
