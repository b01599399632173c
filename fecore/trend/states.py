"""The states of a monitored parameter: no data, normal, pending, alarm, acknowledged.

A pure machine: a condition and an event give the next condition. Events are a campaign inside or outside the limits, an
expected campaign that is missing, and somebody's acknowledgement.

                inside          outside                         missing         acknowledge
    no data     normal          pending (alarm at the k-th)     no data         refused
    normal      normal          pending (alarm at the k-th)     no data         refused
    pending     normal          pending (alarm at the k-th)     no data         refused
    alarm       alarm           alarm                           alarm           acknowledged
    acknowl.    normal          acknowledged                    no data         refused

An alarm stays until somebody has seen it, even where the chart comes back or campaigns stop. A missing campaign is neither
inside nor outside: the count towards k, and that an alarm was acknowledged, live on behind `no data`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from fecore.errors import InputError


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
    """A state with what it remembers.

    Attributes:
        state: what is shown.
        outside: campaigns outside in a row, missing ones passed over.
        acknowledged: somebody has seen the alarm that these campaigns raised.
    """

    state: State = State.NO_DATA
    outside: int = 0
    acknowledged: bool = False


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
            raise InputError("state", f"is {condition.state.value}; only an alarm can be acknowledged")
        return replace(condition, state=State.ACKNOWLEDGED, acknowledged=True)
    if event is Event.MISSING:
        return condition if condition.state is State.ALARM else replace(condition, state=State.NO_DATA)
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
