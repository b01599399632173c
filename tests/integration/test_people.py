"""Keys and users, over REST and at the command line; projects and structures that are archived,
deleted and purged.
"""

import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import ANY
from uuid import UUID, uuid4

import httpx
import pytest
from sqlalchemy import select, text
from sqlalchemy.exc import DBAPIError, OperationalError
from typer.testing import CliRunner

from service.app.cli.command import app
from service.app.doctor import Finding, examine
from service.app.supervisor import LocalService
from service.nouns.structures.operations import structure_for
from service.platform.access import Member, Project, User
from service.platform.db.engine import Sessions, make_engine, make_sessions
from service.platform.queue.queue import enqueue
from service.platform.settings import Settings
from tests.support.job_kinds import KINDS
from tests.support.laboratory import BEAM
from tests.support.rest import client_at, ok

NewClient = Callable[[], httpx.Client]


@pytest.fixture
def project(api: httpx.Client) -> str:
    return str(api.post("projects", json={"name": "p", "description": "d"}).json()["id"])


def with_key(made: dict[str, Any]) -> dict[str, str]:
    return {"Authorization": f"Bearer {made['key']}"}


def test_a_key_makes_none_with_more_rights(api: httpx.Client) -> None:
    soon = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    later = (datetime.now(UTC) + timedelta(hours=2)).isoformat()
    made = api.post(
        "api-keys", json={"name": "a", "scopes": ["read", "admin"], "expires_at": soon}
    ).json()
    assert made["scopes"] == ["read", "admin"]
    narrow = with_key(made)
    for body, pointer in (
        ({"scopes": ["read", "write"]}, "/scopes"),
        ({"expires_at": later}, "/expires_at"),
        ({"expires_at": "2020-01-01T00:00:00Z"}, "/expires_at"),
    ):
        answer = api.post("api-keys", json={"name": "b", **body}, headers=narrow)
        assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, pointer)
    for body in ({}, {"expires_at": soon, "scopes": ["read", "admin", "read"]}):
        heir = api.post("api-keys", json={"name": "b", **body}, headers=narrow).json()
        assert (heir["scopes"], heir["expires_at"]) == (made["scopes"], made["expires_at"])


def test_an_edit_keeps_other_edits_off_and_no_reader(
    api: httpx.Client, project: str, service: LocalService
) -> None:
    key = UUID(ok(api.post(f"projects/{project}/structures", json=BEAM), 201)["id"])
    engine = make_engine(service.settings.database_url)
    with make_sessions(engine)() as one, make_sessions(engine)() as other:
        mine = (
            select(User)
            .join(Member, Member.user_id == User.id)
            .where(Member.project_id == UUID(project))
        )
        structure_for(one, one.scalars(mine).one(), key, "editor", lock=True)
        user = other.scalars(mine).one()
        # the lock stays for as long as `one` is open
        other.execute(text("SET LOCAL lock_timeout = '1ms'"))
        assert structure_for(other, user, key).name == BEAM["name"]
        with pytest.raises(OperationalError, match="lock timeout"):
            structure_for(other, user, key, "editor", lock=True)
    engine.dispose()


def test_administrators_look_after_users_and_their_keys(
    service: LocalService, new_client: NewClient
) -> None:
    """And nobody else, whatever their key; they make no keys and see no projects."""
    ann, guest = f"ann-{uuid4().hex}", new_client()
    with client_at(service.url, service.new_key(ann, administrator=True)) as chief:
        name = guest.get("api-keys").json()["items"][0]["name"]
        (user,) = ok(chief.get("users", params={"name": name}), 200)["items"]
        assert (user["valid_keys"], user["disabled_at"], user["administrator"]) == (1, None, False)
        place = f"users/{user['id']}"
        assert ok(guest.get(place), 403) | {"request_id": ANY} == ok(
            guest.get(f"users/{uuid4()}"), 403
        ) | {"request_id": ANY}
        assert ok(guest.get("users"), 403)["detail"].startswith("this is for administrators")
        reader = with_key(ok(chief.post("api-keys", json={"name": "r", "scopes": ["read"]}), 201))
        assert "scope admin" in ok(chief.get("users", headers=reader), 403)["detail"]

        second = ok(guest.post("api-keys", json={"name": "s"}), 201)
        soon, later = ((datetime.now(UTC) + timedelta(hours=h)).isoformat() for h in (1, 2))
        ended = ok(chief.patch(f"{place}/api-keys/{second['id']}", json={"expires_at": soon}), 200)
        assert datetime.fromisoformat(ended["expires_at"]) == datetime.fromisoformat(soon)
        for wrong in (later, "2020-01-01T00:00:00Z"):
            ok(chief.patch(f"{place}/api-keys/{second['id']}", json={"expires_at": wrong}), 422)
        assert (
            ok(chief.patch(f"{place}/api-keys/{second['id']}", json={"expires_at": soon}), 200)
            == ended
        )
        own = ok(chief.get("api-keys"), 200)["items"][0]["id"]
        ok(chief.delete(f"{place}/api-keys/{own}"), 404)  # a key of another user
        for _ in range(2):  # again is fine, and no act
            ok(chief.delete(f"{place}/api-keys/{second['id']}"), 204)
        assert guest.get("projects", headers=with_key(second)).status_code == 401
        ok(chief.get(f"users/{uuid4()}"), 404)
        assert ok(chief.get(place), 200) == user
        ok(chief.patch(f"{place}/api-keys/{second['id']}", json={"expires_at": soon}), 409)
        assert [
            k["revoked_at"] is None for k in ok(chief.get(f"{place}/api-keys"), 200)["items"]
        ] == [True, False]
        assert "mb_" not in chief.get(f"{place}/api-keys").text

        assert ok(chief.post(f"{place}/disable"), 200)["disabled_at"] is not None
        assert guest.get("projects").status_code == 401
        assert ok(chief.post(f"{place}/enable"), 200)["disabled_at"] is None
        myself = ok(chief.get("users", params={"name": ann}), 200)["items"][0]["id"]
        assert "themselves" in ok(chief.post(f"users/{myself}/disable"), 409)["detail"]
        acts = [event["action"] for event in ok(chief.get("audit-events"), 200)["items"]]
        assert acts[:5] == [
            "user.enable",
            "user.disable",
            "api_key.revoke",
            "api_key.expire",
            "api_key.expire",
        ]
        assert ok(chief.get("projects"), 200)["items"] == []


def test_the_audit_trail_is_not_changed(sessions: Sessions, key_of: Callable[[str], str]) -> None:
    key_of("ada")
    with sessions.begin() as session:
        session.execute(
            text(
                "INSERT INTO audit_events (action, subject_type, detail) VALUES ('a.b', 'a', '{}')"
            )
        )
    for statement in (
        "UPDATE audit_events SET action = 'x'",
        "DELETE FROM audit_events",
        "TRUNCATE audit_events",
    ):
        with (
            pytest.raises(DBAPIError, match="the audit trail is not changed"),
            sessions.begin() as session,
        ):
            session.execute(text(statement))


def test_a_project_is_edited_and_archived(
    api: httpx.Client, project: str, beam: dict[str, Any]
) -> None:
    answer = api.get(f"projects/{project}")
    assert api.patch(f"projects/{project}", json={"name": "x"}).status_code == 428
    tag = {"If-Match": answer.headers["ETag"]}
    changed = api.patch(f"projects/{project}", json={"name": "x", "archived": True}, headers=tag)
    assert changed.status_code == 200, changed.text
    assert (changed.json()["name"], changed.json()["archived_at"] is not None) == ("x", True)
    assert api.patch(f"projects/{project}", json={"name": "y"}, headers=tag).status_code == 412
    refused = api.post(f"projects/{project}/structures", json=beam)
    assert (refused.status_code, "archived" in refused.json()["detail"]) == (409, True)
    assert api.get(f"projects/{project}/structures").status_code == 200
    again = api.patch(
        f"projects/{project}",
        json={"archived": False},
        headers={"If-Match": changed.headers["ETag"]},
    )
    assert again.json()["archived_at"] is None
    now = {"If-Match": again.headers["ETag"]}
    assert api.patch(f"projects/{project}", json={}, headers=now).status_code == 422
    moments = []
    for _ in range(2):  # what is archived already stays archived since then
        answer = api.patch(
            f"projects/{project}",
            json={"archived": True, "description": "e"},
            headers={"If-Match": "*"},
        )
        moments.append(answer.json()["archived_at"])
    assert moments[0] == moments[1]
    event = api.get("audit-events").json()["items"][0]
    assert (event["action"], event["subject_id"]) == ("project.change", project)
    assert event["detail"] == {
        "was": {"description": "e"},
        "now": {"archived": True, "description": "e"},
    }
    assert (
        api.patch(
            f"projects/{project}", json={"archived": False}, headers={"If-Match": "*"}
        ).status_code
        == 200
    )
    assert api.post(f"projects/{project}/structures", json=beam).status_code == 201


def test_what_is_deleted_is_restored_or_purged(
    api: httpx.Client, project: str, beam: dict[str, Any], rows: Callable[..., list[dict[str, Any]]]
) -> None:
    structure = api.post(f"projects/{project}/structures", json=beam).json()["id"]
    campaign = api.post(
        f"structures/{structure}/campaigns", json={"name": "c", "boundary": "free"}
    ).json()["id"]
    file = f"    -1\n   151\n{project}\n    -1\n".encode()
    sent = api.post(
        f"campaigns/{campaign}/imports",
        content=file,
        headers={"Content-Type": "application/octet-stream"},
    )
    sha256 = bytes.fromhex(sent.json()["sha256"])
    assert api.post(f"structures/{structure}/purge").status_code == 409
    assert api.delete(f"structures/{structure}").status_code == 204
    assert api.get(f"campaigns/{campaign}").status_code == 404
    assert [
        s["id"] for s in api.get(f"projects/{project}/structures?deleted=true").json()["items"]
    ] == [structure]
    assert api.post(f"structures/{structure}/restore").status_code == 200
    assert api.get(f"campaigns/{campaign}").status_code == 200
    assert api.delete(f"projects/{project}").status_code == 204
    assert api.get(f"structures/{structure}").status_code == 404
    assert api.delete(f"projects/{project}").status_code == 404
    assert (
        api.patch(f"projects/{project}", json={"name": "x"}, headers={"If-Match": "*"}).status_code
        == 404
    )
    assert project not in api.get("projects").text
    assert project in api.get("projects?deleted=true").text
    assert api.post(f"projects/{project}/restore").json()["deleted_at"] is None
    assert api.post(f"projects/{project}/restore").status_code == 409
    acts = [event["action"] for event in api.get("audit-events").json()["items"][:2]]
    assert acts == ["project.restore", "project.delete"]
    assert api.get(f"campaigns/{campaign}").status_code == 200
    api.delete(f"projects/{project}").raise_for_status()
    assert rows("SELECT 1 FROM original_chunks WHERE sha256 = %s", sha256)
    purged = api.post(f"projects/{project}/purge")
    assert purged.status_code == 204, purged.text
    assert rows("SELECT 1 FROM original_chunks WHERE sha256 = %s", sha256) == []
    assert rows("SELECT 1 FROM campaigns WHERE id = %s", campaign) == []
    assert api.get(f"projects/{project}").status_code == 404
    stub = api.get("audit-events").json()["items"][0]
    assert (stub["action"], stub["subject_id"], stub["detail"]) == (
        "project.purge",
        project,
        {"name": "p"},
    )


def test_a_member_may_leave(new_client: NewClient) -> None:
    owner, guest = new_client(), new_client()
    key = owner.post("projects", json={"name": "p"}).json()["id"]
    name = guest.get("api-keys").json()["items"][0]["name"]
    for act in ("archived", "deleted"):
        assert (
            owner.put(f"projects/{key}/members/{name}", json={"role": "viewer"}).status_code == 200
        )
        if act == "archived":
            ok(
                owner.patch(f"projects/{key}", json={"archived": True}, headers={"If-Match": "*"}),
                200,
            )
        else:
            ok(owner.delete(f"projects/{key}"), 204)
        assert guest.delete(f"projects/{key}/members/{name}").status_code == 204
        if act == "archived":
            assert guest.get(f"projects/{key}").status_code == 404
            ok(
                owner.patch(f"projects/{key}", json={"archived": False}, headers={"If-Match": "*"}),
                200,
            )
    assert guest.get("projects?deleted=true").json()["items"] == []


# --- keys and users at the operator's command line, and what `doctor` says of jobs and disks
# ----------------------------


@pytest.fixture(scope="module")
def service(idle: LocalService) -> LocalService:
    """One with few users: a list of all keys asks for those of each."""
    return idle


class Disk(NamedTuple):
    total: int
    used: int
    free: int


def test_keys_are_listed_and_revoked_and_users_disabled(
    service: LocalService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MODALBASE_DATABASE_URL", service.settings.database_url)

    def command(*words: str, code: int = 0) -> str:
        ended = CliRunner().invoke(app, list(words))
        assert ended.exit_code == code, ended.output
        return ended.output

    def status(key: str) -> int:
        headers = {"Authorization": f"Bearer {key}"}
        return httpx.get(
            f"{service.url}/api/v1/projects", headers=headers, trust_env=False, timeout=60
        ).status_code

    key = command("keys", "create", "--name", "grace", "--scope", "read", "--days", "2").strip()
    other = command("keys", "create", "--name", "grace").strip()
    assert (status(key), status(other)) == (200, 200)
    lines = [line.split("\t") for line in command("keys", "list").splitlines()]
    assert key.split("_", 2)[2] not in command("keys", "list")
    of_grace = {line[0]: line for line in lines if line[1] == "grace"}
    prefix = key.split("_")[1]
    assert of_grace[prefix][3] == "read"
    assert of_grace[prefix][4].startswith("valid until 2")
    command("keys", "revoke", prefix)
    command("keys", "revoke", prefix)  # again is fine
    assert (status(key), status(other)) == (401, 200)
    assert f"{prefix}\tgrace\tgrace\tread\trevoked" in command("keys", "list")
    assert "keys list" in command("keys", "revoke", "nobody", code=1)
    third = command("keys", "create", "--name", "grace").strip()
    command("users", "disable", "grace")
    assert "grace\tdisabled" in command("users", "list")
    # it stays known as wrong for a while, so another one is asked below
    assert status(third) == 401
    command("users", "enable", "grace")
    assert "grace\tenabled" in command("users", "list")
    assert status(other) == 200
    assert "users list" in command("users", "disable", "nobody", code=1)
    command("users", "promote", "grace")
    assert "grace\tenabled\tadministrator" in command("users", "list")
    command("users", "demote", "grace")
    assert "grace\tenabled" in command("users", "list").splitlines()
    assert "there is read, write, jobs, admin" in command(
        "keys", "create", "--name", "x", "--scope", "all", code=2
    )


def test_the_same_commands_over_rest(
    service: LocalService, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With an administrator's key at a service elsewhere: no database is named, and none is opened
    here.
    """
    chief, plain = service.new_key("olga", administrator=True), service.new_key("paul")
    place = {"MODALBASE_PROFILE": str(tmp_path / "none"), "MODALBASE_DATA": str(tmp_path / "data")}
    for name, value in place.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("MODALBASE_DATABASE_URL", raising=False)

    def command(*words: str, key: str = chief, code: int = 0) -> str:
        ended = CliRunner().invoke(
            app, [*words, "--url", service.url], env={"MODALBASE_API_KEY": key}
        )
        assert ended.exit_code == code, ended.output or str(ended.exception)
        return ended.output or str(ended.exception)

    assert {"olga\tenabled\tadministrator", "paul\tenabled"} <= set(
        command("users", "list").splitlines()
    )
    assert "administrator" in command("users", "list", key=plain, code=1)
    made = command(
        "keys", "create", "--name", "second", "--scope", "read", "--days", "2", key=plain
    ).strip()
    prefix = made.split("_")[1]
    assert f"{prefix}\t-\tsecond\tread\tvalid until 2" in command("keys", "list", key=plain)
    assert plain.split("_")[1] + "\t" not in command("keys", "list", key=service.new_key("quin"))
    assert f"{prefix}\tpaul\tsecond\tread\tvalid until 2" in command("keys", "list")
    command("keys", "revoke", prefix)
    assert f"{prefix}\tpaul\tsecond\tread\trevoked" in command("keys", "list")
    assert "keys list" in command("keys", "revoke", "nobody", code=1)
    command("users", "disable", "paul")
    assert f"{plain.split('_')[1]}\tpaul\tpaul\tread,write,jobs,admin\tuser disabled" in command(
        "keys", "list"
    )
    command("users", "enable", "paul")
    assert "users list" in command("users", "disable", "nobody", code=1)
    monkeypatch.setenv("MODALBASE_URL", service.url)
    monkeypatch.setenv("MODALBASE_API_KEY", chief)
    assert "paul\tenabled" in CliRunner().invoke(app, ["users", "list", "--remote"]).output
    assert not (tmp_path / "data").exists()


def looked_at(database: str, subject: str) -> list[Finding]:
    findings = examine(Settings(database_url=database), stored=False)
    return [finding for finding in findings if finding.subject == subject]


def test_doctor_sees_jobs_that_wait_in_vain_and_those_that_were_given_up(
    database: str, sessions: Sessions
) -> None:
    assert [finding.level for finding in looked_at(database, "jobs")] == ["ok"]
    with sessions.begin() as session:
        project = Project(name="p")
        session.add(project)
        session.flush()
        for _ in range(2):
            enqueue(session, kind=KINDS["empty"], project_id=project.id)
    # they wait since a moment ago
    assert [finding.level for finding in looked_at(database, "jobs")] == ["ok"]
    with sessions.begin() as session:
        session.execute(text("UPDATE jobs SET queued_at = now() - interval '1 hour'"))
    (stuck,) = looked_at(database, "jobs")
    assert stuck.level == "warning"
    assert stuck.words.startswith("2 waiting, 0 running; 2 have waited over 10 minutes")
    with sessions.begin() as session:
        session.execute(
            text(
                "UPDATE jobs SET state = 'failed', error = '{\"reason\": \"lost\"}', finished_at ="
                " now()"
            )
        )
    ended, lost = looked_at(database, "jobs")
    assert (ended.level, lost.level) == ("ok", "warning")
    assert lost.words.startswith("2 were given up because their workers died")


def test_doctor_warns_of_a_disk_that_is_nearly_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def level(free: int, total: int) -> str:
        monkeypatch.setattr(shutil, "disk_usage", lambda _: Disk(total, total - free, free))
        disk = next(
            finding
            for finding in examine(Settings(data=tmp_path), stored=False)
            if finding.subject == "disk"
        )
        return disk.level

    gigabyte = 10**9
    assert level(100 * gigabyte, 1000 * gigabyte) == "ok"
    assert level(40 * gigabyte, 1000 * gigabyte) == "warning"  # under 5 %
    assert level(gigabyte // 2, 5 * gigabyte) == "warning"  # under 1 GiB
