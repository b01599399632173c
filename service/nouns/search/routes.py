"""Routes of search: rows of one noun over all projects of the user, found by a filter in CQL2 text
and by words, as JSON, CSV, Arrow and Parquet; and trends.
"""

import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import IO, Annotated, Any

import nanoarrow as na
import numpy as np
from fastapi import Depends, Query, Request, Response
from fastapi.responses import FileResponse
from nanoarrow.ipc import StreamWriter
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from modalbase.formats.arrays_out import ARRAY_WRITERS, as_parquet
from service.nouns.frfs.data import BY_FILTER
from service.nouns.frfs.operations import frfs_of
from service.nouns.frfs.routes import FILES, SpectraDep
from service.nouns.search.fields import Kind, Noun
from service.nouns.search.nouns import NOUNS, SEARCHED
from service.nouns.search.operations import (
    MOST_COUNTED,
    Column,
    Search,
    SearchQuery,
    bounded,
    names_in,
)
from service.nouns.search.translate import LONGEST
from service.nouns.search.trends import (
    COVARIATES,
    FOLLOWED,
    Trending,
    TrendOut,
    columns_of,
    flat,
    trend_of,
)
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Invalid, NotFound
from service.platform.web import Limit
from service.platform.web.downloads import spooled
from service.platform.web.parameters import form_of
from service.platform.web.routing import require_used

_TYPES: dict[Kind, Any] = {
    "text": na.string(),
    "id": na.string(),
    "number": na.float64(),
    "whole": na.int64(),
    "truth": na.bool_(),
    "time": na.timestamp("us", timezone="UTC"),
    "tags": na.string(),
    "json": na.string(),
}
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_TOGETHER = 1000  # rows of a record batch


def write_csv(columns: Sequence[Column], rows: Iterable[tuple[Any, ...]], file: IO[bytes]) -> None:
    """A header of names and a line for each row, numbers in the shortest form that is exact, times
    as ISO 8601.
    """
    text = io.TextIOWrapper(file, "utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(column.name for column in columns)
    writer.writerows([as_text(shown(value)) for value in row] for row in rows)
    text.detach()


def write_lines(
    columns: Sequence[Column], rows: Iterable[tuple[Any, ...]], file: IO[bytes]
) -> None:
    """A line of JSON for each row, with a member for each column."""
    names = [column.name for column in columns]
    for row in rows:
        item = dict(zip(names, map(shown, row), strict=True))
        file.write(json.dumps(item, ensure_ascii=False, allow_nan=False).encode() + b"\n")


def write_arrow(
    columns: Sequence[Column], rows: Iterable[tuple[Any, ...]], file: IO[bytes]
) -> None:
    """An Arrow IPC stream with a column for each field: text, float64, int64, bool, or microseconds
    UTC.
    """
    schema = na.struct({column.name: _TYPES[column.field.kind] for column in columns})
    with StreamWriter.from_writable(file) as writer:
        for batch in _batches(rows):
            children = [
                _array(column, [row[i] for row in batch]) for i, column in enumerate(columns)
            ]
            writer.write_array(
                na.c_array_from_buffers(schema, len(batch), [None], children=children)
            )


def write_parquet(
    columns: Sequence[Column], rows: Iterable[tuple[Any, ...]], file: IO[bytes]
) -> None:
    """Parquet with the columns of the Arrow stream."""
    as_parquet(lambda stream: write_arrow(columns, rows, stream), file)


def shown(value: Any) -> Any:
    """A value as JSON and CSV have it."""
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat().replace("+00:00", "Z")
    return (
        value
        if value is None or isinstance(value, bool | int | float | list | dict)
        else str(value)
    )


def as_text(value: Any) -> Any:
    """A value as a table has it: tags with commas between them, other lists and objects as JSON."""
    if isinstance(value, list) and all(isinstance(one, str) for one in value):
        return ", ".join(value)
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value


def _array(column: Column, values: list[Any]) -> Any:
    kind = column.field.kind
    if kind in ("id", "tags", "json"):
        values = [None if one is None else str(as_text(one)) for one in values]
    if kind != "time":
        return na.c_array(values, _TYPES[kind])
    since = np.array(
        [0 if one is None else (one - _EPOCH) // timedelta(microseconds=1) for one in values],
        np.int64,
    )
    known = np.array([one is not None for one in values], bool)
    buffers = [np.packbits(known, bitorder="little"), since]
    return na.c_array_from_buffers(
        _TYPES[kind], len(values), buffers, null_count=int((~known).sum())
    )


def _batches(rows: Iterable[tuple[Any, ...]]) -> Iterator[list[tuple[Any, ...]]]:
    """One at least, as a stream has its schema with the first."""
    row = iter(rows)
    yield list(islice(row, _TOGETHER))
    while batch := list(islice(row, _TOGETHER)):
        yield batch


router = api_router(tags=["search"])

MOST_ROWS = 100_000
"""Rows of a file."""

MEDIA_TYPES = {
    "json": "application/json",
    "jsonl": "application/x-ndjson",
    "csv": "text/csv",
    "arrow": "application/vnd.apache.arrow.stream",
    "parquet": ARRAY_WRITERS["parquet"].media_type,
}
MOST_SPECTRA = 20_000
"""FRFs of a file."""
WRITERS: dict[
    str, tuple[Callable[[Sequence[Column], Iterable[tuple[Any, ...]], IO[bytes]], None], str]
] = {
    "jsonl": (write_lines, "jsonl"),
    "csv": (write_csv, "csv"),
    "arrow": (write_arrow, "arrows"),
    "parquet": (write_parquet, "parquet"),
}


class Found(BaseModel):
    """A page of what a search found; counts stand on the first page."""

    items: list[dict[str, Any]] = Field(description="rows: a member for each column")
    next_cursor: str | None
    count: int | None = Field(
        description="rows in all; of more than 10,000, 10,000. null after the first page"
    )
    more: bool = Field(description="whether there are more rows than were counted")
    facets: dict[str, dict[str, int]] = Field(
        description="by field: its values and how many of the counted rows have each"
    )


def _filter(
    condition: Annotated[
        str | None,
        Query(
            alias="filter",
            description=f"CQL2 text, at most {LONGEST} characters: `campaign.temperature_c > 25`",
        ),
    ] = None,
    words: Annotated[
        str | None,
        Query(alias="q", max_length=200, description="words in names, notes and instruments"),
    ] = None,
) -> SearchQuery:
    if "\0" in (words or ""):
        raise Invalid("q", "has a NUL character")
    return SearchQuery(condition, words)


FilterDep = Annotated[SearchQuery, Depends(_filter)]
"""Which rows, of an answer that has an order and columns of its own."""


def _ordered(
    query: FilterDep,
    sort: Annotated[
        str | None, Query(max_length=100, description="a field; `-` in front for descending")
    ] = None,
) -> SearchQuery:
    return replace(query, sort=sort)


OrderedDep = Annotated[SearchQuery, Depends(_ordered)]
"""Which rows in which order, of an answer that has columns of its own."""


def _with_columns(
    query: OrderedDep,
    fields: Annotated[
        str | None, Query(max_length=LONGEST, description="columns, with commas between")
    ] = None,
    facets: Annotated[
        str | None,
        Query(
            max_length=LONGEST, description="fields whose values are counted, with commas between"
        ),
    ] = None,
) -> SearchQuery:
    return replace(query, fields=names_in(fields), facets=names_in(facets))


QueryDep = Annotated[SearchQuery, Depends(_with_columns)]
After = Annotated[
    str | None, Query(max_length=4000, description="`next_cursor` of the page before")
]
_OF_PAGES = {"cursor", "limit", "facets"}
Form = Annotated[
    str, form_of(MEDIA_TYPES, f"default: by Accept; files have all rows, at most {MOST_ROWS:,}")
]


def _add(address: str, noun: Noun) -> None:
    """Add the search for one noun."""

    def search(
        request: Request,
        form: Form,
        query: QueryDep,
        session: SessionDep,
        user: CurrentUser,
        cursor: After = None,
        limit: Limit = 100,
    ) -> Any:
        if form != "json":
            require_used(
                request,
                f"the {form} of a search",
                _OF_PAGES,
                "a file has all rows at once, and no counts",
            )
        matches = Search(user, noun, query)
        with bounded(session):
            return (
                _page(matches, session, cursor, limit)
                if form == "json"
                else _file(matches, session, form)
            )

    files: dict[str, Any] = {
        kind: {} for kind in MEDIA_TYPES.values() if kind != "application/json"
    }
    router.get(
        f"/search/{address}",
        name=f"search_{address}",
        description=_described(address, noun),
        response_model=Found,
        responses={200: {"content": files, "description": "What was found."}},
    )(search)


def _described(address: str, noun: Noun) -> str:
    title = "FRFs" if address == "frfs" else address.capitalize()
    names = ", ".join(f"`{field.name}`" for field in noun.fields)
    return (
        f"{title} of all projects that one may see, by a filter and by words, in any order, with"
        f" counts.\n\nFields: {names}; those of other nouns with the noun in front, such as"
        " `campaign.temperature_c`."
    )


for _address, _noun in SEARCHED.items():
    _add(_address, _noun)

Covariates = Annotated[
    str,
    Query(
        max_length=400,
        description=f"fitted beside time, with commas between: {', '.join(COVARIATES)}, or others"
        " that campaigns state, such as `wind_m_s`",
    ),
]
Value = Annotated[
    str | None,
    Query(max_length=100, description="what is followed; default: Ex, or frequency_hz of modes"),
]
TREND_TYPES = {name: MEDIA_TYPES[name] for name in ("json", "csv", "parquet")}
TrendForm = Annotated[
    str, form_of(TREND_TYPES, "default: by Accept; CSV and Parquet have the points")
]


POINTS: dict[int | str, dict[str, Any]] = {
    200: {"content": {TREND_TYPES[form]: {} for form in ("csv", "parquet")}}
}


def _trend(noun: Trending) -> Callable[..., TrendOut]:
    def trend(
        query: FilterDep,
        session: SessionDep,
        user: CurrentUser,
        value: Value = None,
        covariates: Covariates = COVARIATES[0],
    ) -> TrendOut:
        with bounded(session):
            return trend_of(
                session, user, noun, query, value or FOLLOWED[noun], names_in(covariates)
            )

    return trend


ResultTrend = Annotated[TrendOut, Depends(_trend("results"))]
"""The trend of a constant, as the query of a route asks for it."""
ModeTrend = Annotated[TrendOut, Depends(_trend("modes"))]
"""The same of modes."""


@router.get("/search/results/trend", response_model=TrendOut, responses=POINTS)
def get_result_trend(form: TrendForm, trend: ResultTrend) -> Any:
    """A constant of the results that a search finds, over time and temperature: a series for each
    structure, and lines.

    Each campaign counts once, with its newest result. A line has the change a year, with and
    without the covariates; scatter between campaigns is in its interval.
    """
    return _as(form, trend)


@router.get("/search/modes/trend", response_model=TrendOut, responses=POINTS)
def get_mode_trend(form: TrendForm, trend: ModeTrend) -> Any:
    """Frequency or damping of the modes that a search finds, over time and temperature: a series
    for each mode of a structure.

    Modes are followed from campaign to campaign by MAC and frequency; each campaign counts once,
    with its newest mode set.
    """
    return _as(form, trend)


def _as(form: str, trend: TrendOut) -> Any:
    if form == "json":
        return trend
    if form == "parquet":
        columns, names = zip(*flat(trend), strict=True), columns_of(trend)
        points = dict(zip(names, columns, strict=False)) or dict.fromkeys(names, ())
        return spooled(
            lambda file: ARRAY_WRITERS[form].write(points, file),
            TREND_TYPES[form],
            "trend.parquet",
            {"Vary": "Accept"},
        )
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(columns_of(trend))
    writer.writerows(map(shown, row) for row in flat(trend))
    headers = {"Vary": "Accept", "Content-Disposition": 'attachment; filename="trend.csv"'}
    return Response(text.getvalue(), media_type=TREND_TYPES["csv"], headers=headers)


@router.get("/search/frfs/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_found_data(
    query: FilterDep, session: SessionDep, user: CurrentUser, spectra: SpectraDep
) -> Response:
    """Spectra of all FRFs that a search finds, in the order of their ids, as one file.

    UFF takes FRFs of one campaign; the others need one axis and one quantity.
    """
    with bounded(session):
        keys = Search(user, NOUNS["frf"], query).keys(session, MOST_SPECTRA + 1)
    if not keys:
        raise NotFound("FRF that the search finds")
    if len(keys) > MOST_SPECTRA:
        raise Invalid(
            "filter",
            f"finds more than {MOST_SPECTRA:,} FRFs, the most that a file holds; narrow it",
        )
    return spectra.of(session, frfs_of(session, keys), BY_FILTER)


def _page(matches: Search, session: Session, cursor: str | None, limit: int) -> Found:
    rows, following = matches.page(session, cursor, limit)
    count, facets = matches.counts(session) if cursor is None else (None, {})
    names = [column.name for column in matches.columns]
    return Found(
        items=[dict(zip(names, map(shown, row), strict=True)) for row in rows],
        next_cursor=following,
        count=count if count is None else min(count, MOST_COUNTED),
        more=count is not None and count > MOST_COUNTED,
        facets=facets,
    )


def _file(matches: Search, session: Session, form: str) -> FileResponse:
    write, suffix = WRITERS[form]
    return spooled(
        lambda file: write(matches.columns, _few(matches.rows(session)), file),
        MEDIA_TYPES[form],
        f"found.{suffix}",
        {"Vary": "Accept"},
    )


def _few(rows: Iterable[tuple[Any, ...]]) -> Iterable[tuple[Any, ...]]:
    for number, row in enumerate(rows):
        if number == MOST_ROWS:
            raise Invalid(
                "filter",
                f"finds more than {MOST_ROWS:,} rows, the most that a file holds; narrow it",
            )
        yield row
