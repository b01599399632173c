"""The client's table of routes, made from the service's routers: `modalbase/client/routes.json`."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from fastapi import FastAPI

from service.app.application import PREFIX
from service.app.composition import ROUTERS
from service.web.routing import include

METHODS = ("get", "post", "put", "patch", "delete")


@dataclass(frozen=True)
class Described:
    """A route of the OpenAPI document.

    Attributes:
        name: of the client's method.
        method: of HTTP, in capitals.
        path: below the prefix, without a leading slash.
        operation: what the document says of it.
    """

    name: str
    method: str
    path: str
    operation: dict[str, Any] = field(repr=False)

    @property
    def query(self) -> tuple[str, ...]:
        """Names of the query's parameters."""
        return tuple(one["name"] for one in self.operation.get("parameters", ()) if one["in"] == "query")

    @property
    def summary(self) -> str:
        """The first paragraph of what the route does, on one line."""
        text = self.operation.get("description") or self.operation["summary"]
        return " ".join(text.split("\n\n")[0].split())


@cache
def document() -> dict[str, Any]:
    """The OpenAPI document of everything under the prefix; no database is needed for it."""
    app = FastAPI()
    for router in ROUTERS:
        include(app, router, PREFIX)
    return app.openapi()


def described(openapi: dict[str, Any]) -> list[Described]:
    """The routes of a document, each with a name of its own.

    A method has the name of the function behind its route. Where two routes have one name, the words of the path keep
    them apart: `get_original` becomes `get_imports_original`.
    """
    found = []
    for path, operations in openapi["paths"].items():
        for method in METHODS:
            if method in operations:
                name = operations[method]["operationId"].split(PREFIX.replace("/", "_"))[0]
                found.append((name, method, path.removeprefix(PREFIX).lstrip("/"), operations[method]))
    often = Counter(name for name, *_ in found)
    return [
        Described(name if often[name] == 1 else _longer(name, path), method.upper(), path, operation)
        for name, method, path, operation in found
    ]


def _longer(name: str, path: str) -> str:
    words = [part.replace("-", "_") for part in path.split("/") if not part.startswith("{")]
    return "_".join([name.split("_")[0], *words])


def table() -> str:
    """The text of `modalbase/client/routes.json`: a line for each call, for diffs that can be read."""
    rows = ({route.name: [route.method, route.path, route.query, route.summary]} for route in described(document()))
    return "{\n" + ",\n".join(json.dumps(row, ensure_ascii=False)[1:-1] for row in rows) + "\n}\n"
