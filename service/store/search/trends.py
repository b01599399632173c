"""What a search found over time and temperature: a constant of results, or the modes of mode sets tracked over campaigns.

Each structure has series of its own. A line is laid through each, with and without the covariates (`fecore.trend.line`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from itertools import groupby, islice
from typing import Any, Literal, NamedTuple
from uuid import UUID

import numpy as np
from pydantic import Field
from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.trend import Series, TrackedMode, line, track
from service.access import User
from service.errors import Invalid
from service.store.modes.operations import modes_of, shape_of
from service.store.search.nouns import NOUNS
from service.store.search.operations import Search, Wanted
from service.store.updating.operations import result_parts
from service.web import StrictModel

MOST_ROWS = 5000
"""Results, or mode sets, of which a trend is made."""
MOST_MODES = 50_000
Z_95 = 1.959964
COVARIATES = ("temperature_c", "humidity_percent")
Trending = Literal["results", "modes"]
FOLLOWED: dict[Trending, str] = {"results": "Ex", "modes": "frequency_hz"}
"""What is followed where nobody says."""
MODE_VALUES = {"frequency_hz": ("Hz", "frequency_sd_hz"), "damping_ratio": ("1", "damping_sd")}
"""What a mode has over time: its unit, and the field of its standard deviation."""


class TrendPoint(StrictModel):
    """One campaign of a series."""

    id: UUID = Field(description="of the update job, or of the mode set")
    campaign_id: UUID
    campaign_name: str
    performed_at: datetime
    temperature_c: float | None
    humidity_percent: float | None
    number: int | None = Field(description="of the mode in its set; null of a constant")
    value: float = Field(
        description="SI; of a constant with every input held at what was stated, so that campaigns compare"
    )
    standard_deviation: float | None = Field(description="of the value; null where nobody says")
    interval_95: tuple[float, float] | None = Field(description="all that is not known; null where nobody says")


class TrendLine(StrictModel):
    """A straight line through a series."""

    covariates: list[str] = Field(description="fitted together with the line; none: time alone")
    campaigns: int = Field(description="how many have them all")
    per_year: float = Field(description="change of the value a year")
    interval_95: tuple[float, float] = Field(description="of the change a year")
    relative_per_year: float = Field(description="the same as a share of the mean")
    relative_interval_95: tuple[float, float]
    effects: dict[str, tuple[float, float]] = Field(description="change by one unit of each covariate, and its sd")
    ends: tuple[float, float] = Field(description="the line at the first and at the last campaign")
    corrected: list[float | None] = Field(
        description="value of each point at the covariates' means; null: one not known"
    )


class TrendSeries(StrictModel):
    """A constant, or a mode, of one structure over its campaigns."""

    structure_id: UUID
    structure_name: str
    name: str
    points: list[TrendPoint] = Field(description="in time order")
    lines: list[TrendLine] = Field(
        description="without covariates and with them; none where there are too few campaigns"
    )
    notes: list[str]


class TrendOut(StrictModel):
    """What a search found, over time."""

    value: str = Field(description="what is drawn")
    unit: str | None = Field(description="SI; null where the name says none")
    series: list[TrendSeries] = Field(description="by structure; of modes a series each")
    notes: list[str]


class _Place(NamedTuple):
    """Where a value was found; the names are those of `_FIELDS`."""

    structure_id: UUID
    structure_name: str
    campaign_id: UUID
    campaign_name: str
    performed_at: datetime | None
    temperature_c: float | None
    humidity_percent: float | None


_FIELDS = (
    "structure.id", "structure.name", "campaign.id", "campaign.name",
    "campaign.performed_at", "campaign.temperature_c", "campaign.humidity_percent",
)  # fmt: skip


def trend_of_results(
    session: Session, user: User, wanted: Wanted, value: str, covariates: Sequence[str] = COVARIATES[:1]
) -> TrendOut:
    """A constant of the newest result of each campaign among those that are found, such as `Ex` or `flange.E1`.

    Raises:
        Invalid: no result that is found has it, there are too many, or a covariate is none.
    """
    rows = _rows(session, user, "result", wanted, ("id",), MOST_ROWS)
    newest = {row[0].campaign_id: row for row in rows}
    found = result_parts(session, [key for _, key in newest.values()], ("parameters",))
    rows_by_name = {key: {row["name"]: row for row in parts["parameters"]} for key, parts in found.items()}
    names = sorted({name for constants in rows_by_name.values() for name in constants})
    if names and value not in names:
        raise Invalid("value", f"no result that was found has {value[:60]!r}; there is {', '.join(names[:40])}")
    having = [(place, key, rows_by_name[key][value]) for place, key in newest.values() if value in rows_by_name[key]]
    unit = next((row["unit"] for *_, row in having), None)
    points = [
        (place, value, _point(place, key, *_comparable(row), row["interval_95"]))
        for place, key, row in having
        if place.performed_at is not None
    ]
    notes = [*_undated(len(having) - len(points)), *_older(len(rows) - len(newest), "result")]
    return TrendOut(value=value, unit=unit, series=list(_series(points, covariates)), notes=notes)


def trend_of_modes(
    session: Session, user: User, wanted: Wanted, value: str, covariates: Sequence[str] = COVARIATES[:1]
) -> TrendOut:
    """Frequency or damping of the modes of each campaign's newest mode set that is found, tracked by MAC and frequency.

    Raises:
        Invalid: a mode has no such value, there are too many, or a covariate is none.
    """
    if value not in MODE_VALUES:
        raise Invalid("value", f"is {value[:60]!r}, expected one of {', '.join(MODE_VALUES)}")
    unit, sd = MODE_VALUES[value]
    rows = _rows(session, user, "mode", wanted, ("mode_set.id", "number", "frequency_hz", value, sd), MOST_MODES)
    newest = {row[0].campaign_id: row[1] for row in rows}
    if len(newest) > MOST_ROWS:
        raise Invalid(
            "filter", f"finds modes of more than {MOST_ROWS:,} campaigns, of which no trend is made; narrow it"
        )
    kept = [row for row in rows if newest[row[0].campaign_id] == row[1]]
    dated = [row for row in kept if row[0].performed_at is not None and row[3] > 0]
    points = [
        (place, f"mode {number + 1}", _point(place, key, found, sd, None, mode))
        for (place, key, mode, _, found, sd), number in _tracked(session, dated)
        if found is not None
    ]
    older = len({row[1] for row in rows}) - len(newest)
    notes = [*_undated(sum(row[0].performed_at is None for row in kept)), *_older(older, "mode set")]
    return TrendOut(value=value, unit=unit, series=list(_series(points, covariates)), notes=notes)


def trend_of(
    session: Session, user: User, noun: Trending, wanted: Wanted, value: str, covariates: Sequence[str]
) -> TrendOut:
    """The trend of whatever a search for results or modes finds; see `trend_of_results` and `trend_of_modes`."""
    if unknown := set(covariates) - set(COVARIATES):
        raise Invalid("covariates", f"{', '.join(sorted(unknown))[:100]} is none; there is {', '.join(COVARIATES)}")
    return (trend_of_results if noun == "results" else trend_of_modes)(session, user, wanted, value, covariates)


def _rows(
    session: Session, user: User, noun: str, wanted: Wanted, fields: Sequence[str], most: int
) -> list[tuple[Any, ...]]:
    """What a search finds, in the order of ids: a place, then the fields."""
    search = Search(user, NOUNS[noun], Wanted(wanted.filter, wanted.words, None, (*_FIELDS, *fields)))
    rows = list(islice(search.rows(session), most + 1))
    if len(rows) > most:
        raise Invalid("filter", f"finds more than {most:,} {noun}s, of which no trend is made; narrow it")
    width = len(_FIELDS)
    return [(_Place(*row[:width]), *row[width:]) for row in rows]


def _comparable(row: Mapping[str, Any]) -> tuple[float, float]:
    """Estimate and standard deviation of a constant as tests of one body are compared by."""
    found = row["comparable"] or {"estimate": row["estimate"], "standard_deviation": row["noise_standard_deviation"]}
    return found["estimate"], found["standard_deviation"]


def _undated(count: int) -> Iterator[str]:
    if count:
        yield f"{count} left out, whose campaigns have no date"


def _older(count: int, noun: str) -> Iterator[str]:
    if count:
        yield f"{count} {noun}{'s' if count > 1 else ''} left out, as the campaign has a newer one that was found too"


def _point(
    place: _Place,
    key: UUID,
    value: float,
    sd: float | None,
    interval: Sequence[float] | None,
    number: int | None = None,
) -> TrendPoint:
    ends = (
        (value - Z_95 * sd, value + Z_95 * sd) if interval is None and sd is not None else interval and tuple(interval)
    )
    where = {name: member for name, member in place._asdict().items() if name in TrendPoint.model_fields}
    return TrendPoint.model_construct(
        id=key, number=number, value=value, standard_deviation=sd, interval_95=ends, **where
    )


def _tracked(session: Session, rows: Sequence[tuple[Any, ...]]) -> Iterator[tuple[tuple[Any, ...], int]]:
    """Rows of modes, each with the number of its track within its structure, from 0."""
    shapes = {
        (key, mode.number): shape_of(mode)
        for key, modes in modes_of(session, list({row[1] for row in rows})).items()
        for mode in modes
    }
    ordered = sorted(rows, key=lambda row: (row[0].structure_id, row[0].performed_at, row[1], row[2]))
    for _, of_structure in groupby(ordered, key=lambda row: row[0].structure_id):
        campaigns = [list(group) for _, group in groupby(of_structure, key=lambda row: row[1])]
        numbers = track([[TrackedMode(row[3], shapes[row[1], row[2]]) for row in modes] for modes in campaigns])
        for modes, tracks in zip(campaigns, numbers, strict=True):
            yield from zip(modes, tracks, strict=True)


def _series(points: Iterable[tuple[_Place, str, TrendPoint]], covariates: Sequence[str]) -> Iterator[TrendSeries]:
    """Points by structure and by what they are of, in the order in which these were first found."""
    groups: dict[tuple[UUID, str], list[tuple[_Place, TrendPoint]]] = {}
    for place, name, point in points:
        groups.setdefault((place.structure_id, name), []).append((place, point))
    for (key, name), found in groups.items():
        ordered = sorted((point for _, point in found), key=lambda point: point.performed_at)
        lines, notes = _lines(ordered, covariates)
        yield TrendSeries.model_construct(
            structure_id=key,
            structure_name=found[-1][0].structure_name,
            name=name,
            points=ordered,
            lines=lines,
            notes=notes,
        )


def _lines(points: Sequence[TrendPoint], covariates: Sequence[str]) -> tuple[list[TrendLine], list[str]]:
    """The line without covariates and the one with them; and why one is missing."""
    lines: list[TrendLine] = []
    notes: list[str] = []
    series = _as_series(points)
    for names in dict.fromkeys([(), tuple(covariates)]):
        try:
            lines.append(_line(series, names))
        except InputError as error:
            notes.append(f"no line{' with ' + ' and '.join(names) if names else ''}: {error}")
    if any(point.standard_deviation is None for point in points):
        notes.append("some standard deviations are not known: the scatter alone says how well the lines are known")
    return lines, notes


def _as_series(points: Sequence[TrendPoint]) -> Series:
    values = np.array([point.value for point in points])
    known = all(point.standard_deviation for point in points)
    sd = (
        [point.standard_deviation for point in points]
        if known
        else np.full(values.size, 1e-9 * np.abs(values).max() or 1e-9)
    )
    measured = {name: np.array([getattr(point, name) for point in points], dtype=float) for name in COVARIATES}
    return Series("value", [point.performed_at for point in points], values, np.array(sd, dtype=float), measured)


def _line(series: Series, names: Sequence[str]) -> TrendLine:
    found = line(series, names, float(series.estimate.mean()))
    return TrendLine.model_construct(
        covariates=list(names),
        campaigns=found.used,
        per_year=found.rate.per_year,
        interval_95=found.rate.interval_95,
        relative_per_year=found.rate.relative_per_year,
        relative_interval_95=found.rate.relative_interval_95,
        effects=dict(found.effects),
        ends=found.ends,
        corrected=[float(value) if np.isfinite(value) else None for value in found.corrected],
    )


POINT_COLUMNS = (
    "structure",
    "series",
    *(name for name in TrendPoint.model_fields if name != "interval_95"),
    "low",
    "high",
    "corrected",
)
"""Columns of a table of points."""


def flat(trend: TrendOut) -> Iterator[Mapping[str, Any]]:
    """A row for each point, as a table has them; `corrected` is of the line with covariates."""
    for series in trend.series:
        corrected = next((one.corrected for one in series.lines if one.covariates), [None] * len(series.points))
        for point, value in zip(series.points, corrected, strict=True):
            low, high = point.interval_95 or (None, None)
            yield {
                "structure": series.structure_name,
                "series": series.name,
                **point.model_dump(exclude={"interval_95"}),
                "low": low,
                "high": high,
                "corrected": value,
            }
