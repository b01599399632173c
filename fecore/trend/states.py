"""The states of a monitored parameter: no data, normal, pending, alarm, acknowledged.

A pure machine: a condition and an event give the next condition. Events are a campaign inside or
outside the limits, an expected campaign that is missing, and somebody's acknowledgement.

                inside          outside                         missing         acknowledge
    no data     normal          pending (alarm at the k-th)     no data         refused
    normal      normal          pending (alarm at the k-th)     no data         refused
    pending     normal          pending (alarm at the k-th)     no data         refused
    alarm       alarm           alarm                           alarm           acknowledged
    acknowl.    normal          acknowledged                    no data         refused

An alarm stays until somebody has seen it, even where the chart comes back or campaigns stop. A
missing campaign is neither inside nor outside: the count towards k, and that an alarm was
acknowledged, live on behind `no data`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from enum import StrEnum

from fecore.arrays import BoolArray
from fecore.errors import InputError
from fecore.trend.series import Series


class State(StrEnum):
    """State of a monitored parameter."""

    NO_DATA = "no data"
    NORMAL = "normal"
    PENDING = "pending"
    ALARM = "alarm"
    ACKNOWLEDGED = "acknowledged"


class Event(StrEnum):
    """What can happen to it."""

    INSIDE = "inside"
    OUTSIDE = "outside"
    MISSING = "missing"
    ACKNOWLEDGE = "acknowledge"


WORST_FIRST = (State.ALARM, State.PENDING, State.NO_DATA, State.ACKNOWLEDGED, State.NORMAL)
"""Order in which states ask for attention; of several parameters the first counts."""


@dataclass(frozen=True)
class Condition:
    """A state with what it remembers."""

    state: State = State.NO_DATA  # what is shown
    outside: int = 0  # campaigns outside in a row, missing ones passed over
    acknowledged: bool = False  # somebody has seen the alarm that these campaigns raised


def step(condition: Condition, event: Event, pending: int = 1) -> Condition:
    """The condition after an event.

    Args:
        condition: before.
        event: what happened.
        pending: k, consecutive campaigns outside that make an alarm; 1 has no pending state.

    Raises:
        InputError: an acknowledgement where there is no alarm, or a pending period below 1.
    """
    if pending < 1:
        raise InputError("pending", f"is {pending}, expected at least 1 campaign")
    if event is Event.ACKNOWLEDGE:
        if condition.state is not State.ALARM:
            raise InputError(
                "state", f"is {condition.state.value}; only an alarm can be acknowledged"
            )
        return replace(condition, state=State.ACKNOWLEDGED, acknowledged=True)
    if event is Event.MISSING:
        return (
            condition if condition.state is State.ALARM else replace(condition, state=State.NO_DATA)
        )
    outside = condition.outside + 1 if event is Event.OUTSIDE else 0
    if condition.state is State.ALARM:
        return replace(condition, outside=outside)
    if event is Event.INSIDE:
        return Condition(State.NORMAL)
    if condition.acknowledged:
        return Condition(State.ACKNOWLEDGED, outside, acknowledged=True)
    return Condition(State.ALARM if outside >= pending else State.PENDING, outside)


def worst(states: tuple[State, ...]) -> State:
    """The state that asks most for attention.

    Raises:
        InputError: there is none.
    """
    if not states:
        raise InputError("states", "is empty, expected at least one watched parameter")
    return min(states, key=WORST_FIRST.index)


GRACE = 0.5  # share of the expected interval by which a campaign may be late before it is missing


@dataclass(frozen=True)
class Acknowledgement:
    """Somebody has seen an alarm."""

    parameter: str  # whose alarm
    date: datetime  # when


@dataclass(frozen=True)
class Moment:
    """A state on the time axis."""

    date: datetime  # when it began to hold
    event: Event  # what brought it
    label: str | None  # campaign, or None where one was missing or an alarm was acknowledged
    condition: Condition  # from then on

    @property
    def state(self) -> State:
        """The state from then on."""
        return self.condition.state


def timeline(
    begin: datetime,
    watched: Series | None,
    outside: BoolArray,
    acknowledged: Sequence[datetime],
    pending: int,
    interval_days: float | None,
    as_of: datetime | None,
    before: Condition | None = None,
) -> tuple[Moment, ...]:
    """States from the end of the baseline on.

    Args:
        begin: the baseline's last campaign, or the last one that was judged.
        watched: campaigns after it, in time order.
        outside: (m,) whether each is outside.
        acknowledged: when alarms were acknowledged.
        pending: k of the state machine.
        interval_days: expected between campaigns; None where nothing is expected.
        as_of: now, or None for the last campaign.
        before: condition at `begin`; None where that is the baseline's last campaign.

    Raises:
        InputError: an acknowledgement where there was no alarm.
    """
    dates = () if watched is None else tuple(watched.dates)
    labels = () if watched is None else tuple(watched.labels)
    events: list[tuple[datetime, Event, str | None]] = [
        (date, Event.OUTSIDE if out else Event.INSIDE, label)
        for date, label, out in zip(dates, labels, outside, strict=True)
    ]
    events += [
        (date, Event.MISSING, None)
        for date in missing_campaigns((begin, *dates), interval_days, as_of)
    ]
    events += [(date, Event.ACKNOWLEDGE, None) for date in acknowledged]
    condition, moments = before or Condition(), []
    # stable: a campaign comes before its acknowledgement
    for date, event, label in sorted(events, key=lambda e: e[0]):
        condition = step(condition, event, pending)
        moments.append(Moment(date, event, label, condition))
    return tuple(moments)


def missing_campaigns(
    dates: Sequence[datetime], interval_days: float | None, as_of: datetime | None
) -> list[datetime]:
    """When each campaign that did not come began to be missing: half an interval after it was
    due.
    """
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
