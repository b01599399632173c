"""What one SI unit makes in the samples of a channel: by the unit that the file or the mapping
states, or by a sensitivity.

A unit of force or motion says it alone. Volts need a sensitivity, a number in V per SI unit or a
text with its unit, `"2.25 mV/N"`. Without any unit a sensitivity is what one SI unit makes in the
file. What contradicts is refused with both.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from modalbase.formats.errors import FormatError
from modalbase.formats.factors import factor_beside, question, split_factor, with_factor
from modalbase.formats.records.arrays import array_of
from modalbase.formats.units import DIMENSIONS, VOLTAGE, Unit, known_units, read_unit, unit_in_name

_SAME = 0.01  # by which a stated sensitivity may differ from what the unit says
_NUMBER = re.compile(r"(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?")
_NUMBER_AND_UNIT = re.compile(rf"\s*({_NUMBER.pattern})\s*(\S.*?)\s*")
_INVERTED = re.compile(
    r"^\s*[-−–]\s*(?![xyz]\b)[^\W\d_]{2}|\binvert|\bnegated", re.IGNORECASE
)  # of a channel's name; "-Z" is its direction
SI = {"force": "N", "acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}
"""The unit of each quantity that blocks are stored in."""


def _per(quantity: str) -> str:
    """The SI unit as it is written behind a stroke."""
    return f"({SI[quantity]})" if "/" in SI[quantity] else SI[quantity]


def units_of(name: str, quantity: Any, stated: Mapping[str, str]) -> tuple[str, ...]:
    """Units that a file states of a channel, in its own words: in its properties, and in the
    channel's name.

    >>> units_of("Log/ACC (g)", "acceleration", {"Log/ACC (g)": "m/s^2"}), units_of("ACC", "acceleration", {})
    (('m/s^2', 'g'), ())
    >>> units_of("acc_g column 3", "acceleration", {}), units_of("-Kraft (N)", "force", {})
    (('g',), ('N (inverted)',))

    Args:
        name: of the channel.
        quantity: what it is, where that is known: "acc_g" states a unit where it is an
            acceleration.
        stated: units in the file's properties, by channel.
    """
    own, factor = split_factor(stated.get(name, "").strip())
    array = array_of(name)
    named = unit_in_name(array, quantity if quantity in DIMENSIONS else None)[1]
    factor = factor or factor_beside(array, {}) or ("inverted" if _INVERTED.search(array) else "")
    texts = [text for text in (own, named) if text] or [""] * bool(factor)
    alike = len({read_unit(text) or text for text in texts}) == 1
    return tuple(with_factor(text, factor) for text in (texts[:1] if alike else texts))


def sensitivity_of(channel: Mapping[str, Any], in_file: Sequence[str], place: str) -> float:
    """By what the samples of a channel are divided for SI.

    Args:
        channel: of a mapping, with its `quantity`, and `unit`, `instead_of` and `sensitivity` where
            they are stated; a member that is null is empty, and is asked for where it is needed.
        in_file: units that the file states, see `units_of`.
        place: of the channel in the mapping, for errors.

    Raises:
        FormatError: it is not stated, or two statements contradict each other; names both.
    """
    text = _unit(channel, in_file, place)
    unit, quantity, given = read_unit(text), channel["quantity"], channel.get("sensitivity")
    if unknown := question(text, SI[quantity]):
        raise FormatError(f"{place}.unit", f"is {text!r}{unknown}")
    if isinstance(given, str) and _NUMBER.fullmatch(given.strip()):
        given = float(given.replace(",", "."))
    if unit is not None and unit.dimension == DIMENSIONS[quantity]:
        return _of_si(unit, text, given, place)
    if unit is not None and unit.dimension != VOLTAGE:
        what = f"a unit of {unit.quantity}" if unit.quantity else "none of a force or motion"
        raise FormatError(
            f"{place}.quantity",
            f"is {quantity!r}, and the unit {text!r} is {what}; which is right?",
        )
    example = f'a number in volts per {SI[quantity]}, or a text such as "2.25 mV/{_per(quantity)}"'
    if given is None and (unit is not None or text):
        why = "volts" if unit is not None else "no unit that is known here"
        raise FormatError(
            f"{place}.sensitivity", f"is missing: the file is in {text!r}, {why}; state {example}"
        )
    if given is None and "sensitivity" in channel:
        why = (
            f"the file states no unit; state one (`unit`), or {example}; 1 where the file is in SI"
        )
        raise FormatError(f"{place}.sensitivity", f"is empty: {why}")
    if isinstance(given, str):
        return _read(given, quantity, place) / (1.0 if unit is None else unit.factor)
    if unit is not None and unit.factor != 1.0:
        both = " or ".join(f'"{given:g} {name}/{_per(quantity)}"' for name in (text, "V"))
        raise FormatError(
            f"{place}.sensitivity", f"is {given:g}, and the file is in {text!r}: state {both}"
        )
    return 1.0 if given is None else float(given)


def _unit(channel: Mapping[str, Any], in_file: Sequence[str], place: str) -> str:
    """The unit of the samples: the file's, or the stated one where it does not contradict; "" where
    there is none.
    """
    stated, instead = channel.get("unit") or "", channel.get("instead_of") or ""
    file_units = " and ".join(map(repr, in_file))
    if instead and instead not in in_file:
        raise FormatError(
            f"{place}.instead_of", f"is {instead!r}, and the file states {file_units or 'no unit'}"
        )
    if not stated:
        if len(in_file) > 1:
            raise FormatError(
                f"{place}.unit",
                f"is stated in the file as {file_units}; state the one that is right",
            )
        return in_file[0] if in_file else ""
    unit = read_unit(stated)
    if unit is None and stated not in in_file:
        known = known_units(channel["quantity"])
        raise FormatError(
            f"{place}.unit",
            f"is {stated!r}, which is no unit that is known here; expected {known}, V, mV",
        )
    others = [read_unit(text) for text in in_file if text != instead]
    if unit is not None and any(others) and unit not in others and not instead:
        wrong = in_file[0]
        raise FormatError(
            f"{place}.unit",
            f"is {stated!r}, and the file states {file_units}; where the file is wrong, state"
            f' "instead_of": "{wrong}"',
        )
    return stated


def _of_si(unit: Unit, text: str, given: Any, place: str) -> float:
    """Of samples in a unit of the quantity."""
    if given is not None and (isinstance(given, str) or abs(given * unit.factor - 1) > _SAME):
        raise FormatError(
            f"{place}.sensitivity",
            f"is {given!r}, and the unit {text!r} says that the samples are no volts; leave it out,"
            " or state "
            f'"unit": "V", "instead_of": "{text}" where they are volts',
        )
    return 1 / unit.factor


def _read(text: str, quantity: str, place: str) -> float:
    """A sensitivity with its unit, in V per SI unit."""
    match = _NUMBER_AND_UNIT.fullmatch(text)
    unit = read_unit(match[2]) if match else None
    if match is None or unit is None or unit.dimension != VOLTAGE.times(DIMENSIONS[quantity], -1):  # type: ignore[index]
        raise FormatError(
            f"{place}.sensitivity",
            f'is {text!r}, expected a number, or a text such as "2.25 mV/{_per(quantity)}"',
        )
    return float(match[1].replace(",", ".")) * unit.factor
