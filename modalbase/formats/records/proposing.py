"""A mapping that the names and shapes of a file's arrays suggest."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from modalbase.formats.records.arrays import Variables
from modalbase.formats.records.blocks import ChannelQuantity
from modalbase.formats.records.mapping import FEWEST_SAMPLES

_RATES = ("fs", "sr", "samplerate", "sampleratehz", "samplingrate", "samplingfrequency")
_NAMES: dict[ChannelQuantity, tuple[str, ...]] = {
    "force": ("force", "hammer", "exc"),
    "acceleration": ("acc", "response", "resp"),
    "velocity": ("vel",),
    "displacement": ("disp",),
}


def propose(variables: Variables) -> dict[str, Any]:
    """A mapping that the names and shapes suggest, to be looked at and completed; sensitivities and points are the
    user's.

    Where no name says what a channel is, every variable as long as the time axis is proposed with the quantity "?".
    """
    long = {name: a for name, a in variables.items() if a.size >= FEWEST_SAMPLES and np.squeeze(a).ndim in (1, 2)}
    rate = next((n for n, a in variables.items() if a.size == 1 and _plain(n).endswith(_RATES)), None)
    time = next((n for n, a in long.items() if re.split(r"[_.]", n.lower())[0] in ("time", "t") and _ascends(a)), None)
    point: Any = {"variable": "point"} if "point" in variables else 1
    channels = [
        {
            "variable": name,
            "quantity": quantity,
            "sensitivity": 1.0,
            "point": point if quantity == "force" else 1,
            "direction": 3,
        }
        for quantity, names in _channels(long, time).items()
        for name in names
    ]
    found: dict[str, Any] = {"channels": channels}
    if rate or time:
        found["sample_rate_hz"] = {"variable": rate or time}
    if "hit" in variables:
        found["hit"] = {"variable": "hit"}
    return found


def propose_recording(names: Iterable[str]) -> dict[str, Any]:
    """The same of a recording of many hits, by the names of its channels: "?" where one does not say what it is. One such as
    `acceleration_33_-3`, as the channels of a UFF are called, says its point and direction, too.
    """
    channels: list[dict[str, Any]] = []
    for name in names:
        quantity = next((q for q, parts in _NAMES.items() if any(part in name.lower() for part in parts)), "?")
        place = re.fullmatch(r"[a-z]+_(\d+)_(-?\d)", name)
        point, direction = (int(place[1]), int(place[2])) if place else (0, 3)
        said = {"variable": name, "quantity": quantity, "sensitivity": 1.0, "direction": direction}
        channels.append(said | ({"point": point} if point else {}))
    return {"recording": {"order": []}, "channels": channels}


def _channels(long: Variables, time: str | None) -> dict[str, list[str]]:
    """Names of the channels by quantity; by length alone where no name says one."""
    named: dict[str, list[str]] = {
        quantity: [n for n in long if any(s in n.lower() for s in starts) and "time" not in n.lower()]
        for quantity, starts in _NAMES.items()
    }
    if any(named.values()) or time is None:
        return named
    samples = long[time].size
    return {"?": [n for n, a in long.items() if n != time and samples in a.shape and a.dtype.kind in "fiu"]}


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())


def _ascends(array: np.ndarray[Any, Any]) -> bool:
    return array.dtype.kind in "fiu" and bool(np.all(np.diff(np.ravel(array)) > 0))
