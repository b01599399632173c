"""An MDF that asammdf writes gives back what was written, in parts, and says what it lacks."""

import contextlib
import gc
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.recognise import recognise
from modalbase.formats.records.arrays import SAMPLE_RATE
from modalbase.formats.records.mdf import Mdf, read_mdf_head
from modalbase.formats.records.wav import FRAMES
from service.tasks.import_file.recordings import Channels, channels_of
from service.tasks.look.compute import look_at
from tests.unit.fecore.signal.test_recording import RATE, recording

asammdf = pytest.importorskip(
    "asammdf", reason="asammdf is not installed: pip install 'modalbase[mdf]'"
)
WHOLE = recording([1.0, 4.0], [1.0, 0.6], 7.0).astype(np.float32)
TIME = np.arange(WHOLE.shape[1]) / RATE
STARTED = datetime(2026, 5, 4, 3, 2, 1, tzinfo=UTC)
NAMES = ["2/force", "2/acc"]
MAPPED = [
    {"variable": "2/acc", "quantity": "acceleration", "point": 33},
    {"variable": "2/force", "quantity": "force", "point": 4},
]


def signal(name: str, samples: Any, time: Any = None, unit: str = "", **more: Any) -> Any:
    time = TIME[: len(samples)] if time is None else time
    return asammdf.Signal(samples, time, name=name, unit=unit, **more)


def written(folder: Path, *groups: list[Any], version: str = "4.10", compression: int = 0) -> Path:
    """A file whose first group is of words; then the given ones, by default force and response."""
    default = [signal("force", WHOLE[0], unit="kN"), signal("acc", WHOLE[1], unit="g")]
    path = folder / ("rec.mf4" if version >= "4" else "rec.mdf")
    with asammdf.MDF(version=version) as file:
        file.start_time = STARTED
        words = np.array([b"begin", b"end"])
        file.append([signal("remark", words, np.array([0.0, 1.0]), encoding="utf-8")])
        for group in groups or [default]:
            file.append(group)
        file.save(path, overwrite=True, compression=compression)
    return path


def channels(path: Path, **stated: object) -> Channels:
    return channels_of(path, {"recording": {}, "channels": MAPPED, **stated}, path.name, "mdf")


def mapped_rows(head: Mdf, names: list[str]) -> np.ndarray:
    head.rate_of(names, SAMPLE_RATE)
    return np.concatenate(list(head.chunks(names)), axis=1)


@pytest.mark.parametrize(("version", "compression"), [("4.10", 0), ("4.11", 2), ("3.30", 0)])
def test_samples_units_and_start_are_those_that_were_written(
    tmp_path: Path, version: str, compression: int
) -> None:
    path = written(tmp_path, version=version, compression=compression)
    assert recognise(path, "x.csv") == "mdf"
    head = read_mdf_head(path)
    assert (head.names, head.units) == (NAMES, {"2/force": "kN", "2/acc": "g"})
    assert head.began == STARTED.timestamp()
    assert head.rate_of(NAMES, SAMPLE_RATE) == pytest.approx(
        RATE, rel=1e-9
    )  # of a mean step in float64
    parts = list(head.chunks(NAMES[::-1]))
    assert {part.shape[1] for part in parts[:-1]} <= {FRAMES}
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), WHOLE[::-1])
    assert channels(path).mapped[0].sensitivity == 1e-3  # the file states kN


def test_a_look_shows_channels_their_units_and_when_it_was_recorded(tmp_path: Path) -> None:
    look = look_at(written(tmp_path), "rec.mf4", None)
    assert (look.format, look.kind, look.performed_at) == ("mdf", "hits", STARTED)
    assert [(c["variable"], c["unit"]) for c in look.mapping["channels"]] == [
        ("2/force", "kN"),
        ("2/acc", "g"),
    ]
    assert look.variables["2/acc"].startswith(f"float32 [{WHOLE.shape[1]}], ")


def test_groups_have_a_clock_each_and_are_aligned_or_refused(tmp_path: Path) -> None:
    late = TIME + 10 / RATE
    path = written(tmp_path, [signal("force", WHOLE[0])], [signal("acc", WHOLE[1], late)])
    head = read_mdf_head(path)
    names = ["2/force", "3/acc"]
    assert "begins 10 samples" in head.notes(names)[0]
    parts = np.concatenate(list(head.chunks(names)), axis=1)
    np.testing.assert_array_equal(parts, [WHOLE[0, 10:], WHOLE[1, :-10]])
    for time, message in (
        (2 * TIME, r"3/acc: differs in rate or length from 2/force \(.* Hz, .* and .* Hz"),
        (TIME + 0.5 / RATE, r"3/acc: begins .* which is 0.5 samples"),
        (TIME + 100.0, "2/force: ends before other channels begin"),
    ):
        own = read_mdf_head(
            written(tmp_path, [signal("force", WHOLE[0])], [signal("acc", WHOLE[1], time)])
        )
        with pytest.raises(FormatError, match=message):
            mapped_rows(own, names)


def test_an_uneven_time_channel_is_refused_with_its_sample(tmp_path: Path) -> None:
    gap = TIME.copy()
    gap[100:] += 1 / RATE
    stamps = TIME + np.where(np.arange(TIME.size) % 2, 0.2 / RATE, 0.0)
    for time, stated, message in (
        (gap, {}, "2/time: does not rise evenly: the step to sample 101"),
        (gap, {"sample_rate_hz": RATE}, "2/time: does not rise evenly: the step to sample 101"),
        (stamps, {}, "2/time: is not an evenly rising time axis, most at sample"),
        (TIME[::-1] * 0, {}, "2/time: does not rise evenly"),
    ):
        pair = [signal(name, row, time) for name, row in zip(("force", "acc"), WHOLE, strict=True)]
        with pytest.raises(FormatError, match=message):
            channels(written(tmp_path, pair), **stated)
    pair = [signal(name, row, stamps) for name, row in zip(("force", "acc"), WHOLE, strict=True)]
    assert channels(written(tmp_path, pair), sample_rate_hz=RATE).sample_rate_hz == RATE
    with pytest.raises(FormatError, match=r"sample_rate_hz: is 100, and the file says"):
        channels(written(tmp_path), sample_rate_hz=100)


def test_units_are_used_or_refused_by_name_and_what_is_no_number_is_no_channel(
    tmp_path: Path,
) -> None:
    path = written(tmp_path, [signal("force", WHOLE[0], unit="V"), signal("acc", WHOLE[1])])
    with pytest.raises(FormatError, match="sensitivity: is missing: the file is in 'V'"):
        channels(path)
    with pytest.raises(FormatError, match="unit: is 'm/s²', and the file states 'g'"):
        channels(written(tmp_path), channels=[{**MAPPED[0], "unit": "m/s²"}, MAPPED[1]])
    with pytest.raises(FormatError, match=r"is '1/remark'; the file has 2/force, 2/acc"):
        channels(written(tmp_path), channels=[{**MAPPED[0], "variable": "1/remark"}, MAPPED[1]])
    words = [signal("remark", np.array([b"a", b"b"]), np.array([0.0, 1.0]), encoding="utf-8")]
    with pytest.raises(FormatError, match="is an MDF without a channel of numbers"):
        read_mdf_head(written(tmp_path, words))


def test_a_sample_that_the_file_calls_invalid_is_named(tmp_path: Path) -> None:
    bad = np.arange(TIME.size) == 41
    pair = [signal("force", WHOLE[0]), signal("acc", WHOLE[1], invalidation_bits=bad)]
    with pytest.raises(FormatError, match="2/acc: is invalid at sample 42, as the file says"):
        list(read_mdf_head(written(tmp_path, pair)).chunks(NAMES))


def test_without_asammdf_the_error_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path)
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(FormatError, match=r"asammdf reads: pip install 'modalbase\[mdf\]'"):
        read_mdf_head(path)


@pytest.fixture
def collected() -> Iterator[None]:
    """asammdf's destructor wants members that a file that it refuses never got."""
    yield
    gc.collect()


@pytest.mark.usefixtures("collected")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_read(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Cut at any byte, or with any bytes of its head changed."""
    folder = tmp_path_factory.mktemp("mdf")
    short = [signal(n, row[:200]) for n, row in zip(("force", "acc"), WHOLE, strict=True)]
    path = written(folder, short)
    whole = path.read_bytes()
    at = data.draw(st.integers(0, len(whole) - 1))
    if data.draw(st.booleans()):
        content = whole[:at]
    else:
        noise = data.draw(st.binary(min_size=1, max_size=8))
        content = whole[:at] + noise + whole[at + len(noise) :]
    path.write_bytes(content)
    with contextlib.suppress(FormatError):
        head: Mdf = read_mdf_head(path)
        head.rate_of(head.names, 1.0)
        list(head.chunks(head.names))
