"""Functions of one or two channels that are no FRF: time blocks in SI, and the power spectra that FRFs are made of."""

from __future__ import annotations

from typing import Literal

import numpy as np

from modalbase.formats.uff.content import Axis, ChannelQuantity, PowerSpectrum, TimeResponse, Units
from modalbase.formats.uff.frf import frequency_of
from modalbase.formats.uff.function import RawFunction
from modalbase.formats.uff.geometry import Geometry
from modalbase.formats.uff.text import Refusal
from modalbase.formats.uff.units import FORCE, RESPONSE, Dimension, read_label

TIME_RESPONSE, AUTO_SPECTRUM, CROSS_SPECTRUM = 1, 2, 3
_UNSTATED_TYPES = (0, 1)
_TYPES: dict[int, ChannelQuantity] = {
    8: "displacement",
    11: "velocity",
    12: "acceleration",
    9: "force",
    13: "force",
}
_DIMENSIONS: dict[Dimension, ChannelQuantity] = {
    FORCE: "force",
    RESPONSE["accelerance"]: "acceleration",
    RESPONSE["mobility"]: "velocity",
    RESPONSE["receptance"]: "displacement",
}
_SECONDS = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "": 1.0, "none": 1.0}


def time_of(
    raw: RawFunction, dataset: int, units: Units | None, geometry: Geometry
) -> tuple[TimeResponse, list[str]] | None:
    """A time block in SI and the notes on how it came there; None where it is a block of another kind (pressure, strain).

    Raises:
        Refusal: it is uneven or has no sampling rate, its unit contradicts its data type, or SI takes it out of range.
    """
    notes: list[str] = []
    found = _channel(raw, units, notes)
    if found is None or raw.values.dtype.kind == "c":
        return None
    quantity, factor = found
    unit = raw.abscissa.unit.lower().strip()
    if unit not in _SECONDS or raw.abscissa.data_type not in (*_UNSTATED_TYPES, 17):
        raise Refusal(f"is a time block over '{raw.abscissa.unit}', expected seconds", 7)
    if raw.axis.values is not None or not raw.axis.step > 0:
        raise Refusal("is a time block without an even time step: its sample rate is missing", 6)
    with np.errstate(over="ignore"):
        samples = raw.values.real if factor == 1.0 else raw.values.real.astype(np.float64) * factor
    if not np.isfinite(samples).all():
        raise Refusal(f"its samples are beyond double precision in SI, first at {np.argmin(np.isfinite(samples)) + 1}")
    dofs = _directions(raw, geometry, notes)
    rate = float(f"{1 / (raw.axis.step * _SECONDS[unit]):.12g}")
    return TimeResponse(dataset, raw.id_lines[0], quantity, *dofs, rate, samples), notes


def spectrum_of(
    raw: RawFunction, dataset: int, units: Units | None, geometry: Geometry
) -> tuple[PowerSpectrum, list[str]] | None:
    """A power spectrum and the notes on it; None where its channel is neither force nor motion.

    The unit label of an auto spectrum is that of its channel or the square of it, as programs differ.

    Raises:
        Refusal: it is not over frequency, or its unit contradicts its data type.
    """
    notes: list[str] = []
    kind: Literal["auto", "cross"] = "auto" if raw.function_type == AUTO_SPECTRUM else "cross"
    found = _channel(raw, units, notes, squared=True) if kind == "auto" else (None, 1.0)
    if found is None:
        return None
    quantity, factor = found
    axis: Axis = frequency_of(raw, notes)
    values = np.asarray(raw.values, dtype=np.complex128)
    dofs = _directions(raw, geometry, notes)
    return PowerSpectrum(dataset, raw.id_lines[0], kind, quantity, factor, *dofs, axis, values), notes


def _channel(
    raw: RawFunction, units: Units | None, notes: list[str], *, squared: bool = False
) -> tuple[ChannelQuantity, float] | None:
    """What a channel is, and the factor of its amplitude to SI; None where it is none of ours."""
    described = raw.ordinate
    label, by_type = read_label(described.unit), _TYPES.get(described.data_type)
    if label is not None:
        for power in (1, 2) if squared else (1,):
            root = _root(label.dimension, power)
            if root in _DIMENSIONS:
                quantity = _DIMENSIONS[root]
                if by_type not in (None, quantity):
                    raise Refusal(f"its data type says {by_type}, its unit '{described.unit}' says {quantity}", 8)
                return quantity, label.factor ** (1 / power)
        return None
    if by_type is None:
        return None
    length, force = (1.0, 1.0) if units is None else (units.length, units.force)
    by = "SI (the file has no set 164)" if units is None else f"set 164 ({units.description or units.code})"
    notes.append(f"its ordinate has no unit label that is understood ('{described.unit}'); units of {by} assumed")
    return by_type, 1 / force if by_type == "force" else 1 / length


def _root(dimension: Dimension, power: int) -> Dimension | None:
    if any(d % power for d in dimension):
        return None
    return dimension[0] // power, dimension[1] // power, dimension[2] // power


def _directions(raw: RawFunction, geometry: Geometry, notes: list[str]) -> tuple[int, int, int, int]:
    """Response point and direction, reference point and direction, along global axes."""
    response = geometry.global_direction(raw.response_point, raw.response_direction, "response", notes)
    reference = geometry.global_direction(raw.reference_point, raw.reference_direction, "reference", notes)
    return raw.response_point, response, raw.reference_point, reference
