"""Time series of SDyPy's proposal SEP 5, "Unified timeseries": to time blocks and back.

A timeseries is a dict, several are a list of them:

    {"name": "hammer", "data": array, "fs": 2048.0, "unit_str": "N", ...}        or "time", an axis in s, in place of "fs"

Readers for it exist for many recorders (Dewesoft, FBGS, NI, ...). The unit says what a channel
is; where it sits, and which hit it is, no series says, so both are stated here.
https://sdypy.readthedocs.io/en/latest/seps/sep-0005.html
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast, get_args

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import ChannelQuantity, TimeBlock
from modalbase.formats.records.mapping import ChannelMapping, blocks_of
from modalbase.formats.records.mapping import Mapping as BlockMapping
from modalbase.formats.records.scale import SI, units_of
from modalbase.formats.units import VOLTAGE, known_units, read_unit

Timeseries = Mapping[str, Any]


@dataclass(frozen=True)
class Place:
    """Where a channel sits: grid point and signed direction, 1 to 3 for x to z."""

    point: int
    direction: int = 3


def records_from_sep005(
    series: Timeseries | Sequence[Timeseries],
    places: Mapping[str, Place | int],
    *,
    hit: int | None = None,
    sensitivities: Mapping[str, float] | None = None,
) -> list[TimeBlock]:
    """Time blocks in SI of SEP 5 time series.

    A series whose data has several rows is one of several hits, all of the same force channel's
    point; each row is one.

    Args:
        series: one channel or a list of them; exactly one measures a force.
        places: of each channel by its name; a number is a grid point, its direction z.
        hit: number of the first hit; None counts from 1.
        sensitivities: by name, what one unit of `unit_str`'s SI quantity makes in volts, for
            channels whose unit is V; such channels state their `quantity`.

    Returns:
        The blocks, hit by hit, the force first.

    Raises:
        FormatError: a series lacks a field, its unit is not known, its axis is uneven, channels are
            unlike, or a place is missing; names it.
    """
    listed = [series] if isinstance(series, Mapping) else list(series)
    faults: list[tuple[str, str]] = []
    entries = [
        entry
        for i, one in enumerate(listed)
        if (entry := _channel(one, f"series.{i}", places, sensitivities or {}, faults)) is not None
    ]
    rates = sorted({entry.rate for entry in entries})
    names = [entry.mapping.variable for entry in entries]
    if not faults and len(set(names)) < len(names):
        faults.append(("series", "hold a name twice: places are by name"))
    if not faults and sum(entry.mapping.quantity == "force" for entry in entries) != 1:
        faults.append(("series", "have not exactly one channel that measures a force"))
    if not faults and len(entries) < 2:
        faults.append(("series", "have no response"))
    if not faults and rates[-1] - rates[0] > 1e-9 * rates[-1]:
        faults.append(
            ("series", f"differ in sampling rate: {', '.join(f'{rate:g} Hz' for rate in rates)}")
        )
    if faults:
        raise FormatError(faults)
    variables = {entry.mapping.variable: entry.data for entry in entries}
    rows = max(
        1, next(iter(variables.values())).size // np.shape(next(iter(variables.values())))[-1]
    )
    number: Any = None
    if hit is not None:
        variables["\0hit"] = np.arange(hit, hit + rows, dtype=float)  # no channel has such a name
        number = "\0hit"
    return blocks_of(
        variables, BlockMapping(rates[0], tuple(entry.mapping for entry in entries), number)
    )


@dataclass(frozen=True)
class _Entry:
    mapping: ChannelMapping
    data: np.ndarray[Any, Any]
    rate: float


def _channel(
    one: Any,
    place: str,
    places: Mapping[str, Place | int],
    sensitivities: Mapping[str, float],
    faults: list[tuple[str, str]],
) -> _Entry | None:
    if not isinstance(one, Mapping):
        faults.append(
            (
                place,
                (
                    f"is a {type(one).__name__}, expected a dict with data, name, unit_str and fs"
                    " or time"
                ),
            )
        )
        return None
    before = len(faults)
    faults += [
        (f"{place}.{name}", "is missing")
        for name in ("data", "name", "unit_str")
        if name not in one
    ]
    if one.get("fs") is None and one.get("time") is None:
        faults.append((f"{place}.fs", "is missing, and so is time: the sampling rate is not known"))
    if len(faults) > before:
        return None
    name = str(one["name"])
    try:
        data = np.asarray(one["data"])
        numeric = data.dtype.kind in "fiu" and data.size > 0
    except ValueError:
        numeric = False
    if not numeric:
        faults.append((f"{place}.data", "holds no numbers"))
        return None
    rate = _rate(one, data, place, faults)
    meaning = _meaning(one, name, place, sensitivities, faults)
    at = places.get(name)
    if at is None:
        faults.append(
            (
                f"places.{name}",
                f"is missing; places are stated for {', '.join(sorted(places)) or 'none'}",
            )
        )
    if len(faults) > before or at is None or rate is None or meaning is None:
        return None
    stands = at if isinstance(at, Place) else Place(int(at))
    quantity, per_si = meaning
    mapping = ChannelMapping(name, quantity, float(stands.point), float(stands.direction), per_si)
    return _Entry(mapping, data, rate)


def _rate(
    one: Timeseries, data: np.ndarray[Any, Any], place: str, faults: list[tuple[str, str]]
) -> float | None:
    samples = data.shape[-1] if data.ndim else 0
    rate: float | None = None
    if one.get("time") is not None:
        time = np.ravel(np.asarray(one["time"], dtype=float))
        if time.size != samples:
            faults.append((f"{place}.time", f"has {time.size} values, the data {samples} samples"))
            return None
        step = float(time[-1] - time[0]) / max(samples - 1, 1)
        if (
            not step > 0
            or np.abs(np.diff(time) - step).max()
            > 1e-3 * step + 1e-6 * abs(float(time[-1])) / samples
        ):
            faults.append((f"{place}.time", "is not an evenly rising axis in seconds"))
            return None
        rate = 1 / step
    if one.get("fs") is not None:
        stated = float(one["fs"])
        if not (np.isfinite(stated) and stated > 0):
            faults.append((f"{place}.fs", f"is {stated:g}, expected samples a second"))
            return None
        if rate is not None and abs(rate / stated - 1) > 1e-3:
            faults.append((f"{place}.fs", f"is {stated:g} Hz, the axis in time says {rate:g} Hz"))
            return None
        rate = stated
    return rate


def _meaning(
    one: Timeseries,
    name: str,
    place: str,
    sensitivities: Mapping[str, float],
    faults: list[tuple[str, str]],
) -> tuple[ChannelQuantity, float] | None:
    """What a channel measures, and how much of its numbers one SI unit is."""
    text = str(one["unit_str"])
    unit = read_unit(text)
    quantity = one.get("quantity") if unit is None or unit.dimension == VOLTAGE else unit.quantity
    fault = ""
    if len(units_of(name, quantity, {name: text})) > 1:
        fault = (
            f"is {text!r}, and the name {name!r} states another unit; correct the one that is wrong"
        )
    elif unit is not None and unit.quantity in SI:
        return cast("ChannelQuantity", unit.quantity), 1 / unit.factor
    elif unit is None or unit.dimension != VOLTAGE:
        known = "; ".join(known_units(each) for each in get_args(ChannelQuantity))
        fault = f"is {text!r}, expected one of {known}; or V with a sensitivity"
    elif name in sensitivities and quantity in SI:
        return cast("ChannelQuantity", quantity), sensitivities[name] / unit.factor
    else:
        fault = f"is {text}: state `quantity` ({', '.join(SI)}) and a sensitivity for {name!r}"
    faults.append((f"{place}.unit_str", fault))
    return None


def records_to_sep005(blocks: Sequence[TimeBlock]) -> list[dict[str, Any]]:
    """SEP 5 time series of time blocks, one a block, in SI.

    Point, direction and hit, which the proposal has no fields for, stand in fields of their own:
    `point`, `direction`, `force_point`, `force_direction`, `hit`; an analyser's window in
    `window_rate_per_s`.
    """
    return [
        {
            "name": block.label or f"{block.quantity} {block.point}",
            "data": np.asarray(block.samples),
            "fs": block.sample_rate_hz,
            "unit_str": SI[block.quantity],
            "quantity": block.quantity,
            "point": block.point,
            "direction": block.direction,
            "force_point": block.force_point,
            "force_direction": block.force_direction,
            "hit": block.hit,
            "window_rate_per_s": block.window_rate_per_s,
        }
        for block in blocks
    ]
