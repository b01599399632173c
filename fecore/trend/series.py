"""Dated estimates of one parameter, campaign after campaign, with their own uncertainty and their
covariates; and the recipe of a monitor: which are watched, against which baseline, and how often it
may call in vain.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.trend.charts import Chart

TEMPERATURE = "temperature_c"
"""Name of the covariate of which a parameter's change is known before."""

Direction = Literal["fall", "rise", "both"]

SIDES: dict[Direction, dict[str, int]] = {
    "fall": {"fall": -1},
    "rise": {"rise": 1},
    "both": {"fall": -1, "rise": 1},
}
"""One-sided charts of each direction, and the sign by which scores enter them."""


@dataclass(frozen=True)
class Watch:
    """All choices of a monitor."""

    # watched parameters and where they must not go: `fall` (stiffness), `rise` (damping) or `both`
    directions: Mapping[str, Direction]
    baseline: int = 12  # campaigns that make the baseline
    covariates: tuple[str, ...] = ()  # names of the covariates to regress out
    false_alarm_rate: float = 0.01  # α, false alarms a campaign of the whole family
    # H, campaigns after the baseline over which α is held: P(false alarm) = 1 − (1 − α)^H
    horizon: int = 24
    pending: int = 1  # consecutive campaigns outside that make an alarm; the limits know of it
    chart: Chart = field(default_factory=Chart)  # kind of chart
    expected_interval_days: float | None = None  # between campaigns; None where nothing is expected
    # of watched parameters, mean and standard deviation of their relative change per kelvin, as it
    # is known before: the prior of their regression on `temperature_c`
    per_kelvin: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.directions:
            raise InputError("directions", "is empty, expected at least one watched parameter")
        for name, direction in self.directions.items():
            if direction not in SIDES:
                raise InputError(
                    f"directions.{name}", f"is {direction!r}, expected fall, rise or both"
                )
        if not 0 < self.false_alarm_rate < 0.5:
            raise InputError(
                "false_alarm_rate",
                f"is {self.false_alarm_rate}, expected between 0 and 0.5 a campaign",
            )
        if self.pending < 1 or self.horizon < self.pending:
            raise InputError(
                "horizon",
                f"is {self.horizon} with a pending period of {self.pending}, expected 1 ≤ k ≤ H",
            )
        if self.expected_interval_days is not None and not self.expected_interval_days > 0:
            raise InputError(
                "expected_interval_days",
                f"is {self.expected_interval_days}, expected a positive number",
            )

    @property
    def side_probability(self) -> float:
        """Probability of a false alarm within the horizon that each one-sided chart may spend."""
        sides = sum(len(SIDES[d]) for d in self.directions.values())
        return float(1 - (1 - self.false_alarm_rate) ** self.horizon) / sides


SECONDS_A_DAY = 86400.0  # by definition


@dataclass(frozen=True)
class Series:
    """Estimates θ(t) of one watched parameter."""

    name: str  # of the parameter, such as `Ex` or `damping_ratio_1`
    # when each campaign was performed; all with a time zone, or all without
    dates: Sequence[datetime]
    estimate: FloatArray  # (n,) in the parameter's unit
    # (n,) of each estimate, the part that differs from one campaign to the next: the noise-only
    # posterior. A model error that all campaigns share moves the whole series and hides no change
    standard_deviation: FloatArray
    # by name, such as `temperature_c`, (n,) each; NaN where it was not measured
    covariates: Mapping[str, FloatArray] = field(default_factory=dict)
    labels: Sequence[str] = ()  # of the campaigns, such as their ids; "1", "2" … by default

    def __post_init__(self) -> None:
        n = len(self.dates)
        if n == 0:
            raise InputError(
                "dates", f"the series {self.name} is empty, expected at least one campaign"
            )
        if not self.labels:
            object.__setattr__(self, "labels", tuple(str(i + 1) for i in range(n)))
        if len(self.labels) != n:
            raise InputError("labels", f"{len(self.labels)} labels for {n} campaigns")
        _check_values("estimate", self.estimate, self.labels)
        _check_values("standard_deviation", self.standard_deviation, self.labels)
        if np.any(self.standard_deviation <= 0):
            at = self.labels[int(np.argmax(self.standard_deviation <= 0))]
            raise InputError(
                "standard_deviation",
                f"of campaign {at} is not positive; an exact estimate does not exist",
            )
        for name, values in self.covariates.items():
            if values.shape != (n,):
                raise InputError(f"covariates.{name}", f"has shape {values.shape}, expected ({n},)")
            if np.any(np.isinf(values)):
                raise InputError(
                    f"covariates.{name}", "is infinite; use NaN where it was not measured"
                )
        if len({d.tzinfo is None for d in self.dates}) > 1:
            raise InputError(
                "dates", "some have a time zone and some have none; give all of them one"
            )

    def __len__(self) -> int:
        return len(self.dates)

    def measured(self, names: Sequence[str]) -> FloatArray:
        """(n, k) covariates of some names; NaN where they were not measured."""
        nothing = np.full(len(self), np.nan)
        return (
            np.array([self.covariates.get(name, nothing) for name in names])
            .reshape(len(names), len(self))
            .T
        )

    @property
    def days(self) -> FloatArray:
        """(n,) days since the first campaign."""
        return days_since(self.dates[0], self.dates)


def days_since(origin: datetime, dates: Sequence[datetime]) -> FloatArray:
    """Days from an origin to each date."""
    return np.array([(d - origin).total_seconds() / SECONDS_A_DAY for d in dates])


def in_time_order(series: Series) -> tuple[Series, tuple[str, ...]]:
    """The series in ascending time, and a note that names the campaigns that were handed in late.

    Raises:
        InputError: two campaigns have the same date and time; which one counts is for the
            laboratory to say.
    """
    order = sorted(range(len(series)), key=lambda i: series.dates[i])
    for a, b in itertools.pairwise(order):
        if series.dates[a] == series.dates[b]:
            raise InputError(
                "dates",
                f"campaigns {series.labels[a]} and {series.labels[b]} are both of"
                f" {series.dates[a].isoformat()}; leave one out, or correct its date",
            )
    late = came_late(series.dates, series.labels)
    return (select(series, order), (late_note(late),)) if late else (series, ())


def came_late(dates: Sequence[datetime], labels: Sequence[str]) -> list[str]:
    """Campaigns that came after one of a later date, of all in the order in which they came."""
    newest = itertools.accumulate(dates, max)
    return [label for label, date, last in zip(labels, dates, newest, strict=True) if date < last]


def late_note(late: Sequence[str]) -> str:
    """That campaigns came late, in words."""
    return (
        f"put into time order: {listed(late)} came after later campaigns; the states were judged"
        " anew"
    )


def select(series: Series, indices: Sequence[int]) -> Series:
    """The campaigns of these indices, in their order."""
    at = np.asarray(indices, int)
    return Series(
        series.name,
        tuple(series.dates[i] for i in at),
        series.estimate[at],
        series.standard_deviation[at],
        {name: values[at] for name, values in series.covariates.items()},
        tuple(series.labels[i] for i in at),
    )


def later(series: Series, date: datetime) -> Series | None:
    """The campaigns after a time; None where there are none."""
    at = [i for i, each in enumerate(series.dates) if each > date]
    return select(series, at) if at else None


_LISTED = 20  # campaigns that a sentence names


def listed(labels: Sequence[str]) -> str:
    """Campaigns in words."""
    more = len(labels) - _LISTED
    return ", ".join(labels[:_LISTED]) + (f" and {more} more" if more > 0 else "")


def _check_values(name: str, values: FloatArray, labels: Sequence[str]) -> None:
    if values.shape != (len(labels),):
        raise InputError(name, f"has shape {values.shape}, expected ({len(labels)},)")
    bad = ~np.isfinite(values)
    if np.any(bad):
        at = labels[int(np.argmax(bad))]
        raise InputError(
            name,
            f"of campaign {at} is not a finite number; leave a campaign without an estimate out",
        )
