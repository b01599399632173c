"""Sentences on pages are for people: no member of REST, no call, no option of a command stands in
them.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from fecore.updating.known_findings import FINDINGS
from service.nouns.updates.schemas import RecipeIn
from service.pages.forms import FormField, fields_of, labelled, page_words
from service.pages.look import FOLDER

OF_REST = re.compile(
    r"`|\b(?:GET|POST|PUT|PATCH|DELETE)"
    r" /|\?\w+=|--\w|\b[a-z]+(?:_[a-z0-9]+)*_(?:m|kg|hz|per_s|deg)\b|/api/v1"
)
TEMPLATES = sorted((FOLDER.parent / "templates").glob("*.html"))


def texts_of(template: str) -> Iterator[str]:
    """What a template says itself: without its expressions, tags and what scripts read."""
    plain = re.sub(
        r"\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}|<script.*?</script>", " ", template, flags=re.DOTALL
    )
    yield from filter(str.strip, re.split(r"<[^>]*>", plain))
    yield from re.findall(r'\b(?:title|aria-label|data-confirm|alt)="([^"]*)"', plain)
    yield from re.findall(r'(?:help|hint)="([^"]*)"', template)


@pytest.mark.parametrize("template", TEMPLATES, ids=[each.stem for each in TEMPLATES])
def test_templates_name_no_member(template: Path) -> None:
    texts = list(texts_of(template.read_text()))
    # a command
    assert [
        text for text in texts if OF_REST.search(text) and not text.startswith("modalbase ")
    ] == []


@pytest.mark.parametrize("kind", sorted(FINDINGS))
def test_findings_are_told_in_words(kind: str) -> None:
    row = FINDINGS[kind]
    for text in (row.sentence, row.advice):
        assert not OF_REST.search(page_words(re.sub(r"\{[^}]*\}", "3", text))), page_words(text)


def test_forms_are_told_in_words() -> None:
    def walk(fields: list[FormField]) -> Iterator[FormField]:
        for one in fields:
            yield one
            yield from walk(one.fields)

    for one in walk(fields_of(RecipeIn, {})):
        assert not OF_REST.search(page_words(one.help)), page_words(one.help)
        assert "_" not in one.label


@pytest.mark.parametrize(
    ("of_rest", "in_words"),
    [
        ("inputs.thickness_sd_m is not stated", "“Thickness standard deviation” is not stated"),
        ("choose one with `mode_set`", "choose one with “Mode set”"),
        ("see GET /campaigns/{id}/frfs", "see this page"),
        ("point_4.csv has no channel `acc_x`", "point_4.csv has no channel acc_x"),
        ("Ex is 33 GPa", "Ex is 33 GPa"),
    ],
)
def test_a_sentence_is_told_by_labels(of_rest: str, in_words: str) -> None:
    assert page_words(of_rest) == in_words


def test_a_pointer_is_a_label() -> None:
    assert labelled("/hold_out/band_hz") == "Band"
    assert labelled("/jobs/0/unknown_thing") == "jobs 0 unknown thing"
