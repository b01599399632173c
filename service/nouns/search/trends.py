"""What a search found over time and temperature: a constant of results, or the modes of mode sets
tracked over campaigns.

Each structure has series of its own. A line is laid through each, with and without the covariates
(`fecore.trend.line`).
"""

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from itertools import groupby, islice
from typing import Any, Literal
from uuid import UUID

import numpy as np
from pydantic import ConfigDict, Field
from pydantic_core import PydanticCustomError
from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.normal import Z_95
from fecore.trend import Series, TrackedMode, line, track
from fecore.trend.change import TIME_UNITS, time_unit
from fecore.trend.series import days_since
from service.nouns.campaigns.climate import CLIMATE, Climate, covariate
from service.nouns.modes.operations import modes_of, shape_of
from service.nouns.search.nouns import NOUNS
from service.nouns.search.operations import Search, SearchQuery
from service.nouns.updates.operations import result_parts
from service.platform.access import User
from service.platform.errors import Invalid
from service.platform.web import StrictModel, shown_as

MOST_ROWS, MOST_MODES, MOST_SERIES = 2000, 10_000, 200
"""Results, or modes, of which a trend is made, and its series."""
COVARIATES = tuple(CLIMATE)
Trending = Literal["results", "modes"]
FOLLOWED: dict[Trending, str] = {"results": "Ex", "modes": "frequency_hz"}
"""What is followed where nobody says."""
MODE_VALUES = {"frequency_hz": ("Hz", "frequency_sd_hz"), "damping_ratio": ("1", "damping_sd")}
"""What a mode has over time: its unit, and the field of its standard deviation."""


class _TrendPlace(StrictModel):
    id: UUID = Field(description="of the update job, or of the mode set")
    campaign_id: UUID
    campaign_name: str
    performed_at: datetime


class TrendPoint(Climate, _TrendPlace):
    """One campaign of a series."""

    model_config = ConfigDict(json_schema_serialization_defaults_required=True)

    covariates: dict[str, float | None] = Field(
        {},
        description="others than the climate that were asked for; null: the campaign states none",
    )

    number: int | None = Field(description="of the mode in its set; null of a constant")
    value: float = Field(
        description=(
            "SI; of a constant with every input held at what was stated, so that campaigns compare"
        )
    )
    standard_deviation: float | None = Field(description="of the value; null where nobody says")
    interval_95: tuple[float, float] | None = Field(
        description="all that is not known; null where nobody says"
    )


class TrendLine(StrictModel):
    """A straight line through a series."""

    covariates: list[str] = Field(description="fitted together with the line; none: time alone")
    campaigns: int = Field(description="how many have them all")
    per_year: float = Field(description="change of the value a year")
    interval_95: tuple[float, float] = Field(description="of the change a year")
    relative_per_year: float = Field(description="the same as a share of the mean")
    relative_interval_95: tuple[float, float]
    effects: dict[str, tuple[float, float]] = Field(
        description="change by one unit of each covariate, and its sd"
    )
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
    time_unit: Literal["hour", "day", "year"] = Field(
        description="that suits the time between the first and the last point"
    )
    time_unit_years: float = Field(
        description="how long it is in years: times a change a year, the change in it"
    )
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


Row = dict[str, Any]
PLACE = ("campaign_id", "campaign_name", "performed_at", *COVARIATES)
"""Members of a point that say where its value is from."""
_FIELDS = (
    *("structure.id", "structure.name", "campaign.id", "campaign.name"),
    *(f"campaign.{name}" for name in PLACE[2:]),
)


def trend_of(
    session: Session,
    user: User,
    noun: Trending,
    query: SearchQuery,
    value: str,
    covariates: Sequence[str] = COVARIATES[:1],
) -> TrendOut:
    """A constant of results, such as `Ex` or `flange.E1`, or the frequency or damping of modes, of
    whatever a search finds; beside conditions and any covariates that campaigns state.

    Each campaign counts once, with its newest result or mode set that is found. Modes are tracked
    by MAC and frequency.

    Raises:
        Invalid: nothing that is found has such a value, there is too much, or a covariate is none.
    """
    named = [name for name in covariates if name not in COVARIATES]
    for name in named:
        try:
            covariate(name)
        except PydanticCustomError as error:
            raise Invalid("covariates", error.message()) from None
    unit, left_out, points = (_constants if noun == "results" else _modes)(
        session, user, query, value, {name: f"campaign.covariates.{name}" for name in named}
    )
    groups: dict[tuple[UUID, str], list[Row]] = {}
    for row in sorted(
        (row for row in points if row["performed_at"] is not None),
        key=lambda row: row["performed_at"],
    ):
        groups.setdefault((row["structure_id"], row["series"]), []).append(row)
    if len(groups) > MOST_SERIES:
        raise Invalid(
            "filter", f"makes {len(groups)} series, at most {MOST_SERIES} are followed; narrow it"
        )
    undated = sum(row["performed_at"] is None for row in points)
    notes = [
        f"{count} left out, {why}"
        for why, count in {"as the campaign has no date": undated, **left_out}.items()
        if count
    ]
    series = [_series(rows, covariates) for rows in groups.values()]
    return TrendOut.model_construct(value=value, unit=unit, series=series, notes=notes)


def _constants(
    session: Session, user: User, query: SearchQuery, value: str, named: Mapping[str, str]
) -> tuple[str | None, dict[str, int], list[Row]]:
    """Unit of a constant, how many results are left out by why, and a row for each that has it."""
    rows = _rows(session, user, "result", query, {"id": "id", **named}, MOST_ROWS)
    newest = {row["campaign_id"]: row for row in rows}
    documents = result_parts(session, [row["id"] for row in newest.values()], ("parameters",))
    constants = {
        key: {one["name"]: one for one in parts["parameters"]} for key, parts in documents.items()
    }
    names = sorted({name for known in constants.values() for name in known})
    if names and value not in names:
        raise Invalid(
            "value",
            f"no result that was found has {value[:60]!r}; there is {', '.join(names[:40])}",
        )
    unit, points = None, []
    for row in newest.values():
        if one := constants.get(row["id"], {}).get(value):
            own = one["comparable"] or {
                **one,
                "standard_deviation": one["noise_standard_deviation"],
            }
            unit, interval = one["unit"], tuple(one["interval_95"])
            points.append(
                {
                    **row,
                    "series": value,
                    "value": own["estimate"],
                    "sd": own["standard_deviation"],
                    "ends": interval,
                }
            )
    left_out = {
        _NEWER: len(rows) - len(newest),
        "as an earlier version stored it: run the update again": len(newest) - len(documents),
    }
    return unit, left_out, points


_NEWER = "as the campaign has a newer one that is found"


def _modes(
    session: Session, user: User, query: SearchQuery, value: str, named: Mapping[str, str]
) -> tuple[str, dict[str, int], list[Row]]:
    """Unit of a value of modes, how many mode sets are left out by why, and a row for each mode, with
    the name of its track.
    """
    if value not in MODE_VALUES:
        raise Invalid("value", f"is {value[:60]!r}, expected one of {', '.join(MODE_VALUES)}")
    unit, sd = MODE_VALUES[value]
    fields = {
        "id": "mode_set.id",
        "number": "number",
        "hz": "frequency_hz",
        "value": value,
        "sd": sd,
        **named,
    }
    rows = _rows(session, user, "mode", query, fields, MOST_MODES)
    newest = {row["campaign_id"]: row["id"] for row in rows}
    kept = [row for row in rows if newest[row["campaign_id"]] == row["id"] and row["hz"] > 0]
    _name_tracks(session, [row for row in kept if row["performed_at"] is not None])
    return (
        unit,
        {_NEWER: len({row["id"] for row in rows}) - len(newest)},
        [row for row in kept if row["value"] is not None],
    )


def _rows(
    session: Session,
    user: User,
    noun: str,
    query: SearchQuery,
    fields: Mapping[str, str],
    most: int,
) -> list[Row]:
    """What a search finds, in the order of ids: its structure, its place, and these fields by
    name.
    """
    search = Search(
        user,
        NOUNS[noun],
        SearchQuery(query.filter, query.words, None, (*_FIELDS, *fields.values())),
    )
    names = ("structure_id", "structure_name", *PLACE, *fields)
    rows = [dict(zip(names, row, strict=True)) for row in islice(search.rows(session), most + 1)]
    if len(rows) > most:
        raise Invalid(
            "filter", f"finds more than {most:,} {noun}s, too many for a trend; narrow it"
        )
    return rows


def _name_tracks(session: Session, rows: Sequence[Row]) -> None:
    """Give each mode the name of its track within its structure as `series`."""
    sets = modes_of(session, list({row["id"] for row in rows}))
    known = {
        (key, mode.number): TrackedMode(
            mode.frequency_hz,
            shape_of(mode),
            mode.frequency_sd_hz,
            damping_ratio=mode.damping_ratio,
        )
        for key, modes in sets.items()
        for mode in modes
    }
    ordered = sorted(
        rows, key=lambda row: (row["structure_id"], row["performed_at"], row["id"], row["number"])
    )
    for _, of_structure in groupby(ordered, key=lambda row: row["structure_id"]):
        campaigns = [list(group) for _, group in groupby(of_structure, key=lambda row: row["id"])]
        tracked = [[known[row["id"], row["number"]] for row in modes] for modes in campaigns]
        times = [modes[0]["performed_at"] for modes in campaigns]
        days = days_since(times[0], times).tolist()
        for modes, numbers in zip(campaigns, track(tracked, days), strict=True):
            for row, number in zip(modes, numbers, strict=True):
                row["series"] = f"mode {number + 1}"


def _series(rows: Sequence[Row], covariates: Sequence[str]) -> TrendSeries:
    """A series of rows in time order, with the line without covariates and the one with them, or
    why one is missing.
    """
    lines: list[TrendLine] = []
    notes: list[str] = []
    series = _as_series(rows, covariates)
    for names in dict.fromkeys([(), tuple(covariates)]):
        try:
            lines.append(_line(series, names))
        except InputError as error:
            notes.append(f"no line{' with ' + ' and '.join(names) if names else ''}: {error}")
    if any(not row["sd"] for row in rows):
        notes.append(
            "some standard deviations are not known: the scatter alone says how well the lines are"
            " known"
        )
    about = {name: rows[-1][name] for name in ("structure_id", "structure_name")}
    named = [name for name in covariates if name not in COVARIATES]
    points = [_point(row, named) for row in rows]
    unit = time_unit(float(series.days[-1]))
    return TrendSeries.model_construct(
        None,
        name=rows[0]["series"],
        points=points,
        time_unit=unit,
        time_unit_years=TIME_UNITS[unit],
        lines=lines,
        notes=notes,
        **about,
    )


def _point(row: Row, named: Sequence[str]) -> TrendPoint:
    value, sd = row["value"], row["sd"]
    ends = row.get("ends") or (None if sd is None else (value - Z_95 * sd, value + Z_95 * sd))
    place = {name: row[name] for name in ("id", *PLACE)}
    known = {
        "covariates": {name: row[name] for name in named},
        "number": row.get("number"),
        "value": value,
        "standard_deviation": sd,
        "interval_95": ends,
    }
    return TrendPoint.model_construct(None, **place, **known)


def _as_series(rows: Sequence[Row], covariates: Sequence[str]) -> Series:
    """What the core fits; where some standard deviations are not known all are taken as next to
    nothing.
    """
    values = np.array([row["value"] for row in rows])
    nothing = np.full(values.size, 1e-9 * np.abs(values).max() or 1e-9)
    sd = (
        np.array([row["sd"] for row in rows], dtype=float)
        if all(row["sd"] for row in rows)
        else nothing
    )
    measured = {name: np.array([row[name] for row in rows], dtype=float) for name in covariates}
    return Series("value", [row["performed_at"] for row in rows], values, sd, measured)


def _line(series: Series, names: Sequence[str]) -> TrendLine:
    fitted = line(series, names, float(series.estimate.mean()))
    corrected = [float(value) if np.isfinite(value) else None for value in fitted.corrected]
    own = {
        "covariates": list(names),
        "campaigns": fitted.used,
        "effects": fitted.effects,
        "ends": fitted.ends,
    }
    return shown_as(TrendLine, fitted.rate, corrected=corrected, **own)


POINT_COLUMNS = (
    *("structure", "series", "id", *PLACE),
    *("number", "value", "standard_deviation", "low", "high", "corrected"),
)
"""Columns of a table of points, before those of the covariates that were asked for by name."""


def columns_of(trend: TrendOut) -> tuple[str, ...]:
    """Columns of a trend's table of points."""
    points = [point for series in trend.series for point in series.points]
    return (*POINT_COLUMNS, *(points[0].covariates if points else ()))


def flat(trend: TrendOut) -> Iterator[tuple[Any, ...]]:
    """A row for each point, with these columns; `corrected` is of the line with covariates."""
    for series in trend.series:
        corrected = next(
            (one.corrected for one in series.lines if one.covariates), [None] * len(series.points)
        )
        for point, value in zip(series.points, corrected, strict=True):
            own = (getattr(point, name) for name in POINT_COLUMNS[2:-3])
            yield (
                series.structure_name,
                series.name,
                *own,
                *(point.interval_95 or (None, None)),
                value,
                *point.covariates.values(),
            )
