"""Every route of the REST contract as a method, made from the table of routes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

from modalbase.client.errors import ClientError

if TYPE_CHECKING:
    from modalbase.client.connection import Connection

Call = Callable[..., Any]

_OF_THE_CLIENT = ("cursor", "limit", "format", "filename")
"""Parameters that the library's own methods state."""


class Route(NamedTuple):
    """A call: its method, its path below `/api/v1/`, the names of its query, what it does."""

    method: str
    path: str
    query: list[str]
    summary: str

    @property
    def takes(self) -> list[str]:
        """What stands in the path's braces."""
        return [part.strip("{}") for part in self.path.split("/") if part.startswith("{")]


@cache
def routes() -> dict[str, Route]:
    """The calls of the REST contract by name, read when first asked for;
    `python -m tools.reference` makes the file.
    """
    text = files("modalbase.client").joinpath("routes.json").read_text(encoding="utf-8")
    return {name: Route(*row) for name, row in json.loads(text).items()}


class Rest:
    """The REST contract, call by call: `rest.get_campaign(id)`,
    `rest.create_project(body={"name": "bridge"})`.

    A method takes what stands in braces in its path, in that order, and by keyword what goes in the
    query. `body` is sent as JSON; `content` as bytes of `content_type`; `headers` beside the key.
    It returns the JSON that answers, bytes of anything else, None of an empty answer. `dir(rest)`
    lists the methods; each says its route in its docstring.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *routes()]

    def __getattr__(self, name: str) -> Call:
        if (route := routes().get(name)) is None:
            raise AttributeError(f"the REST contract has no call {name!r}; dir() lists them")
        return _call(self._connection, name, route)


def require_known(name: str, filters: Iterable[str]) -> None:
    """Refuse names that the query of a call does not have, before anything is sent.

    Args:
        name: of the call, such as `list_frfs`.
        filters: the names that a script states.

    Raises:
        ClientError: one is unknown; the message lists those that there are.
    """
    known = [one for one in routes()[name].query if one not in _OF_THE_CLIENT]
    if unknown := sorted(set(filters) - set(known)):
        raise ClientError(
            f"there is no {', '.join(map(repr, unknown))} to choose by; there is {', '.join(known)}"
        )


def _call(connection: Connection, name: str, route: Route) -> Call:
    def call(
        *ids: object,
        body: Any = None,
        content: bytes | None = None,
        content_type: str = "application/octet-stream",
        headers: dict[str, str] | None = None,
        **query: Any,
    ) -> Any:
        if len(ids) != len(route.takes):
            raise TypeError(
                f"{name}() takes {', '.join(route.takes) or 'no id'} and got {len(ids)}"
            )
        if unknown := set(query) - set(route.query):
            raise TypeError(
                f"{name}() has no {', '.join(sorted(unknown))}; it has"
                f" {', '.join(route.query) or 'no query'}"
            )
        path = route.path.format(
            **{key: quote(str(one), safe="") for key, one in zip(route.takes, ids, strict=True)}
        )
        how: dict[str, Any] = {"headers": dict(headers or {}), "params": query}
        if content is not None:
            how["content"] = content
            how["headers"].setdefault("Content-Type", content_type)
        elif body is not None:
            how["json"] = body
        return connection.call(route.method, path, **how)

    call.__name__ = name
    call.__doc__ = f"{route.summary}\n\n    {route.method} {route.path}"
    return call
