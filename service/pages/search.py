"""The page of searches: one box, facets, columns to choose, what was found with units and digits,
files, saved searches.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import Query, Request
from fastapi.responses import HTMLResponse

from service.nouns.search.fields import Field, Noun
from service.nouns.search.nouns import NOUNS, SEARCHED, lineage
from service.nouns.search.operations import MOST_COUNTED, Column, Search, SearchQuery, bounded
from service.nouns.search.routes import as_text
from service.nouns.search.saved import list_saved
from service.nouns.search.trends import COVARIATES, FOLLOWED, MODE_VALUES, trend_of
from service.nouns.updates.result_schemas import CONSTANTS
from service.pages.look import Visit
from service.pages.numbers import NOTHING, in_unit, moment, spread, unit_of, words
from service.platform.access import CurrentUser, SessionDep
from service.platform.access import routes as access
from service.platform.errors import Invalid
from service.platform.web.routing import UI, page_router

router = page_router(UI)
ROWS = 50
FILTER = re.compile(r"[=<>(]|\b(?:LIKE|BETWEEN|IN|IS|AND|OR|NOT)\b", re.IGNORECASE)
"""What a filter has and words have not."""

FOLLOWED_HINTS = {"results": list(CONSTANTS), "modes": list(MODE_VALUES)}
"""Values that are offered to follow over time, by what is searched; of results any other constant
can be named.
"""

PAGES = {
    "structure.id": "structures",
    "campaign.id": "campaigns",
    "result.id": "update-jobs",
    "batch.id": "coupon-batches",
    "monitor.id": "monitors",
    "project.id": "projects",
}
"""Fields that name something which has a page, and where that is."""


@dataclass(frozen=True)
class Head:
    """A column of the table: name, heading, unit, whether it has numbers, and the address that
    sorts by it.
    """

    name: str
    words: str
    unit: str
    numeric: bool
    sort: str
    sorted: str


@dataclass(frozen=True)
class SearchForm:
    """What the address of the page says."""

    noun: str  # what is searched
    text: str  # of the box, a filter or words
    sort: str  # field, `-` in front for descending
    fields: tuple[str, ...]  # columns; the noun's own where there are none
    trend: str = ""  # value that is followed over time; none where it is empty

    def query(self) -> dict[str, str]:
        """Parameters of `GET /search/{noun}`."""
        words_or_filter = {"filter" if FILTER.search(self.text) else "q": self.text.strip()}
        return {
            k: v
            for k, v in (
                words_or_filter | {"sort": self.sort, "fields": ",".join(self.fields)}
            ).items()
            if v
        }

    def address(self, **changed: Any) -> str:
        """The page's query with some of it changed."""
        values = {
            "noun": self.noun,
            "for": self.text,
            "sort": self.sort,
            "fields": self.fields,
            "trend": self.trend,
        } | changed
        return "?" + urlencode({name: value for name, value in values.items() if value}, doseq=True)


@router.get("/search")
def get_search(
    request: Request,
    session: SessionDep,
    user: CurrentUser,
    noun: Annotated[str, Query(max_length=20)] = "campaigns",
    text: Annotated[str, Query(alias="for", max_length=2000)] = "",
    sort: Annotated[str, Query(max_length=100)] = "",
    fields: Annotated[list[str] | None, Query(max_length=100)] = None,
    cursor: Annotated[str | None, Query(max_length=4000)] = None,
    trend: Annotated[str, Query(max_length=100)] = "",
) -> HTMLResponse:
    """What a filter or words find, over all projects of the visitor; the address has the whole
    search.
    """
    if noun not in SEARCHED:
        raise Invalid("noun", f"expected one of {', '.join(SEARCHED)}")
    visit, form = (
        Visit(request, session, user),
        SearchForm(noun, text, sort, tuple(fields or ()), trend.strip()),
    )
    results: dict[str, Any] = {}
    faults = dict.fromkeys(_PLACES.values(), "")
    try:
        results = _results(visit, form, cursor)
        results["trend"] = None  # it is drawn where the search itself can be read
        results["trend"] = _trend(visit, form)
    except Invalid as error:
        for fault in error.faults:
            faults[_PLACES.get(fault.pointer, "filter")] = fault.detail
    projects = access.list_projects(session, user, limit=200).items
    shown = visit.show(
        "find.html",
        search=form,
        nouns=list(SEARCHED),
        followed=FOLLOWED_HINTS.get(noun),
        columns=_choice(SEARCHED[noun], form),
        hints=[_hint(one, field, SEARCHED[noun]) for one in NOUNS.values() for field in one.fields],
        saved=[
            (kept, _address_of(kept.noun, kept.query))
            for kept in list_saved(session, user, None, 200).items
        ],
        projects=[project for project in projects if project.archived_at is None],
        faults=faults,
        **{"trend": None, **results},
    )
    shown.status_code = 422 if any(faults.values()) else 200
    return shown


_PLACES = {
    "filter": "filter",
    "sort": "sort",
    "fields": "fields",
    "cursor": "cursor",
    "value": "trend",
}
"""Parameters of the search, and the part of the page beside which what is wrong with them stands;
any other is the box.
"""


def _results(visit: Visit, form: SearchForm, cursor: str | None) -> dict[str, Any]:
    """Rows, counts and facets of a search.

    Raises:
        Invalid: it cannot be read, or takes too long.
    """
    noun, query = SEARCHED[form.noun], form.query()
    names = form.fields or tuple(
        name for name in noun.shown if not name.endswith(("id", "_low", "_high"))
    )
    beside = [*_links(noun), *_deviations(noun, names)]
    fields = tuple(dict.fromkeys([*names, *beside]))
    facets = (*noun.facets, *(["tag"] if any(field.name == "tag" for field in noun.fields) else []))
    search = Search(
        visit.user,
        noun,
        SearchQuery(query.get("filter"), query.get("q"), form.sort, fields, facets),
    )
    with bounded(visit.session):
        rows, following = search.page(visit.session, cursor, ROWS)
        count, counted = search.counts(visit.session)
    shown = [
        column
        for column in search.columns
        if column.name in {_shown_as(noun, name) for name in names}
    ]
    values = [
        dict(zip((column.name for column in search.columns), row, strict=True)) for row in rows
    ]
    shown = [one for one in shown if form.fields or not _is_empty(one, values)]
    return {
        "heads": [_head(column, form) for column in shown],
        "rows": [[_cell(noun, column, row) for column in shown] for row in values],
        "links": [_link(noun, row) for row in values],
        "count": f"{MOST_COUNTED:,}+" if count > MOST_COUNTED else f"{count:,}",
        "facets": {
            name: list(_narrower(form, name, times))
            for name, times in counted.items()
            if len(times) > 1
        },
        "following": form.address(cursor=following) if following else None,
        "query": urlencode(query),
        "ordered": urlencode({name: value for name, value in query.items() if name != "fields"}),
        "saving": query,
    }


def _trend(visit: Visit, form: SearchForm) -> dict[str, Any] | None:
    """What the page says of the chosen value over time; None where results or modes are not
    searched, or none is chosen.

    Raises:
        Invalid: the value is none that can be followed.
    """
    if form.noun not in FOLLOWED or not form.trend:
        return None
    query = form.query()
    conditions = SearchQuery(query.get("filter"), query.get("q"))
    with bounded(visit.session):
        trend = trend_of(
            visit.session, visit.user, form.noun, conditions, form.trend, COVARIATES[:1]
        )
    address = urlencode(
        {**{k: v for k, v in query.items() if k in ("filter", "q")}, "value": form.trend}
    )
    notes = [*trend.notes, *(note for one in trend.series for note in one.notes)]
    return {"query": address, "series": trend.series, "notes": list(dict.fromkeys(notes))}


def _is_empty(column: Column, rows: Sequence[Mapping[str, Any]]) -> bool:
    """Whether no row has a constant that results may have."""
    return bool(column.field.sd) and bool(rows) and all(row[column.name] is None for row in rows)


def _shown_as(noun: Noun, name: str) -> str:
    return name.removeprefix(f"{noun.name}.")


def _links(noun: Noun) -> list[str]:
    """Fields that name what has a page, the nearest first."""
    return [name for one in lineage(noun) if (name := f"{one.name}.id") in PAGES]


def _deviations(noun: Noun, names: Sequence[str]) -> Iterator[str]:
    """The standard deviation of each field that has one, and the ends of its interval."""
    known, shown = {field.name for field in noun.fields}, {_shown_as(noun, name) for name in names}
    for field in noun.fields:
        if field.sd and field.name in shown:
            yield from (field.sd, *({f"{field.name}_low", f"{field.name}_high"} & known))


def _link(noun: Noun, row: Mapping[str, Any]) -> str:
    name = _links(noun)[0]
    return f"ui/{PAGES[name]}/{row[_shown_as(noun, name)]}"


def _head(column: Column, form: SearchForm) -> Head:
    name, field = column.name, column.field
    now = form.sort.removeprefix("-") == name and (
        (form.sort.startswith("-") and "descending") or "ascending"
    )
    following = f"-{name}" if now == "ascending" else name
    sort = "" if field.kind in ("tags", "json") else form.address(sort=following)
    return Head(
        name,
        _heading(name),
        unit_of(field.unit),
        field.kind in ("number", "whole"),
        sort,
        now or "none",
    )


def _heading(name: str) -> str:
    """A field's name as words: `campaign.temperature_c` is "campaign temperature"."""
    return re.sub(r"_(hz|c|percent|Pa)$", "", name).replace(".", " ").replace("_", " ")


def _cell(noun: Noun, column: Column, row: Mapping[str, Any]) -> tuple[str, str]:
    """A value as a laboratory writes it, and how far it may be off where that is known."""
    value, field = row[column.name], column.field
    if value is None or value == [] or value == {}:
        return NOTHING, ""
    if isinstance(value, datetime):
        return moment(value), ""
    if field.kind == "number":
        sd = row.get(field.sd) if any(one is field for one in noun.fields) else None
        if sd:
            ends = [row.get(f"{field.name}_{end}") for end in ("low", "high")]
            known = {
                "unit": field.unit,
                "estimate": value,
                "standard_deviation": sd,
                "interval_95": ends,
            }
            return in_unit(value, field.unit, sd), spread(known)
        return _without_zeros(in_unit(value, field.unit)), ""
    if isinstance(value, bool):
        return "yes" if value else "no", ""
    return (
        words(value) if field.name in ("verdict", "boundary", "state") else str(as_text(value))
    ), ""


def _without_zeros(text: str) -> str:
    """A number that nobody said how well is known: what was typed."""
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def _narrower(
    form: SearchForm, name: str, times: Mapping[str, int]
) -> Iterator[tuple[str, int, str]]:
    """Values of a facet, how often each is there, and the address that finds these alone."""
    for value, count in times.items():
        condition = (
            f"{name} IS NULL"
            if value == ""
            else f"{name} = '{value.replace(chr(39), chr(39) * 2)}'"
        )
        before = form.query().get("filter")
        text = (
            f"({before}) AND {condition}"
            if before and re.search(r"\bOR\b", before, re.IGNORECASE)
            else (f"{before} AND {condition}" if before else condition)
        )
        yield words(value) or "not known", count, form.address(**{"for": text})


def _choice(noun: Noun, form: SearchForm) -> list[tuple[str, bool]]:
    """All columns of a noun and of what it belongs to, and whether each is chosen."""
    names = [
        field.name if one is noun else f"{one.name}.{field.name}"
        for one in lineage(noun)
        for field in one.fields
    ]
    members = [name for name in form.fields if name not in names]
    chosen = form.fields or noun.shown
    return [(name, name in chosen) for name in [*names, *members] if name != "meta"]


def _hint(one: Noun, field: Field, here: Noun) -> dict[str, str]:
    """What the box suggests of a field."""
    name = field.name if one is here else f"{one.name}.{field.name}"
    return {
        "name": name,
        "kind": field.kind,
        "means": field.meaning + (f", {field.unit}" if field.unit else ""),
    }


def _address_of(noun: str, query: Mapping[str, str]) -> str:
    fields = tuple(name for name in query.get("fields", "").split(",") if name)
    return SearchForm(
        noun, query.get("filter") or query.get("q", ""), query.get("sort", ""), fields
    ).address()
