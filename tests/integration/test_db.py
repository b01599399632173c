"""The database: schema refusal, migrations, drift, keys, the embedded server."""

from concurrent.futures import ThreadPoolExecutor
from typing import LiteralString

import psycopg
import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from psycopg.conninfo import conninfo_to_dict
from sqlalchemy import Engine, inspect, select, text

import service.app.composition  # noqa: F401  imports every table
from service.access.tables import User
from service.app.application import create_app
from service.db.base import Base
from service.db.engine import Sessions, for_reading, make_sessions, psycopg_url, sqlalchemy_url
from service.db.schema import SchemaError, current_revision, head_revision, require_head, upgrade
from service.settings import Settings


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
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '0001_foundations'"))
    if head_revision() == "0001_foundations":
        pytest.skip("there is one revision only")
    with pytest.raises(SchemaError, match=r"0001_foundations.*run `modalbase db upgrade`"):
        require_head(engine)


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
                "include_name": lambda name, kind, _: not (kind == "table" and name.startswith("procrastinate_")),
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
    "given", ["postgres://u:p%40@h:1/d", "postgresql://u:p%40@h:1/d", "postgresql+psycopg://u:p%40@h:1/d"]
)
def test_urls(given: str) -> None:
    assert sqlalchemy_url(given) == "postgresql+psycopg://u:p%40@h:1/d"
    assert psycopg_url(given) == "postgresql://u:p%40@h:1/d"


def test_libpq_understands_spaces_in_passwords_and_paths() -> None:
    url = psycopg_url("postgresql://u:a b+%2F@/d?host=%2Fsrv%2Fa%20b%2B")
    assert conninfo_to_dict(url) == {"user": "u", "password": "a b+/", "dbname": "d", "host": "/srv/a b+"}


def test_other_databases_are_refused() -> None:
    with pytest.raises(ValueError, match="expected a postgresql:// URL"):
        sqlalchemy_url("sqlite:///x.db")


def test_a_connection_whose_server_process_has_gone_is_replaced(engine: Engine) -> None:
    """Nobody is asked whether it lives: the end shows on this side."""
    with engine.connect() as connection:
        before = connection.scalar(OWN_PID)
    assert asked(engine, "SELECT pg_terminate_backend(%s, 60000)", before) is True
    with engine.connect() as connection:
        assert connection.scalar(OWN_PID) != before


def test_what_only_reads_holds_no_transaction(engine: Engine) -> None:
    for of, state in ((for_reading(engine), "idle"), (engine, "idle in transaction")):
        with make_sessions(of)() as session:
            pid = session.scalar(OWN_PID)
            assert asked(engine, "SELECT state FROM pg_stat_activity WHERE pid = %s", pid) == state


OWN_PID = text("SELECT pg_backend_pid()")


def asked(engine: Engine, question: LiteralString, pid: int | None) -> object:
    """By a connection of its own."""
    with psycopg.connect(psycopg_url(engine.url.render_as_string(hide_password=False))) as connection:
        row = connection.execute(question, [pid]).fetchone()
        return row[0] if row else None
