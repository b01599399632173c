"""Named arrays with the sampling rate among them, and time blocks: what one channel recorded of one
hit.
"""

import io
import re
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.types import FloatArray
from modalbase.formats.units import Measured, factor_of, unit_in_name

Variables = dict[str, np.ndarray[Any, Any]]

SAMPLE_RATE = "sample_rate_hz"
"""Name of the variable that a wav file's own sampling rate becomes."""

PREAMBLE_RATE = "preamble@rate"
"""Name of the rate that lines above a table state beside its time axis."""

MOST_COLUMNS = 1000
"""Of a matrix whose columns are channels."""
_COLUMN = re.compile(r"(.+) column ([1-9]\d*)", re.DOTALL)
_RATES = ("fs", "sr", "samplerate", "samplingrate", "samplingfrequency")
_FIRST = 16
_STARTS = ("start_value", "xstart", "x0", "t0", "start_time")
UNEVEN = 1e-3
"""By which the steps of a time axis may differ, of their mean."""
_OTHER_RATE = 0.01  # by which a stated rate may differ from the file's own
# no analyser of vibrations samples faster, and 50 samples a second are by an axis that counts days
_FASTEST_HZ = 4e6


def rate_among(names: Iterable[str]) -> str | None:
    """Which of these single numbers is a sampling rate by its name: `fs`, `SampleRate`, `m.fs`.

    >>> rate_among(["offs", "n", "m.fs"]), rate_among(["gain"])
    ('m.fs', None)
    """
    parts = {
        name: re.split(r"[^a-z]+", name.lower().removesuffix("hz").rstrip("_")) for name in names
    }
    return next(
        (n for n, own in parts.items() if own[-1] in _RATES or "".join(own[-2:]) in _RATES), None
    )


def columns_of(name: str, shape: Sequence[int]) -> list[str]:
    """Names of the channels that lie side by side in a matrix; its longer side is the time.

    >>> columns_of("data", (30000, 2)), columns_of("data", (30000, 1))
    (['data column 1', 'data column 2'], [])
    """
    return [f"{name} column {k}" for k in range(1, _columns(shape) + 1)]


def _columns(shape: Sequence[int]) -> int:
    """How many channels lie side by side in a matrix."""
    sides = sorted(int(n) for n in shape if n != 1)
    return sides[0] if len(sides) == 2 and sides[0] <= MOST_COLUMNS else 0


def channels_of(name: str, shape: Sequence[int]) -> list[str]:
    """Names of the channels of an array: itself where it has one dimension, or its columns; none of
    another one, or of a single number.

    >>> channels_of("acc", (1, 30000)), channels_of("data", (30000, 2)), channels_of("cube", (9, 9, 9))
    (['acc'], ['data column 1', 'data column 2'], [])
    """
    sides = [n for n in shape if n != 1]
    return [] if 0 in sides else [name] if len(sides) == 1 else columns_of(name, sides)


def array_of(name: str) -> str:
    """The array of which a name is a column, or itself."""
    parts = _COLUMN.fullmatch(name)
    return parts[1] if parts else name


def variable(variables: Variables, name: str) -> np.ndarray[Any, Any]:
    """The array of a name, or the column of a matrix, `data column 3`.

    Raises:
        FormatError: the file has none; lists those that it has.
    """
    if name in variables:
        return variables[name]
    parts = _COLUMN.fullmatch(name)
    if parts and parts[1] in variables:
        number, table = int(parts[2]), np.squeeze(variables[parts[1]])
        if number <= _columns(table.shape):
            return (table if table.shape[0] >= table.shape[1] else table.T)[:, number - 1]
    raise FormatError(name, f"is not in the file; it has {', '.join(sorted(variables))}")


NO_NUMBERS: Mapping[str, np.ndarray[Any, Any]] = MappingProxyType({})
"""Of a recording that holds channels alone."""


def single_numbers(variables: Variables) -> Variables:
    """The variables that are one number, which no channel is."""
    return {n: each for n, each in variables.items() if each.size == 1 and each.dtype.kind in "iuf"}


def require_one_clock(variables: Variables, names: Iterable[str]) -> None:
    """Refuse channels whose own time axes, starts or rates differ: `Acc.t` and `Hammer.t`,
    `Data1_time_Acc` of `Data1_Acc`, `daq.acc@start_time` of `daq.acc`.

    Raises:
        FormatError: as said; names both.
    """
    names = list(names)
    rising = {name for name, array in variables.items() if _is_axis(array)}
    axes = {name: own for name in names if (own := _axis_of(variables, rising, name)) is not None}
    first = next(iter(axes.values()), "")
    for name, axis in axes.items():
        one, other = (np.ravel(variables[own]).astype(float) for own in (first, axis))
        step = 0.01 * (one[-1] - one[0]) / (one.size - 1) if one.size > 1 else 1e-6
        if one.size != other.size or np.any(np.abs(one - other) > step):
            raise FormatError(
                axis,
                f"begins {name} at {other[0]:.6g} with {other.size} values, and {first} says"
                f" {one[0]:.6g} and {one.size}; the channels of a hit are on one clock: export them"
                " over the same times",
            )
    single = single_numbers(variables)
    rates = {own: float(single[own].item()) for name in names
             if (own := rate_among(_beside(single, array_of(name)))) is not None}  # fmt: skip
    if rates and max(rates.values()) - min(rates.values()) > _OTHER_RATE * max(rates.values()):
        listed = " and ".join(f"{own} is {rate:g}" for own, rate in rates.items())
        raise FormatError("mapping.sample_rate_hz", f"is one of all channels, and {listed}")


def _beside(variables: Iterable[str], own: str) -> list[str]:
    """What stands beside an array itself: its attributes, those of the nearest group that has any,
    and what else is in its structure.
    """
    names, parts = list(variables), own.split(".")
    for depth in range(len(parts), 0, -1):
        inside = re.compile(re.escape(".".join(parts[:depth])) + r"[.@][^.@]+")
        if near := [name for name in names if name != own and inside.fullmatch(name)]:
            return near
    return []


def _axis_of(variables: Variables, rising: Set[str], name: str) -> str | None:
    """The time axis, one of what rises evenly, or the start that stands beside a channel, within its
    structures or by its name.
    """
    own = array_of(name)
    size = max(np.shape(variables.get(own, 0)), default=0)
    parts = own.split(".")
    for depth in range(len(parts) - 1, 0, -1):
        inside = [v for v in variables if v.startswith(".".join(parts[:depth]) + ".") and v != own]
        if axes := [v for v in inside if v in rising and variables[v].size == size]:
            return axes[0] if len(axes) == 1 else None
        if starts := [v for v in inside if "@" not in v and _is_start(v, variables[v])]:
            return starts[0]
    if starts := [v for v in _beside(variables, own) if _is_start(v, variables[v])]:
        return starts[0]
    fitting = (v for v in variables if v in rising and v != own and variables[v].size == size)
    bare = ((v, re.sub(r"_?time", "", v, count=1, flags=re.IGNORECASE)) for v in fitting)
    return next((v for v, channel in bare if channel == own), None)


def _is_axis(array: np.ndarray[Any, Any]) -> bool:
    """Whether it is a vector of values that rise evenly."""
    if array.size < 3 or max(array.shape) != array.size or array.dtype.kind != "f":
        return False
    if np.any(np.diff(np.ravel(array)[:_FIRST]) <= 0):  # as most channels begin
        return False
    steps = np.diff(np.ravel(array))
    return bool(
        np.all(steps > 0) and np.ptp(steps) <= 2 * UNEVEN * steps.mean() + 1e-6 * array.max()
    )


def _is_start(name: str, array: np.ndarray[Any, Any]) -> bool:
    return (
        array.size == 1
        and array.dtype.kind in "fiu"
        and re.split(r"[.@]", name)[-1].lower() in _STARTS
    )


def described(array: np.ndarray[Any, Any]) -> str:
    """Type and shape of an array, and its least and greatest value where it has such."""
    extent = (
        ""
        if array.dtype.kind == "c" or not array.size
        else f", {array.min():.3g} to {array.max():.3g}"
    )
    return f"{array.dtype} {list(array.shape)}{extent}"


def is_named(given: Any) -> bool:
    """Whether a mapping's value is `{"variable": name}`."""
    return (
        isinstance(given, dict)
        and set(given) == {"variable"}
        and isinstance(given["variable"], str)
    )


def sampling_rate(
    variables: Variables, given: float | str, samples: int, units: Mapping[str, str] | None = None
) -> float:
    """Samples a second: a number, or the name of the variable that holds it or the time axis of so
    many samples, in the unit that its name or the file's properties state.

    Raises:
        FormatError: it is no rate, the axis is uneven or of another length, or the file says
            another.
    """
    if not isinstance(given, str):
        rate = float(given)
        own = variables.get(SAMPLE_RATE, np.array(rate))
        if (
            own.size == 1
            and own.dtype.kind != "c"
            and abs(rate - float(own.item())) > _OTHER_RATE * abs(rate)
        ):
            raise FormatError(
                "mapping.sample_rate_hz",
                f'is {rate:g}, and the file says {float(own.item()):g}; state {{"variable":'
                f' "{SAMPLE_RATE}"}}',
            )
    else:
        values = real(np.ravel(variable(variables, given)), given)
        if values.size == 1:
            rate = float(values[0]) * _factor_of(given, "frequency", units or {})
        elif values.size == samples:
            rate = axis_rate(given, [values], samples, units)
            stated = float(variables.get(PREAMBLE_RATE, np.array(rate)).item())
            if abs(rate - stated) > _OTHER_RATE * rate:
                raise FormatError(
                    "mapping.sample_rate_hz",
                    f"is {rate:g} by {given}, and the preamble states {stated:g}; state the one that"
                    " is right as a number",
                )
            return rate
        else:
            raise FormatError(
                given, f"has {values.size} values, expected the rate or a time axis of {samples}"
            )
    return _plausible(rate)


@dataclass(frozen=True)
class TimeAxis:
    """A time axis of a recording, in its own unit.

    Attributes:
        first, last: its ends.
        step: mean between two values.
        uneven: by how much one step differs most from it.
        sample: to which that step leads, from 1.
    """

    first: float
    last: float
    step: float
    uneven: float
    sample: int

    @classmethod
    def of(cls, name: str, parts: Iterable[FloatArray], samples: int) -> "TimeAxis":
        """The axis of so many values, which come one behind the other.

        Raises:
            FormatError: a value is no number; names the axis.
        """
        count, first, last = 0, 0.0, 0.0
        steps = {-1: (0.0, 1), 1: (0.0, 1)}  # the shortest and the longest, each with its sample
        for part in parts:
            if (bad := np.flatnonzero(~np.isfinite(part))).size:
                why = f"row {count + bad[0] + 1} of the data has no number; state the rate as a number"
                raise FormatError(name, f"is not an evenly rising time axis: {why}")
            own = np.diff(np.concatenate(([last], part) if count else (part,)).astype(float))
            first = first if count else float(part[0])
            for sign, (extreme, _) in steps.items() if own.size else ():
                at = int(np.argmax(sign * own))
                if steps[sign][1] == 1 or sign * own[at] > sign * extreme:
                    steps[sign] = float(own[at]), count + at + (1 if count else 2)
            count, last = count + part.size, float(part[-1])
        step = (last - first) / max(samples - 1, 1)
        uneven, sample = max((abs(length - step), at) for length, at in steps.values())
        return cls(first, last, step, uneven, sample)

    def is_even(self, most: float, rounding: float = 0.0) -> bool:
        """Whether no step differs by more than a part of the mean one, and a part of the last
        value, to which values may be rounded.
        """
        return self.step > 0 and self.uneven <= most * self.step + rounding * abs(self.last)


def axis_rate(
    name: str, parts: Iterable[FloatArray], samples: int, units: Mapping[str, str] | None = None
) -> float:
    """Samples a second by a time axis.

    Args:
        name: of the axis.
        parts: its values, one behind the other.
        samples: how many.
        units: that the file's properties state, by channel.

    Raises:
        FormatError: it does not rise evenly; names the sample where it differs most.
    """
    axis = TimeAxis.of(name, parts, samples)
    if not axis.is_even(UNEVEN, 1e-6):
        raise FormatError(
            name,
            f"is not an evenly rising time axis, most at sample {axis.sample}; state the rate as a"
            " number where it is rounded",
        )
    return _plausible(1 / axis.step / _factor_of(name, "time", units or {}))


def _plausible(rate: float) -> float:
    if not 0 < rate <= _FASTEST_HZ:
        expected = (
            f"expected a positive number of samples a second, up to {_FASTEST_HZ:g}; state it as a"
            " number where a time axis counts days or has no unit"
        )
        raise FormatError("mapping.sample_rate_hz", f"is {rate:g}, {expected}")
    return float(f"{rate:.12g}")


def _factor_of(name: str, quantity: Measured, units: Mapping[str, str]) -> float:
    """The SI value of the unit that a file states of a rate or time axis; 1 where it states none.

    Raises:
        FormatError: it is a unit of something else.
    """
    unit = unit_in_name(name, quantity)[1] or units.get(name, "")
    factor = factor_of(quantity, unit) if unit else 1.0
    if factor is None:
        raise FormatError(
            name, f"is in {unit!r}, expected a {quantity} (state the rate as a number otherwise)"
        )
    return factor


def real(values: np.ndarray[Any, Any], name: str) -> FloatArray:
    """Values as reals.

    Raises:
        FormatError: they are complex.
    """
    if values.dtype.kind == "c":
        raise FormatError(name, "holds complex numbers")
    with np.errstate(invalid="ignore"):  # what is no number is refused where it is used
        return np.asarray(values, dtype=float)


ChannelQuantity = Literal["force", "acceleration", "velocity", "displacement"]


@dataclass(frozen=True, eq=False)
class TimeBlock:
    """One channel's time block of one hit, in SI.

    Attributes:
        quantity: what the samples are.
        point, direction: where the sensor sits, or where the hammer hit for a force.
        force_point, force_direction: where the hit was that this block belongs to.
        hit: number of the hit at its point, from 1.
        sample_rate_hz: samples a second.
        samples: (n,) float32 or float64, N, m/s², m/s or m.
        window_rate_per_s: r where the analyser has multiplied the block by exp(-r t); 0 for none.
        full_scale: largest magnitude that the channel can record, in SI; None where it is not
            known.
        sensitivity: volts (or counts) per SI unit that the samples were divided by; 1 where they
            were in SI.
        label: name of the variable or column, or the first ID line.
        start_sample: of a block cut from a recording, its first sample there, from 0; None where it
            was recorded alone.
    """

    quantity: ChannelQuantity
    point: int
    direction: int
    force_point: int
    force_direction: int
    hit: int
    sample_rate_hz: float
    samples: FloatArray
    window_rate_per_s: float = 0.0
    full_scale: float | None = None
    sensitivity: float = 1.0
    label: str = ""
    start_sample: int | None = None


def arrays_of(blocks: Sequence[TimeBlock], *, numbered: bool) -> tuple[bytes, dict[str, Any]]:
    """Blocks as one npz with its mapping, as `POST /campaigns/{id}/records` takes them.

    Args:
        blocks: of whole hits, hit by hit, of the same sensors, sampling rate and length, the force
            first, as `blocks_of` and `records_from_sep005` give them.
        numbered: their hit numbers are meant; else the hits of each point are counted on.

    Returns:
        The npz, and the mapping that says what its arrays are.
    """
    sensors = {(block.quantity, block.label): block for block in blocks}
    variables: dict[str, Any] = {}
    channels = []
    for number, (key, first) in enumerate(sensors.items(), 1):
        own = [block for block in blocks if (block.quantity, block.label) == key]
        # the samples are in SI, whatever they were in
        name, unit = unit_in_name(first.label, first.quantity)
        # savez has an argument `file`
        name = name if name not in ("", "file", *variables) else f"channel_{number}"
        variables[name] = np.array([block.samples for block in own])
        variables[f"_point_{number}"] = np.array([block.point for block in own])
        variables[f"_direction_{number}"] = np.array([block.direction for block in own])
        channels.append(
            {
                "variable": name,
                "quantity": first.quantity,
                "point": {"variable": f"_point_{number}"},
                "direction": {"variable": f"_direction_{number}"},
                "window_rate_per_s": first.window_rate_per_s,
                "full_scale": first.full_scale,
            }
            | ({"label": [block.label for block in own]} if unit else {})
        )
        variables["_hit"] = np.array([block.hit for block in own])
    mapping: dict[str, Any] = {"sample_rate_hz": blocks[0].sample_rate_hz, "channels": channels}
    if numbered:
        mapping["hit"] = {"variable": "_hit"}
    file = io.BytesIO()
    np.savez(file, **variables)
    return file.getvalue(), mapping
