"""Values and examples of a test that only `make long` tries."""

from collections.abc import Callable
from typing import Any, TypeVar

import pytest
from _pytest.mark import ParameterSet
from hypothesis import given, settings
from hypothesis.strategies import SearchStrategy

T = TypeVar("T")
STRANGE = "aE1 _.,;:%'\"\\()[]<>=+-*/\x00\n\u202eäµ中😀"
"""Of texts that nobody meant; to list every character takes hypothesis seconds."""


def long(*values: Any) -> ParameterSet:
    """Values of the parameters of a long run of a test, which is short with others."""
    return pytest.param(*values, marks=pytest.mark.long)


def fuzz(examples: int, values: SearchStrategy[T], check: Callable[[T], object]) -> None:
    """Try so many examples."""

    def one(value: T) -> None:
        check(value)

    settings(max_examples=examples)(given(values)(one))()
