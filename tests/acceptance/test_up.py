"""`modalbase up` in ordinary folders, and when a part of it dies."""

from __future__ import annotations

from pathlib import Path

import psutil
import pytest

from service.db.opening import DataFolderError
from service.settings import Settings
from service.supervisor import LocalService, StartError
from tests.support.command import modalbase, modalbase_here, status, up, wait_until_gone
from tests.support.waiting import until


def part(up: psutil.Process, name: str) -> psutil.Process:
    """The API (`serve`) or the worker of a running command."""
    return next(child for child in up.children() if name in child.cmdline())


def test_what_dies_is_started_again_and_other_commands_find_what_runs(short_folder: Path, database: str) -> None:
    """In the default folder of a home with a space, as on macOS, beside a service on a server of its own; nobody says which."""
    home = short_folder / "Prüf stand" / ("with a long name, " * 6)
    home.mkdir(parents=True)
    around = {"HOME": str(home), "XDG_STATE_HOME": "", "XDG_DATA_HOME": "", "MODALBASE_LOG_LEVEL": "info"}
    log = short_folder / "home.log"
    with log.open("w") as stderr, up(None, stderr=stderr, **around) as (process, url, key):
        data = home / ".local" / "share" / "modalbase"
        made = modalbase("keys", "create", "--name", "ada", **around)
        assert status(url, made.stdout.strip()) == 200, made.stderr
        modalbase_here("db", "current", code=0, **around)
        the_parts_die(psutil.Process(process.pid), data, log, url, key)
        assert process.poll() is None
        with up(short_folder / "no data", MODALBASE_DATABASE_URL=database, **around):
            ended = modalbase_here("keys", "create", "--name", "ada", code=1, **around)
            assert "2 services run here; say which with --data" in ended.stderr
            assert str(data) in ended.stderr
            process.kill()  # its note stays, and names nobody
            process.wait()
            wait_until_gone(data)
            ended = modalbase_here("keys", "create", "--name", "x", code=1, **around)
            assert "has a database server of its own; set MODALBASE_DATABASE_URL" in ended.stderr
        assert "/api/v1/projects" not in log.read_text()  # no line for each request
    modalbase_here("keys", "create", "--name", "x", "--data", data, code=0)
    assert "services run here" not in modalbase_here("db", "current", **around).stderr


def the_parts_die(command: psutil.Process, data: Path, log: Path, url: str, key: str) -> None:
    """The API, the worker and PostgreSQL, one after the other; each runs again."""
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
