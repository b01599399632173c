"""Bodies are received whole, within limits of size and time."""

import asyncio
import hashlib
from collections.abc import Iterable
from typing import Any

import pytest
from starlette.requests import ClientDisconnect
from starlette.types import Receive

from service.errors import PayloadTooLarge, TooSlow
from service.web import uploads

LIMIT = 4 * uploads.MEMORY_BYTES


def client(blocks: Iterable[bytes], *, ends: bool = True) -> Receive:
    """Sends these blocks; then nothing more, or never again anything."""
    messages: list[dict[str, Any]] = [{"type": "http.request", "body": b, "more_body": True} for b in blocks]
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

    return asyncio.run(run())


@pytest.mark.parametrize("size", [0, 1, uploads.MEMORY_BYTES, uploads.MEMORY_BYTES + 1, LIMIT])
def test_a_body_comes_as_it_was_sent(size: int) -> None:
    whole = bytes(i % 251 for i in range(size))
    got, digest, on_disk = received(client([whole[i : i + 300_000] for i in range(0, size, 300_000)]))
    assert got == whole
    assert digest == hashlib.sha256(whole).digest()
    assert on_disk == (size > uploads.MEMORY_BYTES)


def test_more_than_the_limit_is_refused() -> None:
    with pytest.raises(PayloadTooLarge):
        received(client([b"x" * uploads.MEMORY_BYTES] * 5))


def test_silence_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "IDLE_SECONDS", 0.05)
    with pytest.raises(TooSlow, match="nothing of the body came"):
        received(client([b"x"], ends=False))


def test_a_trickle_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "GRACE_SECONDS", 0.0)
    monkeypatch.setattr(uploads, "SLOWEST", 1e12)
    with pytest.raises(TooSlow, match="comes too slowly"):
        received(client([b"x"] * 1000))


def test_a_client_that_breaks_off_is_no_body() -> None:
    async def gone() -> dict[str, Any]:
        return {"type": "http.disconnect"}

    with pytest.raises(ClientDisconnect):
        received(gone)
