"""Who gets in where: every operation of the OpenAPI document as every kind of caller, with ids of
the caller's own project, of a foreign one and of none.

What an operation asks for is judged by hand (`furnished.JUDGED`), so that a new route fails until
somebody has judged it. Three things are held against each answer: the status that role, scope and
id call for; that a foreign thing and one that does not exist are answered alike; and that nothing
of the foreign project stands in it.
"""

import copy
import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import uuid4

import httpx
from sqlalchemy import update

from service.app.supervisor import LocalService
from service.pages.example import paper
from service.platform.access.keys import SCOPES, create_key, user_named
from service.platform.access.tables import ApiKey, User
from service.platform.db.engine import Sessions, make_engine, make_sessions
from tests.support import furnished
from tests.support.furnished import BODIES, HOOK, furnish, record
from tests.support.rest import RAW, client_of, posted

PREFIX = "/api/v1"
RANK = {"viewer": 0, "editor": 1, "owner": 2}
REFUSED = (401, 403, 404)
OUTSIDE = {
    "project_id",
    "search_id",
    "instrument_id",
    "webhook_id",
    "delivery_id",
    "key_id",
    "joint_id",
}
"""What belongs to a project and to none of its structures; a joint update is of several."""
_NAMES = re.compile(r"{(\w+)}")
_UNKNOWN = re.compile(r'"detail":\s*"no [\w ]+ [0-9a-f-]{36}"')
Ids = dict[str, str]
Answer = tuple[int, str]


@dataclass(frozen=True)
class Caller:
    """Somebody with a key, or without: `role` in the own project, `scopes` of the key; None for a
    key that is none.
    """

    name: str
    role: str | None
    scopes: tuple[str, ...]
    key: str
    administrator: bool = False


@dataclass
class Matrix:
    """Calls by operation, statuses of all answers, and answers that should not have been, in
    words.
    """

    calls: Counter[str] = field(default_factory=Counter)
    statuses: Counter[int] = field(default_factory=Counter)
    leaks: list[str] = field(default_factory=list)


def operations(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The operations of an OpenAPI document, as `GET /projects`."""
    return {
        f"{method.upper()} {path.removeprefix(PREFIX)}": operation
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }


@contextmanager
def asking_of(service: LocalService) -> Iterator["Round"]:
    """Projects and callers of a service that runs with settings such as `ASKED_FREELY`."""
    with ExitStack() as stack:
        engine = make_engine(service.settings.database_url, pool_size=2)
        stack.callback(engine.dispose)
        line = stack.enter_context(httpx.Client(base_url=service.url, timeout=120, trust_env=False))
        owner, stranger = (
            stack.enter_context(client_of(service, name)) for name in ("owner", "stranger")
        )
        yield Round(make_sessions(engine), line, owner, stranger)


class Round:
    """One service, two projects, all callers."""

    def __init__(
        self, sessions: Sessions, line: httpx.Client, owner: httpx.Client, stranger: httpx.Client
    ) -> None:
        self.line, self.sessions, self.owner, self.matrix = line, sessions, owner, Matrix()
        self.document = line.get("/openapi.json").raise_for_status().json()
        self.mark = f"m4rk{uuid4().hex}"
        self.foreign, self.own = (
            furnish(stranger, sessions, self.mark),
            furnish(owner, sessions, "own"),
        )
        for name, role in (
            ("viewer", "viewer"),
            ("editor", "editor"),
            ("guest", "viewer"),
            ("chief", "viewer"),
        ):
            with sessions.begin() as session:
                user_named(session, name)
            self._join(name, role)
        self.random = {name: str(uuid4()) for name in (*self.own, "user_id")} | {
            "number": "1",
            "name": "parameters",
        }
        for ids in (self.own, self.foreign, self.random):
            ids["member"] = "guest"
        with sessions.begin() as session:
            user_named(session, "chief").administrator = True
            self.own["user_id"] = str(user_named(session, "guest").id)
        self.secrets = {value for name, value in self.foreign.items() if name.endswith("_id")}

    def _join(self, member: str, role: str) -> None:
        path = f"projects/{self.own['project_id']}/members/{member}"
        self.owner.put(path, json={"role": role}).raise_for_status()

    def callers(self, long: bool) -> list[Caller]:
        """Every kind of caller; with every combination of role and scope where it may take long."""
        made, yesterday = [Caller("no key", None, (), "")], datetime.now(UTC) - timedelta(days=1)
        with self.sessions.begin() as session:

            def key(user: str, *scopes: str, **more: Any) -> str:
                return create_key(
                    session, user_named(session, user), "made", scopes or SCOPES, **more
                )[1]

            for role in ("owner", "editor", "viewer"):
                made.append(Caller(role, role, SCOPES, key(role)))
                alone = SCOPES if long or role == "owner" else ()
                made += [
                    Caller(f"{role}, {scope} alone", role, (scope,), key(role, scope))
                    for scope in alone
                ]
            some = ("read", "write", "jobs")
            made.append(Caller("administrator", "viewer", SCOPES, key("chief"), True))
            made.append(
                Caller("administrator, no admin", "viewer", some, key("chief", *some), True)
            )
            if long:
                revoked = create_key(session, user_named(session, "owner"), "revoked")
                session.execute(
                    update(ApiKey).where(ApiKey.id == revoked[0].id).values(revoked_at=yesterday)
                )
                made.append(Caller("revoked", None, (), revoked[1]))
                made.append(Caller("expired", None, (), key("owner", expires_at=yesterday)))
                made.append(Caller("disabled", None, (), key("gone")))
                session.execute(
                    update(User)
                    .where(User.id == user_named(session, "gone").id)
                    .values(disabled_at=yesterday)
                )
        return made

    def run(self, long: bool = False, only: Sequence[str] = ()) -> Matrix:
        """Ask everything, or only some operations, as every caller; what removes things last.

        Args:
            long: every role with every scope, and each asks for what is not its own. Else the least
                role that may and the next lower ask for their own, an administrator for what is
                foreign, and a key of one scope for what names nothing: of the others the test
                compares the scope with the route's.
            only: these operations; all by default.
        """
        self.matrix, self.long = Matrix(), long
        callers, judged, asked = (
            self.callers(long),
            furnished.judgements(),
            operations(self.document),
        )
        for missing in asked.keys() - judged.keys():
            self.matrix.leaks.append(f"{missing}: nobody has judged who may; add it to `JUDGED`")
        for gone in judged.keys() - asked.keys():
            self.matrix.leaks.append(f"{gone}: is judged, but no operation of the document")
        known = [name for name in only or asked if name in judged]
        for name in sorted(known, key=lambda name: (name.startswith("DELETE"), name)):
            for caller in callers:
                if long or _tells(name, caller, *judged[name]):
                    self._ask_all(name, asked[name], judged[name], caller)
        owner = next(caller for caller in callers if caller.role == "owner")
        reads = [name for name in known if name.startswith("GET") and judged[name][0] == "read"]
        self._hide(f"structures/{self.own['structure_id']}", reads, owner, OUTSIDE)
        if not long:  # what is in a structure is found by the structure's project
            reads = [name for name in reads if not (names := _named(name)) or names & OUTSIDE]
        self._hide(f"projects/{self.own['project_id']}", reads, owner, {"key_id"})
        return self.matrix

    def _hide(self, path: str, reads: Sequence[str], owner: Caller, outside: set[str]) -> None:
        """Nothing of what is deleted with a structure or a project is shown by any route, but the
        audit trail.
        """
        self.owner.delete(path).raise_for_status()
        inside = {
            value
            for name, value in self.own.items()
            if name.endswith("_id") and name not in outside
        }
        for name in reads:
            if (named := _named(name)) & outside:
                continue
            answer = self._ask(name, owner, self.own, None)
            if named and answer[0] != 404:
                self._leak(name, owner, "own", answer, f"should be 404 after DELETE {path}")
            if (
                not named
                and name != "GET /audit-events"
                and any(value in answer[1] for value in inside)
            ):
                self._leak(name, owner, "own", answer, f"shows what is hidden by DELETE {path}")
        self.owner.post(f"{path}/restore").raise_for_status()

    def _ask_all(
        self, name: str, operation: dict[str, Any], judged: tuple[str, str], caller: Caller
    ) -> None:
        (scope, role), body = judged, BODIES.get(name)
        refused = (
            200
            if scope == "public"
            else 401
            if caller.role is None
            else 403
            if scope not in caller.scopes
            else None
        )
        if refused:
            self._expect(name, caller, "own", self._ask(name, caller, self.own, body), {refused})
            return
        if role == "administrator":
            self._ask_administrator(name, caller, body)
            return
        named = "{" in name
        if named and (self.long or caller.administrator):
            foreign = self._ask(name, caller, self.foreign, body)
            self._expect(name, caller, "foreign", foreign, {404})
            if self.long:
                random = self._ask(name, caller, self.random, body)
                self._expect(name, caller, "random", random, {404})
                self._same(name, caller, random, foreign, self.random, self.foreign)
            elif not _UNKNOWN.search(foreign[1]):
                self._leak(name, caller, "foreign", foreign, "does not say that there is none")
        if caller.administrator and not self.long:
            return
        if role != "anyone" and RANK[str(caller.role)] < RANK[role]:
            self._expect(name, caller, "own", self._ask(name, caller, self.own, body), {403})
            return
        if self.long or role in (caller.role, "anyone"):
            self._ask_own(name, caller, body)
        if len(caller.scopes) > 1 and (self.long or caller.role == "owner"):
            self._references(name, operation, caller, body)

    def _ask_own(self, name: str, caller: Caller, body: Any) -> None:
        """Who may is let in; what that removes is brought back."""
        user = "chief" if caller.administrator else str(caller.role)
        ids = self._with_own_key(user) if "{key_id}" in name else self.own
        own = self._ask(name, caller, ids, body)
        if "{" in name and own[0] in REFUSED:
            random = self._ask(name, caller, self.random, body)
            if _anonymous(own[1], ids) == _anonymous(random[1], self.random):
                self._leak(name, caller, "own", own, "should be let in")
        if name.startswith("DELETE") and own[0] < 300:
            self._repair(name)

    def _ask_administrator(self, name: str, caller: Caller, body: Any) -> None:
        """Users belong to no project: an administrator is let in to all, anybody else learns not
        even who there is.
        """
        ids = self._with_own_key("guest") if "{key_id}" in name else self.own
        own, random = self._ask(name, caller, ids, body), self._ask(name, caller, self.random, body)
        if caller.administrator:
            self._expect(name, caller, "own", own, {200, 204})
            self._expect(name, caller, "random", random, {404} if "{" in name else {200, 204})
        else:
            self._expect(name, caller, "own", own, {403})
            self._same(name, caller, random, own, self.random, ids)

    def _references(self, name: str, operation: dict[str, Any], caller: Caller, body: Any) -> None:
        """Ids in the query and in the body: a foreign one is like one that there is not."""

        def compare(what: str, **how: Any) -> None:
            ids = (str(uuid4()), self.foreign[_kind_of(what)])
            make = how.pop("make")
            one, other = (self._ask(name, caller, self.own, *make(value)) for value in ids)
            self._same(name, caller, one, other, {"x": ids[0]}, {"x": ids[1]})

        for parameter in operation.get("parameters", []):
            if parameter["in"] == "query" and _is_uuid(parameter["schema"]):
                compare(
                    parameter["name"],
                    make=lambda value, own=parameter["name"]: (body, {own: value}),
                )
        schema = (
            operation.get("requestBody", {})
            .get("content", {})
            .get("application/json", {})
            .get("schema", {})
        )
        for place in _uuid_places(self.document, schema):
            # a list of ids ends in a number
            own = next(step for step in reversed(place) if isinstance(step, str))
            compare(own, make=lambda value, place=place: (_with(body, place, value),))

    def _with_own_key(self, name: str) -> Ids:
        with self.sessions.begin() as session:
            return {
                **self.own,
                "key_id": str(create_key(session, user_named(session, name), "spare")[0].id),
            }

    def _ask(
        self, name: str, caller: Caller, ids: Ids, body: Any, query: Ids | None = None
    ) -> Answer:
        method, path = name.split(" ", 1)
        headers = {"Authorization": f"Bearer {caller.key}"} if caller.key else {}
        arguments: dict[str, Any] = {"params": query or {}}
        if name.endswith("/imports") and method == "POST":
            arguments["content"], headers = b"no file", headers | RAW
        elif name == "PUT /laboratory/logo":
            arguments["content"], headers = b"\x89PNG\r\n\x1a\n", headers | RAW
        elif body is not None:
            arguments["json"] = body
        if method == "DELETE" and path.split("/")[1] in (
            "structures",
            "campaigns",
            "instruments",
            "monitors",
        ):
            headers["If-Match"] = '"another"'  # so that it stays
        url = ("" if path in ("/healthz", "/readyz") else PREFIX) + path.format_map(ids)
        with self.line.stream(method, url, headers=headers, **arguments) as answer:
            if answer.headers.get("content-type", "").startswith("text/event-stream"):
                content = next(answer.iter_text(), "")
            else:
                content = answer.read().decode("utf-8", "replace")
            status = answer.status_code
        self.line.cookies.clear()  # a session that was begun is nobody else's
        self.matrix.calls[name] += 1
        self.matrix.statuses[status] += 1
        sent = {*ids.values(), *(query or {}).values()}
        shown = next(
            (
                s
                for s in self.secrets
                if s in content and s not in sent and s not in json.dumps(body)
            ),
            None,
        )
        if self.mark in content or shown:
            self._leak(
                name, caller, "any", (status, content), "says something of the foreign project"
            )
        if status >= 500:
            self._leak(name, caller, "any", (status, content), "is an error of the service")
        return status, content

    def _expect(
        self, name: str, caller: Caller, what: str, answer: Answer, wanted: set[int]
    ) -> None:
        if answer[0] not in wanted:
            self._leak(name, caller, what, answer, f"should be {', '.join(map(str, wanted))}")

    def _same(
        self, name: str, caller: Caller, one: Answer, other: Answer, ids: Ids, others: Ids
    ) -> None:
        if (one[0], _anonymous(one[1], ids)) != (other[0], _anonymous(other[1], others)):
            self._leak(
                name,
                caller,
                "foreign",
                other,
                f"is answered unlike an id that is none: {one[0]} {one[1][:200]}",
            )

    def _leak(self, name: str, caller: Caller, what: str, answer: Answer, why: str) -> None:
        self.matrix.leaks.append(
            f"{name}, {caller.name}, {what} id: {why}; it is {answer[0]} {answer[1][:300]}"
        )

    def _repair(self, name: str) -> None:
        """Bring back what an act of somebody who may has removed."""
        own = self.own
        if name.startswith("DELETE /projects/{project_id}/members"):
            self._join("guest", "viewer")
        elif name == "DELETE /projects/{project_id}":
            posted(self.owner, f"projects/{own['project_id']}/restore")
        elif name.startswith("DELETE /records"):
            campaign = posted(
                self.owner, f"structures/{own['structure_id']}/campaigns", paper.CAMPAIGN
            )["id"]
            own["record_id"] = posted(self.owner, f"campaigns/{campaign}/records", record())[
                "items"
            ][0]["id"]
        elif name.startswith("DELETE /attachments"):
            own["attachment_id"] = posted(
                self.owner, f"campaigns/{own['campaign_id']}/attachments", content=b"", headers=RAW
            )["id"]
        elif name.startswith("DELETE /searches"):
            body = {"project": own["project_id"], "name": str(uuid4()), "noun": "frfs"}
            own["search_id"] = posted(self.owner, "searches", body)["id"]
        elif name.startswith("DELETE /webhooks"):
            own["webhook_id"] = posted(
                self.owner, "webhooks", {"project": own["project_id"], "url": HOOK}
            )["id"]


def _tells(name: str, caller: Caller, scope: str, role: str) -> bool:
    """Whether the answer to a caller shows what the answers to others do not."""
    if caller.administrator:
        return "admin" in caller.scopes or scope == "admin"
    if len(caller.scopes) == 1:
        alone = (scope, SCOPES[SCOPES.index(scope) - 1]) if scope in SCOPES else ()
        return "{" not in name and caller.scopes[0] in alone
    if caller.role in ("viewer", "editor"):
        return caller.role in {"editor": ("viewer", "editor"), "owner": ("editor",)}.get(
            role, ("viewer",)
        )
    return True


def _named(operation: str) -> set[str]:
    """The names of ids in the path of an operation."""
    return set(_NAMES.findall(operation))


def _anonymous(content: str, ids: Ids) -> str:
    """An answer without the ids that were asked for and without the request's."""
    try:
        document = json.loads(content)
    except ValueError:
        return content
    if isinstance(document, dict):
        document.pop("request_id", None)
    shown = json.dumps(document)
    for value in ids.values():
        shown = shown.replace(value, "…") if len(value) == 36 else shown
    return shown


def _is_uuid(schema: dict[str, Any]) -> bool:
    return any(one.get("format") == "uuid" for one in (schema, *schema.get("anyOf", [])))


def _kind_of(name: str) -> str:
    """The kind of thing that a field names, as paths call it."""
    known = dict.fromkeys(("prior_from_coupon_batch", "batch", "coupon_batches"), "batch_id")
    return known.get(name, name if name.endswith("_id") else f"{name}_id")


def _uuid_places(
    document: dict[str, Any], schema: dict[str, Any], at: tuple[str | int, ...] = ()
) -> Iterator[Any]:
    """Where a body names things by id, as the steps to each."""
    if "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
    if schema.get("format") == "uuid":
        yield at
    for one in schema.get("anyOf", []) + schema.get("oneOf", []):
        yield from _uuid_places(document, one, at)
    for name, one in schema.get("properties", {}).items():
        yield from _uuid_places(document, one, (*at, name))
    if isinstance(schema.get("items"), dict):
        yield from _uuid_places(document, schema["items"], (*at, 0))


def _with(body: Any, place: tuple[str | int, ...], value: str) -> Any:
    """A copy of a body that has an id at a place."""
    made = copy.deepcopy(body)
    node = made
    for step, following in zip(place, (*place[1:], None), strict=True):
        new: Any = value if following is None else [{}] if following == 0 else {}
        if following is None or (isinstance(node, dict) and step not in node):
            node[step] = new
        node = node[step]
    return made
