"""How much a pole that may be no mode says in a fit: P·N(r; 0, σ²) + (1 - P)·uniform."""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray


def mixture(probability: FloatArray, z: FloatArray, sd: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Weight and cost of residuals whose mode is one with a probability P, and anywhere in the band otherwise.

    The likelihood of r = zσ is P N(r; 0, σ²) + (1 - P)/W. Its negative logarithm, less that at r = 0, is the cost;
    the weight that gives the same slope in least squares is the posterior probability w = P N/(P N + (1 - P)/W)
    (expectation maximisation).

    Args:
        probability: (n,) P.
        z: (n,) residuals in standard deviations.
        sd: (n,) σ, in the unit of the width.
        width: W of the band.

    Returns:
        (n,) w from 0 to 1, and (n,) cost, z²/2 where P is 1.
    """
    stray = (1 - probability) * np.sqrt(2 * np.pi) * sd / width
    there = probability * np.exp(-np.minimum(z**2, 1400.0) / 2)
    weight = there / (there + stray)
    cost = np.where(stray > 0, np.log((probability + stray) / (there + stray)), z**2 / 2)
    return np.asarray(np.where(stray > 0, weight, 1.0)), np.asarray(cost)
