"""Which mode of one set is which of another, and what documents state, a line each."""

import numpy as np
import pytest

from fecore.frf import Dof
from fecore.modes import MeasuredModes
from service.show.measured import _by_axis
from service.show.pages.comparing import _told_apart, leaves


def test_shapes_are_compared_along_positive_axes() -> None:
    shapes = np.array([[1.0 + 0j, 2.0]])
    modes = MeasuredModes(np.array([10.0]), np.array([0.01]), shapes, (Dof(1, 3), Dof(2, -3)))
    assert {key: value.tolist() for key, value in _by_axis(modes).items()} == {(1, 3): [1.0], (2, 3): [-2.0]}
    assert _by_axis(MeasuredModes(np.array([10.0]), np.array([0.01]))) == {}


@pytest.mark.parametrize(
    ("value", "line"),
    [
        ({"material": {"Ex_Pa": 33.05e9}}, ("material Ex", "33.05 GPa")),
        ({"temperature_c": 21.5}, ("temperature", "21.5 °C")),
        ({"humidity_percent": None}, ("humidity percent", "–")),
        ({"hold_out": {"points": [1, 2]}}, ("hold out points", "1, 2")),
        ({"parameters": [{"name": "Ex"}]}, ("parameters 1 name", "Ex")),
        ({"use_shapes": True}, ("use shapes", "True")),
    ],
)
def test_a_document_is_written_a_line_each_in_a_laboratorys_units(value: object, line: tuple[str, str]) -> None:
    assert list(leaves(value)) == [line]


def test_names_are_as_long_as_they_must_be() -> None:
    twice = ("May", "bar", "1")
    assert _told_apart([twice, twice, ("June", "bar", "1")]) == ["May, bar, 1", "May, bar, 1", "June"]
