"""The table of damping laws: nothing of a law is forgotten in recipes, decks or the guide."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from fecore.dynamics.laws import DEFAULT_LAWS, LAWS, Damped
from service.nouns.updates.schemas import DampingModel

DOCS = Path(__file__).parents[3] / "docs"
OF = Damped(("Ex", "Ey", "Gxy", "Gxz", "Gyz", "supports"), (100.0, 300.0, 900.0))
OMEGA = np.array([80.0, 200.0, 1000.0])
STRAIN = np.array(
    [
        [0.5, 0.1, 0.2, 0.1, 0.05, 0.05],
        [0.1, 0.2, 0.5, 0.1, 0.05, 0.05],
        [0.3, 0.3, 0.1, 0.2, 0, 0.1],
    ]
)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_says_all_of_itself(name: str) -> None:
    """Its sentence, equation, names and units, and a slope that is its basis' derivative."""
    row, law = LAWS[name], LAWS[name].make(OF)
    assert law is not None
    assert law.name == name
    assert row.meaning, f"the law {name} has no sentence"
    assert row.rate.startswith("c = "), f"the law {name} has no equation"
    assert len(law.coefficient_names) == len(law.coefficient_units), f"{name} lacks a unit"
    assert set(row.alpha_beta or ()) <= set(law.coefficient_names)
    basis = law.basis(OMEGA, STRAIN)
    assert basis.shape == (3, len(law.coefficient_names))
    step = 1e-4 * OMEGA
    slope = (law.basis(OMEGA + step, STRAIN) - law.basis(OMEGA - step, STRAIN)) / (
        2 * step[:, None]
    )
    np.testing.assert_allclose(law.slope(OMEGA, STRAIN), slope, rtol=1e-6, atol=1e-9)
    coefficients = np.arange(1.0, 1 + len(law.coefficient_names))
    more = np.zeros_like(STRAIN)
    more[:, 2] = 1e-3
    by = law.by_strain(OMEGA, coefficients, STRAIN.shape[1])[:, 2] * 1e-3
    change = (law.basis(OMEGA, STRAIN + more) - basis) @ coefficients
    np.testing.assert_allclose(change, by, atol=1e-8)


def test_a_law_that_a_body_cannot_have_says_what_lacks() -> None:
    bare = Damped(OF.mechanisms[:-1], OF.knots)
    lacking = [name for name, row in LAWS.items() if row.make(bare) is None]
    assert lacking == ["mechanism_support"]
    assert all(LAWS[name].needs for name in lacking)


def test_the_guide_and_recipes_name_every_law() -> None:
    theory, updating = ((DOCS / f"{page}.md").read_text() for page in ("theory", "updating"))
    for row in LAWS.values():
        line = f"| `{row.name}` | {row.meaning} | {row.matrix} | {row.rate} |\n"
        assert line in theory, f"docs/theory.md lacks {line}"
    (line,) = [line for line in updating.splitlines() if line.startswith("| `damping_models`")]
    assert line.split("|")[2].strip() == ", ".join(DEFAULT_LAWS)
    for name in LAWS:
        assert name in line, f"docs/updating.md's damping_models lack {name}"
    assert get_args(DampingModel) == tuple(LAWS)
