"""The pages of updating and of its result name every field of a recipe and of a result document."""

import re
from dataclasses import fields

import pytest

from fecore.updating.result import HeldOut, ModeComparison, ParameterEstimate
from service.store.updating.result_schemas import ResultOut
from service.store.updating.schemas import HoldOutIn, ParameterIn, RecipeIn
from tests.support.places import ROOT

DOCS = ROOT / "docs"
GUIDE = "".join((DOCS / name).read_text() for name in ("updating.md", "results.md"))


def named(name: str) -> bool:
    return re.search(rf"`[^`\n]*\b{name}\b[^`\n]*`", GUIDE) is not None


@pytest.mark.parametrize("name", [*RecipeIn.model_fields, *ParameterIn.model_fields, *HoldOutIn.model_fields])
def test_every_field_of_a_recipe_is_explained(name: str) -> None:
    assert named(name)


@pytest.mark.parametrize(
    "name",
    [
        *ResultOut.model_fields,
        *(field.name for field in fields(ParameterEstimate)),
        *(field.name for field in fields(ModeComparison)),
        *(field.name for field in fields(HeldOut) if field.name != "agreement"),
    ],
)
def test_every_field_of_a_result_is_explained(name: str) -> None:
    assert named(name)


def test_defaults_are_as_stated() -> None:
    recipe = RecipeIn()
    for name in ("method", "weighting", "posterior"):
        assert f'| `{name}` | `"{getattr(recipe, name)}"`' in GUIDE
    assert f"| `damping_models` | {', '.join(recipe.damping_models)} |" in GUIDE
    assert f"| `seed` | {recipe.seed} |" in GUIDE
    assert f"| `use_shapes` | `{str(recipe.use_shapes).lower()}` |" in GUIDE
