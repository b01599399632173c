"""A recording as a mapping describes it: its channels, in SI, part by part. This module imports no
database.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from fecore.arrays import FloatArray
from fecore.frf import Dof
from modalbase.formats.errors import FormatError
from modalbase.formats.factors import factors_among
from modalbase.formats.records import ChannelMapping, Variables, read_mapping
from modalbase.formats.records.arrays import SAMPLE_RATE, columns_of
from modalbase.formats.records.mapping import LARGEST, MOST_POINT, Recorded
from modalbase.formats.records.proposal import units_beside
from modalbase.formats.records.recording import AnyRecording, Arrays
from modalbase.formats.records.variables import read_named
from modalbase.formats.registry import FORMATS, load
from modalbase.formats.tables import Stated

FREE_BYTES, RATIO, MOST_BYTES = 64 * 1024 * 1024, 100, 1024 * 1024 * 1024
"""A file may unpack to `FREE_BYTES`, or to `RATIO` times its own size, at most to `MOST_BYTES` or
its own size: what is measured does not compress better.
"""


def limit_of(path: Path) -> int:
    """The most bytes that a file may unpack to."""
    size = path.stat().st_size
    return max(FREE_BYTES, size, min(RATIO * size, MOST_BYTES))


@dataclass(frozen=True)
class MappedChannels:
    """The channels of a recording that a mapping names."""

    file: AnyRecording  # the recording
    sample_rate_hz: float  # samples a second
    mapped: tuple[ChannelMapping, ...]  # channels of the mapping

    @property
    def names(self) -> list[str]:
        """Of the channels in the file."""
        return [c.variable for c in self.mapped]

    @property
    def full_scales(self) -> list[float | None]:
        """Of each channel in SI; that of a file of integers is theirs where none is stated."""
        own = self.file.full_scale
        return [c.full_scale or (own / c.sensitivity if own else None) for c in self.mapped]

    def chunks(self) -> Iterator[FloatArray]:
        """(channels, n) parts in SI.

        Raises:
            FormatError: a channel reaches more than any sensor gives.
        """
        for part in self.file.chunks(self.names):
            for row, channel in zip(part, self.mapped, strict=True):
                most = max(float(row.max()), -float(row.min()))
                if np.isfinite(most) and most >= LARGEST * channel.sensitivity:
                    most /= channel.sensitivity
                    why = (
                        f"reaches {most:.3g} in SI, more than any sensor gives; look at the"
                        " sensitivity"
                    )
                    raise FormatError(channel.variable, why)
                row /= channel.sensitivity
            yield part


def place_of(channel: ChannelMapping) -> tuple[int, int]:
    """Point and direction of a channel, which `mapped_channels` has made sure is one place."""
    return int(cast("float", channel.point)), int(cast("float", channel.direction))


def dof_of(channel: ChannelMapping) -> Dof:
    """The same as a degree of freedom."""
    return Dof(*place_of(channel))


def mapped_channels(
    path: Path,
    document: dict[str, Any],
    form: str,
    limit_bytes: int | None = None,
    kind: Recorded = "hits",
) -> MappedChannels:
    """The channels of a recording that a mapping names, a force before the others.

    Args:
        path: of the file.
        document: the mapping; what `recording` says is not read here.
        form: name of its format.
        limit_bytes: the most that arrays of a file may take.
        kind: what it is of.

    Raises:
        FormatError: the file cannot be read, or the mapping does not fit; names the field.
    """
    file = recording_of(path, form, limit_bytes, document.get("table"))
    left = ("recording", "table") if file.is_table else ("recording",)
    rest = {name: value for name, value in document.items() if name not in left}
    if file.rate == SAMPLE_RATE:
        rest.setdefault("sample_rate_hz", {"variable": SAMPLE_RATE})
    mapping = read_mapping(rest, file.units, kind)
    if mapping.hit is not None:
        raise FormatError(
            "mapping.hit", "is of hits one by one, and this is a recording; leave it out"
        )
    for number, c in enumerate(mapping.channels):
        if c.variable not in file.names:
            raise FormatError(
                f"mapping.channels.{number}.variable",
                f"is {c.variable!r}; the file has {', '.join(file.names)}",
            )
        for name, least, most in (("point", 1, MOST_POINT), ("direction", -6, 6)):
            value = getattr(c, name)
            if not (
                isinstance(value, float)
                and value == int(value)
                and least <= value <= most
                and value
            ):
                expected = "±1 to ±6" if name == "direction" else f"a whole number from 1 to {most}"
                raise FormatError(
                    f"mapping.channels.{number}.{name}", f"is {value!r}, expected {expected}"
                )
        if c.window_rate_per_s:
            raise FormatError(
                f"mapping.channels.{number}.window_rate_per_s",
                "is of blocks; a recording has no window",
            )
    mapped = tuple(sorted(mapping.channels, key=lambda c: c.quantity != "force"))
    rate = file.rate_of([c.variable for c in mapped], mapping.sample_rate_hz)
    return MappedChannels(file, rate, mapped)


def recording_of(
    path: Path, form: str, limit_bytes: int | None = None, table: Any = None
) -> AnyRecording:
    """What a recording of a format says of itself; `table` is what a mapping says of one of text.

    Raises:
        FormatError: it cannot be read.
    """
    row = FORMATS[form]
    if row.recording:
        stated = (Stated.of(table, "mapping.table"),) if row.is_table else ()
        file: AnyRecording = load(row.recording)(path, *stated)
        return file
    if row.parts:
        parts: AnyRecording = load(row.parts)(path)
        return parts
    variables, texts = read_named(path, row.suffixes[0], limit_bytes)
    return Arrays(variables, units_in(variables, texts))


def units_in(variables: Variables, texts: dict[str, str]) -> dict[str, str]:
    """Units that the texts of a file state of its arrays, and so of their columns, with the factors
    that stand beside them.
    """
    names = [name for own, a in variables.items() for name in (own, *columns_of(own, a.shape))]
    return units_beside(names, texts | factors_among(variables))
