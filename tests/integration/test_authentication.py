"""Authentication before the house, asked as a server asks it: who comes in, what is read of a body, and
which slot is free when.
"""

import asyncio
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any
from uuid import UUID, uuid4

import pytest
from fastapi import APIRouter, Request
from pydantic import BaseModel
from starlette.requests import ClientDisconnect
from starlette.types import Message, Receive, Scope, Send

from service.platform.access.authentication import LARGE_BYTES, Authentication, Paths
from service.platform.access.keys import create_key, user_named
from service.platform.db.engine import Sessions
from service.platform.errors import Forbidden, NotFound
from service.platform.settings import Settings
from service.platform.web.admission import SLOT
from tests.support.waiting import awaited, settle

PREFIX = "/api/v1"
THING, FILE = UUID(int=1), UUID(int=2)


class Named(BaseModel):
    name: str


router = APIRouter(prefix=PREFIX)


@router.put("/things/{thing}")
def put_thing(thing: UUID, body: Named) -> None:
    """Takes JSON."""


@router.put("/files/{thing}/{part}")
def put_file(thing: UUID, part: str, request: Request) -> None:
    """Reads its body itself."""


@dataclass
class House:
    """The application behind a layer: answers with a status and keeps what it was asked."""

    status: int = 200
    requests: list[Scope] = field(default_factory=list)
    bodies: list[bytes] = field(default_factory=list)
    busy: list[tuple[int, int]] = field(default_factory=list)
    """Slots taken before and after the answer began."""
    layer: Authentication | None = None
    error: Exception | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.requests.append(scope)
        if self.error is not None:
            raise self.error
        if scope["type"] != "http":
            return
        body, more = b"", True
        while more:
            message = await receive()
            body += message.get("body", b"")
            more = message.get("more_body", False)
        self.bodies.append(body)
        before = self.layer.admission.answering
        await send({"type": "http.response.start", "status": self.status, "headers": []})
        self.busy.append((before, self.layer.admission.answering))
        await send({"type": "http.response.body", "body": b""})


Lookups = list[tuple[str, UUID, str]]


@dataclass
class Front:
    """A layer with its house, and the ways to it."""

    layer: Authentication
    house: House
    key: str
    looked: Lookups
    client: tuple[str, int] = ("10.0.0.1", 1)

    async def ask(
        self,
        *blocks: bytes,
        path: str = f"/things/{THING}",
        key: str | None = None,
        receive: Receive | None = None,
        **headers: str,
    ) -> tuple[int, dict[str, str], dict[str, Any]]:
        """Status, headers and body of the answer to a PUT; the blocks are counted unless `receive`
        is given.
        """
        shown = {"authorization": f"Bearer {self.key if key is None else key}", **headers}
        if blocks and "content_length" not in headers and "transfer_encoding" not in headers:
            shown["content_length"] = str(sum(map(len, blocks)))
        scope: dict[str, Any] = {
            "type": "http",
            "method": "PUT",
            "path": f"{PREFIX}{path}",
            "client": self.client,
            "headers": [
                (name.replace("_", "-").encode(), value.encode()) for name, value in shown.items()
            ],
        }
        left = list(blocks)

        async def next_block() -> Message:
            block = left.pop(0) if left else b""
            return {"type": "http.request", "body": block, "more_body": bool(left)}

        sent: list[Message] = []

        async def send(message: Message) -> None:
            sent.append(message)

        await self.layer(scope, receive or next_block, send)
        body = b"".join(message.get("body", b"") for message in sent)
        names = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
        return sent[0]["status"], names, json.loads(body) if body else {}


Open = Callable[..., Front]


@pytest.fixture
def front(sessions: Sessions) -> Open:
    """Makes layers; time stands still at them, so that no bucket fills again."""
    with sessions.begin() as session:
        key = create_key(session, user_named(session, "ada"), "k")[1]

    def make(refusal: Exception | None = None, **settings: Any) -> Front:
        house, looked = House(), []

        def find(_: object, user: Any, key: UUID, role: str) -> None:
            looked.append((user.name, key, role))
            if refusal is not None:
                raise refusal

        paths = Paths(router.routes, PREFIX, {"thing": find})
        layer = Authentication(
            house,
            Settings(database_url="postgresql://nowhere/x", **settings),
            sessions,
            paths,
            [PREFIX],
        )
        house.layer = layer
        for bucket in (layer._requests, layer._bytes, layer.keys._failures):
            bucket._clock = lambda: 0.0
        return Front(layer, house, key, looked)

    return make


async def nothing_comes() -> Message:
    raise AssertionError("the body was asked for")


@awaited
async def test_what_is_not_under_a_prefix_passes_by(front: Open) -> None:
    at = front()
    for scope in (
        {"type": "lifespan"},
        {"type": "websocket", "path": f"{PREFIX}/x"},
        {"type": "http", "path": "/api/v1"},
        {"type": "http", "path": "/api/v10/x"},
    ):
        at.house.error = KeyError("passed")
        with pytest.raises(KeyError, match="passed"):
            await at.layer(scope, nothing_comes, nothing_comes)
    assert len(at.house.requests) == 4


@awaited
async def test_nobody_without_a_key_comes_in_and_what_is_large_is_not_received(front: Open) -> None:
    at = front()
    for size, closed in ((0, False), (LARGE_BYTES, False), (LARGE_BYTES + 1, True)):
        status, headers, body = await at.ask(
            authorization="", content_length=str(size), receive=nothing_comes, path="/things/x"
        )
        assert (status, headers["www-authenticate"], body["status"]) == (401, "Bearer", 401)
        assert (headers.get("connection") == "close") is closed
    endless = await at.ask(authorization="", transfer_encoding="chunked", receive=nothing_comes)
    assert endless[1]["connection"] == "close"
    assert not at.house.requests


@awaited
async def test_a_key_is_known_once_an_answer_was_a_success(front: Open) -> None:
    for status, known in ((404, False), (300, False), (299, True), (200, True)):
        at = front()
        at.house.status = status
        assert (await at.ask())[0] == status
        caller = at.layer.keys.caller(f"Bearer {at.key}", "elsewhere")
        assert caller.known is known
    at.house.status = 401  # revoked meanwhile
    assert (await at.ask())[0] == 401
    count = len(at.house.requests)
    assert (await at.ask())[0] == 401  # by memory
    assert len(at.house.requests) == count


@awaited
async def test_a_slot_is_held_until_the_answer_begins_and_never_lost(front: Open) -> None:
    at = front(database_pool=2)
    assert (await at.ask(b"{}"))[0] == 200
    assert at.house.requests[-1][SLOT] is not None
    assert at.house.busy == [(1, 0)]
    at.house.error = RuntimeError("unheard of")
    with pytest.raises(RuntimeError, match="unheard of"):
        await at.ask(b"{}")
    at.house.error = Forbidden("the application answers its own errors")
    with pytest.raises(Forbidden):
        await at.ask(b"{}")
    assert (at.layer.admission.answering, at.layer.admission.waiting) == (0, 0)


@awaited
async def test_bodies_have_a_limit_by_their_kind(front: Open) -> None:
    at = front(json_limit_bytes=10, upload_limit_bytes=20)
    for kind, limit in (
        ("application/json", 10),
        ("application/merge-patch+json", 10),
        ("text/csv", 20),
    ):
        assert (await at.ask(b"x" * limit, content_type=kind))[0] == 200
        status, _, body = await at.ask(
            content_length=str(limit + 1), content_type=kind, receive=nothing_comes, path="/x"
        )
        assert (status, f"larger than {limit} bytes" in body["detail"]) == (413, True)
        for length in ({"transfer_encoding": "chunked"}, {"content_length": "many"}):
            assert (await at.ask(b"x" * limit, content_type=kind, **length))[0] == 200
            assert (await at.ask(b"x" * limit, b"x", content_type=kind, **length))[0] == 413
    assert {len(body) for body in at.house.bodies} == {10, 20}


@awaited
async def test_key_and_role_are_asked_before_what_costs_is_received(front: Open) -> None:
    """The role where a body is large, where the key is new, and where a route reads its body
    itself; else the route asks.
    """
    for refusal, status in ((NotFound("thing", THING), 404), (Forbidden("a viewer"), 403)):
        at = front(refusal)
        for path in (f"/things/{THING}", f"/files/{FILE}/x"):
            assert (await at.ask(content_length="5", receive=nothing_comes, path=path))[0] == status
        assert at.looked == [("ada", THING, "editor"), ("ada", FILE, "editor")]
        assert (at.layer.admission.answering, at.house.requests) == (0, [])
    at = front()
    assert (await at.ask())[0] == 200  # nothing to read, so nothing is asked here
    assert at.looked == []
    known = at.layer.keys.caller(f"Bearer {at.key}", "x").known
    assert known
    assert (await at.ask(b"x" * LARGE_BYTES))[0] == 200
    assert at.looked == []
    assert (await at.ask(b"x" * (LARGE_BYTES + 1)))[0] == 200
    assert (await at.ask(b"x", path=f"/files/{FILE}/x"))[0] == 200
    # the route says what is wrong with it
    assert (await at.ask(b"x", path="/files/none/x"))[0] == 200
    assert at.looked == [("ada", THING, "editor"), ("ada", FILE, "editor")]
    assert at.house.requests[-1]["route"].path == f"{PREFIX}/files/{{thing}}/{{part}}"


@awaited
async def test_a_wrong_key_is_found_out_before_its_body_and_then_by_memory(
    front: Open, sessions: Sessions
) -> None:
    at = front(key_failures_a_minute=1)
    wrong = f"{at.key[:-1]}{'a' if at.key[-1] != 'a' else 'b'}"
    assert (await at.ask(content_length="5", receive=nothing_comes, key=wrong))[0] == 401
    assert (await at.ask(content_length="5", receive=nothing_comes, key=wrong))[0] == 401
    at.client = ("10.0.0.1", 2)
    status, headers, _ = await at.ask(key=f"{wrong}c")
    assert (status, headers["retry-after"]) == (429, "60")
    assert (await at.ask())[0] == 200  # a right key that nobody knew yet, from there
    assert len(at.house.requests) == 1
    at.house.requests.clear()
    at.client = ("10.0.0.2", 1)
    assert (await at.ask(content_length="5", receive=nothing_comes, key=f"{wrong}d"))[0] == 401
    assert (at.layer.admission.answering, at.house.requests, at.looked) == (0, [], [])
    with sessions.begin() as session:
        narrow = create_key(session, user_named(session, "bob"), "k", scopes=("read",))[1]
    at = front()
    status, _, body = await at.ask(content_length="5", receive=nothing_comes, key=narrow)
    assert (status, "scope write" in body["detail"]) == (403, True)


@awaited
async def test_requests_and_bytes_of_a_key_are_counted(front: Open) -> None:
    at = front(key_requests_a_second=1)
    assert [(await at.ask())[0] for _ in range(10)] == [200] * 10  # the first as an address
    assert (await at.ask())[0] == 200
    status, headers, body = await at.ask()
    assert (status, headers["retry-after"], "more than 1 requests a second" in body["detail"]) == (
        429,
        "1",
        True,
    )
    at = front(key_bytes_an_hour=100)
    await at.ask()
    assert [(await at.ask(b"x" * 60))[0], (await at.ask(b"x" * 40))[0]] == [200, 200]
    status, headers, body = await at.ask(b"x")
    assert (status, headers["retry-after"], "more than 100 bytes an hour" in body["detail"]) == (
        429,
        "36",
        True,
    )


class Slow:
    """A body that comes when it is let in."""

    def __init__(self) -> None:
        self.called, self.go = asyncio.Event(), asyncio.Event()

    async def __call__(self) -> Message:
        self.called.set()
        await self.go.wait()
        return {"type": "http.request", "body": b"x"}


@awaited
async def test_so_many_large_bodies_are_received_at_a_time(front: Open) -> None:
    at = front(uploads=2)
    large = {"content_length": str(LARGE_BYTES + 1)}
    for end in ({"type": "http.disconnect"}, {"type": "http.request", "body": b"x"}):
        slow: Sequence[Slow] = (Slow(), Slow())
        coming = [asyncio.ensure_future(at.ask(receive=one, **large)) for one in slow]
        for one in slow:
            await one.called.wait()
        status, headers, body = await at.ask(receive=nothing_comes, **large)
        assert (status, headers["connection"]) == (503, "close")
        assert body["detail"].startswith("2 uploads are being received")
        assert (await at.ask(b"{}"))[0] == 200  # what is small comes in

        async def ended(end: dict[str, Any] = end) -> Message:
            return end

        for one in slow:
            one.go.set()
        assert [answer[0] for answer in await asyncio.gather(*coming)] == [200, 200]
        for _ in range(3):  # nor does one that is broken off stay counted
            if end["type"] == "http.disconnect":
                with pytest.raises(ClientDisconnect):
                    await at.ask(receive=ended, **large)
            else:
                assert (await at.ask(receive=ended, **large))[0] == 200


@awaited
async def test_who_goes_away_while_waiting_leaves_no_gap(front: Open) -> None:
    at = front(database_pool=1)
    inside, go = asyncio.Event(), asyncio.Event()
    answer = at.house.__call__

    async def held(scope: Scope, receive: Receive, send: Send) -> None:
        inside.set()
        await go.wait()
        await answer(scope, receive, send)

    at.layer.app = held
    first = asyncio.ensure_future(at.ask())
    await inside.wait()
    waits = asyncio.Event()

    async def leaves() -> Message:
        if waits.is_set():  # the empty body has come
            return {"type": "http.disconnect"}
        waits.set()
        return {"type": "http.request", "body": b""}

    with pytest.raises(ClientDisconnect):
        await at.ask(receive=leaves)
    await settle()
    assert (at.layer.admission.answering, at.layer.admission.waiting) == (1, 0)
    second = asyncio.ensure_future(at.ask(receive=Patient()))
    await settle()
    assert (at.layer.admission.answering, at.layer.admission.waiting) == (1, 1)
    go.set()
    assert [(await first)[0], (await second)[0]] == [200, 200]
    assert (at.layer.admission.answering, at.layer.admission.waiting) == (0, 0)


class Patient:
    """A client that has sent an empty body, and stays."""

    def __init__(self) -> None:
        self.sent = False

    async def __call__(self) -> Message:
        if self.sent:
            await asyncio.Event().wait()
        self.sent = True
        return {"type": "http.request", "body": b""}


def test_ids_of_a_path_are_found_by_method_and_pattern() -> None:
    def find(*_: object) -> None:
        """Never called."""

    paths = Paths(router.routes, PREFIX, {"thing": find})
    key = uuid4()
    for method, path, expected in (
        ("PUT", f"/things/{key}", [(find, key)]),
        ("PUT", f"/files/{key}/{uuid4()}", [(find, key)]),
        ("GET", f"/things/{key}", []),
        ("PUT", f"/things/{key}/more", []),
        ("PUT", "/things/x", []),
    ):
        scope: Scope = {"method": method, "path": PREFIX + path}
        assert paths.find(scope) == expected
        assert ("route" in scope) is (bool(expected) or path == "/things/x")
