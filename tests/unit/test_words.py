"""The list of words that names do not use."""

import ast

import pytest

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
    file, name = "service/store/imports/routes.py", "found"
    assert f"{file}:{name}" in CONTRACTS
    assert word_in(name, file) is None
    assert word_in(name, "service/store/frfs/routes.py") == name


def test_names_are_those_that_are_defined_bound_or_passed() -> None:
    source = "class A:\n    def b(self, c): return d(e=f.g)\nimport x.y as z\n"
    there = {name for _, name in names(ast.parse(source))}
    assert there >= {"A", "b", "c", "d", "e", "f", "g", "z"}


def test_every_contract_uses_a_word_of_the_list() -> None:
    for entry in CONTRACTS:
        parts = f"_{'_'.join(words_of(entry.rpartition(':')[2]))}_"
        assert any(f"_{word}_" in parts for word in WORDS), entry
