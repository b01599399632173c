"""A wav of every kind of samples gives what was written, in parts."""

import struct
from pathlib import Path

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.records.wav import read_wav_head

KINDS = {"<u1": 1, "<i2": 1, "<i3": 1, "<i4": 1, "<f4": 3, "<f8": 3}
VALUES = np.random.default_rng(4).uniform(-0.9, 0.9, (300_000, 2))


def written(values: np.ndarray, kind: str) -> bytes:
    """Frames of samples from -1 to 1."""
    size = int(kind[2])
    if kind[1] == "f":
        return values.astype(kind).tobytes()
    counts = np.round(values * 2.0 ** (8 * size - 1)).astype("<i8")
    if kind[1] == "u":
        return (counts + 128).astype(np.uint8).tobytes()
    return counts.view(np.uint8).reshape(-1, 8)[:, :size].tobytes()


def wav(kind: str, data: bytes, *, long: bool = False, declared: int | None = None) -> bytes:
    """A file of two channels; `long` is RF64, whose sizes stand in a chunk of their own."""
    bits, size = 8 * int(kind[2]), len(data) if declared is None else declared
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, KINDS[kind], 2, 48_000, 12_000 * bits, bits // 4, bits)
    sizes = struct.pack("<4sIQQQI", b"ds64", 28, len(data) + 72, len(data), len(data) * 4 // bits, 0)
    head = b"RF64\xff\xff\xff\xffWAVE" + sizes if long else struct.pack("<4sI4s", b"RIFF", len(data) + 36, b"WAVE")
    return head + form + struct.pack("<4sI", b"data", 0xFFFF_FFFF if long else size) + data


@pytest.mark.parametrize("long", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_samples_of_every_width_are_those_that_were_written(tmp_path: Path, kind: str, long: bool) -> None:
    path = tmp_path / "long.wav"
    path.write_bytes(wav(kind, written(VALUES, kind), long=long))
    head = read_wav_head(path)
    assert (head.channels, head.sample_rate_hz, head.frames, head.declared) == (2, 48_000, len(VALUES), True)
    chunks = list(head.chunks(head.names))
    assert len(chunks) > 1
    step = 2.0 ** -(8 * int(kind[2]) - 1) if kind[1] != "f" else 0.0
    np.testing.assert_allclose(np.concatenate(chunks, axis=1), VALUES.T, rtol=1e-7, atol=step / 2 + 1e-7)


def test_the_largest_sample_of_integers_is_their_full_scale(tmp_path: Path) -> None:
    path = tmp_path / "long.wav"
    for kind, data in (("<u1", b"\xff\x00"), ("<i2", b"\xff\x7f\x00\x80"), ("<i3", b"\xff\xff\x7f\x00\x00\x80")):
        path.write_bytes(wav(kind, data))
        head = read_wav_head(path)
        (chunk,) = head.chunks(head.names)
        assert head.full_scale == pytest.approx(float(chunk.max()), abs=1e-7)
        assert chunk.min() == -1.0


@pytest.mark.parametrize("declared", [0, 0xFFFF_FFFF])
def test_a_file_that_declares_no_length_goes_to_its_end_and_says_so(tmp_path: Path, declared: int) -> None:
    path = tmp_path / "long.wav"
    path.write_bytes(wav("<i2", written(VALUES, "<i2") + b"\x07", declared=declared))
    head = read_wav_head(path)
    assert (head.frames, head.declared) == (len(VALUES), False)


def test_a_file_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "long.wav"
    path.write_bytes(wav("<i2", written(VALUES, "<i2"))[:-1000])
    with pytest.raises(FormatError, match="is cut off: it declares 1200000 bytes of samples and has 1199000"):
        read_wav_head(path)
