"""From a function as the file states it to an FRF in SI: what it is, in which units, along which
axes.
"""

import re
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from modalbase.formats.factors import factor_beside
from modalbase.formats.frfs.kinds import kinds_in
from modalbase.formats.types import ComplexArray, Quantity
from modalbase.formats.uff.content import Axis, Frf, Function, Limits, Units
from modalbase.formats.uff.function import RawFunction, fits_single
from modalbase.formats.uff.geometry import Geometry
from modalbase.formats.uff.text import Refusal
from modalbase.formats.units import (
    FORCE,
    LENGTH,
    NO_UNIT,
    RESPONSE,
    Dimension,
    Unit,
    factor_of,
    level_of,
    read_unit,
    without_amplitude,
)

RESPONSE_TYPES: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}
_FORCE_TYPES = (9, 13)
UNSTATED_TYPES = (0, 1)
_FREQUENCY_TYPES = (*UNSTATED_TYPES, 18)
_SCALED = re.compile(r"10|\de[+-]?\d", re.IGNORECASE)
_GRAVITY = re.compile(r"(?i)(?<![a-z])(g|gn|g's)(?![a-z])")


@dataclass(frozen=True)
class _Side:
    """Numerator or denominator of an FRF."""

    # meaning of its unit label, None where there is none or it is not understood
    label: Unit | None
    text: str  # the label as the file has it
    by_164: float  # factor to SI by set 164


def function_of(raw: RawFunction, dataset: int) -> Function:
    """A function that is not an FRF, in the units of its labels."""
    unit = "" if raw.ordinate.unit.lower() in NO_UNIT else raw.ordinate.unit
    ids, dofs = raw.id_lines, raw.dofs
    return Function(
        dataset,
        ids[0],
        ids,
        raw.function_type,
        *dofs,
        raw.axis,
        raw.abscissa.unit,
        raw.values,
        unit,
    )


def global_dofs(
    raw: RawFunction, geometry: Geometry, notes: list[str]
) -> tuple[int, int, int, int]:
    """Response point and direction, reference point and direction, along global axes.

    Raises:
        Refusal: a point's own axes are not along the global ones.
    """
    response = geometry.global_direction(
        raw.response_point, raw.response_direction, "response", notes
    )
    reference = geometry.global_direction(
        raw.reference_point, raw.reference_direction, "reference", notes
    )
    return raw.response_point, response, raw.reference_point, reference


def frf_of(
    raw: RawFunction, dataset: int, units: Units | None, geometry: Geometry, limits: Limits
) -> tuple[Frf, list[str]]:
    """An FRF in SI and the notes on how it came there.

    Raises:
        Refusal: it is not complex, not over frequency, not a response over a force, states no
            quantity, is measured along axes that are none of the global ones, or is out of range in
            SI.
    """
    notes: list[str] = []
    if raw.values.dtype.kind != "c":
        raise Refusal("is an FRF with real ordinates: without phase it is of no use")
    frequency = frequency_of(raw, notes)
    if stated := factor_beside(raw.id_lines[0], {}):
        notes.append(f"its first ID line says {stated}; its values are taken as they stand")
    quantity, factor = _quantity_and_factor(raw, units, limits, notes)
    dofs = global_dofs(raw, geometry, notes)
    double = raw.values.astype(np.complex128, copy=factor != 1.0)
    if factor != 1.0:
        with np.errstate(over="ignore"):
            # part by part: a complex product would lose the sign of zeros
            double.view(np.float64)[:] *= factor
        if not np.isfinite(double).all():
            raise Refusal(
                "its ordinates are beyond double precision in SI, first at"
                f" {np.argmin(np.isfinite(double)) + 1}"
            )
    values: NDArray[np.complex64] | ComplexArray = double
    if raw.values.dtype == np.complex64 and fits_single(double.view(np.float64)):
        values = double.astype(np.complex64)
    return (
        Frf(
            dataset,
            raw.id_lines[0],
            raw.id_lines,
            *dofs,
            quantity,
            frequency,
            values,
            raw.load_case,
        ),
        notes,
    )


def frequency_of(raw: RawFunction, notes: list[str]) -> Axis:
    """The abscissa in Hz."""
    described = raw.abscissa
    if described.data_type not in _FREQUENCY_TYPES:
        raise Refusal(
            f"is over an abscissa of type {described.data_type}, expected 18 (frequency)", 7
        )
    factor = factor_of("frequency", described.unit)
    if factor is None:
        factor = 1.0
        if described.unit.lower().strip() not in NO_UNIT or described.data_type != 18:
            notes.append(f"the unit of the abscissa is '{described.unit}'; Hz assumed")
    elif factor != 1.0:
        notes.append(f"frequencies in {described.unit} converted to Hz")
    axis = raw.axis
    if axis.start < 0:
        raise Refusal(f"its first frequency is {axis.start:g}, expected 0 or more")
    if factor == 1.0:
        return axis
    values = None if axis.values is None else axis.values * factor
    return Axis(axis.start * factor, axis.step * factor, axis.count, values)


def _quantity_and_factor(
    raw: RawFunction, units: Units | None, limits: Limits, notes: list[str]
) -> tuple[Quantity, float]:
    """What the FRF is, and the factor that brings its ordinates to SI."""
    rotation = abs(raw.response_direction) > 3
    moment = abs(raw.reference_direction) > 3
    length, force = (1.0, 1.0) if units is None else (units.length, units.force)
    above_unit, below_unit = _of_one_amplitude(raw.ordinate.unit, raw.denominator.unit)
    top = _Side(read_unit(above_unit), above_unit, 1.0 if rotation else 1 / length)
    bottom = _Side(read_unit(below_unit), below_unit, 1 / (force * length) if moment else 1 / force)
    if raw.denominator.data_type not in (*_FORCE_TYPES, *UNSTATED_TYPES):
        raise Refusal(
            f"its denominator is of type {raw.denominator.data_type}, not a force (9, 13)", 9
        )
    response = {q: d.times(LENGTH, -1) if rotation else d for q, d in RESPONSE.items()}
    below = FORCE.times(LENGTH) if moment else FORCE
    quantity, whole = _quantity(raw, top.label, response, below, limits, notes)
    _note_exponents(raw, rotation, moment, notes)
    if whole and top.label is not None:
        factor, label = top.label.factor, f"'{top.text}'"
        if bottom.label is not None and bottom.text.lower() not in top.text.lower():
            notes.append(
                f"its ordinate is in '{top.text}', and its denominator in '{bottom.text}': that of the"
                " ordinate is used, as it is one of the whole ratio"
            )
    else:
        factor, label = _ratio(top, bottom, response[quantity], below, units, notes)
    _note_factor(factor, label, top, bottom, units, notes)
    return quantity, factor


def _of_one_amplitude(above: str, below: str) -> tuple[str, str]:
    """The units of a ratio without the amplitude that both are of, such as `g pk` over `N pk`.

    Raises:
        Refusal: they are of two amplitudes, so that the ratio has a factor that nobody states.
    """
    (one, word), (two, other) = without_amplitude(above), without_amplitude(below)
    if word != other and read_unit(one) and read_unit(two):
        raise Refusal(
            f"its ordinate is in '{above}' and its denominator in '{below}', of two amplitudes;"
            " export both as peak, or both as rms",
            8,
        )
    return one, two


def _quantity(
    raw: RawFunction,
    label: Unit | None,
    response: dict[Quantity, Dimension],
    below: Dimension,
    limits: Limits,
    notes: list[str],
) -> tuple[Quantity, bool]:
    """The quantity by data type, label, or the user; and whether the ordinate's label states the
    whole ratio.
    """
    by_type = RESPONSE_TYPES.get(raw.ordinate.data_type)
    if by_type is None and raw.ordinate.data_type not in UNSTATED_TYPES:
        raise Refusal(
            f"its ordinate is of type {raw.ordinate.data_type}, not an acceleration, velocity or"
            " displacement",
            8,
        )
    for quantity in get_args(Quantity):
        if label is None:
            break
        whole = label.dimension == response[quantity].times(below, -1)
        if whole or label.dimension == response[quantity]:
            if by_type not in (None, quantity):
                raise Refusal(
                    f"its data type says {by_type}, its unit '{raw.ordinate.unit}' says {quantity}",
                    8,
                )
            return quantity, whole
    if label is not None:
        raise Refusal(
            f"its ordinate is in '{raw.ordinate.unit}', which is no unit of an FRF's response", 8
        )
    named = kinds_in([raw.ordinate.name, f"{raw.ordinate.name} / force"])
    if by_type is not None:
        if named and by_type not in named:
            raise Refusal(
                f"its data type says {by_type}, its name {raw.ordinate.name!r} another", 8
            )
        return by_type, False
    if limits.quantity is None:
        raise Refusal(
            f"neither its data type ({raw.ordinate.data_type}) nor its unit ('{raw.ordinate.unit}')"
            " says whether it is an accelerance, a mobility or a receptance; state it in the file"
            " (record 9: 12, 11 or 8), or as the quantity of the import",
            8,
        )
    notes.append(f"the file does not state what it is; {limits.quantity} as stated for the import")
    return limits.quantity, False


def _ratio(
    top: _Side,
    bottom: _Side,
    response: Dimension,
    below: Dimension,
    units: Units | None,
    notes: list[str],
) -> tuple[float, str]:
    """Factor to SI of numerator over denominator, each by its label or by set 164."""
    factors = []
    for side, dimension, name in ((top, response, "ordinate"), (bottom, below, "denominator")):
        if side.label is not None and side.label.dimension != dimension:
            raise Refusal(f"the unit '{side.text}' of its {name} does not fit its data type")
        if side.label is None:
            if level_of(side.text) is not None or _SCALED.search(side.text):
                raise Refusal(
                    f"its {name} is in '{side.text}', which is read as no unit: export complex values"
                    " on a linear scale, in a unit without a factor",
                    8,
                )
            by = (
                "SI (the file has no set 164)"
                if units is None
                else f"set 164 ({units.description or units.code})"
            )
            stated = (
                "has no unit label"
                if side.text.lower() in NO_UNIT
                else f"has the unknown unit label '{side.text}'"
            )
            notes.append(f"its {name} {stated}; units of {by} assumed")
        factors.append(side.by_164 if side.label is None else side.label.factor)
    return factors[0] / factors[1], f"'{top.text}' over '{bottom.text}'"


def _note_factor(
    factor: float, label: str, top: _Side, bottom: _Side, units: Units | None, notes: list[str]
) -> None:
    """State the conversion, and where labels and set 164 disagree."""
    if factor != 1.0:
        gravity = " (1 g = 9.80665 m/s²)" if _GRAVITY.search(top.text) else ""
        notes.append(
            f"ordinates multiplied by {factor:.9g} to SI{gravity}: their units are {label}"
        )
    by_164 = top.by_164 / bottom.by_164
    if units is not None and (top.label or bottom.label) and abs(by_164 / factor - 1) > 1e-6:
        notes.append(
            f"the unit labels {label} contradict set 164, by which the factor is {by_164:.9g}; the"
            " labels are used"
        )


def _note_exponents(raw: RawFunction, rotation: bool, moment: bool, notes: list[str]) -> None:
    """Unit exponents are redundant with the data types; say where they do not agree."""
    expected = (
        (raw.ordinate, (0 if rotation else 1, 0, 0), "ordinate"),
        (raw.denominator, (int(moment), 1, 0), "denominator"),
    )
    for described, usual, name in expected:
        stated = described.exponents
        if described.data_type not in UNSTATED_TYPES and stated not in ((0, 0, 0), usual):
            notes.append(
                f"the unit exponents {stated} of its {name} do not fit its data type"
                f" {described.data_type}"
            )
