"""A mapping: which variable or column of a file is what. With it, named arrays become time blocks
in SI.

    {"sample_rate_hz": {"variable": "fs"},            or a number, or {"variable": "time_s"} of a time axis
     "hit": {"variable": "hit"},                      or a number; without it the hits of each point are counted
     "channels": [
       {"variable": "force", "quantity": "force", "sensitivity": 0.00225,
        "point": {"variable": "point"}, "direction": 3},
       {"variable": "acceleration", "quantity": "acceleration", "sensitivity": 0.00102,
        "point": 33, "direction": 3, "window_rate_per_s": 0, "full_scale": 4900}]}

`unit` is that of the samples, `sensitivity` what one SI unit makes in the file (volts per newton);
see `modalbase.formats.records.scale`. Without both the file's own unit counts, and where it states
none it is in SI. A member that is null is empty: what a channel needs is asked for. Where blocks
lie in a table, its longer side is the time. `point`, `direction` and `hit` may be lists too, of one
number for each block. An archive's mapping says `"archived": true`: blocks are as a service kept
them, in SI whatever the `sensitivity` that made them so, with the `label` and, of a recording, the
`start_sample` of each.
"""

from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, get_args

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import (
    ChannelQuantity,
    TimeBlock,
    Variables,
    is_named,
    real,
    require_one_clock,
    sampling_rate,
    variable,
)
from modalbase.formats.records.scale import sensitivity_of, units_of
from modalbase.formats.types import FloatArray

Value = float | str
"""A number, or the name of a variable that holds it."""
Values = Value | tuple[float, ...]
"""The same, or a number for each block."""

FEWEST_SAMPLES = 64
"""Of a block."""
MOST_POINT = 9_999_999_999  # label of a grid point, as in UFF
LARGEST = 1e15  # N, m/s², m/s or m: whatever is larger is not a measurement


Recorded = Literal["hits", "responses", "loads"]
"""What a recording is of: hits of a hammer, responses alone, or responses and the loads that cause
them.
"""

MOST_LOADS = 8


@dataclass(frozen=True)
class ChannelMapping:
    """One channel of a mapping; see the module."""

    variable: str
    quantity: ChannelQuantity
    point: Values
    direction: Values = 3.0
    sensitivity: float = 1.0  # by which samples are divided for SI, whatever has said so
    unit: str = ""
    instead_of: str = ""
    window_rate_per_s: float = 0.0
    full_scale: float | None = None
    label: tuple[str, ...] | None = None
    start_sample: Values | None = None


@dataclass(frozen=True)
class Mapping:
    """A whole mapping: exactly one channel is the force."""

    sample_rate_hz: Value
    channels: tuple[ChannelMapping, ...]
    hit: Values | None = None
    archived: bool = False


def read_mapping(
    document: Any, units: dict[str, str] | None = None, kind: Recorded = "hits"
) -> Mapping:
    """The mapping of a JSON document.

    Args:
        document: of JSON.
        units: that the file's properties state, by channel; those in the channels' names are known
            without.
        kind: what is recorded: hits have one force, responses none, and loads one or several.

    Raises:
        FormatError: names every field that is missing, unknown or of another kind.
    """
    if not isinstance(document, dict):
        raise FormatError("mapping", "is not an object")
    listed = document.get("channels")
    if not isinstance(listed, list) or not all(isinstance(c, dict) for c in listed):
        raise FormatError("mapping.channels", "is missing, expected a list of channels")
    faults = _faults_of(Mapping, "mapping", document)
    channels = []
    for number, entry in enumerate(listed):
        place = f"mapping.channels.{number}"
        own = _faults_of(ChannelMapping, place, entry)
        if not own:
            try:
                channels.append(
                    _channel(entry, units or {}, place, archived=document.get("archived") is True)
                )
            except FormatError as error:
                own = error.faults
        faults += own
    names = [c.variable for c in channels]
    faults += [
        (f"mapping.channels.{i}.variable", f"is {name!r}, as that of another channel")
        for i, name in enumerate(names)
        if name in names[:i]
    ]
    forces = [c.quantity for c in channels].count("force")
    if not faults and kind != "hits":
        faults += _faults_of_recording(channels, kind)
    elif not faults and (forces == 0 or forces == len(channels) == 1):
        lacks = f"a force; {ONE_FILE}; {NO_FORCE}" if forces == 0 else f"a response; {ONE_FILE}"
        faults.append(("mapping.channels", f"lack {lacks}"))
    elif not faults and forces != 1:
        faults.append(
            (
                "mapping.channels",
                f"have {forces} channels of the quantity force, expected one; where each is of a hit of"
                " its own, import each hit by a mapping of its own; where all of them act throughout,"
                " state kind=loads",
            )
        )
    if faults:
        raise FormatError(faults)
    return Mapping(**{**_taken(document), "channels": tuple(channels)})


def _faults_of_recording(channels: list[ChannelMapping], kind: Recorded) -> list[tuple[str, str]]:
    """What does not fit in a recording of responses alone, or of them and loads."""
    faults, seen = list[tuple[str, str]](), dict[tuple[Values, Values, bool], str]()
    forces = [c.quantity for c in channels].count("force")
    if forces == len(channels):
        faults.append(("mapping.channels", "lack a response"))
    if kind == "loads" and not 1 <= forces <= MOST_LOADS:
        why = f"have {forces} forces, expected 1 to {MOST_LOADS} loads (kind=loads)"
        faults.append(("mapping.channels", f"{why}; {NO_FORCE}" if not forces else why))
    for number, c in enumerate(channels):
        place = f"mapping.channels.{number}"
        if c.quantity == "force" and kind == "responses":
            why = "is force, and the recording is stated to be of responses alone (kind=responses)"
            faults.append((f"{place}.quantity", why))
        axis = abs(c.direction) if isinstance(c.direction, float) else c.direction
        first = seen.setdefault((c.point, axis, c.quantity == "force"), c.variable)
        if first != c.variable:
            faults.append((f"{place}.point", f"and direction are those of {first!r} too"))
    return faults


def _channel(
    entry: dict[str, Any], units: dict[str, str], place: str, *, archived: bool
) -> ChannelMapping:
    in_file = units_of(entry["variable"], entry["quantity"], units)
    own = entry.get("sensitivity", 1.0) if archived else sensitivity_of(entry, in_file, place)
    return ChannelMapping(**{**_taken(entry), "sensitivity": own})


def _is_number(given: Any) -> bool:
    return (
        isinstance(given, int | float) and not isinstance(given, bool) and bool(np.isfinite(given))
    )


def _is_value(given: Any) -> bool:
    return is_named(given) or _is_number(given)


def _is_values(given: Any) -> bool:
    return _is_value(given) or (isinstance(given, list) and all(map(_is_number, given)))


def _is_texts(given: Any) -> bool:
    return isinstance(given, list) and all(isinstance(one, str) for one in given)


ONE_FILE = (
    "all channels of a hit belong in one file: where the force is in one and the response in"
    " another, join their columns"
)

NO_FORCE = (
    'where no load was measured, state {"recording": {}} in the mapping, or kind=responses: modes'
    " are found from the responses alone then"
)

_VALUE = 'a number or {"variable": name}'
_EXPECTED: dict[str, tuple[Callable[[Any], bool], str]] = {
    "sample_rate_hz": (_is_value, f"{_VALUE}, of the samples a second or of the time axis"),
    "hit": (_is_values, _VALUE),
    "archived": (lambda given: isinstance(given, bool), "true or false"),
    "variable": (lambda given: isinstance(given, str), "a name"),
    "quantity": (
        lambda given: given in get_args(ChannelQuantity),
        f"one of {', '.join(get_args(ChannelQuantity))}",
    ),
    "point": (_is_values, _VALUE),
    "direction": (_is_values, f"{_VALUE}: ±1 to ±3 along x, y, z, ±4 to ±6 about them"),
    "start_sample": (_is_values, _VALUE),
    "unit": (lambda given: isinstance(given, str), "the text of a unit"),
    "instead_of": (lambda given: isinstance(given, str), "the unit that the file states"),
    "sensitivity": (
        lambda given: isinstance(given, str) or (_is_number(given) and given > 0),
        'a number, more than 0, or a text such as "2.25 mV/N"',
    ),
    "window_rate_per_s": (lambda given: _is_number(given) and given >= 0, "a number, 0 or more"),
    "full_scale": (lambda given: _is_number(given) and given > 0, "a number, more than 0"),
    "label": (_is_texts, "a list of texts, one for each block"),
}
"""What the fields of a mapping and of its channels must be."""
_REQUIRED_IF_NAMED = (
    "direction",
)  # have a default, and are asked for where a proposal left them empty


def _faults_of(
    kind: type[Mapping | ChannelMapping], place: str, document: dict[str, Any]
) -> list[tuple[str, str]]:
    """Fields that are unknown, missing, wrong, or null where a value is needed; another one that is
    null is not stated.
    """
    own = {f.name: f.default is MISSING for f in fields(kind) if f.name in _EXPECTED}
    faults = [
        (f"{place}.{name}", "is unknown") for name in sorted(document.keys() - {*own, "channels"})
    ]
    for name, is_required in own.items():
        given, (holds, expected) = document.get(name), _EXPECTED[name]
        if given is None and (is_required or (name in _REQUIRED_IF_NAMED and name in document)):
            is_empty = "is empty" if name in document else "is missing"
            faults.append((f"{place}.{name}", f"{is_empty}, expected {expected}"))
        elif given is not None and not holds(given):
            faults.append((f"{place}.{name}", f"is {given!r}, expected {expected}"))
    return faults


def _taken(document: dict[str, Any]) -> dict[str, Any]:
    """Fields as the dataclasses have them: names, numbers, and tuples."""

    def taken(given: Any) -> Any:
        if isinstance(given, list):
            return tuple(map(taken, given))
        if is_named(given):
            return given["variable"]
        return float(given) if _is_number(given) else given

    return {name: taken(given) for name, given in document.items() if given is not None}


def blocks_of(
    variables: Variables, mapping: Mapping, units: dict[str, str] | None = None
) -> list[TimeBlock]:
    """The time blocks of all channels, hit by hit: the force first.

    Args:
        variables: the arrays.
        mapping: what they are.
        units: that the file's properties state, by variable; that of the time axis counts here.

    Raises:
        FormatError: a variable is missing, lengths differ, values are not finite, a channel is
            constant, or a rate,
        point,
            direction or hit is impossible; names it.
    """
    tables = {c.variable: _table(variables, c) for c in mapping.channels}
    if not mapping.archived:
        tables = {c.variable: _in_si(_measured(tables[c.variable], c), c) for c in mapping.channels}
        _refuse_copies(tables)
    require_one_clock(variables, tables)
    shapes = {name: table.shape for name, table in tables.items()}
    if len(set(shapes.values())) > 1:
        listed = ", ".join(
            f"{name} {shape[0]} blocks of {shape[1]} samples" for name, shape in shapes.items()
        )
        raise FormatError("mapping.channels", f"are not alike: {listed}")
    count, samples = next(iter(shapes.values()))
    rate = sampling_rate(variables, mapping.sample_rate_hz, samples, units)
    force = next(c for c in mapping.channels if c.quantity == "force")
    ordered = [force, *(c for c in mapping.channels if c is not force)]
    points = {c.variable: _integers(variables, c.point, count, "point", 1) for c in ordered}
    directions = {
        c.variable: _integers(variables, c.direction, count, "direction", -6) for c in ordered
    }
    where = list(zip(points[force.variable], directions[force.variable], strict=True))
    hits = _hits(variables, mapping.hit, where)
    labels = {c.variable: _labels(c, count) for c in mapping.channels}
    starts = {
        c.variable: _integers(variables, c.start_sample, count, "start_sample", 0)
        for c in mapping.channels
        if c.start_sample is not None
    }
    return [
        TimeBlock(
            c.quantity,
            points[c.variable][i],
            directions[c.variable][i],
            *where[i],
            hits[i],
            rate,
            tables[c.variable][i],
            c.window_rate_per_s,
            c.full_scale,
            c.sensitivity,
            labels[c.variable][i],
            starts[c.variable][i] if c.variable in starts else None,
        )
        for i in range(count)
        for c in ordered
    ]


def _table(variables: Variables, channel: ChannelMapping) -> FloatArray:
    """(blocks, samples); the longer side is the time."""
    values = np.squeeze(variable(variables, channel.variable))
    if values.ndim == 1:
        values = values[np.newaxis]
    if values.ndim != 2:
        raise FormatError(
            channel.variable, f"has shape {values.shape}, expected one block or a table of them"
        )
    if values.dtype.kind == "c":
        raise FormatError(
            channel.variable, "holds complex numbers: it is no time block; FRFs go to POST frfs"
        )
    if values.dtype.itemsize > 8:
        raise FormatError(
            channel.variable,
            f"holds numbers of type {values.dtype}, which would be rounded; save them as float64",
        )
    if values.shape[0] > values.shape[1]:
        values = values.T
    table: FloatArray = np.ascontiguousarray(
        values, dtype=np.float32 if values.dtype == np.float32 else np.float64
    )
    with np.errstate(over="ignore", invalid="ignore"):
        total = table.sum()  # one pass; only where it is not finite is each number asked
    bad = np.empty((0, 2), dtype=int) if np.isfinite(total) else np.argwhere(~np.isfinite(table))
    if bad.size:
        raise FormatError(
            channel.variable,
            f"holds NaN or infinity, first at sample {bad[0][1] + 1} of block {bad[0][0] + 1}",
        )
    return table


def _measured(table: FloatArray, channel: ChannelMapping) -> FloatArray:
    """The same; refused where it is too short, or a channel carried nothing."""
    if table.shape[1] < FEWEST_SAMPLES:
        raise FormatError(
            channel.variable,
            f"has {table.shape[1]} samples a block, expected {FEWEST_SAMPLES} or more",
        )
    flat = np.flatnonzero(table.max(axis=1) == table.min(axis=1))
    if flat.size:
        raise FormatError(
            channel.variable,
            f"is {table[flat[0], 0]:g} throughout block {flat[0] + 1}: a channel that carried"
            " nothing",
        )
    return table


def _refuse_copies(tables: dict[str, FloatArray]) -> None:
    """Two channels of the same samples are one that was exported twice: their FRF would be 1."""
    names = list(tables)
    for i, name in enumerate(names):
        for other in names[:i]:
            one, two = tables[name], tables[other]
            if one.shape == two.shape and np.array_equal(
                one[0] * two[0].max(), two[0] * one[0].max()
            ):
                raise FormatError(
                    name, f"holds the same samples as {other}: one channel was written twice"
                )


def _in_si(table: FloatArray, channel: ChannelMapping) -> FloatArray:
    # what comes of it is looked at
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        values: FloatArray = table if channel.sensitivity == 1 else table / channel.sensitivity
    most = max(float(values.max()), -float(values.min()))
    if not most < LARGEST:
        raise FormatError(
            channel.variable,
            f"reaches {most:.3g} in SI, more than any sensor gives; look at the sensitivity",
        )
    return values


def _labels(channel: ChannelMapping, count: int) -> tuple[str, ...]:
    labels = channel.label or (channel.variable,) * count
    if len(labels) != count:
        raise FormatError(channel.variable, f"has {len(labels)} labels for {count} blocks")
    return labels


def _integers(variables: Variables, given: Values, count: int, name: str, least: int) -> list[int]:
    place = given if isinstance(given, str) else f"mapping.{name}"
    values = (
        real(np.ravel(variable(variables, given)), place)
        if isinstance(given, str)
        else np.ravel(given)
    )
    if values.size == 1:
        values = np.repeat(values, count)
    if values.size != count:
        raise FormatError(
            place, f"has {values.size} values, expected one for each of the {count} blocks"
        )
    whole = [int(v) if np.isfinite(v) else 0 for v in values]
    most = 6 if name == "direction" else MOST_POINT
    if any(
        w != v or not least <= w <= most or (name == "direction" and w == 0)
        for w, v in zip(whole, values, strict=True)
    ):
        raise FormatError(
            place,
            f"is no {name}: expected"
            f" {'±1 to ±6' if name == 'direction' else f'whole numbers from {least}'}",
        )
    return whole


def _hits(variables: Variables, given: Values | None, where: list[tuple[int, int]]) -> list[int]:
    if given is not None:
        return _integers(variables, given, len(where), "hit", 1)
    seen: dict[tuple[int, int], int] = {}
    numbers = []
    for place in where:
        seen[place] = seen.get(place, 0) + 1
        numbers.append(seen[place])
    return numbers
