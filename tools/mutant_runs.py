"""How a mutant is tried: within a function, by exchanging its code in a loaded project; elsewhere in a new process.

Loading the project takes longer than most unit tests. So it is loaded once, a process is forked for each mutant, and there the
code of the one function is exchanged, which reaches everybody who holds the function. A function that worked while the project
was loaded is tried in a new process, like what stands outside functions.
"""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from types import CodeType, FrameType, FunctionType, ModuleType
from typing import Any

import pytest

QUIET = (
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),  # what was imported beforehand is not rewritten
    *("-W", "ignore::DeprecationWarning"),  # of the API, which runs in the tests' process here
)
OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "--no-header", *QUIET)
SERVER = "MODALBASE_TEST_SERVER"  # a PostgreSQL that runs already; see tests/conftest.py


def load(
    folder: Path, here: Path, modules: Sequence[str], tests: Sequence[str], *, http: bool
) -> tuple[dict[str, ModuleType], set[str]]:
    """Load the project from its copy; the API answers in the tests' own process where wanted.

    Returns:
        The modules that will be changed, by their files, and those of their functions that were called meanwhile, as
        `file:name`.
    """
    os.chdir(folder)
    os.environ["PYTHONPATH"] = str(folder)  # for the processes that the tests start
    sys.path[:] = [str(folder), *(place for place in sys.path if Path(place or ".").resolve() != here)]
    called: set[str] = set()
    places = {str(folder / module): module for module in modules}

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and (module := places.get(frame.f_code.co_filename)):
            called.add(f"{module}:{frame.f_code.co_qualname}")

    sys.setprofile(note)
    if http:
        from service import supervisor
        from tools.mutant_service import ServiceInside

        supervisor.LocalService = ServiceInside  # type: ignore[misc]  # as much of it as these tests use
    importlib.import_module("tests.conftest")
    changed = {module: importlib.import_module(module.removesuffix(".py").replace("/", ".")) for module in modules}
    sys.setprofile(None)
    with Path(os.devnull).open("w") as silent, redirect_stdout(silent):
        pytest.main([*OPTIONS, "--collect-only", *tests])  # loads the tests, with their assertions rewritten
    return changed, called


@contextmanager
def database_server(folder: Path) -> Iterator[None]:
    """One PostgreSQL for all mutants, which the tests are shown by a variable of the environment."""
    from service.db.embedded import embedded_server

    with embedded_server(folder) as url:
        os.environ[SERVER] = url
        try:
            yield
        finally:
            del os.environ[SERVER]


def put(module: ModuleType, name: str, text: str) -> bool:
    """Give a loaded function the code that it has in this text of its module. Whether that could be done."""
    new = [code for code in _codes(compile(text, str(module.__file__), "exec")) if code.co_qualname == name]
    old = _function(module, name)
    if len(new) != 1 or old is None or old.__code__.co_freevars != new[0].co_freevars:
        return False
    old.__code__ = new[0]
    return True


def _codes(code: CodeType) -> Iterator[CodeType]:
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield part
            yield from _codes(part)


def _function(module: ModuleType, name: str) -> FunctionType | None:
    """A function or method behind what its decorators made of it."""
    held: Any = module
    for part in name.split("."):
        held = vars(held).get(part)
        if held is None:
            return None
    for _ in range(9):
        inner = next(
            (getattr(held, key) for key in ("__wrapped__", "__func__", "fget", "func") if hasattr(held, key)), None
        )
        if inner is None:
            break
        held = inner
    return held if isinstance(held, FunctionType) and held.__code__.co_qualname == name else None


def warm(tests: Sequence[str], seconds: float, change: Callable[[], bool]) -> bool | None:
    """Whether the tests fail, or do not end, in a fork in which a change was made; None where it cannot be made."""
    child = os.fork()
    if child == 0:
        os.setsid()
        _run(tests, change)
    return _ended(child, seconds)


CANNOT = 77


def _run(tests: Sequence[str], change: Callable[[], bool]) -> None:
    with Path(os.devnull).open("w") as silent:
        os.dup2(silent.fileno(), 1)
        os.dup2(silent.fileno(), 2)
        os._exit(int(pytest.main([*OPTIONS, *tests])) if change() else CANNOT)


def _ended(child: int, seconds: float) -> bool | None:
    until, ended = time.monotonic() + seconds, 0
    try:
        while time.monotonic() < until:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return None if os.waitstatus_to_exitcode(status) == CANNOT else status != 0
            time.sleep(0.01)
        return True
    finally:  # also where somebody has seen enough
        if not ended:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)


def cold(folder: Path, tests: Sequence[str], seconds: float) -> bool:
    """Whether the tests fail, or do not end, in a new process on this copy of the project."""
    command = [sys.executable, "-m", "pytest", *OPTIONS, *tests]
    run = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        return run.wait(seconds) != 0
    except subprocess.TimeoutExpired:
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
        return True
