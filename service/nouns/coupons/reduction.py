"""From a testing machine's file and the readings of a specimen to what its standard reports. No
database, no web.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import fmean
from typing import Any, cast

import numpy as np
from pydantic import ValidationError

import fecore
from fecore.arrays import FloatArray
from fecore.coupons import d3039, d3518
from fecore.coupons.curves import Curve, restarts
from fecore.errors import InputError
from modalbase.formats.errors import FormatError
from modalbase.formats.machine_csv import (
    Column,
    MachineFile,
    Quantity,
    Run,
    factor,
    read_machine_csv,
)
from modalbase.formats.tables.sizes import StatedSize
from service.nouns.coupons.schemas import CouponIn, CurveCouponIn, Series

GAUGE = {
    "strain": "gauge_length",
    "strain_back": "gauge_length",
    "transverse_strain": "transverse_gauge_length",
}
"""Which gauge length turns the elongation of a series into its strain."""

_UNLOADED = 0.02  # of the largest force: a curve that begins below it begins unloaded
_SAME_SIZE = 0.05  # by which a size in the file may differ from the readings: it may be nominal
_TARED = 500e-6  # m/m: a strain that begins above it without force was not tared
_FIELDS = {"width_m": "dimensions.width", "thickness_m": "dimensions.thickness"}
"""Fields of the core to fields of the request."""


_Part = tuple[dict[str, FloatArray], Sequence[int]]
"""Series of a run, by name, and the lines of the file that they are of."""


@dataclass(frozen=True)
class Reduced:
    """A specimen that was reduced."""

    coupon: CouponIn  # what counts in the batch
    series: dict[str, FloatArray]  # SI arrays of the run, by name
    reading: dict[str, Any]  # how the file was read
    reduction: dict[str, Any]  # all that the standard reports, and its warnings
    software: str  # version that did it


def reduce_curve(path: Path, request: CurveCouponIn) -> Reduced:
    """Read a machine's file and reduce its curve.

    Raises:
        InputError: the file cannot be read, or its curve not be reduced; says where and what to do.
    """
    gauges: dict[str, float | None] = {name: _gauge_m(request, name) for name in request.columns}
    columns: dict[str, Column] = {
        name: Column(c.header, _quantity(name, gauges[name]), c.unit)
        for name, c in request.columns.items()
    }
    try:
        file = read_machine_csv(
            path.read_bytes(), columns, request.delimiter, request.decimal, request.encoding
        )
    except FormatError as error:
        raise InputError(error.place, error.message) from error
    _require_sizes(file.sizes, request)
    runs = [part for run in file.runs for part in _parts(run, file, gauges, request)]
    number = _chosen(runs, request.run)
    series, lines = runs[number - 1]
    untared = _untared(series, file)
    try:
        coupon, reduction = _by_standard(series, request)
    except InputError as error:
        why = "; ".join(filter(None, (error.message, untared)))
        raise InputError(_FIELDS.get(error.field, error.field), why) from error
    reading = {
        "encoding": file.encoding,
        "delimiter": file.delimiter,
        "decimal": file.decimal,
        "units": dict(file.units),
        "run": number,
        "runs": len(runs),
        "first_line": lines[0],
        "last_line": lines[-1],
        "notes": [*file.notes, *([untared] if untared else [])],
    }
    return Reduced(coupon, series, reading, reduction, fecore.__version__)


def _require_sizes(sizes: Sequence[StatedSize], request: CurveCouponIn) -> None:
    """Refuse dimensions that a line of the file contradicts.

    Raises:
        InputError: as it says.
    """
    dimensions = request.dimensions
    metres = factor("length", dimensions.unit, "dimensions.unit")
    width, thickness = (metres * fmean(each) for each in (dimensions.width, dimensions.thickness))
    own = {
        "width": width,
        "thickness": thickness,
        "gauge_length": metres * (dimensions.gauge_length or 0.0),
        "area": width * thickness,
    }
    for stated in sizes:
        value = own[stated.size]
        if value and all(abs(each / value - 1) > _SAME_SIZE for each in stated.values):
            if stated.size == "area":
                field, what = "width", "and thickness make an area of"
                shown = f"{value / metres**2:.4g} {dimensions.unit}²"
            else:
                field, what, shown = stated.size, "is", f"{value / metres:.4g} {dimensions.unit}"
            raise InputError(
                f"dimensions.{field}",
                f"{what} {shown}, and {stated.words} in the file; correct the one that is wrong",
            )


def _zero(values: FloatArray, name: Series, unit: str, request: CurveCouponIn) -> float:
    """The reading at zero of a series, in SI of its column."""
    stated = request.zero[name]
    if stated != "first":
        quantity = _quantity(name, _gauge_m(request, name))
        return stated * factor(quantity, unit, f"columns.{name}.unit")
    known = values[np.isfinite(values)]
    if not known.size:
        raise InputError(f"zero.{name}", "is first, and the series holds no number; leave it out")
    return float(known[0])


def _untared(series: dict[str, FloatArray], file: MachineFile) -> str:
    """What helps where a strain begins far from 0 while the force begins near it, or the other way;
    else nothing.
    """
    force = np.abs(series["force"])
    begins_unloaded = force.size and force[0] <= _UNLOADED * np.nanmax(force)
    for name in GAUGE:
        first = series[name][0] if name in series and series[name].size else 0.0
        if begins_unloaded and abs(first) > _TARED:
            return (
                f"{name} begins at {first:.4g} m/m ({file.units[name]} in the file) with hardly any"
                " force. Where it was not "
                "tared, zero it at its first reading, or at the reading that it has without load. A"
                " script states that "
                f'(`"zero": {{"{name}": "first"}}`)'
            )
    begins_loaded = force.size and force[0] > _UNLOADED * np.nanmax(force)
    if begins_loaded and all(abs(series[name][0]) <= _TARED for name in GAUGE if name in series):
        return (
            f"force begins at {series['force'][0]:.4g} N with hardly any strain, and counts in the"
            ' strength: where it was not tared, state "zero": {"force": "first"}'
        )
    return ""


def _gauge_m(request: CurveCouponIn, series: str) -> float | None:
    """Gauge length of a series that is recorded as an elongation, m; None of any other."""
    length: float | None = getattr(request.dimensions, GAUGE[series]) if series in GAUGE else None
    return (
        None
        if length is None
        else length * factor("length", request.dimensions.unit, "dimensions.unit")
    )


def _quantity(series: str, gauge_m: float | None) -> Quantity:
    if series in ("force", "time"):
        return cast(Quantity, series)
    return "strain" if gauge_m is None else "length"


def _parts(
    run: Run, file: MachineFile, gauges: dict[str, float | None], request: CurveCouponIn
) -> Iterator[_Part]:
    """A run of the machine, divided where it was unloaded and loaded again."""
    zeros: dict[str, float] = {
        name: _zero(run.columns[name], name, file.units[name], request) for name in request.zero
    }
    series = {
        name: (np.asarray(values) - zeros.get(name, 0.0)) / (gauges[name] or 1.0)
        for name, values in run.columns.items()
    }
    try:
        starts = restarts(Curve(series["force"], series["strain"]))
    except InputError:  # which says what is wrong once it is chosen
        starts = ()
    for start, stop in itertools.pairwise([0, *starts, len(run.lines)]):
        yield {name: values[start:stop] for name, values in series.items()}, run.lines[start:stop]


def _chosen(runs: Sequence[_Part], requested: int | None) -> int:
    """The number of the run that counts."""
    if requested is None and len(runs) > 1:
        lines = ", ".join(
            f"{i} (lines {lines[0]} to {lines[-1]})" for i, (_, lines) in enumerate(runs, 1)
        )
        raise InputError(
            "run",
            "is missing: the machine was restarted, or unloaded and loaded again; say which of its"
            f" runs counts: {lines}",
        )
    number = requested or 1
    if number > len(runs):
        raise InputError("run", f"is {number}, the file has {len(runs)}")
    return number


def _by_standard(
    series: dict[str, FloatArray], request: CurveCouponIn
) -> tuple[CouponIn, dict[str, Any]]:
    metres = factor("length", request.dimensions.unit, "dimensions.unit")
    width = [metres * reading for reading in request.dimensions.width]
    thickness = [metres * reading for reading in request.dimensions.thickness]
    curve = Curve(
        series["force"],
        series["strain"],
        series.get("strain_back"),
        series.get("transverse_strain"),
        series.get("time"),
    )
    values: dict[str, Any]
    result: d3039.TensileResult | d3518.ShearResult
    if request.standard == "D3039":
        result = d3039.reduce(curve, width, thickness, request.chord_range, request.ends)
        values = {
            "E_Pa": result.modulus_pa,
            "nu": result.poisson_ratio,
            "strength_Pa": result.strength_pa,
            "ultimate_strain": result.ultimate_strain,
        }
    else:
        start = (
            d3518.START_RANGE[0] / 2 + d3518.START_RANGE[1] / 2
            if request.chord_start is None
            else request.chord_start
        )
        result = d3518.reduce(curve, width, thickness, start, request.ends)
        values = {"G_Pa": result.modulus_pa, "strength_Pa": result.maximum_stress_pa}
    try:
        coupon = CouponIn(
            specimen=request.specimen,
            standard=request.standard,
            failure_code=request.failure_code,
            excluded=request.excluded,
            exclusion_reason=request.exclusion_reason,
            **values,
        )
    except ValidationError as error:
        names = [str(fault["loc"][0]) for fault in error.errors()]
        whys = [f"{name} {values[name]:.4g}" for name in names]
        raise InputError(
            "columns",
            f"give {' and '.join(whys)} in SI, which no material has: is a unit or a dimension"
            " another?",
        ) from None
    reduction = asdict(result)
    return coupon, {
        **reduction,
        "chord_range": list(result.chord_range),
        "warnings": list(result.warnings),
    }
