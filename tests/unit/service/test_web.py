"""The front of the service, without the rest: admission, bodies as they come, formats of answers."""

import asyncio
import hashlib
from collections.abc import Iterable
from typing import Any

import pytest
from starlette.types import Receive

from service.platform.errors import Invalid, NotAcceptable, TooManyRequests, TooSlow, Unavailable
from service.platform.web import uploads
from service.platform.web.admission import SLOT, AdmissionControl, Buckets, Slot, without_slot
from service.platform.web.negotiation import choose_format
from tests.support.waiting import awaited, completed, settle


@awaited
async def test_callers_take_turns() -> None:
    admission, order = AdmissionControl(1, 100, 60), []

    async def ask(name: str) -> None:
        slot = Slot(admission, name)
        await slot.take()
        order.append(name)
        await asyncio.sleep(0)
        slot.release()

    await admission.enter("first")
    requests = [asyncio.ensure_future(ask(name)) for name in "aaaabbc"]
    await settle()
    admission.leave(0)
    await asyncio.gather(*requests)
    assert order == list("abcabaa")
    assert (admission.answering, admission.waiting) == (0, 0)


@awaited
async def test_waiting_is_bounded_in_number() -> None:
    admission = AdmissionControl(1, 4, 60)
    await admission.enter("x")
    waiting = [asyncio.ensure_future(admission.enter(name)) for name in "aabc"]
    await settle()
    with pytest.raises(TooManyRequests, match="2 requests of this key wait already"):
        await admission.enter("a")
    with pytest.raises(Unavailable, match="1 requests are being answered and 4 wait"):
        await admission.enter("d")
    for _ in range(5):
        admission.leave(0)
        await settle()
    await asyncio.gather(*waiting)
    assert (admission.answering, admission.waiting) == (0, 0)


@awaited
async def test_one_client_under_two_names_leaves_places_to_others() -> None:
    """A key is counted under its address until it is known, and then under its name."""
    admission = AdmissionControl(1, 20, 60)
    await admission.enter("x")
    crowd = [
        asyncio.ensure_future(admission.enter(name)) for name in ["address"] * 20 + ["key"] * 20
    ]
    await settle()
    assert admission.waiting == 15
    others = [asyncio.ensure_future(admission.enter(name)) for name in "abcde"]
    await settle()
    assert admission.waiting == 20
    for one in (*crowd, *others):
        one.cancel()
    outcomes = await asyncio.gather(*crowd, *others, return_exceptions=True)
    assert sum(isinstance(answer, TooManyRequests) for answer in outcomes) == 25
    assert admission.waiting == 0


@awaited
async def test_who_is_refused_is_asked_to_come_back_when_the_queue_will_have_been_answered() -> (
    None
):
    admission = AdmissionControl(2, 40, 60)
    assert admission.retry_after() == 1
    for _ in range(2):
        await admission.enter("x")
    admission.leave(10)  # so answers seem to take 0.05 s + (10 s - 0.05 s)/20
    await admission.enter("x")
    waiting = [asyncio.ensure_future(admission.enter(str(number))) for number in range(40)]
    await settle()
    with pytest.raises(Unavailable, match="40 wait, as many as may wait") as full:
        await admission.enter("y")
    assert full.value.retry_after == admission.retry_after() == 11  # 40 · 0.5475 s / 2 slots
    for one in waiting:
        one.cancel()
    await asyncio.gather(*waiting, return_exceptions=True)
    assert admission.retry_after() == 1


@awaited
async def test_a_slot_is_given_back_once() -> None:
    admission = AdmissionControl(2, 4, 60)
    first, second, third = (Slot(admission, name) for name in "abc")
    assert first.try_take()
    await second.take()
    assert not third.try_take()
    third.release()  # it has none
    for _ in range(2):
        first.release()
        assert admission.answering == 1
    async with without_slot({SLOT: second}):
        assert admission.answering == 0
    assert admission.answering == 1
    async with without_slot({}):
        assert admission.answering == 1
    await third.take()
    waits = asyncio.ensure_future(Slot(admission, "d").take())
    await settle()
    assert admission.retry_after() == 1  # what was held was held for a moment
    waits.cancel()


@awaited
async def test_waiting_is_bounded_in_time() -> None:
    admission = AdmissionControl(1, 4, 0.01)
    await admission.enter("x")
    with pytest.raises(Unavailable, match=r"has waited 0\.01 s"):
        await admission.enter("a")
    assert (admission.answering, admission.waiting) == (1, 0)


@awaited
async def test_who_goes_away_leaves_no_gap() -> None:
    """Cancelled while it waits, or at the moment when its turn has come."""
    admission = AdmissionControl(1, 10, 60)
    await admission.enter("x")
    first, second, third = (asyncio.ensure_future(admission.enter(name)) for name in "abc")
    await settle()
    second.cancel()
    await settle()
    admission.leave(0)  # it is the first one's turn
    first.cancel()
    await third
    assert (admission.answering, admission.waiting) == (1, 0)
    for others in (["d"], []):  # it goes before its turn comes, and nobody has noticed yet
        gone, *others_wait = (
            asyncio.ensure_future(admission.enter(name)) for name in ["c", *others]
        )
        await settle()
        gone.cancel()
        admission.leave(0)
        await asyncio.gather(gone, *others_wait, return_exceptions=True)
        assert gone.cancelled()
        assert (admission.answering, admission.waiting) == (len(others), 0)


def test_buckets_fill_again() -> None:
    now = 100.0
    buckets = Buckets(10, 5, clock=lambda: now)
    assert [buckets.take("a") for _ in range(11)] == [0] * 10 + [1]
    assert buckets.take("b", 9) == 0
    assert buckets.take("b", 5) == 2  # 4 are lacking, and 2 come in a second
    now = 102.0
    assert buckets.take("b", 5) == 0
    assert buckets.left("a") == 4


def test_the_callers_that_were_silent_longest_are_forgotten(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("service.platform.web.admission.MOST_CALLERS", 2)
    buckets = Buckets(10, 5, clock=lambda: 0.0)
    for caller in "abac":
        assert buckets.take(caller, 2) == 0
    assert [buckets.left(caller) for caller in "abc"] == [6, 10, 8]


# --- bodies are received whole, within limits of size and time
# ----------------------------------------------------------

LIMIT = 4 * uploads.MEMORY_BYTES


def client(blocks: Iterable[bytes], *, ends: bool = True) -> Receive:
    """Sends these blocks; then nothing more, or never again anything."""
    messages: list[dict[str, Any]] = [
        {"type": "http.request", "body": b, "more_body": True} for b in blocks
    ]
    if ends:
        messages.append({"type": "http.request", "body": b"", "more_body": False})

    async def receive() -> dict[str, Any]:
        if not messages:
            await asyncio.Event().wait()
        return messages.pop(0)

    return receive


def received(receive: Receive) -> tuple[bytes, bytes, bool]:
    """The body as the application gets it, its digest, and whether it lay on disk."""

    async def run() -> tuple[bytes, bytes, bool]:
        scope: dict[str, Any] = {}
        async with uploads.spooled_body(scope, receive, LIMIT) as body:
            assert uploads.body_of(scope) is body
            again, whole, more = body.replayed(receive), b"", True
            while more:
                message = await again()
                whole, more = whole + message["body"], message["more_body"]
            path = body.on_disk()
            assert path is None or path.stat().st_size == body.size
        assert path is None or not path.exists()
        return whole, body.sha256, path is not None

    return completed(run())


@pytest.mark.parametrize("size", [0, 1, uploads.MEMORY_BYTES, uploads.MEMORY_BYTES + 1, LIMIT])
def test_a_body_comes_as_it_was_sent(size: int) -> None:
    whole = bytes(i % 251 for i in range(size))
    got, digest, on_disk = received(
        client([whole[i : i + 300_000] for i in range(0, size, 300_000)])
    )
    assert got == whole
    assert digest == hashlib.sha256(whole).digest()
    assert on_disk == (size > uploads.MEMORY_BYTES)


def test_silence_or_a_trickle_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "IDLE_SECONDS", 0.05)
    with pytest.raises(TooSlow, match="nothing of the body came"):
        received(client([b"x"], ends=False))
    monkeypatch.setattr(uploads, "GRACE_SECONDS", 0.0)
    monkeypatch.setattr(uploads, "SLOWEST", 1e12)
    with pytest.raises(TooSlow, match="comes too slowly"):
        received(client([b"x"] * 1000))


# --- which format an answer has, by the parameter `format` and by Accept with its q values (RFC
# 9110, 12. ---------------

KNOWN = {"json": "application/json", "csv": "text/csv", "npz": "application/x-npz"}


@pytest.mark.parametrize(
    ("wanted", "accept", "chosen"),
    [
        (None, None, "json"),
        (None, " ", "json"),
        ("npz", "text/csv", "npz"),
        (None, "*/*", "json"),
        (None, "text/*", "csv"),
        (None, "application/json;q=0.4, text/csv; q=0.5", "csv"),
        (None, "application/json; v=1; q=0.9, text/csv;q=0.8", "json"),
        (None, "*/*, application/json;q=0", "csv"),  # the most specific range counts
        (None, "text/csv;q=much, application/x-npz;q=0.1", "npz"),
        (None, "text/csv;q=7, application/json", "json"),
    ],
)
def test_the_format_that_the_client_likes_best(
    wanted: str | None, accept: str | None, chosen: str
) -> None:
    assert choose_format(wanted, accept, KNOWN) == chosen


def test_what_cannot_be_had_is_refused() -> None:
    with pytest.raises(Invalid, match="expected one of json, csv, npz"):
        choose_format("xml", None, KNOWN)
    with pytest.raises(NotAcceptable, match="image/png"):
        choose_format(None, "image/png, text/csv;q=0", KNOWN)
