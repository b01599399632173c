"""What is wrong with a channel of a recording is said before its hits are cut."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from fecore.errors import InputError
from modalbase.formats.errors import FormatError
from modalbase.formats.recognise import recognise
from modalbase.formats.records import propose, read_mapping
from service.compute.recordings import recording_of
from service.tasks.import_file.recordings import Channels, channels_of
from service.tasks.import_file.responses import proposal_of
from tests.support.lengths import long
from tests.support.uff import axis, function
from tests.unit.fecore.signal.test_recording import RATE, recording


def channels(folder: Path, table: np.ndarray, sensitivity: float = 1.0, cut: int = 0) -> Channels:
    """Of a wav of floats whose first column is the response, the second the force."""
    path = folder / "long.wav"
    wavfile.write(path, int(RATE), np.ascontiguousarray(table.T, dtype=np.float32))
    if cut:
        whole = bytearray(path.read_bytes())
        at = whole.index(b"data") + 4
        whole[at : at + 4] = b"\xff\xff\xff\xff"
        path.write_bytes(whole[:-cut])
    mapped = [
        {
            "variable": "channel_1",
            "quantity": "acceleration",
            "point": 33,
            "sensitivity": sensitivity,
        },
        {"variable": "channel_2", "quantity": "force", "point": 4},
        *(
            {"variable": f"channel_{k + 1}", "quantity": "acceleration", "point": 33 + k}
            for k in range(2, len(table))
        ),
    ]
    return channels_of(path, {"recording": {}, "channels": mapped}, path.name, recognise(path))


def blocks_of_channels(own: Channels) -> list[np.ndarray]:
    survey = own.survey()
    return [block.samples for block in own.blocks(survey, own.places(survey.hits))]


WHOLE = recording([1.0, 4.0], [1.0, 0.6], 7.0)[::-1]


ENDLESS = np.where(np.arange(WHOLE.shape[1]) == 3000, np.inf, WHOLE[0])
FAULTS = [
    (np.array([np.full(WHOLE.shape[1], 0.25), WHOLE[1]]), 1.0, r"channel_1 is 0\.25 throughout"),
    (np.array([WHOLE[0], 0 * WHOLE[1]]), 1.0, "channel_2 is 0 throughout"),
    (np.array([WHOLE[1], WHOLE[1]]), 1.0, "channel_1 holds the same samples as channel_2"),
    (np.array([0.37 * WHOLE[1], WHOLE[1]]), 1.0, "channel_1 holds the same samples as channel_2"),
    (np.array([ENDLESS, WHOLE[1]]), 1.0, "NaN or infinity in channel_1 behind sample 3001"),
    (WHOLE, 1e-16, r"reaches .* in SI, more than any sensor gives"),
    (WHOLE, 1e-310, r"reaches .* in SI, more than any sensor gives"),
]


@pytest.mark.parametrize(("table", "sensitivity", "fault"), FAULTS)
def test_what_a_channel_did_is_said_by_the_name_that_the_file_gives_it(
    tmp_path: Path, table: np.ndarray, sensitivity: float, fault: str
) -> None:
    with pytest.raises((InputError, FormatError), match=fault):
        channels(tmp_path, table, sensitivity).survey()


def test_two_sensors_that_see_nearly_the_same_are_no_copies(tmp_path: Path) -> None:
    beside = WHOLE[0] + 1e-4 * np.random.default_rng(3).standard_normal(WHOLE.shape[1])
    assert len(channels(tmp_path, np.array([*WHOLE, beside])).survey().hits) == 2


def test_a_recording_that_declares_no_length_says_that_it_may_be_cut_off(tmp_path: Path) -> None:
    own = channels(tmp_path, WHOLE, cut=400)
    assert any("declares no length" in note for note in own.notes(own.survey()))


AXIS = np.arange(WHOLE.shape[1]) / RATE


def two_channels(response: str, force: str, **more: object) -> list[dict[str, object]]:
    return [
        {"variable": response, "quantity": "acceleration", "point": 33, **more},
        {"variable": force, "quantity": "force", "point": 4},
    ]


def written(folder: Path, suffix: str) -> Path:
    """`WHOLE` as arrays `acc` and `force` with a rate or a time axis."""
    path, (acc, force) = folder / f"long{suffix}", WHOLE
    if suffix == ".npz":
        np.savez(path, acc=acc, force=force, fs=RATE)
    elif suffix == ".mat":
        savemat(path, {"acc": acc[:, np.newaxis], "force": force[np.newaxis], "fs": RATE})
    elif suffix == ".csv":
        np.savetxt(
            path,
            np.column_stack((AXIS, acc, force)),
            "%.17g",
            ",",
            header="fs,acc,force",
            comments="",
        )
    elif suffix == " matrix.npz":
        np.savez(path, hits=WHOLE, fs=RATE)
    elif suffix == " matrix.mat":
        savemat(path, {"hits": WHOLE.T, "fs": RATE})
    elif suffix in (".npy", " by columns.npy"):
        order = "F" if "columns" in suffix else "C"
        np.save(path, np.asarray(np.column_stack((AXIS, *WHOLE)), order=order))
    else:
        content = b""
        for kind, unit, point, samples in ((12, "m/s^2", 33, acc), (13, "N", 4, force)):
            sampling = {
                "abscissa": axis(17, "s"),
                "ordinate": axis(kind, unit),
                "step": f"{1 / RATE:13.5e}",
            }
            content += function(1, samples, response=(point, 3), reference=(0, 0), **sampling)
        path.write_bytes(content)
    return path


NAMES = {
    ".uff": ("acceleration_33_3", "force_4_3"),
    " matrix.npz": ("hits column 1", "hits column 2"),
    " matrix.mat": ("hits column 1", "hits column 2"),
    ".npy": ("array column 2", "array column 3"),
    " by columns.npy": ("array column 2", "array column 3"),
}


@pytest.mark.parametrize("suffix", [".npz", ".mat", long(".csv"), *NAMES])
def test_arrays_that_go_on_over_many_hits_are_cut_as_a_wav_is(tmp_path: Path, suffix: str) -> None:
    own = blocks_of_channels(channels(tmp_path, WHOLE))
    names = NAMES.get(suffix, ("acc", "force"))
    mapped = two_channels(*names)
    axis = "array column 1" if suffix.endswith(".npy") else "fs"
    rate = {} if suffix == ".uff" else {"sample_rate_hz": {"variable": axis}}
    path = written(tmp_path, suffix)
    seen = channels_of(
        path, {"recording": {}, "channels": mapped, **rate}, path.name, recognise(path)
    )
    np.testing.assert_allclose(blocks_of_channels(seen), own, rtol=1e-6, atol=1e-6)
    if suffix != ".uff":
        with pytest.raises(FormatError, match="sample_rate_hz: is missing"):
            channels_of(path, {"recording": {}, "channels": mapped}, path.name, recognise(path))
    with pytest.raises(FormatError, match=f"is 'b'; the file has .*{names[1]}"):
        channels_of(
            path,
            {"recording": {}, "channels": [{**mapped[0], "variable": "b"}, mapped[1]], **rate},
            path.name,
            recognise(path),
        )


def test_arrays_of_unlike_length_and_single_hits_of_a_uff_are_no_recording(tmp_path: Path) -> None:
    np.savez(path := tmp_path / "long.npz", acc=WHOLE[0][:-1], force=WHOLE[1])
    mapped = two_channels("acc", "force")
    with pytest.raises(
        FormatError, match=r"acc: is float64 .*, expected 14336 real numbers as force"
    ):
        channels_of(
            path,
            {"recording": {}, "channels": mapped, "sample_rate_hz": RATE},
            path.name,
            recognise(path),
        )
    twice = written(tmp_path, ".uff")
    twice.write_bytes(2 * twice.read_bytes())
    with pytest.raises(
        FormatError, match="acceleration_33_3: is in the file several times: as single hits"
    ):
        channels_of(twice, {"recording": {}, "channels": mapped}, twice.name, recognise(twice))


@pytest.mark.parametrize(
    ("channel", "fault"),
    [
        ({"point": -3}, r"channels\.0\.point: is -3\.0, expected a whole number from 1"),
        (
            {"point": 1e30},
            r"channels\.0\.point: is 1e\+30, expected a whole number from 1 to 9999999999",
        ),
        ({"point": {"variable": "x"}}, r"channels\.0\.point: is 'x', expected a whole number"),
        ({"direction": 7}, r"channels\.0\.direction: is 7\.0, expected ±1 to ±6"),
        ({"direction": 0}, r"channels\.0\.direction: is 0\.0, expected ±1 to ±6"),
        ({"window_rate_per_s": 1}, "is of blocks; a recording has no window"),
    ],
)
def test_what_a_channel_cannot_be_is_named(
    tmp_path: Path, channel: dict[str, object], fault: str
) -> None:
    own = channels(tmp_path, WHOLE)
    mapped = two_channels("channel_1", "channel_2", **channel)
    with pytest.raises(FormatError, match=fault):
        channels_of(own.file.path, {"recording": {}, "channels": mapped}, "long.wav", "wav")


def test_a_matrix_of_channels_is_proposed_column_by_column(tmp_path: Path) -> None:
    """Also where the file has a unit in the name of the matrix, and the time in its first column."""
    np.savez(tmp_path / "g.npz", acc_g=WHOLE.T)
    file = recording_of(tmp_path / "g.npz", "npz")
    channels = proposal_of(file)["channels"]
    assert [channel["variable"] for channel in channels] == ["acc_g column 1", "acc_g column 2"]
    mapping = {"channels": two_channels("acc_g column 1", "f"), "sample_rate_hz": RATE}
    assert read_mapping(mapping).channels[0].sensitivity == pytest.approx(1 / 9.80665)
    by_columns = recording_of(written(tmp_path, " by columns.npy"), "npy")
    assert proposal_of(by_columns)["sample_rate_hz"] == {"variable": "array column 1"}
    one_hit = propose({"hit": np.column_stack((AXIS, *WHOLE))})
    assert [c["variable"] for c in one_hit["channels"]] == ["hit column 2", "hit column 3"]
    assert one_hit["sample_rate_hz"] == {"variable": "hit column 1"}
    np.savez(tmp_path / "cube.npz", data=np.zeros((100, 3, 4)))
    with pytest.raises(FormatError, match="or a matrix with a column a channel"):
        recording_of(tmp_path / "cube.npz", "npz")
