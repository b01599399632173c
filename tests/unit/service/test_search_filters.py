"""Filters as people and programs write them: whatever the text, it becomes SQL or is refused in
words.
"""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy.dialects import postgresql

from service.app import composition
from service.nouns.search.nouns import NOUNS, lineage
from service.nouns.search.translate import condition
from service.platform.errors import Invalid

assert composition.ROUTERS  # so that every table is known


def sql_of(text: str, noun: str = "campaign") -> str:
    scope = {one.name: one.rows() for one in lineage(NOUNS[noun])}
    return str(condition(text, NOUNS[noun], scope).compile(dialect=postgresql.dialect()))


FIELDS = st.sampled_from(
    [
        "name",
        "created_at",
        "temperature_c",
        "tag",
        "id",
        "meta",
        "meta.client",
        "structure.name",
        "mode.number",
        "nothing",
    ]
)
VALUES = st.one_of(
    st.sampled_from(
        [
            "'a'",
            "''",
            "'..'",
            "3",
            "-1e400",
            "1e20",
            "TRUE",
            "NULL",
            "POINT(0 0)",
            "('a', 'b')",
            "()",
            "a + 1",
        ]
    ),
    st.sampled_from(
        [
            "DATE('2026-03-01')",
            "DATE('x')",
            "DATE()",
            "TIMESTAMP('2026-03-01T12:00:00Z')",
            "'2026-03-01'",
        ]
    ),
)
OPERANDS = st.recursive(
    FIELDS | VALUES,
    lambda inner: st.builds(
        lambda name, args: f"{name}({', '.join(args)})",
        st.sampled_from(["CASEI", "INTERVAL", "ACCENTI", "avg", "DATE", "T_DURING"]),
        st.lists(inner, max_size=3),
    ),
    max_leaves=4,
)
CALLS = st.builds(
    lambda name, args: f"{name}({', '.join(args)})",
    st.sampled_from(["T_AFTER", "T_BEFORE", "T_DURING", "S_INTERSECTS", "A_CONTAINS", "CASEI", "AND", "IN", "LIKE", "BETWEEN",
                     "isNull", "T_EQUALS"]),
    st.lists(OPERANDS, max_size=3),
)  # fmt: skip
CONDITIONS = st.one_of(
    CALLS,
    OPERANDS,
    st.builds(
        "{} {} {}".format,
        OPERANDS,
        st.sampled_from(["=", "<>", "<", ">=", "LIKE", "IN", "NOT LIKE"]),
        OPERANDS,
    ),
    st.builds("{} BETWEEN {} AND {}".format, OPERANDS, OPERANDS, OPERANDS),
    st.builds("{} IS NULL".format, OPERANDS),
)
FILTERS = st.recursive(
    CONDITIONS,
    lambda inner: (
        st.builds("({}) {} ({})".format, inner, st.sampled_from(["AND", "OR"]), inner)
        | st.builds("NOT ({})".format, inner)
    ),
    max_leaves=3,
)


@given(FILTERS, st.sampled_from(sorted(NOUNS)))
def test_a_filter_becomes_sql_or_is_refused(text: str, noun: str) -> None:
    with suppress(Invalid):
        assert sql_of(text, noun)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("CASEI(1, 2) = 'a'", "CASEI takes one text, or a field of text; it has 2 arguments"),
        ("CASEI() = 'a'", "CASEI takes one text"),
        ("CASEI(3) = 'a'", "CASEI takes one text"),
        ("CASEI(CASEI(name)) = 'a'", "CASEI takes one text"),
        ("name = CASEI(1)", "CASEI takes one text"),
        ("name IN (CASEI('a', 'b'))", "CASEI takes one text"),
        ("CASEI(name)", "'CASEI', which is not read here"),
        ("T_DURING()", "T_DURING takes a field and a time; it has 0 arguments"),
        ("T_DURING(created_at)", "it has 1 argument"),
        ("T_DURING(created_at, INTERVAL('2020-01-01'))", "INTERVAL takes two ends"),
        ("T_AFTER(created_at, INTERVAL('a', 'b', 'c'))", "INTERVAL takes two ends"),
        ("T_AFTER(created_at, 3)", "is compared with 3"),
        ("LIKE(name)", "LIKE takes a field and a pattern"),
        ("BETWEEN(name, 1)", "BETWEEN takes a field and two values"),
        ("AND()", "AND takes conditions; it has 0 arguments"),
        ("S_INTERSECTS(name, POINT(0 0))", "'S_INTERSECTS', which is not read here"),
    ],
)
def test_what_a_function_lacks_is_said(text: str, words: str) -> None:
    with pytest.raises(Invalid, match="filter: ") as refused:
        sql_of(text)
    assert words in str(refused.value)


def test_functions_with_what_they_take_are_read() -> None:
    assert "lower" in sql_of("CASEI(name) = CASEI('A')")
    assert ">=" in sql_of("T_DURING(created_at, INTERVAL('2026-01-01', '..'))")
