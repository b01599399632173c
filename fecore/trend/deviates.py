"""Normal deviates: what a chart takes in place of residuals of which the scatter is not known well."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy

from fecore.arrays import FloatArray

_NODES = np.sinh(np.linspace(0, 14.5, 2901))  # t up to 10⁶, closest about 0: linear between is exact to 2e-5


def normal_score(t: FloatArray, degrees_of_freedom: float) -> FloatArray:
    """Φ⁻¹(T_ν(t)), from the nearer tail so that a large deviate keeps its digits."""
    tail = np.maximum(scipy.special.stdtr(degrees_of_freedom, -np.abs(t)), 1e-300)
    return np.asarray(-np.sign(t) * scipy.special.ndtri(tail))


def simulated_scores(t: FloatArray, degrees_of_freedom: float) -> FloatArray:
    """The same of many simulated deviates, from a table: a tenth of the time, within 2e-5 up to |t| = 10⁶."""
    return np.copysign(np.interp(np.abs(t), _NODES, _table(degrees_of_freedom)), t)


@lru_cache(maxsize=64)
def _table(degrees_of_freedom: float) -> FloatArray:
    return normal_score(_NODES, degrees_of_freedom)
