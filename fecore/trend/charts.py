"""Control charts of scores: EWMA (Roberts 1959), CUSUM (Page 1954) and Shewhart's, one side each.

Upwards, with scores z and S₀ = 0, all are

    S_i = min(2h, max(0, a S_{i−1} + b z_i − c)),   outside where S_i > h

EWMA with weight λ: a = 1 − λ, b = λ, c = 0; CUSUM with reference value k: a = b = 1, c = k; Shewhart: a = c = 0, b = 1.
The floor at 0 keeps a chart from falling asleep on the good side; the cap at 2h lets it return when a structure has been
repaired. Downwards the scores change sign.

A chart with memory is slow to see what is plain in one campaign, so a campaign is outside too where its own score is above a
limit c: the combined chart (Lucas and Saccucci 1990). Both limits together are set from the false-alarm rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.errors import InputError

CAP = 2.0
"""Highest value of a chart, in units of its limit."""

Kind = Literal["ewma", "cusum", "shewhart"]


@dataclass(frozen=True)
class Limits:
    """Where a campaign is outside.

    Attributes:
        chart: h, for the chart's value.
        score: c, for the campaign's own score; infinite where there is none.
    """

    chart: float
    score: float = float("inf")


@dataclass(frozen=True)
class Chart:
    """A kind of chart.

    Attributes:
        kind: `ewma`, `cusum` or `shewhart`.
        weight: λ of an EWMA, 0 < λ ≤ 1. Small for slow and small changes, large for sudden ones.
        reference: k of a CUSUM, half the change to be found, in standard deviations.
        jump_share: share of the false alarms that the limit on single scores may take; 0 for none.
    """

    kind: Kind = "ewma"
    weight: float = 0.3
    reference: float = 0.5
    jump_share: float = 0.5

    def __post_init__(self) -> None:
        if self.kind not in ("ewma", "cusum", "shewhart"):
            raise InputError("chart.kind", f"is {self.kind!r}, expected ewma, cusum or shewhart")
        if not 0 < self.weight <= 1:
            raise InputError("chart.weight", f"is {self.weight}, expected 0 < weight ≤ 1")
        if not 0 < self.reference < 10:
            raise InputError("chart.reference", f"is {self.reference}, expected 0 < reference < 10")
        if not 0 <= self.jump_share < 1:
            raise InputError("chart.jump_share", f"is {self.jump_share}, expected 0 ≤ jump_share < 1")

    @property
    def recursion(self) -> tuple[float, float, float]:
        """(a, b, c) of the recursion."""
        if self.kind == "cusum":
            return 1.0, 1.0, self.reference
        weight = 1.0 if self.kind == "shewhart" else self.weight
        return 1 - weight, weight, 0.0

    def run(self, scores: FloatArray, limit: float) -> FloatArray:
        """The chart's values S for scores that rise with the change looked for."""
        a, b, c = self.recursion
        values = np.empty(scores.size)
        s = 0.0
        for i, z in enumerate(scores):
            s = min(CAP * limit, max(0.0, a * s + b * float(z) - c))
            values[i] = s
        return values

    def outside(self, scores: FloatArray, limits: Limits) -> tuple[FloatArray, BoolArray]:
        """The chart's values, and whether each campaign is outside."""
        values = self.run(scores, limits.chart)
        return values, (values > limits.chart) | (scores > limits.score)
