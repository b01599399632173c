"""A TDMS that npTDMS writes gives back what was written, in parts, and says what it lacks."""

import sys
from pathlib import Path

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.records.tdms import Tdms, read_tdms_head
from service.compute.recordings import Channels, channels_of
from tests.unit.fecore.signal.test_recording import RATE, recording

nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed: pip install 'modalbase[tdms]'")
WHOLE = recording([1.0, 4.0], [1.0, 0.6], 7.0)
NAMES = ["daq/force", "daq/acc"]
MAPPED = [
    {"variable": "daq/acc", "quantity": "acceleration", "point": 33, "sensitivity": 0.5},
    {"variable": "daq/force", "quantity": "force", "point": 4, "sensitivity": 0.5},
]


def written(folder: Path, strokes: int = 1, rate: float | None = RATE, lacks: int = 0) -> Path:
    """The force and response of `WHOLE` in so many strokes; the response lacks some samples."""
    path = folder / "long.tdms"
    said = {"wf_increment": 1 / rate} if rate else {}
    with nptdms.TdmsWriter(path) as file:
        for force, response in zip(*(np.array_split(row, strokes, axis=0) for row in WHOLE), strict=True):
            file.write_segment(
                [
                    nptdms.ChannelObject("daq", "force", force, said),
                    nptdms.ChannelObject("daq", "acc", response[: len(response) - lacks], said),
                    nptdms.ChannelObject("daq", "remarks", ["none"]),
                ]
            )
    return path


def channels(path: Path, **said: object) -> Channels:
    return channels_of(path, {"recording": {}, "channels": MAPPED, **said}, path.name)


@pytest.mark.parametrize("strokes", [1, 7, 300])
def test_samples_are_those_that_were_written(tmp_path: Path, strokes: int) -> None:
    head = read_tdms_head(written(tmp_path, strokes))
    assert head == Tdms(head.path, dict.fromkeys(NAMES, WHOLE.shape[1]), dict.fromkeys(NAMES, RATE), True)
    parts = list(head.chunks(NAMES[::-1]))
    assert [part.shape[1] for part in parts[:-1]] == [1 << 17] * (len(parts) - 1)
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), WHOLE[::-1].astype(np.float32))


def test_hits_are_cut_by_group_and_channel(tmp_path: Path) -> None:
    own = channels(written(tmp_path, 7))
    found = own.survey()
    blocks = list(own.blocks(found, own.places(found.hits)))
    assert [(b.quantity, b.force_point, b.hit, b.label) for b in blocks] == [
        (quantity, 4, hit, name)
        for hit in (1, 2)
        for quantity, name in (("force", "daq/force"), ("acceleration", "daq/acc"))
    ]
    begin = blocks[0].start_sample
    assert begin is not None
    expected = WHOLE[:, begin : begin + found.length] / 0.5
    np.testing.assert_allclose([blocks[0].samples, blocks[1].samples], expected, rtol=1e-6, atol=1e-7)
    assert own.notes(found) == []


def test_a_rate_is_the_files_or_stated(tmp_path: Path) -> None:
    path = written(tmp_path, rate=None)
    with pytest.raises(FormatError, match=r"sample_rate_hz: is missing, and the file states none"):
        channels(path)
    assert channels(path, sample_rate_hz=RATE).sample_rate_hz == RATE
    with pytest.raises(FormatError, match=r"is 100\.0, and the file says"):
        channels(written(tmp_path), sample_rate_hz=100)


def test_channels_of_unlike_length_and_unknown_ones_are_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="daq/acc: differs in rate or length from daq/force"):
        channels(written(tmp_path, lacks=1))
    with pytest.raises(FormatError, match=r"is 'acc'; the file has daq/force, daq/acc"):
        channels(written(tmp_path), channels=[{**MAPPED[0], "variable": "acc"}, MAPPED[1]])


def test_a_file_that_was_cut_off_says_so_and_one_that_is_broken_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, 7)
    whole = path.read_bytes()
    path.write_bytes(whole[:-1000])
    own = channels(path)
    assert any("cut off" in note for note in own.notes(own.survey()))
    path.write_bytes(whole[:40])
    with pytest.raises(FormatError, match="is a TDMS without a channel of numbers"):
        channels(path)


def test_without_nptdms_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(FormatError, match=r"pip install 'modalbase\[tdms\]'"):
        channels(path)
