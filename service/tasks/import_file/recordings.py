"""A long recording of many hits, in the child process: the hits are found and their blocks cut, one
at a time.

This module imports no database and no web, since the child imports it.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.signal.pulse import LEAD
from fecore.signal.recording import Impact, Survey, cut, survey
from modalbase.formats.errors import FormatError
from modalbase.formats.records import (
    ChannelMapping,
    TimeBlock,
    propose,
    propose_recording,
    read_mapping,
)
from modalbase.formats.records.arrays import SAMPLE_RATE, Variables
from modalbase.formats.records.mapping import LARGEST, MOST_POINT
from modalbase.formats.records.recording import (
    AnyRecording,
    Arrays,
    Recording,
    read_recording,
)
from modalbase.formats.records.text import TextRecording
from modalbase.formats.records.uff import open_uff
from modalbase.formats.records.variables import read_named
from modalbase.formats.registry import FORMATS, load
from modalbase.formats.tables import Stated
from modalbase.formats.units import unit_beside

Place = tuple[int, int]
_MOST_NAMED = 60
_RECORDING = "mapping.recording"


@dataclass(frozen=True)
class Channels:
    """The channels of a recording that a mapping names, the force first, and where each hit was."""

    file: AnyRecording  # the recording
    sample_rate_hz: float  # samples a second
    mapped: tuple[ChannelMapping, ...]  # channels of the mapping
    stated: Recording  # the order of the hits; where it is empty, all are at the force's point

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

    def survey(self) -> Survey:
        """Find the hits; see `fecore.signal.recording.survey`."""
        least = self.stated.least_force
        return survey(
            self.chunks(),
            self.sample_rate_hz,
            0,
            least_force=least,
            full_scale=self.full_scales,
            names=self.names,
        )

    def places(self, hits: tuple[Impact, ...]) -> list[Place]:
        """Where each hit was.

        Raises:
            FormatError: the order states more or fewer hits; says when each was found.
        """
        force, order = self.mapped[0], self.stated.order
        if not order:
            return [_place(force)] * len(hits)
        if order[0][2] == 0:
            return [(order[0][0], _place(force)[1])] * len(hits)
        places = [entry[:2] for entry in order for _ in range(entry[2])]
        if len(places) != len(hits):
            raise FormatError(
                "mapping.recording.order",
                f"has {len(places)} hits, and {len(hits)} were found, at {self.times(hits)};"
                " correct the order, or state least_force where a pulse is none",
            )
        return places

    def times(self, hits: tuple[Impact, ...]) -> str:
        """When hits were, in seconds, with their force."""
        shown = [
            f"{hit.at / self.sample_rate_hz:.2f} s ({hit.force:.3g} N)"
            for hit in hits[:_MOST_NAMED]
        ]
        return ", ".join(shown) + (" …" if len(hits) > _MOST_NAMED else "")

    def notes(self, survey: Survey) -> list[str]:
        """Hits that are left out or clipped, and whether the file may have been cut off.

        Raises:
            FormatError: no hit can be cut, or a channel is clipped in every hit.
        """
        notes = self.file.notes(self.names)
        if not self.file.declared:
            notes.append(
                "the file declares no length: it is read to its end, and nobody knows whether it"
                " was cut off"
            )
        if left := tuple(hit for hit in survey.hits if not survey.fits(hit)):
            lead, seconds = LEAD / self.sample_rate_hz, survey.length / self.sample_rate_hz
            if len(left) == len(survey.hits):
                early = sum(hit.at < LEAD for hit in left)
                reasons = (
                    [f"{early} within the first {lead:.3g} s, which a block needs before its hit"]
                    if early
                    else []
                )
                if early < len(left):
                    reasons.append(
                        f"{len(left) - early} too near to the next hit or the end for a block of"
                        f" {seconds:.3g} s"
                    )
                raise FormatError(
                    _RECORDING,
                    f"holds {len(left)} {'hit' if len(left) == 1 else 'hits'}, at"
                    f" {self.times(left)}, and none can be cut out: {', '.join(reasons)}; record"
                    " longer before and after each hit, or, where the file holds one hit alone,"
                    " leave `recording` out of the mapping: the whole file is its block then",
                )
            notes.append(
                f"{len(left)} of {len(survey.hits)} hits are left out, since the next hit or the end"
                f" of the recording comes before their {seconds:.3g} s are over, or the recording"
                f" begins with them: {self.times(left)}"
            )
        for row, channel in enumerate(self.mapped):
            clipped = tuple(hit for hit in survey.hits if row in hit.clipped)
            where = (
                f"at its full scale in {len(clipped)} of {len(survey.hits)} hits:"
                f" {self.times(clipped)}"
            )
            if len(clipped) == len(survey.hits):
                raise FormatError(
                    channel.variable,
                    f"is clipped, {where}; measure with a larger range, or correct full_scale",
                )
            if clipped:
                notes.append(f"{channel.variable} is clipped, {where}")
        return notes

    def blocks(self, survey: Survey, places: list[Place]) -> Iterator[TimeBlock]:
        """The blocks of each hit, the force first."""
        counts: Counter[Place] = Counter()
        numbers = {}
        for hit, place in zip(survey.hits, places, strict=True):
            counts[place] += 1
            numbers[hit.at] = place, counts[place]
        for hit, samples in cut(self.chunks(), survey):
            place, number = numbers[hit.at]
            for c, values, full in zip(self.mapped, samples, self.full_scales, strict=True):
                own = place if c.quantity == "force" else _place(c)
                yield TimeBlock(
                    c.quantity,
                    *own,
                    *place,
                    number,
                    self.sample_rate_hz,
                    values,
                    full_scale=full,
                    sensitivity=c.sensitivity,
                    label=c.variable,
                    start_sample=hit.at - LEAD,
                )


def channels_of(
    path: Path,
    document: dict[str, Any],
    filename: str,
    form: str,
    limit_bytes: int | None = None,
) -> Channels:
    """A recording and what a mapping with the member `recording` says of it.

    Args:
        path: of the file.
        document: the mapping.
        filename: as its sender calls the file, which may name the point.
        form: name of its format.
        limit_bytes: the most that arrays of a file may take.

    Raises:
        FormatError: the file cannot be read, or the mapping does not fit; names the field.
    """
    file = recording_of(path, form, limit_bytes, document.get("table"))
    stated = read_recording(document["recording"], filename)
    left = ("recording", "table") if isinstance(file, TextRecording) else ("recording",)
    rest = {name: value for name, value in document.items() if name not in left}
    if file.has_rate:
        rest.setdefault("sample_rate_hz", {"variable": SAMPLE_RATE})
    # the order says where the hammer hits
    if stated.order and isinstance(rest.get("channels"), list):
        rest["channels"] = [_placed(channel, stated.order[0]) for channel in rest["channels"]]
    mapping = read_mapping(rest, file.units)
    if mapping.hit is not None:
        raise FormatError("mapping.hit", "is counted in a recording; leave it out")
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
    return Channels(
        file, file.rate_of([c.variable for c in mapped], mapping.sample_rate_hz), mapped, stated
    )


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
    variables, texts = read_named(path, row.suffixes[0], limit_bytes)
    return Arrays(variables, units_in(variables, texts))


def units_in(variables: Variables, texts: dict[str, str]) -> dict[str, str]:
    """Units that the texts of a file state of its arrays."""
    return {name: unit for name in variables if (unit := unit_beside(name, texts))}


def recording_in_uff(path: Path, channels: Counter[str]) -> tuple[Variables, dict[str, Any]] | None:
    """The blocks of a UFF file and the mapping of a recording that they suggest; None where they
    are single hits.

    The blocks are read again, so that only a file with one block of one hammer and one of each
    sensor has them in memory.

    Args:
        path: of the file.
        channels: how many blocks each channel has, by `channel_of`.
    """
    if sum(name.startswith("force") for name in channels) != 1 or channels.total() > len(channels):
        return None
    try:
        file = open_uff(path)
    except FormatError:  # channels of two rates are no recording
        return None
    proposed = proposed_recording(file)
    return None if proposed is None else (file.variables, proposed)


def proposed_recording(file: Arrays) -> dict[str, Any] | None:
    """The mapping of a recording that arrays suggest whose force holds several hits; None where
    they do not.
    """
    mapping = propose(file.variables, file.units)
    names = [channel["variable"] for channel in mapping["channels"]]
    if (
        not names
        or mapping["channels"][0]["quantity"] != "force"
        or not set(names) <= set(file.names)
    ):
        return None
    try:
        rate = file.rate_of(names, mapping["sample_rate_hz"]["variable"])
        several = len(survey(file.chunks(names), rate, 0).hits) > 1
    except (KeyError, FormatError, InputError):  # no rate, unlike channels, no pulse: no recording
        return None
    return (
        {"sample_rate_hz": mapping["sample_rate_hz"], **propose_recording(names, file.units)}
        if several
        else None
    )


def looked_at(file: AnyRecording, *, together: bool) -> dict[str, str]:
    """Type and shape of each channel, and its least and greatest sample, by which a person knows
    the hammer's.

    Args:
        file: the recording.
        together: its channels lie side by side, and are read at once.

    Raises:
        FormatError: the samples cannot be read.
    """
    shapes = file.shapes()
    for names in [file.names] if together else [[name] for name in file.names]:
        if not (parts := [(part.min(axis=1), part.max(axis=1)) for part in file.chunks(names)]):
            raise FormatError("", "holds no samples")
        extremes = np.array(parts)
        for name, low, high in zip(
            names, extremes[:, 0].min(axis=0), extremes[:, 1].max(axis=0), strict=True
        ):
            shapes[name] += f", {low:.3g} to {high:.3g}"
    return shapes


def _place(channel: ChannelMapping) -> Place:
    """Where a channel of a recording is, which `channels_of` has made sure is one place."""
    return int(cast("float", channel.point)), int(cast("float", channel.direction))


def _placed(channel: Any, first: tuple[int, int, int]) -> Any:
    """A force channel whose place the order of the hits states."""
    if not isinstance(channel, dict) or channel.get("quantity") != "force":
        return channel
    stated = dict(zip(("point", "direction"), first[: 2 if first[2] else 1], strict=False))
    return {
        **channel,
        **{name: value for name, value in stated.items() if channel.get(name) is None},
    }
