"""`modalbase up` in ordinary folders, and when a part of it dies."""

from __future__ import annotations

from pathlib import Path

import psutil
import pytest

from service.db.opening import DataFolderError
from service.settings import Settings
from service.supervisor import LocalService, StartError
from tests.support.command import modalbase, status, up, wait_until_gone
from tests.support.waiting import until


def part(up: psutil.Process, name: str) -> psutil.Process:
    """The API (`serve`) or the worker of a running command."""
    return next(child for child in up.children() if name in child.cmdline())


def test_what_dies_is_started_again(short_folder: Path) -> None:
    """The API, the worker and PostgreSQL; and when the command itself is killed, nothing of it goes on."""
    data, log = short_folder / "dying", short_folder / "dying.log"
    with log.open("w") as stderr, up(data, stderr=stderr) as (process, url, key):
        command = psutil.Process(process.pid)
        for name, said in (("serve", "the api"), ("worker", "the worker")):
            part(command, name).kill()
            line = f"modalbase: {said} runs again"
            until(lambda line=line: line in log.read_text(), line, log.read_text)
            assert status(url, key) == 200  # at the same address; a request in between waits
        assert f"{said} was killed, perhaps for lack of memory; it is started again in 0.5 s" in log.read_text()
        postmaster = int((data / "postgres" / "postmaster.pid").read_text().split()[0])
        psutil.Process(postmaster).kill()
        seen = {200}
        until(lambda: "modalbase: PostgreSQL runs again" in log.read_text(), "PostgreSQL", log.read_text)
        until(lambda: seen.add(answer := status(url, key)) or answer == 200, "the API's answer")
        assert seen <= {200, 503}
        assert process.poll() is None
        process.kill()
        process.wait()
        wait_until_gone(data)


def test_what_dies_again_and_again_is_given_up(database: str) -> None:
    """With one clear line, and everything ended."""
    with LocalService(Settings(database_url=database, port=0, log_level="error"), pauses=(0.0, 0.0)) as service:
        processes = list(service.processes.values())

        def die() -> None:
            service.processes["worker"].kill()
            service.processes["worker"].wait()
            while not service.tend():
                pass
            if service.processes["worker"].poll() is not None:
                service.tend()

        die()
        die()
        with pytest.raises(StartError, match=r"the worker was killed.*, 3 times in a row; it is not started again"):
            die()
        assert service.processes["api"].poll() is None
    assert all(process.poll() is not None for process in processes)


def test_a_start_without_its_database_is_reported_once(short_folder: Path) -> None:
    """By who starts it: the API, which was loading meanwhile, says nothing and is gone."""
    data, log, before = short_folder / "foreign", short_folder / "foreign.log", set(psutil.Process().children())
    (data / "postgres").mkdir(parents=True)
    (data / "postgres" / "notes.txt").write_text("not PostgreSQL's")
    with (
        pytest.raises(DataFolderError, match="holds no files of PostgreSQL"),
        LocalService(Settings(data=data, port=0), log_file=log),
    ):
        pass
    assert log.read_text() == ""
    assert set(psutil.Process().children()) <= before


def test_the_other_commands_find_the_service_that_runs(short_folder: Path) -> None:
    """In the default folder of a home with a space, as on macOS, and in one of one's own; nobody says which."""
    home = short_folder / "Prüf stand" / ("with a long name, " * 6)
    home.mkdir(parents=True)
    around = {"HOME": str(home), "XDG_STATE_HOME": "", "XDG_DATA_HOME": "", "MODALBASE_LOG_LEVEL": "info"}
    log, elsewhere = short_folder / "home.log", short_folder / "elsewhere"
    with up(elsewhere, **around) as (first, url, _):
        made = modalbase("keys", "create", "--name", "ada", **around)
        assert status(url, made.stdout.strip()) == 200, made.stderr
        assert modalbase("db", "current", **around).returncode == 0
        with log.open("w") as stderr, up(None, stderr=stderr, **around) as (_, url, key):
            ended = modalbase("keys", "create", "--name", "ada", **around)
            assert ended.returncode == 1
            assert "2 services run here; say which with --data" in ended.stderr
            assert str(elsewhere) in ended.stderr
            first.kill()  # its note stays, and names nobody
            first.wait()
            assert status(url, key) == 200
            made = modalbase("keys", "create", "--name", "ada", **around)
            assert status(url, made.stdout.strip()) == 200, made.stderr
            assert "/api/v1/projects" not in log.read_text()  # no line for each request
        assert modalbase("keys", "create", "--name", "x", "--data", str(elsewhere)).returncode == 0
    assert "services run here" not in modalbase("db", "current", **around).stderr


def test_a_service_on_a_server_of_its_own_says_what_is_missing(short_folder: Path, database: str) -> None:
    around = {"HOME": str(short_folder), "XDG_STATE_HOME": ""}
    with up(None, MODALBASE_DATABASE_URL=database, **around):
        ended = modalbase("keys", "create", "--name", "x", **around)
        assert "has a database server of its own; set MODALBASE_DATABASE_URL" in ended.stderr
        assert ended.returncode == 1
