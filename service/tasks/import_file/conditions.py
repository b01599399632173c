"""What a recording states of the test itself: means of channels as covariates, and when it began.

    {"recording": {"performed_at": "file",            the first sample's time as the file has it; or
                                                      {"variable": "start_unix_s"}, s since 1970 in UTC
                   "covariates": {"wind_m_s": {"variable": "anemometer"},
                                  "temperature_deck_c": {"variable": "pt100", "sensitivity": 0.01,
                                                         "offset": -2.5}}}}

A covariate is the mean of its channel divided by `sensitivity`, plus `offset`. This module imports
no database and no web, since the child imports it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.recording import AnyRecording

_PLACE = "mapping.recording"
_BRACKET = re.compile(r"[\[(]([^\s\[\]()]{1,8})[\])]$")  # a unit at the end of a name
_FROM, _TO = 315_532_800.0, 32_503_680_000.0  # s since 1970: from 1980 to the year 3000


@dataclass(frozen=True)
class Covariate:
    """The mean of a channel of slow values."""

    variable: str
    mean: float  # as the covariate's name says its unit
    unit: str  # that the file states of the channel, where its mapping scales nothing; else empty
    samples: int
    left_out: int  # of the samples: NaN


@dataclass(frozen=True)
class Conditions:
    """What a recording states of its campaign."""

    covariates: dict[str, Covariate]
    performed_at: datetime | None


STATED = ("covariates", "performed_at")
"""Members of a mapping's `recording` that are read here."""


def read_conditions(file: AnyRecording, about: dict[str, Any]) -> Conditions:
    """The covariates and the time that the member `recording` of a mapping takes from a file.

    Raises:
        FormatError: a channel is not in the file, or what is stated is none of the forms above;
            names the field.
    """
    stated = about.get("covariates") or {}
    if not isinstance(stated, dict):
        raise FormatError(f"{_PLACE}.covariates", "is not an object of channels by name")
    channels = {name: _channel(file, name, each) for name, each in stated.items()}
    means = _means(file, sorted({channel["variable"] for channel in channels.values()}))
    covariates = {}
    for name, channel in channels.items():
        variable, scaled = channel["variable"], len(channel) > 1
        mean, samples, left_out = means[variable]
        value = mean / channel.get("sensitivity", 1.0) + channel.get("offset", 0.0)
        bracket = _BRACKET.search(variable)
        own = file.units.get(variable) or (bracket[1] if bracket else "")
        covariates[name] = Covariate(variable, value, "" if scaled else own, samples, left_out)
    return Conditions(covariates, _performed_at(file, about.get("performed_at")))


def _channel(file: AnyRecording, name: str, stated: Any) -> dict[str, Any]:
    place = f"{_PLACE}.covariates.{name}"
    expected = 'expected {"variable": name} with or without sensitivity and offset'
    if not isinstance(stated, dict) or not {"variable"} <= stated.keys() <= {
        "variable",
        "sensitivity",
        "offset",
    }:
        raise FormatError(place, f"is {stated!r}, {expected}")
    _require_there(file, f"{place}.variable", stated["variable"])
    for member in ("sensitivity", "offset"):
        value = stated.get(member, 1.0)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not np.isfinite(value) or (member == "sensitivity" and value == 0):
            raise FormatError(f"{place}.{member}", f"is {value!r}, expected a number, not 0")
    return stated


def _require_there(file: AnyRecording, place: str, name: Any) -> None:
    there = [*file.names, *file.numbers]
    if name not in there:
        raise FormatError(place, f"is {name!r}; the file has {', '.join(there)}")


def _means(file: AnyRecording, names: list[str]) -> dict[str, tuple[float, int, int]]:
    """Mean of the numbers of each channel, how many samples it has, and how many of them are NaN.

    Raises:
        FormatError: a channel has no number at all.
    """
    means = {}
    # columns of a table lie side by side and are read at once; other channels may differ in length
    for together in [names] if file.is_table and names else [[n] for n in names]:
        total, good, samples = np.zeros(len(together)), np.zeros(len(together), dtype=int), 0
        for part in _parts(file, together):
            finite = np.isfinite(part)
            total += np.where(finite, part, 0.0).sum(axis=1, dtype=float)
            good, samples = good + finite.sum(axis=1), samples + part.shape[1]
        for name, own, count in zip(together, total, good, strict=True):
            if not count:
                raise FormatError(name, "holds no number, and a covariate is its mean")
            means[name] = (float(own / count), samples, int(samples - count))
    return means


def _parts(file: AnyRecording, names: list[str]) -> Any:
    single = file.numbers
    return [np.reshape(single[names[0]], (1, 1))] if names[0] in single else file.chunks(names)


def _performed_at(file: AnyRecording, stated: Any) -> datetime | None:
    place = f"{_PLACE}.performed_at"
    if stated is None:
        return None
    if stated == "file":
        if file.began is None:
            raise FormatError(place, "is file, and the file does not state when it began")
        return datetime.fromtimestamp(file.began, UTC)
    if not isinstance(stated, dict) or stated.keys() != {"variable"}:
        raise FormatError(place, f'is {stated!r}, expected "file" or {{"variable": name}}')
    _require_there(file, f"{place}.variable", stated["variable"])
    first = float(next(iter(_parts(file, [stated["variable"]])))[0][0])
    if not _FROM < first < _TO:
        why = f"begins with {first:g}, which are no seconds since 1970"
        raise FormatError(f"{place}.variable", why)
    return datetime.fromtimestamp(first, UTC)
