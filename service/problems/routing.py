"""Routers whose JSON bodies are read strictly."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.routing import APIRoute
from starlette.datastructures import Headers

from service.problems.errors import UnsupportedMediaType
from service.problems.json_body import parse_json

LARGE = 65536  # bytes beyond which parsing would hold up other requests


class StrictRequest(Request):
    """A request whose JSON is `service.problems.json_body`'s, not Python's."""

    strict_json: Any = None

    async def json(self) -> Any:
        """The body, already checked."""
        return self.strict_json


class StrictRoute(APIRoute):
    """A route that refuses what cannot be stored before anything else looks at the body.

    Only routes that declare a body read one here: uploads stream theirs themselves.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """FastAPI's handler behind the strict reading."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            if self.body_field is None:
                return await handle(request)
            _require_json(request.headers)
            checked = StrictRequest(request.scope, request.receive)
            if body := await checked.body():
                checked.strict_json = (
                    await run_in_threadpool(parse_json, body) if len(body) > LARGE else parse_json(body)
                )
            return await handle(checked)

        return strict


def _require_json(headers: Headers) -> None:
    """Refuse a body that is not said to be JSON, such as what `curl -d` sends when it is told nothing."""
    kind = headers.get("content-type", "").split(";")[0].strip().lower()
    if kind == "application/json" or kind.endswith("+json"):
        return
    if kind or headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
        raise UnsupportedMediaType(
            f"the body is {kind or 'of no stated type'}, expected JSON and `Content-Type: application/json`"
        )


def api_router(*, tags: list[str]) -> APIRouter:
    """A router for one feature, to be listed in `service.composition`; paths are relative to `/api/v1`."""
    return APIRouter(route_class=StrictRoute, tags=list(tags))
