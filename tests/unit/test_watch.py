"""Which files rest, and what is stated of a file beside it."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Event
from zoneinfo import ZoneInfo

import pytest

from modalbase.client.errors import ClientError, Exit
from modalbase.commands.watching import _statements
from modalbase.watch import watching
from modalbase.watch.folders import Folders
from modalbase.watch.headings import BY_DIMENSION, BY_TEXT
from modalbase.watch.statements import (
    Covariates,
    NotStatedYetError,
    StatementError,
    TimeInName,
    zone_of,
)
from service.nouns.campaigns.climate import unit_of_covariate

BERN = ZoneInfo("Europe/Zurich")
NOON = datetime(2026, 3, 2, 12, tzinfo=UTC)


def test_a_file_rests_when_neither_size_nor_time_changes(tmp_path: Path) -> None:
    now = 0.0
    folders = Folders([tmp_path, tmp_path / "b"], ["*.npz", "*.wav"], 10.0, lambda: now)
    (tmp_path / "b").mkdir()
    for name in ("a.npz", "b/b.wav", "c.txt", ".d.npz", "e.npz.part", "f.npz"):
        (tmp_path / name).write_bytes(b"" if name == "f.npz" else b"x")
    assert folders.look() == []
    now = 9.0
    (tmp_path / "b/b.wav").write_bytes(b"xy")
    assert folders.look() == []
    now = 10.0
    assert [each.path.name for each in folders.look()] == ["a.npz"]
    (tmp_path / "b").rename(tmp_path / "away")
    now = 12.0
    assert [each.path.name for each in folders.look()] == ["a.npz"]
    assert list(folders.unreadable) == [tmp_path / "b"]
    (tmp_path / "away").rename(tmp_path / "b")
    os.remove(tmp_path / "a.npz")
    now = 19.0  # what lay in a folder that could not be read has rested all the while
    assert [each.path.name for each in folders.look()] == ["b.wav"]


@pytest.mark.parametrize(
    ("pattern", "name", "time"),
    [
        ("%Y%m%d_%H%M%S", "deck_20260302_130000_ch8.npz", NOON),
        ("%Y-%m-%dT%H.%M%z", "2026-03-02T14.00+0200.wav", NOON),
        ("%y%jh%H", "a260611260611h13.npz", None),
        ("%Y%m%d%H", "2026130213.npz", None),
        ("%Y%m%d%H", "2026030213 2026030214.npz", None),
        ("%Y%m%d_%H", "deck.npz", None),
    ],
)
def test_a_time_in_a_name(pattern: str, name: str, time: datetime | None) -> None:
    own = TimeInName(pattern, BERN)
    if time is None:
        with pytest.raises(StatementError, match="its name has"):
            own.of(Path(name))
    else:
        assert own.of(Path(name)) == time


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        (("%Y%m%d_%H", None, None, None), "--zone is missing"),
        (("%H%M", "UTC", None, None), "lacks year"),
        (("%Y%m%d", "UTC", None, None), "or the hour"),
        (("%Y%B%d%H", "UTC", None, None), "has '%B'"),
        ((None, None, None, None), "--time is missing"),
        (("now", None, None, None), "--time is 'now'"),
        (("csv", None, None, None), "needs --covariates"),
        (("file", None, None, None), "needs a --mapping"),
        (("modified", "Bern", None, None), "no time zone"),
    ],
)
def test_what_is_not_known_is_asked_for(
    stated: tuple[str | None, str | None, str | None, float | None], words: str
) -> None:
    with pytest.raises(ClientError, match=words):
        _statements({}, {}, *stated)


def test_the_file_states_its_time_where_that_is_said() -> None:
    dated = _statements({}, {"mapping": {"recording": {}}}, "file", None, None, None)
    assert dated.how["mapping"] == {"recording": {"performed_at": "file"}}
    assert dated.of(Path("hour.npz")) == {"name": "hour"}


BY_TIME = "performed_at,wind_m_s\n2026-03-02T12:50,3\n2026-03-02 13:10+01:00,4\n"
BY_FILE = "file;performed_at;wind_m_s;temperature_c\na.npz;2026-03-02T13:00;4,5;\n"


def test_covariates_of_a_table(tmp_path: Path) -> None:
    table, file = tmp_path / "weather.csv", tmp_path / "a.npz"
    by_time = Covariates(table, zone_of("Europe/Zurich"), timedelta(minutes=20))
    with pytest.raises(NotStatedYetError, match=r"weather\.csv is not there"):
        by_time.of(file, NOON)
    table.write_text(BY_TIME)
    assert by_time.of(file, NOON + timedelta(minutes=1)) == ({"wind_m_s": 4}, None)
    with pytest.raises(NotStatedYetError, match="no row near 2026-03-02T13:00"):
        by_time.of(file, NOON + timedelta(hours=1))
    with pytest.raises(StatementError, match="without an offset; state --zone"):
        Covariates(table, None, timedelta(minutes=20)).of(file, NOON)
    with pytest.raises(StatementError, match="--within"):
        Covariates(table, BERN, None).of(file, NOON)
    table.write_text(BY_FILE)
    assert by_time.of(file, None) == ({"wind_m_s": 4.5}, NOON)
    with pytest.raises(NotStatedYetError, match="no row of it"):
        by_time.of(tmp_path / "b.npz", None)
    german = BY_FILE.replace("wind_m_s", "Wind (km/h)").replace("5;\n", "5;-3\n")
    table.write_text(german.replace("temperature_c", "Außentemperatur [°C]"))
    assert by_time.of(file, None)[0] == {"wind_m_s": 1.25, "aussentemperatur_c": -3}
    for heading, words in (("Druck [bar]", "no unit of a cov"), ("Wind [m/s]", "wind_m_s twice")):
        table.write_text(BY_FILE.replace("temperature_c", heading).replace("5;\n", "5;-3\n"))
        with pytest.raises(StatementError, match=words):
            by_time.of(file, None)
    table.write_text(BY_FILE.replace("4,5", "strong"))
    with pytest.raises(StatementError, match=r"weather\.csv, wind_m_s is 'strong'"):
        by_time.of(file, None)
    table.write_text(BY_FILE + "b.npz;1\n")
    with pytest.raises(StatementError, match=r"weather\.csv, line 3 has 2 cells, and the head 4"):
        by_time.of(file, None)


def test_headings_become_names_that_the_service_takes() -> None:
    for end in {*BY_TEXT.values(), *BY_DIMENSION.values()}:
        assert unit_of_covariate(f"any{end}"), end


def test_a_table_beside_a_file_is_no_recording(tmp_path: Path) -> None:
    beside = Covariates(None, None, None)
    names = frozenset({"a.npz", "a.csv", "b.csv"})
    assert [n for n in sorted(names) if beside.is_beside(tmp_path / n, names)] == ["a.csv"]


def test_a_service_that_does_not_answer_is_waited_for_and_one_that_refuses_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(watching, "FIRST_PAUSE_S", 1e-3)
    answers = iter(
        [ClientError("no answer", Exit.UNREACHABLE), "there", ClientError("no", status=403)]
    )
    notes: list[str] = []

    def ask() -> str:
        answer = next(answers)
        if isinstance(answer, ClientError):
            raise answer
        return answer

    assert watching.through_outages(ask, Event(), notes.append) == "there"
    assert notes == ["no answer; tries again in 0.001 s"]
    with pytest.raises(ClientError, match="no"):
        watching.through_outages(ask, Event(), notes.append)
