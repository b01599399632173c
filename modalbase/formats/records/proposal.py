"""Mappings that suggest themselves: what a file says of its channels, in its own words, and nothing
that it does not say.

What is empty (null) is the user's to fill in; a mapping that is sent with it is refused, and names
it.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args

import numpy as np

from modalbase.formats.records.arrays import (
    ChannelQuantity,
    Variables,
    array_of,
    columns_of,
    rate_among,
    variable,
)
from modalbase.formats.records.mapping import FEWEST_SAMPLES
from modalbase.formats.records.recording import AnyRecording
from modalbase.formats.records.scale import SI, units_of
from modalbase.formats.units import VOLTAGE, Measured, read_unit, unit_beside, unit_in_name

_NAMES: dict[ChannelQuantity, tuple[str, ...]] = {
    "force": ("force", "hammer", "exc", "kraft", "marteau"),
    "acceleration": ("acc", "beschl", "accél"),
    "velocity": ("vel", "geschw", "vitesse"),
    "displacement": ("disp",),
}
_TIMES = (".t", "time", "zeit", "temps", "x_value")  # LabVIEW calls the axis X_Value
# of a table without headings, whose first column may be the time axis
_UNNAMED = re.compile(r"(?:.+ )?column \d+", re.DOTALL)
_OTHERS = ("resp",)  # names a channel, and not what it measures


def propose(variables: Variables, units: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The mapping that names, units and shapes suggest.

    Where names and units do not say both a force and a response, every variable of their length is
    proposed, with an empty quantity where it is not known.

    Args:
        variables: arrays of a file.
        units: that its properties state, by variable.
    """
    long = {
        name: a
        for name, a in variables.items()
        if a.size >= FEWEST_SAMPLES and np.squeeze(a).ndim in (1, 2)
    }
    rate = rate_among(name for name, a in variables.items() if a.size == 1)
    counts = [len(columns_of(n, a.shape)) for n, a in long.items() if not is_time(n, units)]
    if len(counts) == 1 or len(set(counts)) > 1:  # channels, and no blocks, lie side by side
        long = {
            name: variable(variables, name)
            for own, a in long.items()
            for name in columns_of(own, a.shape) or [own]
        }
    times = [name for name in long if is_time(name, units)] or [
        name for name in long if _UNNAMED.fullmatch(name)
    ][:1]
    axes = [name for name in times if _ascends(long[name])]
    time = axes[0] if axes else None
    point: Any = {"variable": "point"} if "point" in variables else None
    channels = []
    for name in _channels(long, axes, units or {}):
        channel = _channel(name, units or {})
        at = point if channel["quantity"] == "force" else None
        channels.append(channel if channel["point"] or at is None else channel | {"point": at})
    mapping: dict[str, Any] = {"channels": sorted(channels, key=lambda c: c["quantity"] != "force")}
    if rate or time:
        mapping["sample_rate_hz"] = {"variable": rate or time}
    if "hit" in variables:
        mapping["hit"] = {"variable": "hit"}
    return mapping


def propose_recording(
    names: Iterable[str], units: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """The same of a recording of many hits, by the names of its channels. One such as
    `acceleration_33_-3`, as the channels of a UFF are called, says its point and direction, too.
    """
    channels = [_channel(name, units or {}) for name in names if not is_time(name, units)]
    return {"recording": {"order": []}, "channels": channels}


def time_axis(file: AnyRecording) -> str | None:
    """The channel that is the time axis: by its name, or the first of columns without names where
    it rises.
    """
    named = [name for name in file.names if is_time(name, file.units)]
    unnamed = [name for name in file.names if _UNNAMED.fullmatch(name)][:1]
    rising = (name for name in unnamed if _ascends(next(iter(file.chunks([name])))[0]))
    return next(iter([*named, *rising]), None)


def _channel(name: str, units: Mapping[str, str]) -> dict[str, Any]:
    by_name = _by_name(name)
    texts = units_of(name, by_name, units)
    unit = read_unit(texts[0]) if len(texts) == 1 else None
    by_unit = (
        unit.quantity if unit is not None and unit.quantity in get_args(ChannelQuantity) else None
    )
    place = re.fullmatch(r"[a-z]+_(\d+)_(-?\d)", name)
    return {
        "variable": name,
        "quantity": None if by_name and by_unit and by_name != by_unit else by_unit or by_name,
        "unit": texts[0] if len(texts) == 1 else None,
        **({} if by_unit else {"sensitivity": None}),
        "point": int(place[1]) or None if place else None,
        "direction": int(place[2]) if place else None,
    }


def _by_name(name: str) -> ChannelQuantity | None:
    """What a channel is by its own name, that of its group apart."""
    own = unit_in_name(name)[0].lower().rpartition("/")[2]
    return next(
        (quantity for quantity, parts in _NAMES.items() if any(part in own for part in parts)), None
    )


def _channels(long: Variables, axes: Sequence[str], units: Mapping[str, str]) -> list[str]:
    """Names of the channels: those that a name or unit says, and every other column of their
    length, its quantity empty, where force or response are not among them.
    """
    others = [
        n for n, a in long.items() if n not in axes and a.dtype.kind in "fiu" and not _counts(a)
    ]
    known = {name: _channel(name, units)["quantity"] for name in others}
    named = [
        name
        for name in others
        if "time" not in name.lower()
        and (
            known[name] or _is_voltage(name, units) or any(part in name.lower() for part in _OTHERS)
        )
    ]
    quantities = {known[name] for name in named}
    if None in quantities or (len(quantities | {"force"}) > 1 and "force" in quantities):
        return named
    lengths = Counter(max(long[name].shape) for name in [*named, *axes] or others)
    samples = max(lengths, key=lambda length: (lengths[length], length), default=0)
    return [n for n in others if samples in long[n].shape]


def _is_voltage(name: str, units: Mapping[str, str]) -> bool:
    return any(
        (unit := read_unit(text)) is not None and unit.dimension == VOLTAGE
        for text in units_of(name, None, units)
    )


def _counts(array: np.ndarray[Any, Any]) -> bool:
    """Whether an array only numbers its lines."""
    values = np.ravel(array)
    return values.size > 1 and values[0] in (0, 1) and bool(np.all(np.diff(values) == 1))


def is_time(name: str, units: Mapping[str, str] | None = None) -> bool:
    """Whether a column or variable is a time axis by its name, or by the unit that is stated of it.

    >>> [is_time(name) for name in ("time_ms", "X_Value", "Prüfzeit (s)", "m.t", "X [ms]", "Timestamp", "Temperature")]
    [True, True, True, True, True, True, False]
    """
    bare = re.sub(r" \d+$", "", unit_in_name(name, "time")[0].lower())  # "X_Value 2", a second one
    parts = re.split(r"[_.\s]", bare)
    texts = units_of(name, None, units or {})
    in_time = any(
        (unit := read_unit(text)) is not None and unit.quantity == "time" for text in texts
    )
    return in_time or parts[0] in ("time", "t", "timestamp", "zeitstempel") or bare.endswith(_TIMES)


def units_beside(names: Iterable[str], texts: Mapping[str, str]) -> dict[str, str]:
    r"""Units that texts of a file state of its arrays and their columns, which have a line each
    where there are several. One that a whole structure has is not that of its time axis or rate.

    >>> units_beside(["Acc.t", "Acc.fs", "Acc.y column 1"], {"Acc.units": "m/s^2"})
    {'Acc.y column 1': 'm/s^2'}
    >>> units_beside(["y column 1", "y column 2"], {"y_unit": "N\ng"})
    {'y column 1': 'N', 'y column 2': 'g'}
    """
    stated = {
        name: _line_of(name, unit_beside(array_of(name), texts, _of_axis(name))) for name in names
    }
    return {
        name: text
        for name, text in stated.items()
        if text
        and not (
            (is_time(name) or rate_among([name]))
            and (unit := read_unit(text))
            and unit.quantity in SI
        )
    }


def _of_axis(name: str) -> Measured | None:
    """What a time axis or a sampling rate is, by its name; None of others."""
    return "time" if is_time(name) else "frequency" if rate_among([name]) else None


def _line_of(name: str, text: str) -> str:
    """The line of a text that is a column's, or its only one."""
    lines = text.split("\n")
    place = name.removeprefix(f"{array_of(name)} column ")
    at = int(place) - 1 if place.isdigit() and len(lines) > 1 else 0
    return lines[at] if at < len(lines) and (at or place.isdigit() or len(lines) == 1) else ""


def _ascends(array: np.ndarray[Any, Any]) -> bool:
    """Whether an array rises; one that is rounded or has gaps is refused by name where it is
    read.
    """
    values = np.ravel(array)
    if array.dtype.kind not in "fiu":
        return False
    steps = np.diff(values[np.isfinite(values)])
    return steps.size > 0 and bool(np.all(steps >= 0) and steps.sum() > 0)
