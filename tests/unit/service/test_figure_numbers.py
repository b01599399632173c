"""Numbers of a figure are JSON, whatever was measured."""

import json
import math

import pytest

from service.show.figures.screen import numbers


def test_numbers_are_rounded_and_what_json_lacks_is_a_gap() -> None:
    given = [1.23456789, -6.02214076e23, 1e-320, 1e-300, 1.7e308, 0.0, math.nan, math.inf]
    found = numbers(given)
    assert found == [1.234568, pytest.approx(-6.022141e23), 0.0, 0.0, pytest.approx(1.7e308), 0.0, None, None]
    json.dumps(found, allow_nan=False)
