"""The door before the house: who asks, how often and how much is checked before a body is read, and a body is received
whole before the request takes a slot (docs/limits.md).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import UUID

from fastapi.routing import APIRoute
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.routing import BaseRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.access.keys import found_key
from service.access.known_keys import Caller, KnownKeys
from service.access.projects import Role
from service.access.scopes import require_scope
from service.access.tables import User
from service.db.engine import Sessions
from service.errors import PayloadTooLarge, TooManyRequests, Unauthorized, Unavailable
from service.settings import Settings
from service.web.buckets import Buckets
from service.web.gate import SLOT, Gate, Slot
from service.web.negotiation import content_type, is_json
from service.web.problems import problem_of
from service.web.spool import answer_early, spooled_body, too_large

Finder = Callable[[Session, User, UUID, Role], object]
"""Finds what an id of a path names, or raises what the route itself would."""

LARGE_BYTES = 65536  # of a body before which key and role are checked, even of a key that is known


class Paths:
    """The routes with ids in their paths, to know what a body is for before it is read."""

    def __init__(self, routes: Sequence[BaseRoute], prefix: str, finders: Mapping[str, Finder]) -> None:
        self._finders = finders
        self._routes = [
            route for route in routes if isinstance(route, APIRoute) and route.path.startswith(f"{prefix}/")
        ]

    def find(self, scope: Scope) -> list[tuple[Finder, UUID]]:
        """What the ids of a path name. The route goes into the scope, where log and metrics look for it."""
        for route in self._routes:
            if scope["method"] in (route.methods or ()) and (match := route.path_regex.match(scope["path"])):
                scope["route"] = route
                ids = {name: _uuid(value) for name, value in match.groupdict().items() if name in self._finders}
                return [(self._finders[name], value) for name, value in ids.items() if value is not None]
        return []


@dataclass
class _Visit:
    """A request at the door."""

    scope: Scope
    caller: Caller
    address: str
    slot: Slot
    inside: bool = False


class Door:
    """ASGI layer before the API and its pages; what is not under one of its prefixes passes by."""

    def __init__(
        self, app: ASGIApp, settings: Settings, sessions: Sessions, paths: Paths, prefixes: Sequence[str]
    ) -> None:
        self.app, self._settings, self._sessions = app, settings, sessions
        self._paths, self._prefixes = paths, tuple(f"{prefix}/" for prefix in prefixes)
        self.gate = Gate(settings.database_pool, settings.request_queue, settings.request_wait_seconds)
        self.keys = KnownKeys(settings.key_failures_a_minute)
        self._requests = Buckets(10 * settings.key_requests_a_second, 10.0)
        self._bytes = Buckets(settings.key_bytes_an_hour, 3600.0)
        self._receiving = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http" or not scope["path"].startswith(self._prefixes):
            await self.app(scope, receive, send)
            return
        visit: _Visit | None = None
        try:
            visit = self._arrived(scope)
            await self._admitted(visit, receive, send)
        except Exception as error:
            answer = None if visit is not None and visit.inside else problem_of(error)
            if answer is None:
                raise
            if _length(scope) > LARGE_BYTES:  # it is not worth receiving
                answer.headers["Connection"] = "close"
                if isinstance(error, PayloadTooLarge):
                    await answer_early(answer, scope, receive, send)
                    return
            await answer(scope, receive, send)

    def _arrived(self, scope: Scope) -> _Visit:
        """Who is at the door; without a transaction."""
        address = scope["client"][0] if scope.get("client") else "unknown"
        caller = self.keys.caller(Headers(scope=scope).get("authorization"), address)
        if seconds := self._requests.take(caller.name):
            most = self._settings.key_requests_a_second
            raise TooManyRequests(f"more than {most} requests a second of one key", retry_after=seconds)
        return _Visit(scope, caller, address, Slot(self.gate, caller.name))

    async def _admitted(self, visit: _Visit, receive: Receive, send: Send) -> None:
        """The request with its body, as soon as there is a slot for it."""
        scope, length = visit.scope, _length(visit.scope)
        limit, better = self._limit(scope)
        if length:
            targets = self._paths.find(scope)
            if length > LARGE_BYTES or not visit.caller.known or _reads_itself(scope):
                await self._may_send(visit, targets)
        if length > limit and length != _UNKNOWN:
            raise PayloadTooLarge(too_large(limit, better))
        large = length > LARGE_BYTES
        if large:
            self._count_uploads(+1)
        try:
            async with spooled_body(scope, receive, limit, better) as body:
                if large:
                    self._count_uploads(-1)
                    large = False
                if seconds := self._bytes.take(visit.caller.name, body.size):
                    most = self._settings.key_bytes_an_hour
                    raise TooManyRequests(f"more than {most} bytes an hour of one key", retry_after=seconds)
                try:
                    await self._wait_for_slot(visit, receive)
                    visit.inside, scope[SLOT] = True, visit.slot
                    await self.app(scope, body.replayed(receive), self._watched(visit, send))
                finally:
                    visit.slot.give_back()
        finally:
            if large:
                self._count_uploads(-1)

    def _count_uploads(self, change: int) -> None:
        if change > 0 and self._receiving >= self._settings.uploads:
            raise Unavailable(f"{self._receiving} uploads are being received, as many as may be; try again")
        self._receiving += change

    async def _may_send(self, visit: _Visit, targets: Sequence[tuple[Finder, UUID]]) -> None:
        """Key and role, in a transaction that is over before the body comes."""
        await visit.slot.take()
        try:
            await run_in_threadpool(self._check, visit, targets)
        except Unauthorized:
            self.keys.found(visit.caller, visit.address, valid=False)
            raise
        finally:
            visit.slot.give_back()

    def _check(self, visit: _Visit, targets: Sequence[tuple[Finder, UUID]]) -> None:
        with self._sessions.begin() as session:
            key, user = found_key(session, visit.caller.token)
            if "route" in visit.scope:
                require_scope(key, visit.scope)
            for find, target in targets:
                find(session, user, target, "editor")

    async def _wait_for_slot(self, visit: _Visit, receive: Receive) -> None:
        """Take a slot, unless the client is gone before it is this one's turn."""
        if visit.slot.try_take():
            return
        entering, leaving = asyncio.ensure_future(visit.slot.take()), asyncio.ensure_future(receive())
        try:
            await asyncio.wait({entering, leaving}, return_when=asyncio.FIRST_COMPLETED)
            if not entering.done():
                raise ClientDisconnect
            await entering
        finally:
            entering.cancel()
            leaving.cancel()

    def _watched(self, visit: _Visit, send: Send) -> Send:
        """The slot is free when the answer begins: the transaction is over, and what follows is for the line alone."""

        async def watched(message: Message) -> None:
            if message["type"] == "http.response.start":
                visit.slot.give_back()
                status = message["status"]
                if status == 401 or (not visit.caller.known and status < 300):
                    self.keys.found(visit.caller, visit.address, valid=status != 401)
            await send(message)

        return watched

    def _limit(self, scope: Scope) -> tuple[int, str]:
        """The most bytes of the body, and what else one may do with more."""
        most = self._settings.upload_limit_bytes
        if not is_json(content_type(Headers(scope=scope).get("content-type"))):
            return most, ""
        measured = scope["path"].endswith(("/frfs", "/records"))
        better = f"; send it as a file, such as npz, to the same address or to …/imports: up to {most} bytes"
        return self._settings.json_limit_bytes, better if measured else ""


_UNKNOWN = 2**62


def _length(scope: Scope) -> int:
    """Bytes of the body, as far as the client says so; 0 of what has none."""
    headers = Headers(scope=scope)
    declared = headers.get("content-length", "")
    if declared.isdecimal():
        return int(declared)
    return _UNKNOWN if "transfer-encoding" in headers or declared else 0


def _reads_itself(scope: Scope) -> bool:
    """Whether the route takes more than JSON: what it does with a body costs more than to ask for the role."""
    return getattr(scope.get("route"), "body_field", None) is None


def _uuid(value: Any) -> UUID | None:
    try:
        return UUID(value)
    except ValueError:
        return None
