"""Changes that make no sense, each refused by its pointer, and what a second time does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from uuid import uuid4

import httpx

from tests.support.rest import ok, session_client


def test_what_is_deleted_is_not_there_to_be_changed_or_deleted_again(api: httpx.Client, project: str) -> None:
    ok(api.delete(f"projects/{project}"), 204)
    ok(api.delete(f"projects/{project}"), 404)
    ok(api.patch(f"projects/{project}", json={"name": "x"}, headers={"If-Match": "*"}), 404)
    ok(api.post(f"projects/{project}/restore"), 200)
    assert "not deleted" in ok(api.post(f"projects/{project}/restore"), 409)["detail"]


def test_a_key_that_is_revoked_twice_is_revoked_once_in_the_audit(api: httpx.Client) -> None:
    key = ok(api.post("api-keys", json={"name": "lost"}), 201)["id"]
    for _ in range(2):
        ok(api.delete(f"api-keys/{key}"), 204)
    events = ok(api.get("audit-events"), 200)["items"]
    assert [event["action"] for event in events].count("api_key.revoke") == 1


def test_a_session_begins_and_ends_no_other(api: httpx.Client) -> None:
    with session_client(api) as browser:
        assert "sign in with a key" in ok(browser.post("session"), 409)["detail"]
        assert "revoke the key" in ok(api.delete("session"), 409)["detail"]
        ok(browser.delete("session"), 204)
        ok(browser.get("projects"), 401)


def test_a_project_that_is_full_takes_no_member_more_but_another_role(
    api: httpx.Client, project: str, rows: Callable[..., list[dict[str, Any]]]
) -> None:
    crowd = uuid4().hex
    rows(
        "WITH new AS (INSERT INTO users (name) SELECT %s || n FROM generate_series(1, 999) n RETURNING id) "
        "INSERT INTO members SELECT %s, id, 'viewer' FROM new RETURNING role",
        crowd,
        project,
    )
    assert (
        "has 1000 members"
        in ok(api.put(f"projects/{project}/members/one-more", json={"role": "viewer"}), 409)["detail"]
    )
    assert ok(api.put(f"projects/{project}/members/{crowd}1", json={"role": "editor"}), 200)["role"] == "editor"
    ok(api.delete(f"projects/{project}/members/{crowd}2"), 204)
    ok(api.put(f"projects/{project}/members/one-more", json={"role": "viewer"}), 200)
