"""Ctrl-C and SIGTERM while a process is still being loaded."""

import subprocess
import sys

import pytest

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
