"""Named arrays and a mapping to time blocks: every kind of file gives the same blocks, and what
cannot be right is named.
"""

import io
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy import sparse
from scipy.io import savemat, wavfile

from modalbase.formats.errors import FormatError
from modalbase.formats.recognise import recognise
from modalbase.formats.records import (
    TimeBlock,
    Variables,
    blocks_of,
    propose,
    read_mapping,
    read_variables,
)
from modalbase.formats.records.arrays import arrays_of

RNG = np.random.default_rng(1)
FORCE = RNG.standard_normal((3, 256)).astype(np.float32)
RESPONSE = RNG.standard_normal((3, 256)).astype(np.float32)
ARRAYS = {"force": FORCE, "acc": RESPONSE, "point": np.array([4, 4, 7]), "fs": np.array(2048.0)}
MAPPING: dict[str, Any] = {
    "sample_rate_hz": {"variable": "fs"},
    "channels": [
        {
            "variable": "force",
            "quantity": "force",
            "point": {"variable": "point"},
            "sensitivity": 0.5,
        },
        {
            "variable": "acc",
            "quantity": "acceleration",
            "point": 33,
            "direction": -3,
            "window_rate_per_s": 2.0,
        },
    ],
}


def _mat(path: Path) -> None:
    savemat(path, {"force": FORCE.T, "acc": RESPONSE.T, "point": ARRAYS["point"], "fs": 2048.0})


def _mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in ARRAYS.items():
            file[name] = np.atleast_2d(values)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: TEST")


def _npz(path: Path) -> None:
    np.savez(path, **ARRAYS)


@pytest.mark.parametrize(("suffix", "write"), [(".npz", _npz), (".mat", _mat), (".MAT", _mat73)])
def test_every_kind_of_file_gives_the_same_blocks(
    suffix: str, write: Callable[[Path], None], tmp_path: Path
) -> None:
    path = tmp_path / f"hits{suffix}"
    write(path)
    blocks = blocks_of(read_variables(path), read_mapping(MAPPING))
    assert [(b.quantity, b.point, b.direction, b.force_point, b.hit) for b in blocks] == [
        ("force", 4, 3, 4, 1),
        ("acceleration", 33, -3, 4, 1),
        ("force", 4, 3, 4, 2),
        ("acceleration", 33, -3, 4, 2),
        ("force", 7, 3, 7, 1),
        ("acceleration", 33, -3, 7, 1),
    ]
    np.testing.assert_array_equal(blocks[2].samples, FORCE[1] / 0.5)
    np.testing.assert_array_equal(blocks[5].samples, RESPONSE[2])
    assert {b.sample_rate_hz for b in blocks} == {2048.0}
    assert [b.window_rate_per_s for b in blocks[:2]] == [0.0, 2.0]


@pytest.mark.parametrize(("separator", "point"), [(",", "."), (";", ","), ("\t", ".")])
def test_csv_with_a_time_axis(separator: str, point: str, tmp_path: Path) -> None:
    rows = [
        separator.join(
            f"{v:.9g}".replace(".", point) for v in (i / 2048, FORCE[0, i], RESPONSE[0, i])
        )
        for i in range(256)
    ]
    path = tmp_path / "4_1.csv"
    path.write_text("\n".join([separator.join(("time_s", "force", "acc")), *rows]) + "\n")
    mapping = {
        "sample_rate_hz": {"variable": "time_s"},
        "hit": 2,
        "channels": [{**MAPPING["channels"][0], "point": 4}, MAPPING["channels"][1]],
    }
    blocks = blocks_of(read_variables(path), read_mapping(mapping))
    assert (blocks[0].hit, blocks[0].force_point) == (2, 4)
    assert blocks[0].sample_rate_hz == pytest.approx(2048.0, rel=1e-6)
    np.testing.assert_allclose(blocks[1].samples, RESPONSE[0], rtol=1e-8)


def test_a_proposal_takes_the_hits_and_the_time_axis_and_states_no_rate_that_is_not_there() -> None:
    arrays = {"force": FORCE, "acc": RESPONSE, "hit": np.array([1, 2, 3])}
    assert "sample_rate_hz" not in propose(arrays)
    proposed = propose({**arrays, "time_s": np.arange(256) / 2048})
    assert (proposed["hit"], proposed["sample_rate_hz"]) == (
        {"variable": "hit"},
        {"variable": "time_s"},
    )


def test_a_proposal_takes_an_analysers_channels_by_their_length() -> None:
    """As one analyser names what it exports; which channel is the force only the user knows."""
    ticks = np.arange(4096.0)[:, None] / 1280
    proposed = propose(
        {
            "Time_domain": ticks,
            "Time_chan_1": np.zeros((4096, 1), np.float32),
            "Time_Sample_Rate": np.array([[1280.0]]),
            "Time_chan_2": np.ones((4096, 1), np.float32),
            "PSD_chan_1": np.ones((1601, 1), np.float32),
        }
    )
    assert proposed["sample_rate_hz"] == {"variable": "Time_Sample_Rate"}
    assert [(c["variable"], c["quantity"]) for c in proposed["channels"]] == [
        ("Time_chan_1", None),
        ("Time_chan_2", None),
    ]
    with pytest.raises(
        FormatError, match=r"channels\.0\.quantity: is empty, expected one of force"
    ):
        read_mapping(proposed)


def _named(**changes: Any) -> Variables:
    return {**ARRAYS, **{name: np.asarray(value) for name, value in changes.items()}}


def _with_nan(block: int, sample: int) -> np.ndarray:
    values = FORCE.copy()
    values[block, sample] = np.nan
    return values


def _channel(number: int, **changes: Any) -> dict[str, Any]:
    channels = [dict(channel) for channel in MAPPING["channels"]]
    channels[number].update(changes)
    return {**MAPPING, "channels": channels}


@pytest.mark.parametrize(
    ("variables", "mapping", "text"),
    [
        (ARRAYS, {**MAPPING, "sample_rate_hz": {"variable": "rate"}}, "^rate: is not in the file; it has acc, force"),
        (ARRAYS, {k: v for k, v in MAPPING.items() if k != "sample_rate_hz"}, r"^mapping\.sample_rate_hz: is missing"),
        (_named(fs=0.0), MAPPING, r"^mapping\.sample_rate_hz: .*expected a positive number"),
        (_named(acc=RESPONSE[:, :200]), MAPPING,
         "^mapping.channels: .*force 3 blocks of 256 samples, acc 3 blocks of 200"),
        (_named(force=_with_nan(1, 7)), MAPPING, "^force: .*NaN or infinity, first at sample 8 of block 2"),
        (_named(acc=np.zeros((3, 256))), MAPPING, "^acc: .*carried nothing"),
        (_named(point=[1, 2]), MAPPING, "^point: .*one for each of the 3 blocks"),
        (_named(point=[0, 2, 3]), MAPPING, "^point: .*whole numbers from 1"),
        (ARRAYS, {**MAPPING, "chanels": []}, r"^mapping\.chanels: is unknown"),
        (ARRAYS, {**MAPPING, "channels": MAPPING["channels"][1:]}, r"^mapping\.channels: lack a force; all channels"),
        (ARRAYS, {**MAPPING, "channels": MAPPING["channels"][:1]}, r"^mapping\.channels: lack a response; all channels"),
        (ARRAYS, _channel(0, sensitivity=0), r"^mapping\.channels\.0\.sensitivity: .*more than 0"),
        (_named(fs=2048j), MAPPING, "fs: holds complex numbers"),
        (_named(fs=np.where(np.arange(256) == 9, np.nan, np.arange(256))), MAPPING, "not an evenly rising time axis"),
        (_named(hit=[1, np.nan, 2]), {**MAPPING, "hit": {"variable": "hit"}}, "hit: is no hit: expected whole numbers"),
        (_named(point=[4, np.inf, 7]), MAPPING, "point: is no point"),
        (ARRAYS, _channel(0, sensitivity=1e-320), "look at the sensitivity"),
        (_named(acc=1e308 * np.sign(RESPONSE.astype(float))), MAPPING, "more than any sensor gives"),
        (ARRAYS, _channel(1, variable="force"), "as that of another channel"),
        (_named(acc=FORCE), MAPPING, "the same samples as force"),
        (ARRAYS, _channel(1, point=0), "mapping.point: is no point"),
        (ARRAYS, "force", "mapping: is not an object"),
        (ARRAYS, {**MAPPING, "channels": ["force", "acc"]}, "mapping.channels: is missing, expected a list"),
        (ARRAYS, _channel(1, place=7), "mapping.channels.1.place: is unknown"),
        (ARRAYS, {**MAPPING, "channels": [{"variable": "force"}]},
         "channels.0.quantity: is missing, .*0.point: is missing"),
        (ARRAYS, _channel(1, variable=7), "mapping.channels.1.variable: is 7, expected a name"),
        (ARRAYS, _channel(0, sensitivity="2 mV/g"), "channels.0.sensitivity: is '2 mV/g', expected a number"),
        (
            ARRAYS,
            _channel(0, window_rate_per_s=-1),
            "channels.0.window_rate_per_s: is -1, expected a number, 0 or more",
        ),
        (ARRAYS, _channel(0, point="point"), "channels.0.point: is 'point', expected a number or {\"variable\": name}"),
        (_named(acc=np.zeros((2, 3, 256))), MAPPING, r"acc: has shape \(2, 3, 256\), expected one block or a table"),
        (_named(acc=RESPONSE * 1j), MAPPING, "acc: holds complex numbers: it is no time block; FRFs go to POST frfs"),
        (_named(acc=RESPONSE[:, :63]), MAPPING, "acc: has 63 samples a block, expected 64 or more"),
        (_named(fs=np.arange(100)), MAPPING, "fs: has 100 values, expected the rate or a time axis of 256"),
    ],
)  # fmt: skip
def test_what_cannot_be_right_is_refused_by_its_place(
    variables: Variables, mapping: Any, text: str
) -> None:
    with pytest.raises(FormatError, match=text) as refused:
        blocks_of(variables, read_mapping(mapping))
    assert str(refused.value).startswith(f"{refused.value.place}: ")


def _damaged_npz(path: Path) -> None:
    np.savez_compressed(path, **ARRAYS)
    data = bytearray(path.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 40] = b"\xff" * 40
    path.write_bytes(data)


def _bytes(content: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(content)


def _wav() -> bytes:
    """One of no channels."""
    wavfile.write(stream := io.BytesIO(), 2048, np.stack([FORCE[0], RESPONSE[0]], axis=1))
    return stream.getvalue()[:22] + b"\0\0" + stream.getvalue()[24:]


NO_FILES = (
    b"",
    b"\x00" * 600,
    b"PK\x03\x04 not really",
    b"a,b\n1,2\n3\n",
    b"RIFF\x10\x00\x00\x00WAVE",
)
DAMAGED = [
    (suffix, _bytes(content), None)
    for suffix in (".npz", ".npy", ".mat", ".csv", ".wav")
    for content in NO_FILES
]
DAMAGED += [
    (".npz", _damaged_npz, r"cannot be read(:| as \.npz)"),
    (".wav", _bytes(_wav()), r"cannot be read(:| as \.wav)"),
    (".csv", _bytes(b"\xff\xfeA"), "is not the utf-16 text that it begins as"),
    (".wav", _bytes(b"RIFF" + b"\xff" * 30), r"cannot be read(:| as \.wav)"),
]


@pytest.mark.parametrize(("suffix", "write", "text"), DAMAGED)
def test_damaged_files_are_clear_errors(
    suffix: str, write: Callable[[Path], None], text: str | None, tmp_path: Path
) -> None:
    path = tmp_path / f"damaged{suffix}"
    write(path)
    with pytest.raises(FormatError, match=text):
        read_variables(path)


@pytest.mark.parametrize("write", [_npz, _mat, _mat73])
def test_truncated_files_are_clear_errors(write: Callable[[Path], None], tmp_path: Path) -> None:
    whole = tmp_path / ("whole.npz" if write is _npz else "whole.mat")
    write(whole)
    data = whole.read_bytes()
    for share in (0.1, 0.3, 0.5, 0.7, 0.95):
        cut = tmp_path / f"cut{whole.suffix}"
        cut.write_bytes(data[: int(share * len(data))])
        with pytest.raises(FormatError):
            blocks_of(read_variables(cut), read_mapping(MAPPING))


def test_of_an_npz_nothing_twice_no_pickle_and_no_more_than_allowed_is_taken(
    tmp_path: Path,
) -> None:
    _npz(path := tmp_path / "hits.npz")
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("force.npy", archive.read("force.npy"))
    with pytest.raises(FormatError, match="force: is in the file twice"):
        read_variables(path)
    np.savez(path, force=np.array([{}], dtype=object))
    with pytest.raises(FormatError):
        read_variables(path)
    np.savez_compressed(path, force=np.zeros(1_000_000))
    with pytest.raises(FormatError, match="more than the 1000"):
        read_variables(path, limit_bytes=1000)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("force,acc\n1,2\n1,2,3\n", "line 3: has 3 cells, the table has 2"),
        ("force,acc\n1,2\n\n1,-\n", "line 4, acc: '-' is no number with a decimal"),
        ("force,acc\n", "no line of it holds numbers in columns .* it begins 'force,acc'"),
        ("", "no line of it holds numbers in columns .* it is empty"),
        ("for\0ce,acc\n1,2\n", "holds NUL bytes; it is not text"),
        (
            "PK\3\4" + 26 * " " + "[Content_Types].xml",
            "is a workbook, no text; save its sheet as CSV",
        ),
    ],
)
def test_a_csv_is_refused_by_its_line(tmp_path: Path, text: str, fault: str) -> None:
    (tmp_path / "hit.csv").write_text(text)
    assert recognise(tmp_path / "hit.csv", "hit.csv") == "csv"
    with pytest.raises(FormatError, match=fault):
        read_variables(tmp_path / "hit.csv")
    with pytest.raises(
        FormatError, match=r"is a '.xlsx' file, expected one of .npz, .npy, .mat, .h5, .csv, .wav"
    ):
        read_variables(tmp_path / "hit.xlsx")


def test_of_a_structure_only_numbers_are_taken(tmp_path: Path) -> None:
    """Texts and objects within objects say nothing of a time block; a list of structures has its
    numbers one by one.
    """
    thin = sparse.csc_array(np.eye(3))
    several = np.array([(1.0,), (2.0,)], dtype=[("gain", object)])
    savemat(
        tmp_path / "m.mat",
        {
            "m": {"force": FORCE, "deep": {"fs": 2048.0}, "name": "hit", "s": thin},
            "sensors": several,
            "s": thin,
        },
    )
    variables = read_variables(tmp_path / "m.mat")
    assert variables.keys() == {"m.force", "m.deep.fs", "sensors.gain"}
    assert variables["sensors.gain"].ravel().tolist() == [1.0, 2.0]
    with h5py.File(tmp_path / "m73.mat", "w") as file:
        file["m/force"], file["m/name"], file["#refs#"] = FORCE, np.bytes_("hit"), FORCE
    assert read_variables(tmp_path / "m73.mat").keys() == {"m.force"}


@pytest.mark.parametrize(
    ("write", "missing", "advice"),
    [
        (_mat, "scipy", r"which scipy reads: pip install .modalbase\[server\]"),
        (_mat73, "h5py", "save it with -v7"),
    ],
)
def test_a_library_that_is_not_there_is_named(
    write: Callable[[Path], None],
    missing: str,
    advice: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    write(tmp_path / "hits.mat")
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(FormatError, match=advice):
        read_variables(tmp_path / "hits.mat")


@pytest.mark.parametrize("numbered", [True, False])
def test_blocks_become_one_file_that_gives_them_back(tmp_path: Path, numbered: bool) -> None:
    """Sensors without a name, or with one that `savez` keeps for itself, get a name of their
    own.
    """
    sent = [
        TimeBlock(
            quantity, point, 3, 4, 3, hit, 2048.0, samples[hit - 5].astype(float), label=label
        )
        for hit in (5, 6)
        for quantity, point, samples, label in (
            ("force", 4, FORCE, "file"),
            ("velocity", 33, RESPONSE, ""),
        )
    ]
    content, mapping = arrays_of(sent, numbered=numbered)
    (tmp_path / "hits.npz").write_bytes(content)
    again = blocks_of(read_variables(tmp_path / "hits.npz"), read_mapping(mapping))
    for one, two in zip(again, sent, strict=True):
        np.testing.assert_array_equal(one.samples, two.samples)
        assert (one.quantity, one.point, one.force_point) == (
            two.quantity,
            two.point,
            two.force_point,
        )
        assert one.hit == (two.hit if numbered else two.hit - 4)
    assert [b.label for b in again[:2]] == ["channel_1", "channel_2"]


def test_blocks_of_an_archive_are_taken_as_a_service_kept_them(tmp_path: Path) -> None:
    """In SI whatever their sensitivity, also where a channel carried nothing, with labels and
    starts of their own.
    """
    np.savez(
        tmp_path / "1.npz", force_1=FORCE[:2], acceleration_2=np.zeros_like(FORCE[:2], np.float32)
    )
    force = {"variable": "force_1", "quantity": "force", "point": [1, 2], "sensitivity": 0.5}
    other = {
        "variable": "acceleration_2",
        "quantity": "acceleration",
        "point": 33,
        "label": ["a", "b"],
    }
    document = {"archived": True, "sample_rate_hz": 2048.0, "hit": [4, 7]}
    document["channels"] = [force, {**other, "start_sample": [0, 4096], "direction": [3, -3]}]
    blocks = blocks_of(read_variables(tmp_path / "1.npz"), read_mapping(document))
    assert [(b.force_point, b.hit, b.label, b.start_sample) for b in blocks] == [
        (1, 4, "force_1", None), (1, 4, "a", 0), (2, 7, "force_1", None), (2, 7, "b", 4096),
    ]  # fmt: skip
    assert (blocks[2].samples == FORCE[1]).all()
    assert (blocks[0].sensitivity, blocks[1].samples.dtype, blocks[3].direction) == (
        0.5,
        np.float32,
        -3,
    )
    with pytest.raises(FormatError, match="carried nothing"):
        blocks_of(read_variables(tmp_path / "1.npz"), read_mapping({**document, "archived": False}))
    for wrong, why in (
        ({"archived": 1}, "expected true or false"),
        ({"hit": [4, "7"]}, "expected a number"),
        ({"hit": [4, 5, 6]}, "has 3 values, expected one for each"),
        ({"channels": [force, {**other, "label": "a"}]}, "expected a list of texts"),
        ({"channels": [force, {**other, "label": ["a"]}]}, "has 1 labels for 2 blocks"),
        ({"channels": [force, {**other, "start_sample": [-1, 0]}]}, "whole numbers from 0"),
    ):
        with pytest.raises(FormatError, match=why):
            blocks_of(read_variables(tmp_path / "1.npz"), read_mapping({**document, **wrong}))


def test_half_precision_goes_in_exactly_and_what_would_be_rounded_is_refused(
    tmp_path: Path,
) -> None:
    half = FORCE.astype(np.float16)
    np.savez(tmp_path / "half.npz", **{**ARRAYS, "force": half})
    first, *_ = blocks_of(read_variables(tmp_path / "half.npz"), read_mapping(MAPPING))
    assert first.samples.dtype == np.float64
    sensitivity = next(c["sensitivity"] for c in MAPPING["channels"] if c["variable"] == "force")
    np.testing.assert_array_equal(first.samples, half[0].astype(float) / sensitivity)
    if np.dtype(np.longdouble).itemsize > 8:
        with pytest.raises(
            FormatError, match=r"force: holds numbers of type .* which would be rounded"
        ):
            blocks_of({**ARRAYS, "force": FORCE.astype(np.longdouble)}, read_mapping(MAPPING))
