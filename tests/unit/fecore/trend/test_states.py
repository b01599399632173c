"""The state machine, cell by cell of its table."""

from __future__ import annotations

import itertools

import pytest

from fecore.errors import InputError
from fecore.trend import Condition, Event, State, step, worst

I, O, M, A = Event.INSIDE, Event.OUTSIDE, Event.MISSING, Event.ACKNOWLEDGE  # noqa: E741
NO_DATA, NORMAL, PENDING, ALARM, SEEN = State


def walk(events: list[Event], pending: int = 2) -> list[State]:
    condition, states = Condition(), []
    for event in events:
        condition = step(condition, event, pending)
        states.append(condition.state)
    return states


@pytest.mark.parametrize(
    ("events", "states"),
    [
        ([I, O, O], [NORMAL, PENDING, ALARM]),
        ([O, I, O], [PENDING, NORMAL, PENDING]),
        ([I, M, I], [NORMAL, NO_DATA, NORMAL]),
        ([O, M, O], [PENDING, NO_DATA, ALARM]),  # a missing campaign is not inside
        ([O, O, I, M], [PENDING, ALARM, ALARM, ALARM]),  # an alarm waits to be seen
        ([O, O, A, O, O], [PENDING, ALARM, SEEN, SEEN, SEEN]),
        ([O, O, A, M, O], [PENDING, ALARM, SEEN, NO_DATA, SEEN]),
        ([O, O, A, I, O, O], [PENDING, ALARM, SEEN, NORMAL, PENDING, ALARM]),  # a new alarm after it was well
        ([M, M], [NO_DATA, NO_DATA]),
    ],
)
def test_stories(events: list[Event], states: list[State]) -> None:
    assert walk(events) == states


def test_an_alarm_needs_k_in_a_row_and_is_never_lost() -> None:
    for events in itertools.product((I, O, M), repeat=6):
        states = walk(list(events), 3)
        present = [e for e in events if e is not M]
        runs = [sum(1 for _ in group) for event, group in itertools.groupby(present) if event is O]
        assert (ALARM in states) == (max(runs, default=0) >= 3)
        assert ALARM not in states or states[-1] is ALARM


def test_the_worst_state_counts() -> None:
    assert worst((NORMAL, SEEN, NO_DATA)) is NO_DATA
    assert worst((NORMAL, ALARM, PENDING)) is ALARM
    with pytest.raises(InputError, match="states"):
        worst(())
    with pytest.raises(InputError, match="pending"):
        step(Condition(), I, 0)
