"""The list of words that names do not use."""

import ast
import re

import pytest

import fecore
import modalbase
from tests.support.places import ROOT
from tools.words import CONTRACTS, WORDS, names, word_in, words_of


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("found", "found"),
        ("_found_rows", "found"),
        ("ModesFound", "found"),
        ("given_up_edges", "given_up"),
        ("foundation", None),
        ("leading", None),
        ("stalled", None),
    ],
)
def test_a_word_counts_where_it_is_a_word_of_the_name(name: str, word: str | None) -> None:
    assert word_in(name) == word


def test_a_contract_counts_in_its_file_alone() -> None:
    file, name = "service/tasks/import_file/routes.py", "found"
    assert f"{file}:{name}" in CONTRACTS
    assert word_in(name, file) is None
    assert word_in(name, "service/nouns/frfs/routes.py") == name


def test_names_are_those_that_are_defined_bound_or_passed() -> None:
    source = "class A:\n    def b(self, c): return d(e=f.g)\nimport x.y as z\n"
    there = {name for _, name in names(ast.parse(source))}
    assert there >= {"A", "b", "c", "d", "e", "f", "g", "z"}


def test_every_contract_uses_a_word_of_the_list() -> None:
    for entry in CONTRACTS:
        parts = f"_{'_'.join(words_of(entry.rpartition(':')[2]))}_"
        assert any(f"_{word}_" in parts for word in WORDS), entry


GLOSSARY = (ROOT / "docs/glossary.md").read_text()
PACKAGES = ("fecore", "modalbase", "service")
ORDINARY = frozenset(
    [
        "beam",
        "client",
        "connect",
        "csv",
        "failed",
        "fecore",
        "job",
        "laboratory",
        "machine",
        "measurement",
        "options",
        "section",
        "updating",
        "version",
        "write",
    ]
)
"""Words of public names that every reader of this field knows."""


@pytest.mark.parametrize("name", sorted({*fecore.__all__, *modalbase.__all__}))
def test_each_word_of_a_public_name_is_in_the_glossary(name: str) -> None:
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z0-9]+", name)
    text = GLOSSARY.casefold()
    # a plural; identify, of which the glossary has the noun
    known = lambda word: any(word.removesuffix(end) in text for end in ("", "s", "y"))  # noqa: E731
    assert {word.casefold() for word in words if not known(word.casefold())} <= ORDINARY


def test_each_term_of_the_glossary_is_in_the_code() -> None:
    """Bracketed abbreviations apart; of two words the code may have either form of the plural."""
    code = " ".join(
        path.read_text(encoding="utf-8")
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.suffix in (".py", ".html") and "vendor" not in path.parts
    ).casefold()
    terms = re.findall(r"^\*\*([^*]+)\*\*:", GLOSSARY, flags=re.MULTILINE)
    unused = [
        term
        for term in terms
        if not any(
            re.search(r"[\s_-]+".join(re.findall(r"\w+", form)), code)
            for form in re.split(r", | or | / ", re.sub(r"\(.*?\)", "", term).casefold())
        )
    ]
    assert unused == []
