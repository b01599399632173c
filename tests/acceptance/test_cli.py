"""The command `modalbase` as a person meets it."""

from __future__ import annotations

import signal
import socket
import subprocess
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from fecore import __version__
from tests.support.command import COMMAND, environment, modalbase, modalbase_here, wait_until_gone
from tests.support.waiting import PATIENCE, until


def test_version() -> None:
    assert modalbase("--version").stdout == f"modalbase {__version__}\n"


def test_port_in_use_is_a_clear_error(short_folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        ended = modalbase("up", "--port", str(port), "--data", str(short_folder / "port"))
    assert ended.returncode == 1
    assert ended.stderr == (
        f"modalbase: cannot listen on 127.0.0.1 port {port}: Address already in use; choose another with --port\n"
    )


def test_schema_that_is_not_at_head_is_refused_with_the_command_that_mends_it(empty_database: str) -> None:
    for command in (["serve", "--port", "0"], ["worker"], ["up", "--port", "0"], ["keys", "create", "--name", "x"]):
        ended = (modalbase_here if command[0] == "keys" else modalbase)(*command, MODALBASE_DATABASE_URL=empty_database)
        assert (ended.returncode, ended.stdout) == (1, "")
        assert "run `modalbase db upgrade`" in ended.stderr
        assert "Traceback" not in ended.stderr
    assert modalbase_here("db", "current", MODALBASE_DATABASE_URL=empty_database).stdout == "empty\n"
    modalbase_here("db", "upgrade", code=0, MODALBASE_DATABASE_URL=empty_database)
    modalbase_here("keys", "create", "--name", "x", code=0, MODALBASE_DATABASE_URL=empty_database)


@pytest.mark.parametrize("made", ["a file", "below a file"])
def test_data_folder_that_cannot_be_used_is_a_clear_error(short_folder: Path, made: str) -> None:
    file = short_folder / "taken"
    file.write_text("")
    data = file if made == "a file" else file / "data"
    for command in (["up", "--port", "0"], ["keys", "create", "--name", "x"]):
        ended = (modalbase_here if command[0] == "keys" else modalbase)(*command, "--data", str(data))
        assert (ended.returncode, ended.stdout) == (1, "")
        assert ended.stderr.startswith(f"modalbase: cannot use the data folder {data}: ")
        assert len(ended.stderr.splitlines()) == 1


def test_postgresql_that_does_not_start_is_a_clear_error(short_folder: Path) -> None:
    postgres = short_folder / "broken" / "postgres"
    postgres.mkdir(parents=True)
    (postgres / "PG_VERSION").write_text("7\n")  # of another PostgreSQL, or what a full disk left
    ended = modalbase("up", "--port", "0", "--data", str(postgres.parent))
    assert (ended.returncode, ended.stdout) == (1, "")
    assert "Traceback" not in ended.stderr
    assert f"PostgreSQL does not start in {postgres.parent}" in ended.stderr.splitlines()[-1]


def starting(data: Path) -> tuple[subprocess.Popen[str], psutil.Process]:
    """`modalbase up` that has just begun its API, which listens and does not answer yet; and the API."""
    process = subprocess.Popen(
        [str(COMMAND), "up", "--port", "0", "--data", str(data)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
    )  # fmt: skip

    def api() -> psutil.Process | None:
        assert process.poll() is None, process.communicate()
        for child in psutil.Process(process.pid).children():
            with suppress(psutil.Error):  # one of initdb's, which has ended since
                if "serve" in child.cmdline():
                    return child
        return None

    found = until(api, "the start of the API")
    assert found is not None
    return process, found


def test_an_api_that_dies_while_starting_ends_up_at_once_and_so_does_a_signal(short_folder: Path) -> None:
    data = short_folder / "dies"
    process, api = starting(data)
    api.kill()
    shown, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, shown) == (1, "")
    assert errors.splitlines()[-1] == "modalbase: the api ended while starting; its log says why"
    wait_until_gone(data)
    process, api = starting(data)
    api.suspend()  # it stays starting
    process.send_signal(signal.SIGTERM)
    api.resume()
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    wait_until_gone(data)


@pytest.mark.parametrize("name", ["", "  ", "x" * 201])
def test_a_users_name_is_as_rest_takes_it(short_folder: Path, name: str) -> None:
    ended = modalbase_here("keys", "create", "--name", name, "--data", short_folder / "names")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert not (short_folder / "names").exists()


@pytest.mark.parametrize(
    "url",
    [
        "postgresql://u:p@secret@127.0.0.1:1/d",
        "postgresql://u:secret@127.0.0.1:1/d",
        "mysql://u:secret@h/d",
        "nonsense",
    ],
)
def test_database_that_does_not_answer_is_a_clear_error(url: str) -> None:
    ended = modalbase_here("keys", "create", "--name", "x", MODALBASE_DATABASE_URL=url)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.startswith("modalbase: ")
    assert "Traceback" not in ended.stderr
    assert "secret" not in ended.stderr


def test_a_queue_that_nobody_fills_is_refused() -> None:
    ended = modalbase("worker", "--queues", "jobs,imports")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == "modalbase: --queues jobs,imports: there is jobs, separated by commas where several\n"


def test_wrong_setting_is_a_clear_error() -> None:
    ended = modalbase("worker", MODALBASE_JOB_WALL_SECONDS="soon")
    assert ended.returncode == 1
    assert ended.stderr.startswith("modalbase: settings: job_wall_seconds: ")
