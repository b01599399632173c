"""Routes that read JSON bodies strictly.

They refuse names in a query that they do not know: a mistyped filter would answer with more than
was asked for.
"""

from collections.abc import Callable, Coroutine, Iterable, Set
from functools import partial
from typing import Any

from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute
from starlette.datastructures import Headers

from service.platform.errors import Fault, Invalid, PayloadTooLarge, UnsupportedMediaType
from service.platform.web.json_body import MOST_VALUES, parse_json
from service.platform.web.negotiation import content_type, is_json
from service.platform.web.uploads import too_large

API, UI = "/api/v1", "/ui"
"""Prefixes of the paths of the contract, and of pages."""


def query_names(dependant: Dependant) -> frozenset[str]:
    """Names of the query's parameters that a route and all that it depends on declare."""
    own = {field.alias for field in dependant.query_params}
    return frozenset(own.union(*(query_names(one) for one in dependant.dependencies)))


def require_known(sent: Iterable[str], known: Set[str]) -> None:
    """Refuse names of query parameters that are not among the known ones.

    Raises:
        Invalid: each unknown name, with those that there are.
    """
    if unknown := sorted(set(sent) - known):
        there_are = (
            f"expected one of {', '.join(sorted(known))}" if known else "this address takes none"
        )
        raise Invalid(
            [Fault(name, f"is no parameter of this query; {there_are}") for name in unknown]
        )


AFTERWARDS = "modalbase.afterwards"
"""Where a request's scope has what is done with its answer before its transaction is committed."""


def require_used(request: Request, variant: str, unused: Set[str], instead: str) -> None:
    """Refuse parameters that a route has, and that what is asked for does not use.

    Args:
        request: whose query is looked at.
        variant: what is asked for, in words: a format of the answer, a figure.
        unused: names that it does not use.
        instead: what it takes, or where they are used.

    Raises:
        Invalid: each such name.
    """
    if stated := sorted(unused & request.query_params.keys()):
        raise Invalid([Fault(name, f"is not used by {variant}; {instead}") for name in stated])


LARGE = 65536  # bytes beyond which parsing would hold up other requests


class StrictRequest(Request):
    """A request whose JSON is `service.platform.web.json_body`'s, not Python's."""

    strict_json: Any = None

    async def json(self) -> Any:
        """The body, already checked."""
        return self.strict_json


class StrictRoute(APIRoute):
    """A route that refuses parameters of the query that it does not know, and a body that cannot be
    stored before anything else looks at it.

    Only routes that declare a body read one here: uploads stream theirs themselves.

    Attributes:
        most_bytes: that the body may have.
        most_values: members and elements that it may have, of all depths together.
    """

    most_bytes, most_values = 1024 * 1024, MOST_VALUES

    @property
    def label(self) -> str:
        """The path below `API`, by which the log, metrics and kept answers know the route."""
        return self.path.removeprefix(API)

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """FastAPI's handler behind the strict reading."""
        handle, known = super().get_route_handler(), query_names(self.dependant)

        async def strict(request: Request) -> Response:
            response = await read(request)
            if (afterwards := request.scope.get(AFTERWARDS)) is not None:
                await run_in_threadpool(afterwards, response)
            return response

        async def read(request: Request) -> Response:
            require_known(request.query_params, known)
            if self.body_field is None:
                return await handle(request)
            _require_json(request.headers)
            checked = StrictRequest(request.scope, request.receive)
            if body := await checked.body():
                if len(body) > self.most_bytes:
                    raise PayloadTooLarge(too_large(self.most_bytes))
                parse = partial(parse_json, body, most_values=self.most_values)
                checked.strict_json = (
                    await run_in_threadpool(parse) if len(body) > LARGE else parse()
                )
            return await handle(checked)

        return strict


def _require_json(headers: Headers) -> None:
    """Refuse a body without `Content-Type: application/json`, such as `curl -d` sends by
    default.
    """
    kind = content_type(headers.get("content-type"))
    if is_json(kind):
        return
    if kind or headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
        raise UnsupportedMediaType(
            f"the body is {kind or 'of no stated type'}, expected JSON and `Content-Type:"
            " application/json`"
        )


class PageRoute(APIRoute):
    """A route of a page below `UI`."""

    @property
    def label(self) -> str:
        """The path below `UI`, by which metrics know the route."""
        return self.path.removeprefix(UI)


def page_router(prefix: str = "") -> APIRouter:
    """A router of pages, which the OpenAPI document leaves out.

    Args:
        prefix: of their paths: `UI`, or none.
    """
    kind = PageRoute if prefix else APIRoute
    return APIRouter(prefix=prefix, route_class=kind, include_in_schema=False)


def serve(app: FastAPI, router: APIRouter) -> None:
    """Give an app the routes of a router as they are. FastAPI's own `include_router` would make
    each of them anew at the first request.
    """
    app.router.routes.extend(router.routes)
