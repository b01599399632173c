"""A recording of responses to loads that nobody measured, or that were measured throughout, in the
child process: what a mapping says of it, and whether its channels can be used.

This module imports no database and no web, since the child imports it.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.signal import ChannelQuantity
from fecore.signal.half_spectra import longest_lag_s
from fecore.signal.measured_loads import require_length
from modalbase.formats.errors import FormatError
from modalbase.formats.records import propose_recording
from modalbase.formats.records.arrays import SAMPLE_RATE
from modalbase.formats.records.proposal import time_axis
from modalbase.formats.records.recording import AnyRecording
from modalbase.formats.records.text import TextRecording
from service.compute.recordings import MappedChannels, mapped_channels
from service.tasks.import_file.conditions import STATED, Conditions, read_conditions

_SLICES, _SLICE = 40, 1024
_BURST = 0.5  # of a channel's power in a 40th of a file, from which it does not go on throughout
_FEWEST = 2560  # samples of a recording of responses


@dataclass(frozen=True)
class ReadRecording:
    """A recording of responses and perhaps loads, on its way to the database; its samples stay in the original."""

    format: str  # of the file
    mapping: dict[str, Any]  # by which it was read
    sample_rate_hz: float
    samples: int  # of each channel
    channels: list[dict[str, Any]]  # as the mapping says, in SI units
    conditions: Conditions  # what it states of its campaign


Throughout = Literal["responses", "loads"]


def recorded_throughout(mapping: Any, kind: str | None) -> Throughout | None:
    """Whether a request states a recording of responses alone, or of responses and loads: by its
    kind, or by a mapping of a recording whose channels are all stated, and none or several of which
    are forces. None of hits and FRFs.
    """
    if kind is not None or not isinstance(mapping, dict):
        return cast("Throughout", kind) if kind in get_args(Throughout) else None
    channels = mapping.get("channels")
    if "recording" not in mapping or not isinstance(channels, list) or not channels:
        return None
    stated = [c.get("quantity") if isinstance(c, dict) else None for c in channels]
    if not all(each in get_args(ChannelQuantity) for each in stated):
        return None
    forces = stated.count("force")
    return None if forces == 1 else "loads" if forces else "responses"


def read_responses(
    path: Path,
    mapping: dict[str, Any],
    form: str,
    limit_bytes: int | None,
    kind: Throughout = "responses",
) -> tuple[ReadRecording, MappedChannels, list[str]]:
    """A recording as a mapping describes it, its channels, and what was noticed.

    1. Mapping: which channel is what.
    2. Samples: finite, not constant, no copies of one another, long enough; all of them are read.

    Raises:
        FormatError: the mapping does not fit, or a channel cannot be used; names it.
    """
    # 1. Mapping.
    about = mapping.get("recording") or {}
    if not isinstance(about, dict):
        raise FormatError("mapping.recording", "is not an object")
    for name in (n for n, value in about.items() if value not in (None, []) and n not in STATED):
        known = name in ("order", "least_force")
        why = f"is of hits, and this is of {kind}; leave it out" if known else "is unknown"
        raise FormatError(f"mapping.recording.{name}", why)
    own = mapped_channels(path, mapping, form, limit_bytes, kind)
    # 2. Samples.
    samples, notes = _checked(own, kind)
    recording = ReadRecording(
        form,
        mapping,
        own.sample_rate_hz,
        samples,
        [_described(own, k) for k in range(len(own.mapped))],
        read_conditions(own.file, about),
    )
    forces = [c.quantity for c in own.mapped].count("force")
    moved = f"{forces} loads" if forces else "no channel is a force: loads that nobody measured"
    about_loads = f"{moved} moved the {len(own.names) - forces} sensors"
    return recording, own, [about_loads, *own.file.notes(own.names), *notes]


def _described(own: MappedChannels, row: int) -> dict[str, Any]:
    channel = asdict(own.mapped[row])
    names = ("variable", "quantity", "sensitivity")
    place = {name: int(channel[name]) for name in ("point", "direction")}
    known = {name: channel[name] for name in names}
    return {**known, **place, "full_scale": own.full_scales[row]}


def _checked(own: MappedChannels, kind: Throughout) -> tuple[int, list[str]]:
    """Samples of each channel, and which channels are clipped."""
    samples, names = 0, own.names
    low, high = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    full = np.array([np.inf if each is None else each for each in own.full_scales])
    clipped = np.zeros(len(names), dtype=int)
    for part in own.chunks():
        if not samples:
            _refuse_copies(names, part)
        if (bad := np.argwhere(~np.isfinite(part))).size:
            at = samples + bad[0][1] + 1
            raise FormatError(names[bad[0][0]], f"holds NaN or infinity, first at sample {at}")
        low, high = np.minimum(low, part.min(axis=1)), np.maximum(high, part.max(axis=1))
        clipped += np.sum(np.abs(part) >= full[:, None], axis=1)
        samples += part.shape[1]
    try:
        if kind == "responses":
            longest_lag_s(samples, own.sample_rate_hz)
        else:
            loads = [c.quantity for c in own.mapped].count("force")
            require_length(samples, loads, own.sample_rate_hz)
    except InputError as error:
        raise FormatError("", f"{error.field} {error.message}") from None
    for name in (names[k] for k in np.flatnonzero(low == high)):
        raise FormatError(name, "is constant: a channel that carried nothing")
    return samples, [
        f"{name} is at its full scale in {count} of {samples} samples: it is clipped"
        for name, count in zip(names, clipped, strict=True)
        if count
    ]


def _refuse_copies(names: list[str], part: FloatArray) -> None:
    for k, name in enumerate(names):
        for i in range(k):
            if np.array_equal(part[i] * part[k].max(), part[k] * part[i].max()):
                why = f"holds the same samples as {names[i]}: one channel was written twice"
                raise FormatError(name, why)


def proposed_responses(
    file: AnyRecording, names: list[str], rate: Any
) -> tuple[dict[str, Any], bool] | None:
    """The mapping of a recording of responses that a file suggests whose channels go on throughout
    and none of which is a force; and whether names and units say what all of them are. None where
    it suggests none.

    Args:
        file: the recording.
        names: of its channels.
        rate: `sample_rate_hz` of the mapping; None where the file states it itself, or nothing does.
    """
    proposed = propose_recording(names, file.units)
    quantities = {channel["quantity"] for channel in proposed["channels"]}
    names = [channel["variable"] for channel in proposed["channels"]]
    if not names or "force" in quantities:
        return None
    try:
        if not _goes_on(file.chunks(names)):
            return None
    except FormatError:  # channels of unlike lengths are no recording
        return None
    stated = {} if rate is None else {"sample_rate_hz": rate}
    return {**stated, **proposed, "recording": {}}, None not in quantities


def proposal_of(file: AnyRecording) -> dict[str, Any]:
    """The mapping of a recording that is stated to be of responses: by the names of its channels."""
    axis = file.rate or time_axis(file)
    own = {"sample_rate_hz": {"variable": axis}} if axis and axis != SAMPLE_RATE else {}
    named = propose_recording([name for name in file.names if name != axis], file.units)
    return {**own, **named, "recording": {}}


def _goes_on(chunks: Iterable[FloatArray]) -> bool:
    """Whether no channel has most of its power in a 40th of the file, as a hit has."""
    slices = list[FloatArray]()
    samples = 0
    for part in chunks:
        samples += part.shape[1]
        whole = np.asarray(part, dtype=float)
        begins = np.arange(0, part.shape[1], _SLICE)
        slices += [
            np.stack([own.sum(axis=1), (own**2).sum(axis=1), np.full(len(own), own.shape[1])])
            for own in (whole[:, at : at + _SLICE] for at in begins)
        ]
    if samples < _FEWEST:
        return False
    total, square, count = np.array(slices).transpose(1, 2, 0)
    mean = total.sum(axis=1, keepdims=True) / samples
    power = np.maximum(square - 2 * mean * total + mean**2 * count, 0.0)
    each = np.array([part.sum(axis=1) for part in np.array_split(power, _SLICES, axis=1)])
    return bool(np.all(each.max(axis=0) < _BURST * each.sum(axis=0)))


def table_of(file: AnyRecording) -> dict[str, Any] | None:
    """How a table of text was read."""
    if not isinstance(file, TextRecording):
        return None
    return file.table.layout.described(file.table.encoding)
