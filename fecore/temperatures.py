"""Temperatures at which what changes with temperature is shown."""

import numpy as np

from fecore.arrays import FloatArray

# temperatures of a curve, and how far beyond the tests it goes, of their range
_POINTS, _BEYOND = 13, 1 / 8


def temperatures_between(low: float, high: float) -> FloatArray:
    """(n,) temperatures of a curve from a little below the lowest of some tests to a little above
    the highest, °C.
    """
    beyond = _BEYOND * (high - low)
    return np.linspace(low - beyond, high + beyond, _POINTS)
