"""A recording in MDF, ASAM's format of data acquisition, part by part, with asammdf, which the extra
`mdf` brings.

A channel is named `group/channel`. A group is called by its name where it has one of its own, else
by its number, from 1. Its time channel is its clock; values are those that the file's conversions
give, and units those that it states.
"""

import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import UNEVEN, TimeAxis
from modalbase.formats.records.clocks import OwnClocks
from modalbase.formats.records.wav import FRAMES
from modalbase.formats.registry import FORMATS
from modalbase.formats.types import FloatArray

_OPEN = b"UnFinMF "
"""How a file begins that its recorder did not close."""
_LOST = 0.5
"""Part of a step by which a time channel that is rounded may be uneven: no sample is missing then."""
_PIECE_BYTES = 1 << 22
_Bools = np.ndarray[Any, np.dtype[np.bool_]]
_TIME = 1
"""Type of a master channel that counts time."""


@dataclass(frozen=True)
class Channel:
    """Where a channel lies.

    Attributes:
        group, index: in the file.
        dtype: of its values.
        unit: that it states.
    """

    group: int
    index: int
    dtype: np.dtype[Any]
    unit: str


@dataclass(frozen=True)
class Mdf(OwnClocks):
    """The head of an MDF file.

    Attributes:
        path: of the file.
        channels: of numbers, by name.
        lengths: samples of each.
        clocks: names of the time channels of the groups that have one.
        began: when the file says that it begins, s since 1970 in UTC.
        declared: whether the file was closed, and holds what it says.
    """

    path: Path
    channels: dict[str, Channel]
    lengths: dict[str, int]
    clocks: dict[int, str]
    began: float | None = None
    declared: bool = True
    axes: dict[int, TimeAxis] = field(default_factory=dict, compare=False)  # those that were read

    sample_bytes = 8
    start_stated_by = "the time channels of their groups"

    @cached_property
    def units(self) -> dict[str, str]:
        """That channels state, in the file's own words."""
        return {name: each.unit for name, each in self.channels.items() if each.unit}

    def shapes(self) -> dict[str, str]:
        """Type and shape of each channel."""
        return {name: f"{c.dtype} [{self.lengths[name]}]" for name, c in self.channels.items()}

    def own_rate(self, name: str) -> float:
        """Samples a second of a channel; NaN where its group has no time channel."""
        axis = self._axis(name)
        return np.nan if axis is None else float(f"{1 / axis.step:.9g}")

    def start(self, name: str) -> float:
        """When it begins, in s of the file's own time."""
        axis = self._axis(name)
        return 0.0 if axis is None else axis.first

    def rate_of(self, names: Sequence[str], stated: float | str) -> float:
        """Rate of these channels.

        Raises:
            FormatError: as of other recordings; or a time channel is uneven, where no rate is
                stated by more than a rounding, and else by half a sample.
        """
        for name in names:
            axis, clock = self._axis(name), self.clocks.get(self.channels[name].group, "")
            if axis is not None and isinstance(stated, str) and not axis.is_even(UNEVEN):
                raise FormatError(
                    clock,
                    f"is not an evenly rising time axis, most at sample {axis.sample}; state the"
                    " rate as a number where it is rounded",
                )
        return super().rate_of(names, stated)

    def _axis(self, name: str) -> TimeAxis | None:
        """The time channel of a channel's group; None where it has none.

        Raises:
            FormatError: it does not rise, or a sample is missing; names it and the sample.
        """
        group, samples = self.channels[name].group, self.lengths[name]
        if group not in self.clocks:
            return None
        if group not in self.axes:
            clock = self.clocks[group]
            with _opened(self.path) as file:
                parts = _parts(samples, lambda at, n: [_clock(file, group, clock, at, n)])
                axis = TimeAxis.of(clock, (part[0] for part in parts), samples)
            if samples > 1 and not axis.is_even(_LOST):
                raise FormatError(
                    clock,
                    f"does not rise evenly: the step to sample {axis.sample} differs by"
                    f" {axis.uneven:.3g} s from the mean of {axis.step:.6g} s; samples are missing,"
                    " or were taken when they came; export them on one clock",
                )
            self.axes[group] = axis
        return self.axes[group]

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file.

        Raises:
            FormatError: the samples cannot be read, or the file says that one is invalid.
        """
        skipped, count = self.overlap(names)
        kind = np.result_type(np.float32, *(self.channels[name].dtype for name in names))
        with _opened(self.path) as file:
            for part in _parts(count, lambda at, n: self._rows(file, names, skipped, at, n)):
                yield np.array(part, dtype=kind)

    def _rows(
        self, file: Any, names: Sequence[str], skipped: dict[str, int], at: int, count: int
    ) -> list[FloatArray]:
        """So many samples of each channel; those of one group are read together."""
        rows: dict[str, FloatArray] = {}
        for group in dict.fromkeys(self.channels[name].group for name in names):
            own = [name for name in names if self.channels[name].group == group]
            first = skipped[own[0]] + at
            places = [self.channels[name].index for name in own]
            for name, (samples, invalid) in zip(
                own, _values(file, group, places, first, count), strict=True
            ):
                if invalid.any():
                    bad = first + int(np.argmax(invalid)) + 1
                    raise FormatError(name, f"is invalid at sample {bad}, as the file says")
                rows[name] = _whole(name, samples, count, first)
        return [rows[name] for name in names]


def read_mdf_head(path: Path) -> Mdf:
    """What an MDF file says of itself.

    Raises:
        FormatError: it is broken or holds no channel of numbers, or asammdf is not installed.
    """
    with path.open("rb") as raw:
        declared = raw.read(8) != _OPEN
    with _opened(path) as file:
        channels, clocks = _channels(file), dict[int, str]()
        if not channels:
            raise FormatError(
                "", "is an MDF without a channel of numbers, or was cut off before them"
            )
        groups = {channel.group: name for name, channel in channels.items()}
        for group, name in groups.items():
            if (index := file.masters_db.get(group)) is not None:
                clock = file.groups[group].channels[index]
                label = f"{name.partition('/')[0]}/{clock.name}"
                if getattr(clock, "sync_type", _TIME) != _TIME:
                    raise FormatError(
                        label, "counts no time: channels over an angle or a distance are not read"
                    )
                clocks[group] = label
        return Mdf(
            path,
            channels,
            {name: _cycles(file, each.group) for name, each in channels.items()},
            clocks,
            file.header.start_time.timestamp(),
            declared,
        )


def mdf_texts(path: Path, _most_bytes: int) -> dict[str, str]:
    """When a file begins, with the zone that it states, and the units of its channels."""
    with _opened(path) as file:
        units = {f"{name} unit": each.unit for name, each in _channels(file).items() if each.unit}
        return {**units, "start time": file.header.start_time.isoformat()}


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file, and what is wrong with it in one line."""
    reader = FORMATS["mdf"].dependency("asammdf")
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # it would print what is damaged
    try:
        # of a stream, as a path is mapped into memory; but what is not closed asammdf mends by its path
        with (
            path.open("rb") as raw,
            reader.MDF(_source(raw, path), process_bus_logging=False) as file,
        ):
            for group in file.groups if file.version >= "4" else ():
                blocks = [piece for block in group.data_blocks for piece in _pieces(block)]
                group.data_blocks[:] = blocks
            yield file
    except FormatError:
        raise
    except Exception as error:  # noqa: BLE001 - of damaged files asammdf raises errors of many kinds
        is_in_words = (
            isinstance(error, OSError | ValueError) or type(error).__name__ == "MdfException"
        )
        why = " ".join(str(error).split())[:200] if is_in_words else "it is damaged, or cut off"
        raise FormatError("", f"cannot be read as MDF: {why}; export it anew, or as CSV") from None


def _source(raw: BinaryIO, path: Path) -> BinaryIO | Path:
    is_open = raw.read(len(_OPEN)) == _OPEN
    raw.seek(0)
    return path if is_open else raw


def _values(
    file: Any, group: int, channels: Sequence[int], at: int, count: int
) -> list[tuple[FloatArray, _Bools]]:
    """So many values of these channels of a group, and which of them are invalid, empty where the
    file says of none.

    Of a part of a group asammdf's own `select` and `get` prepare as much as the whole group takes, of
    a day 2 GB; of bytes that are given only those.
    """
    own = file.groups[group]
    if file.version < "4" or own.channel_group.invalidation_bytes_nr:
        where = [(None, group, index) for index in channels]
        read = file.select(where, record_offset=at, record_count=count, copy_master=False)
        return [(each.samples, _invalid(each)) for each in read]
    values = [
        [file.get(group=group, index=index, data=part, samples_only=True)[0] for index in channels]
        for part in file._mdf._load_data(own, record_offset=at, record_count=count)
    ]
    if not values:
        return [(np.zeros(0), np.zeros(0, bool))] * len(channels)
    rows = [np.concatenate(each) for each in zip(*values, strict=True)]
    return [(row, np.zeros(0, bool)) for row in rows]


def _invalid(signal: Any) -> _Bools:
    bits = signal.invalidation_bits
    return np.zeros(0, bool) if bits is None else np.asarray(bits, bool)


def _pieces(block: Any) -> list[Any]:
    """A block of samples in pieces, where it lies in the file as it is: for any part of a block
    asammdf reads the whole, and a simple recorder writes a day as one.
    """
    plain = not block.block_type and block.invalidation_block is None and block.block_limit is None
    size = block.original_size or 0
    if not plain or size <= _PIECE_BYTES:
        return [block]
    pieces = []
    for first in range(0, size, _PIECE_BYTES):
        piece = copy(block)
        piece.address = block.address + first
        piece.original_size = piece.compressed_size = min(_PIECE_BYTES, size - first)
        pieces.append(piece)
    return pieces


def _channels(file: Any) -> dict[str, Channel]:
    """The channels that hold numbers, by group/channel."""
    titles = [_title(group) for group in file.groups]
    known = Counter(titles)
    channels: dict[str, Channel] = {}
    for number, group in enumerate(file.groups):
        if not _cycles(file, number):
            continue
        label = titles[number] if known[titles[number]] == 1 else ""
        label = label.replace("/", "_") or str(number + 1)
        times = Counter(channel.name for channel in group.channels)
        for index, channel in enumerate(group.channels):
            if index == file.masters_db.get(number):
                continue
            ((samples, _),) = _values(file, number, [index], 0, 1)
            if samples.dtype.kind not in "iuf" or samples.ndim != 1:
                continue
            name = f"{label}/{channel.name}"
            name = name if times[channel.name] == 1 else f"{name}#{index}"
            channels[name] = Channel(number, index, samples.dtype, _unit(channel))
    return channels


def _unit(channel: Any) -> str:
    """That a channel or its conversion states."""
    return str(getattr(channel.conversion, "unit", "") or channel.unit or "").strip()


def _title(group: Any) -> str:
    return (getattr(group.channel_group, "acq_name", "") or "").strip()


def _cycles(file: Any, group: int) -> int:
    return int(file.groups[group].channel_group.cycles_nr)


def _clock(file: Any, group: int, name: str, at: int, count: int) -> FloatArray:
    read = file.get_master(group, record_offset=at, record_count=count)
    return _whole(name, read, count, at)


def _whole(name: str, samples: Any, count: int, first: int) -> FloatArray:
    """Samples of a channel.

    Raises:
        FormatError: some are missing.
    """
    values: FloatArray = np.asarray(samples)
    if len(values) < count:
        raise FormatError(name, f"is cut short: it has no sample {first + len(values) + 1}")
    return values


def _parts(count: int, read: Any) -> Iterator[list[FloatArray]]:
    """What is read of so many samples, some at a time."""
    for first in range(0, count, FRAMES):
        yield read(first, min(FRAMES, count - first))
