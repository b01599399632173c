"""Values in filters: what a field of a kind is compared with, checked, and the comparison in SQL.
And conditions on tags and on free metadata: an index has the rows that have any; a condition that
is not negated asks it.

A thing has any number of tags, and `tag = 'winter'` is true where one of them is. A value of the
metadata has the type that it is compared as, or it is not known.
"""

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from typing import Any
from uuid import UUID

from sqlalchemy import (
    BigInteger,
    Boolean,
    ColumnElement,
    DateTime,
    Double,
    FromClause,
    Text,
    Uuid,
    and_,
    case,
    cast,
    exists,
    func,
    literal,
    not_,
    or_,
    select,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB

from service.nouns.search.fields import Field, Kind
from service.platform.errors import Invalid

EXPECTED: dict[Kind, str] = {
    "text": "a text in single quotes",
    "number": "a number",
    "whole": "a whole number",
    "time": "DATE('2026-03-01') or TIMESTAMP('2026-03-01T12:00:00Z')",
    "truth": "TRUE or FALSE",
    "id": "an id in single quotes",
    "tags": "a text in single quotes",
    "json": "a value of JSON; name a member, such as meta.client",
}
"""How a value of each kind is written."""

COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "=": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}

Span = tuple[datetime, datetime]
"""First moment and the moment after the last; the same twice for one moment."""


def bound(field: Field, name: str, value: Any) -> ColumnElement[Any]:
    """A value for a field of any kind but time.

    Raises:
        Invalid: it is of another type; says the field and what it takes.
    """
    match field.kind, value:
        case "text", str():
            return literal(value, Text)
        case "truth", bool():
            return literal(value, Boolean)
        case (("number" | "whole"), bool()):
            pass
        case "number", int() | float() if math.isfinite(value):
            return literal(float(value), Double)
        case "whole", int() | float() if abs(value) < 2**63 and value == int(value):
            return literal(int(value), BigInteger)
        case "id", str():
            try:
                return literal(UUID(value), Uuid)
            except ValueError:
                raise _mismatch(field, name, value) from None
    raise _mismatch(field, name, value)


def compared(
    field: Field, name: str, op: str, column: ColumnElement[Any], value: Any
) -> ColumnElement[bool]:
    """A comparison of a field with a value.

    Raises:
        Invalid: the value is of another type, or one that the field never has.
    """
    if field.among and op in ("=", "<>") and isinstance(value, str) and value not in field.among:
        raise Invalid("filter", f"{name} is never {value[:60]!r}; it is {listed(field.among)}")
    if field.kind != "time":
        result: ColumnElement[bool] = COMPARISONS[op](column, bound(field, name, value))
        return result
    begin, end = span(field, name, value)
    first, after = (literal(moment, DateTime(timezone=True)) for moment in (begin, end))
    if begin == end:
        return COMPARISONS[op](column, first)  # type: ignore[no-any-return]
    return {  # a whole day
        "=": and_(column >= first, column < after),
        "<>": or_(column < first, column >= after),
        "<": column < first,
        "<=": column < after,
        ">": column >= after,
        ">=": column >= first,
    }[op]


def within(
    field: Field, name: str, column: ColumnElement[Any], low: Any, high: Any
) -> ColumnElement[bool]:
    """That a field lies between two values, both included."""
    if field.kind in ("truth", "id"):
        raise Invalid("filter", f"{name} cannot be BETWEEN two values; compare it with = or <>")
    return and_(compared(field, name, ">=", column, low), compared(field, name, "<=", column, high))


def matching(
    field: Field, name: str, column: ColumnElement[Any], pattern: Any
) -> ColumnElement[bool]:
    r"""That a text is like a pattern: `%` any text, `_` one character, `\` before either for
    itself.
    """
    if field.kind != "text" or not isinstance(pattern, str):
        raise Invalid("filter", f"{name} LIKE takes a field of text and a pattern in single quotes")
    if (len(pattern) - len(pattern.rstrip("\\"))) % 2:
        raise Invalid(
            "filter",
            rf"the pattern {pattern[:100]!r} of {name} ends in a single \; write \\ for itself",
        )
    return column.like(literal(pattern, Text))


def in_time(
    field: Field, name: str, op: str, column: ColumnElement[Any], value: Any
) -> ColumnElement[bool]:
    """`T_AFTER`, `T_BEFORE` a moment or an interval, `T_DURING` an interval; `'..'` is an open end.

    Raises:
        Invalid: the field has no times, or the value is none.
    """
    if field.kind != "time":
        raise Invalid("filter", f"{name} is {EXPECTED[field.kind]}; {op.upper()} takes a time")
    ends = value["interval"] if isinstance(value, dict) and "interval" in value else [value, value]
    low, high = ends
    if op == "t_before":
        return compared(field, name, "<", column, low)
    if op == "t_after":
        return compared(field, name, ">", column, high)
    conditions: list[ColumnElement[bool]] = [column.is_not(None)]
    if low != "..":
        conditions.append(compared(field, name, ">=", column, low))
    if high != "..":
        conditions.append(compared(field, name, "<=", column, high))
    return and_(*conditions)


def span(field: Field, name: str, value: Any) -> Span:
    """A date, a timestamp or a text that is either, as the time that it covers, UTC.

    Raises:
        Invalid: it is none of them.
    """
    text = value.get("date", value.get("timestamp")) if isinstance(value, dict) else value
    if not isinstance(text, str):
        raise _mismatch(field, name, value)
    try:
        if len(text) <= len("2026-03-01"):
            begin = datetime.combine(date.fromisoformat(text), datetime.min.time(), UTC)
            return begin, begin + timedelta(days=1)
        moment = datetime.fromisoformat(text)
        moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except (ValueError, OverflowError):
        raise _mismatch(field, name, text) from None
    return moment, moment


def listed(values: Sequence[str]) -> str:
    """Values in a sentence: a, b or c."""
    *first, last = values
    return f"{', '.join(first)} or {last}"


def folded(column: ColumnElement[Any]) -> ColumnElement[Any]:
    """A text without regard to case."""
    return func.lower(column)


def _mismatch(field: Field, name: str, value: Any) -> Invalid:
    unit = f" in {field.unit}" if field.unit else ""
    return Invalid(
        "filter", f"{name} is compared with {_shown(value)}, expected {EXPECTED[field.kind]}{unit}"
    )


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return (
            "an expression"
            if "op" in value
            else "another field"
            if "property" in value
            else str(value)[:60]
        )
    return "nothing" if value is None else repr(value)[:60]


_TYPES: dict[str, tuple[Kind, Any]] = {
    "string": ("text", Text),
    "number": ("number", Double),
    "boolean": ("truth", Boolean),
}
"""By the name of a JSON type: the kind of a field of such values, and their type in SQL."""


def has_tag(
    name: str, op: str, tags: ColumnElement[Any], values: Sequence[Any]
) -> ColumnElement[bool]:
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
        alike = matching(Field("tag", "text", ""), name, tag.c.tag, values[0])
        return and_(some, exists(select(1).select_from(tag).where(alike)))
    held = and_(some, tags.contains([values[0]]))
    return not_(held) if op == "<>" else held


def as_compared(field: Field, values: Sequence[Any]) -> Field:
    """A field of the metadata as one of the type of the values that it is compared with.

    Raises:
        Invalid: they are none that JSON has.
    """
    value = (
        values[0][0]
        if values and isinstance(values[0], list) and values[0]
        else values[0]
        if values
        else ""
    )
    names = {str: "string", int: "number", float: "number", bool: "boolean"}
    if type(value) not in names:
        raise Invalid(
            "filter", f"{field.name} takes a text in single quotes, a number, TRUE or FALSE"
        )
    json_type = names[type(value)]
    kind, sql = _TYPES[json_type]

    def typed(table: FromClause) -> ColumnElement[Any]:
        value = field.of(table)
        known = None if not values else func.jsonb_typeof(value) == json_type
        shown = value.op("#>>")(text("'{}'"))
        return shown if known is None else case((known, cast(shown, sql)), else_=None)

    return replace(field, kind=kind, value=typed)


def has_member(
    meta: ColumnElement[Any], path: Sequence[str], op: str, value: Any
) -> ColumnElement[bool]:
    """That metadata has a member, which is what an index of it can say: of `=` with its value,
    unless that is a number, of which JSON keeps all digits.
    """
    some = [meta != text("'{}'"), meta.has_key(path[0])]
    if op == "=" and isinstance(value, str | bool):
        document: Any = value
        for name in reversed(path):
            document = {name: document}
        some.append(meta.contains(literal(document, JSONB)))
    return and_(*some)
