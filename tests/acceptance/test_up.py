"""`modalbase up` from its first start to its end: when parts of it die, with backup and restore,
verify and doctor.
"""

import io
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, nullcontext
from pathlib import Path
from queue import Queue
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import httpx
import numpy as np
import psutil
import psycopg
import pytest

from service.app import serving, supervisor
from service.app.cli.running import up as up_here
from service.app.running import announced
from service.app.supervisor import Component, LocalService, RestartLimitError, StartError
from service.platform.db import schema
from service.platform.db.engine import psycopg_url
from service.platform.db.opening import DataFolderError
from service.platform.db.postgres import ACCOUNT
from service.platform.settings import Settings
from tests.support.command import living, modalbase, modalbase_here, status, up, wait_until_gone
from tests.support.laboratory import BEAM
from tests.support.lengths import long
from tests.support.rest import plain_client
from tests.support.waiting import PATIENCE, until


@pytest.mark.parametrize("beside", [False, long(True)])
def test_a_service_is_begun_hurt_backed_up_restored_and_ended(
    short_folder: Path, empty_database: str, unpacked: Path, laboratory: Path, beside: bool
) -> None:
    """From the wheel alone, in the default folder of a home with a space, as on macOS: the first
    start makes a key and prints it, what dies is started again, no end leaves anything running, and
    no process takes a file of the laboratory's own folder for a module. In the long run the
    restored service runs beside it on a server of its own: the same key opens it, and the same bits
    come out. Commands that do not say which of the two they mean are refused.
    """
    home = short_folder / "Prüf stand" / ("with a long name, " * 6)
    home.mkdir(parents=True)
    around = {
        "HOME": str(home),
        "XDG_STATE_HOME": "",
        "XDG_DATA_HOME": "",
        "MODALBASE_LOG_LEVEL": "info",
    }
    data, log, file = (
        home / ".local" / "share" / "modalbase",
        short_folder / "home.log",
        short_folder / "home.modalbase",
    )
    own = {"MODALBASE_DATABASE_URL": empty_database}
    with (
        log.open("w") as stderr,
        up(None, cwd=laboratory, stderr=stderr, PYTHONPATH=str(unpacked), **around) as (
            process,
            url,
            key,
        ),
        client(url, key) as api,
    ):
        # by another process, and nobody says where
        made = modalbase_here("keys", "create", "--name", "ada", **around)
        assert re.fullmatch(r"mb_[0-9a-f]{12}_\S+\n", made.stdout), made.stderr
        assert status(url, made.stdout.strip()) == 200
        modalbase_here("db", "current", code=0, **around)
        frfs = with_frfs(api)
        before = api.get(frfs).raise_for_status().content
        the_parts_die(psutil.Process(process.pid), data, log, url, key)
        assert process.poll() is None
        modalbase_here("backup", file, code=0, **around)
        again = modalbase_here("backup", file, "--data", data, code=1)
        assert again.stderr == f"modalbase: {file} exists; a backup overwrites nothing\n"
        modalbase_here("restore", file, code=0, **own)
        modalbase_here("verify", code=0, **own)
        with ExitStack() as stack:
            if beside:
                other, there, second = stack.enter_context(
                    up(short_folder / "no data", **own, **around)
                )
                assert second == ""  # there is a key already
                restored = stack.enter_context(client(there, key))
                assert same(before, restored.get(frfs).raise_for_status().content)
            else:
                with patch.dict(os.environ, around):
                    stack.enter_context(announced("http://127.0.0.1:9", None))
            ended = modalbase_here("keys", "create", "--name", "ada", code=1, **around)
            assert "2 services run here; say which with --data" in ended.stderr
            assert str(data) in ended.stderr
            assert len(living(data)) >= 4  # the command, the API, the worker, PostgreSQL
            if beside:
                process.kill()  # its note stays, and names nobody
            else:
                process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == (-signal.SIGKILL if beside else 0)
            wait_until_gone(data)
            ended = modalbase_here("keys", "create", "--name", "x", code=1, **around)
            assert "has a database server of its own; set MODALBASE_DATABASE_URL" in ended.stderr
            if beside:
                parts = psutil.Process(other.pid).children()
                other.send_signal(signal.SIGINT)
                assert other.wait(PATIENCE) == 0
                assert not any(map(psutil.Process.is_running, parts))
        assert "/api/v1/projects" not in log.read_text()  # no line for each request
        assert "py.warnings" not in log.read_text()
    assert "services run here" not in modalbase_here("db", "current", **around).stderr


def client(url: str, key: str) -> httpx.Client:
    return plain_client(f"{url}/", {"Authorization": f"Bearer {key}"})


def with_frfs(api: httpx.Client) -> str:
    """The address of the FRFs of a new campaign, bit for bit."""

    def post(path: str, body: Any) -> str:
        return str(api.post(path, json=body).raise_for_status().json()["id"])

    structure = post(f"projects/{post('projects', {'name': 'x'})}/structures", BEAM)
    campaign = post(f"structures/{structure}/campaigns", {"name": "x", "boundary": "cantilever"})
    npz = {"Content-Type": "application/x-npz"}
    api.post(
        f"campaigns/{campaign}/frfs", content=measured(10, 101), headers=npz
    ).raise_for_status()
    return f"campaigns/{campaign}/frfs/data?format=npz"


def measured(count: int, lines: int) -> bytes:
    rng = np.random.default_rng(14)
    values = rng.standard_normal((count, lines)) + 1j * rng.standard_normal((count, lines))
    file = io.BytesIO()
    np.savez(
        file,
        frequency_hz=np.arange(1, lines + 1) * 0.5,
        values=values,
        response_point=np.arange(1, count + 1),
        response_direction=np.full(count, 3),
        reference_point=np.int64(33),
        reference_direction=np.int64(-3),
        quantity=np.array("mobility"),
    )
    return file.getvalue()


def same(one: bytes, other: bytes) -> bool:
    with np.load(io.BytesIO(one)) as ours, np.load(io.BytesIO(other)) as theirs:
        return all(ours[name].tobytes() == theirs[name].tobytes() for name in ours)


def the_parts_die(command: psutil.Process, data: Path, log: Path, url: str, key: str) -> None:
    """The API and PostgreSQL, one after the other; each runs again."""
    next(child for child in command.children() if "serve" in child.cmdline()).kill()
    line = "modalbase: the api runs again"
    until(lambda: line in log.read_text(), line, log.read_text)
    assert status(url, key) == 200  # at the same address; a request in between waits
    assert (
        "the api was killed, perhaps for lack of memory; it is started again in 0.5 s"
        in log.read_text()
    )
    postmaster = int((data / "postgres" / "postmaster.pid").read_text().split()[0])
    psutil.Process(postmaster).kill()
    seen = {200}
    until(
        lambda: "modalbase: PostgreSQL runs again" in log.read_text(), "PostgreSQL", log.read_text
    )
    until(lambda: seen.add(answer := status(url, key)) or answer == 200, "the API's answer")
    assert seen <= {200, 503}


def test_what_dies_again_and_again_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """With one clear line; before that it is started again after each pause."""
    starts: list[str] = []
    part = Component("a part", lambda: starts.append("again"), lambda: "ended", (0.0, 0.0))
    for _ in range(4):  # its end and its start, twice
        part.tend()
    with pytest.raises(RestartLimitError, match="a part ended, 3 times in a row"):
        part.tend()
    assert starts == ["again", "again"]
    monkeypatch.setattr(supervisor, "STEADY_SECONDS", -1.0)
    steady = Component("a part", lambda: None, lambda: "ended", (0.0,))  # whose ends are far apart
    ends = ["a part ended; it is started again in 0 s", "a part runs again"]
    assert [steady.tend() for _ in range(6)] == 3 * ends
    service = LocalService(Settings())
    service._parts.append(Component("the api", lambda: None, lambda: "was killed", ()))
    with pytest.raises(
        StartError, match=r"the api was killed, 1 times in a row; it is not started again"
    ):
        service.tend()


def test_a_service_with_keys_makes_none(
    service: LocalService,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What `modalbase up` prints of it, and that it ends with a part that is given up."""

    def given_up() -> list[str]:
        raise StartError("the api ended")

    service.new_key("before")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(supervisor, "LocalService", lambda _: nullcontext(service))
    monkeypatch.setattr(service, "tend", given_up)
    with pytest.raises(StartError):
        up_here()
    shown = capsys.readouterr().out
    assert "those made before still work; one more: modalbase keys create" in shown
    assert "mb_" not in shown


def test_a_process_ends_when_the_one_that_started_it_is_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its end of the pipe closes; `modalbase up` itself is killed in `test_command_line.py`."""
    reads, writes = os.pipe()
    killed: Queue[tuple[int, int]] = Queue()
    here = SimpleNamespace(
        read=lambda _, size: os.read(reads, size),
        getpid=os.getpid,
        kill=lambda *whom: killed.put(whom),
    )
    monkeypatch.setattr(serving, "os", here)
    os.write(writes, b"1")  # the database is open
    serving._follow()
    assert killed.empty()
    os.close(writes)
    assert killed.get(timeout=PATIENCE) == (os.getpid(), signal.SIGTERM)
    with pytest.raises(SystemExit):  # gone before the database was open
        serving._follow()
    os.close(reads)


def test_a_start_without_its_database_is_reported_once(short_folder: Path) -> None:
    """By who starts it: the API, which was loading meanwhile, says nothing and is gone."""
    data, log, before = (
        short_folder / "foreign",
        short_folder / "foreign.log",
        set(psutil.Process().children()),
    )
    (data / "postgres").mkdir(parents=True)
    (data / "postgres" / "notes.txt").write_text("not PostgreSQL's")
    with (
        pytest.raises(DataFolderError, match="holds no files of PostgreSQL"),
        LocalService(Settings(data=data, port=0), log_file=log),
    ):
        pass
    assert log.read_text() == ""
    assert set(psutil.Process().children()) <= before


# --- verify and doctor as an operator meets them, and servers that will not do
# ------------------------------------------

POSTGRESQL_15 = Path("/usr/lib/postgresql/15/bin")


def test_doctor_and_verify_say_what_is_wrong_and_a_backup_carries_it(
    database: str, empty_database: str, short_folder: Path, tmp_path: Path
) -> None:
    around = {"MODALBASE_DATABASE_URL": database}
    healthy = modalbase_here("doctor", **around)
    assert healthy.returncode == 0, healthy.stdout + healthy.stderr
    assert "ok       schema: this version's" in healthy.stdout
    assert "warning  workers: none is alive" in healthy.stdout
    with psycopg.connect(psycopg_url(database)) as connection:
        connection.execute("INSERT INTO originals VALUES ('\\x00', 3)")
    for command in ("doctor", "verify"):
        ended = modalbase_here(command, **around)
        assert ended.returncode == 1
        assert "1 damaged" in ended.stdout + ended.stderr
        assert "originals 00: data" in ended.stdout + ended.stderr
    file = tmp_path / "damaged.modalbase"
    written = modalbase_here("backup", file, **around)
    assert (
        written.returncode,
        "and so is this damage of the database: originals 00" in written.stderr,
    ) == (1, True)
    data = short_folder / "looked-at"
    restored = modalbase_here("restore", file, "--data", data)
    assert (
        restored.returncode,
        "but for this damage, which the backup already had" in restored.stderr,
    ) == (1, True)
    (data / "postgres").chmod(0o750)
    shown = modalbase_here("doctor", "--data", data).stdout
    assert "warning  data folder: other users may read" in shown
    assert "disk: " in shown
    shown = modalbase_here("doctor", MODALBASE_DATABASE_URL=empty_database).stdout
    assert "fault    schema: the database has no modalbase schema yet" in shown
    with psycopg.connect(psycopg_url(database)) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '0009_original_rows'")
    assert "fault    schema: the schema is at 0009" in modalbase_here("doctor", **around).stdout
    nowhere = modalbase_here("doctor", MODALBASE_DATABASE_URL="postgresql://u@127.0.0.1:1/d")
    assert (nowhere.returncode, nowhere.stderr) == (1, "")
    assert nowhere.stdout.startswith("fault    database: ")
    absent = modalbase_here("doctor", "--data", str(short_folder / "absent"))
    assert "fault    data folder: " in absent.stdout
    assert modalbase_here("backup", "x", "--data", str(short_folder / "absent")).returncode == 1
    assert not (short_folder / "absent").exists()


@pytest.fixture
def old_server(short_folder: Path, server: str) -> Iterator[str]:
    """URL of a PostgreSQL 15."""
    if not POSTGRESQL_15.is_dir():
        pytest.skip(f"no PostgreSQL 15 in {POSTGRESQL_15}")
    folder = short_folder / "old"
    folder.mkdir()
    assert server  # which made the account where it was missing
    user = ACCOUNT if os.geteuid() == 0 else None
    if user:
        short_folder.chmod(0o755)
        shutil.chown(folder, ACCOUNT, ACCOUNT)

    def run(*words: str) -> None:
        subprocess.run(
            [str(POSTGRESQL_15 / words[0]), *words[1:]],
            user=user,
            check=True,
            stdout=subprocess.DEVNULL,
        )

    run("initdb", "-A", "trust", "-U", "postgres", "-D", str(folder / "d"))
    run(
        "pg_ctl",
        "-w",
        "-D",
        str(folder / "d"),
        "-l",
        str(folder / "log"),
        "-o",
        f"-h '' -k {folder}",
        "start",
    )
    yield f"postgresql://postgres@/postgres?host={folder}"
    run("pg_ctl", "-w", "-D", str(folder / "d"), "-m", "fast", "stop")


COMMANDS = (["db", "upgrade"], ["keys", "create", "--name", "x"], ["verify"])


def test_a_server_that_is_too_old_is_refused_in_one_line(
    database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(schema, "POSTGRESQL", 99)
    refused_as_too_old(database, "18.", "99", [modalbase_here] * 3, COMMANDS)


@pytest.mark.long
def test_postgresql_15_is_too_old(old_server: str) -> None:
    up = ["up", "--port", "0"]
    runs = [modalbase_here] * 3 + [modalbase]
    refused_as_too_old(old_server, "15.", "18", runs, (*COMMANDS, up))


def refused_as_too_old(
    url: str, version: str, needed: str, runs: list[Any], commands: tuple[list[str], ...]
) -> None:
    for run, words in zip(runs, commands, strict=True):
        ended = run(*words, MODALBASE_DATABASE_URL=url)
        assert ended.returncode == 1
        assert ended.stderr.startswith(f"modalbase: the server runs PostgreSQL {version}")
        assert f"needs {needed} or newer" in ended.stderr
        assert len(ended.stderr.splitlines()) == 1
    examined = modalbase_here("doctor", MODALBASE_DATABASE_URL=url).stdout
    assert f"fault    database: the server runs PostgreSQL {version}" in examined
