"""Quantities as people type them: `1850 kg/m³`, `21,5`, `70 °F`, `0.5 m`, `1.2e3`. One reader for
every field of every page.

A number without a unit is in the unit of its field; with one, it is converted. A comma or a point
is the decimal mark; groups of three digits may be parted by blanks, apostrophes, or the other mark.
What could be two numbers (`1,850`) is asked about.
"""

import re
from fractions import Fraction
from functools import cache
from typing import Any

from fecore.quantities import QUANTITIES, WRITTEN
from service.platform.errors import ServiceError

_INCH, _POUND, _POUND_FORCE, _PSI = "0.0254", "0.45359237", "4.4482216152605", "6894.757293168361"
_DEGREE = "0.017453292519943295"
DIMENSIONS: tuple[dict[str, str], ...] = (
    {"mm": "1e-3", "cm": "1e-2", "m": "1", "µm": "1e-6", "um": "1e-6", "nm": "1e-9", "dm": "0.1", "km": "1e3",
     "in": _INCH, "inch": _INCH, "mil": "2.54e-5", "ft": "0.3048"},
    {"GPa": "1e9", "MPa": "1e6", "kPa": "1e3", "Pa": "1", "N/mm2": "1e6", "kN/mm2": "1e9", "N/m2": "1", "bar": "1e5",
     "psi": _PSI, "ksi": f"{_PSI}e3", "Msi": f"{_PSI}e6"},
    {"g": "1e-3", "kg": "1", "mg": "1e-6", "t": "1e3", "lb": _POUND, "oz": "0.028349523125"},
    {"kg/m3": "1", "g/cm3": "1e3", "kgm-3": "1", "gcm-3": "1e3", "g/cc": "1e3", "g/ml": "1e3", "kg/dm3": "1e3",
     "kg/l": "1e3", "g/l": "1", "t/m3": "1e3", "g/mm3": "1e6", "kg/mm3": "1e9", "t/mm3": "1e12",
     "lb/ft3": "16.018463373960142", "lb/in3": "27679.904710203122"},
    {"kgm2": "1", "kgcm2": "1e-4", "kgmm2": "1e-6", "gm2": "1e-3", "gcm2": "1e-7", "gmm2": "1e-9"},
    {"m/s": "1", "mm/s": "1e-3", "km/h": "5/18", "mph": "0.44704"},
    {"1/s": "1", "s-1": "1", "1/ms": "1e3", "1/min": "1/60"},
    {"Hz": "1", "kHz": "1e3", "MHz": "1e6"},
    {"°": _DEGREE, "deg": _DEGREE, "degrees": _DEGREE, "rad": "1", "mrad": "1e-3"},
    {"s": "1", "ms": "1e-3", "µs": "1e-6", "us": "1e-6", "ns": "1e-9"},
    {"d": "1", "day": "1", "days": "1", "week": "7", "weeks": "7", "h": "1/24"},
    {"N": "1", "kN": "1e3", "mN": "1e-3", "lbf": _POUND_FORCE, "kgf": "9.80665"},
    {"N/m": "1", "N/mm": "1e3", "kN/m": "1e3", "kN/mm": "1e6", "MN/m": "1e6", "Nm/rad": "1", "kNm/rad": "1e3"},
    {"°C": "1", "C": "1", "degC": "1", "°": "1", "K": "1", "°F": "1", "F": "1", "degF": "1"},
    {"": "1", "%": "0.01", "‰": "1e-3", "ppm": "1e-6", "m/m": "1", "mm/m": "1e-3", "µm/m": "1e-6", "µε": "1e-6",
     "ue": "1e-6", "ustrain": "1e-6", "microstrain": "1e-6"},
    {"%": "1", "%rh": "1"},
)  # fmt: skip
"""Units of one kind, the usual ones first, each with its size; a unit of two kinds is of that of
its field.
"""

_KELVIN, _FAHRENHEIT = ("K",), ("°F", "F", "degF")
SHOWN_AS = {unit: WRITTEN[unit][1] for unit in ("m", "Pa", "kg")}
"""What people write in place of an SI unit."""

LONGEST = 200  # characters of one quantity
SMALLEST, LARGEST = Fraction("1e-300"), Fraction("1e300")


class UnreadableError(ServiceError):
    """A text is no quantity of its field; the message says what would be."""


class AmbiguousError(UnreadableError):
    """A text could mean two numbers.

    Attributes:
        readings: both, each with the unit that the text has.
    """

    def __init__(self, text: str, first: str, second: str) -> None:
        self.readings = [first, second]
        super().__init__(f"“{text[:40]}” is {first} or {second}: write which, without a comma")

    def usual(self, unit: str, to: str) -> list[str]:
        """The readings that a quantity of this unit usually has; both where none is, or each is."""
        ranges = [one.usual for one in QUANTITIES.values() if one.unit == to and one.usual]
        values = {one: abs(read(one, unit, to)) for one in self.readings}
        usual = [
            one
            for one, value in values.items()
            if any(low <= value <= high for low, high in ranges)
        ]
        return usual or self.readings


def read(text: str, unit: str, to: str) -> float:
    """The number that a text means.

    Args:
        text: as it was typed.
        unit: in which a number without one is, such as `GPa`; empty where it has none.
        to: unit of the number to return, such as `Pa`.

    Raises:
        UnreadableError: it is no number, is in a unit of another kind, or could mean two numbers.

    >>> read("1.85 g/cm³", "kg/m³", "kg/m³"), read("21,5", "°C", "°C"), read("33000 MPa", "GPa", "Pa")
    (1850.0, 21.5, 33000000000.0)
    """
    number, stated = _parts(text, unit)
    kind = _kind(to)
    name = _spelled(stated, kind, text) if stated else _plain(unit)
    value = (
        _celsius(number, name)
        if "°C" in kind
        else number * Fraction(kind[name]) / Fraction(kind[_plain(to)])
    )
    if value and not SMALLEST < abs(value) < LARGEST:
        raise UnreadableError(f"“{text.strip()[:40]}” is beyond what can be computed with")
    return float(value)


def read_whole(text: str) -> int:
    """The whole number that a text means.

    Raises:
        UnreadableError: it is none, or one that a browser does not keep to the last digit.
    """
    value = read(text, "", "")
    if value != int(value) or "%" in text:
        raise UnreadableError(f"“{text.strip()[:40]}” is no whole number")
    if abs(value) >= 2**53:
        raise UnreadableError(
            f"“{text.strip()[:40]}” has more digits than are kept; the largest is {2**53 - 1}"
        )
    return int(value)


def read_numbers(text: str, unit: str, to: str) -> list[float]:
    """The numbers of a list; where only the last one has a unit, all are in it.

    Raises:
        UnreadableError: one of them cannot be read, or commas without blanks part them or are in
            them.

    >>> read_numbers("−90, 0, 90 mm", "mm", "m"), read_numbers("25,02; 25,00", "", "")
    ([-0.09, 0.0, 0.09], [25.02, 25.0])
    """
    parts = split(text)
    if (
        len(parts) == 1
        and parts[0].count(",")
        and not re.search(r"[^\d.,\s+−-]", parts[0].split(",")[0])
    ):
        raise UnreadableError(
            f"“{text.strip()[:40]}” is one number or several: part them with semicolons"
        )
    stated = [bool(_parts(part, unit)[1]) for part in parts]
    if any(stated) and not all(stated):
        if stated.index(True) != len(parts) - 1:
            raise UnreadableError(
                "some of the numbers have a unit and others have none: write it once, behind the"
                " last"
            )
        last = _parts(parts[-1], unit)[1]
        parts = [*(f"{part} {last}" for part in parts[:-1]), parts[-1]]
    return [read(part, unit, to) for part in parts]


def read_points(text: str) -> list[dict[str, Any]]:
    """Grid points of lines: number, x, y and where it is given z, in mm or with a unit.

    Raises:
        UnreadableError: a line is none; says which.

    >>> read_points("1; 0,5; -20")
    [{'label': 1, 'x_m': 0.0005, 'y_m': -0.02, 'z_m': 0.0}]
    """
    points = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip():
            try:
                points.append(_point(line))
            except UnreadableError as error:
                raise UnreadableError(f"line {number}: {error}") from None
    return points


def _point(line: str) -> dict[str, Any]:
    parts = split(line)
    label, *sizes = parts if len(parts) > 1 else [part.strip() for part in line.split(",")]
    if not 2 <= len(sizes) <= 3:
        raise UnreadableError(f"“{line.strip()[:60]}” is no line of number, x, y and z")
    x, y, z = [*(read(size, "mm", "m") for size in sizes), 0.0][:3]
    return {"label": read_whole(label), "x_m": x, "y_m": y, "z_m": z}


def in_words(value: float, unit: str, to: str, digits: int = 10) -> str:
    """A number that was read, in the unit of its field: what a page shows as understood.

    >>> in_words(33.05e9, "GPa", "Pa"), in_words(2.0, "", "")
    ('33.05 GPa', '2')
    """
    kind = _kind(to)
    shown = (
        value
        if "°C" in kind
        else float(Fraction(value) * Fraction(kind[_plain(to)]) / Fraction(kind[_plain(unit)]))
    )
    return f"{shown:.{digits}g} {unit}".strip()


def are_alike(unit: str, to: str) -> bool:
    """Whether a number in the one unit is one in the other."""
    kind = _kind(to)
    return _plain(unit) in kind and _plain(to) in kind


def size_of(unit: str, to: str) -> float:
    """One unit of a field in the unit that is sent.

    >>> size_of("GPa", "Pa"), size_of("kg m²", "kg·m²")
    (1000000000.0, 1.0)
    """
    kind = _kind(to)
    return float(Fraction(kind[_plain(unit)]) / Fraction(kind[_plain(to)]))


def split(text: str) -> list[str]:
    """The parts of a list: by semicolons, tabs or line breaks where there are some, else by commas
    with a blank, else by blanks between numbers.
    """
    for separator in (r"[;\t\n]", r",\s+"):
        if re.search(separator, text.strip()):
            return [part for each in re.split(separator, text) if (part := each.strip())]
    return re.split(r"\s+(?=[+−-]?[.,]?\d)", text.strip())


_MINUS = str.maketrans(
    {"−": "-", "–": "-", "\u00a0": " ", "\u2009": " ", "\u202f": " ", "’": "'", "μ": "µ"}
)
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_QUANTITY = re.compile(
    r"(?P<sign>[+-]?)\s*(?P<digits>[0-9.,](?:[0-9.,' ]*[0-9.,])?)"
    r"(?:[eE](?P<e>[+-]?[0-9]{1,4})|\s*[x×·*]\s*10(?:\^|\*\*)?(?P<ten>[+-]?[0-9]{1,4}))?(?P<unit>\s*[^0-9\s.,'].*)?"
)


def _parts(text: str, unit: str) -> tuple[Fraction, str]:
    """The number of a text, in its own unit, and that unit; empty where it states none."""
    plain = text.strip().translate(_MINUS).translate(_SUPERSCRIPTS)
    match = _QUANTITY.fullmatch(re.sub(r"\s+1/", " /", plain)) if len(plain) <= LONGEST else None
    if match is None:
        raise UnreadableError(f"“{text.strip()[:40]}” is no number{f' in {unit}' if unit else ''}")
    stated, power = (match["unit"] or "").strip(), match["e"] or match["ten"] or 0
    try:
        digits = _decimal(match["digits"], text.strip())
    except AmbiguousError as error:
        tail = f"{f'e{power}' if power else ''} {stated}".rstrip()
        error.readings = [f"{match['sign']}{number}{tail}" for number in error.readings]
        raise
    return Fraction(f"{match['sign']}{digits}e{power}"), stated


def _decimal(digits: str, text: str) -> str:
    """Digits with a point before the decimals, and nothing else."""
    marks = [mark for mark in ",." if mark in digits]
    if len(marks) == 2:
        marks.sort(key=digits.rindex)  # the last one is the decimal mark
    blanks = any(mark in digits for mark in " '")
    if len(marks) == 1 and digits.count(marks[0]) == 1:
        before, after = digits.split(marks[0])
        if (
            marks == [","]
            and not blanks
            and len(after) == 3
            and re.fullmatch(r"[1-9]\d{0,2}", before)
        ):
            raise AmbiguousError(text, f"{before}{after}", f"{before}.{after}")
        whole, fraction = before, after
    elif len(marks) == 2 and digits.count(marks[1]) == 1:
        whole, fraction = digits.split(marks[1])
    else:
        whole, fraction = digits, ""
    if not re.fullmatch(r"\d*", whole):
        if not re.fullmatch(r"\d{1,3}(?:([ ',.])\d{3})(?:\1\d{3})*", whole):
            raise UnreadableError(f"“{text[:40]}” is no number: its digits are parted unevenly")
        whole = re.sub(r"\D", "", whole)
    if not re.fullmatch(r"\d*", fraction) or not whole + fraction:
        raise UnreadableError(f"“{text[:40]}” is no number")
    return f"{whole or 0}.{fraction or 0}"


def _plain(unit: str) -> str:
    """A unit's name without what people write differently: kg·m², kg m^2 and kg m2 are one.

    >>> _plain("kg/m³"), _plain("N·m/rad")
    ('kg/m3', 'Nm/rad')
    """
    return re.sub(r"[\s·⋅*^()]", "", unit.translate(_MINUS).translate(_SUPERSCRIPTS))


@cache
def _kind(to: str) -> dict[str, str]:
    """The units of the same kind."""
    if to == "%":  # of humidity; elsewhere a share
        return DIMENSIONS[-1]
    return next((kind for kind in DIMENSIONS if _plain(to) in kind), {"": "1", _plain(to): "1"})


def _spelled(stated: str, kind: dict[str, str], text: str) -> str:
    """The name of a unit as the table has it; without regard to case where that is one unit
    alone.
    """
    name = re.sub("^/", "1/", _plain(stated))
    alike = [one for one in kind if one.lower() == name.lower()]
    if name in kind or len({kind[one] for one in alike}) == 1:
        return name if name in kind else alike[0]
    known = [one for one in kind if one][:6]
    if alike:
        raise UnreadableError(f"“{stated[:20]}” is {' or '.join(alike)}: write which")
    if not known:
        raise UnreadableError(f"“{text.strip()[:40]}” has a unit, and this number has none")
    raise UnreadableError(f"“{stated[:20]}” is no unit of this field; there is {', '.join(known)}")


def _celsius(number: Fraction, name: str) -> Fraction:
    if name in _KELVIN:
        return number - Fraction("273.15")
    return (number - 32) * 5 / 9 if name in _FAHRENHEIT else number
