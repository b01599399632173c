"""The examples in docstrings run and give what they show."""

import doctest
import importlib
from pathlib import Path

import pytest

from tests.support.places import ROOT

PACKAGES = ("fecore", "modalbase", "service")
MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in PACKAGES
    for path in sorted(Path(ROOT / package).rglob("*.py"))
    if ">>> " in path.read_text()
]


def test_there_are_examples() -> None:
    assert len(MODULES) >= 5


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried
    assert not failed
