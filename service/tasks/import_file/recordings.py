"""A long recording of many hits, in the child process: the hits are found and their blocks cut, one
at a time.

This module imports no database and no web, since the child imports it.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fecore.errors import InputError
from fecore.signal.pulse import LEAD
from fecore.signal.recording import Impact, Survey, cut, survey
from modalbase.formats.errors import FormatError
from modalbase.formats.records import (
    TimeBlock,
    propose,
    propose_recording,
)
from modalbase.formats.records.arrays import Variables
from modalbase.formats.records.recording import (
    AnyRecording,
    Arrays,
    Recording,
    read_recording,
)
from modalbase.formats.records.uff import is_force, open_uff
from service.compute.recordings import MappedChannels, mapped_channels, place_of
from service.tasks.import_file.responses import proposed_responses

Place = tuple[int, int]
_MOST_NAMED = 60
_RECORDING = "mapping.recording"


@dataclass(frozen=True)
class Channels(MappedChannels):
    """Those of a recording of hits, the force first, and where each hit was."""

    stated: Recording  # the order of the hits; where it is empty, all are at the force's point

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
            return [place_of(force)] * len(hits)
        if order[0][2] == 0:
            return [(order[0][0], place_of(force)[1])] * len(hits)
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
                own = place if c.quantity == "force" else place_of(c)
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
    stated = read_recording(document["recording"], filename)
    # the order says where the hammer hits
    if stated.order and isinstance(document.get("channels"), list):
        placed = [_placed(channel, stated.order[0]) for channel in document["channels"]]
        document = {**document, "channels": placed}
    own = mapped_channels(path, document, form, limit_bytes)
    return Channels(own.file, own.sample_rate_hz, own.mapped, stated)


def recording_in_uff(path: Path, channels: Counter[str]) -> tuple[Variables, dict[str, Any]] | None:
    """The blocks of a UFF file and the mapping of a recording of hits that they suggest; None where
    they are single hits.

    The blocks are read again, so that only a file with one block of one hammer and one of each
    sensor has them in memory.

    Args:
        path: of the file.
        channels: how many blocks each channel has, by `channel_of`.
    """
    if sum(map(is_force, channels)) != 1 or channels.total() > len(channels):
        return None
    try:
        file = open_uff(path)
    except FormatError:  # channels of two rates are no recording
        return None
    proposed = proposed_recording(file)
    return None if proposed is None else (file.variables, proposed)


def responses_in_uff(path: Path, channels: Counter[str]) -> Arrays | None:
    """The blocks of a UFF file that are one recording of responses; None where they are none.

    Args:
        path: of the file.
        channels: how many blocks each channel has, by `channel_of`.
    """
    if not channels or channels.total() > len(channels) or any(map(is_force, channels)):
        return None
    try:
        return open_uff(path)
    except FormatError:  # channels of two rates are no recording
        return None


def proposed_recording(file: Arrays) -> dict[str, Any] | None:
    """The mapping of a recording that arrays suggest whose force holds several hits, or which go on
    throughout and none is a force; None where they do not.
    """
    mapping = propose(file.variables, file.units)
    names = [channel["variable"] for channel in mapping["channels"]]
    if not names or not set(names) <= set(file.names):
        return None
    if mapping["channels"][0]["quantity"] != "force":
        responses = proposed_responses(file, names, mapping.get("sample_rate_hz"))
        return None if responses is None else responses[0]
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


def _placed(channel: Any, first: tuple[int, int, int]) -> Any:
    """A force channel whose place the order of the hits states."""
    if not isinstance(channel, dict) or channel.get("quantity") != "force":
        return channel
    stated = dict(zip(("point", "direction"), first[: 2 if first[2] else 1], strict=False))
    return {
        **channel,
        **{name: value for name, value in stated.items() if channel.get(name) is None},
    }
