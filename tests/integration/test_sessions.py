"""A browser's session: from a key, with its rights, ended with it; what changes something needs its token."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from service.access.keys import COOKIE
from tests.support.rest import ok, session_client


@pytest.fixture
def signed_in(api: httpx.Client) -> Iterator[httpx.Client]:
    """A client with the cookie of a session and no key."""
    with session_client(api) as client:
        yield client


def test_a_session_reads_and_writes_as_its_key(api: httpx.Client, signed_in: httpx.Client) -> None:
    made = ok(signed_in.post("projects", json={"name": "by cookie"}), 201)
    assert ok(api.get(f"projects/{made['id']}"))["name"] == "by cookie"
    acts = [(event["action"], event["user"]) for event in ok(api.get("audit-events"))["items"]]
    assert {action for action, _ in acts} >= {"session.create", "project.create"}
    assert len({user for _, user in acts}) == 1


def test_the_cookie_is_kept_from_scripts_and_other_sites(api: httpx.Client) -> None:
    answer = api.post("session")
    name, _, flags = answer.headers["set-cookie"].partition(";")
    assert name.startswith(f"{COOKIE}=mbs_")
    stated = {flag.strip().lower() for flag in flags.split(";")}
    assert stated == {"httponly", "samesite=strict", "path=/", "max-age=43200"}  # `secure` where one comes by HTTPS
    assert answer.headers["cache-control"] == "no-store"
    assert name.partition("=")[2] not in answer.text


@pytest.mark.parametrize("token", [None, "", "0" * 64, "é"])
def test_a_change_without_the_sessions_token_is_refused(signed_in: httpx.Client, token: str | None) -> None:
    headers = {} if token is None else {"X-CSRF-Token": token.encode()}
    signed_in.headers.pop("X-CSRF-Token")
    answer = signed_in.post("projects", json={"name": "forged"}, headers=headers)
    assert answer.status_code == 403
    assert "X-CSRF-Token" in answer.json()["detail"]
    assert ok(signed_in.get("projects"))["items"] == []


def test_a_session_ends_when_its_owner_signs_out(api: httpx.Client, signed_in: httpx.Client) -> None:
    answer = signed_in.delete("session")
    assert answer.status_code == 204
    assert answer.headers["set-cookie"].startswith(f'{COOKIE}=""; ')
    assert {"httponly", "max-age=0"} <= {flag.strip().lower() for flag in answer.headers["set-cookie"].split(";")}
    assert signed_in.get("projects").status_code == 401
    acts = [event["action"] for event in ok(api.get("audit-events"))["items"]]
    assert acts == ["session.delete", "session.create"]


def test_a_session_makes_no_session_and_a_key_ends_none(signed_in: httpx.Client, api: httpx.Client) -> None:
    assert signed_in.post("session").status_code == 409
    assert api.delete("session").status_code == 409
