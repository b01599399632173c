"""A wav of any length, chunk by chunk."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import NO_NUMBERS, SAMPLE_RATE, sampling_rate
from modalbase.formats.types import FloatArray

FRAMES = 1 << 17
"""Of a chunk."""
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_KINDS = ("u1", "i2", "i3", "i4", "i8", "f4", "f8")
_MOST_WORDS = 1 << 16  # bytes of a list
_UNKNOWN_LENGTH = 0xFFFF_FFFF
"""Size that a recorder declares, or 0, which writes its file as it measures and never comes back to
the head.
"""


@dataclass(frozen=True)
class Wav:
    """The head of a wav.

    Attributes:
        path: of the file.
        channels: in each frame.
        sample_rate_hz: frames a second.
        kind: such as `u1`, `i2`, `i3` or `f4`, with its byte order before it.
        begin: byte where the frames begin.
        frames: how many there are.
        declared: whether the file says so itself.
    """

    path: Path
    channels: int
    sample_rate_hz: float
    kind: str
    begin: int
    frames: int
    declared: bool = True

    rate, began, is_table, numbers = SAMPLE_RATE, None, False, NO_NUMBERS

    def notes(self, _: Sequence[str]) -> list[str]:
        """Nothing is noticed of its channels."""
        return []

    @property
    def units(self) -> dict[str, str]:
        """A wav states none."""
        return {}

    @property
    def full_scale(self) -> float | None:
        """Largest sample that integers have; floating point has none."""
        return None if self.kind[1] == "f" else 1 - 2.0 ** (1 - 8 * int(self.kind[2]))

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return [f"channel_{row + 1}" for row in range(self.channels)]

    def shapes(self) -> dict[str, str]:
        """Type and shape of each channel."""
        return dict.fromkeys(self.names, f"float32 [{self.frames}]")

    def rate_of(self, _: Sequence[str], stated: float | str) -> float:
        """Rate of all channels.

        Raises:
            FormatError: another is stated.
        """
        return sampling_rate({SAMPLE_RATE: np.array(self.sample_rate_hz)}, stated, self.frames)

    def chunks(
        self, names: Sequence[str], kind: type[np.floating] = np.float32
    ) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, from -1 to 1 where the samples are
        integers.
        """
        places = {name: row for row, name in enumerate(self.names)}
        rows = [places[name] for name in names]
        size = int(self.kind[2]) * self.channels
        with self.path.open("rb") as file:
            file.seek(self.begin)
            for first in range(0, self.frames, FRAMES):
                raw = file.read(min(FRAMES, self.frames - first) * size)
                yield np.ascontiguousarray(
                    _decoded(raw, self.kind, kind).reshape(-1, self.channels).T[rows]
                )


def _decoded(raw: bytes, kind: str, dtype: type[np.floating]) -> FloatArray:
    if kind[1:] == "i3":
        order = slice(None) if kind[0] == "<" else slice(None, None, -1)
        whole = np.zeros((len(raw) // 3, 4), dtype=np.uint8)
        whole[:, 1:] = np.frombuffer(raw, np.uint8).reshape(-1, 3)[:, order]
        return _decoded(whole.tobytes(), "<i4", dtype)
    values = np.frombuffer(raw, kind).astype(dtype)
    if kind[1] == "f":
        return values
    half = dtype(2.0 ** (8 * int(kind[2]) - 1))
    return np.asarray((values - half if kind[1] == "u" else values) / half)


def read_wav_head(path: Path) -> Wav:
    """What a wav says of itself. One without a declared length goes to the file's end.

    Raises:
        FormatError: it is no wav, of another kind of samples, or cut off.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        mark = file.read(12)
        if mark[:4] not in (b"RIFF", b"RIFX", b"RF64") or mark[8:] != b"WAVE":
            raise FormatError(
                "",
                f"cannot be read as .wav: it begins with {mark!r}, expected RIFF, RIFX or RF64, and"
                " WAVE",
            )
        order: Literal["little", "big"] = "big" if mark[:4] == b"RIFX" else "little"
        form, long = b"", 0
        while len(head := file.read(8)) == 8:
            declared, begin = int.from_bytes(head[4:], order), file.tell()
            if head[:4] == b"ds64":  # the lengths of an RF64
                long = int.from_bytes(file.read(16)[8:], order)
            elif head[:4] == b"fmt ":
                form = file.read(min(declared, 40))
            elif head[:4] == b"data" and len(form) >= 16:
                left = size - begin
                if declared == _UNKNOWN_LENGTH and long:
                    declared = long
                open_ended = declared == _UNKNOWN_LENGTH or (
                    declared == 0 and not _are_chunks(file, left, order)
                )
                declared = left if open_ended else declared
                if declared > left:
                    why = (
                        f"is cut off: it declares {declared} bytes of samples and has {left}; copy"
                        " it again"
                    )
                    raise FormatError("", why)
                return replace(_head(path, form, order, begin, declared), declared=not open_ended)
            file.seek(begin + declared + declared % 2)
    raise FormatError("", "cannot be read as .wav: it has no format or no samples")


def wav_texts(path: Path, _most_bytes: int) -> dict[str, str]:
    """When a wav was recorded, as its chunk of broadcasters (`bext`) or its list `INFO` says."""
    texts = {}
    with path.open("rb") as file:
        order: Literal["little", "big"] = "big" if file.read(12)[:4] == b"RIFX" else "little"
        while len(head := file.read(8)) == 8:
            length, begin = int.from_bytes(head[4:], order), file.tell()
            if head[:4] == b"bext":
                own = file.read(min(length, 338))
                texts["recording date"] = _words(own[320:330]) + " " + _words(own[330:338])
            elif head[:4] == b"LIST" and (own := file.read(min(length, _MOST_WORDS))):
                while len(own := own[4:]) > 8:
                    size = int.from_bytes(own[4:8], order)
                    texts[_words(own[:4])] = _words(own[8 : 8 + size])
                    own = own[4 + size + size % 2 :]
            file.seek(begin + length + length % 2)
    return texts


def _words(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("latin-1").strip()


def _head(path: Path, form: bytes, order: Literal["little", "big"], begin: int, length: int) -> Wav:
    places = ((0, 2), (2, 4), (4, 8), (8, 12), (12, 14), (14, 16))
    tag, channels, rate, flow, frame, bits = (int.from_bytes(form[a:b], order) for a, b in places)
    if tag == _EXTENSIBLE:
        tag = int.from_bytes(form[24:26], order)
    size = (bits + 7) // 8
    kind = {_PCM: "u1" if size == 1 else f"i{size}", _FLOAT: f"f{size}"}.get(tag)
    if kind not in _KINDS:
        raise FormatError(
            "", f"has samples of {bits} bits in format {tag}, expected PCM or floating point"
        )
    if not channels or not rate:
        raise FormatError("", f"cannot be read as .wav: it has {channels} channels at {rate} Hz")
    if tag == _PCM and (frame != size * channels or flow != rate * frame):
        claims = (
            f"{rate} frames of {channels} times {bits} bits a second, {frame} bytes a frame and"
            f" {flow} bytes a second"
        )
        raise FormatError("", f"cannot be read as .wav: its head is damaged, which says {claims}")
    kind = ("<" if order == "little" else ">") + kind
    return Wav(path, channels, float(rate), kind, begin, length // (size * channels))


def _are_chunks(file: BinaryIO, left: int, order: Literal["little", "big"]) -> bool:
    """Whether the rest of a file is chunks to its very end, so that those before them are as long
    as they declare.
    """
    while left >= 8:
        length = int.from_bytes(file.read(8)[4:], order)
        length += length % 2
        file.seek(length, 1)
        left -= 8 + length
    return left == 0
