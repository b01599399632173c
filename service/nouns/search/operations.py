"""What a search finds: a page of rows in any order, how many there are, and how often each value of
a facet.

A search is one read-only transaction with a limit of time. It sees rows of the projects that the
user is a member of, and whatever a filter names it reaches from such a row, within its project.
"""

import base64
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from psycopg.errors import QueryCanceled
from sqlalchemy import (
    CTE,
    ColumnElement,
    FromClause,
    Select,
    and_,
    func,
    literal,
    literal_column,
    or_,
    select,
    tuple_,
)
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from service.nouns.search import literals
from service.nouns.search.fields import Field, Noun, find_field
from service.nouns.search.nouns import lineage
from service.nouns.search.translate import Scope, condition
from service.platform.access import User, projects_of
from service.platform.errors import Invalid

SECONDS = 5
"""A search that takes longer is ended."""
MOST_COUNTED = 10_000
MOST_FACETS = 20
"""Values of a facet that are shown, the most frequent ones."""
MOST_FACETED = 8
"""Fields whose values are counted at a time."""
MOST_WORDS = 20


@dataclass(frozen=True)
class SearchQuery:
    """What is searched for."""

    filter: str | None = None  # CQL2 text
    # that names, notes or instruments have, of the row or of what it belongs to
    words: str | None = None
    # name of a field, `-` in front for descending; by the key where there is none
    sort: str | None = None
    fields: tuple[str, ...] = ()  # names of the columns; the noun's own choice where there are none
    facets: tuple[
        str, ...
    ] = ()  # names of the fields whose values are counted; the noun's own choice where there are none


@dataclass(frozen=True)
class Column:
    """A column of an answer: its name, the field that it shows, and its value in SQL."""

    name: str
    field: Field
    value: ColumnElement[Any]


class Search:
    """A search that was read: its query, and the columns that it shows.

    Attributes:
        columns: of the answer.
        facets: columns whose values are counted.
    """

    def __init__(self, user: User, noun: Noun, query: SearchQuery) -> None:
        """Read what a user searches among the rows of a noun.

        Raises:
            Invalid: the filter, the order or a column names what there is not.
        """
        self._noun, chain = noun, lineage(noun)
        self._scope: Scope = {one.name: one.rows() for one in chain}
        self.columns = [self._column(name, "fields") for name in query.fields or noun.shown]
        self._key = [self._scope[self._noun.name].c[name] for name in self._noun.key]
        self._descending = (query.sort or "").startswith("-")
        self._order = self._column(query.sort.removeprefix("-"), "sort") if query.sort else None
        self._order_by = [*([self._order.value] if self._order else []), *self._key]
        self.facets = [self._column(name, "facets") for name in query.facets or noun.facets]
        if len(self.facets) > MOST_FACETED:
            raise Invalid(
                "facets", f"names {len(self.facets)} fields, at most {MOST_FACETED} are counted"
            )
        self._from = self._joined(chain)
        self._where: list[ColumnElement[bool]] = [
            self._scope["project"].c.id.in_(projects_of(user))
        ]
        self._where += [self._scope[one.name].c.deleted_at.is_(None) for one in chain if one.hidden]
        if query.filter and query.filter.strip():
            self._where.append(condition(query.filter, self._noun, self._scope))
        words = (query.words or "").split()
        if len(words) > MOST_WORDS:
            raise Invalid("q", f"has {len(words)} words, at most {MOST_WORDS} are looked for")
        self._where += [self._has_word(chain, word) for word in words]

    def page(
        self, session: Session, cursor: str | None, limit: int
    ) -> tuple[list[tuple[Any, ...]], str | None]:
        """Rows as tuples of the columns' values, and the cursor of the next page.

        Raises:
            Invalid: the cursor is not one of this order.
        """
        rows = session.execute(self.page_query(cursor, limit)).all()
        width = len(self.columns)
        following = _encode(rows[limit - 1][width:]) if len(rows) > limit else None
        return [tuple(row[:width]) for row in rows[:limit]], following

    def page_query(self, cursor: str | None, limit: int) -> Select[Any]:
        """The query of a page's rows and of one more: the columns, then what orders them.

        The rows are found by their keys first, for which indexes often do; the columns are fetched
        of those alone.

        Raises:
            Invalid: the cursor is not one of this order.
        """
        direction = [value.desc() if self._descending else value.asc() for value in self._order_by]
        if self._order is not None and self._order.field.nullable:
            direction[0] = direction[0].nulls_last()
        keys = self._query(*self._key)
        if cursor is not None:
            keys = keys.where(self._after(cursor))
        on_page = tuple_(*self._key).in_(keys.order_by(*direction).limit(limit + 1).correlate(None))
        shown = (*(column.value for column in self.columns), *self._order_by)
        return select(*shown).select_from(self._from).where(on_page).order_by(*direction)

    def rows(self, session: Session) -> Iterator[tuple[Any, ...]]:
        """All of them, one page after the other, as `page` gives them."""
        cursor: str | None = None
        while True:
            batch, cursor = self.page(session, cursor, 1000)
            yield from batch
            if cursor is None:
                return

    def counts(self, session: Session) -> tuple[int, dict[str, dict[str, int]]]:
        """How many rows there are, and how often each value of each facet; of the first
        `MOST_COUNTED` + 1 rows.
        """
        some = self.some().cte()
        facets = {facet.name: dict[str, int]() for facet in self.facets}
        total = self._count_values(session, some, facets)
        for facet, value in zip(self.facets, some.c, strict=True):
            if facet.field.kind == "tags":
                tag, times = func.unnest(value).label("tag"), func.count()
                query = (
                    select(tag, times).group_by(tag).order_by(times.desc(), tag).limit(MOST_FACETS)
                )
                facets[facet.name] = dict(session.execute(query).all())
        return total, facets

    def _count_values(self, session: Session, some: CTE, facets: dict[str, dict[str, int]]) -> int:
        """Count the rows, and the values of facets of which a row has one, in one pass."""
        pairs = zip(self.facets, some.c, strict=True)
        single = {facet.name: value for facet, value in pairs if facet.field.kind != "tags"}
        # 1 where a row is not counted by it
        left_out = [func.grouping(value) for value in single.values()]
        times = func.count()
        rank = func.row_number().over(
            partition_by=left_out or None, order_by=(times.desc(), *single.values())
        )
        sets = func.grouping_sets(tuple_(), *map(tuple_, single.values()))
        counted = (
            select(*left_out, *single.values(), times, rank.label("rank"))
            .select_from(some)
            .group_by(sets)
            .subquery()
        )
        total, width = 0, len(single)
        for row in session.execute(select(counted).where(counted.c.rank <= MOST_FACETS)):
            by = [i for i in range(width) if row[i] == 0]
            total = total if by else row[-2]
            for i in by:
                facets[list(single)[i]][_facet(row[width + i])] = row[-2]
        return int(total)

    def some(self) -> Select[Any]:
        """The query of the facets' values in the rows that are counted."""
        return self._query(
            *(one.value.label(f"facet_{i}") for i, one in enumerate(self.facets))
        ).limit(MOST_COUNTED + 1)

    def keys(self, session: Session, most: int) -> list[Any]:
        """Ids of the rows, of so many at the most, in their order."""
        query = self._query(*self._key).order_by(*self._key).limit(most)
        return list(session.scalars(query))

    def _query(self, *values: ColumnElement[Any]) -> Select[Any]:
        return select(*values).select_from(self._from).where(*self._where)

    def _column(self, name: str, parameter: str) -> Column:
        within = {noun.name: noun for noun in lineage(self._noun)}
        noun, field = find_field(within, self._noun, name, parameter)
        shown = field.name if noun is self._noun else f"{noun.name}.{field.name}"
        if parameter == "sort" and field.kind in ("tags", "json"):
            raise Invalid("sort", f"{shown} has no order; sort by another field")
        return Column(shown, field, field.of(self._scope[noun.name]))

    def _joined(self, chain: Sequence[Noun]) -> FromClause:
        joined = self._scope[chain[0].name]
        for noun in chain[:-1]:
            owner = self._scope[noun.owner]
            joined = joined.join(owner, noun.owned_by(self._scope[noun.name], owner))
        return joined

    def _has_word(self, chain: Sequence[Noun], word: str) -> ColumnElement[bool]:
        """That the row, or what it belongs to, has a word; the index of each noun is asked by
        itself.
        """
        conditions: list[ColumnElement[bool]] = []
        for noun in chain:
            if noun.words:
                row = noun.rows()
                query = func.plainto_tsquery("simple", word)
                having = select(row.c.id).where(literal_column(noun.words).op("@@")(query))
                conditions.append(self._scope[noun.name].c.id.in_(having))
        return or_(*conditions)

    def _after(self, cursor: str) -> ColumnElement[bool]:
        """That a row comes after the last one of the page before."""
        values = _decode(cursor)
        if len(values) != len(self._order_by):
            raise _no_cursor()
        fields = [
            *([self._order.field] if self._order else []),
            *(_key_field(self._noun, name) for name in self._noun.key),
        ]
        bound = [
            None if value is None else _bound(field, value)
            for field, value in zip(fields, values, strict=True)
        ]
        if any(value is None for value in bound[1:]) or (
            bound[0] is None and not fields[0].nullable
        ):
            raise _no_cursor()
        keys, last = (
            tuple_(*self._order_by),
            tuple_(*(value for value in bound if value is not None)),
        )
        if self._order is None or not fields[0].nullable:
            return keys < last if self._descending else keys > last
        order, rest = self._order_by[0], tuple_(*self._order_by[1:])
        if bound[0] is None:
            return and_(order.is_(None), rest < last if self._descending else rest > last)
        return or_(order.is_(None), keys < last if self._descending else keys > last)


def names_in(text: str | None) -> tuple[str, ...]:
    """Names with commas between them, each once."""
    return tuple(dict.fromkeys(name.strip() for name in (text or "").split(",") if name.strip()))


@contextmanager
def bounded(session: Session, seconds: float = SECONDS) -> Iterator[None]:
    """A read-only transaction in which no statement takes longer.

    Raises:
        Invalid: one did.
    """
    connection = session.connection()
    milliseconds = int(1000 * seconds)
    # PostgreSQL's own cost of a page out of order is that of a disk with arms: it would read tables
    # whole that fit in memory.
    settings = f"SET LOCAL statement_timeout = {milliseconds}; SET LOCAL random_page_cost = 1.1"
    connection.exec_driver_sql(f"BEGIN READ ONLY; {settings}")
    try:
        yield
    except DBAPIError as error:
        if isinstance(error.orig, QueryCanceled):
            raise Invalid(
                "filter",
                f"takes longer than {seconds:g} s and was ended; narrow it, such as by a structure"
                " or a date",
            ) from None
        raise
    finally:
        connection.exec_driver_sql("ROLLBACK")


def _facet(value: Any) -> str:
    """A value as a filter has it, without quotes; empty where it is not known."""
    return "" if value is None else str(value).upper() if isinstance(value, bool) else str(value)


def _key_field(noun: Noun, name: str) -> Field:
    return next((field for field in noun.fields if field.name == name), Field(name, "id", ""))


def _bound(field: Field, value: Any) -> ColumnElement[Any]:
    try:
        if field.kind == "time":
            return literal(literals.span(field, field.name, value)[0])
        return literals.bound(field, field.name, value)
    except Invalid:
        raise _no_cursor() from None


def _encode(values: Sequence[Any]) -> str:
    text = json.dumps(
        list(values), default=lambda one: one.isoformat() if hasattr(one, "isoformat") else str(one)
    )
    return base64.urlsafe_b64encode(text.encode()).rstrip(b"=").decode()


def _decode(cursor: str) -> list[Any]:
    try:
        values = json.loads(base64.urlsafe_b64decode(cursor.encode() + b"==="))
        json.dumps(values, ensure_ascii=False).encode()  # a lone surrogate is no text
    except (ValueError, RecursionError):
        raise _no_cursor() from None
    if not isinstance(values, list):
        raise _no_cursor()
    return values


def _no_cursor() -> Invalid:
    return Invalid(
        "cursor", "is not a cursor of this search; take `next_cursor` of a page in the same order"
    )
