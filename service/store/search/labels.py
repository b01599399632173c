"""Conditions on tags and on free metadata. An index has the rows that have any; a condition that is not negated asks it.

A thing has any number of tags, and `tag = 'winter'` is true where one of them is. A value of the metadata has the type that it
is compared as, or it is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from sqlalchemy import (
    Boolean,
    ColumnElement,
    Double,
    FromClause,
    Text,
    and_,
    case,
    cast,
    exists,
    func,
    literal,
    not_,
    select,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB

from service.errors import Invalid
from service.store.search import literals
from service.store.search.fields import Field, Kind

_TYPES: dict[str, tuple[Kind, Any]] = {
    "string": ("text", Text),
    "number": ("number", Double),
    "boolean": ("truth", Boolean),
}
"""By the name of a JSON type: the kind of a field of such values, and their type in SQL."""


def has_tag(name: str, op: str, tags: ColumnElement[Any], values: Sequence[Any]) -> ColumnElement[bool]:
    """A condition on tags: `=`, `<>`, `LIKE` with a text, `IS NULL`.

    Raises:
        Invalid: it is another one.
    """
    if op == "isnull":
        return tags == text("'{}'")
    if op not in ("=", "<>", "like") or not isinstance(values[0], str):
        raise Invalid("filter", f"{name} takes =, <>, IN or LIKE, and a text in single quotes")
    some = tags != text("'{}'")
    if op == "like":
        tag = func.unnest(tags).table_valued("tag").render_derived()
        alike = literals.matching(Field("tag", "text", ""), name, tag.c.tag, values[0])
        return and_(some, exists(select(1).select_from(tag).where(alike)))
    held = and_(some, tags.contains([values[0]]))
    return not_(held) if op == "<>" else held


def as_compared(field: Field, values: Sequence[Any]) -> Field:
    """A field of the metadata as one of the type of the values that it is compared with.

    Raises:
        Invalid: they are none that JSON has.
    """
    value = values[0][0] if values and isinstance(values[0], list) and values[0] else values[0] if values else ""
    names = {str: "string", int: "number", float: "number", bool: "boolean"}
    if type(value) not in names:
        raise Invalid("filter", f"{field.name} takes a text in single quotes, a number, TRUE or FALSE")
    json_type = names[type(value)]
    kind, sql = _TYPES[json_type]

    def typed(table: FromClause) -> ColumnElement[Any]:
        found = field.of(table)
        known = None if not values else func.jsonb_typeof(found) == json_type
        shown = found.op("#>>")(text("'{}'"))
        return shown if known is None else case((known, cast(shown, sql)), else_=None)

    return replace(field, kind=kind, value=typed)


def has_member(meta: ColumnElement[Any], path: Sequence[str], op: str, value: Any) -> ColumnElement[bool]:
    """That metadata has a member, which is what an index of it can say: of `=` with its value, unless that is a number, of
    which JSON keeps all digits.
    """
    some = [meta != text("'{}'"), meta.has_key(path[0])]
    if op == "=" and isinstance(value, str | bool):
        document: Any = value
        for name in reversed(path):
            document = {name: document}
        some.append(meta.contains(literal(document, JSONB)))
    return and_(*some)
