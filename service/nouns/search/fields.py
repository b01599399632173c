"""What a field and a noun of search are; a name of a filter to its field, or a message that names
the nearest ones.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Literal

from sqlalchemy import ColumnElement, FromClause, select

from service.platform.access import present
from service.platform.db.base import Base
from service.platform.errors import Invalid

Kind = Literal["text", "number", "whole", "time", "truth", "id", "tags", "json"]
META = "meta"
"""The field of free metadata, whose members are fields too: `meta.client`."""

OfPart = Callable[
    [FromClause, Mapping[str, FromClause], ColumnElement[bool]], ColumnElement[bool] | None
]


@dataclass(frozen=True)
class Field:
    """One field of a noun."""

    name: str  # in filters, after the noun and a point
    kind: Kind  # of its values
    meaning: str  # in words
    unit: str = ""  # of a number; empty where it has none
    column: str = ""  # of the noun's table, where it is not called like the field
    # from the noun's table, where it is no column
    value: Callable[[FromClause], ColumnElement[Any]] | None = None
    nullable: bool = False  # whether it may be unknown
    among: tuple[str, ...] = ()  # the values that a text can have, where they are few
    # name of the field of its standard deviation, which says how many of its digits mean something
    sd: str = ""
    via: str = ""  # noun of whose `column` a condition on it is; `value` is what is shown

    def of(self, table: FromClause) -> ColumnElement[Any]:
        """Its value in a row of the noun's table."""
        return self.value(table) if self.value else table.c[self.column or self.name]


@dataclass(frozen=True)
class Noun:
    """Rows of one table that can be searched."""

    name: str  # in filters
    table: str  # its name
    fields: tuple[Field, ...]  # all of them
    owner: str = ""  # noun that it belongs to; empty of a project
    # column that a row and its owner have alike, where the owner is not named by its id
    common: str = ""
    key: tuple[str, ...] = ("id",)  # columns that name a row
    # fields of an answer where none are asked for; those of owners with the noun in front
    shown: tuple[str, ...] = ()
    facets: tuple[str, ...] = ()  # fields whose values are counted
    hidden: bool = False  # whether a row may be deleted and kept
    # what a free search reads of a row, in SQL as an index has it; empty where nothing
    words: str = ""
    made: Callable[[], FromClause] | None = None  # makes the rows where they are in no table
    # a field of a name that is not among `fields`, where there can be any number; None of another
    # name
    more: Callable[[str], Field | None] | None = None
    # that a row of which something is asked concerns what is at hand below its owner, such as one
    # FRF of a campaign; None where nothing is
    of_part: OfPart | None = None

    def rows(self) -> FromClause:
        """Its table without what was made anew since, under a new name."""
        if self.made:
            return self.made()
        table = Base.metadata.tables[self.table]
        return (
            table.alias()
            if "superseded_by" not in table.c
            else select(table).where(*present(table.c)).subquery()
        )

    def owned_by(self, row: FromClause, owner: FromClause) -> ColumnElement[bool]:
        """That one row belongs to another."""
        if self.common:
            return row.c[self.common] == owner.c[self.common]
        return row.c[f"{self.owner}_id"] == owner.c.id


def find_field(
    nouns: Mapping[str, Noun], here: Noun, name: str, parameter: str
) -> tuple[Noun, Field]:
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
    if noun.more and (member := noun.more(after)):
        return noun, member
    known = {f"{noun.name}.{field.name}" for noun in nouns.values() for field in noun.fields}
    full_name = name if point else f"{here.name}.{name}"
    near = get_close_matches(full_name, sorted(known), 4, 0.5) or sorted(
        n for n in known if n.startswith(f"{here.name}.")
    )
    raise Invalid(parameter, f"there is no field {name[:100]!r}; the nearest are {', '.join(near)}")
