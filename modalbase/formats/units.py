"""Units as laboratories write them, one table for time data, FRFs and coupons.

A unit is read as an expression: `m/s2`, `mm/s^2`, `(1/N)*(m/s²)`, `in/s**2/lbf`, `mV/g`. It has a
factor to SI and a dimension in powers of length, mass, time and voltage, so that N is (1, 1, -2, 0)
and 1/kg is an accelerance. `g` is the gravity of accelerometers, never the gram.
"""

import re
from collections.abc import Mapping
from functools import lru_cache
from math import radians
from typing import Literal, NamedTuple
from unicodedata import normalize

from modalbase.formats.constants import FOOT, INCH, POUND_FORCE, STANDARD_GRAVITY
from modalbase.formats.factors import factor_beside, split_factor, with_factor
from modalbase.formats.types import Quantity

Measured = Literal[
    "force", "acceleration", "velocity", "displacement", "length", "voltage", "time", "frequency", "stress", "strain",
    "mass"
]  # fmt: skip
"""What a unit can be of; that of a length is a displacement's, a pure number a strain's."""


class Dimension(NamedTuple):
    """Powers of length, mass, time and voltage."""

    length: int = 0
    mass: int = 0
    time: int = 0
    voltage: int = 0

    def times(self, other: "Dimension", power: int = 1) -> "Dimension":
        """The dimension of a·bᵖ.

        >>> ACCELERATION.times(FORCE, -1)  # acceleration over force: 1/mass
        Dimension(length=0, mass=-1, time=0, voltage=0)
        """
        return Dimension(*(a + power * b for a, b in zip(self, other, strict=True)))


FORCE, ACCELERATION, VELOCITY, LENGTH = (
    Dimension(1, 1, -2),
    Dimension(1, 0, -2),
    Dimension(1, 0, -1),
    Dimension(1),
)
VOLTAGE, TIME, FREQUENCY, NUMBER = (
    Dimension(voltage=1),
    Dimension(time=1),
    Dimension(time=-1),
    Dimension(),
)
DIMENSIONS: dict[Measured, Dimension] = {
    "force": FORCE,
    "acceleration": ACCELERATION,
    "velocity": VELOCITY,
    "displacement": LENGTH,
    "length": LENGTH,
    "voltage": VOLTAGE,
    "time": TIME,
    "frequency": FREQUENCY,
    "stress": Dimension(-1, 1, -2),
    "strain": NUMBER,
    "mass": Dimension(mass=1),
}

RESPONSE: dict[Quantity, Dimension] = {
    "accelerance": ACCELERATION,
    "mobility": VELOCITY,
    "receptance": LENGTH,
}
"""Of what an FRF has above the force."""

_PSI = POUND_FORCE / INCH**2
_NAMES: dict[Dimension, dict[str, float]] = {
    LENGTH: {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "um": 1e-6, "micron": 1e-6, "microns": 1e-6, "nm": 1e-9,
             "in": INCH, "inch": INCH, "inches": INCH, "mil": 1e-3 * INCH, "mils": 1e-3 * INCH, "µin": 1e-6 * INCH,
             "uin": 1e-6 * INCH, "ft": FOOT},
    TIME: {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "sek": 1.0, "seg": 1.0, "ms": 1e-3, "msec": 1e-3,
           "µs": 1e-6, "us": 1e-6, "min": 60.0, "h": 3600.0},
    FREQUENCY: {"Hz": 1.0, "hertz": 1.0, "mHz": 1e-3, "kHz": 1e3, "MHz": 1e6, "cps": 1.0, "rpm": 1 / 60, "cpm": 1 / 60},
    NUMBER: {"1": 1.0, "strain": 1.0, "%": 1e-2, "percent": 1e-2, "‰": 1e-3, "ppm": 1e-6, "mstrain": 1e-3,
             "µε": 1e-6, "ue": 1e-6, "µstrain": 1e-6, "ustrain": 1e-6, "microstrain": 1e-6},
    Dimension(mass=1): {"kg": 1.0},
    FORCE: {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "daN": 10.0, "dyn": 1e-5, "newton": 1.0, "newtons": 1.0,
            "lbf": POUND_FORCE, "lb": POUND_FORCE, "lbs": POUND_FORCE, "kip": 1e3 * POUND_FORCE,
            "kips": 1e3 * POUND_FORCE, "klbf": 1e3 * POUND_FORCE, "kgf": STANDARD_GRAVITY, "kp": STANDARD_GRAVITY},
    FORCE.times(LENGTH): {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3},
    ACCELERATION: {"g": STANDARD_GRAVITY, "gn": STANDARD_GRAVITY, "g0": STANDARD_GRAVITY, "g's": STANDARD_GRAVITY,
                   "gs": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "µg": 1e-6 * STANDARD_GRAVITY,
                   "ug": 1e-6 * STANDARD_GRAVITY, "gal": 1e-2},
    VELOCITY: {"ips": INCH},
    DIMENSIONS["stress"]: {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": _PSI, "ksi": 1e3 * _PSI,
                           "Msi": 1e6 * _PSI},
    VOLTAGE: {"V": 1.0, "volt": 1.0, "volts": 1.0, "mV": 1e-3, "millivolts": 1e-3, "µV": 1e-6, "uV": 1e-6},
}  # fmt: skip
"""SI value of one unit, by dimension and name."""

_ANGLES = {
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    **dict.fromkeys(("deg", "degree", "degrees", "°", "grad", "gradi", "grados"), radians(1)),
    **dict.fromkeys(("cycle", "cycles", "rev", "revs", "turn", "turns"), radians(360)),
    "mrad": 1e-3,
    "gon": radians(0.9),
}
"""Angles in rad; "grad" is German for a degree."""
_TWO_CASES = {"mn", "mpa", "msi", "mhz", "nm"}  # two units by the case of a letter: nm and Nm
_SPELLED = {"MPA": "MPa", "Mpa": "MPa", "MSI": "Msi"}
_COMPOSED: dict[Measured, tuple[str, ...]] = {
    "acceleration": ("m/s²", "mm/s²", "in/s²"),
    "velocity": ("m/s", "mm/s", "in/s"),
    "stress": ("N/mm²",),
    "strain": ("mm/mm", "µm/m"),
}
_FACTOR = r"[0-9]+(?:\.[0-9]+)?(?:e[+-]?[0-9]+)?"
_TOKEN = re.compile(
    rf"\s*(\*\*|[()*/·^.-]|[²³]|g0|{_FACTOR}|[%‰°]|[^\W\d_²³]+(?:'s)?)", re.IGNORECASE
)
# full-width letters, digits and brackets of Chinese and Japanese texts, and units in one character, as ㎜
_HALF_WIDTH = str.maketrans(
    {char: normalize("NFKC", char) for char in map(chr, (0x3000, *range(0x3380, 0x33E0), *range(0xFF01, 0xFF5F)))}
    | dict(zip("【】〔〕", "[]()", strict=True))
)  # fmt: skip
_ONE_SIGN = str.maketrans({"μ": "µ", "ɛ": "ε", "⋅": "·", "×": "*", "∕": "/", "−": "-"})
NO_UNIT = {"", "none", "unknown", "user_defined", "-"}
"""What programs write where they have no unit, in small letters."""


class Unit(NamedTuple):
    """What the text of a unit means."""

    factor: float  # multiply by it for SI
    dimension: Dimension

    @property
    def quantity(self) -> Measured | None:
        """What it is of; None where that is none of ours, such as N·m or mV/g."""
        return next(
            (name for name, dimension in DIMENSIONS.items() if dimension == self.dimension), None
        )


_BY_NAME = {name: Unit(factor, NUMBER) for name, factor in _ANGLES.items()} | {
    name: Unit(factor, dimension)
    for dimension, names in _NAMES.items()
    for name, factor in names.items()
}
_BY_SMALL = {
    name.lower(): unit for name, unit in _BY_NAME.items() if name.lower() not in _TWO_CASES
}


@lru_cache(maxsize=256)
def read_unit(text: str) -> Unit | None:
    """The meaning of a unit as programs and people write it; None where it states none or is not
    understood.

    >>> read_unit("mm/s²")
    Unit(factor=0.001, dimension=Dimension(length=1, mass=0, time=-2, voltage=0))
    >>> read_unit("LBF").quantity, read_unit("g").quantity, read_unit("mV").quantity, read_unit("EU")
    ('force', 'acceleration', 'voltage', None)
    >>> read_unit("20*m").factor, read_unit("50 mm")  # a size beside a name is no unit
    (20.0, None)
    """
    tokens: list[str] = []
    position = 0
    text = plain(text)
    if text.lower() in NO_UNIT:
        return None
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            return None
        tokens.append(match[1])
        position = match.end()
    unit, rest = _product(tokens)
    return unit if not rest else None


_RUN_TOGETHER = re.compile(
    r"(?<![a-zµ])([mµ]?)ms(?:\^|\*\*)?-([12])(?!\d)"
)  # no power of milliseconds


_RAISED = {"⁻¹": "-1", "⁻²": "-2", "⁻³": "-3", "⁻⁶": "-6"}
_POWER_OF_TEN = re.compile(
    r"[*x]?\s*(?:1e([+-]?\d+)|10\s*(?:\^|\*\*)?\s*([+-]\d+))(?![\d.])\s*[*·]?\s*(.*)", re.IGNORECASE
)

_LONGEST = 60  # characters of a unit with a power of ten behind it
_POWER_BEHIND = re.compile(
    r"(\S.*?)\s*(?:[*x·]|(?<=\s))\s*(1e[+-]?\d+|10\s*(?:\^|\*\*)?\s*[+-]\d+)", re.IGNORECASE
)


def half_width(text: str) -> str:
    """A text whose letters, digits and brackets of full width are the usual ones.

    >>> half_width("荷重（ｋＮ）"), half_width("変位 [㎜]")
    ('荷重(kN)', '変位 [mm]')
    """
    return text.translate(_HALF_WIDTH)


def plain(unit: str) -> str:
    """A unit without brackets around it, with one kind of micro sign and epsilon.

    >>> plain("[με]"), plain("ms-2"), plain("mms-1"), plain("1E-3 g/N"), plain("×10⁻⁶"), plain("g/N x10-3")
    ('µε', 'm/s2', 'mm/s', '1e-3*g/N', '1e-6*1', '1e-3*g/N')
    """
    bare = half_width(unit).strip().rstrip(".").translate(_ONE_SIGN)
    for raised, power in _RAISED.items():
        bare = bare.replace(raised, power)
    if len(bare) < _LONGEST and (behind := _POWER_BEHIND.fullmatch(bare)):  # as in "m/s² x10-3"
        bare = f"{behind[2]} {behind[1]}"
    if scaled := _POWER_OF_TEN.fullmatch(bare):
        bare = f"1e{scaled[1] or scaled[2]}*{scaled[3] or 1}"
    bare = _RUN_TOGETHER.sub(lambda match: f"{match[1]}m/s{match[2].replace('1', '')}", bare)
    if bare[:1] + bare[-1:] in ("[]", "()", "{}", "<>") and not {bare[0], bare[-1]} & set(
        bare[1:-1]
    ):
        bare = bare[1:-1].strip()
    return "µε" if bare == "µe" else bare


_AMPLITUDE = re.compile(
    r"[\s_]*[(\[]?(?<![a-z])(rms|eff|p(?:ea)?k(?:[- ]?(?:to[- ]?)?p(?:ea)?k)?|0[- ]?pk?|p-p)[)\]]?$",
    re.IGNORECASE,
)


def without_amplitude(unit: str) -> tuple[str, str]:
    """A unit without the word for the amplitude that is meant, and that word in small letters.

    >>> without_amplitude("g pk"), without_amplitude("N (RMS)"), without_amplitude("kp")
    (('g', 'pk'), ('N', 'rms'), ('kp', ''))
    """
    match = _AMPLITUDE.search(unit.strip())
    if match is None or not unit.strip()[: match.start()]:
        return unit, ""
    return unit.strip()[: match.start()], match[1].lower()


def factor_of(quantity: Measured, unit: str) -> float | None:
    """The SI value of one unit of a quantity (a frequency's in Hz); None where the unit is not one
    of it.

    >>> factor_of("force", "kN"), factor_of("strain", "µε"), factor_of("time", "kN")
    (1000.0, 1e-06, None)
    >>> round(factor_of("frequency", "rad/s"), 4), factor_of("strain", "mV/V")  # a bridge's ratio
    (0.1592, None)
    """
    read = read_unit(unit)
    if read is None or read.dimension != DIMENSIONS[quantity]:
        return None
    names = re.findall(r"[^\W\d_]+|°", plain(unit))
    parts = [part for part in map(_atom, names) if part]
    if quantity == "strain" and any(part.dimension not in (LENGTH, NUMBER) for part in parts):
        return None
    turns = quantity == "frequency" and any(name.lower() in _ANGLES for name in names)
    return read.factor / radians(360) if turns else read.factor


def angle_of(text: str) -> float | None:
    """The value in rad of one unit of an angle; None of what is none.

    >>> angle_of("[rad]"), angle_of("π rad"), angle_of("Degrees") == angle_of("°"), angle_of("g/N")
    (1.0, 3.141592653589793, True, None)
    """
    bare = plain(text).lower().replace(" ", "").replace("pi", "π")
    number = _ANGLES.get("rad" if bare == "π" else bare.removeprefix("π"))
    return number and number * (radians(180) if "π" in bare else 1.0)


_LEVEL = re.compile(r"(?<![^\W\d_])(?:dB|(?i:db)(?![^\W\d_]))[\s,/:]*(.*)")  # dBg is one of g
_WRAPPED = re.compile(r"[(\[{]([^()\[\]{}]*(?:\([^()]*\)[^()\[\]{}]*)*)[)\]}]")
_REFERENCE = re.compile(
    rf"(?:re(?:f(?:erence)?)?\.?(?![a-z]))?[\s=:]*(?:({_FACTOR})(?!\s*/)|1\.)?\s*(.*)",
    re.IGNORECASE,
)


def level_of(text: str) -> str | None:
    """The unit of the amplitude at 0 dB, "" where a level states none; None of what is no level.

    >>> level_of("dB re 1 g/N"), level_of("dB (m/s²/N)"), level_of("dBg/N"), level_of("dB"), level_of("g/N")
    ('g/N', 'm/s²/N', 'g/N', '', None)
    >>> level_of("dB re 1e-6")  # of an unknown unit
    '1e-06'
    >>> level_of("dB, ref=1.0E-6 m/s²/N"), level_of("DB (re 20 (µm/s)/N)"), level_of("dB//1 (m/s)/N")
    ('1e-06*(m/s²/N)', '20*((µm/s)/N)', '(m/s)/N')
    """
    level = _LEVEL.search(text)
    if level is None:
        return None
    wrapped = _WRAPPED.fullmatch(level[1].strip())
    reference = _REFERENCE.fullmatch(wrapped[1].strip() if wrapped else level[1].strip())
    assert reference is not None, "everything in it may be missing"
    number, unit = float(reference[1] or 1), plain(reference[2])
    if number == 1:
        return unit
    return f"{number:g}*({unit})" if unit else f"{number:g}"


def decibels_in(name: str) -> str:
    """What brackets of a name hold where that is a level; else nothing.

    >>> decibels_in("H1 [dB re 1 g/N]"), decibels_in("H1 [g/N]")
    ('dB re 1 g/N', '')
    """
    match = re.search(r"[(\[](\s*dB.*)[)\]]", name, re.IGNORECASE)
    return match[1] if match and level_of(match[1]) is not None else ""


def values_of(quantity: Measured, names: str) -> dict[str, float]:
    """SI values of some units of a quantity, by name.

    >>> values_of("length", "m mm")
    {'m': 1.0, 'mm': 0.001}
    """
    return {name: _NAMES[DIMENSIONS[quantity]][name] for name in names.split()}


def known_units(quantity: Measured) -> str:
    """Names of the units of a quantity, for a message.

    >>> known_units("velocity")
    'm/s, mm/s, in/s, ips'
    """
    return ", ".join((*_COMPOSED.get(quantity, ()), *_NAMES.get(DIMENSIONS[quantity], ())))


_IN_BRACKETS = re.compile(r"[\[({<]([^\[\](){}<>]*(?:\([^()]*\)[^\[\](){}<>]*)*)[\])}>]")
_NAMED_UNIT = re.compile(r"[^\W\d_]+(?: \w+)*\s*\([^()]*\)")
_LONGEST_NAME = 1000  # characters; the time of looking for a unit grows with their square
_AT_THE_END = re.compile(r"(?=(?:\s*/\s*|\s*[_,;:]\s*|\s+in\s+|\s+)(\S+)$)")


def unit_in_name(name: str, quantity: Measured | None = None) -> tuple[str, str]:
    """The name of a column or channel without the unit that stands in it, and that unit; "" where
    none stands there.

    A unit is what brackets hold, where it reads as one: a name in brackets is none. Without
    brackets, the last part of a name is one where it is a unit of the quantity that the caller
    knows the name to be of.

    >>> unit_in_name("ACC (g)"), unit_in_name("Hammer [lbf] 1"), unit_in_name("Strain 1 (left)")
    (('ACC', 'g'), ('Hammer 1', 'lbf'), ('Strain 1 (left)', ''))
    >>> unit_in_name("Beschleunigung in m/s²")
    ('Beschleunigung', 'm/s²')
    >>> unit_in_name("time_ms", "time"), unit_in_name("time_s"), unit_in_name("Strain 1", "strain")
    (('time', 'ms'), ('time_s', ''), ('Strain 1', ''))
    """
    if len(name) > _LONGEST_NAME:
        return name, ""
    name = half_width(name)
    for match in reversed(list(_IN_BRACKETS.finditer(name))):
        # as in "Strain 1 (Strain (%))"
        inner = unit_in_name(match[1])[1] if _NAMED_UNIT.fullmatch(match[1]) else ""
        if inner:
            return " ".join(name[: match.start()].split()), inner
        if match[1].strip() != "1" and read_unit(match[1]) is not None:
            return (
                " ".join(f"{name[: match.start()]} {name[match.end() :]}".split()),
                match[1].strip(),
            )
    bare, _, behind = name.rpartition(" in ")
    if bare and not behind.strip().isdigit() and read_unit(behind) is not None:
        return bare.strip(), behind.strip()
    for match in _AT_THE_END.finditer(name):
        unit = match[1].replace("_", "/")
        if quantity is not None and not unit.isdigit() and factor_of(quantity, unit) is not None:
            return name[: match.start()], unit
    return name, ""


def unread_unit(name: str) -> str:
    """What the last brackets of a name hold where that is no unit that is known; else nothing.

    >>> unread_unit("Frequency [bins]"), unread_unit("Frequency [Hz]"), unread_unit("f")
    ('bins', '', '')
    """
    held = [match[1].strip() for match in _IN_BRACKETS.finditer(half_width(name))]
    known = not held or held[-1].lower() in NO_UNIT or read_unit(held[-1]) is not None
    return "" if known else held[-1]


# members of the structure of an array
_BESIDE = ("quantity.label", "quantity.unit", "unit", "units", "unit_string")


_ATTRIBUTES = tuple(
    spelled
    for end in ("unit", "units", "unit_string")
    for spelled in (end, end.title(), end.upper())
)


def unit_beside(name: str, texts: Mapping[str, str], quantity: Measured | None = None) -> str:
    """The unit that a file states of an array, in a text beside it or in the array's name; "" where
    it states none. One of another quantity that a whole structure has is not the array's.

    >>> unit_beside("FRF.y_values.values", {"FRF.y_values.quantity.label": "g/N"}), unit_beside("H (m/N)", {})
    ('g/N', 'm/N')
    >>> import numpy as np
    >>> from modalbase.formats.factors import factors_among  # whoever sends it says what counts
    >>> unit_beside("H", {"H@unit": "g/N"} | factors_among({"H@gain": np.array(10)}))
    'g/N (gain = 10)'
    """
    parent, _, own = name.rpartition(".")
    within = f"{parent}." if parent else ""
    shared = [
        text
        for end in _BESIDE
        if (text := texts.get(f"{within}{end}", ""))
        and (quantity is None or factor_of(quantity, text) is not None)
    ]
    attributes = [f"{name}@{end}" for end in _ATTRIBUTES]  # of a dataset
    its_own = [
        texts.get(at, "") for at in (f"{within}{own}_unit", f"{within}{own}_units", *attributes)
    ]
    stated = next((text.strip() for text in (*shared, *its_own) if text.strip()), "")
    bare, factor = split_factor(stated)
    factor = factor or factor_beside(name, texts, own=quantity is not None)
    return with_factor(bare or unit_in_name(own, quantity)[1], factor)


def _product(tokens: list[str]) -> tuple[Unit | None, list[str]]:
    """Factors joined by * · - . or blanks, and divided by /; stops at a closing parenthesis."""
    total = Unit(1.0, NUMBER)
    power = 1
    expect = True
    if tokens[1:2] == ["*"] and re.fullmatch(_FACTOR, tokens[0], re.IGNORECASE):
        total, expect, tokens = Unit(float(tokens[0]), NUMBER), False, tokens[1:]
    while tokens and tokens[0] != ")":
        if tokens[0] in ("*", "·", "/", "-", "."):
            if expect:
                return None, tokens
            power, expect, tokens = (-1 if tokens[0] == "/" else 1), True, tokens[1:]
            continue
        if tokens[0].isdigit() and not expect:  # "Strain 1" is a name
            return None, tokens
        unit, tokens = _factor(tokens)
        if unit is None:
            return None, tokens
        total = Unit(
            total.factor * unit.factor**power, total.dimension.times(unit.dimension, power)
        )
        expect = False
    return (None if expect else total), tokens


def _factor(tokens: list[str]) -> tuple[Unit | None, list[str]]:
    """A unit or a parenthesis, with its power: s2, s^2, s**2, s²."""
    unit: Unit | None
    if tokens[0] == "(":
        unit, tokens = _product(tokens[1:])
        if not tokens:
            return None, tokens
        tokens = tokens[1:]
    else:
        unit, tokens = _atom(tokens[0]), tokens[1:]
    if unit is None:
        return None, tokens
    exponent = 1
    if tokens and tokens[0] in "²³":
        exponent, tokens = (2 if tokens[0] == "²" else 3), tokens[1:]
    elif tokens and tokens[0] in ("^", "**"):
        sign, tokens = (-1, tokens[2:]) if tokens[1:2] == ["-"] else (1, tokens[1:])
        if not tokens or tokens[0] not in ("1", "2", "3"):
            return None, tokens
        exponent, tokens = sign * int(tokens[0]), tokens[1:]
    elif len(tokens) > 1 and tokens[0] == "-" and tokens[1] in ("1", "2", "3"):
        exponent, tokens = -int(tokens[1]), tokens[2:]
    elif tokens and tokens[0] in ("2", "3") and unit.dimension != NUMBER:
        exponent, tokens = int(tokens[0]), tokens[1:]
    return Unit(unit.factor**exponent, NUMBER.times(unit.dimension, exponent)), tokens


def _atom(name: str) -> Unit | None:
    """A single unit; case matters only where milli and mega differ by it."""
    return _BY_NAME.get(_SPELLED.get(name, name)) or _BY_SMALL.get(name.lower())
