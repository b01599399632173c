"""A .wav gives what was written, whole or in parts: samples of every width, its rate, its scale,
its length.
"""

import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from modalbase.formats.errors import FormatError
from modalbase.formats.records import blocks_of, read_mapping, read_variables
from modalbase.formats.records.wav import read_wav_head

KINDS = {"<u1": 1, "<i2": 1, "<i3": 1, "<i4": 1, "<f4": 3, "<f8": 3}
VALUES = np.random.default_rng(4).uniform(-0.9, 0.9, (300_000, 2))
FORCE, RESPONSE = np.random.default_rng(1).standard_normal((2, 256)).astype(np.float32)


def samples(values: np.ndarray, kind: str) -> bytes:
    """Frames of samples from -1 to 1."""
    size = int(kind[2])
    if kind[1] == "f":
        return values.astype(kind).tobytes()
    counts = np.round(values * 2.0 ** (8 * size - 1)).astype("<i8")
    if kind[1] == "u":
        return (counts + 128).astype(np.uint8).tobytes()
    return counts.view(np.uint8).reshape(-1, 8)[:, :size].tobytes()


def wav(kind: str, data: bytes, *, long: bool = False) -> bytes:
    """A file of two channels; `long` is RF64, whose sizes stand in a chunk of their own."""
    bits = 8 * int(kind[2])
    form = struct.pack(
        "<4sIHHIIHH", b"fmt ", 16, KINDS[kind], 2, 48_000, 12_000 * bits, bits // 4, bits
    )
    sizes = struct.pack(
        "<4sIQQQI", b"ds64", 28, len(data) + 72, len(data), len(data) * 4 // bits, 0
    )
    head = (
        b"RF64\xff\xff\xff\xffWAVE" + sizes
        if long
        else struct.pack("<4sI4s", b"RIFF", len(data) + 36, b"WAVE")
    )
    return head + form + struct.pack("<4sI", b"data", 0xFFFF_FFFF if long else len(data)) + data


@pytest.fixture
def hit(tmp_path: Path) -> Path:
    """A force and a response."""
    wavfile.write(path := tmp_path / "hit.wav", 2048, np.stack([FORCE, RESPONSE], axis=1))
    return path


@pytest.mark.parametrize("long", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_samples_of_every_width_are_those_that_were_written(
    tmp_path: Path, kind: str, long: bool
) -> None:
    path = tmp_path / "long.wav"
    path.write_bytes(wav(kind, samples(VALUES, kind), long=long))
    head = read_wav_head(path)
    assert (head.channels, head.sample_rate_hz, head.frames, head.declared) == (
        2,
        48_000,
        len(VALUES),
        True,
    )
    chunks = list(head.chunks(head.names))
    assert len(chunks) > 1
    step = 2.0 ** -(8 * int(kind[2]) - 1) if kind[1] != "f" else 0.0
    np.testing.assert_allclose(
        np.concatenate(chunks, axis=1), VALUES.T, rtol=1e-7, atol=step / 2 + 1e-7
    )


@pytest.mark.parametrize(
    ("kind", "data"),
    [("<u1", b"\xff\x00"), ("<i2", b"\xff\x7f\x00\x80"), ("<i3", b"\xff\xff\x7f\x00\x00\x80")],
)
def test_the_largest_sample_of_integers_is_their_full_scale(
    tmp_path: Path, kind: str, data: bytes
) -> None:
    path = tmp_path / "long.wav"
    path.write_bytes(wav(kind, data))
    head = read_wav_head(path)
    (chunk,) = head.chunks(head.names)
    assert (head.full_scale, chunk.min()) == (pytest.approx(float(chunk.max()), abs=1e-7), -1.0)


@pytest.mark.parametrize(("kind", "full"), [("u1", 2**7), ("<i2", 2**15), ("<i4", 2**31)])
def test_integers_go_from_minus_one_to_one(kind: str, full: int, tmp_path: Path) -> None:
    shares = np.array([-1.0, -0.5, 0.0, 0.25, 127 / 128] * 20)
    wavfile.write(
        path := tmp_path / "hit.wav",
        2048,
        (shares * full + (full if kind == "u1" else 0)).astype(kind),
    )
    np.testing.assert_array_equal(read_variables(path)["channel_1"], shares)


def test_it_carries_its_own_rate_and_a_stated_one_that_contradicts_it_is_refused(hit: Path) -> None:
    channels = [
        {"variable": "channel_1", "quantity": "force", "point": 4},
        {"variable": "channel_2", "quantity": "acceleration", "point": 33},
    ]
    for stated, rate in (({"variable": "sample_rate_hz"}, 2048), (2050, 2050)):
        blocks = blocks_of(
            read_variables(hit), read_mapping({"sample_rate_hz": stated, "channels": channels})
        )
        assert blocks[0].sample_rate_hz == rate
        np.testing.assert_array_equal(blocks[0].samples, FORCE.astype(float))
    with pytest.raises(FormatError, match="sample_rate_hz: is 51200, and the file says 2048"):
        blocks_of(
            read_variables(hit), read_mapping({"sample_rate_hz": 51200, "channels": channels})
        )


@pytest.mark.parametrize("declared", [0, 0xFFFFFFFF])
# half a frame, where the recorder was switched off
@pytest.mark.parametrize("more", [b"", b"\x01\x02\x03"])
def test_one_that_declares_no_length_is_read_to_its_end(
    hit: Path, declared: int, more: bytes
) -> None:
    whole = bytearray(hit.read_bytes())
    at = whole.index(b"data") + 4
    whole[at : at + 4] = whole[4:8] = declared.to_bytes(4, "little")
    hit.write_bytes(whole + more)
    head = read_wav_head(hit)
    assert (head.frames, head.declared) == (FORCE.size, False)
    with pytest.warns(UserWarning, match="hit.wav declares no length: it is read to its end"):
        variables = read_variables(hit)
    np.testing.assert_array_equal(variables["channel_2"], RESPONSE)


def test_one_without_samples_is_none_of_those(tmp_path: Path) -> None:
    wavfile.write(path := tmp_path / "hit.wav", 2048, np.zeros((0, 2)))
    path.write_bytes(path.read_bytes() + b"LIST\x04\x00\x00\x00INFO")
    assert set(read_variables(path)) == {"sample_rate_hz"}


def test_one_that_ends_before_its_samples_do_is_refused(hit: Path) -> None:
    hit.write_bytes(hit.read_bytes()[:-1000])
    for read in (read_variables, read_wav_head):
        with pytest.raises(
            FormatError, match="is cut off: it declares 2048 bytes of samples and has 1048"
        ):
            read(hit)
