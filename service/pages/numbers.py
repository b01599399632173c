"""Numbers as a laboratory writes them: its units, and no more digits than the uncertainty
leaves.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

from fecore.quantities import SHOWN
from modalbase.client.results import deviations, motion_words
from service.figures.marks import counted
from service.figures.trend import named_covariate, shown_in
from service.nouns.campaigns.climate import ENDINGS
from service.platform.web.quantities import UNITS

NOTHING = "–"
UNITS_OF_MEMBERS = {**ENDINGS, **UNITS}
"""Unit of a member by the end of its name."""


KEY = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}")
"""The key of a row, as text."""

_MINUS = re.compile(r"(?<![\w.)-])-(?=\d)")


def minus(text: str) -> str:
    """A text whose negative numbers have the sign that print has.

    >>> minus("-38 % of 2026-11-30, 1e-5")
    '−38 % of 2026-11-30, 1e-5'
    """
    return _MINUS.sub("−", text)


def number(value: float | None, digits: int = 4) -> str:
    """A value with so many significant digits, without an exponent where it can be read without
    one.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 <= size < 7:
        return minus(f"{value:.{max(0, digits - 1 - size)}f}")
    text = f"{value:.{digits - 1}e}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")
    return minus(text)


def watched(value: float | None, name: str, unit: str | None, sd: float | None = None) -> str:
    """A value that a monitor watches: damping ratios are in per cent."""
    factor, shown = shown_in(name, unit)
    scaled = [None if each is None else factor * each for each in (value, sd)]
    return in_unit(scaled[0], shown or "", scaled[1])


def unit_watched(unit: str | None, name: str) -> str:
    """The unit of what `watched` gives."""
    return (shown_in(name, unit)[1] or "").strip(NOTHING)


def unit_of(unit: str) -> str:
    """The unit in which values of an SI unit are shown."""
    return "" if unit == "1" else SHOWN.get(unit, (1.0, unit))[1]


def in_unit(value: float | None, unit: str, sd: float | None = None) -> str:
    """A value of an SI unit as a laboratory writes it; with a standard deviation to its second
    digit.

    >>> in_unit(33.0512e9, "Pa", 0.21e9)
    '33.05'
    """
    factor = SHOWN.get(unit, (1.0, unit))[0]
    if value is None or not math.isfinite(value):
        return NOTHING
    shown = factor * value
    if sd is None or sd <= 0 or not math.isfinite(sd):
        return number(shown)
    places = 1 - math.floor(math.log10(factor * sd))
    if places > 8 or abs(shown) >= 1e7:
        return number(shown, 6)
    return minus(f"{shown:.{max(0, places)}f}")


def spread(row: Mapping[str, Any]) -> str:
    """How far an estimate may be off, beside it: two sides where its interval is not about its
    middle.

    >>> row = {"unit": "Pa", "estimate": 26.9e9, "standard_deviation": 8e9, "interval_95": [11.3e9, 27e9]}
    >>> spread(row), spread(row | {"interval_95": None})
    ('+0.1 −8.0', '± 8.0')
    """
    sd = row["standard_deviation"]
    if row["estimate"] is None or sd is None:
        return f"± {NOTHING}"
    sides = [
        in_unit(each, row["unit"], sd)
        for each in deviations(row["estimate"], sd, row["interval_95"])
    ]
    return f"± {sides[0]}" if len(sides) == 1 else f"+{sides[0]} −{sides[1]}"


def percent(value: float | None, digits: int = 2) -> str:
    """A per cent value with a sign."""
    if value is None or not math.isfinite(value):
        return NOTHING
    text = f"{value:+.{digits}f}"
    return minus(text) if float(text) else text[1:]  # no sign of nothing


def in_laboratory_units(text: str) -> str:
    """A text with its amounts in Pa, m and s as a laboratory writes them.

    >>> in_laboratory_units("0.000121 m, stated")
    '0.121 mm, stated'
    """

    def shown(match: re.Match[str]) -> str:
        factor, unit = SHOWN[match[2]]
        return f"{factor * float(match[1]):.3g} {unit}"

    return _AMOUNT.sub(shown, text)


_AMOUNT = re.compile(r"(?<![\w.])(\d[\d.]*(?:e[+-]?\d+)?) (Pa|m|s)(?=$|,)")


def day(value: datetime | str | None) -> str:
    """A date in UTC."""
    return NOTHING if value is None else _time(value).strftime("%Y-%m-%d")


def moment(value: datetime | str | None) -> str:
    """A date and time in UTC."""
    return NOTHING if value is None else _time(value).strftime("%Y-%m-%d %H:%M")


def seconds_between(start: datetime | None, end: datetime | None) -> str:
    """How long something took."""
    if start is None or end is None:
        return NOTHING
    took = (end - start).total_seconds()
    return f"{took:.1f} s" if took < 100 else f"{took / 60:.1f} min"


def size(value: int) -> str:
    """Bytes in the largest unit that leaves a whole digit."""
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            return f"{value:.3g} {unit}"
        value /= 1000  # type: ignore[assignment]
    return f"{value:.3g} GB"


_CALLED = {
    "frfs": "FRFs",
    "rayleigh": "Rayleigh",
    "caughey3": "Caughey 3",
    "caughey4": "Caughey 4",
    "laplace": "Laplace",
    "mcmc": "MCMC",
}
_NAMES = re.compile(rf"\b({'|'.join(_CALLED)})\b")


def words(name: str) -> str:
    """A name of the contract as words.

    >>> words("with_care"), words("more_frfs")
    ('with care', 'more FRFs')
    """
    return _NAMES.sub(lambda m: _CALLED[m[1]], name.replace("_", " "))


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """What a document states, a line each, in the units of a laboratory."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{name} {key}".strip())
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for k, inner in enumerate(value, start=1):
            yield from leaves(inner, f"{name} {k}")
    else:
        yield _in_words(name, value)


def _in_words(name: str, value: Any) -> tuple[str, str]:
    """A member and its value with the unit that its name ends in.

    >>> _in_words("structure geometry length_m", 0.5), _in_words("recipe band_hz", [10.0, 900.0])
    (('structure geometry length', '500.0 mm'), ('recipe band', '10, 900 Hz'))
    """
    ending, unit = next(
        ((end, unit) for end, unit in UNITS_OF_MEMBERS.items() if name.endswith(end)), ("", "")
    )
    parts = value if isinstance(value, list) else [value]
    text = ", ".join(_in_digits(each, unit) for each in parts)
    counts = any(isinstance(each, int | float) and not isinstance(each, bool) for each in parts)
    return words(name.removesuffix(ending) if counts else name), (
        f"{text} {unit_of(unit)}".strip() if counts else text
    )


def _in_digits(value: Any, unit: str) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return in_unit(value, unit) if unit in ("m", "Pa") else f"{value:.6g}"


def mean(values: Sequence[float | None] | float | None) -> float | None:
    """The mean of those that are there; of a mean itself."""
    if not isinstance(values, Sequence):
        return values
    there = [value for value in values if value is not None]
    return sum(there) / len(there) if there else None


def named(rows: Iterable[Any], name: str) -> Any:
    """The row of that name, an object or a mapping; None where there is none."""
    return next(
        (row for row in rows if (row["name"] if isinstance(row, Mapping) else row.name) == name),
        None,
    )


def details(value: Mapping[str, Any]) -> str:
    """Members of a flat object in one line."""
    return ", ".join(
        f"{words(key)} {item}" for key, item in value.items() if item not in (None, "", {}, [])
    )


def _time(value: datetime | str) -> datetime:
    return datetime.fromisoformat(value) if isinstance(value, str) else value


FILTERS: dict[str, Callable[..., Any]] = {
    "counted": counted,
    "number": number,
    "unit_of": unit_of,
    "in_unit": in_unit,
    "watched": watched,
    "unit_watched": unit_watched,
    "covariate": named_covariate,
    "spread": spread,
    "in_laboratory_units": in_laboratory_units,
    "percent": percent,
    "day": day,
    "moment": moment,
    "seconds_between": seconds_between,
    "size": size,
    "words": words,
    "mean": mean,
    "motion": motion_words,
    "details": details,
    "named": named,
}
"""What templates call by name."""
