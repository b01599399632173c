"""A TDMS that npTDMS writes gives back what was written, in parts, and says what it lacks."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.records.tdms import Tdms, read_tdms_head
from service.tasks.import_file.recordings import Channels, channels_of
from tests.unit.fecore.signal.test_recording import RATE, recording

nptdms = pytest.importorskip(
    "nptdms", reason="npTDMS is not installed: pip install 'modalbase[tdms]'"
)
WHOLE = recording([1.0, 4.0], [1.0, 0.6], 7.0)
NAMES = ["daq/force", "daq/acc"]
MAPPED = [
    {"variable": "daq/acc", "quantity": "acceleration", "point": 33, "sensitivity": 0.5},
    {"variable": "daq/force", "quantity": "force", "point": 4, "sensitivity": 0.5},
]


def written(folder: Path, strokes: int = 1, rate: float | None = RATE, lacks: int = 0) -> Path:
    """The force and response of `WHOLE` in so many strokes; the response lacks some samples."""
    path = folder / "long.tdms"
    properties = {"wf_increment": 1 / rate} if rate else {}
    with nptdms.TdmsWriter(path) as file:
        for force, response in zip(
            *(np.array_split(row, strokes, axis=0) for row in WHOLE), strict=True
        ):
            file.write_segment(
                [
                    nptdms.ChannelObject("daq", "force", force, properties),
                    nptdms.ChannelObject(
                        "daq", "acc", response[: len(response) - lacks], properties
                    ),
                    nptdms.ChannelObject("daq", "remarks", ["none"]),
                ]
            )
    return path


def channels(path: Path, **stated: object) -> Channels:
    return channels_of(path, {"recording": {}, "channels": MAPPED, **stated}, path.name, "tdms")


@pytest.mark.parametrize("strokes", [1, 7, 300])
def test_samples_are_those_that_were_written(tmp_path: Path, strokes: int) -> None:
    head = read_tdms_head(written(tmp_path, strokes))
    assert head == Tdms(
        head.path, dict.fromkeys(NAMES, WHOLE.shape[1]), dict.fromkeys(NAMES, RATE), True
    )
    parts = list(head.chunks(NAMES[::-1]))
    assert [part.shape[1] for part in parts[:-1]] == [1 << 17] * (len(parts) - 1)
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), WHOLE[::-1].astype(np.float32))


def test_hits_are_cut_by_group_and_channel(tmp_path: Path) -> None:
    own = channels(written(tmp_path, 7))
    survey = own.survey()
    blocks = list(own.blocks(survey, own.places(survey.hits)))
    assert [(b.quantity, b.force_point, b.hit, b.label) for b in blocks] == [
        (quantity, 4, hit, name)
        for hit in (1, 2)
        for quantity, name in (("force", "daq/force"), ("acceleration", "daq/acc"))
    ]
    begin = blocks[0].start_sample
    assert begin is not None
    expected = WHOLE[:, begin : begin + survey.length] / 0.5
    np.testing.assert_allclose(
        [blocks[0].samples, blocks[1].samples], expected, rtol=1e-6, atol=1e-7
    )
    assert own.notes(survey) == []


def test_a_rate_is_the_files_or_stated_and_one_that_a_recorder_has(tmp_path: Path) -> None:
    assert channels(written(tmp_path, rate=None), sample_rate_hz=RATE).sample_rate_hz == RATE
    for rate, stated, message in (
        (None, {}, "is missing, and the file states none"),
        (RATE, {"sample_rate_hz": 100}, "is 100, and the file says"),
        (-RATE, {}, f"is -{RATE:g}, expected a positive number"),
        (1e300, {}, r"is 1e\+300, expected a positive number"),
        (None, {"sample_rate_hz": -5}, "is -5, expected"),
    ):
        with pytest.raises(FormatError, match=f"sample_rate_hz: {message}"):
            channels(written(tmp_path, rate=rate), **stated)


def test_a_damaged_name_is_not_printed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """npTDMS printed all bytes of what it took for a name: with a damaged length, the rest of the
    file.
    """
    path = written(tmp_path)
    path.write_bytes(path.read_bytes().replace(b"wf_increment", b"wf_\xffncrement"))
    assert np.isnan(read_tdms_head(path).rates["daq/force"])
    assert "xff" not in "".join(capfd.readouterr())


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


def test_without_nptdms_the_error_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(FormatError, match=r"pip install 'modalbase\[tdms\]'"):
        channels(path)


def strokes_of(path: Path, strokes: int, interleaved: bool = False, cut: int = 0) -> None:
    """Make the raw data of a file's one segment as many strokes, each with samples of its own, and
    cut some bytes off.
    """
    whole = bytearray(path.read_bytes())
    meta, begin = int.from_bytes(whole[4:8], "little"), 28 + int.from_bytes(whole[20:28], "little")
    data = np.frombuffer(bytes(whole[begin:]), "<f8")
    raw = b"".join((data + stroke).tobytes() for stroke in range(strokes))
    whole[4:8] = (meta | (1 << 5) * interleaved).to_bytes(4, "little")
    whole[12:20] = (begin - 28 + len(raw)).to_bytes(8, "little")
    path.write_bytes((bytes(whole[:begin]) + raw)[: -cut or None])


@pytest.mark.parametrize("strokes", [1, 3])
@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("cut", [0, 100_004])
def test_every_layout_gives_what_nptdms_reads_at_once(
    tmp_path: Path, strokes: int, interleaved: bool, cut: int
) -> None:
    path, rows = tmp_path / "long.tdms", {"daq/force": WHOLE[0], "daq/acc": WHOLE[1]}
    scale = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
    }
    scale |= {
        "NI_Scale[0]_Linear_Y_Intercept": 0.25,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFF_FFFF,
    }
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [nptdms.ChannelObject(*name.split("/"), row, scale) for name, row in rows.items()]
        )
    strokes_of(path, strokes, interleaved, cut)
    whole = nptdms.TdmsFile.read(path)["daq"]
    for name in rows:
        parts = list(read_tdms_head(path).chunks([name]))
        assert max(part.size for part in parts) <= 1 << 17
        np.testing.assert_array_equal(
            np.concatenate(parts, axis=1)[0], whole[name[4:]][:].astype(np.float32)
        )


def daqmx(path: Path, strokes: int, frames: int, claimed: int | None = None) -> np.ndarray:
    """Write two channels of 16 bits in DAQmx's layout, 2 and 3 of a count a volt; gives the
    (frames, 2) counts.
    """

    def text(content: str) -> bytes:
        return struct.pack("<L", len(content)) + content.encode()

    counts = np.arange(2 * strokes * frames, dtype="<i2").reshape(-1, 2)
    objects = [
        text("/") + struct.pack("<LL", 0xFFFF_FFFF, 0),
        text("/'daq'") + struct.pack("<LL", 0xFFFF_FFFF, 0),
    ]
    for k in (0, 1):
        index = struct.pack("<LLLQ", 0x1269, 0xFFFF_FFFF, 1, claimed or frames)
        index += struct.pack("<LLLLLL", 1, 3, 0, 2 * k, 0, 0) + struct.pack("<LL", 1, 4)
        entries = [
            ("NI_Number_Of_Scales", 7, struct.pack("<L", 2)),
            ("NI_Scale[1]_Scale_Type", 0x20, text("Linear")),
        ]
        entries += [
            (f"NI_Scale[1]_Linear_{n}", 10, struct.pack("<d", v))
            for n, v in (("Slope", k + 2), ("Y_Intercept", 0))
        ]
        entries += [
            ("NI_Scale[1]_Linear_Input_Source", 7, struct.pack("<L", 0)),
            ("wf_increment", 10, struct.pack("<d", 1e-3)),
        ]
        properties = b"".join(
            text(name) + struct.pack("<L", kind) + value for name, kind, value in entries
        )
        objects.append(
            text(f"/'daq'/'c{k}'") + index + struct.pack("<L", len(entries)) + properties
        )
    head = struct.pack("<L", len(objects)) + b"".join(objects)
    lead = b"TDSm" + struct.pack("<lLQQ", 0b1000_1110, 4713, len(head) + counts.nbytes, len(head))
    path.write_bytes(lead + head + counts.tobytes())
    return counts


def test_daqmx_s_own_layout_is_read_stroke_by_stroke_and_refused_where_one_is_large(
    tmp_path: Path,
) -> None:
    path = tmp_path / "daqmx.tdms"
    counts = daqmx(path, 5, 100)
    read = np.concatenate(list(read_tdms_head(path).chunks(["daq/c0", "daq/c1"])), axis=1)
    np.testing.assert_array_equal(read, (counts * [2.0, 3.0]).T)
    daqmx(path, 1, 100, claimed=1 << 25)
    with pytest.raises(
        FormatError,
        match=r"strokes of 134 MB, of which 67 MB can be read; let the recorder write more",
    ):
        list(read_tdms_head(path).chunks(["daq/c0"]))
