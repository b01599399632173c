"""Recordings of which each channel states its own rate and start: channels of one rate are cut to
begin and end together, others are refused by name.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import NO_NUMBERS, SAMPLE_RATE, Variables, sampling_rate
from modalbase.formats.types import FloatArray

# of a sample, and of a time stamp: what two channels may lie off whole samples
_WHOLE, _CLOCK_S = 0.01, 1e-6


class OwnClocks(ABC):
    """Channels that have a rate and a start each."""

    lengths: dict[str, int]
    full_scale: ClassVar[None] = None
    rate: ClassVar[str] = SAMPLE_RATE
    is_table: ClassVar[bool] = False
    numbers = NO_NUMBERS
    sample_bytes: ClassVar[int] = 4
    start_stated_by: ClassVar[str]
    """What states where a channel begins, for messages."""

    @abstractmethod
    def own_rate(self, name: str) -> float:
        """Samples a second of a channel; NaN where the file states none."""

    @abstractmethod
    def start(self, name: str) -> float:
        """When a channel begins, in s after any time that all of them share."""

    @abstractmethod
    def chunks(self, names: Sequence[str], /) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file."""

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return list(self.lengths)

    def rate_of(self, names: Sequence[str], stated: float | str) -> float:
        """Rate of these channels.

        Raises:
            FormatError: they differ in rate or length, begin at times that lie no whole number of
                samples apart, another rate is stated, or none is.
        """
        late, first = self.late(names), names[0]
        own = self.own_rate(first)
        for name in names[1:]:
            unlike = late[name] == late[first] and self.lengths[name] != self.lengths[first]
            if unlike or not np.isclose(self.own_rate(name), own, rtol=1e-9, equal_nan=True):
                each = (f"{self.own_rate(n):.9g} Hz, {self.lengths[n]}" for n in (name, first))
                raise FormatError(
                    name,
                    f"differs in rate or length from {first} ({' and '.join(each)} samples); the"
                    " channels of a hit are on one clock",
                )
        if np.isnan(own) and isinstance(stated, str):
            raise FormatError(
                "mapping.sample_rate_hz",
                "is missing, and the file states none; state it as a number",
            )
        return sampling_rate(
            {} if np.isnan(own) else {SAMPLE_RATE: np.array(own)}, stated, self.lengths[first]
        )

    def notes(self, names: Sequence[str]) -> list[str]:
        """Where some of these channels begin later than others, which are cut to begin with
        them.
        """
        late = self.late(names)
        first = min(late, key=lambda name: late[name])
        return [
            f"{name} begins {samples} samples ({1e3 * samples / self.own_rate(name):.4g} ms) after"
            f" {first}: the channels are aligned by {self.start_stated_by}"
            for name, samples in late.items()
            if samples
        ]

    def late(self, names: Sequence[str]) -> dict[str, int]:
        """Samples by which each of these channels begins after the first of them.

        Raises:
            FormatError: it is no whole number of samples.
        """
        starts = {name: self.start(name) for name in names}
        first = min(starts, key=lambda name: starts[name])
        late = {}
        for name, start in starts.items():
            rate = self.own_rate(name) if np.isfinite(self.own_rate(name)) else 0.0
            samples = (start - starts[first]) * rate
            late[name] = round(samples)
            if abs(samples - late[name]) > max(_WHOLE, _CLOCK_S * rate) or (
                start > starts[first] and not rate
            ):
                raise FormatError(
                    name,
                    f"begins {1e3 * (start - starts[first]):.6g} ms after {first}"
                    f" ({self.start_stated_by}), which is {samples:.4g} samples: they can be aligned"
                    " by whole samples alone; export them on one clock",
                )
        return late

    def overlap(self, names: Sequence[str]) -> tuple[dict[str, int], int]:
        """The first sample of each of these channels that all have, and how many they share.

        Raises:
            FormatError: as of `late`; or they share none.
        """
        late = self.late(names)
        last = max(late.values())
        count = min(self.lengths[name] - last + late[name] for name in names)
        if count < 1:
            end = min(names, key=lambda name: self.lengths[name] + late[name])
            raise FormatError(end, "ends before other channels begin; they share no sample")
        return {name: last - late[name] for name in names}, count

    def arrays(self, names: Sequence[str], limit_bytes: int | None = None) -> Variables:
        """These channels whole, of a file that holds single hits, and their rate where the file
        states one.

        Raises:
            FormatError: they take more bytes than allowed, or cannot be read.
        """
        size = self.sample_bytes * sum(self.lengths[name] for name in names)
        if limit_bytes is not None and size > limit_bytes:
            raise FormatError(
                "",
                f"takes {size} bytes, more than the {limit_bytes} that are allowed; state"
                " `recording`",
            )
        rate = self.own_rate(names[0]) if names else np.nan
        own = {} if np.isnan(rate) else {SAMPLE_RATE: np.array(self.rate_of(names, SAMPLE_RATE))}
        return (
            own | dict(zip(names, np.hstack(list(self.chunks(names))), strict=True))
            if names
            else own
        )
