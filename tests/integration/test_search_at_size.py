"""The questions of `docs/search.md` at tens of thousands of rows: an index answers each, and one that takes too
long is ended in words.
"""

from typing import Any

import pytest
from sqlalchemy import Connection, Engine, event, text

from benchmarks.search import QUESTIONS, filling
from service.app import composition
from service.nouns.search.nouns import SEARCHED
from service.nouns.search.operations import Search, SearchQuery, bounded
from service.platform.access import User
from service.platform.access.keys import user_named
from service.platform.db.engine import Sessions
from service.platform.errors import Invalid

assert composition.ROUTERS  # so that every table is known

BIG = {"frfs": 30_000, "modes": 25_000, "update_results": 15_000}
"""Tables that are not read whole, with their rows."""


@pytest.fixture
def user(engine: Engine, sessions: Sessions) -> User:
    """A member of a project with all of it."""
    with sessions.begin() as session:
        asker = user_named(session, "asker")
        session.flush()
        project = session.execute(
            text("INSERT INTO projects (name) VALUES ('all') RETURNING id")
        ).scalar_one()
        values = {"project": project, "user": asker.id}
        session.execute(
            text(
                "INSERT INTO members (project_id, user_id, role) VALUES (:project, :user, 'viewer')"
            ),
            values,
        )
        rows = filling(
            project, 50, 0.995, campaigns=20, frfs=30, modes=25, results=15, spectrum="''"
        )
        for statement in rows:
            session.connection().connection.driver_connection.execute(statement)  # type: ignore[union-attr]
        for table in ("frfs", "update_results"):
            some = "WHERE get_byte(uuid_send(id), 15) = 7"
            session.execute(
                text(
                    f"""UPDATE {table} SET tags = '{{winter}}', meta = '{{"tip" \\: "steel"}}' {some}"""
                )
            )
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("VACUUM ANALYZE")
    return asker


def scanned(connection: Connection, statement: Any) -> set[str]:
    """Tables that the plan of a statement reads whole."""

    def explain(_: Any, __: Any, query: str, values: Any, *___: Any) -> tuple[str, Any]:
        return f"EXPLAIN (FORMAT JSON) {query}", values

    event.listen(connection, "before_cursor_execute", explain, retval=True)
    try:
        ((plan,),) = connection.execute(statement).cursor.fetchall()  # type: ignore[union-attr]
    finally:
        event.remove(connection, "before_cursor_execute", explain)
    return set(_whole(plan[0]["Plan"]))


def _whole(node: dict[str, Any]) -> Any:
    if node["Node Type"] == "Seq Scan":
        yield node["Relation Name"]
    for below in node.get("Plans", ()):
        yield from _whole(below)


def test_an_index_answers_every_question_of_the_documents(sessions: Sessions, user: User) -> None:
    assert len(QUESTIONS) == 11
    labels = [
        (noun, text)
        for noun in ("frfs", "results")
        for text in ("tag = 'winter'", "meta.tip = 'steel'")
    ]
    with sessions() as session, bounded(session):
        for noun, question in [*QUESTIONS, *labels]:
            search = Search(user, SEARCHED[noun], SearchQuery(question))
            for statement in (search.page_query(None, 100), search.some()):
                assert not scanned(session.connection(), statement) & BIG.keys(), question
            search.page(session, None, 100)


def test_a_search_that_takes_too_long_is_ended_in_words(sessions: Sessions) -> None:
    with sessions() as session:
        with pytest.raises(Invalid, match=r"takes longer than 0\.05 s"), bounded(session, 0.05):
            session.execute(text("SELECT pg_sleep(5)"))
        assert session.execute(text("SELECT 1")).scalar_one() == 1
        assert session.execute(text("SHOW statement_timeout")).scalar_one() == "0"
