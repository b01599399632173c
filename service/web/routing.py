"""Routes that are put together when they are first asked for, and that read JSON bodies strictly.

They refuse names in a query that they do not know: a mistyped filter would answer with more than
was asked for.
"""

from collections.abc import Callable, Coroutine, Iterable, Set
from functools import partial
from threading import RLock
from typing import Any

from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute
from starlette.datastructures import Headers
from starlette.routing import compile_path

from service.errors import Fault, Invalid, PayloadTooLarge, UnsupportedMediaType
from service.web.json_body import BULK_VALUES, MOST_VALUES, parse_json
from service.web.negotiation import content_type, is_json
from service.web.uploads import too_large


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
_MATCHING = ("path_regex", "path_format", "param_convertors")
_assembly = RLock()


class StrictRequest(Request):
    """A request whose JSON is `service.web.json_body`'s, not Python's."""

    strict_json: Any = None

    async def json(self) -> Any:
        """The body, already checked."""
        return self.strict_json


class LazyOpenApi(dict[str, Any]):
    """What a route says of itself to OpenAPI, made when the route is put together.

    Attributes:
        make: makes it.
    """

    def __init__(self, make: Callable[[], dict[str, Any]]) -> None:
        super().__init__()
        self.make = make


class LateRoute(APIRoute):
    """A route that FastAPI puts together when it is first asked for, with what its router was
    given.

    To read the parameters of 150 functions and to make models of what they answer takes a third of
    the time in which the API starts, and most of these functions are not called for hours.

    Attributes:
        label: the path in its own router, by which log and metrics know it.
        given: what else its router was given for it.
    """

    _begun = True  # of a copy that no `__init__` has filled

    def __init__(
        self,
        path: str,
        endpoint: Callable[..., Any],
        *,
        name: str | None = None,
        methods: set[str] | list[str] | None = None,
        **given: Any,
    ) -> None:
        self.path, self.label, self.endpoint, self.given = path, path, endpoint, given
        self.name = endpoint.__name__ if name is None else name
        self.methods = {method.upper() for method in methods or ("GET",)}
        self._begun = False

    def __getattr__(self, name: str) -> Any:
        """What is not there yet."""
        with _assembly:
            if name in _MATCHING:
                self.path_regex, self.path_format, self.param_convertors = compile_path(self.path)
            elif not self._begun:
                self._begun = True
                if isinstance(extra := self.given.get("openapi_extra"), LazyOpenApi):
                    extra.update(extra.make())
                super().__init__(
                    self.path, self.endpoint, name=self.name, methods=self.methods, **self.given
                )
            if name not in self.__dict__:
                raise AttributeError(f"a route has no {name}")
            return self.__dict__[name]


class StrictRoute(LateRoute):
    """A route that refuses parameters of the query that it does not know, and a body that cannot be
    stored before anything else looks at it.

    Only routes that declare a body read one here: uploads stream theirs themselves.

    Attributes:
        most_bytes: that the body may have.
        most_values: members and elements that it may have, of all depths together.
    """

    most_bytes, most_values = 1024 * 1024, MOST_VALUES

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


class BulkRoute(StrictRoute):
    """A route whose body carries measured values."""

    most_bytes, most_values = 2**62, BULK_VALUES  # the operator's limit on JSON is smaller


def api_router(*, tags: list[str], bulk: bool = False) -> APIRouter:
    """A router for one feature, to be listed in `service.app.composition`; paths are relative to
    `/api/v1`.

    Args:
        tags: headings on the documentation page.
        bulk: bodies carry measured values, and may be large.
    """
    return APIRouter(route_class=BulkRoute if bulk else StrictRoute, tags=list(tags))


def page_router() -> APIRouter:
    """A router of pages, which the OpenAPI document leaves out."""
    return APIRouter(route_class=LateRoute, include_in_schema=False)


def creates(route: LateRoute) -> bool:
    """Whether a route creates something: a POST that answers 201, or 202 while a job makes it."""
    return "POST" in (route.methods or ()) and route.given.get("status_code") in (201, 202)


def include(
    app: FastAPI,
    router: APIRouter,
    prefix: str = "",
    creating: Callable[[Callable[..., Any]], Callable[..., Any]] | None = None,
) -> None:
    """Give an app the routes of a router. FastAPI's own `include_router` puts all of them together,
    once more, at the first request.

    Args:
        app: takes the routes.
        router: has them.
        prefix: of their paths.
        creating: what the operations become that create something.
    """
    for route in router.routes:
        assert isinstance(route, LateRoute)
        given = {
            name: value
            for name, value in route.given.items()
            if name not in ("dependency_overrides_provider", "operation_id")
        }
        kind = type(route)
        app.router.add_api_route(
            prefix + route.path,
            creating(route.endpoint) if creating is not None and creates(route) else route.endpoint,
            name=route.name,
            methods=route.methods,
            operation_id=route.name,
            route_class_override=kind,
            **given,
        )
        added = app.router.routes[-1]
        assert isinstance(added, LateRoute)
        added.label = route.label
