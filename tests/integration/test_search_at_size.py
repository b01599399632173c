"""The questions of `docs/search.md` at some 10⁵ rows: an index answers each, and one that takes too long is ended in words."""

import re
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection, Engine, event, text

from service.access import User
from service.access.keys import user_named
from service.app import composition
from service.db.engine import Sessions
from service.errors import Invalid
from service.store.search.nouns import SEARCHED, field_table
from service.store.search.operations import Search, Wanted, bounded

assert composition.ROUTERS  # so that every table is known

PAGE = (Path(__file__).parents[2] / "docs/search.md").read_text(encoding="utf-8")
QUESTIONS = re.findall(r"^\| [^|]+ \| `(\w+)` \| `([^`]+)` \|$", PAGE, re.MULTILINE)
BIG = {"frfs": 120_000, "modes": 100_000, "update_results": 60_000, "result_constants": 120_000}
"""Tables that are not read whole, with their rows."""

CAMPAIGNS, FRFS_EACH, MODES_EACH = 4000, 30, 25
FILL = f"""
SET LOCAL session_replication_role = replica;
INSERT INTO structures (project_id, name, version)
  SELECT :project, (ARRAY['bridge', 'panel', 'bar', 'mast'])[1 + i % 4] || ' ' || i, 1 FROM generate_series(1, 200) i;
INSERT INTO campaigns (structure_id, name, boundary, performed_at, temperature_c, instruments, notes)
  SELECT s.id, 'test ' || i, (ARRAY['free', 'cantilever'])[1 + i % 2],
    timestamptz '2025-01-01' + i * interval '7 days', random(-10.0, 40.0),
    jsonb_build_object('hammer', jsonb_build_object('model', '8206-002'),
                       'sensor', jsonb_build_object('model', (4500 + i % 20)::text)), ''
  FROM structures s, generate_series(1, {CAMPAIGNS} / 200) i;
INSERT INTO frfs (campaign_id, label, response_point, response_direction, reference_point, reference_direction, quantity,
    start_hz, end_hz, step_hz, lines, dtype, sha256, data)
  SELECT c.id, 'f', i, 3, 1 + floor(random() * 3000), 3, 'accelerance', 0, 31, 1, 32, '<c8', '', ''
  FROM campaigns c, generate_series(1, {FRFS_EACH}) i;
INSERT INTO mode_sets (campaign_id, name, origin) SELECT id, 'set', 'identified' FROM campaigns;
INSERT INTO modes (mode_set_id, number, frequency_hz, damping_ratio)
  SELECT id, i, random(6.0, 4000.0), random(0.001, 0.2) FROM mode_sets, generate_series(1, {MODES_EACH}) i;
INSERT INTO update_jobs (id, project_id, campaign_id, structure_version_id, recipe)
  SELECT uuidv7(), :project, c.id, c.id, '{{}}' FROM campaigns c, generate_series(1, 15) i;
INSERT INTO update_results (id, verdict, document, prediction)
  SELECT id, (ARRAY['usable', 'with_care'])[1 + (random() < 0.3)::int], '{{}}', '' FROM update_jobs;
INSERT INTO result_constants (result_id, name, estimate, standard_deviation, low, high)
  SELECT id, n, 3e10 * random(0.995, 2.0), 1e9, 1e9, 1e11 FROM update_results, unnest(ARRAY['Ex', 'Ey']) n;
"""


@pytest.fixture
def user(engine: Engine, sessions: Sessions) -> User:
    """A member of a project with all of it."""
    with sessions.begin() as session:
        found = user_named(session, "asker")
        session.flush()
        project = session.execute(text("INSERT INTO projects (name) VALUES ('all') RETURNING id")).scalar_one()
        values = {"project": project, "user": found.id}
        session.execute(
            text("INSERT INTO members (project_id, user_id, role) VALUES (:project, :user, 'viewer')"), values
        )
        for statement in FILL.replace(":project", f"'{project}'").split(";\n"):
            session.execute(text(statement.replace(":", "\\:"))) if statement.strip() else None
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("VACUUM ANALYZE")
    return found


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
    assert len(QUESTIONS) == 10
    with sessions() as session, bounded(session):
        for noun, question in QUESTIONS:
            search = Search(user, SEARCHED[noun], Wanted(question))
            for statement in (search.page_query(None, 100), search.some()):
                assert not scanned(session.connection(), statement) & BIG.keys(), question
            search.page(session, None, 100)


def test_a_search_that_takes_too_long_is_ended_in_words(sessions: Sessions) -> None:
    with sessions() as session:
        with pytest.raises(Invalid, match=r"takes longer than 0\.05 s"), bounded(session, 0.05):
            session.execute(text("SELECT pg_sleep(5)"))
        assert session.execute(text("SELECT 1")).scalar_one() == 1
        assert session.execute(text("SHOW statement_timeout")).scalar_one() == "0"


def test_the_documents_have_every_field() -> None:
    assert field_table() in PAGE
