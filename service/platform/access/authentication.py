"""Authentication and admission of requests: who asks, how often and how much is checked before a body is read, and
a body is received whole before the request takes a slot (docs/limits.md).

One API process remembers verdicts on keys, so that who is turned away costs neither a transaction
nor a slot. A key that was found valid a moment ago is counted under its own name by admission
control, any other under the address that it came from. Nothing is let in by memory alone: the
transaction that answers a request asks for the key again.
"""

import asyncio
import hashlib
import hmac
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Any
from uuid import UUID

from fastapi.routing import APIRoute
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.routing import BaseRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.platform.access.keys import (
    COOKIE,
    HEADER,
    authenticated_key,
    is_session_token,
    request_token,
    require_scope,
)
from service.platform.access.lookup import Role
from service.platform.access.tables import User
from service.platform.db.engine import Sessions
from service.platform.errors import (
    Forbidden,
    PayloadTooLarge,
    TooManyRequests,
    Unauthorized,
    Unavailable,
)
from service.platform.settings import Settings
from service.platform.web.admission import SLOT, AdmissionControl, Buckets, Slot
from service.platform.web.negotiation import content_type, is_json
from service.platform.web.problems import problem_of
from service.platform.web.uploads import answer_early, spooled_body, too_large

SAFE = ("GET", "HEAD", "OPTIONS")

LARGE_BYTES = 65536  # of a body before which key and role are checked, even of a key that is known

SECONDS = 30.0  # for which a verdict is remembered
MOST_KEYS = 10_000
MISSING = "send `Authorization: Bearer KEY`; make a key with `modalbase keys create --name NAME`"
TOO_MANY_WRONG = (
    "too many wrong keys came from this address, and this one is wrong too; wait a minute"
)
INVALID = "the API key is not valid; make one with `modalbase keys create --name NAME`"


@dataclass(frozen=True)
class Caller:
    """Who asks, as far as is known before the database was asked."""

    # under which requests are counted: the key where it was valid a moment ago, else the address
    name: str
    digest: bytes  # of the key
    token: str  # the key
    known: bool  # the key was valid a moment ago
    suspect: bool  # the address has tried too many wrong keys, and this one is not known


class KnownKeys:
    """Verdicts on keys, and the number of wrong keys that each address has tried."""

    def __init__(self, failures_a_minute: int) -> None:
        self._verdicts: OrderedDict[bytes, tuple[bool, float]] = OrderedDict()
        self._failures = Buckets(failures_a_minute, 60.0)

    def caller(self, authorization: str | None, address: str) -> Caller:
        """Who asks.

        Raises:
            Unauthorized: there is no key, or it was wrong a moment ago.
        """
        scheme, _, token = (authorization or "").partition(" ")
        token = token.strip()
        if scheme.lower() != "bearer" or not token:
            raise Unauthorized(MISSING)
        digest = hashlib.sha256(token.encode("utf-8", "surrogatepass")).digest()
        verdict = self._verdict(digest)
        if verdict is False:
            raise Unauthorized(INVALID)
        known = verdict is True
        suspect = not known and self._failures.left(address) < 1
        return Caller(
            f"key {digest.hex()}" if known else f"address {address}", digest, token, known, suspect
        )

    def remember(self, caller: Caller, address: str, *, valid: bool) -> None:
        """The database was asked."""
        if not valid and self._verdict(caller.digest) is not False:
            self._failures.take(address)
        self._verdicts[caller.digest] = valid, time.monotonic() + SECONDS
        self._verdicts.move_to_end(caller.digest)
        if len(self._verdicts) > MOST_KEYS:
            self._verdicts.popitem(last=False)

    def _verdict(self, digest: bytes) -> bool | None:
        valid, until = self._verdicts.get(digest, (None, 0.0))
        return valid if time.monotonic() < until else None


class SessionCookie:
    """ASGI layer: a request that comes with a session's cookie and without `Authorization` gets the
    session's token.

    One that changes something is refused where it lacks the session's request token: another site
    may send the cookie's owner here, but cannot read that token.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        token = session_token(scope) if scope["type"] == "http" else None
        if token is None:
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if scope["method"] not in SAFE and not _proven(token, headers.get(HEADER, "")):
            answer = problem_of(
                Forbidden(
                    f"a request with a session's cookie needs its token in the header {HEADER}"
                )
            )
            assert answer is not None
            await answer(scope, receive, send)
            return
        authorization = (b"authorization", f"Bearer {token}".encode())
        await self.app({**scope, "headers": [*scope["headers"], authorization]}, receive, send)


def session_token(scope: Scope) -> str | None:
    """The token of the session's cookie; None where the request has none, or states a key."""
    headers = Headers(scope=scope)
    if "authorization" in headers:
        return None
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:  # other cookies of this host, which are not ours to judge
        return None
    return (
        morsel.value
        if morsel is not None and is_session_token(morsel.value) and morsel.value.isascii()
        else None
    )


def _proven(token: str, sent: str) -> bool:
    return hmac.compare_digest(request_token(token).encode(), sent.encode("utf-8", "surrogatepass"))


Finder = Callable[[Session, User, UUID, Role], object]
"""Finds what an id of a path names, or raises what the route itself would."""


class Paths:
    """The routes with ids in their paths, to know what a body is for before it is read."""

    def __init__(
        self, routes: Sequence[BaseRoute], prefix: str, finders: Mapping[str, Finder]
    ) -> None:
        self._finders = finders
        self._routes = [
            route
            for route in routes
            if isinstance(route, APIRoute) and route.path.startswith(f"{prefix}/")
        ]

    def find(self, scope: Scope) -> list[tuple[Finder, UUID]]:
        """What the ids of a path name. The route goes into the scope, where log and metrics look
        for it.
        """
        for route in self._routes:
            if scope["method"] in (route.methods or ()) and (
                match := route.path_regex.match(scope["path"])
            ):
                scope["route"] = route
                ids = {
                    name: _uuid(value)
                    for name, value in match.groupdict().items()
                    if name in self._finders
                }
                return [
                    (self._finders[name], value) for name, value in ids.items() if value is not None
                ]
        return []


@dataclass
class _Visit:
    """A request that asks to be admitted."""

    scope: Scope
    caller: Caller
    address: str
    slot: Slot
    inside: bool = False


class Authentication:
    """ASGI layer before the API and its pages; what is not under one of its prefixes passes by."""

    def __init__(
        self,
        app: ASGIApp,
        settings: Settings,
        sessions: Sessions,
        paths: Paths,
        prefixes: Sequence[str],
    ) -> None:
        self.app, self._settings, self._sessions = app, settings, sessions
        self._paths, self._prefixes = paths, tuple(f"{prefix}/" for prefix in prefixes)
        self.admission = AdmissionControl(
            settings.database_pool, settings.request_queue, settings.request_wait_seconds
        )
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
        """Who asks; without a transaction."""
        address = scope["client"][0] if scope.get("client") else "unknown"
        caller = self.keys.caller(Headers(scope=scope).get("authorization"), address)
        if seconds := self._requests.take(caller.name):
            most = self._settings.key_requests_a_second
            raise TooManyRequests(
                f"more than {most} requests a second of one key", retry_after=seconds
            )
        return _Visit(scope, caller, address, Slot(self.admission, caller.name))

    async def _admitted(self, visit: _Visit, receive: Receive, send: Send) -> None:
        """The request with its body, as soon as there is a slot for it."""
        scope, length = visit.scope, _length(visit.scope)
        limit, better = self._limit(scope)
        # What is sent again may be answered by what is kept, so the role is asked for here.
        again = "idempotency-key" in Headers(scope=scope)
        if length or again or visit.caller.suspect:
            targets = self._paths.find(scope) if length or again else []
            if length > LARGE_BYTES or not visit.caller.known or again or _reads_itself(scope):
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
                    raise TooManyRequests(
                        f"more than {most} bytes an hour of one key", retry_after=seconds
                    )
                try:
                    await self._wait_for_slot(visit, receive)
                    visit.inside, scope[SLOT] = True, visit.slot
                    await self.app(scope, body.replayed(receive), self._watched(visit, send))
                finally:
                    visit.slot.release()
        finally:
            if large:
                self._count_uploads(-1)

    def _count_uploads(self, change: int) -> None:
        if change > 0 and self._receiving >= self._settings.uploads:
            raise Unavailable(
                f"{self._receiving} uploads are being received, as many as may be; try again"
            )
        self._receiving += change

    async def _may_send(self, visit: _Visit, targets: Sequence[tuple[Finder, UUID]]) -> None:
        """Key and role, in a transaction that is over before the body comes."""
        await visit.slot.take()
        try:
            await run_in_threadpool(self._check, visit, targets)
        except Unauthorized:
            self.keys.remember(visit.caller, visit.address, valid=False)
            if visit.caller.suspect:
                raise TooManyRequests(TOO_MANY_WRONG, retry_after=60) from None
            raise
        finally:
            visit.slot.release()

    def _check(self, visit: _Visit, targets: Sequence[tuple[Finder, UUID]]) -> None:
        with self._sessions.begin() as session:
            key, user = authenticated_key(session, visit.caller.token)
            if "route" in visit.scope:
                require_scope(key, visit.scope)
            for find, target in targets:
                find(session, user, target, "editor")

    async def _wait_for_slot(self, visit: _Visit, receive: Receive) -> None:
        """Take a slot, unless the client is gone before it is this one's turn."""
        if visit.slot.try_take():
            return
        entering, leaving = (
            asyncio.ensure_future(visit.slot.take()),
            asyncio.ensure_future(receive()),
        )
        try:
            await asyncio.wait({entering, leaving}, return_when=asyncio.FIRST_COMPLETED)
            if not entering.done():
                raise ClientDisconnect
            await entering
        finally:
            entering.cancel()
            leaving.cancel()

    def _watched(self, visit: _Visit, send: Send) -> Send:
        """The slot is free when the answer begins: the transaction is over, and what follows is for
        the line alone.
        """

        async def watched(message: Message) -> None:
            if message["type"] == "http.response.start":
                visit.slot.release()
                status = message["status"]
                if status == 401 or (not visit.caller.known and status < 300):
                    self.keys.remember(visit.caller, visit.address, valid=status != 401)
            await send(message)

        return watched

    def _limit(self, scope: Scope) -> tuple[int, str]:
        """The most bytes of the body, and what else one may do with more."""
        most = self._settings.upload_limit_bytes
        if not is_json(content_type(Headers(scope=scope).get("content-type"))):
            return most, ""
        measured = scope["path"].endswith(("/frfs", "/records"))
        better = (
            f"; send it as a file, such as npz, to the same address or to …/imports: up to {most}"
            " bytes"
        )
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
    """Whether the route takes more than JSON: what it does with a body costs more than to ask for
    the role.
    """
    return getattr(scope.get("route"), "body_field", None) is None


def _uuid(value: Any) -> UUID | None:
    try:
        return UUID(value)
    except ValueError:
        return None
