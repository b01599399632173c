"""The patches of typical changes fit, touch few files, and are the table of CONTRIBUTING.md."""

import pytest

from tools.changes import CHANGES, CONTRIBUTING, FILES, Change, applies, contributing

each = pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.name)


@each
def test_the_patch_fits(change: Change) -> None:
    assert applies(change) == ""


@each
def test_few_files_of_the_product_are_touched(change: Change) -> None:
    assert len(change.product) <= FILES, change.product
    assert change.tests, "a patch brings the test that shows what is new"


def test_contributing_has_the_table() -> None:
    """`python -m tools.changes --table` writes it."""
    assert CONTRIBUTING.read_text(encoding="utf-8") == contributing()


def test_every_patch_is_a_change() -> None:
    folder = CHANGES[0].patch.parent
    assert {file.stem for file in folder.glob("*.patch")} == {change.name for change in CHANGES}
