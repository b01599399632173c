"""What wraps every request: the hosts that the service answers to, its id, its log line, headers
for browsers, the answer to the unexpected, and an end for clients that open a line and then say
nothing.
"""

import asyncio
import time
from collections.abc import Sequence
from typing import Any
from urllib.parse import urlsplit

import structlog
from prometheus_client import Histogram
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.auto import AutoHTTPProtocol

from service.platform.logs import REQUEST_ID_HEADER, adopt_request_id
from service.platform.web.problems import problem

OWN = ("localhost", "127.0.0.1", "::1")
ANY_NAME = ("/healthz", "/readyz", "/metrics")
"""What probes ask for, by whatever address they have; it depends on no name."""


class KnownHosts:
    """ASGI layer: a request whose `Host` is none of the service's is refused, 421 (RFC 9110,
    7.4).
    """

    def __init__(self, app: ASGIApp, allowed: Sequence[str]) -> None:
        """Name the hosts.

        Args:
            app: what is behind.
            allowed: names and addresses, `*.name` for all below a name; those of the machine itself
                are always allowed.
        """
        self.app = app
        self._names = {*OWN, *(name for name in allowed if not name.startswith("*."))}
        self._suffixes = tuple(name[1:] for name in allowed if name.startswith("*."))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if (
            scope["type"] == "http"
            and scope["path"] not in ANY_NAME
            and not self._knows(Headers(scope=scope))
        ):
            answer = problem(
                421,
                "the service has no such name; the operator lists those it has"
                " (MODALBASE_ALLOWED_HOSTS)",
            )
            await answer(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    def _knows(self, headers: Headers) -> bool:
        try:
            name = (urlsplit(f"//{headers.get('host', '')}").hostname or "").rstrip(".")
        except ValueError:
            return False
        return name in self._names or name.endswith(self._suffixes)


NOTHING = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
HEADERS = {
    "Content-Security-Policy": NOTHING,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""Of every answer that does not set them itself: a browser loads nothing for it and shows it in no
frame.
"""

# by custom the status, in logs and metrics alone, of a request that its client broke off
CLIENT_GONE = 499
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
SECONDS = Histogram(
    "modalbase_http_request_seconds", "Time to answer", ["method", "route", "status"]
)

log = structlog.stdlib.get_logger("modalbase.http")


class RequestMiddleware:
    """Around all of the service: request id, one log line, and a problem document for what nobody
    expected.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id = adopt_request_id(Headers(scope=scope).get(REQUEST_ID_HEADER))
        structlog.contextvars.clear_contextvars()
        structlog.contextvars.bind_contextvars(request_id=request_id)
        began, status = time.perf_counter(), 0

        async def send_with_id(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers[REQUEST_ID_HEADER] = request_id
                if "//" in (location := headers.get("location", "")):
                    headers["location"] = _on_this_host(location, scope["path"])
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        try:
            await self.app(scope, receive, send_with_id)
        except ClientDisconnect:
            status = CLIENT_GONE
        except Exception:
            log.exception("unexpected error", method=scope["method"], path=scope["path"])
            if status:  # half an answer is out: the broken connection is the client's sign
                raise
            answer = problem(500, "an unexpected error; the log has it under the request id")
            await answer(scope, receive, send_with_id)
        seconds = time.perf_counter() - began
        SECONDS.labels(_method(scope), _route(scope), status).observe(seconds)
        log.info(
            "request",
            method=scope["method"],
            path=scope["path"],
            status=status,
            ms=round(1000 * seconds, 1),
        )


def _on_this_host(location: str, path: str) -> str:
    """An address that the framework made, relative to the one asked for: it takes the host from the
    request, where anybody may state any, and knows no prefix of a proxy.
    """
    to = urlsplit(location)
    return "../" * (path.count("/") - 1) + to.path.lstrip("/") + (to.query and f"?{to.query}")


def _method(scope: Scope) -> str:
    return scope["method"] if scope["method"] in METHODS else "other"


def _route(scope: Scope) -> str:
    """The route's template, so that the number of series is bounded."""
    route = scope.get("route")
    return str(getattr(route, "label", getattr(route, "path", "none")))


HEAD_SECONDS = 20.0

_Protocol: Any = AutoHTTPProtocol  # one of two classes, by what is installed


class PatientProtocol(_Protocol):  # type: ignore[misc]
    """Closes a connection on which the head of a request does not come whole within
    `HEAD_SECONDS`.
    """

    _hurry: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """A client has connected."""
        super().connection_made(transport)
        self._expect_head()

    def data_received(self, data: bytes) -> None:
        """Something came: a whole head, or a part of one."""
        super().data_received(data)
        if self.cycle is None or self.cycle.response_complete:
            self._expect_head()
        else:
            self._expect_nothing()

    def connection_lost(self, exc: Exception | None) -> None:
        """The connection has ended."""
        self._expect_nothing()
        super().connection_lost(exc)

    def _expect_head(self) -> None:
        if self._hurry is None:
            self._hurry = asyncio.get_running_loop().call_later(HEAD_SECONDS, self.transport.abort)

    def _expect_nothing(self) -> None:
        if self._hurry is not None:
            self._hurry.cancel()
            self._hurry = None
