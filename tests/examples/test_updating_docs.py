"""The guide names every field of a recipe and of a result document, the glossary is in order, and the links lead somewhere."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

from fecore.updating.result import HeldOut, ModeComparison, ParameterEstimate
from service.updating.schemas import HoldOutIn, ParameterIn, RecipeIn

DOCS = Path(__file__).parents[2] / "docs"
GUIDE = (DOCS / "updating.md").read_text()
DOCUMENT = [
    "parameters",
    "modes",
    "correlation",
    "damping_models",
    "damping_fit",
    "convergence",
    "identifiability",
    "discrepancy",
    "band_hz",
    "identification",
    "posterior",
    "warnings",
    "provenance",
]


def named(name: str) -> bool:
    return re.search(rf"`[^`\n]*\b{name}\b[^`\n]*`", GUIDE) is not None


@pytest.mark.parametrize("name", [*RecipeIn.model_fields, *ParameterIn.model_fields, *HoldOutIn.model_fields])
def test_every_field_of_a_recipe_is_explained(name: str) -> None:
    assert named(name)


@pytest.mark.parametrize(
    "name",
    [
        *DOCUMENT,
        *(field.name for field in fields(ParameterEstimate)),
        *(field.name for field in fields(ModeComparison)),
        *(field.name for field in fields(HeldOut) if field.name != "agreement"),
    ],
)
def test_every_field_of_a_result_is_explained(name: str) -> None:
    assert named(name)


def test_the_document_has_those_fields_and_no_others() -> None:
    source = (DOCS.parent / "service" / "updating" / "document.py").read_text()
    written = re.findall(r'^        "(\w+)":', source.split("def _posterior")[0], flags=re.MULTILINE)
    assert written == DOCUMENT


def test_defaults_are_as_stated() -> None:
    recipe = RecipeIn()  # type: ignore[call-arg]
    for name in ("method", "weighting", "posterior"):
        assert f'| `{name}` | `"{getattr(recipe, name)}"`' in GUIDE
    assert f"| `damping_models` | {', '.join(recipe.damping_models)} |" in GUIDE
    assert f"| `seed` | {recipe.seed} |" in GUIDE
    assert f"| `use_shapes` | `{str(recipe.use_shapes).lower()}` |" in GUIDE


def test_links_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", GUIDE):
        assert (DOCS / target).exists(), target


def test_the_glossary_is_in_alphabetical_order() -> None:
    text = (DOCS / "glossary.md").read_text()
    terms = [term.lower() for term in re.findall(r"^\*\*([^*]+)\*\*:", text, flags=re.MULTILINE)]
    assert len(terms) > 60
    assert terms == sorted(terms)
