"""The command `modalbase` as a person meets it."""

import signal
import socket
import subprocess
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from fecore import __version__
from tests.support.command import COMMAND, environment, modalbase, modalbase_here, refusals, wait_until_gone
from tests.support.waiting import PATIENCE, until


def test_version() -> None:
    assert modalbase("--version").stdout == f"modalbase {__version__}\n"


def test_what_cannot_start_says_why(short_folder: Path, empty_database: str) -> None:
    """A schema that is not there, a folder that is a file, another PostgreSQL's files, a port that is taken, bad words."""
    file, postgres = short_folder / "taken", short_folder / "broken" / "postgres"
    file.write_text("")
    postgres.mkdir(parents=True)
    (postgres / "PG_VERSION").write_text("7\n")  # of another PostgreSQL, or what a full disk left
    on_empty, folders = {"MODALBASE_DATABASE_URL": empty_database}, (file, file / "data")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        *unmade, at_file, below_file, broken, in_use, queue, setting = refusals(
            *((words, on_empty) for words in (["serve", "--port", "0"], ["worker"], ["up", "--port", "0"])),
            *((["up", "--port", "0", "--data", str(data)], {}) for data in (*folders, postgres.parent)),
            (["up", "--port", port, "--data", str(short_folder / "port")], {}),
            (["worker", "--queues", "jobs,imports"], {}),
            (["worker"], {"MODALBASE_JOB_WALL_SECONDS": "soon"}),
        )
    unmade.append(modalbase_here("keys", "create", "--name", "x", **on_empty))
    for ended in unmade:
        assert (ended.returncode, ended.stdout) == (1, "")
        assert "run `modalbase db upgrade`" in ended.stderr
        assert "Traceback" not in ended.stderr
    for data, *both in zip(folders, (at_file, below_file), strict=True):
        for ended in (*both, modalbase_here("keys", "create", "--name", "x", "--data", data)):
            assert (ended.returncode, ended.stdout) == (1, "")
            assert ended.stderr.startswith(f"modalbase: cannot use the data folder {data}: ")
            assert len(ended.stderr.splitlines()) == 1
    assert (broken.returncode, broken.stdout) == (1, "")
    assert "Traceback" not in broken.stderr
    assert f"PostgreSQL does not start in {postgres.parent}" in broken.stderr.splitlines()[-1]
    assert in_use.returncode == 1
    assert in_use.stderr == (
        f"modalbase: cannot listen on 127.0.0.1 port {port}: Address already in use; choose another with --port\n"
    )
    assert (queue.returncode, queue.stdout) == (2, "")
    assert (
        queue.stderr == "modalbase: --queues jobs,imports: there is jobs, requests, separated by commas where several\n"
    )
    assert setting.returncode == 1
    assert setting.stderr.startswith("modalbase: settings: job_wall_seconds: ")


def test_the_command_that_a_refusal_names_makes_the_schema(empty_database: str) -> None:
    assert modalbase_here("db", "current", MODALBASE_DATABASE_URL=empty_database).stdout == "empty\n"
    modalbase_here("db", "upgrade", code=0, MODALBASE_DATABASE_URL=empty_database)
    modalbase_here("keys", "create", "--name", "x", code=0, MODALBASE_DATABASE_URL=empty_database)


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
