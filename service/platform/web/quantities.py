"""Physical quantities of bodies: which numbers are usual, and what was probably meant by one that
is not.

The schema of a member says what is possible. What is possible and still not usual is nearly always
in another unit: 33 for a modulus of 33 GPa, 500 for a length of 500 mm. `unusual` names such
numbers; a route refuses them until the client confirms them. The ranges are wide, so that foams (1
MPa), balsa (100 kg/m³), films (0.2 mm) and bridge decks (30 m) need no confirmation.
"""

import re
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, get_args

from pydantic import BaseModel, Field

from fecore.quantities import QUANTITIES, WRITTEN, Quantity
from service.platform.errors import Fault

UNITS = {
    "_m_s": "m/s",
    "_kg_m2": "kg·m²",
    "_kg_m3": "kg/m³",
    "_per_s": "1/s",
    "_hz": "Hz",
    "_deg": "°",
    "_Pa": "Pa",
    "_kg": "kg",
    "_m": "m",
    "_s": "s",
}
"""Unit of a member by the end of its name."""

_READABLE = 1e-2, 1e4
"""Unit that a person reads a number in beside its SI unit, where the number in it is neither tiny
nor huge.
"""


def doubt(value: float, quantity: Quantity) -> str | None:
    """What is odd about a value, with what was probably meant; None where it is usual."""
    if value == 0 or quantity.usual is None or _within(value, quantity.usual):
        return None
    # the latter: converted once too often
    factors = (*quantity.mistaken, *(1 / factor for factor in quantity.mistaken))
    meant = next(
        (
            value * factor
            for bounds in (quantity.likely, quantity.usual)
            for factor in factors
            if _within(value * factor, bounds)
        ),
        None,
    )
    guess = "." if meant is None else f"; did you mean {in_words(meant, quantity.unit)}?"
    return (
        f"is {in_words(value, quantity.unit)}, usual is"
        f" {' to '.join(in_words(b, quantity.unit) for b in quantity.usual)}{guess}"
    )


def _within(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= abs(value) <= bounds[1]


LENGTH = QUANTITIES["length"]
WIDTH = QUANTITIES["width"]
THICKNESS = QUANTITIES["thickness"]
PLY_THICKNESS = QUANTITIES["ply_thickness"]
COUPON_SIZE = QUANTITIES["coupon_size"]
DENSITY = QUANTITIES["density"]
MODULUS = QUANTITIES["modulus"]
STRENGTH = QUANTITIES["strength"]
STRAIN = QUANTITIES["strain"]
SENSOR_MASS = QUANTITIES["sensor_mass"]
LENGTH_SD, THICKNESS_SD, DENSITY_SD, MODULUS_SD = (
    each.sd or each for each in (LENGTH, THICKNESS, DENSITY, MODULUS)
)

Length = Annotated[float, Field(gt=0, le=1000, description="m")]
Density = Annotated[float, Field(gt=0, le=50_000, description="kg/m³"), DENSITY]
Modulus = Annotated[float, Field(gt=0, le=1e13, description="Pa"), MODULUS]
Strength = Annotated[float, Field(gt=0, le=1e11, description="Pa"), STRENGTH]


def unusual(value: object, at: str = "") -> Iterator[Fault]:
    """Each number of a body that is possible and not usual.

    Args:
        value: a model, or a list or mapping of models.
        at: JSON pointer of the value.
    """
    if isinstance(value, BaseModel):
        for name, number, quantity in stated(value):
            if (odd := doubt(number, quantity)) is not None:
                yield Fault(f"{at}/{name}", odd)
        value = dict(value)
    members = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for step, inner in members:
        if isinstance(inner, BaseModel | dict | list):
            yield from unusual(inner, f"{at}/{step}")


COMPUTABLE = 1e-30, 1e30
"""Magnitudes of which the products that a computation forms stay numbers; 0 is one too."""
FREE = "meta"
"""The member of a person's own JSON, with which nothing is computed."""


def beyond(value: object, at: str = "") -> Iterator[Fault]:
    """Each number of a body that is possible, and too small or too large to compute with, whoever
    confirms it.

    Args:
        value: a model, or what a model's member may be.
        at: JSON pointer of the value.
    """
    if isinstance(value, float) and value and not _within(value, COMPUTABLE):
        low, high = COMPUTABLE
        yield Fault(
            at,
            f"is {_digits(value)}; expected 0, or a magnitude from {_digits(low)} to"
            f" {_digits(high)}",
        )
    if isinstance(value, BaseModel):
        value = dict(value)
    members = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list | tuple)
        else ()
    )
    for step, inner in members:
        if step != FREE:
            yield from beyond(inner, f"{at}/{step}")


def stated(body: BaseModel) -> Iterator[tuple[str, float, Quantity]]:
    """Numbers of a model that measure something: member, value, quantity. What a member measures is
    in its annotation; where another member decides about it, in the model's own `measured`.
    """
    for name, quantity in _annotated(type(body)).items():
        if (value := getattr(body, name)) is not None:
            yield name, value, quantity
    if (measured := getattr(body, "measured", None)) is not None:
        yield from measured()


@cache
def _annotated(model: type[BaseModel]) -> dict[str, Quantity]:
    fields = model.model_fields.items()
    quantities = {
        name: next(_quantities((field.annotation, *field.metadata)), None) for name, field in fields
    }
    return {name: quantity for name, quantity in quantities.items() if quantity is not None}


def _quantities(parts: tuple[Any, ...]) -> Iterator[Quantity]:
    for part in parts:
        if isinstance(part, Quantity):
            yield part
        else:
            yield from _quantities(get_args(part))


def in_words(value: float, unit: str) -> str:
    """A number with its unit, and in the one that a person reads it in.

    >>> in_words(1e13, "Pa"), in_words(0.0005, "m"), in_words(40, "")
    ('1e13 Pa (10000 GPa)', '0.0005 m (0.5 mm)', '40')
    """
    text = f"{_digits(value)} {unit}".rstrip()
    if unit in ("Pa", "m", "kg"):
        factor, other = WRITTEN[unit]
        read = float(f"{value * factor:.12g}")
        if (unit == "Pa" or abs(value) < 1) and _within(read, _READABLE):
            text += f" ({_digits(read)} {other})"
    return text


def _digits(value: float) -> str:
    return re.sub(r"e\+?(-?)0*", r"e\1", f"{value:g}")
