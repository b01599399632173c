"""Rules that need no database: roles, keys that are known, the session's cookie, and where messages
may go.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any
from uuid import uuid4

import pytest

import service.app.composition  # noqa: F401  imports every table
from service.nouns.notifications.addresses import AddressError, parse_url, resolve
from service.nouns.notifications.channels.webhook import sign
from service.platform.access import authentication
from service.platform.access.authentication import KnownKeys, session_token
from service.platform.access.keys import COOKIE
from service.platform.access.lookup import Role, require_role
from service.platform.access.tables import Project
from service.platform.errors import Conflict, Forbidden, NotFound, Unauthorized
from service.platform.settings import Settings

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
        assert (
            refused(lambda project=project: require_role(project, held, role, resting=True))
            is expected
        )


@pytest.mark.parametrize("header", [None, "", "Bearer", "Bearer  ", "Basic mb_1_2", "mb_1_2"])
def test_without_a_key_nobody_is_there(header: str | None) -> None:
    with pytest.raises(Unauthorized, match="send `Authorization: Bearer KEY`"):
        KnownKeys(5).caller(header, "home")


def test_a_key_counts_for_itself_only_when_it_was_found_valid(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 1000.0
    monkeypatch.setattr(authentication, "time", SimpleNamespace(monotonic=lambda: now))
    keys = KnownKeys(5)
    new = keys.caller("bearer mb_1_2 ", "home")
    assert (new.name, new.token, new.known) == ("address home", "mb_1_2", False)
    keys.remember(new, "home", valid=True)
    known = keys.caller("Bearer mb_1_2", "elsewhere")
    assert (known.name, known.known, known.digest) == (f"key {new.digest.hex()}", True, new.digest)
    assert not keys.caller("Bearer mb_1_3", "home").known
    now += authentication.SECONDS - 1
    assert keys.caller("Bearer mb_1_2", "home").known
    now += 1
    assert not keys.caller("Bearer mb_1_2", "home").known  # the database is asked again


def test_a_wrong_key_is_refused_and_its_address_after_some() -> None:
    keys = KnownKeys(2)
    right = keys.caller("Bearer right", "home")
    keys.remember(right, "home", valid=True)
    wrong = keys.caller("Bearer wrong", "home")
    for _ in range(3):  # several requests that came at once with one wrong key are one try
        keys.remember(wrong, "home", valid=False)
    with pytest.raises(Unauthorized, match="the API key is not valid"):
        keys.caller("Bearer wrong", "home")
    keys.remember(keys.caller("Bearer other", "home"), "home", valid=False)
    # it is looked up before anything else is done for it
    assert keys.caller("Bearer third", "home").suspect
    right = keys.caller("Bearer right", "home")
    # who is known to be right is let in from there
    assert (right.known, right.suspect) == (True, False)
    third = keys.caller("Bearer third", "elsewhere")
    assert (third.known, third.suspect) == (False, False)


def test_only_so_many_keys_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(authentication, "MOST_KEYS", 2)
    keys = KnownKeys(5)
    first, second, third = (keys.caller(f"Bearer {name}", "home") for name in "abc")
    for one in (first, second, first, third):  # the second is the one that was found longest ago
        keys.remember(one, "home", valid=True)
    assert [keys.caller(f"Bearer {name}", "home").known for name in "abc"] == [True, False, True]


def cookie_scope(cookie: str, *headers: tuple[bytes, bytes], method: str = "GET") -> dict[str, Any]:
    return {
        "type": "http",
        "method": method,
        "headers": [(b"cookie", cookie.encode("latin-1")), *headers],
    }


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
def test_a_cookie_stands_for_a_key_where_none_is_stated(
    scope: dict[str, Any], token: str | None
) -> None:
    assert session_token(scope) == token


# --- where messages may go, and how they are signed
# ---------------------------------------------------------------------

LOOPBACK = Settings(
    webhook_networks="127.0.0.0/8", webhook_ports="1-65535", delivery_pause_seconds=0.05
)
ANYWHERE = Settings()
NOT_PUBLIC = [
    "127.0.0.1", "0.0.0.0", "10.1.2.3", "169.254.169.254", "[::1]", "[::ffff:127.0.0.1]", "[fe80::1]", "224.0.0.1",
    "[64:ff9b::7f00:1]", "[64:ff9b::10.0.0.1]", "[64:ff9b:1::7f00:1]", "[2002:7f00:1::]", "[2002:a9fe:a9fe::1]",
    "[2001:0:7f00:1::1]", "[2001:0:0808:0808::80ff:fffe]", "[::7f00:1]", "[::169.254.169.254]", "[::ffff:0:127.0.0.1]",
    "[2606:4700::5efe:10.0.0.1]", "[2606:4700::200:5efe:10.0.0.1]", "[::]", "[fd00::1]", "0x7f.1", "2130706433", "localhost",
]  # fmt: skip
REGISTERED = [
    "0.255.255.255", "10.255.255.255", "100.64.0.0", "100.127.255.255", "127.255.255.255", "169.254.255.255", "172.16.0.0",
    "172.31.255.255", "192.0.0.0", "192.0.0.8", "192.0.0.9", "192.0.0.10", "192.0.0.170", "192.0.0.192", "192.0.0.255",
    "192.0.2.255", "192.31.196.1", "192.52.193.1", "192.88.99.1", "192.168.255.255", "192.175.48.1", "198.18.0.0",
    "198.19.255.255", "198.51.100.1", "203.0.113.255", "239.255.255.255", "240.0.0.1", "255.255.255.255",
    "[::ffff:1.1.1.1]", "[64:ff9b::1.1.1.1]", "[64:ff9b:1::101:101]", "[100::1]", "[100:0:0:1::1]", "[2001::1]",
    "[2001:1::1]", "[2001:1::2]", "[2001:2::1]", "[2001:3::1]", "[2001:4:112::1]", "[2001:10::1]", "[2001:20::1]",
    "[2001:30::1]", "[2001:1ff::1]", "[2001:db8::1]", "[2002:101:101::1]", "[2620:4f:8000::1]", "[3fff::1]", "[5f00::1]",
    "[fdff::1]", "[febf::1]", "[fec0::1]", "[ff02::1]", "[4000::1]", "[1fff::1]",
]  # fmt: skip
"""Of every network of the registries an address, ends of some, and what is no unicast or not
assigned.
"""
PUBLIC = [
    "1.0.0.0", "9.255.255.255", "11.0.0.0", "100.63.255.255", "100.128.0.0", "126.255.255.255", "128.0.0.0", "169.253.255.255",
    "169.255.0.0", "172.15.255.255", "172.32.0.0", "192.0.1.0", "192.0.3.0", "192.167.255.255", "192.169.0.0",
    "198.17.255.255", "198.20.0.0", "223.255.255.255", "[2001:200::1]", "[2003::1]", "[2606:4700::1111]", "[2a00::1]",
    "[2620:4f:8001::1]", "[3ffe::1]",
]  # fmt: skip
"""What lies beside them."""


def test_signature_is_that_of_standard_webhooks() -> None:
    """The example that the specification's own libraries test themselves with."""
    signature = sign(
        "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw",
        "msg_p5jXN8AQM9LWM0D4loKWxJek",
        1614265330,
        b'{"test": 2432232314}',
    )
    assert signature == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_ports_are_the_operators() -> None:
    with pytest.raises(AddressError, match="port 22"):
        resolve("http://1.1.1.1:22/", ANYWHERE)
    some = Settings(webhook_ports="443, 8000-8999")
    assert resolve("http://1.1.1.1:8123/", some).url.port == 8123
    with pytest.raises(AddressError, match="port 80"):
        resolve("http://1.1.1.1/", some)
    with pytest.raises(ValueError, match="is no port"):
        Settings(webhook_ports="https")


@pytest.mark.parametrize("host", NOT_PUBLIC + REGISTERED)
def test_addresses_that_are_not_public_are_refused(host: str) -> None:
    with pytest.raises(AddressError, match="not a public address"):
        resolve(f"http://{host}/", ANYWHERE)


def test_public_addresses_are_taken() -> None:
    for address in PUBLIC:
        assert resolve(f"http://{address}/", ANYWHERE).name in address


def test_what_an_allowed_network_carries_must_be_allowed_too() -> None:
    by_nat64 = Settings(webhook_networks="64:ff9b::/96")
    assert resolve("http://[64:ff9b::1.1.1.1]/", by_nat64).name == "64:ff9b::1.1.1.1"
    with pytest.raises(AddressError, match=r"leads to 10\.0\.0\.1 \(private\)"):
        resolve("http://[64:ff9b::10.0.0.1]/", by_nat64)
    both = Settings(webhook_networks="64:ff9b::/96, 10.0.0.0/8")
    assert resolve("http://[64:ff9b::10.0.0.1]/", both).name == "64:ff9b::10.0.0.1"


def test_an_operator_allows_networks() -> None:
    assert resolve("http://127.0.0.9:8080/x?y=1", LOOPBACK).url == "http://127.0.0.9:8080/x?y=1"
    assert resolve("https://1.1.1.1/", ANYWHERE).name == "1.1.1.1"
    with pytest.raises(ValueError, match=r"10\.0\.0\.1/8"):
        Settings(webhook_networks="10.0.0.1/8")
    with pytest.raises(AddressError):
        parse_url("http://")
