"""Small parts of the service at the edges of what they take, and at starts and ends that a test
does not have.
"""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest

from service.app.application import create_app
from service.app.supervisor import Component, LocalService
from service.compute.spectra import decode, encode
from service.figures.modes import aligned
from service.nouns.campaigns.operations import from_csv
from service.pages.numbers import in_unit, number, percent, seconds_between, size
from service.platform.db.engine import DatabaseUrlError, sqlalchemy_url
from service.platform.errors import MOST_FAULTS, Damaged, Invalid
from service.platform.queue.child import CHECKPOINT_BYTES, _Reporter
from service.platform.settings import Settings, SettingsFileError
from tests.support.lengths import long

NOON = datetime(2026, 3, 2, 12, tzinfo=UTC)


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        (number(None), "–"),
        (number(1.23456e9), "1.235e9"),
        (number(-1.23456e-12), "−1.235e-12"),
        (in_unit(3e25, "Pa", 1e9), "3.00000e16"),
        (percent(None), "–"),
        (percent(-0.001), "0.00"),
        (seconds_between(NOON, None), "–"),
        (seconds_between(NOON, NOON + timedelta(seconds=99)), "99.0 s"),
        (seconds_between(NOON, NOON + timedelta(seconds=150)), "2.5 min"),
        (size(999), "999 B"),
        (size(1500), "1.5 kB"),
        (size(2_000_000), "2 MB"),
        (size(5_120_000_000), "5.12 GB"),
    ],
)
def test_numbers_that_are_missing_tiny_or_huge(shown: str, expected: str) -> None:
    assert shown == expected


WRONG: dict[str, tuple[type[Exception], str, Callable[[], object]]] = {
    "more broken lines than are listed": (Invalid, "line 2, label: .*; and 1 more faults",
        lambda: from_csv(b"label,x_m,y_m\n" + b"x,0,0\n" * (MOST_FAULTS + 10))),
    "a spectrum cut to another count": (Damaged,
        "the stored spectrum [0-9a-f]{64} fails its checksum; restore it from a backup",
        lambda: decode(replace(encode(np.ones(4)), count=5))),
    "an URL with two @": (DatabaseUrlError, "has more than one @; write one in the user or password as %40",
        lambda: sqlalchemy_url("postgresql://ada:se@cret@host/lab")),
    "a service without a database": (ValueError, "settings.database_url is not set", lambda: create_app(Settings())),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_is_refused_in_words(case: str) -> None:
    kind, words, act = WRONG[case]
    with pytest.raises(kind, match=words):
        act()


def test_a_checkpoint_has_a_limit_and_what_is_within_it_is_sent() -> None:
    reading, writing = Pipe(duplex=False)
    reporter = _Reporter(writing, None)
    reporter.checkpoint(b"here")
    assert reading.recv().data == b"here"
    with pytest.raises(
        ValueError,
        match=f"a checkpoint of {CHECKPOINT_BYTES + 1} bytes, at most {CHECKPOINT_BYTES} are",
    ):
        reporter.checkpoint(bytes(CHECKPOINT_BYTES + 1))
    assert not reading.poll()


def test_a_setting_stands_in_the_environment_or_in_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "password"
    monkeypatch.setenv("MODALBASE_SMTP_PASSWORD_FILE", str(file))
    with pytest.raises(
        SettingsFileError, match=r"MODALBASE_SMTP_PASSWORD_FILE: cannot read .*password"
    ):
        Settings()
    file.write_text("secret\n")
    monkeypatch.setenv("MODALBASE_SMTP_PASSWORD", "another")
    with pytest.raises(
        SettingsFileError,
        match=r"both MODALBASE_SMTP_PASSWORD and MODALBASE_SMTP_PASSWORD_FILE are set",
    ):
        Settings()


def test_nothing_is_drawn_of_nothing() -> None:
    measured, updated = aligned(np.zeros(0, complex), np.array([0.0, -2.0]))
    assert (measured.size, updated.tolist()) == (0, [0.0, -1.0])


def test_nothing_is_tended_while_the_database_is_down() -> None:
    service = LocalService(Settings())
    tended: list[str] = []
    for name, ended in (("PostgreSQL", "ended by itself"), ("the API", None)):
        part = Component(
            name, lambda: None, lambda name=name, ended=ended: tended.append(name) or ended, (60.0,)
        )
        service._parts.append(part)
    (line,) = service.tend()
    assert line.startswith("PostgreSQL ended by itself")
    assert set(tended) == {"PostgreSQL"}


# --- ctrl-C and SIGTERM while a process is still being loaded
# -----------------------------------------------------------

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
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


# Where Python 3.11 wraps an error as `RuntimeError`: a class of the library that is loaded is just
# being made.
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
        long("SIGTERM", 0, "service.platform.queue.worker", ATTACHED, ["worker", "0"]),
        ("SIGTERM", 0, "service.app.supervisor", COMMAND, ["up"]),
        ("SIGINT", 130, "service.app.supervisor", COMMAND, ["up"]),
    ],
)
def test_a_signal_that_a_library_would_disguise_ends_it_without_a_trace(
    signal: str, code: int, library: str, start: str, command: list[str]
) -> None:
    program = STOPPED.format(signal=signal, library=library, start=start, command=command)
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (code, "", "")
