"""What wraps every request: its id, its log line, and the answer to the unexpected."""

from __future__ import annotations

import time
from urllib.parse import urlsplit

import structlog
from prometheus_client import Histogram
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.request_id import HEADER, adopt_request_id
from service.web.pages import HEADERS
from service.web.problems import problem

CLIENT_GONE = 499  # by custom the status, in logs and metrics alone, of a request that its client broke off
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
SECONDS = Histogram("modalbase_http_request_seconds", "Time to answer", ["method", "route", "status"])

log = structlog.stdlib.get_logger("modalbase.http")


class RequestMiddleware:
    """Around all of the service: request id, one log line, and a problem document for what nobody expected."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id = adopt_request_id(Headers(scope=scope).get(HEADER))
        structlog.contextvars.clear_contextvars()
        structlog.contextvars.bind_contextvars(request_id=request_id)
        began, status = time.perf_counter(), 0

        async def send_with_id(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers[HEADER] = request_id
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
        log.info("request", method=scope["method"], path=scope["path"], status=status, ms=round(1000 * seconds, 1))


def _on_this_host(location: str, path: str) -> str:
    """An address that the framework made, relative to the one asked for: it takes the host from the request, where anybody
    may state any, and knows no prefix of a proxy.
    """
    to = urlsplit(location)
    return "../" * (path.count("/") - 1) + to.path.lstrip("/") + (to.query and f"?{to.query}")


def _method(scope: Scope) -> str:
    return scope["method"] if scope["method"] in METHODS else "other"


def _route(scope: Scope) -> str:
    """The route's template, so that the number of series is bounded."""
    route = scope.get("route")
    return str(getattr(route, "label", getattr(route, "path", "none")))
