"""Keys and users at the operator's command line, and what `doctor` says of jobs and disks."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import httpx
import pytest
from sqlalchemy import text
from typer.testing import CliRunner

from benchmarks.jobs_floor import EMPTY
from service.access import Project
from service.app.cli.command import app
from service.app.doctor import Finding, examine
from service.app.supervisor import LocalService
from service.db.engine import Sessions
from service.jobs.queue import enqueue
from service.settings import Settings


@pytest.fixture(scope="module")
def service(new_database: Callable[[], str]) -> Iterator[LocalService]:
    """A service of its own with few users: a list of all keys asks for those of each."""
    settings = Settings(database_url=new_database(), port=0, log_level="warning")
    with LocalService(settings, worker=False) as running:
        yield running


class Disk(NamedTuple):
    total: int
    used: int
    free: int


def test_keys_are_listed_and_revoked_and_users_disabled(service: LocalService, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MODALBASE_DATABASE_URL", service.settings.database_url or "")

    def command(*words: str, code: int = 0) -> str:
        ended = CliRunner().invoke(app, list(words))
        assert ended.exit_code == code, ended.output
        return ended.output

    def status(key: str) -> int:
        headers = {"Authorization": f"Bearer {key}"}
        return httpx.get(f"{service.url}/api/v1/projects", headers=headers, trust_env=False, timeout=60).status_code

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
    assert status(third) == 401  # it stays known as wrong for a while, so another one is asked below
    command("users", "enable", "grace")
    assert "grace\tenabled" in command("users", "list")
    assert status(other) == 200
    assert "users list" in command("users", "disable", "nobody", code=1)
    command("users", "promote", "grace")
    assert "grace\tenabled\tadministrator" in command("users", "list")
    command("users", "demote", "grace")
    assert "grace\tenabled" in command("users", "list").splitlines()
    assert "there is read, write, jobs, admin" in command("keys", "create", "--name", "x", "--scope", "all", code=2)


def test_the_same_commands_over_rest(service: LocalService, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With an administrator's key at a service elsewhere: no database is named, and none is opened here."""
    chief, plain = service.new_key("olga", administrator=True), service.new_key("paul")
    place = {"MODALBASE_PROFILE": str(tmp_path / "none"), "MODALBASE_DATA": str(tmp_path / "data")}
    for name, value in place.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("MODALBASE_DATABASE_URL", raising=False)

    def command(*words: str, key: str = chief, code: int = 0) -> str:
        ended = CliRunner().invoke(app, [*words, "--url", service.url], env={"MODALBASE_API_KEY": key})
        assert ended.exit_code == code, ended.output or str(ended.exception)
        return ended.output or str(ended.exception)

    assert {"olga\tenabled\tadministrator", "paul\tenabled"} <= set(command("users", "list").splitlines())
    assert "administrator" in command("users", "list", key=plain, code=1)
    made = command("keys", "create", "--name", "second", "--scope", "read", "--days", "2", key=plain).strip()
    prefix = made.split("_")[1]
    assert f"{prefix}\t-\tsecond\tread\tvalid until 2" in command("keys", "list", key=plain)
    assert plain.split("_")[1] + "\t" not in command("keys", "list", key=service.new_key("quin"))
    assert f"{prefix}\tpaul\tsecond\tread\tvalid until 2" in command("keys", "list")
    command("keys", "revoke", prefix)
    assert f"{prefix}\tpaul\tsecond\tread\trevoked" in command("keys", "list")
    assert "keys list" in command("keys", "revoke", "nobody", code=1)
    command("users", "disable", "paul")
    assert f"{plain.split('_')[1]}\tpaul\tpaul\tread,write,jobs,admin\tuser disabled" in command("keys", "list")
    command("users", "enable", "paul")
    assert "users list" in command("users", "disable", "nobody", code=1)
    monkeypatch.setenv("MODALBASE_URL", service.url)
    monkeypatch.setenv("MODALBASE_API_KEY", chief)
    assert "paul\tenabled" in CliRunner().invoke(app, ["users", "list", "--remote"]).output
    assert not (tmp_path / "data").exists()


def looked_at(database: str, subject: str) -> list[Finding]:
    found = examine(Settings(database_url=database), stored=False)
    return [finding for finding in found if finding.subject == subject]


def test_doctor_sees_jobs_that_wait_in_vain_and_those_that_were_given_up(database: str, sessions: Sessions) -> None:
    assert [finding.level for finding in looked_at(database, "jobs")] == ["ok"]
    with sessions.begin() as session:
        project = Project(name="p")
        session.add(project)
        session.flush()
        for _ in range(2):
            enqueue(session, kind=EMPTY, project_id=project.id)
    assert [finding.level for finding in looked_at(database, "jobs")] == ["ok"]  # they wait since a moment ago
    with sessions.begin() as session:
        session.execute(text("UPDATE jobs SET queued_at = now() - interval '1 hour'"))
    (stuck,) = looked_at(database, "jobs")
    assert stuck.level == "warning"
    assert stuck.words.startswith("2 waiting, 0 running; 2 have waited over 10 minutes")
    with sessions.begin() as session:
        session.execute(text("UPDATE jobs SET state = 'failed', error = '{\"reason\": \"lost\"}', finished_at = now()"))
    ended, lost = looked_at(database, "jobs")
    assert (ended.level, lost.level) == ("ok", "warning")
    assert lost.words.startswith("2 were given up because their workers died")


def test_doctor_warns_of_a_disk_that_is_nearly_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def level(free: int, total: int) -> str:
        monkeypatch.setattr(shutil, "disk_usage", lambda _: Disk(total, total - free, free))
        disk = next(finding for finding in examine(Settings(data=tmp_path), stored=False) if finding.subject == "disk")
        return disk.level

    gigabyte = 10**9
    assert level(100 * gigabyte, 1000 * gigabyte) == "ok"
    assert level(40 * gigabyte, 1000 * gigabyte) == "warning"  # under 5 %
    assert level(gigabyte // 2, 5 * gigabyte) == "warning"  # under 1 GiB
