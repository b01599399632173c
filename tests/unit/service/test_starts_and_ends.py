"""Starts and ends of what runs, without the processes themselves: systems, users and moments that a test does not have."""

import subprocess
import sys
import threading

import pytest

from service.app.supervisor import LocalService, Part
from service.jobs.background import Background
from service.settings import Settings


def test_nothing_is_tended_while_the_database_is_down() -> None:
    service = LocalService(Settings())
    tended: list[str] = []
    for name, ended in (("PostgreSQL", "ended by itself"), ("the API", None)):
        part = Part(name, lambda: None, lambda name=name, ended=ended: tended.append(name) or ended, (60.0,))
        service._parts.append(part)
    (line,) = service.tend()
    assert line.startswith("PostgreSQL ended by itself")
    assert set(tended) == {"PostgreSQL"}


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
