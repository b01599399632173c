"""The gate: slots, turns, and what waits. No slot is ever lost."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from service.errors import TooManyRequests, Unavailable
from service.web.gate import SLOT, Buckets, Gate, Slot, without_slot


def run(test: Callable[[], Awaitable[Any]]) -> None:
    asyncio.run(test())


async def settle() -> None:
    """Let everything that can go on do so."""
    for _ in range(10):
        await asyncio.sleep(0)


def test_callers_take_turns() -> None:
    async def test() -> None:
        gate, order = Gate(1, 100, 60), []

        async def ask(name: str) -> None:
            slot = Slot(gate, name)
            await slot.take()
            order.append(name)
            await asyncio.sleep(0)
            slot.give_back()

        await gate.enter("first")
        asked = [asyncio.ensure_future(ask(name)) for name in "aaaabbc"]
        await settle()
        gate.leave(0)
        await asyncio.gather(*asked)
        assert order == list("abcabaa")
        assert (gate.answering, gate.waiting) == (0, 0)

    run(test)


def test_waiting_is_bounded_in_number() -> None:
    async def test() -> None:
        gate = Gate(1, 4, 60)
        await gate.enter("x")
        waiting = [asyncio.ensure_future(gate.enter(name)) for name in "aabc"]
        await settle()
        with pytest.raises(TooManyRequests, match="2 requests of this key wait already"):
            await gate.enter("a")
        with pytest.raises(Unavailable, match="1 requests are being answered and 4 wait"):
            await gate.enter("d")
        for _ in range(5):
            gate.leave(0)
            await settle()
        await asyncio.gather(*waiting)
        assert (gate.answering, gate.waiting) == (0, 0)

    run(test)


def test_one_client_under_two_names_leaves_places_to_others() -> None:
    """A key is counted under its address until it is known, and then under its name."""

    async def test() -> None:
        gate = Gate(1, 20, 60)
        await gate.enter("x")
        crowd = [asyncio.ensure_future(gate.enter(name)) for name in ["address"] * 20 + ["key"] * 20]
        await settle()
        assert gate.waiting == 15
        others = [asyncio.ensure_future(gate.enter(name)) for name in "abcde"]
        await settle()
        assert gate.waiting == 20
        for one in (*crowd, *others):
            one.cancel()
        found = await asyncio.gather(*crowd, *others, return_exceptions=True)
        assert sum(isinstance(answer, TooManyRequests) for answer in found) == 25
        assert gate.waiting == 0

    run(test)


def test_who_is_refused_is_asked_to_come_back_when_the_queue_will_have_been_answered() -> None:
    async def test() -> None:
        gate = Gate(2, 40, 60)
        assert gate.retry_after() == 1
        for _ in range(2):
            await gate.enter("x")
        gate.leave(10)  # so answers seem to take 0.05 s + (10 s - 0.05 s)/20
        await gate.enter("x")
        waiting = [asyncio.ensure_future(gate.enter(str(number))) for number in range(40)]
        await settle()
        with pytest.raises(Unavailable, match="40 wait, as many as may wait") as full:
            await gate.enter("y")
        assert full.value.retry_after == gate.retry_after() == 11  # 40 · 0.5475 s / 2 slots
        for one in waiting:
            one.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)
        assert gate.retry_after() == 1

    run(test)


def test_a_slot_is_given_back_once() -> None:
    async def test() -> None:
        gate = Gate(2, 4, 60)
        first, second, third = (Slot(gate, name) for name in "abc")
        assert first.try_take()
        await second.take()
        assert not third.try_take()
        third.give_back()  # it has none
        for _ in range(2):
            first.give_back()
            assert gate.answering == 1
        async with without_slot({SLOT: second}):
            assert gate.answering == 0
        assert gate.answering == 1
        async with without_slot({}):
            assert gate.answering == 1
        await third.take()
        waits = asyncio.ensure_future(Slot(gate, "d").take())
        await settle()
        assert gate.retry_after() == 1  # what was held was held for a moment
        waits.cancel()

    run(test)


def test_waiting_is_bounded_in_time() -> None:
    async def test() -> None:
        gate = Gate(1, 4, 0.01)
        await gate.enter("x")
        with pytest.raises(Unavailable, match=r"has waited 0\.01 s"):
            await gate.enter("a")
        assert (gate.answering, gate.waiting) == (1, 0)

    run(test)


def test_who_goes_away_leaves_no_gap() -> None:
    """Cancelled while it waits, or at the moment when its turn has come."""

    async def test() -> None:
        gate = Gate(1, 10, 60)
        await gate.enter("x")
        first, second, third = (asyncio.ensure_future(gate.enter(name)) for name in "abc")
        await settle()
        second.cancel()
        await settle()
        gate.leave(0)  # it is the first one's turn
        first.cancel()
        await third
        assert (gate.answering, gate.waiting) == (1, 0)
        for others in (["d"], []):  # it goes before its turn comes, and nobody has noticed yet
            gone, *others_wait = (asyncio.ensure_future(gate.enter(name)) for name in ["c", *others])
            await settle()
            gone.cancel()
            gate.leave(0)
            await asyncio.gather(gone, *others_wait, return_exceptions=True)
            assert gone.cancelled()
            assert (gate.answering, gate.waiting) == (len(others), 0)

    run(test)


def test_buckets_fill_again() -> None:
    now = 100.0
    buckets = Buckets(10, 5, clock=lambda: now)
    assert [buckets.take("a") for _ in range(11)] == [0] * 10 + [1]
    assert buckets.take("b", 9) == 0
    assert buckets.take("b", 5) == 2  # 4 are lacking, and 2 come in a second
    now = 102.0
    assert buckets.take("b", 5) == 0
    assert buckets.left("a") == 4


def test_the_callers_that_were_silent_longest_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.web.gate.MOST_CALLERS", 2)
    buckets = Buckets(10, 5, clock=lambda: 0.0)
    for caller in "abac":
        assert buckets.take(caller, 2) == 0
    assert [buckets.left(caller) for caller in "abc"] == [6, 10, 8]
