"""A .wav as time blocks: its rate, its scale, its length."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from modalbase.formats.errors import FormatError
from modalbase.formats.records import blocks_of, read_mapping, read_variables

FORCE, RESPONSE = np.random.default_rng(1).standard_normal((2, 256)).astype(np.float32)


def written(path: Path) -> None:
    wavfile.write(path, 2048, np.stack([FORCE, RESPONSE], axis=1))


def test_wav_carries_its_own_rate_and_a_stated_one_that_contradicts_it_is_refused(tmp_path: Path) -> None:
    written(path := tmp_path / "hit.wav")
    channels = [
        {"variable": "channel_1", "quantity": "force", "point": 4},
        {"variable": "channel_2", "quantity": "acceleration", "point": 33},
    ]
    for stated, rate in (({"variable": "sample_rate_hz"}, 2048), (2050, 2050)):
        blocks = blocks_of(read_variables(path), read_mapping({"sample_rate_hz": stated, "channels": channels}))
        assert blocks[0].sample_rate_hz == rate
        np.testing.assert_array_equal(blocks[0].samples, FORCE.astype(float))
    with pytest.raises(FormatError, match="sample_rate_hz: is 51200, and the file says 2048"):
        blocks_of(read_variables(path), read_mapping({"sample_rate_hz": 51200, "channels": channels}))


@pytest.mark.parametrize(("kind", "full"), [("u1", 2**7), ("<i2", 2**15), ("<i4", 2**31)])
def test_integers_of_a_wav_go_from_minus_one_to_one(kind: str, full: int, tmp_path: Path) -> None:
    path = tmp_path / "hit.wav"
    shares = np.array([-1.0, -0.5, 0.0, 0.25, 127 / 128] * 20)
    wavfile.write(path, 2048, (shares * full + (full if kind == "u1" else 0)).astype(kind))
    np.testing.assert_array_equal(read_variables(path)["channel_1"], shares)


@pytest.mark.parametrize("declared", [0, 0xFFFFFFFF])
@pytest.mark.parametrize("more", [b"", b"\x01\x02\x03"])  # half a frame, where the recorder was switched off
def test_a_wav_that_declares_no_length_is_read_to_its_end(tmp_path: Path, declared: int, more: bytes) -> None:
    path, samples = tmp_path / "hit.wav", np.stack([FORCE, RESPONSE], axis=1)
    wavfile.write(path, 2048, samples)
    whole = bytearray(path.read_bytes())
    at = whole.index(b"data") + 4
    whole[at : at + 4] = whole[4:8] = declared.to_bytes(4, "little")
    path.write_bytes(whole + more)
    with pytest.warns(UserWarning, match="hit.wav declares no length: it is read to its end"):
        found = read_variables(path)
    np.testing.assert_array_equal(found["channel_2"], samples[:, 1])


def test_a_wav_without_samples_is_none_of_those(tmp_path: Path) -> None:
    path = tmp_path / "hit.wav"
    wavfile.write(path, 2048, np.zeros((0, 2)))
    path.write_bytes(path.read_bytes() + b"LIST\x04\x00\x00\x00INFO")
    assert set(read_variables(path)) == {"sample_rate_hz"}


@pytest.mark.parametrize("left", [64, 200])
def test_a_wav_that_ends_before_its_samples_do_is_refused(tmp_path: Path, left: int) -> None:
    written(path := tmp_path / "hit.wav")
    read_variables(path)
    data = path.read_bytes()
    frame = 2 * FORCE.itemsize
    path.write_bytes(data[: len(data) - (FORCE.size - left) * frame])
    with pytest.raises(FormatError, match=rf"is cut off: it declares {FORCE.size * frame} bytes"):
        read_variables(path)
