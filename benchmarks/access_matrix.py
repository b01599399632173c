"""Who gets in where: `python -m benchmarks.access_matrix [long]` asks every operation of the OpenAPI document as every kind
of caller, with ids of the caller's own project, of a foreign one and of none, and prints the matrix.

What an operation asks for is judged here by hand, so that a new route fails until somebody has judged it. Three things
are held against each answer: the status that role, scope and id call for; that a foreign thing and one that does not
exist are answered alike; and that nothing of the foreign project stands in it.
"""

from __future__ import annotations

import copy
import json
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
from sqlalchemy import update

from benchmarks.access_judged import BODIES, judgements
from benchmarks.access_laboratory import ASKED_FREELY, FORM, HOOK, Things, furnish, record
from service.access.keys import SCOPES, create_key, user_named
from service.access.tables import ApiKey, User
from service.app.demo import paper
from service.app.supervisor import LocalService
from service.db.engine import Sessions, make_engine, make_sessions
from service.settings import Settings

PREFIX = "/api/v1"
RANK = {"viewer": 0, "editor": 1, "owner": 2}
REFUSED = (401, 403, 404)
OUTSIDE = {"project_id", "webhook_id", "delivery_id", "key_id", "joint_id"}
"""What belongs to a project and to none of its structures; a joint update is of several."""
_NAMES = re.compile(r"{(\w+)}")


@dataclass(frozen=True)
class Caller:
    """Somebody with a key, or without: `role` in the own project, `scopes` of the key; None for a key that is none; and
    whether they look after other users.
    """

    name: str
    role: str | None
    scopes: tuple[str, ...]
    key: str
    administrator: bool = False

    @property
    def user(self) -> str:
        """Whose key it is."""
        return "chief" if self.administrator else str(self.role)

    @property
    def may_most(self) -> bool:
        """Whether nobody may more: who else asks for what is foreign is refused by the same lines."""
        return (self.role == "owner" or self.administrator) and self.scopes == SCOPES


@dataclass
class Matrix:
    """What was asked and what was wrong.

    Attributes:
        calls: by operation.
        statuses: of all answers.
        leaks: answers that should not have been, in words.
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


class Round:
    """One service, two projects, all callers."""

    def __init__(self, service: LocalService, sessions: Sessions, line: httpx.Client) -> None:
        self.line, self.sessions, self.matrix = line, sessions, Matrix()
        self.document = line.get("/openapi.json").raise_for_status().json()
        self.mark = f"m4rk{uuid4().hex}"
        self.owner = self._client(service.new_key("owner"))
        self.stranger = self._client(service.new_key("stranger"))
        self.foreign = furnish(self.stranger, sessions, self.mark)
        self.own = furnish(self.owner, sessions, "own")
        for name, role in (("viewer", "viewer"), ("editor", "editor"), ("guest", "viewer"), ("chief", "viewer")):
            with sessions.begin() as session:
                user_named(session, name)
            self._join(name, role)
        self.random = Things({name: str(uuid4()) for name in self.own.ids} | {"number": "1", "name": "parameters"})
        for things in (self.own, self.foreign, self.random):
            things.ids["member"] = "guest"
        with sessions.begin() as session:
            user_named(session, "chief").administrator = True
            self.own.ids["user_id"] = str(user_named(session, "guest").id)
        self.random.ids["user_id"] = str(uuid4())
        self.secrets = {value for name, value in self.foreign.ids.items() if name.endswith("_id")}

    def _client(self, key: str) -> httpx.Client:
        headers = {"Authorization": f"Bearer {key}"}
        return httpx.Client(
            base_url=str(self.line.base_url.join(f"{PREFIX}/")), headers=headers, timeout=120, trust_env=False
        )

    def _join(self, member: str, role: str) -> None:
        path = f"projects/{self.own['project_id']}/members/{member}"
        self.owner.put(path, json={"role": role}).raise_for_status()

    def callers(self, long: bool) -> list[Caller]:
        """Every kind of caller; with every combination of role and scope where it may take long."""
        made = [Caller("no key", None, (), "")]
        with self.sessions.begin() as session:
            for role in ("owner", "editor", "viewer"):
                user = user_named(session, role)
                made.append(Caller(role, role, SCOPES, create_key(session, user, "all")[1]))
                for scope in SCOPES if long or role == "owner" else ():
                    key = create_key(session, user, scope, [scope])[1]
                    made.append(Caller(f"{role}, {scope} alone", role, (scope,), key))
            chief, some = user_named(session, "chief"), ("read", "write", "jobs")
            made.append(Caller("administrator", "viewer", SCOPES, create_key(session, chief, "all")[1], True))
            made.append(
                Caller("administrator, no admin", "viewer", some, create_key(session, chief, "s", some)[1], True)
            )
            owner, yesterday = user_named(session, "owner"), datetime.now(UTC) - timedelta(days=1)
            revoked = create_key(session, owner, "revoked")
            session.execute(update(ApiKey).where(ApiKey.id == revoked[0].id).values(revoked_at=yesterday))
            if not long:
                return [*made, Caller("revoked", None, (), revoked[1])]
            expired = create_key(session, owner, "expired", expires_at=yesterday)
            gone = user_named(session, "gone")
            made += [Caller("revoked", None, (), revoked[1]), Caller("expired", None, (), expired[1])]
            made.append(Caller("disabled", None, (), create_key(session, gone, "gone")[1]))
            session.execute(update(User).where(User.id == gone.id).values(disabled_at=yesterday))
        return made

    def run(self, long: bool = False, only: Sequence[str] = ()) -> Matrix:
        """Ask everything, or only some operations, as every caller; what removes things last.

        Args:
            long: every role with every scope, not only the owner; and each asks for what is not its own, not only those
                that may most.
            only: these operations; all by default.
        """
        self.matrix, self.long = Matrix(), long
        callers, judged = self.callers(long), judgements()
        asked = operations(self.document)
        for missing in asked.keys() - judged.keys():
            self.matrix.leaks.append(f"{missing}: nobody has judged who may; add it to benchmarks/access_judged.py")
        for gone in judged.keys() - asked.keys():
            self.matrix.leaks.append(f"{gone}: is judged, but no operation of the document")
        known = [name for name in only or asked if name in judged]
        for name in sorted(known, key=lambda name: (name.startswith("DELETE"), name)):
            for caller in callers:
                self._ask_all(name, asked[name], judged[name], caller)
        owner = next(caller for caller in callers if caller.role == "owner")
        reads = [name for name in known if name.startswith("GET") and judged[name][0] == "read"]
        self._hide(f"structures/{self.own['structure_id']}", reads, owner, OUTSIDE)
        self._hide(f"projects/{self.own['project_id']}", reads, owner, {"key_id"})
        return self.matrix

    def _hide(self, path: str, reads: Sequence[str], owner: Caller, outside: set[str]) -> None:
        """Nothing of what is deleted with a structure or a project is shown by any route, but the audit trail."""
        self.owner.delete(path).raise_for_status()
        inside = {value for name, value in self.own.ids.items() if name.endswith("_id") and name not in outside}
        for name in reads:
            status, content = self._ask(name, owner, self.own, None)
            named = set(_NAMES.findall(name))
            if named and not named & outside and status != 404:
                self._leak(name, owner, "own", (status, content), f"should be 404 after DELETE {path}")
            if not named and name != "GET /audit-events" and any(value in content for value in inside):
                self._leak(name, owner, "own", (status, content), f"shows what is hidden by DELETE {path}")
        self.owner.post(f"{path}/restore").raise_for_status()

    def _ask_all(self, name: str, operation: dict[str, Any], judged: tuple[str, str], caller: Caller) -> None:
        scope, role = judged
        body = BODIES.get(name)
        if scope == "public":
            self._expect(name, caller, "public", self._ask(name, caller, self.own, body), {200})
            return
        if caller.role is None:
            self._expect(name, caller, "own", self._ask(name, caller, self.own, body), {401})
            return
        if scope not in caller.scopes:
            self._expect(name, caller, "own", self._ask(name, caller, self.own, body), {403})
            return
        if role == "administrator":
            self._ask_administrator(name, caller, body)
            return
        named, outside = "{" in name, self.long or caller.may_most
        if named and outside:
            random, foreign = (self._ask(name, caller, things, body) for things in (self.random, self.foreign))
            self._expect(name, caller, "random", random, {404})
            self._expect(name, caller, "foreign", foreign, {404})
            self._same(name, caller, random, foreign, self.random, self.foreign)
        if role != "anyone" and RANK[caller.role] < RANK[role]:
            self._expect(name, caller, "own", self._ask(name, caller, self.own, body), {403})
            return
        things = self._with_own_key(caller.user) if "{key_id}" in name else self.own
        own = self._ask(name, caller, things, body)
        if named and own[0] in REFUSED:
            random = self._ask(name, caller, self.random, body)
            if _anonymous(own[1], things) == _anonymous(random[1], self.random):
                self._leak(name, caller, "own", own, "should be let in")
        self._repair(name, own[0])
        if outside and len(caller.scopes) > 1:
            self._references(name, operation, caller, body)

    def _ask_administrator(self, name: str, caller: Caller, body: Any) -> None:
        """Users belong to no project: an administrator is let in to all, anybody else learns not even who there is."""
        things = self._with_own_key("guest") if "{key_id}" in name else self.own
        own, random = self._ask(name, caller, things, body), self._ask(name, caller, self.random, body)
        if caller.administrator:
            self._expect(name, caller, "own", own, {200, 204})
            self._expect(name, caller, "random", random, {404} if "{" in name else {200})
        else:
            self._expect(name, caller, "own", own, {403})
            self._same(name, caller, random, own, self.random, things)

    def _references(self, name: str, operation: dict[str, Any], caller: Caller, body: Any) -> None:
        """Ids in the query and in the body: a foreign one is like one that there is not."""
        for parameter in operation.get("parameters", []):
            if parameter["in"] == "query" and _is_uuid(parameter["schema"]):
                target = self.foreign[_kind_of(parameter["name"])]
                absent = str(uuid4())
                answers = [self._ask(name, caller, self.own, body, {parameter["name"]: v}) for v in (absent, target)]
                self._same(name, caller, *answers, Things({"x": absent}), Things({"x": target}))
        schema = operation.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
        for place in _uuid_places(self.document, schema):
            field = next(step for step in reversed(place) if isinstance(step, str))  # a list of ids ends in a number
            target, absent = self.foreign[_kind_of(field)], str(uuid4())
            answers = [self._ask(name, caller, self.own, _with(body, place, v)) for v in (absent, target)]
            self._same(name, caller, *answers, Things({"x": absent}), Things({"x": target}))

    def _with_own_key(self, name: str) -> Things:
        with self.sessions() as session:
            user = user_named(session, name)
            key = create_key(session, user, "spare")[0].id
            session.commit()
        return Things({**self.own.ids, "key_id": str(key)})

    def _ask(
        self, name: str, caller: Caller, things: Things, body: Any, query: dict[str, str] | None = None
    ) -> tuple[int, str]:
        method, path = name.split(" ", 1)
        headers = {"Authorization": f"Bearer {caller.key}"} if caller.key else {}
        arguments: dict[str, Any] = {"params": query or {}}
        if name.endswith("/imports") and method == "POST":
            arguments["content"], headers = b"no file", headers | FORM
        elif body is not None:
            arguments["json"] = body
        if method == "DELETE" and path.split("/")[1] in ("structures", "campaigns", "monitors"):
            headers["If-Match"] = '"another"'  # so that it stays
        prefix = "" if path in ("/healthz", "/readyz") else PREFIX
        url = prefix + path.format_map(things.ids)
        with self.line.stream(method, url, headers=headers, **arguments) as answer:
            if answer.headers.get("content-type", "").startswith("text/event-stream"):
                content = next(answer.iter_text(), "")
            else:
                content = answer.read().decode("utf-8", "replace")
            status = answer.status_code
        self.line.cookies.clear()  # a session that was begun is nobody else's
        self.matrix.calls[name] += 1
        self.matrix.statuses[status] += 1
        sent = set(things.ids.values()) | set((query or {}).values())
        shown = next((s for s in self.secrets if s in content and s not in sent and s not in json.dumps(body)), None)
        if self.mark in content or shown:
            self._leak(name, caller, "any", (status, content), "says something of the foreign project")
        if status >= 500:
            self._leak(name, caller, "any", (status, content), "is an error of the service")
        return status, content

    def _expect(self, name: str, caller: Caller, what: str, answer: tuple[int, str], wanted: set[int]) -> None:
        if answer[0] not in wanted:
            self._leak(name, caller, what, answer, f"should be {', '.join(map(str, wanted))}")

    def _same(
        self, name: str, caller: Caller, one: tuple[int, str], other: tuple[int, str], ids: Things, others: Things
    ) -> None:
        if (one[0], _anonymous(one[1], ids)) != (other[0], _anonymous(other[1], others)):
            self._leak(
                name, caller, "foreign", other, f"is answered unlike an id that is none: {one[0]} {one[1][:200]}"
            )

    def _leak(self, name: str, caller: Caller, what: str, answer: tuple[int, str], why: str) -> None:
        self.matrix.leaks.append(f"{name}, {caller.name}, {what} id: {why}; it is {answer[0]} {answer[1][:300]}")

    def _repair(self, name: str, status: int) -> None:
        """Bring back what an act of somebody who may has removed."""
        if not (name.startswith("DELETE") and status < 300):
            return
        own = self.own.ids
        if name.startswith("DELETE /projects/{project_id}/members"):
            self._join("guest", "viewer")
        elif name == "DELETE /projects/{project_id}":
            self.owner.post(f"projects/{own['project_id']}/restore").raise_for_status()
        elif name.startswith("DELETE /records"):
            made = self.owner.post(
                f"structures/{own['structure_id']}/campaigns", json=paper.CAMPAIGN
            ).raise_for_status()
            answer = self.owner.post(f"campaigns/{made.json()['id']}/records", json=record())
            own["record_id"] = answer.raise_for_status().json()["items"][0]["id"]
        elif name.startswith("DELETE /webhooks"):
            answer = self.owner.post("webhooks", json={"project": own["project_id"], "url": HOOK})
            own["webhook_id"] = answer.raise_for_status().json()["id"]


def _anonymous(content: str, things: Things) -> str:
    """An answer without the ids that were asked for and without the request's."""
    try:
        document = json.loads(content)
    except ValueError:
        return content
    if isinstance(document, dict):
        document.pop("request_id", None)
    shown = json.dumps(document)
    for value in things.ids.values():
        shown = shown.replace(value, "…") if len(value) == 36 else shown
    return shown


def _is_uuid(schema: dict[str, Any]) -> bool:
    return any(one.get("format") == "uuid" for one in (schema, *schema.get("anyOf", [])))


def _kind_of(name: str) -> str:
    """The kind of thing that a field names, as paths call it."""
    known = {
        "prior_from_coupon_batch": "batch_id",
        "batch": "batch_id",
        "coupon_batches": "batch_id",
        "processing": "processing_id",
    }
    return known.get(name, name if name.endswith("_id") else f"{name}_id")


def _uuid_places(document: dict[str, Any], schema: dict[str, Any], at: tuple[str | int, ...] = ()) -> Iterator[Any]:
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


@contextmanager
def asking() -> Iterator[Round]:
    """A service on a temporary database, with its projects and callers, while the block runs."""
    with ExitStack() as stack:
        data = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True)))
        data.chmod(0o755)  # the server may run as a user of its own
        settings = Settings(data=data, port=0, log_level="error", **ASKED_FREELY)
        service = stack.enter_context(LocalService(settings, worker=False))
        yield stack.enter_context(asking_of(service))


@contextmanager
def asking_of(service: LocalService) -> Iterator[Round]:
    """Projects and callers of a service that runs with settings such as `ASKED_FREELY`."""
    with ExitStack() as stack:
        engine = make_engine(service.settings.database_url or "", pool_size=2)
        stack.callback(engine.dispose)
        line = stack.enter_context(httpx.Client(base_url=service.url, timeout=120, trust_env=False))
        asked = Round(service, make_sessions(engine), line)
        stack.callback(asked.owner.close)
        stack.callback(asked.stranger.close)
        yield asked


def report(found: Matrix) -> Iterator[str]:
    """The matrix in lines."""
    for name, (scope, role) in judgements().items():
        yield f"{name:<58} {scope:<7} {role:<7} {found.calls[name]:>5} calls"
    yield f"{found.calls.total()} calls; " + ", ".join(f"{n} × {s}" for s, n in sorted(found.statuses.items()))
    yield f"{len(found.leaks)} leaks"
    yield from found.leaks


if __name__ == "__main__":
    with asking() as asked:
        result = asked.run(long="long" in sys.argv[1:])
    print("\n".join(report(result)))
    sys.exit(1 if result.leaks else 0)
