"""Users, keys, sessions, projects, members and the audit trail over HTTP."""

from collections.abc import Callable, Iterator
from typing import Any
from uuid import UUID, uuid4

import httpx
import pytest
from fastapi import Request
from pydantic import BaseModel
from sqlalchemy import select

from service.app.supervisor import LocalService
from service.platform.access.keys import COOKIE, authenticated_key, create_key, user_named
from service.platform.access.tables import ApiKey
from service.platform.db.engine import Sessions
from service.platform.errors import PreconditionFailed, PreconditionRequired, Unauthorized
from service.platform.web import etag_of, require_match
from tests.support.rest import client_of, ok, session_client

NewClient = Callable[[], httpx.Client]


def project(client: httpx.Client, name: str = "beam") -> str:
    answer = client.post("projects", json={"name": name})
    assert answer.status_code == 201
    assert answer.headers["location"] == f"/api/v1/projects/{answer.json()['id']}"
    return str(answer.json()["id"])


def name_of(client: httpx.Client) -> str:
    return str(client.get("api-keys").json()["items"][0]["name"])


def test_who_adds_members_does_not_learn_which_users_there_are(
    new_client: NewClient, service: LocalService, rows: Callable[..., list[dict[str, Any]]]
) -> None:
    """A name that nobody has is a member like any other, and is one indeed as soon as it gets a
    key.
    """
    owner, guest = new_client(), new_client()
    key, old, new = project(owner), name_of(guest), f"tester-{uuid4().hex}"
    answers = [
        owner.put(f"projects/{key}/members/{name}", json={"role": "viewer"}) for name in (old, new)
    ]
    assert [answer.status_code for answer in answers] == [200, 200]
    shown = [
        {**answer.json(), "user": "", "user_id": UUID(answer.json()["user_id"]).version}
        for answer in answers
    ]
    assert shown[0] == shown[1]
    listed = {m["user"]: m for m in owner.get(f"projects/{key}/members").json()["items"]}
    assert listed.keys() == {name_of(owner), old, new}
    assert listed[new].keys() == listed[old].keys()
    moment = "SELECT uuid_extract_timestamp(%s::uuid) < now() - interval '1 ms' AS past"
    first = (
        "SELECT uuid_extract_timestamp(%s::uuid) >= min(created_at) - interval '1 ms' AS after FROM"
        " users"
    )
    # the id does not say that it was made just now
    assert rows(moment, listed[new]["user_id"]) == [{"past": True}]
    assert rows(first, listed[new]["user_id"]) == [{"after": True}]
    with client_of(service, new) as late:
        assert late.get(f"projects/{key}").status_code == 200
        assert late.patch(f"projects/{key}", json={"name": "x"}).status_code == 403
    again = owner.put(f"projects/{key}/members/{new}", json={"role": "editor"}).json()
    assert (again["user_id"], again["role"]) == (listed[new]["user_id"], "editor")
    for strange in ("%00", "%20", "x" * 201):
        assert owner.put(f"projects/{key}/members/{strange}", json={}).status_code == 404


def test_the_last_owner_stays(new_client: NewClient) -> None:
    owner, heir = new_client(), new_client()
    key = project(owner)
    assert owner.delete(f"projects/{key}/members/{name_of(owner)}").status_code == 409
    assert (
        owner.put(f"projects/{key}/members/{name_of(owner)}", json={"role": "viewer"}).status_code
        == 409
    )
    assert (
        owner.put(f"projects/{key}/members/{name_of(owner)}", json={"role": "owner"}).status_code
        == 200
    )
    assert (
        owner.put(f"projects/{key}/members/{name_of(heir)}", json={"role": "owner"}).status_code
        == 200
    )
    assert owner.delete(f"projects/{key}/members/{name_of(owner)}").status_code == 204
    assert heir.get(f"projects/{key}").status_code == 200
    acts = [
        (event["action"], event["detail"]) for event in heir.get("audit-events").json()["items"]
    ]
    assert acts == [
        ("member.delete", {}),
        *[("member.put", {"role": "owner"})] * 2,
        ("project.create", {"name": "beam"}),
    ]


def test_pages_by_cursor(api: httpx.Client) -> None:
    made = [project(api, f"p{i}") for i in range(7)]
    got: list[str] = []
    cursor = None
    for size in (3, 3, 1):
        page = api.get(
            "projects", params={"limit": 3} | ({"cursor": cursor} if cursor else {})
        ).json()
        assert len(page["items"]) == size
        got += [item["id"] for item in page["items"]]
        cursor = page["next_cursor"]
    assert cursor is None
    assert got == made


def test_keys_are_shown_once_and_can_be_revoked(api: httpx.Client) -> None:
    made = api.post("api-keys", json={"name": "script"}).json()
    other = {"Authorization": f"Bearer {made['key']}"}
    assert api.get("projects", headers=other).status_code == 200
    listed = api.get("api-keys").json()["items"]
    assert len(listed) == 2
    assert all("key" not in item for item in listed)
    assert made["key"].split("_", 2)[2] not in api.get("api-keys").text
    for _ in range(2):  # again is fine, and no act
        assert api.delete(f"api-keys/{made['id']}").status_code == 204
    assert api.get("projects", headers=other).status_code == 401
    assert api.delete(f"api-keys/{uuid4()}").status_code == 404
    events = api.get("audit-events").json()["items"]
    assert [(event["action"], event["subject_id"], event["detail"]) for event in events] == [
        ("api_key.revoke", made["id"], {}),
        ("api_key.create", made["id"], {"name": "script", "scopes": made["scopes"]}),
    ]


def test_acts_are_audited_with_their_request(new_client: NewClient) -> None:
    api, other = new_client(), new_client()
    answer = api.post("projects", json={"name": "beam"}, headers={"X-Request-ID": "r-1"})
    event = api.get("audit-events").json()["items"][0]
    assert (event["action"], event["subject_id"], event["request_id"]) == (
        "project.create",
        answer.json()["id"],
        "r-1",
    )
    assert (event["user"], event["detail"]) == (name_of(api), {"name": "beam"})
    assert other.get("audit-events").json()["items"] == []
    assert other.get("audit-events", params={"project": answer.json()["id"]}).status_code == 404
    second = project(api)
    for key in (answer.json()["id"], second):
        own = api.get("audit-events", params={"project": key}).json()["items"]
        assert [event["subject_id"] for event in own] == [key]


def test_what_fails_leaves_no_trace(api: httpx.Client) -> None:
    key = project(api)
    before = api.get("audit-events").json()
    assert api.put(f"projects/{key}/members/{uuid4()}", json={}).status_code == 404
    assert api.get("audit-events").json() == before


def test_only_the_digest_of_a_key_is_stored(sessions: Sessions) -> None:
    with sessions.begin() as session:
        row, key = create_key(session, user_named(session, "ada"), "k")
        assert user_named(session, "ada").id == row.user_id
    with sessions.begin() as session:
        assert authenticated_key(session, key)[1].name == "ada"
        stored = session.scalars(select(ApiKey)).one()
        assert key.split("_", 2)[2].encode() not in stored.secret_sha256
        assert stored.last_used_at is not None
        for wrong in (key + "x", key[:-1], key.upper(), key.replace("mb_", "xx_"), "mb__", ""):
            with pytest.raises(Unauthorized):
                authenticated_key(session, wrong)


class _Body(BaseModel):
    id: UUID | None = None
    name: str


def test_if_match() -> None:
    tag = etag_of(_Body(name="a"))
    assert tag == etag_of(_Body(name="a")) != etag_of(_Body(name="b"))

    def request(value: str | None) -> Request:
        headers = [] if value is None else [(b"if-match", value.encode())]
        return Request({"type": "http", "headers": headers})

    for fine in (tag, "*", f'"x", {tag}'):
        require_match(request(fine), tag)
    with pytest.raises(PreconditionRequired):
        require_match(request(None), tag)
    with pytest.raises(PreconditionFailed):
        require_match(request('"x"'), tag)


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
    # `secure` where one comes by HTTPS
    assert stated == {"httponly", "samesite=strict", "path=/", "max-age=43200"}
    assert answer.headers["cache-control"] == "no-store"
    assert name.partition("=")[2] not in answer.text


@pytest.mark.parametrize("token", [None, "", "0" * 64, "é"])
def test_a_change_without_the_sessions_token_is_refused(
    signed_in: httpx.Client, token: str | None
) -> None:
    headers = {} if token is None else {"X-CSRF-Token": token.encode()}
    signed_in.headers.pop("X-CSRF-Token")
    answer = signed_in.post("projects", json={"name": "forged"}, headers=headers)
    assert answer.status_code == 403
    assert "X-CSRF-Token" in answer.json()["detail"]
    assert ok(signed_in.get("projects"))["items"] == []


def test_a_session_ends_when_its_owner_signs_out(
    api: httpx.Client, signed_in: httpx.Client
) -> None:
    answer = signed_in.delete("session")
    assert answer.status_code == 204
    assert answer.headers["set-cookie"].startswith(f'{COOKIE}=""; ')
    assert {"httponly", "max-age=0"} <= {
        flag.strip().lower() for flag in answer.headers["set-cookie"].split(";")
    }
    assert signed_in.get("projects").status_code == 401
    acts = [event["action"] for event in ok(api.get("audit-events"))["items"]]
    assert acts == ["session.delete", "session.create"]


def test_a_session_makes_no_session_and_a_key_ends_none(
    signed_in: httpx.Client, api: httpx.Client
) -> None:
    assert signed_in.post("session").status_code == 409
    assert api.delete("session").status_code == 409
