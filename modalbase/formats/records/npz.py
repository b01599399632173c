"""A recording whose channels are arrays of an npz, part by part: memory holds none of them whole."""

import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from modalbase.formats.errors import FormatError
from modalbase.formats.npy import HEADERS, members_of, read_array
from modalbase.formats.records.arrays import (
    SAMPLE_RATE,
    Variables,
    axis_rate,
    real,
    sampling_rate,
)
from modalbase.formats.records.wav import FRAMES
from modalbase.formats.types import FloatArray
from modalbase.formats.units import unit_beside

_SMALL = 1000  # elements up to which an array is read whole


@dataclass(frozen=True)
class NpzRecording:
    """The heads of the arrays of an npz.

    Attributes:
        path: of the file.
        kinds: type and length of each array of numbers of one dimension that is no single number.
        small: arrays that are read whole: the rate, texts.
    """

    path: Path
    kinds: dict[str, tuple[np.dtype[Any], int]]
    small: Variables

    full_scale, declared = None, True

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return list(self.kinds)

    @cached_property
    def units(self) -> dict[str, str]:
        """That texts of the file state, by channel."""
        texts = {
            name: "\n".join(str(one).strip() for one in np.ravel(array))
            for name, array in self.small.items()
            if array.dtype.kind == "U"
        }
        return {name: unit for name in self.kinds if (unit := unit_beside(name, texts))}

    @property
    def has_rate(self) -> bool:
        """Whether the file states the sampling rate."""
        return SAMPLE_RATE in self.small

    def shapes(self) -> dict[str, str]:
        """Type and shape of each channel."""
        return {name: f"{dtype} [{length}]" for name, (dtype, length) in self.kinds.items()}

    def notes(self, _: Sequence[str]) -> list[str]:
        """Nothing is noticed of its channels."""
        return []

    def rate_of(self, names: Sequence[str], stated: float | str) -> float:
        """Rate of these channels: a number, or the array or time axis that states it.

        Raises:
            FormatError: they differ in length or hold no real numbers, or it is no rate.
        """
        length = self.kinds[names[0]][1]
        for name in names:
            dtype, own = self.kinds[name]
            if own != length or dtype.kind == "c":
                why = f"is {dtype} [{own}], expected {length} real numbers as {names[0]}"
                raise FormatError(name, why)
        numbers = {name: array for name, array in self.small.items() if array.dtype.kind in "fiuc"}
        if isinstance(stated, str) and self.kinds.get(stated, (None, 0))[1] == length:
            parts = (part[0] for part in self.chunks([stated]))
            return axis_rate(stated, parts, length, self.units)
        return sampling_rate(numbers, stated, length, self.units)

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file.

        Raises:
            FormatError: an array is damaged or cut short; names it.
        """
        kind = np.result_type(np.float32, *(self.kinds[name][0] for name in names))
        with ExitStack() as files:
            archives = [files.enter_context(zipfile.ZipFile(self.path)) for _ in names]
            streams = [
                files.enter_context(archive.open(f"{name}.npy"))
                for archive, name in zip(archives, names, strict=True)
            ]
            for name, stream in zip(names, streams, strict=True):
                with _named(name):
                    _head(stream)
            left = self.kinds[names[0]][1]
            while left:
                count = min(left, FRAMES)
                rows = [
                    _read(name, stream, self.kinds[name][0], count)
                    for name, stream in zip(names, streams, strict=True)
                ]
                yield np.array(
                    [real(row, name) for name, row in zip(names, rows, strict=True)], kind
                )
                left -= count


def open_npz(path: Path) -> NpzRecording:
    """The heads of the arrays of an npz, and its small ones.

    Raises:
        FormatError: the file is damaged, or holds no channel.
    """
    kinds: dict[str, tuple[np.dtype[Any], int]] = {}
    small: Variables = {}
    with _named(""), zipfile.ZipFile(path) as archive:
        for member in members_of(archive):
            if not member.filename.endswith(".npy"):
                continue
            name = member.filename.removesuffix(".npy")
            with _named(name), archive.open(member) as stream:
                shape, dtype = _head(stream)
                begin = stream.tell()
            size = int(np.prod([int(n) for n in shape], dtype=object))
            if dtype.kind in "fiuc" and size > 1 and size == max(shape):
                if member.file_size - begin != size * dtype.itemsize:
                    claims = f"claims {size * dtype.itemsize} bytes"
                    raise FormatError(name, f"{claims} and has {member.file_size - begin}")
                kinds[name] = dtype, size
            if size <= _SMALL and dtype.kind in "fiucU":
                small[name] = read_array(archive, member)
    if not kinds:
        raise FormatError("", "holds no array of one dimension, which a channel is")
    return NpzRecording(path, kinds, small)


@contextmanager
def _named(name: str) -> Iterator[None]:
    try:
        yield
    except (ValueError, KeyError, EOFError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise FormatError(name, f"cannot be read: {' '.join(str(error).split())}") from None


def _head(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    shape, _, dtype = HEADERS[npy.read_magic(stream)](stream)
    return shape, dtype


def _read(name: str, stream: IO[bytes], dtype: np.dtype[Any], count: int) -> np.ndarray[Any, Any]:
    with _named(name):
        data = stream.read(count * dtype.itemsize)
    if len(data) < count * dtype.itemsize:
        raise FormatError(name, "is cut short")
    return np.frombuffer(data, dtype)
