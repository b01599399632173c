"""Units of a UFF file: set 164, unit labels as engineers write them, and the way from both to SI.

A label is read as an expression: `m/s2`, `mm/s^2`, `(1/N)*(m/s²)`, `g/N`, `in/s**2/lbf`. It has a factor to SI and a
dimension in powers of length, mass and time, so that N is (1, 1, -2) and 1/kg is an accelerance.
"""

import re
from dataclasses import dataclass
from functools import lru_cache

from modalbase.formats.constants import POUND_FORCE, STANDARD_GRAVITY
from modalbase.formats.types import Quantity
from modalbase.formats.uff.content import Units
from modalbase.formats.uff.text import Cursor, Refusal, decoded

Dimension = tuple[int, int, int]

RESPONSE: dict[Quantity, Dimension] = {"accelerance": (1, 0, -2), "mobility": (1, 0, -1), "receptance": (1, 0, 0)}
FORCE: Dimension = (1, 1, -2)
_UNITS: dict[Dimension, dict[str, float]] = {
    (1, 0, 0): {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9, "in": 0.0254,
                "inch": 0.0254, "mil": 0.0254e-3, "ft": 0.3048},
    (0, 0, 1): {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0},
    (0, 0, -1): {"hz": 1.0, "khz": 1e3},
    (0, 0, 0): {"rad": 1.0, "deg": 0.017453292519943295, "1": 1.0},
    (0, 1, 0): {"kg": 1.0},
    FORCE: {"n": 1.0, "newton": 1.0, "newtons": 1.0, "kn": 1e3, "mn": 1e-3, "dan": 10.0, "lbf": POUND_FORCE,
            "lb": POUND_FORCE, "kgf": STANDARD_GRAVITY, "kp": STANDARD_GRAVITY},
    (1, 0, -2): {"g": STANDARD_GRAVITY, "gn": STANDARD_GRAVITY, "g's": STANDARD_GRAVITY},
    (1, 0, -1): {"ips": 0.0254},
}  # fmt: skip
"""SI value of one unit, by dimension and name in small letters."""

_ATOMS = {name: (factor, dimension) for dimension, units in _UNITS.items() for name, factor in units.items()}
_TOKEN = re.compile(r"\s*(\*\*|[()*/·^.-]|[²³]|[0-9]+|[^\W\d_²³]+(?:'s)?)")
NO_LABEL = {"", "none", "unknown", "user_defined"}


@dataclass(frozen=True)
class Label:
    """What a unit label means."""

    factor: float  # multiply by it for SI
    dimension: Dimension  # powers of length, mass and time


def times(a: Dimension, b: Dimension, power: int = 1) -> Dimension:
    """The dimension of a·bᵖ, as powers of length, mass and time.

    >>> times((1, 0, -2), (1, 1, -2), -1)  # acceleration over force: 1/mass
    (0, -1, 0)
    """
    return (a[0] + power * b[0], a[1] + power * b[1], a[2] + power * b[2])


@lru_cache(maxsize=256)
def read_label(text: str) -> Label | None:
    """The meaning of a unit label as programs write it in a header; None where it states none or is not understood.

    >>> read_label("mm/s^2")
    Label(factor=0.001, dimension=(1, 0, -2))
    >>> read_label("NONE") is None
    True
    """
    tokens: list[str] = []
    position = 0
    text = text.strip()
    if text.lower() in NO_LABEL:
        return None
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            return None
        tokens.append(match[1])
        position = match.end()
    label, rest = _product(tokens)
    return label if not rest else None


def _product(tokens: list[str]) -> tuple[Label | None, list[str]]:
    """Factors joined by * · - . or blanks, and divided by /; stops at a closing parenthesis."""
    total = Label(1.0, (0, 0, 0))
    power = 1
    expect = True
    while tokens and tokens[0] != ")":
        if tokens[0] in ("*", "·", "/", "-", "."):
            if expect:
                return None, tokens
            power, expect, tokens = (-1 if tokens[0] == "/" else 1), True, tokens[1:]
            continue
        label, tokens = _factor(tokens)
        if label is None:
            return None, tokens
        total = Label(total.factor * label.factor**power, times(total.dimension, label.dimension, power))
        expect = False
    return (None if expect else total), tokens


def _factor(tokens: list[str]) -> tuple[Label | None, list[str]]:
    """A unit or a parenthesis, with its power: s2, s^2, s**2, s²."""
    label: Label | None
    if tokens[0] == "(":
        label, tokens = _product(tokens[1:])
        if not tokens:
            return None, tokens
        tokens = tokens[1:]
    else:
        label, tokens = _atom(tokens[0]), tokens[1:]
    if label is None:
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
    elif tokens and tokens[0] in ("2", "3") and label != _atom("1"):
        exponent, tokens = int(tokens[0]), tokens[1:]
    dimension = label.dimension
    return Label(
        label.factor**exponent, (dimension[0] * exponent, dimension[1] * exponent, dimension[2] * exponent)
    ), tokens


def _atom(name: str) -> Label | None:
    """A single unit; case matters only between mN and MN."""
    found = (1e6, FORCE) if name == "MN" else _ATOMS.get(name.lower())
    return None if found is None else Label(*found)


def read_164(body: bytes, dataset: int) -> tuple[Units, list[str]]:
    """Set 164: units code, description, and the factors by which file values are divided for SI.

    Raises:
        Refusal: a factor is missing, not a number, or absurd.
    """
    cursor = Cursor(body)
    row = cursor.next("the units code")
    (code,) = cursor.integers(row, ["units code"])
    description = decoded(row[10:30])
    length, force, temperature = cursor.reals(cursor.next("the unit factors"), 3, 25, "unit factors")
    (offset,) = cursor.reals(cursor.next("the temperature offset"), 1, 25, "temperature offset")
    if cursor:
        raise Refusal("holds more than the three lines of the format", cursor.line)
    for name, factor in (("length", length), ("force", force), ("temperature", temperature)):
        if not 1e-12 <= factor <= 1e12:
            raise Refusal(f"the {name} factor is {factor:g}, expected a positive conversion factor", 1)
    notes = []
    known = _FACTORS_OF_CODE.get(code)
    if known is not None and (abs(length / known[0] - 1) > 1e-3 or abs(force / known[1] - 1) > 1e-3):
        notes.append(
            f"units code {code} stands for length and force factors {known[0]:g} and {known[1]:g}, but the set states"
            f" {length:g} and {force:g}; the stated factors are used"
        )
    return Units(dataset, code, description, length, force, temperature, temperature_offset=offset), notes


_FACTORS_OF_CODE = {
    1: (1.0, 1.0),
    2: (1 / 0.3048, 1 / POUND_FORCE),
    3: (1.0, 1 / STANDARD_GRAVITY),
    4: (1 / 0.3048, 1 / 0.138254954376),
    5: (1e3, 1e3),
    6: (1e2, 1e2),
    7: (1 / 0.0254, 1 / POUND_FORCE),
    8: (1e3, 1 / STANDARD_GRAVITY),
    10: (1e3, 1.0),
}
