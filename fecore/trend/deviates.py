"""Normal deviates: what a chart takes in place of residuals of which the scatter is not known well."""

from __future__ import annotations

import numpy as np
import scipy

from fecore.arrays import FloatArray


def normal_score(t: FloatArray, degrees_of_freedom: float) -> FloatArray:
    """Φ⁻¹(T_ν(t)), from the nearer tail so that a large deviate keeps its digits."""
    tail = np.maximum(scipy.special.stdtr(degrees_of_freedom, -np.abs(t)), 1e-300)
    return np.asarray(-np.sign(t) * scipy.special.ndtri(tail))
