"""A recording of many hits, chunk by chunk: a wav of any length, arrays of a file; and what a mapping says of its hits.

    {"recording": {"order": [{"point": 4, "hits": 3}, {"point": 5, "direction": -3, "hits": 3}]}, "channels": [...]}

The order is that in which the points were hit. `"order": "filename"` takes the point from the file's name, `point_4.wav`;
without an order all hits are at the point of the force channel.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.mapping import MOST_POINT, sampling_rate
from modalbase.formats.records.variables import SAMPLE_RATE, UNKNOWN_LENGTH, Variables, are_chunks, described
from modalbase.formats.types import FloatArray

_FRAMES = 1 << 17
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_POINT = re.compile(r"(?:point|pt|p)[ _-]?(\d+)(?!\d)", re.IGNORECASE)
_MOST_HITS = 100_000
_RECORDING = "mapping.recording"


@dataclass(frozen=True)
class Wav:
    """The head of a wav.

    Attributes:
        path: of the file.
        channels: in each frame.
        sample_rate_hz: frames a second.
        kind: `u1`, `i2`, `i3`, `i4`, `f4` or `f8`, with its byte order before it.
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

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) float32 parts of these channels in order, from -1 to 1 where the samples are integers."""
        rows = [self.names.index(name) for name in names]
        size = int(self.kind[2]) * self.channels
        with self.path.open("rb") as file:
            file.seek(self.begin)
            for first in range(0, self.frames, _FRAMES):
                raw = file.read(min(_FRAMES, self.frames - first) * size)
                yield np.ascontiguousarray(_decoded(raw, self.kind).reshape(-1, self.channels).T[rows])


@dataclass(frozen=True)
class Arrays:
    """A recording whose channels are arrays of one dimension, of an npz, a .mat or a CSV.

    Attributes:
        variables: all arrays of the file.
    """

    variables: Variables
    full_scale, declared = None, True

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return [name for name, array in self.variables.items() if array.size > 1 and np.squeeze(array).ndim == 1]

    def shapes(self) -> dict[str, str]:
        """Type, shape and extremes of each channel."""
        return {name: described(self.variables[name]) for name in self.names}

    def rate_of(self, names: Sequence[str], stated: float | str) -> float:
        """Rate of these channels: a number, or the variable or time axis that states it.

        Raises:
            FormatError: they differ in length, or it is no rate.
        """
        length = self.variables[names[0]].size
        for name in names:
            if self.variables[name].size != length or self.variables[name].dtype.kind == "c":
                raise FormatError(
                    name, f"is {described(self.variables[name])}, expected {length} real numbers as {names[0]}"
                )
        return sampling_rate(self.variables, stated, length)

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file."""
        rows = [np.ravel(self.variables[name]) for name in names]
        kind = np.result_type(np.float32, *rows)
        for first in range(0, rows[0].size, _FRAMES):
            yield np.array([row[first : first + _FRAMES] for row in rows], dtype=kind)


def _decoded(raw: bytes, kind: str) -> FloatArray:
    if kind[1:] == "i3":
        order = slice(None) if kind[0] == "<" else slice(None, None, -1)
        whole = np.zeros((len(raw) // 3, 4), dtype=np.uint8)
        whole[:, 1:] = np.frombuffer(raw, np.uint8).reshape(-1, 3)[:, order]
        return _decoded(whole.tobytes(), "<i4")
    values = np.frombuffer(raw, kind).astype(np.float32)
    if kind[1] != "f":
        half = np.float32(2.0 ** (8 * int(kind[2]) - 1))
        values = (values - half if kind[1] == "u" else values) / half
    return values


def read_wav_head(path: Path) -> Wav:
    """What a wav says of itself. One without a declared length goes to the file's end.

    Raises:
        FormatError: it is no wav, of another kind of samples, or cut off.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        mark = file.read(12)
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
                if declared == UNKNOWN_LENGTH and long:
                    declared = long
                open_ended = declared == UNKNOWN_LENGTH or (declared == 0 and not are_chunks(file, left, order))
                declared = left if open_ended else declared
                if declared > left:
                    why = f"is cut off: it declares {declared} bytes of samples and has {left}; copy it again"
                    raise FormatError("", why)
                return replace(_head(path, form, order, begin, declared), declared=not open_ended)
            file.seek(begin + declared + declared % 2)
    raise FormatError("", "cannot be read as .wav: it has no format or no samples")


def _head(path: Path, form: bytes, order: Literal["little", "big"], begin: int, length: int) -> Wav:
    tag, channels, rate, bits = (int.from_bytes(form[a:b], order) for a, b in ((0, 2), (2, 4), (4, 8), (14, 16)))
    if tag == _EXTENSIBLE:
        tag = int.from_bytes(form[24:26], order)
    kinds = {
        (_PCM, 8): "u1",
        (_PCM, 16): "i2",
        (_PCM, 24): "i3",
        (_PCM, 32): "i4",
        (_FLOAT, 32): "f4",
        (_FLOAT, 64): "f8",
    }
    kind = kinds.get((tag, bits))
    if kind is None:
        raise FormatError("", f"has samples of {bits} bits in format {tag}, expected PCM or floating point")
    if not channels or not rate:
        raise FormatError("", f"has {channels} channels at {rate} Hz")
    return Wav(
        path, channels, float(rate), ("<" if order == "little" else ">") + kind, begin, length // (bits // 8 * channels)
    )


@dataclass(frozen=True)
class Recording:
    """What a mapping says of a recording.

    Attributes:
        order: point, direction and number of hits, in the order of the hits; empty where all are at the force's point.
        least_force: of a hit, N; None where the recording shows it.
    """

    order: tuple[tuple[int, int, int], ...] = ()
    least_force: float | None = None


def read_recording(document: dict[str, Any], filename: str, direction: int = 3) -> Recording:
    """What the member `recording` of a mapping says.

    Args:
        document: of the member.
        filename: of the recording.
        direction: of the hits whose entry states none.

    Raises:
        FormatError: names the field that is unknown or wrong.
    """
    if not isinstance(document, dict):
        raise FormatError(_RECORDING, "is not an object")
    if unknown := sorted(document.keys() - {"order", "least_force"}):
        raise FormatError([(f"{_RECORDING}.{name}", "is unknown") for name in unknown])
    least, given = document.get("least_force"), document.get("order", [])
    if least is not None and (isinstance(least, bool) or not isinstance(least, int | float) or not 0 < least < np.inf):
        raise FormatError(f"{_RECORDING}.least_force", f"is {least!r}, expected a force in N above 0")
    if given == "filename":
        return Recording(((_point_of(filename), direction, 0),), least)
    if not isinstance(given, list):
        raise FormatError(f"{_RECORDING}.order", 'is no list of points, nor "filename"')
    return Recording(tuple(_entry(i, entry, direction) for i, entry in enumerate(given)), least)


def _entry(number: int, entry: Any, direction: int) -> tuple[int, int, int]:
    place = f"{_RECORDING}.order.{number}"
    if not isinstance(entry, dict) or not {"point", "hits"} <= entry.keys() <= {"point", "hits", "direction"}:
        raise FormatError(place, "is not {point, hits} with or without direction")
    found = entry["point"], entry.get("direction", direction), entry["hits"]
    if any(isinstance(n, bool) or not isinstance(n, int) for n in found):
        raise FormatError(place, "has a point, direction or number of hits that is no whole number")
    if not (1 <= found[0] <= MOST_POINT and 1 <= abs(found[1]) <= 6 and 1 <= found[2] <= _MOST_HITS):
        raise FormatError(
            place, f"is no place to hit: expected point and hits from 1 (to {_MOST_HITS}), direction ±1 to ±6"
        )
    return found


def _point_of(filename: str) -> int:
    """The number behind `point` or `p` in a file's name, or the only number in it."""
    stem = PurePosixPath(filename).stem
    found = _POINT.findall(stem) or re.findall(r"\d+", stem)
    if len(found) != 1 or int(found[0]) < 1:
        raise FormatError(
            f"{_RECORDING}.order", f"cannot take the point from the name {filename!r}; expected one such as point_4.wav"
        )
    return int(found[0])
