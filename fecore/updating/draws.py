"""Even draws from the unit cube, from which searches begin."""

from __future__ import annotations

from fecore.arrays import FloatArray


def even_draws(dimensions: int, count: int, seed: int) -> FloatArray:
    """Scrambled Sobol points of [0, 1)^d (Owen 1998), which cover it more evenly than random ones.

    Args:
        dimensions: d.
        count: of points; a power of two keeps their balance.
        seed: of the scrambling.

    Returns:
        (count, d).
    """
    from scipy.stats import qmc  # only here: the import takes as long as a small update job

    points: FloatArray = qmc.Sobol(dimensions, seed=seed).random(count)
    return points
