"""Headings of tables as people write them, `Temperatur [°C]` or `Wind (m/s)`, as covariates."""

import re
import unicodedata

from modalbase.formats.units import (
    ACCELERATION,
    DIMENSIONS,
    FORCE,
    FREQUENCY,
    LENGTH,
    TIME,
    VELOCITY,
    VOLTAGE,
    read_unit,
)

_HEADING = re.compile(r"(.*\S)\s*[\[(]([^\[\]()]+)[\])]")
BY_TEXT = {
    "°c": "_c", "degc": "_c", "c": "_c", "%": "_percent", "%rh": "_percent", "% r.f.": "_percent",
    "1": "_ratio", "-": "_ratio", "°": "_deg", "deg": "_deg", "w/m²": "_W_m2", "w/m2": "_W_m2", "w": "_W", "a": "_A",
}  # fmt: skip
"""Ends of names by units that are no units of mechanics, in small letters."""
BY_DIMENSION = {
    ACCELERATION: "_m_s2",
    VELOCITY: "_m_s",
    LENGTH: "_m",
    TIME: "_s",
    FREQUENCY: "_hz",
    FORCE: "_N",
    VOLTAGE: "_V",
    DIMENSIONS["stress"]: "_Pa",
    DIMENSIONS["mass"]: "_kg",
}
"""Ends of names by what a unit is of; numbers go into SI."""
_LETTERS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "ø": "o", "æ": "ae"})


def covariate_of(heading: str) -> tuple[str, float]:
    """The name of a covariate with its unit, and what numbers below are multiplied by; a heading
    without a unit in brackets as it is.

    >>> covariate_of("Temperatur [°C]"), covariate_of("Wind (km/h)"), covariate_of("wind_m_s")
    (('temperatur_c', 1.0), ('wind_m_s', 0.2777777777777778), ('wind_m_s', 1.0))

    Raises:
        ValueError: no covariate is in that unit; says so.
    """
    parts = _HEADING.fullmatch(heading)
    if parts is None:
        return heading, 1.0
    text = parts[2].strip()
    unit = None if text.lower() in BY_TEXT else read_unit(text)
    end = BY_TEXT.get(text.lower()) if unit is None else BY_DIMENSION.get(unit.dimension)
    if end is None:
        raise ValueError(f"{heading!r} is in {text!r}, which is no unit of a covariate")
    plain = unicodedata.normalize("NFKD", parts[1].lower().translate(_LETTERS))
    words = re.sub(r"[^a-z0-9]+", "_", plain.encode("ascii", "ignore").decode()).strip("_")
    return words if words.endswith(end) else words + end, 1.0 if unit is None else unit.factor
