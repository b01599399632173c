"""Is the database's schema this version's? And how to bring it there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine, text

import migrations
from migrations import procrastinate_schema

MIGRATION_LOCK = 0x6D6F_6461_6C62  # an advisory lock of our own: two upgrades at once wait for each other

POSTGRESQL = 18
"""The oldest PostgreSQL that will do: the first with `uuidv7()`."""

NO_SCHEMA = "the database has no modalbase schema yet; run `modalbase db upgrade`"
NEWER = "a newer modalbase made; install that version or a later one"


class SchemaError(Exception):
    """The database's schema is not the one that this version works with; the message says which command mends it."""


def current_revision(engine: Engine) -> str | None:
    """The revision that the database is at; None where it is empty.

    Raises:
        SchemaError: the server's PostgreSQL is too old.
    """
    with engine.connect() as connection:
        require_version(connection)
        return _revision(connection)


def require_version(connection: Connection) -> None:
    """Refuse a server whose PostgreSQL lacks what the schema needs, such as `uuidv7()`.

    Raises:
        SchemaError: with its version and the one that is needed.
    """
    version = connection.connection.driver_connection.info.server_version  # type: ignore[union-attr]  # psycopg's
    if version < 10_000 * POSTGRESQL:
        found = f"{version // 10_000}.{version % 10_000}"
        raise SchemaError(
            f"the server runs PostgreSQL {found}, modalbase needs {POSTGRESQL} or newer; use such a server"
        )


def known_revisions() -> set[str]:
    """The revisions that this version knows."""
    return {script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()}


def require_known(connection: Connection) -> str:
    """The revision of a database that this version can read.

    Raises:
        SchemaError: it has none, or a newer version's.
    """
    require_version(connection)
    current = _revision(connection)
    if current is None:
        raise SchemaError(NO_SCHEMA)
    if current not in known_revisions():
        raise SchemaError(f"the schema is at {current}, which {NEWER}")
    return current


def head_revision() -> str:
    """The revision that this version works with."""
    head = ScriptDirectory.from_config(_config()).get_current_head()
    if head is None:
        raise SchemaError("this installation holds no migrations; install modalbase again")
    return head


def require_head(engine: Engine) -> None:
    """Refuse to work on another schema than this version's.

    Raises:
        SchemaError: the schema is older, or newer, or missing; or the queue's library wants another one for its tables.
    """
    if (unfit := procrastinate_schema.mismatch()) is not None:
        raise SchemaError(unfit)
    current, head = current_revision(engine), head_revision()
    if current == head:
        return
    if current is None:
        raise SchemaError(NO_SCHEMA)
    if current in known_revisions():
        raise SchemaError(f"the schema is at {current}, this version needs {head}; run `modalbase db upgrade`")
    raise SchemaError(f"the schema is at {current}, which {NEWER}")


def upgrade(engine: Engine, revision: str = "head") -> None:
    """Bring the schema to a revision, in one transaction; several processes may try at once.

    Raises:
        SchemaError: the server's PostgreSQL is too old.
    """
    with upgrading(engine) as connection:
        upgrade_on(connection, revision)


@contextmanager
def upgrading(engine: Engine) -> Iterator[Connection]:
    """A transaction that may change the schema, alone; after an error nothing of it stays.

    Raises:
        SchemaError: the server's PostgreSQL is too old.
    """
    with engine.begin() as connection:
        require_version(connection)
        connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": MIGRATION_LOCK})
        yield connection


def upgrade_on(connection: Connection, revision: str) -> None:
    """Bring the schema to a revision in the transaction of `upgrading`."""
    command.upgrade(_config(connection), revision)


def _revision(connection: Connection) -> str | None:
    return MigrationContext.configure(connection).get_current_revision()


def _config(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    if connection is not None:
        config.attributes["connection"] = connection
    return config
