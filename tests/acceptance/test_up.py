"""`modalbase up` from its first start to its end: in an ordinary folder, when parts of it die, with backup and restore."""

import io
import re
import signal
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import pytest

from service.app.supervisor import LocalService, StartError
from service.db.opening import DataFolderError
from service.settings import Settings
from tests.support.command import living, modalbase, modalbase_here, status, up, wait_until_gone
from tests.support.laboratory import BEAM
from tests.support.rest import plain_client
from tests.support.waiting import PATIENCE, until


def part(up: psutil.Process, name: str) -> psutil.Process:
    """The API (`serve`) or the worker of a running command."""
    return next(child for child in up.children() if name in child.cmdline())


def test_a_service_is_begun_hurt_backed_up_restored_and_ended(short_folder: Path, empty_database: str) -> None:
    """In the default folder of a home with a space, as on macOS: the first start makes a key and prints it, what dies is
    started again, and no end leaves anything running. The restored service runs beside it on a server of its own: the same key
    opens it, the same bits come out, and commands that do not say which of the two they mean are refused.
    """
    home = short_folder / "Prüf stand" / ("with a long name, " * 6)
    home.mkdir(parents=True)
    around = {"HOME": str(home), "XDG_STATE_HOME": "", "XDG_DATA_HOME": "", "MODALBASE_LOG_LEVEL": "info"}
    data, log, file = (
        home / ".local" / "share" / "modalbase",
        short_folder / "home.log",
        short_folder / "home.modalbase",
    )
    own = {"MODALBASE_DATABASE_URL": empty_database}
    with log.open("w") as stderr, up(None, stderr=stderr, **around) as (process, url, key), client(url, key) as api:
        made = modalbase("keys", "create", "--name", "ada", **around)  # by another process, and nobody says where
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
        with up(short_folder / "no data", **own, **around) as (other, there, second), client(there, key) as restored:
            assert second == ""  # there is a key already
            assert same(before, restored.get(frfs).raise_for_status().content)
            ended = modalbase_here("keys", "create", "--name", "ada", code=1, **around)
            assert "2 services run here; say which with --data" in ended.stderr
            assert str(data) in ended.stderr
            assert len(living(data)) >= 4  # the command, the API, the worker, PostgreSQL
            process.kill()  # its note stays, and names nobody
            process.wait()
            wait_until_gone(data)
            ended = modalbase_here("keys", "create", "--name", "x", code=1, **around)
            assert "has a database server of its own; set MODALBASE_DATABASE_URL" in ended.stderr
            parts = psutil.Process(other.pid).children()
            other.send_signal(signal.SIGINT)
            assert other.wait(PATIENCE) == 0
            assert not any(map(psutil.Process.is_running, parts))
        assert "/api/v1/projects" not in log.read_text()  # no line for each request
        assert "py.warnings" not in log.read_text()
    assert "services run here" not in modalbase_here("db", "current", **around).stderr
    into_another_folder(file, short_folder / "copy")


def into_another_folder(file: Path, copy: Path) -> None:
    assert modalbase("restore", str(file), "--data", str(copy)).returncode == 0
    again = modalbase_here("restore", file, "--data", copy, code=1)
    assert len(again.stderr.splitlines()) == 1
    assert "the database is not empty" in again.stderr
    modalbase_here("verify", "--data", copy, code=0)  # every spectrum by its SHA-256
    wait_until_gone(copy)


def client(url: str, key: str) -> httpx.Client:
    return plain_client(f"{url}/", {"Authorization": f"Bearer {key}"})


def with_frfs(api: httpx.Client) -> str:
    """The address of the FRFs of a new campaign, bit for bit."""

    def post(path: str, body: Any) -> str:
        return str(api.post(path, json=body).raise_for_status().json()["id"])

    structure = post(f"projects/{post('projects', {'name': 'x'})}/structures", BEAM)
    campaign = post(f"structures/{structure}/campaigns", {"name": "x", "boundary": "cantilever"})
    npz = {"Content-Type": "application/x-npz"}
    api.post(f"campaigns/{campaign}/frfs", content=measured(100, 801), headers=npz).raise_for_status()
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
