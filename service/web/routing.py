"""Routers whose JSON bodies are read strictly."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.routing import APIRoute
from starlette.datastructures import Headers

from service.errors import PayloadTooLarge, UnsupportedMediaType
from service.web.json_body import BULK_VALUES, MOST_VALUES, parse_json
from service.web.negotiation import content_type, is_json
from service.web.spool import too_large

LARGE = 65536  # bytes beyond which parsing would hold up other requests


class StrictRequest(Request):
    """A request whose JSON is `service.web.json_body`'s, not Python's."""

    strict_json: Any = None

    async def json(self) -> Any:
        """The body, already checked."""
        return self.strict_json


class StrictRoute(APIRoute):
    """A route that refuses what cannot be stored before anything else looks at the body.

    Only routes that declare a body read one here: uploads stream theirs themselves.

    Attributes:
        most_bytes: that the body may have.
        most_values: members and elements that it may have, of all depths together.
    """

    most_bytes, most_values = 1024 * 1024, MOST_VALUES

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """FastAPI's handler behind the strict reading."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            if self.body_field is None:
                return await handle(request)
            _require_json(request.headers)
            checked = StrictRequest(request.scope, request.receive)
            if body := await checked.body():
                if len(body) > self.most_bytes:
                    raise PayloadTooLarge(too_large(self.most_bytes))
                parse = partial(parse_json, body, most_values=self.most_values)
                checked.strict_json = await run_in_threadpool(parse) if len(body) > LARGE else parse()
            return await handle(checked)

        return strict


def _require_json(headers: Headers) -> None:
    """Refuse a body without `Content-Type: application/json`, such as `curl -d` sends by default."""
    kind = content_type(headers.get("content-type"))
    if is_json(kind):
        return
    if kind or headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
        raise UnsupportedMediaType(
            f"the body is {kind or 'of no stated type'}, expected JSON and `Content-Type: application/json`"
        )


class BulkRoute(StrictRoute):
    """A route whose body carries measured values."""

    most_bytes, most_values = 2**62, BULK_VALUES  # the operator's limit on JSON is smaller


def api_router(*, tags: list[str], bulk: bool = False) -> APIRouter:
    """A router for one feature, to be listed in `service.composition`; paths are relative to `/api/v1`.

    Args:
        tags: headings on the documentation page.
        bulk: bodies carry measured values, and may be large.
    """
    return APIRouter(route_class=BulkRoute if bulk else StrictRoute, tags=list(tags))
