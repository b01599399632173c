"""Campaigns, acknowledgements and campaigns that did not come, in the order in which they changed a parameter's state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from fecore.arrays import BoolArray
from fecore.trend.series import Series
from fecore.trend.states import Condition, Event, State, step

GRACE = 0.5
"""Share of the expected interval by which a campaign may be late before it is missing."""


@dataclass(frozen=True)
class Acknowledgement:
    """Somebody has seen an alarm.

    Attributes:
        parameter: whose alarm.
        date: when.
    """

    parameter: str
    date: datetime


@dataclass(frozen=True)
class Moment:
    """A state on the time axis.

    Attributes:
        date: when it began to hold.
        event: what brought it.
        label: campaign, or None where one was missing or an alarm was acknowledged.
        state: from then on.
    """

    date: datetime
    event: Event
    label: str | None
    state: State


def timeline(
    begin: datetime,
    watched: Series | None,
    outside: BoolArray,
    acknowledged: Sequence[datetime],
    pending: int,
    interval_days: float | None,
    as_of: datetime | None,
) -> tuple[Moment, ...]:
    """States from the end of the baseline on.

    Args:
        begin: the baseline's last campaign.
        watched: campaigns after it, in time order.
        outside: (m,) whether each is outside.
        acknowledged: when alarms were acknowledged.
        pending: k of the state machine.
        interval_days: expected between campaigns; None where nothing is expected.
        as_of: now, or None for the last campaign.

    Raises:
        InputError: an acknowledgement where there was no alarm.
    """
    dates = () if watched is None else tuple(watched.dates)
    labels = () if watched is None else tuple(watched.labels)
    events: list[tuple[datetime, Event, str | None]] = [
        (date, Event.OUTSIDE if out else Event.INSIDE, label)
        for date, label, out in zip(dates, labels, outside, strict=True)
    ]
    events += [(date, Event.MISSING, None) for date in missing_campaigns((begin, *dates), interval_days, as_of)]
    events += [(date, Event.ACKNOWLEDGE, None) for date in acknowledged]
    condition, moments = Condition(), []
    for date, event, label in sorted(events, key=lambda e: e[0]):  # stable: a campaign comes before its acknowledgement
        condition = step(condition, event, pending)
        moments.append(Moment(date, event, label, condition.state))
    return tuple(moments)


def missing_campaigns(dates: Sequence[datetime], interval_days: float | None, as_of: datetime | None) -> list[datetime]:
    """When each campaign that did not come began to be missing: half an interval after it was due."""
    if interval_days is None:
        return []
    interval = timedelta(days=interval_days)
    ends = [*dates[1:], dates[-1] if as_of is None else as_of]
    missing = []
    for start, end in zip(dates, ends, strict=True):
        late = start + (1 + GRACE) * interval
        while late < end:
            missing.append(late)
            late += interval
    return missing
