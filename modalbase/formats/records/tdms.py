"""A recording in TDMS, NI's format of LabVIEW and FlexLogger, chunk by chunk: npTDMS reads it, which the extra `tdms` brings.

A channel is named `group/channel`. What the recorder wrote at a stroke is a chunk, and one of each channel is in memory.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.types import FloatArray

_FRAMES = 1 << 17
_BROKEN = (ValueError, KeyError, OSError, EOFError, IndexError, struct.error)  # what npTDMS raises of a broken file


@dataclass(frozen=True)
class Tdms:
    """The head of a TDMS file.

    Attributes:
        path: of the file.
        lengths: samples of each channel of numbers, by its name.
        rates: of each, 1/s, from its `wf_increment`; NaN where it states none.
        declared: whether the file was closed, and holds what it says.
    """

    path: Path
    lengths: dict[str, int]
    rates: dict[str, float]
    declared: bool

    full_scale = None

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return list(self.lengths)

    def shapes(self) -> dict[str, str]:
        """Type and shape of each channel."""
        return {name: f"float32 [{length}]" for name, length in self.lengths.items()}

    def rate_of(self, names: Sequence[str]) -> float | None:
        """Rate of these channels; None where the file states none.

        Raises:
            FormatError: they differ in rate or length.
        """
        for name in names[1:]:
            if self.lengths[name] != self.lengths[names[0]] or not np.isclose(
                self.rates[name], self.rates[names[0]], rtol=1e-9, equal_nan=True
            ):
                raise FormatError(
                    name, f"differs in rate or length from {names[0]}; the channels of a hit are on one clock"
                )
        rate = self.rates[names[0]]
        return rate if np.isfinite(rate) else None

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) float32 parts of these channels in order, in the unit of the file."""
        with ExitStack() as opened:
            # npTDMS goes on from where its file stands, so each channel has one of its own.
            files = [opened.enter_context(_opened(self.path)) for _ in names]
            parts = [_even(_channels(file)[name]) for file, name in zip(files, names, strict=True)]
            for rows in zip(*parts, strict=True):
                yield np.array(rows)


def read_tdms_head(path: Path) -> Tdms:
    """What a TDMS file says of itself.

    Raises:
        FormatError: it is broken, or npTDMS is not installed.
    """
    with _opened(path) as file:
        channels = _channels(file)
        if not channels:
            raise FormatError("", "is a TDMS without a channel of numbers, or was cut off before them")
        return Tdms(
            path,
            {name: len(channel) for name, channel in channels.items()},
            {name: _rate(channel.properties.get("wf_increment")) for name, channel in channels.items()},
            not file.file_status.incomplete_final_segment,
        )


def _opened(path: Path) -> Any:
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise FormatError("", "is a TDMS file, which npTDMS reads: pip install 'modalbase[tdms]'") from None
    try:
        return TdmsFile.open(path)
    except _BROKEN as error:
        raise FormatError("", f"cannot be read as TDMS: {error}") from None


def _channels(file: Any) -> dict[str, Any]:
    """The channels that hold numbers, by group/channel."""
    found = ((f"{group.name}/{channel.name}", channel) for group in file.groups() for channel in group.channels())
    return {name: channel for name, channel in found if len(channel) and channel.dtype.kind in "iuf"}


def _rate(increment_s: float | None) -> float:
    return float(np.round(1 / increment_s, 6)) if increment_s else np.nan


def _even(channel: Any) -> Iterator[FloatArray]:
    """The samples of a channel in parts of one length, the last one shorter."""
    held = np.empty(0, dtype=np.float32)
    try:
        for chunk in channel.data_chunks():
            held = np.concatenate((held, np.asarray(chunk[:], dtype=np.float32)))
            while held.size >= _FRAMES:
                yield held[:_FRAMES]
                held = held[_FRAMES:]
    except _BROKEN as error:
        raise FormatError("", f"cannot be read as TDMS: {error}") from None
    if held.size:
        yield held
