"""Values of a test that only `make test-long` tries."""

from typing import Any

import pytest
from _pytest.mark import ParameterSet


def long(*values: Any) -> ParameterSet:
    """Values of the parameters of a long run of a test, which is short with others."""
    return pytest.param(*values, marks=pytest.mark.long)
