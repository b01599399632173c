"""A recording in TDMS, NI's format of LabVIEW and FlexLogger, part by part, with npTDMS, which the
extra `tdms` brings.

A channel is named `group/channel`. npTDMS says where the samples of each channel lie and how they
are scaled; it would read all that the recorder wrote at a stroke, which may be the whole file, so
the samples are read here.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.clocks import OwnClocks
from modalbase.formats.records.wav import FRAMES
from modalbase.formats.registry import FORMATS
from modalbase.formats.types import FloatArray
from modalbase.formats.units import factor_of

# names of the property
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units", "Units")
_MOST_AT_A_STROKE = 1 << 26  # bytes of DAQmx's own layout, which npTDMS has to read at once


@dataclass(frozen=True)
class Tdms(OwnClocks):
    """The head of a TDMS file.

    Attributes:
        path: of the file.
        lengths: samples of each channel of numbers, by its name.
        rates: of each, 1/s, from its `wf_increment`; NaN where it states none.
        declared: whether the file was closed, and holds what it says.
        units: that a channel states, in the file's own words (`unit_string`).
        starts: of each, in s after the first one, from its `wf_start_time` and `wf_start_offset`.
        began: when the first one began, s since 1970 in UTC; None where not every channel says.
    """

    path: Path
    lengths: dict[str, int]
    rates: dict[str, float]
    declared: bool
    units: dict[str, str] = field(default_factory=dict)
    starts: dict[str, float] = field(default_factory=dict)
    began: float | None = None

    start_stated_by = "the file's wf_start_offset and wf_start_time"

    def own_rate(self, name: str) -> float:
        """Samples a second of a channel; NaN where it states none."""
        return self.rates[name]

    def start(self, name: str) -> float:
        """When it begins, in s after the first one."""
        return self.starts.get(name, 0.0)

    def shapes(self) -> dict[str, str]:
        """Type and shape of each channel."""
        return {name: f"float32 [{length}]" for name, length in self.lengths.items()}

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) float32 parts of these channels in order, in the unit of the file.

        Raises:
            FormatError: the samples cannot be read.
        """
        with _opened(self.path) as file, self.path.open("rb") as raw, _broken():
            channels, (skipped, count) = _channels(file), self.overlap(names)
            parts = (
                _part(_samples(file, channels[name], raw), skipped[name], count) for name in names
            )
            for rows in zip(*map(_even, parts), strict=True):
                yield np.array(rows)


def read_tdms_head(path: Path) -> Tdms:
    """What a TDMS file says of itself.

    Raises:
        FormatError: it is broken, or npTDMS is not installed.
    """
    with _opened(path) as file, _broken():
        channels = _channels(file)
        if not channels:
            raise FormatError(
                "", "is a TDMS without a channel of numbers, or was cut off before them"
            )
        return Tdms(
            path=path,
            lengths={name: len(channel) for name, channel in channels.items()},
            rates={name: _rate(channel.properties) for name, channel in channels.items()},
            declared=not file.file_status.incomplete_final_segment,
            units={
                name: unit
                for name, channel in channels.items()
                if (unit := _unit(channel.properties))
            },
            starts=_starts({name: channel.properties for name, channel in channels.items()}),
            began=_began([channel.properties for channel in channels.values()]),
        )


def tdms_texts(path: Path, _most_bytes: int) -> dict[str, str]:
    """Properties of a TDMS and of its channels, by their names; a channel's begin with its own."""
    with _opened(path) as file, _broken():
        texts = {name: str(value) for name, value in file.properties.items()}
        starts = []
        for name, channel in _channels(file).items():
            for own, value in channel.properties.items():
                texts |= {f"{name} {own}": str(value), f"{channel.name} {own}": str(value)}
            if (start := channel.properties.get("wf_start_time")) is not None:
                starts.append(np.datetime64(start, "s"))
        return texts | ({"wf_start_time": f"{min(starts)}Z"} if starts else {})


def _opened(path: Path) -> Any:
    reader, log = map(FORMATS["tdms"].dependency, ("nptdms", "nptdms.log"))
    # it would print all bytes of a damaged name, which may be the rest of the file
    log.log_manager.set_level(logging.ERROR)
    with _broken():
        return reader.TdmsFile.open(path)


@contextmanager
def _broken() -> Iterator[None]:
    try:
        yield
    except FormatError:
        raise
    except Exception as error:  # noqa: BLE001 - of damaged files npTDMS raises errors of many kinds
        is_in_words = not isinstance(
            error, TypeError | LookupError | AttributeError | ArithmeticError | RecursionError
        )
        why = (
            str(error)
            if is_in_words
            else "it is damaged, or scaled in a way that is not known here"
        )
        raise FormatError(
            "", f"cannot be read as TDMS: {why}; export it anew, or as wav or CSV"
        ) from None


def _channels(file: Any) -> dict[str, Any]:
    """The channels that hold numbers, by group/channel."""
    pairs = (
        (f"{group.name}/{channel.name}", channel)
        for group in file.groups()
        for channel in group.channels()
    )
    return {
        name: channel for name, channel in pairs if len(channel) and channel.dtype.kind in "iuf"
    }


def _rate(properties: Mapping[str, Any]) -> float:
    """Samples a second by `wf_increment`, in s unless the channel states another unit of its axis;
    NaN where it says none.
    """
    increment, unit = (
        properties.get("wf_increment"),
        str(properties.get("wf_xunit_string", "")).strip(),
    )
    factor = factor_of("time", unit) if unit else 1.0
    return float(np.round(1 / (increment * factor), 6)) if increment and factor else np.nan


def _unit(properties: Mapping[str, Any]) -> str:
    """The unit that a channel states, "" where it states none."""
    return next((text for name in _UNITS if (text := str(properties.get(name, "")).strip())), "")


def _starts(properties: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """When each channel begins, in s after the first one. A time counts where every channel states
    one.
    """
    offsets = {name: own.get("wf_start_offset", 0.0) for name, own in properties.items()}
    starts = {
        name: float(offset) if isinstance(offset, int | float) else 0.0
        for name, offset in offsets.items()
    }
    times = {name: own.get("wf_start_time") for name, own in properties.items()}
    stamps = [np.datetime64(time, "ns") for time in times.values() if time is not None]
    if len(stamps) == len(times):
        for name, stamp in zip(times, stamps, strict=True):
            starts[name] += float((stamp - min(stamps)) / np.timedelta64(1, "s"))
    earliest = min(starts.values())
    return {name: start - earliest for name, start in starts.items() if start > earliest}


def _began(properties: Sequence[Mapping[str, Any]]) -> float | None:
    """When the first channel began, s since 1970 in UTC; None where not every channel says."""
    times = [own.get("wf_start_time") for own in properties]
    if any(time is None for time in times):
        return None
    since = [np.datetime64(time, "us") - np.datetime64(0, "us") for time in times]
    return float(min(since) / np.timedelta64(1, "s"))


def _part(parts: Iterator[FloatArray], skip: int, count: int) -> Iterator[FloatArray]:
    """So many samples behind the first ones."""
    for part in parts:
        own = part[skip : skip + count]
        skip, count = max(skip - part.size, 0), count - own.size
        if own.size:
            yield own


def _even(parts: Iterator[FloatArray]) -> Iterator[FloatArray]:
    """The same samples in parts of one length, the last one shorter."""
    held = np.empty(0, dtype=np.float32)
    for part in parts:
        held = np.concatenate((held, part))
        while held.size >= FRAMES:
            yield held[:FRAMES]
            held = held[FRAMES:]
    if held.size:
        yield held


def _samples(file: Any, channel: Any, raw: BinaryIO) -> Iterator[FloatArray]:
    """The samples of a channel, scaled, in parts that fit into memory."""
    for segment in file._reader._segments:
        own = next((o for o in segment._get_data_objects() if o.path == channel.path), None)
        if own is not None:
            parts = _of_daqmx if segment._have_daqmx_objects() else _of_segment
            for part in parts(segment, own, raw):
                yield np.asarray(channel._scale_data(part), dtype=np.float32)


def _of_daqmx(segment: Any, own: Any, raw: BinaryIO) -> Iterator[Any]:
    """What npTDMS reads of a segment that DAQmx wrote, stroke by stroke."""
    if (size := segment._get_chunk_size()) > _MOST_AT_A_STROKE:
        raise FormatError(
            own.path,
            f"was written by DAQmx at strokes of {size / 1e6:.0f} MB, of which"
            f" {_MOST_AT_A_STROKE / 1e6:.0f} MB can be read; let the recorder write more often, or"
            " export the recording as wav",
        )
    for stroke in range(segment.num_chunks):
        yield from segment.read_raw_data_for_channel(raw, own.path, stroke, 1)


def _of_segment(segment: Any, own: Any, raw: BinaryIO) -> Iterator[Any]:
    """The same of any other segment, some samples at a time."""
    from nptdms.base_segment import RawChannelDataChunk

    kind = own.data_type.nptype.newbyteorder(segment._get_data_reader().endianness)
    for begin, count, width, column in _sample_blocks(segment, own):
        for first in range(0, count, FRAMES):
            raw.seek(begin + first * width)
            read = np.frombuffer(raw.read(min(FRAMES, count - first) * width), np.uint8)
            rows = read[: read.size // width * width].reshape(-1, width)[
                :, column : column + kind.itemsize
            ]
            yield RawChannelDataChunk.channel_data(np.ascontiguousarray(rows).view(kind)[:, 0])


def _sample_blocks(segment: Any, own: Any) -> Iterator[tuple[int, int, int, int]]:
    """Where the samples of a channel lie: first byte, rows, bytes of a row, and the sample's place
    in it.
    """
    objects, begin = segment._get_data_objects(), segment.data_position
    before = objects[: objects.index(own)]
    if segment._have_interleaved_data():
        if len({o.number_values for o in objects}) > 1:
            raise FormatError(own.path, "lies between the samples of longer or shorter channels")
        width = sum(o.data_type.size for o in objects)
        yield (
            begin,
            (segment.next_segment_pos - begin) // width,
            width,
            sum(o.data_type.size for o in before),
        )
        return
    for stroke in range(segment.num_chunks):
        cut = segment.final_chunk_lengths_override if stroke == segment.num_chunks - 1 else None
        *sizes, count = (
            o.data_size if cut is None else cut.get(o.path, 0) * (o.data_type.size or 0)
            for o in (*before, own)
        )
        at = begin + stroke * segment._get_chunk_size() + sum(sizes)
        yield at, count // own.data_type.size, own.data_type.size, 0
