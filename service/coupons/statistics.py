"""Batch statistics of ASTM D3039, section 13: mean, n-1 standard deviation, coefficient of variation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FEWEST_SPECIMENS = 5
"""D3039, 8.1: test at least five specimens per condition."""


@dataclass(frozen=True)
class Statistics:
    """Mean and scatter.

    Attributes:
        n: number of values; None where a published mean does not say.
        mean: arithmetic mean.
        standard_deviation: with n-1 in the denominator; None below two values.
    """

    n: int | None
    mean: float
    standard_deviation: float | None

    @property
    def cv_percent(self) -> float | None:
        """Coefficient of variation, 100 s / |mean|; None where s is not known or the mean is 0."""
        if self.standard_deviation is None or self.mean == 0:
            return None
        return 100 * self.standard_deviation / abs(self.mean)


def statistics(values: Sequence[float]) -> Statistics:
    """Statistics of at least one value."""
    x = np.asarray(values, float)
    return Statistics(x.size, float(x.mean()), float(x.std(ddof=1)) if x.size > 1 else None)
