"""What a request states is used: each member of each operation is sent, and changes a named part of
the answer.

A `Body` is an operation with a type of body. Its members are the parameters of the query, headers,
and members of the body that the OpenAPI document has. A row of the table
(`tests.support.member_rows`) gives a member a value. What must differ from the same request without
it is by default the member of the answer that has its name, or of a GET the whole answer. Members
that mean the same everywhere, such as `limit` or `If-Match`, have their effect here.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from typing import Any, Literal

import httpx

from tests.support.rest import finished, ok

PREFIX = "/api/v1"
JSON = "application/json"
Node = dict[str, Any]
_NUMBERS = count(1)


@dataclass(frozen=True)
class To:
    """A row: the value of a member, and its effect."""

    value: Any
    # name of the member that differs, wherever it stands; None: its own; "": the whole answer
    at: str | None = None
    # sent with and without it; of the query with `?` in front
    beside: Mapping[str, Any] = field(default_factory=dict)
    drop: tuple[str, ...] = ()  # members of the base that it takes the place of
    status: int | None = None  # with it, where that is the effect
    without: int | None = None  # the same without it
    ids: Mapping[str, str] = field(default_factory=dict)  # others than the operation's
    # for the job's end; a short run is content that a job states the member whose effect another
    # test holds, and cancels it
    waits: Literal["always", "long", "never"] = "always"


held = partial(To, waits="long")
"""Rows of members whose effect on a result golden documents or other tests hold."""


@dataclass(frozen=True)
class Refused:
    """A row of what a type of body, a figure or a format does not take: it is refused by name."""

    value: Any
    beside: Mapping[str, Any] = field(default_factory=dict)
    drop: tuple[str, ...] = ()
    ids: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Body:
    """A request that succeeds without the member that is tried."""

    members: Mapping[str, Any] = field(
        default_factory=dict
    )  # rows, several in a tuple; a bare value is a row `To(value)`
    body: Any = None  # members of the body, or its bytes
    query: Mapping[str, Any] = field(default_factory=dict)  # without which nothing shows
    # makes what the request changes, and gives its ids
    fresh: Callable[[Lab], dict[str, str]] | None = None
    # of a job: the address of what is looked at, where `{id}` is its own; empty: its state
    then: str | None = None
    # names of other ids of the lab, or what the path has in place
    ids: Mapping[str, str] = field(default_factory=dict)
    # members that a short run tries, where not all: others go the same way as one of these, or as
    # in a body of another type
    short: tuple[str, ...] | None = None


@dataclass
class Lab:
    """A furnished project: who asks, ids by the names of paths, and who administers."""

    api: httpx.Client
    ids: dict[str, str]
    chief: httpx.Client
    alarm: Callable[[], str] = str  # makes another alarm

    def filled(self, value: Any, ids: Mapping[str, str]) -> Any:
        """A value with `{name}` of ids in its texts; `{n}` is another number each time."""
        if isinstance(value, str):
            for name, key in {**self.ids, **ids}.items():
                value = value.replace(f"{{{name}}}", key)
            return value.replace("{n}", str(next(_NUMBERS)))
        if isinstance(value, dict):
            return {self.filled(name, ids): self.filled(one, ids) for name, one in value.items()}
        return [self.filled(one, ids) for one in value] if isinstance(value, list) else value


def resolved(document: Node, schema: Node) -> Node:
    """A schema without a reference at its top."""
    while "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
    return schema


def walk(document: Node) -> Iterator[tuple[str, str, dict[str, Node]]]:
    """Operations with members, the type of a body (empty without one), and the members by name."""
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            stated = {
                one["name"]: one for one in operation.get("parameters", []) if one["in"] != "path"
            }
            for kind, body in (operation.get("requestBody", {}).get("content") or {"": {}}).items():
                schema = resolved(document, body.get("schema", {}))
                options = [resolved(document, one) for one in (schema, *schema.get("anyOf", []))]
                own = {
                    name: one
                    for each in options
                    for name, one in each.get("properties", {}).items()
                }
                members = stated | {
                    f"body.{name}" if name in stated else name: {"in": "body", "schema": one}
                    for name, one in own.items()
                }
                if members:
                    yield f"{method.upper()} {path.removeprefix(PREFIX)}", kind, members


Inner = dict[str, set[str]]


def within(document: Node) -> dict[tuple[str, str], Inner]:
    """Of each operation and type of body the members of what is within the body, by path:
    `Schema.member`.

    A list is its first item in a path, a member of any name is `*`, as in `walls.*.thickness_m`.
    """
    found: dict[tuple[str, str], Inner] = {}
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            for kind, body in operation.get("requestBody", {}).get("content", {}).items():
                inner = found.setdefault(
                    (f"{method.upper()} {path.removeprefix(PREFIX)}", kind), {}
                )
                for name, place in _inner(document, body.get("schema", {}), "", "", ()):
                    inner.setdefault(place, set()).add(name)
    return found


def _inner(
    document: Node, schema: Node, name: str, place: str, above: tuple[str, ...]
) -> Iterator[tuple[str, str]]:
    """`Schema.member` and path of all members below a place; what holds itself is entered once."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
    if name in above:
        return
    schema = resolved(document, schema)
    for one in (*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())):
        yield from _inner(document, one, name, place, above)
    if isinstance(items := schema.get("items"), dict):
        yield from _inner(document, items, name, place, above)
    if isinstance(any_name := schema.get("additionalProperties"), dict):
        yield from _inner(document, any_name, name, f"{place}.*", above)
    for member, one in schema.get("properties", {}).items():
        at = f"{place}.{member}".removeprefix(".")
        if name:
            yield f"{name}.{member}", at
        yield from _inner(document, one, "", at, (*above, *filter(None, (name,))))


def placed(body: Any, path: list[str], value: Any) -> Any:
    """A body with another value at a path, whose lists have an item there."""
    name, *rest = path
    if isinstance(body, list):
        return [placed(body[0], path, value), *body[1:]]
    name = next(iter(body)) if name == "*" else name
    return {**body, name: placed(body.get(name, {}), rest, value) if rest else value}


class Trial:
    """Sends the request of a `Body` with and without a member."""

    def __init__(self, lab: Lab, operation: str, kind: str, asked: Body, *, whole: bool) -> None:
        self.lab, self.kind, self.asked, self._asked = lab, kind, asked, dict[str, Any]()
        self.whole, self._got = whole, dict[str, httpx.Response]()
        self.method, self.path = operation.split()

    def ids(self, more: Mapping[str, str] | None = None) -> dict[str, str]:
        """Ids for the path."""
        made = self.asked.fresh(self.lab) if self.asked.fresh else {}
        return made | {
            name: self.lab.ids.get(key, key)
            for name, key in {**self.asked.ids, **(more or {})}.items()
        }

    def send(
        self, query: Node, body: Any = None, headers: Node | None = None, ids: Node | None = None
    ) -> httpx.Response:
        """The answer to a request."""
        ids = self.ids() if ids is None else ids
        query = {
            name: one for name, one in {**self.asked.query, **query}.items() if one is not None
        }
        path = self.lab.filled(self.path, ids).lstrip("/")
        how: Node = {
            "params": self.lab.filled(query, ids),
            "headers": self.lab.filled(dict(headers or {}), ids),
        }
        if isinstance(body, bytes):
            how |= {"content": body, "headers": {"Content-Type": self.kind, **how["headers"]}}
        elif self.kind == "multipart/form-data":
            filled = self.lab.filled(body, ids)
            file = filled.pop("file")
            how["files"] = {"file": (file[0], file[1])}
            how["data"] = {
                name: one if isinstance(one, str) else json.dumps(one)
                for name, one in filled.items()
            }
        elif self.kind:
            how["json"] = self.lab.filled(body, ids)
        if self.method in ("PATCH", "PUT", "DELETE") and "If-Match" not in how["headers"]:
            how["headers"]["If-Match"] = "*"
        of_all = path.startswith(("users", "laboratory"))
        client = self.lab.chief if of_all else self.lab.api
        client.cookies.clear()  # of a session that was begun
        if self.method != "GET":
            return client.request(self.method, path, **how)
        key = repr((path, how))
        if key not in self._got:
            self._got[key] = client.get(path, **how)
        return self._got[key]

    def waits(self, row: To | Refused) -> bool:
        """Whether a row is judged by what a job has made."""
        if isinstance(row, Refused):
            return True
        return row.waits == "always" or (self.whole and row.waits == "long")

    def ask(self, place: str, name: str, row: To | Refused, *, with_it: bool) -> tuple[int, Any]:
        """Status and content of the request, with or without a member; the same one is sent
        once.
        """
        query, headers = {}, dict[str, str]()
        body = dict(self.asked.body) if isinstance(self.asked.body, dict) else self.asked.body
        for member, value in row.beside.items():
            if member == "*":
                body = dict(value) if isinstance(value, dict) else value
            else:
                (query if member[0] == "?" or not isinstance(body, dict) else body)[
                    member.lstrip("?")
                ] = value
        if with_it:
            for one in row.drop:
                body.pop(one)
            if place == "within":
                body = placed(body, name.split("."), row.value)
            else:
                {"query": query, "header": headers, "body": body}[place][
                    name.removeprefix("body.")
                ] = row.value
        key = repr((query, body, headers, row.ids, self.waits(row)))
        if key not in self._asked:
            self._asked[key] = self._answer(query, body, headers, row, self.ids(row.ids))
        found: tuple[int, Any] = self._asked[key]
        return found

    def _answer(
        self, query: Node, body: Any, headers: Node, row: To | Refused, ids: Node
    ) -> tuple[int, Any]:
        if self.method == "PATCH" and not body:
            return 200, content_of(self.lab.api.get(self.lab.filled(self.path, ids).lstrip("/")))
        answer = self.send(query, body, headers, ids)
        if answer.is_error or self.asked.then is None:
            return answer.status_code, content_of(answer)
        state = content_of(answer)
        location = answer.headers.get("location") if answer.status_code == 202 else None
        if not self.waits(row):
            if location:
                ok(self.lab.api.post(self.lab.api.base_url.join(f"{location}/cancel")))
            return answer.status_code, state
        if location:
            state = finished(self.lab.api, location)
        if not self.asked.then or state.get("status") == "failed":
            return answer.status_code, state
        later = self.lab.api.get(
            self.lab.filled(self.asked.then, {**ids, "id": state.get("id", "")})
        )
        return answer.status_code, {"state": state, "later": content_of(later)}

    def shows(self, row: To) -> bool:
        """Whether a member's effect is that the answer has it."""
        stated = row.waits == "long" and not self.whole
        return (
            self.kind == JSON
            and isinstance(self.asked.body, dict)
            and (row.at is None or stated)
            and not (row.status or row.without or row.drop)
            and not any(name.startswith("?") for name in row.beside)
        )

    def shown_together(self, rows: Mapping[str, To]) -> set[str]:
        """Names of members that the answer shows as they are stated where all of them are sent at
        once, and does not show without them. Each of the others is to be tried alone.
        """
        first = next(iter(rows.values()))
        ids, own = self.ids(first.ids), {name: name.rsplit(".", 1)[-1] for name in rows}
        values = {name: self.lab.filled(row.value, ids) for name, row in rows.items()}
        _, plain = self.ask("", "", first, with_it=False)
        body = first.beside.get("*", {**self.asked.body, **first.beside})
        for name, value in values.items():
            body = placed(body, name.removeprefix("body.").split("."), value)
        status, content = self._answer({}, body, {}, first, ids)
        if status >= 300:
            refused = " ".join(one["pointer"] for one in content.get("errors", []))
            left = {name: row for name, row in rows.items() if own[name] not in refused}
            return self.shown_together(left) if 1 < len(left) < len(rows) else set()
        return {
            name
            for name, value in values.items()
            if [*own.values()].count(own[name]) == 1  # no other has it
            and any(holds(one, value) for one in shown(content, own[name]))
            and not any(holds(one, value) for one in shown(plain, own[name]))
        }

    def check(self, place: str, name: str, row: To | Refused) -> str | None:
        """What is wrong with a member; nothing where it has its effect."""
        if isinstance(row, To):
            # first, since what is asked may change what is there
            before, plain = self.ask(place, name, row, with_it=False)
        status, content = self.ask(place, name, row, with_it=True)
        if isinstance(row, Refused):
            name = name.rsplit(".", 1)[-1]
            named = status == 422 and any(
                name in one["pointer"] for one in content.get("errors", [])
            )
            failed = (
                isinstance(content, dict)
                and content.get("status") == "failed"
                and name in str(content["error"])
            )
            return (
                None
                if named or failed
                else f"{status} {str(content)[:400]}, expected a refusal by name"
            )
        for found, wanted, what in ((status, row.status, content), (before, row.without, plain)):
            if found != wanted if wanted else found >= 300:
                return f"with it {status}, without {before}: {str(what)[:400]}"
        if row.status or row.without:
            return None
        stated = row.waits == "long" and not self.whole
        own = name.rsplit(".", 1)[-1] if self.method != "GET" else ""
        at = own if row.at is None or stated else row.at
        values, others = (shown(one, at) for one in (content, plain))
        if not values:
            return f"no {at} in {str(content)[:400]}"
        for one in (content, plain):
            if at != "status" and isinstance(one, dict) and one.get("status") == "failed":
                return f"failed: {one['message']} {one['error']}"
        return (
            None
            if values != others
            else f"{at or 'the answer'} is the same with it: {str(values)[:400]}"
        )


def holds(found: Any, stated: Any) -> bool:
    """Whether what is shown has everything that was stated; defaults may stand beside it."""
    if isinstance(found, dict) and isinstance(stated, dict):
        return all(name in found and holds(found[name], one) for name, one in stated.items())
    if isinstance(found, list) and isinstance(stated, list):
        return len(found) == len(stated) and all(map(holds, found, stated))
    return bool(found == stated)


def content_of(answer: httpx.Response) -> Any:
    """The body of an answer."""
    is_json = "json" in answer.headers.get("content-type", "") and answer.content
    return (
        answer.json()
        if is_json and "ndjson" not in answer.headers["content-type"]
        else answer.content
    )


def shown(content: Any, at: str) -> list[Any]:
    """The values of members of a name, wherever they stand; the whole content where there is no
    name.
    """
    if not at:
        return [content]
    if isinstance(content, dict):
        own = [content[at]] if at in content else []
        return own + [value for one in content.values() for value in shown(one, at)]
    return (
        [value for one in content for value in shown(one, at)] if isinstance(content, list) else []
    )


# What means the same everywhere: each says what is wrong, or nothing.


def _limit(trial: Trial) -> str | None:
    plain, one = (ok(trial.send(more)) for more in ({}, {"limit": 1}))
    name = "items" if "items" in plain else "campaigns"  # a series is shown thinned
    good = len(one[name]) == 1 < len(plain[name]) and one.get("next_cursor", True)
    return None if good else f"limit=1 gives {len(one[name])} of {len(plain[name])}"


def _cursor(trial: Trial) -> str | None:
    first = ok(trial.send({"limit": 1}))
    if not first["next_cursor"]:
        return f"there is no second page: {str(first)[:200]}"
    second = ok(trial.send({"limit": 1, "cursor": first["next_cursor"]}))
    return (
        None
        if second["items"] and second["items"] != first["items"]
        else "the second page is the first"
    )


def _deleted(trial: Trial) -> str | None:
    pages = (ok(trial.send({"deleted": text})) for text in ("false", "true"))
    there, gone = ({one["id"] for one in page["items"]} for page in pages)
    return (
        None
        if gone and not there & gone
        else f"deleted are {len(gone)}, in both are {len(there & gone)}"
    )


def _theme(trial: Trial) -> str | None:
    light, dark = (trial.send(theme) for theme in ({}, {"theme": "dark"}))
    return (
        None
        if light.is_success and dark.is_success and light.text != dark.text
        else f"alike: {light.text[:200]}"
    )


def _if_match(trial: Trial) -> str | None:
    body = trial.asked.body
    if trial.kind == JSON and trial.method == "PATCH":
        name, row = next(
            (name, row) for name, row in trial.asked.members.items() if not isinstance(row, tuple)
        )
        body = {**row.beside, name: row.value} if isinstance(row, To) else {name: row}
    status = trial.send({}, body, {"If-Match": '"another"'}).status_code
    return None if status == 412 else f"an older version is {status}, expected 412"


ALIKE: dict[str, Callable[[Trial], str | None]] = {
    "limit": _limit,
    "cursor": _cursor,
    "deleted": _deleted,
    "theme": _theme,
    "if-match": _if_match,
    "idempotency-key": lambda _: None,  # of every operation that has it: test_once.py
}
"""Members that mean the same everywhere, in small letters."""


def _formats(trial: Trial, stated: Node) -> str | None:
    """Whether each format gives another answer."""
    schema = stated["schema"]
    names = next(one["enum"] for one in (schema, *schema.get("anyOf", [])) if "enum" in one)
    if "svg" in names:  # figures are drawn alike: `tests/integration/test_figures.py`
        names = ["plotly", "svg"]
    usual = schema.get("default")
    answers = {name: trial.send({} if name == usual else {"format": name}) for name in names}
    if wrong := [
        f"{name}: {one.status_code} {one.text[:200]}"
        for name, one in answers.items()
        if one.is_error
    ]:
        return "; ".join(wrong)
    return (
        None
        if len({one.content for one in answers.values()}) == len(names)
        else "two formats give the same"
    )


def faults(
    lab: Lab,
    operation: str,
    kind: str,
    members: Mapping[str, Node],
    asked: Body,
    inner: Inner | None,
    *,
    whole: bool,
) -> list[str]:
    """What is wrong with the members of an operation with a type of body, and with those within
    that have a row; all of it only in a long run, see `To.waits` and `Body.short`.
    """
    of_inner = {
        name: {"in": "within"}
        for name in inner or ()
        if name in asked.members and name not in members
    }
    members = {**members, **of_inner}
    by_itself = {name for name in members if name.lower() in ALIKE or name == "format"}
    found = [
        f"{name}: is no member of the operation, or has no row in tests/support/member_rows_of_*.py"
        for name in (members.keys() ^ asked.members.keys()) - by_itself
    ]
    if asked.short is not None and not whole:
        members = {name: one for name, one in members.items() if name in asked.short}
        asked = replace(asked, members={name: asked.members[name] for name in members})
    trial = Trial(lab, operation, kind, asked, whole=whole)
    groups: dict[str, dict[str, To]] = {}
    for name, row in asked.members.items():
        one = row if isinstance(row, To | Refused | tuple) else To(row)
        place = members.get(name, {}).get("in")
        if place in ("body", "within") and isinstance(one, To) and trial.shows(one):
            group = groups.setdefault(repr((place, one.beside, one.ids, one.waits)), {})
            group[name] = one
    together = set[str]()
    for group in groups.values():
        if len(group) > 1:
            together |= trial.shown_together(group)
    for name, stated in members.items():
        row = asked.members.get(name)
        if alike := ALIKE.get(name.lower()):
            found += [f"{name}: {why}"] if (why := alike(trial)) else []
        if name in together or (row is None and name != "format"):
            continue
        if row is None:
            why = _formats(trial, stated)
        else:
            rows = row if isinstance(row, tuple) else (row,)
            tried = [one if isinstance(one, To | Refused) else To(one) for one in rows]
            why = "; ".join(filter(None, (trial.check(stated["in"], name, one) for one in tried)))
        found += [f"{name}: {why}"] if why else []
    return found
