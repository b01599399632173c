"""The database: schema refusal, migrations that lose nothing, drift, keys."""

import io
import json
import re
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, LiteralString
from uuid import UUID, uuid4

import numpy as np
import psycopg
import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from procrastinate.schema import SchemaManager
from psycopg.conninfo import conninfo_to_dict
from sqlalchemy import Column, Connection, Engine, MetaData, Table, insert, inspect, select, text
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Session

import service.app.composition  # noqa: F401  imports every table
from migrations import procrastinate_schema
from service.app.application import create_app
from service.nouns.updates.tables import UpdateJob, UpdateResult
from service.platform.access.tables import User
from service.platform.db.base import Base
from service.platform.db.engine import (
    Sessions,
    for_reading,
    make_engine,
    make_sessions,
    psycopg_url,
    sqlalchemy_url,
)
from service.platform.db.schema import (
    LAST_WITH_OLDER,
    SchemaError,
    _config,
    current_revision,
    head_revision,
    require_head,
    upgrade,
)
from service.platform.settings import Settings
from tests.support.lengths import long


def test_refuses_an_empty_schema_and_says_what_mends_it(empty: Engine) -> None:
    with pytest.raises(SchemaError, match="run `modalbase db upgrade`"):
        require_head(empty)


def test_app_refuses_to_start_on_an_empty_schema(empty_database: str) -> None:
    with pytest.raises(SchemaError, match="run `modalbase db upgrade`"):
        create_app(Settings(database_url=empty_database))


def test_refuses_a_schema_that_a_newer_version_made(engine: Engine) -> None:
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999_future'"))
    with pytest.raises(SchemaError, match="newer modalbase"):
        require_head(engine)


def test_refuses_an_older_schema(engine: Engine) -> None:
    first = revisions()[0]
    with engine.begin() as connection:
        connection.execute(text(f"UPDATE alembic_version SET version_num = '{first}'"))
    with pytest.raises(SchemaError, match=rf"{first}.*run `modalbase db upgrade`"):
        require_head(engine)


def test_a_schema_older_than_the_first_revision_names_the_commit_that_upgrades_it(
    engine: Engine,
) -> None:
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '0031_search'"))
    for refuse in (require_head, upgrade):
        with pytest.raises(SchemaError, match=f"0031_search, .* commit {LAST_WITH_OLDER}"):
            refuse(engine)
    assert current_revision(engine) == "0031_search"


def test_upgrades_to_head_also_when_two_try_at_once(empty: Engine) -> None:
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(upgrade, [empty, empty]))
    assert current_revision(empty) == head_revision()
    require_head(empty)


def test_failed_upgrade_leaves_nothing(empty: Engine) -> None:
    with empty.begin() as connection:
        connection.execute(text("CREATE TABLE jobs (id int)"))  # in the way of the first revision
    with pytest.raises(Exception, match="already exists"):
        upgrade(empty)
    assert inspect(empty).get_table_names() == ["jobs"]


def test_models_and_migrations_agree(engine: Engine) -> None:
    with engine.connect() as connection:
        context = MigrationContext.configure(
            connection,
            opts={
                "compare_server_default": True,
                "include_name": lambda name, kind, _: (
                    not (kind == "table" and name.startswith("procrastinate_"))
                ),
            },
        )
        assert compare_metadata(context, Base.metadata) == []


def test_keys_are_uuid7_in_order_of_creation(sessions: Sessions) -> None:
    with sessions.begin() as session:
        for name in ("a", "b", "c"):
            session.add(User(name=name))
            session.flush()
    with sessions() as session:
        users = session.scalars(select(User).order_by(User.id)).all()
    assert [user.name for user in users] == ["a", "b", "c"]
    assert {user.id.version for user in users} == {7}
    assert {user.created_at.utcoffset().total_seconds() for user in users} == {0.0}


@pytest.mark.parametrize(
    "given",
    ["postgres://u:p%40@h:1/d", "postgresql://u:p%40@h:1/d", "postgresql+psycopg://u:p%40@h:1/d"],
)
def test_urls(given: str) -> None:
    assert sqlalchemy_url(given) == "postgresql+psycopg://u:p%40@h:1/d"
    assert psycopg_url(given) == "postgresql://u:p%40@h:1/d"


def test_libpq_understands_spaces_in_passwords_and_paths() -> None:
    url = psycopg_url("postgresql://u:a b+%2F@/d?host=%2Fsrv%2Fa%20b%2B")
    assert conninfo_to_dict(url) == {
        "user": "u",
        "password": "a b+/",
        "dbname": "d",
        "host": "/srv/a b+",
    }


def test_other_databases_are_refused() -> None:
    with pytest.raises(ValueError, match="expected a postgresql:// URL"):
        sqlalchemy_url("sqlite:///x.db")


def test_a_connection_whose_server_process_has_gone_is_replaced(engine: Engine) -> None:
    """Nobody is asked whether it lives: the end shows on this side."""
    with engine.connect() as connection:
        before = connection.scalar(OWN_PID)
    assert answer_of(engine, "SELECT pg_terminate_backend(%s, 60000)", before) is True
    with engine.connect() as connection:
        assert connection.scalar(OWN_PID) != before


def test_what_only_reads_holds_no_transaction(engine: Engine) -> None:
    for of, state in ((for_reading(engine), "idle"), (engine, "idle in transaction")):
        with make_sessions(of)() as session:
            pid = session.scalar(OWN_PID)
            assert (
                answer_of(engine, "SELECT state FROM pg_stat_activity WHERE pid = %s", pid) == state
            )


OWN_PID = text("SELECT pg_backend_pid()")


def answer_of(engine: Engine, question: LiteralString, pid: int | None) -> object:
    """By a connection of its own."""
    with psycopg.connect(
        psycopg_url(engine.url.render_as_string(hide_password=False))
    ) as connection:
        row = connection.execute(question, [pid]).fetchone()
        return row[0] if row else None


# --- upgrades of databases that hold rows
# -------------------------------------------------------------------------------

TOGETHER: dict[str, dict[str, Any]] = {
    "frfs": {"step_hz": 0.5},
    "deliveries": {"recipient": "lab@example.org"},
}
"""Values that a check on several columns wants."""

DROPPED = {("monitors", "mail_to"), ("update_jobs", "idempotency_key")}
"""Columns that a later revision has no use for; a test of its own says where their values are."""

GONE = {"joint_updates"}
"""Tables that a later revision has no use for; a test of its own says where their rows are then."""

GAINING = {"update_jobs", "update_results"}
"""Tables that take the rows of those."""

VALUES: dict[type, Any] = {
    str: "µε, °",
    int: 3,
    float: 0.25,
    bool: False,
    bytes: b"\x00\xff",
    datetime: datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC),
}


def revisions() -> list[str]:
    scripts = ScriptDirectory.from_config(_config()).walk_revisions()
    return [script.revision for script in scripts][::-1]


def tables_of(connection: Connection) -> list[Table]:
    """Our tables as they are in the database, parents first."""
    metadata = MetaData()
    metadata.reflect(
        connection,
        only=lambda name, _: not name.startswith("procrastinate_") and name != "alembic_version",
    )
    return metadata.sorted_tables


def a_value(
    table: Table, column: Column[Any], connection: Connection, allowed: dict[str, str], number: int
) -> Any:
    """One that the column takes, which its newest parent has where it has one."""
    for key in column.foreign_keys:
        return connection.scalar(select(key.column).order_by(key.column.desc()).limit(1))
    if column.name in TOGETHER.get(table.name, {}):
        return TOGETHER[table.name][column.name]
    if column.name in allowed:
        return allowed[column.name]
    if isinstance(column.type, JSONB) or column.type.__class__.__name__ == "JSON":
        return {"b": [1, "ü"], "a": None}
    kind = column.type.python_type
    if number and kind in (str, bytes):  # a name or a digest may be there once
        return f"{VALUES[str]} {number:03d}" if kind is str else VALUES[bytes] + bytes([number])
    return VALUES[kind] if kind in VALUES else uuid4()


def fill(
    connection: Connection, number: int = 0, tables: list[Table] | None = None
) -> dict[str, list[dict[str, Any]]]:
    """A row in every table: all that must be stated, and every reference to another table.

    Args:
        connection: on the database.
        number: of the rows; of another number there may be more in the same tables.
        tables: of the database, where they are known.

    Returns:
        All rows that are there then, by table.
    """
    checks = inspect(connection).get_multi_check_constraints()
    jobs: dict[Table, list[Column[Any]]] = {}
    for table in tables or tables_of(connection):
        texts = [check["sqltext"] for check in checks.get((None, table.name), [])]
        lists = [re.search(r"(\w+)\)?(?:::\w+)? = ANY \(.*?'([^']+)'", text) for text in texts]
        allowed = {match[1]: match[2] for match in lists if match}
        needed = [
            column
            for column in table.columns
            if (not column.nullable and column.server_default is None)
            or column.name in TOGETHER.get(table.name, {})
            or (column.foreign_keys and table.name != "deliveries")
        ]
        own: dict[str, Any] = {}
        if table.name == "joint_updates":  # no other row is of its job, which is older than theirs
            own["id"] = UUID(int=number + 1)
            for of_jobs, columns in jobs.items():
                values = {c.name: a_value(of_jobs, c, connection, {}, number) for c in columns}
                connection.execute(insert(of_jobs), values | own | {"state": "queued"})
        values = {c.name: a_value(table, c, connection, allowed, number) for c in needed}
        connection.execute(insert(table), values | own)
        if table.name == "jobs":
            jobs[table] = needed
    return {
        table.name: [dict(row._mapping) for row in connection.execute(select(table))]
        for table in tables or tables_of(connection)
    }


@pytest.mark.parametrize("each", [False, long(True)])
def test_an_upgrade_keeps_every_row(empty: Engine, each: bool) -> None:
    """From each revision to the next, with rows of that and of every earlier revision in every
    table; in the short run from the first, and from the last but one.
    """
    chain, tables = revisions(), None
    chain = chain if each else [chain[0], *chain[-2:]]
    upgrade(empty, chain[0])
    for number, following in enumerate(chain[1:]):
        with empty.begin() as connection:
            before = fill(connection, number, tables)
        assert all(before.values())
        upgrade(empty, following)
        with empty.connect() as connection:
            tables = tables_of(connection)
            after = {table.name: table for table in tables}
            for name, rows in before.items():
                if name in GONE - after.keys():
                    continue
                columns = [column for column in rows[0] if (name, column) not in DROPPED]
                kept = connection.execute(
                    select(*(after[name].c[column] for column in columns))
                ).all()
                copied = Counter(str(dict(row._mapping)) for row in kept)
                copied.subtract(str({c: row[c] for c in columns}) for row in rows)
                assert min(copied.values()) == 0, (name, following)
                assert name in GAINING or max(copied.values()) == 0, (name, following)
    require_head(empty)
    with empty.connect() as connection:
        context = MigrationContext.configure(
            connection,
            opts={"include_name": lambda name, *_: not str(name).startswith("procrastinate_")},
        )
        assert compare_metadata(context, Base.metadata) == []


def test_mail_addresses_become_receivers_and_joint_updates_updates_of_several_campaigns(
    empty: Engine,
) -> None:
    upgrade(empty, "0057_superseded")
    with empty.begin() as connection:
        before = fill(connection)
    upgrade(empty, "0058_channels")
    with empty.connect() as connection:
        receivers = connection.execute(text("SELECT receivers FROM monitors")).scalars().all()
        channels = connection.execute(text("SELECT channel, webhook_id FROM deliveries")).all()
    assert receivers == [{"mail": row["mail_to"]} for row in before["monitors"]]
    assert [(c == "mail", w is None) for c, w in channels] in ([(True, True)], [(False, False)])
    document = {
        "verdict": {"level": "usable"},
        "parameters": [
            {
                "name": "E1",
                "estimate": 3e10,
                "standard_deviation": 1e8,
                "interval_95": [2.9e10, None],
            }
        ],
    }
    request = {"recipe": {"seed": 3}, "jobs": []}
    with empty.begin() as connection:
        connection.execute(
            text("UPDATE joint_updates SET document = :document, request = :request"),
            {"document": json.dumps(document), "request": json.dumps(request)},
        )
        (key,) = connection.execute(text("SELECT id FROM joint_updates")).scalars()
        connection.execute(
            text("UPDATE jobs SET kind = 'joint_update' WHERE id = :id"), {"id": key}
        )
    upgrade(empty, "0059_updates")
    with Session(empty) as session:
        job = session.get_one(UpdateJob, key)
        result = session.get_one(UpdateResult, key)
        kinds = session.execute(text("SELECT kind FROM jobs WHERE id = :id"), {"id": key})
        one = session.scalars(select(UpdateJob).where(UpdateJob.id != key)).one()
        assert (job.campaign_id, job.recipe, job.request) == (None, {"seed": 3}, request)
        assert (result.campaign_id, result.verdict) == (None, "usable")
        assert result.document == {**document, "version": 3}
        assert list(result.document) == ["verdict", "parameters", "version"]
        assert result.constants == {
            "E1": {"estimate": 3e10, "sd": 1e8, "low": 2.9e10, "high": None}
        }
        assert np.load(io.BytesIO(result.prediction)).files == []
        assert kinds.scalar_one() == "update"
        assert one.request is None
        assert one.campaigns == [
            {
                "campaign_id": str(one.campaign_id),
                "structure_version_id": str(one.structure_version_id),
            }
        ]


def test_the_revisions_are_one_chain() -> None:
    chain = revisions()
    assert chain == sorted(chain), "file names and order of revisions differ"
    assert len({revision[:4] for revision in chain}) == len(chain)


def engine_schema(url: str) -> list[tuple[Any, ...]]:
    """Columns, indices, constraints, triggers and functions of the queue's engine."""
    queries = (
        (
            "SELECT table_name, column_name, data_type, column_default, is_nullable FROM"
            " information_schema.columns WHERE table_name LIKE 'procrastinate%'"
        ),
        "SELECT indexdef FROM pg_indexes WHERE tablename LIKE 'procrastinate%'",
        (
            "SELECT conrelid::regclass::text, pg_get_constraintdef(oid) FROM pg_constraint"
            " WHERE conrelid::regclass::text LIKE 'procrastinate%'"
        ),
        (
            "SELECT pg_get_triggerdef(oid) FROM pg_trigger WHERE NOT tgisinternal AND tgname LIKE"
            " 'procrastinate%'"
        ),
        "SELECT pg_get_functiondef(oid) FROM pg_proc WHERE proname LIKE 'procrastinate%'",
        "SELECT enumtypid::regtype::text, enumlabel FROM pg_enum",
    )
    engine = make_engine(url)
    with engine.connect() as connection:
        tables = [
            tuple(row)
            for query in queries
            for row in connection.exec_driver_sql(query.replace("%", "%%"))
        ]
    engine.dispose()
    return sorted(tables, key=str)


def test_the_engines_scripts_by_version_make_the_schema_that_it_brings(
    empty: Engine, new_database: Any
) -> None:
    with empty.begin() as connection:
        connection.exec_driver_sql(SchemaManager.get_schema().replace("%", "%%"))
    assert engine_schema(new_database()) == engine_schema(
        empty.url.render_as_string(hide_password=False)
    )


@pytest.mark.parametrize(
    ("newest", "mends"),
    [
        ("03.11.00_01_pre_new.sql", "'procrastinate<3.11.0'"),
        ("03.03.00_01_pre_old.sql", "'procrastinate>=3.4.0'"),
    ],
)
def test_another_version_of_the_engine_is_refused(
    newest: str, mends: str, database: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A library of that version brings scripts up to it."""
    (tmp_path / newest).touch()
    assert procrastinate_schema._scripts() == sorted(
        Path(SchemaManager.get_migrations_path()).glob("*.sql")
    )
    monkeypatch.setattr(procrastinate_schema, "_scripts", lambda: sorted(tmp_path.glob("*.sql")))
    engine = make_engine(database)
    with pytest.raises(SchemaError, match=re.escape(f"run `pip install {mends}`")):
        require_head(engine)
    engine.dispose()
