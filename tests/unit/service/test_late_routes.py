"""Routes that are put together when they are first asked for: the same ones as FastAPI's, later."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import httpx
import pytest
from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute
from pydantic import BaseModel

from service.web.routing import LateRoute, StrictRoute, include


class Specimen(BaseModel):
    name: str
    layers: int = 8


def _with_routes(kind: type[APIRoute]) -> APIRouter:
    router = APIRouter(route_class=kind, tags=["specimens"])

    @router.get("/specimens/{number}")
    def get_specimen(number: int, unit: str | None = None) -> Specimen:
        """One of them."""
        return Specimen(name=f"{number}{unit or ''}")

    @router.post("/specimens", status_code=201, responses={409: {"description": "There is one of that name"}})
    def make_specimen(body: Specimen) -> Specimen:
        return body

    @router.api_route("/specimens/{number}/picture", methods=["GET", "HEAD"], include_in_schema=False)
    def get_picture(number: int) -> bytes:
        return b"." * number

    return router


def _app(kind: type[APIRoute]) -> FastAPI:
    app = FastAPI(responses={"5XX": {"description": "Not now"}})
    include(app, _with_routes(kind), "/api")
    return app


def test_the_document_is_that_of_fastapis_own_routes() -> None:
    ordinary = FastAPI(responses={"5XX": {"description": "Not now"}})
    ordinary.include_router(_with_routes(APIRoute), prefix="/api")
    assert _app(LateRoute).openapi() == ordinary.openapi()


def test_only_what_is_asked_for_is_put_together() -> None:
    app = _app(StrictRoute)
    routes = [route for route in app.routes if isinstance(route, LateRoute)]

    async def ask() -> None:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test/api/") as client:
            found = await client.get("specimens/4", params={"unit": "b"})
            assert found.json() == {"name": "4b", "layers": 8}
            assert (await client.get("specimens/four")).status_code == 422
            assert (await client.put("specimens/4")).status_code == 405

    asyncio.run(ask())
    assert ["dependant" in vars(route) for route in routes] == [True, False, False]
    assert [route.label for route in routes] == ["/specimens/{number}", "/specimens", "/specimens/{number}/picture"]


def test_threads_that_ask_at_once_have_the_same_route() -> None:
    route = next(route for route in _app(LateRoute).routes if isinstance(route, LateRoute))
    together = Barrier(8)

    def ask(_: int) -> object:
        together.wait()
        return route.dependant

    with ThreadPoolExecutor(8) as threads:
        assert len({id(found) for found in threads.map(ask, range(8))}) == 1
    with pytest.raises(AttributeError, match="a route has no colour"):
        _ = route.colour
