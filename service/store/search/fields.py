"""What a field and a noun of search are; a name of a filter to its field, or a message that names the nearest ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Literal

from sqlalchemy import ColumnElement, FromClause

from service.db.base import Base
from service.errors import Invalid

Kind = Literal["text", "number", "whole", "time", "truth", "id", "tags", "json"]
META = "meta"
"""The field of free metadata, whose members are fields too: `meta.client`."""

OfPart = Callable[[FromClause, Mapping[str, FromClause], ColumnElement[bool]], ColumnElement[bool] | None]


@dataclass(frozen=True)
class Field:
    """One field of a noun.

    Attributes:
        name: in filters, after the noun and a point.
        kind: of its values.
        meaning: in words.
        unit: of a number; empty where it has none.
        column: of the noun's table, where it is not called like the field.
        value: from the noun's table to its value, where it is no column.
        nullable: whether it may be unknown.
        among: the values that a text can have, where they are few.
        sd: name of the field of its standard deviation, which says how many of its digits mean something.
        via: noun of whose `column` a condition on it is; `value` is what is shown.
    """

    name: str
    kind: Kind
    meaning: str
    unit: str = ""
    column: str = ""
    value: Callable[[FromClause], ColumnElement[Any]] | None = None
    nullable: bool = False
    among: tuple[str, ...] = ()
    sd: str = ""
    via: str = ""

    def of(self, table: FromClause) -> ColumnElement[Any]:
        """Its value in a row of the noun's table."""
        return self.value(table) if self.value else table.c[self.column or self.name]


@dataclass(frozen=True)
class Noun:
    """Rows of one table that can be searched.

    Attributes:
        name: in filters.
        table: its name.
        made: makes the rows where they are in no table.
        of_part: that a row of which something is asked concerns what is at hand below its owner, such as one FRF of a campaign;
            None where nothing is.
        more: a field of a name that is not among `fields`, where there can be any number; None of another name.
        owner: noun that it belongs to; empty of a project.
        common: column that a row and its owner have alike, where the owner is not named by its id.
        key: columns that name a row.
        fields: all of them.
        shown: fields of an answer where none are asked for; those of owners with the noun in front.
        facets: fields whose values are counted.
        hidden: whether a row may be deleted and kept.
        words: what a free search reads of a row, in SQL as an index has it; empty where nothing.
    """

    name: str
    table: str
    fields: tuple[Field, ...]
    owner: str = ""
    common: str = ""
    key: tuple[str, ...] = ("id",)
    shown: tuple[str, ...] = ()
    facets: tuple[str, ...] = ()
    hidden: bool = False
    words: str = ""
    made: Callable[[], FromClause] | None = None
    more: Callable[[str], Field | None] | None = None
    of_part: OfPart | None = None

    def rows(self) -> FromClause:
        """Its table, under a new name."""
        return self.made() if self.made else Base.metadata.tables[self.table].alias()

    def owned_by(self, row: FromClause, owner: FromClause) -> ColumnElement[bool]:
        """That one row belongs to another."""
        if self.common:
            return row.c[self.common] == owner.c[self.common]
        return row.c[f"{self.owner}_id"] == owner.c.id


def find_field(nouns: Mapping[str, Noun], here: Noun, name: str, parameter: str) -> tuple[Noun, Field]:
    """The noun and the field that a name means.

    Args:
        nouns: those that may be named.
        here: the noun whose fields need no noun in front.
        name: such as `campaign.temperature_c`.
        parameter: of the query, for the message.

    Raises:
        Invalid: there is no such field; names the nearest ones.
    """
    first, point, rest = name.partition(".")
    noun, after = (nouns[first], rest) if rest and first in nouns else (here, name)
    top, *path = after.split(".")
    for field in noun.fields:
        if field.name == after:
            return noun, field
        if field.name == top == META and all(path):
            value = lambda table, field=field: field.of(table)[tuple(path)]  # noqa: E731
            return noun, replace(field, name=after, value=value, nullable=True)
    if noun.more and (found := noun.more(after)):
        return noun, found
    known = {f"{noun.name}.{field.name}" for noun in nouns.values() for field in noun.fields}
    asked = name if point else f"{here.name}.{name}"
    near = get_close_matches(asked, sorted(known), 4, 0.5) or sorted(n for n in known if n.startswith(f"{here.name}."))
    raise Invalid(parameter, f"there is no field {name[:100]!r}; the nearest are {', '.join(near)}")
