"""A recording of many hits whose channels are arrays, chunk by chunk; and what a mapping says of
the hits of any.

    {"recording": {"order": [{"point": 4, "hits": 3}, {"point": 5, "direction": -3, "hits": 3}]},
    "channels": [...]}

The order is that in which the points were hit. `"order": "filename"` takes the point from the
file's name, `point_4.wav`; without an order all hits are at the point of the force channel.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any, Protocol

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import (
    Variables,
    channels_of,
    described,
    rate_among,
    require_one_clock,
    sampling_rate,
    single_numbers,
    variable,
)
from modalbase.formats.records.mapping import MOST_POINT
from modalbase.formats.records.wav import FRAMES
from modalbase.formats.types import FloatArray

_POINT = re.compile(r"(?:point|pt|p)[ _-]?(\d+)(?!\d)", re.IGNORECASE)
_MOST_HITS = 100_000
_RECORDING = "mapping.recording"


class AnyRecording(Protocol):
    """A recording, whatever its format; its samples are read when they are asked for."""

    @property
    def names(self) -> list[str]:
        """Of the channels."""

    @property
    def units(self) -> dict[str, str]:
        """That the file states, by channel."""

    @property
    def full_scale(self) -> float | None:
        """Largest sample that its numbers have."""

    @property
    def declared(self) -> bool:
        """Whether the file says how long it is."""

    @property
    def rate(self) -> str | None:
        """Name of the single number that is its sampling rate."""

    @property
    def numbers(self) -> Mapping[str, np.ndarray[Any, Any]]:
        """The variables that are one number, which no channel is."""

    @property
    def began(self) -> float | None:
        """When the file says that it begins, s since 1970 in UTC."""

    @property
    def is_table(self) -> bool:
        """Whether all channels are columns of one table, which are best read at once."""

    def shapes(self) -> dict[str, str]:
        """Type and shape of each channel."""

    def notes(self, names: Sequence[str], /) -> list[str]:
        """What was noticed of these channels."""

    def rate_of(self, names: Sequence[str], /, stated: float | str) -> float:
        """Rate of these channels, 1/s."""

    def chunks(self, names: Sequence[str], /) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file."""


@dataclass(frozen=True)
class Arrays:
    """A recording whose channels are arrays of one dimension, or columns of a matrix, of a .mat or a
    CSV.

    Attributes:
        variables: all arrays of the file.
        units: that its properties state, by channel.
    """

    variables: Variables
    units: dict[str, str] = field(default_factory=dict)
    full_scale, declared, began, is_table = None, True, None, False

    @property
    def numbers(self) -> Variables:
        """The variables that are one number."""
        return single_numbers(self.variables)

    @property
    def rate(self) -> str | None:
        """Name of the single number that is the sampling rate."""
        return rate_among(name for name, array in self.variables.items() if array.size == 1)

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return [
            name for own, array in self.variables.items() for name in channels_of(own, array.shape)
        ]

    def shapes(self) -> dict[str, str]:
        """Type, shape and extremes of each channel."""
        return {name: described(variable(self.variables, name)) for name in self.names}

    def notes(self, _: Sequence[str]) -> list[str]:
        """Nothing is noticed of its channels."""
        return []

    def rate_of(self, names: Sequence[str], stated: float | str) -> float:
        """Rate of these channels: a number, or the variable or time axis that states it.

        Raises:
            FormatError: they differ in length, or it is no rate.
        """
        require_one_clock(self.variables, names)
        first, *others = (variable(self.variables, name) for name in names)
        length = first.size
        for name, array in zip(names, (first, *others), strict=True):
            if array.size != length or array.dtype.kind == "c":
                why = f"is {described(array)}, expected {length} real numbers as {names[0]}"
                raise FormatError(name, why)
        return sampling_rate(self.variables, stated, length, self.units)

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file."""
        rows = [np.ravel(variable(self.variables, name)) for name in names]
        kind = np.result_type(np.float32, *rows)
        for first in range(0, rows[0].size, FRAMES):
            yield np.array([row[first : first + FRAMES] for row in rows], dtype=kind)


@dataclass(frozen=True)
class Recording:
    """What a mapping says of a recording.

    Attributes:
        order: point, direction and number of hits, in the order of the hits; empty where all are at
            the force's point.
        least_force: of a hit, N; None where the recording shows it.
    """

    order: tuple[tuple[int, int, int], ...] = ()
    least_force: float | None = None


def read_recording(document: dict[str, Any], filename: str) -> Recording:
    """What the member `recording` of a mapping says.

    Args:
        document: of the member.
        filename: of the recording.

    Raises:
        FormatError: names the field that is unknown or wrong.
    """
    if not isinstance(document, dict):
        raise FormatError(_RECORDING, "is not an object")
    if unknown := sorted(document.keys() - {"order", "least_force"}):
        raise FormatError([(f"{_RECORDING}.{name}", "is unknown") for name in unknown])
    least, given = document.get("least_force"), document.get("order", [])
    if least is not None and (
        isinstance(least, bool) or not isinstance(least, int | float) or not 0 < least < np.inf
    ):
        raise FormatError(
            f"{_RECORDING}.least_force", f"is {least!r}, expected a force in N above 0"
        )
    if given == "filename":
        return Recording(((_point_of(filename), 3, 0),), least)
    if not isinstance(given, list):
        raise FormatError(f"{_RECORDING}.order", 'is no list of points, nor "filename"')
    return Recording(tuple(_entry(i, entry) for i, entry in enumerate(given)), least)


def _entry(number: int, entry: Any) -> tuple[int, int, int]:
    place = f"{_RECORDING}.order.{number}"
    if not isinstance(entry, dict) or not {"point", "hits"} <= entry.keys() <= {
        "point",
        "hits",
        "direction",
    }:
        raise FormatError(place, "is not {point, hits} with or without direction")
    hit = entry["point"], entry.get("direction", 3), entry["hits"]
    if any(isinstance(n, bool) or not isinstance(n, int) for n in hit):
        raise FormatError(place, "has a point, direction or number of hits that is no whole number")
    if not (1 <= hit[0] <= MOST_POINT and 1 <= abs(hit[1]) <= 6 and 1 <= hit[2] <= _MOST_HITS):
        raise FormatError(
            place,
            f"is no place to hit: expected point and hits from 1 (to {_MOST_HITS}), direction ±1"
            " to ±6",
        )
    return hit


def _point_of(filename: str) -> int:
    """The number behind `point` or `p` in a file's name, or the only number in it."""
    stem = PurePosixPath(filename).stem
    numbers = _POINT.findall(stem) or re.findall(r"\d+", stem)
    if len(numbers) != 1 or int(numbers[0]) < 1:
        raise FormatError(
            f"{_RECORDING}.order",
            f"cannot take the point from the name {filename!r}; expected one such as point_4.wav",
        )
    return int(numbers[0])
