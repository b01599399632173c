"""A recording whose channels are arrays of an npz, columns of its matrices, or columns of an npy,
part by part: memory holds none of them whole.
"""

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.factors import factors_among
from modalbase.formats.npy import ARRAY, Head, arrays_of, head_of, named, read_array
from modalbase.formats.records.arrays import (
    Variables,
    axis_rate,
    channels_of,
    rate_among,
    real,
    require_one_clock,
    sampling_rate,
    single_numbers,
)
from modalbase.formats.records.proposal import units_beside
from modalbase.formats.records.wav import FRAMES
from modalbase.formats.types import FloatArray

_SMALL = 1000  # elements up to which an array is read whole


@dataclass(frozen=True)
class Channel:
    """Where the samples of a channel lie in an array of a file."""

    array: str  # its name
    dtype: np.dtype[Any]
    length: int  # of the channel
    first: int = 0  # elements before its first sample
    step: int = 1  # from a sample to the next


@dataclass(frozen=True)
class NpzRecording:
    """The heads of the arrays of an npz or npy.

    Attributes:
        path: of the file.
        channels: arrays of numbers of one dimension, and columns of those of two.
        small: arrays that are read whole: the rate, texts.
    """

    path: Path
    channels: dict[str, Channel]
    small: Variables

    full_scale, declared, began, is_table = None, True, None, False

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return list(self.channels)

    @cached_property
    def units(self) -> dict[str, str]:
        """That texts of the file state, by channel."""
        texts = {
            name: "\n".join(str(one).strip() for one in np.ravel(array))
            for name, array in self.small.items()
            if array.dtype.kind == "U"
        }
        return units_beside(self.channels, texts | factors_among(self.small))

    @property
    def numbers(self) -> Variables:
        """The variables that are one number."""
        return single_numbers(self.small)

    @property
    def rate(self) -> str | None:
        """Name of the single number that is the sampling rate."""
        return rate_among(name for name, array in self.small.items() if array.size == 1)

    def shapes(self) -> dict[str, str]:
        """Type and shape of each channel."""
        return {name: f"{own.dtype} [{own.length}]" for name, own in self.channels.items()}

    def notes(self, _: Sequence[str]) -> list[str]:
        """Nothing is noticed of its channels."""
        return []

    def rate_of(self, names: Sequence[str], stated: float | str) -> float:
        """Rate of these channels: a number, or the array or time axis that states it.

        Raises:
            FormatError: they differ in length or hold no real numbers, or it is no rate.
        """
        require_one_clock(self.small, names)
        length = self.channels[names[0]].length
        for name in names:
            own = self.channels[name]
            if own.length != length or own.dtype.kind == "c":
                why = f"is {own.dtype} [{own.length}], expected {length} real numbers as {names[0]}"
                raise FormatError(name, why)
        numbers = {name: array for name, array in self.small.items() if array.dtype.kind in "fiuc"}
        axis = self.channels.get(stated) if isinstance(stated, str) else None
        if axis is not None and axis.length == length:
            parts = (part[0] for part in self.chunks([cast("str", stated)]))
            return axis_rate(cast("str", stated), parts, length, self.units)
        return sampling_rate(numbers, stated, length, self.units)

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file. Columns that lie
        side by side are read together.

        Raises:
            FormatError: an array is damaged or cut short; names it.
        """
        own = [self.channels[name] for name in names]
        kind = np.result_type(np.float32, *(channel.dtype for channel in own))
        # 1. a stream for what lies together: a channel, or all columns of a matrix
        at = [(channel.array, channel.first if channel.step == 1 else 0) for channel in own]
        with ExitStack() as files:
            streams = dict[tuple[str, int], IO[bytes]]()
            for (name, first), channel in zip(at, own, strict=True):
                if (name, first) not in streams:
                    stream = streams[name, first] = _open(self.path, name, files)
                    with named(name):
                        head_of(stream)
                        stream.seek(stream.tell() + first * channel.dtype.itemsize)
            # 2. part by part
            left, frames = own[0].length, max(FRAMES // max(channel.step for channel in own), 1024)
            while left:
                count = min(left, frames)
                parts = dict[tuple[str, int], np.ndarray[Any, Any]]()
                for key, channel in zip(at, own, strict=True):
                    if key not in parts:
                        size = count * channel.step
                        parts[key] = _read(key[0], streams[key], channel.dtype, size)
                rows = [
                    real(parts[key][channel.first if channel.step > 1 else 0 :: channel.step], name)
                    for key, channel, name in zip(at, own, names, strict=True)
                ]
                yield np.array(rows, kind)
                left -= count


def open_npz(path: Path) -> NpzRecording:
    """The heads of the arrays of an npz, and its small ones.

    Raises:
        FormatError: the file is damaged, or holds no channel.
    """
    channels: dict[str, Channel] = {}
    small: Variables = {}
    with named(""), zipfile.ZipFile(path) as archive:
        for name, member in arrays_of(archive).items():
            with named(name), archive.open(member) as stream:
                head = head_of(stream)
                channels |= _channels(name, head, member.file_size - stream.tell())
            if head.size <= _SMALL and head.dtype.kind in "fiucU":
                small[name] = read_array(archive, member)
    return _recording(path, channels, small)


def open_npy(path: Path) -> NpzRecording:
    """The head of the array of an npy.

    Raises:
        FormatError: the file is damaged, or holds no channel.
    """
    with named(""), path.open("rb") as stream:
        channels = _channels(ARRAY, head_of(stream), path.stat().st_size - stream.tell())
    return _recording(path, channels, {})


def _recording(path: Path, channels: dict[str, Channel], small: Variables) -> NpzRecording:
    if not channels:
        raise FormatError(
            "",
            "holds no channel: expected an array of numbers, or a matrix with a column a channel",
        )
    return NpzRecording(path, channels, small)


def _channels(name: str, head: Head, present: int) -> dict[str, Channel]:
    """Those of an array of so many bytes: itself, or its columns."""
    sides = [int(n) for n in head.shape if n != 1]
    names = channels_of(name, sides)
    if head.dtype.kind not in "fiuc" or not names:
        return {}
    head.require_present(name, present)
    if len(sides) == 1:
        return {name: Channel(name, head.dtype, sides[0])}
    length, count = max(sides), len(names)
    # the last axis lies together, or the first
    together = (sides[0] >= sides[1]) is head.columns_first
    return {
        own: Channel(name, head.dtype, length, *((k * length, 1) if together else (k, count)))
        for k, own in enumerate(names)
    }


def _open(path: Path, name: str, files: ExitStack) -> IO[bytes]:
    """The bytes of an array with its head."""
    if not zipfile.is_zipfile(path):
        return files.enter_context(path.open("rb"))
    archive = files.enter_context(zipfile.ZipFile(path))
    return files.enter_context(archive.open(f"{name}.npy"))


def _read(name: str, stream: IO[bytes], dtype: np.dtype[Any], count: int) -> np.ndarray[Any, Any]:
    with named(name):
        data = stream.read(count * dtype.itemsize)
    if len(data) < count * dtype.itemsize:
        raise FormatError(name, "is cut short")
    return np.frombuffer(data, dtype)
