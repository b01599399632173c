"""What wraps every request: its id, its log line, the limit on its body, and the answer to the unexpected."""

from __future__ import annotations

import time

import structlog
from prometheus_client import Histogram
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.problems.http import problem
from service.problems.request_id import HEADER, adopt_request_id
from service.settings import Settings

CLIENT_GONE = 499  # by custom the status, in logs and metrics alone, of a request that its client broke off
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
SECONDS = Histogram("modalbase_http_request_seconds", "Time to answer", ["method", "route", "status"])

log = structlog.stdlib.get_logger("modalbase.http")


class RequestMiddleware:
    """Outermost layer: request id, one log line, and a problem document for what nobody expected."""

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
                MutableHeaders(scope=message)[HEADER] = request_id
            await send(message)

        try:
            await self.app(scope, receive, send_with_id)
        except ClientDisconnect:
            status = CLIENT_GONE
        except Exception:
            log.exception("unexpected error", method=scope["method"], path=scope["path"])
            if status:  # half an answer is out: the broken connection tells the client
                raise
            answer = problem(500, "an unexpected error; the log has it under the request id")
            await answer(scope, receive, send_with_id)
        seconds = time.perf_counter() - began
        SECONDS.labels(_method(scope), _route(scope), status).observe(seconds)
        log.info("request", method=scope["method"], path=scope["path"], status=status, ms=round(1000 * seconds, 1))


class BodyLimitMiddleware:
    """Refuse bodies beyond the operator's limits, as soon as they are known to be: 413."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.settings = settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers, got = Headers(scope=scope), 0
        kind = headers.get("content-type", "").split(";")[0].strip().lower()
        json = kind == "application/json" or kind.endswith("+json")
        limit = self.settings.json_limit_bytes if json else self.settings.upload_limit_bytes
        declared = headers.get("content-length", "")
        if declared.isdecimal() and int(declared) > limit:
            await problem(413, _too_large(limit), headers={"Connection": "close"})(scope, receive, send)
            return

        async def limited() -> Message:
            nonlocal got
            message = await receive()
            got += len(message.get("body", b""))
            if got > limit:
                raise HTTPException(413, _too_large(limit), headers={"Connection": "close"})
            return message

        await self.app(scope, limited, send)


def _method(scope: Scope) -> str:
    return scope["method"] if scope["method"] in METHODS else "other"


def _route(scope: Scope) -> str:
    """The route's template, so that the number of series is bounded."""
    return getattr(scope.get("route"), "path", "none")


def _too_large(limit: int) -> str:
    return f"the body is larger than {limit} bytes, the limit for its kind"
