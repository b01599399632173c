"""The recipe of a monitor: which parameters are watched, against which baseline, and how often it may call in vain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from fecore.errors import InputError
from fecore.trend.charts import Chart

Direction = Literal["fall", "rise", "both"]

SIDES: dict[Direction, dict[str, int]] = {"fall": {"fall": -1}, "rise": {"rise": 1}, "both": {"fall": -1, "rise": 1}}
"""One-sided charts of each direction, and the sign by which scores enter them."""


@dataclass(frozen=True)
class Watch:
    """All choices of a monitor.

    Attributes:
        directions: watched parameters and where they must not go: `fall` (stiffness), `rise` (damping) or `both`.
        baseline: campaigns that make the baseline.
        covariates: names of the covariates to regress out.
        false_alarm_rate: α, false alarms a campaign of the whole family.
        horizon: H, campaigns after the baseline over which α is held: P(false alarm) = 1 − (1 − α)^H.
        pending: consecutive campaigns outside that make an alarm; the limits know of it.
        chart: kind of chart.
        expected_interval_days: between campaigns; None where nothing is expected.
    """

    directions: Mapping[str, Direction]
    baseline: int = 12
    covariates: tuple[str, ...] = ()
    false_alarm_rate: float = 0.01
    horizon: int = 24
    pending: int = 1
    chart: Chart = field(default_factory=Chart)
    expected_interval_days: float | None = None

    def __post_init__(self) -> None:
        if not self.directions:
            raise InputError("directions", "is empty, expected at least one watched parameter")
        for name, direction in self.directions.items():
            if direction not in SIDES:
                raise InputError(f"directions.{name}", f"is {direction!r}, expected fall, rise or both")
        if not 0 < self.false_alarm_rate < 0.5:
            raise InputError("false_alarm_rate", f"is {self.false_alarm_rate}, expected between 0 and 0.5 a campaign")
        if self.pending < 1 or self.horizon < self.pending:
            raise InputError(
                "horizon", f"is {self.horizon} with a pending period of {self.pending}, expected 1 ≤ k ≤ H"
            )
        if self.expected_interval_days is not None and not self.expected_interval_days > 0:
            raise InputError("expected_interval_days", f"is {self.expected_interval_days}, expected a positive number")

    @property
    def side_probability(self) -> float:
        """Probability of a false alarm within the horizon that each one-sided chart may spend."""
        sides = sum(len(SIDES[d]) for d in self.directions.values())
        return float(1 - (1 - self.false_alarm_rate) ** self.horizon) / sides
