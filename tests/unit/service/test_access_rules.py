"""Rules of access that need no database: roles, keys that are known, the session's cookie."""

import asyncio
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any
from uuid import uuid4

import pytest

from service.access import door
from service.access.door import KnownKeys, SessionCookie, session_token
from service.access.keys import COOKIE, HEADER, request_token
from service.access.lookup import Role, require_role
from service.access.tables import Project
from service.errors import Conflict, Forbidden, NotFound, TooManyRequests, Unauthorized

ROLES: tuple[Role, ...] = ("viewer", "editor", "owner")
NOW = datetime(2026, 3, 1, tzinfo=UTC)


def refused(act: Callable[[], object]) -> type[Exception] | None:
    try:
        act()
    except (NotFound, Forbidden, Conflict) as error:
        return type(error)
    return None


@pytest.mark.parametrize("held", [None, *ROLES])
@pytest.mark.parametrize("role", ROLES)
def test_a_role_is_enough_for_itself_and_for_lower_ones(held: Role | None, role: Role) -> None:
    fresh, archived, deleted = (
        Project(id=uuid4(), name="p"),
        Project(id=uuid4(), name="p", archived_at=NOW),
        Project(id=uuid4(), name="p", deleted_at=NOW),
    )
    too_low = None if held is None or ROLES.index(held) >= ROLES.index(role) else Forbidden
    expected = NotFound if held is None else too_low
    assert refused(lambda: require_role(fresh, held, role)) is expected
    changes = Conflict if role != "viewer" else None  # an archived project is read only
    assert refused(lambda: require_role(archived, held, role)) is (expected or changes)
    assert refused(lambda: require_role(deleted, held, role)) is NotFound
    for project in (archived, deleted):
        assert refused(lambda project=project: require_role(project, held, role, resting=True)) is expected


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(door, "time", clock)
    return clock


@pytest.mark.parametrize("header", [None, "", "Bearer", "Bearer  ", "Basic mb_1_2", "mb_1_2"])
def test_without_a_key_nobody_is_there(header: str | None) -> None:
    with pytest.raises(Unauthorized, match="send `Authorization: Bearer KEY`"):
        KnownKeys(5).caller(header, "home")


def test_a_key_counts_for_itself_only_when_it_was_found_valid(clock: Clock) -> None:
    keys = KnownKeys(5)
    new = keys.caller("bearer mb_1_2 ", "home")
    assert (new.name, new.token, new.known) == ("address home", "mb_1_2", False)
    keys.found(new, "home", valid=True)
    known = keys.caller("Bearer mb_1_2", "elsewhere")
    assert (known.name, known.known, known.digest) == (f"key {new.digest.hex()}", True, new.digest)
    assert not keys.caller("Bearer mb_1_3", "home").known
    clock.now += door.SECONDS - 1
    assert keys.caller("Bearer mb_1_2", "home").known
    clock.now += 1
    assert not keys.caller("Bearer mb_1_2", "home").known  # the database is asked again


def test_a_wrong_key_is_refused_and_its_address_after_some() -> None:
    keys = KnownKeys(2)
    right = keys.caller("Bearer right", "home")
    keys.found(right, "home", valid=True)
    wrong = keys.caller("Bearer wrong", "home")
    for _ in range(3):  # several requests that came at once with one wrong key are one try
        keys.found(wrong, "home", valid=False)
    with pytest.raises(Unauthorized, match="the API key is not valid"):
        keys.caller("Bearer wrong", "home")
    keys.found(keys.caller("Bearer other", "home"), "home", valid=False)
    with pytest.raises(TooManyRequests) as many:
        keys.caller("Bearer third", "home")
    assert many.value.retry_after == 60
    assert keys.caller("Bearer right", "home").known  # who is known to be right is let in from there
    assert not keys.caller("Bearer third", "elsewhere").known


def test_only_so_many_keys_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "MOST_KEYS", 2)
    keys = KnownKeys(5)
    first, second, third = (keys.caller(f"Bearer {name}", "home") for name in "abc")
    for one in (first, second, first, third):  # the second is the one that was found longest ago
        keys.found(one, "home", valid=True)
    assert [keys.caller(f"Bearer {name}", "home").known for name in "abc"] == [True, False, True]


def cookie_scope(cookie: str, *headers: tuple[bytes, bytes], method: str = "GET") -> dict[str, Any]:
    return {"type": "http", "method": method, "headers": [(b"cookie", cookie.encode("latin-1")), *headers]}


@pytest.mark.parametrize(
    ("scope", "token"),
    [
        (cookie_scope(f"a=b; {COOKIE}=mbs_x"), "mbs_x"),
        (cookie_scope(f"{COOKIE}=mb_1_2"), None),  # a key is no session
        (cookie_scope("a=b"), None),
        (cookie_scope(f"{COOKIE}=mbs_\xe9"), None),
        (cookie_scope("a[=; \x00"), None),
        (cookie_scope(f"{COOKIE}=mbs_x", (b"authorization", b"Bearer mb_1_2")), None),
        ({"type": "http", "method": "GET", "headers": []}, None),
    ],
)
def test_a_cookie_stands_for_a_key_where_none_is_stated(scope: dict[str, Any], token: str | None) -> None:
    assert session_token(scope) == token


@pytest.mark.parametrize(
    ("method", "proof", "let_in"),
    [
        ("GET", None, True),
        ("HEAD", None, True),
        ("POST", None, False),
        ("DELETE", "mbs_x", False),
        ("POST", "right", True),
    ],
)
def test_what_changes_something_needs_the_sessions_own_token(method: str, proof: str | None, let_in: bool) -> None:
    seen: list[dict[str, Any]] = []
    sent: list[dict[str, Any]] = []

    async def app(scope: Any, *_: Any) -> None:
        seen.append(scope)

    async def receive() -> Any:
        return {"type": "http.request", "body": b""}

    async def send(message: Any) -> None:
        sent.append(message)

    value = request_token("mbs_x") if proof == "right" else proof
    proofs = [] if value is None else [(HEADER.lower().encode(), value.encode())]
    asyncio.run(SessionCookie(app)(cookie_scope(f"{COOKIE}=mbs_x", *proofs, method=method), receive, send))
    if let_in:
        assert (b"authorization", b"Bearer mbs_x") in seen[0]["headers"]
        assert sent == []
    else:
        assert seen == []
        assert sent[0]["status"] == 403


def test_what_is_no_request_passes_by() -> None:
    seen: list[Any] = []

    async def app(scope: Any, *_: Any) -> None:
        seen.append(scope)

    asyncio.run(SessionCookie(app)({"type": "lifespan"}, None, None))
    assert seen == [{"type": "lifespan"}]
