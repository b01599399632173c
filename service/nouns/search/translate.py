"""A filter in CQL2 text (OGC 21-065) to a condition in SQL.

A filter becomes a tree of AND, OR and conditions on one field each; NOT is moved down to the
conditions (De Morgan). A condition on the noun that is searched, or on what that belongs to, is
asked of the row itself. Any other noun is asked by EXISTS, from what both have in common downwards,
and what one AND says of a noun, and of what belongs to it, is said of one row:
`campaign.temperature_c > 25 AND campaign.boundary = 'free'` finds structures with one campaign that
is both.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cql2
from sqlalchemy import ColumnElement, FromClause, and_, exists, not_, or_

from service.nouns.search import literals
from service.nouns.search.fields import META, Field, Noun, find_field
from service.nouns.search.nouns import NOUNS, lineage
from service.platform.errors import Invalid

LONGEST = 2000
"""Characters of a filter."""
DEEPEST = 50
"""Levels of a filter: brackets, and NOT, AND, OR within one another."""

Scope = Mapping[str, FromClause]
"""Nouns of which a row is at hand, with their tables' names in the query."""


@dataclass(frozen=True)
class Leaf:
    """A condition on one field of a noun: `test` makes it from a row."""

    noun: Noun
    test: Callable[[FromClause], ColumnElement[bool]]


@dataclass(frozen=True)
class Branch:
    """Conditions that must all be met, or one of which must be."""

    together: bool
    parts: tuple[Leaf | Branch, ...]


def condition(text: str, noun: Noun, scope: Scope) -> ColumnElement[bool]:
    """The condition that a filter puts on a row.

    Args:
        text: the filter.
        noun: that is searched; its fields need no noun in front.
        scope: the noun and all that it belongs to.

    Raises:
        Invalid: the filter is too long, cannot be read, names an unknown field, or compares it with
            something else.
    """
    _require_short(text)
    try:
        document = cql2.parse_text(text).to_json()
    except cql2.ParseError as error:
        raise Invalid("filter", _why_not(text, str(error))) from None
    return _all([_Reader(noun).tree(document, negated=False, depth=0)], scope)


def _require_short(text: str) -> None:
    """Bound what the parser is given: it ends its process where brackets lie too deep.

    Raises:
        Invalid: the text is too long or too deep, or has control characters.
    """
    if len(text) > LONGEST:
        raise Invalid("filter", f"has {len(text)} characters, at most {LONGEST} are read")
    if any(ord(character) < 32 and character not in "\t\n\r" for character in text):
        raise Invalid("filter", "has a control character")
    depth, quote = 0, ""
    for character in text:
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        else:
            depth += (character in "([") - (character in ")]")
        if depth > DEEPEST:
            raise Invalid("filter", f"has more than {DEEPEST} brackets within one another")


def _why_not(text: str, error: str) -> str:
    r"""What stands where the parser of a filter stopped, and what may stand there.

    >>> _why_not("Ex > 3e10 Pa", " --> 1:11\n = expected EOI, And, Or, Eq, or Gt")
    "cannot be read from 'Pa' on, behind 'Ex > 3e10': expected AND, OR or the end; a number has no unit"
    """
    place = re.search(r"(\d+):(\d+)", error)
    if place is None:
        return f"cannot be read: {error.strip()}"
    line, column = map(int, place.groups())
    at = sum(map(len, text.splitlines(keepends=True)[: line - 1])) + column - 1
    before, rest = text[:at].strip()[-60:], text[at:].strip()[:60]
    may = "a number, a text in single quotes, or a field"
    if "And" in error:
        may = "AND, OR or the end; a number has no unit" if "EOI" in error else "a closing bracket"
    where = f" from {rest!r} on" if rest else ""
    return f"cannot be read{where}{f', behind {before!r}' if before else ''}: expected {may}"


class _Reader:
    """Reads the parser's document into a tree."""

    def __init__(self, noun: Noun) -> None:
        self.noun = noun

    def tree(self, node: Any, *, negated: bool, depth: int) -> Leaf | Branch:
        """The tree of a node.

        Args:
            node: of the document.
            negated: whether a NOT stands above it.
            depth: nodes above it.
        """
        if depth > DEEPEST:
            raise Invalid("filter", f"has more than {DEEPEST} levels")
        if not isinstance(node, dict) or "op" not in node:
            # a field that is true or not by itself
            if isinstance(node, dict) and "property" in node:
                node = {"op": "=", "args": [node, True]}
            else:
                raise Invalid("filter", "is no condition, such as campaign.temperature_c > 25")
        op, args = node["op"].lower(), node["args"]
        _require_arguments(op, args)
        if op == "not":
            return self.tree(args[0], negated=not negated, depth=depth + 1)
        if op in ("and", "or"):
            parts = tuple(self.tree(one, negated=negated, depth=depth + 1) for one in args)
            return Branch((op == "and") != negated, parts)
        return self.condition(op, args, negated)

    def condition(self, op: str, args: Sequence[Any], negated: bool) -> Leaf | Branch:
        """A condition on one field, which stands on either side of a comparison."""
        _require_read(args)
        if op in _MIRRORED and len(args) == 2 and not _is_field(args[0]):
            op, args = _MIRRORED[op], [args[1], args[0]]
        if op != "in" and op not in _TESTS:
            ops = ", ".join(name.upper() for name in ("and", "or", "not", "in", *_TESTS))
            raise Invalid(
                "filter", f"uses {op[:40].upper()!r}, which is not read here; there is {ops}"
            )
        if not _is_field(args[0]):
            raise Invalid(
                "filter",
                f"{op.upper()} compares no field; a field stands on one side of it, a value on the"
                " other",
            )
        if op == "in":
            if not isinstance(args[1], list) or not args[1]:
                raise Invalid("filter", "IN takes values in brackets, such as ('a', 'b')")
            return Branch(
                negated, tuple(self.condition("=", [args[0], one], negated) for one in args[1])
            )
        if negated and op in _OPPOSITE:
            op, negated = _OPPOSITE[op], False
        return self.leaf(op, args, negated)

    def leaf(self, op: str, args: Sequence[Any], negated: bool) -> Leaf:
        """The same, by one operator that takes values."""
        folded = args[0].get("op") == "casei"
        subject = args[0]["args"][0] if folded else args[0]
        noun, field = find_field(NOUNS, self.noun, subject["property"], "filter")
        name = f"{noun.name}.{field.name}"
        if field.via:
            noun, field = NOUNS[field.via], replace(field, value=None)
        values = [_folded(one) for one in args[1:]] if folded else list(args[1:])
        field = replace(field, among=tuple(map(str.lower, field.among))) if folded else field
        path = field.name.split(".")[1:] if field.kind == "json" else []
        if path:
            field = literals.as_compared(field, values)
        if folded and field.kind != "text":
            raise Invalid(
                "filter", f"CASEI takes a text; {name} is {literals.EXPECTED[field.kind]}"
            )

        def test(row: FromClause) -> ColumnElement[bool]:
            column = field.of(row)
            if field.kind == "tags":
                return literals.has_tag(name, op, column, values)
            return _TESTS[op](
                field, name, op, literals.folded(column) if folded else column, values
            )

        def holds(row: FromClause) -> ColumnElement[bool]:
            condition = test(row)
            if negated:
                return not_(condition)
            if path and op != "isnull":
                return and_(
                    literals.has_member(row.c[META], path, op if not folded else "", values[0]),
                    condition,
                )
            return condition

        return Leaf(noun, holds)


_TAKES: dict[str, tuple[int | None, str]] = {
    "and": (None, "conditions"),
    "or": (None, "conditions"),
    "not": (1, "one condition"),
    **dict.fromkeys(literals.COMPARISONS, (2, "a field and a value")),
    "between": (3, "a field and two values"),
    "like": (2, "a field and a pattern"),
    "in": (2, "a field and values in brackets"),
    "isnull": (1, "one field"),
    "casei": (1, "one text, or a field of text"),
    "interval": (2, "two ends, each a text, a DATE, a TIMESTAMP or '..'"),
    **dict.fromkeys(("t_after", "t_before", "t_during"), (2, "a field and a time")),
}
"""How many arguments each operator takes (None: any number but none), and which."""


def _require_arguments(op: str, args: Any) -> None:
    """Refuse an operator with another number of arguments than it takes; unknown ones are refused
    by their names.

    Raises:
        Invalid: says what it takes.
    """
    number, words = _TAKES.get(op, (len(args), ""))
    if len(args) != number and not (number is None and args):
        raise Invalid(
            "filter",
            f"{op.upper()} takes {words}; it has {len(args)}"
            f" argument{'s' if len(args) != 1 else ''}",
        )


def _require_read(node: Any) -> None:
    """Refuse operands whose functions lack what they take.

    Raises:
        Invalid: says what they take.
    """
    if isinstance(node, list | tuple):
        for one in node:
            _require_read(one)
    elif isinstance(node, dict) and "interval" in node:
        _require_arguments("interval", node["interval"])
    elif isinstance(node, dict) and str(node.get("op", "")).lower() == "casei":
        _require_arguments("casei", node["args"])
        (inner,) = node["args"]
        if not (isinstance(inner, str) or (isinstance(inner, dict) and "property" in inner)):
            raise Invalid("filter", f"CASEI takes {_TAKES['casei'][1]}")


_MIRRORED = {"=": "=", "<>": "<>", "<": ">", "<=": ">=", ">": "<", ">=": "<="}
_OPPOSITE = {"=": "<>", "<>": "=", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}


def _is_field(node: Any) -> bool:
    folded = isinstance(node, dict) and node.get("op") == "casei"
    inner = node["args"][0] if folded else node
    return isinstance(inner, dict) and "property" in inner


def _folded(value: Any) -> Any:
    if isinstance(value, dict) and value.get("op") == "casei":
        value = value["args"][0]
    return (
        [_folded(one) for one in value]
        if isinstance(value, list)
        else value.lower()
        if isinstance(value, str)
        else value
    )


_TESTS: dict[
    str, Callable[[Field, str, str, ColumnElement[Any], list[Any]], ColumnElement[bool]]
] = {
    **dict.fromkeys(
        literals.COMPARISONS, lambda f, n, op, c, v: literals.compared(f, n, op, c, v[0])
    ),
    "between": lambda f, n, _, c, v: literals.within(f, n, c, v[0], v[1]),
    "like": lambda f, n, _, c, v: literals.matching(f, n, c, v[0]),
    "isnull": lambda _f, _n, _, c, _v: c.is_(None),
    **dict.fromkeys(
        ("t_after", "t_before", "t_during"),
        lambda f, n, op, c, v: literals.in_time(f, n, op, c, v[0]),
    ),
}


def _all(trees: Sequence[Leaf | Branch], scope: Scope) -> ColumnElement[bool]:
    """That all trees hold; those that speak of a noun out of reach, and of the same one first, of
    one row of it.
    """
    conditions: list[ColumnElement[bool]] = []
    below: dict[str, list[Leaf | Branch]] = {}
    for tree in _flat(trees):
        steps = _first_steps(tree, scope)
        if len(steps) == 1:
            below.setdefault(next(iter(steps)), []).append(tree)
        elif isinstance(tree, Leaf):
            conditions.append(tree.test(scope[tree.noun.name]))
        else:  # an OR of several nouns, or of none but those at hand
            conditions.append(or_(*(_all([part], scope) for part in tree.parts)))
    for name, about in below.items():
        noun = NOUNS[name]
        row = noun.rows()
        links = [noun.owned_by(row, scope[noun.owner])]
        if noun.hidden:
            links.append(row.c.deleted_at.is_(None))
        condition = and_(*links, _all(about, {**scope, name: row}))
        conditions.append(exists().select_from(row).where(condition))
        if noun.of_part and (part := noun.of_part(row, scope, condition)) is not None:
            conditions.append(part)
    return and_(*conditions)


def _flat(trees: Sequence[Leaf | Branch]) -> list[Leaf | Branch]:
    return [
        part
        for tree in trees
        for part in (_flat(tree.parts) if isinstance(tree, Branch) and tree.together else [tree])
    ]


def _first_steps(tree: Leaf | Branch, scope: Scope) -> set[str]:
    """The nouns through which a tree leaves what is at hand; the empty name stands for what is at
    hand itself.
    """
    if isinstance(tree, Leaf):
        return {
            next((one.name for one in reversed(lineage(tree.noun)) if one.name not in scope), "")
        } - {""}
    parts = [_first_steps(part, scope) for part in tree.parts]
    return set.union(*parts) | ({""} if set() in parts and any(parts) else set())
