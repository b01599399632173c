"""What is asked of small parts of the service at the edges of what they take."""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest

from service.app.application import create_app
from service.compute.spectra import decode, encode, encode_axis
from service.db.engine import DatabaseUrlError, sqlalchemy_url
from service.errors import MOST_FAULTS, Damaged, Invalid
from service.jobs.child import CHECKPOINT_BYTES, _Reporter
from service.settings import Settings, SettingsFileError
from service.show.figures.modes import aligned
from service.show.pages.numbers import in_unit, number, percent, seconds_between, size
from service.show.pages.viewer import draw_grid
from service.store.campaigns.operations import from_csv

NOON = datetime(2026, 3, 2, 12, tzinfo=UTC)


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        (number(None), "–"),
        (number(1.23456e9), "1.235e9"),
        (number(-1.23456e-12), "-1.235e-12"),
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
    "more broken lines than are listed": (
        Invalid,
        "line 2, label: .*; and 1 more faults",
        lambda: from_csv(b"label,x_m,y_m\n" + b"x,0,0\n" * (MOST_FAULTS + 10)),
    ),
    "a spectrum cut to another count": (
        Damaged,
        "the stored spectrum [0-9a-f]{64} fails its checksum; restore it from a backup",
        lambda: decode(replace(encode(np.ones(4)), count=5)),
    ),
    "an URL with two @": (
        DatabaseUrlError,
        "has more than one @; write one in the user or password as %40",
        lambda: sqlalchemy_url("postgresql://ada:se@cret@host/lab"),
    ),
    "a service without a database": (ValueError, "settings.database_url is not set", lambda: create_app(Settings())),
}


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
        ValueError, match=f"a checkpoint of {CHECKPOINT_BYTES + 1} bytes, at most {CHECKPOINT_BYTES} are"
    ):
        reporter.checkpoint(bytes(CHECKPOINT_BYTES + 1))
    assert not reading.poll()


def test_a_setting_stands_in_the_environment_or_in_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "password"
    monkeypatch.setenv("MODALBASE_SMTP_PASSWORD_FILE", str(file))
    with pytest.raises(SettingsFileError, match=r"MODALBASE_SMTP_PASSWORD_FILE: cannot read .*password"):
        Settings()
    file.write_text("secret\n")
    monkeypatch.setenv("MODALBASE_SMTP_PASSWORD", "another")
    with pytest.raises(
        SettingsFileError, match=r"both MODALBASE_SMTP_PASSWORD and MODALBASE_SMTP_PASSWORD_FILE are set"
    ):
        Settings()


def test_nothing_is_drawn_of_nothing() -> None:
    assert draw_grid({}, None, {}) is None
    measured, updated = aligned(np.zeros(0, complex), np.array([0.0, -2.0]))
    assert (measured.size, updated.tolist()) == (0, [0.0, -1.0])


def test_an_axis_of_one_line_keeps_it() -> None:
    axis = encode_axis(np.array([12.5]))
    assert (axis.step_hz, axis.count, axis.frequency_hz().tolist(), axis.columns()["end_hz"]) == (None, 1, [12.5], 12.5)
