"""Is the database's schema this version's? And how to bring it there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Connection, Engine, text

import migrations
from migrations import procrastinate_schema

if TYPE_CHECKING:
    from alembic.config import Config

# Alembic is imported where a schema is changed: whether one is this version's is asked at each start, by every process.

MIGRATION_LOCK = 0x6D6F_6461_6C62  # an advisory lock of our own: two upgrades at once wait for each other

POSTGRESQL = 18
"""The oldest PostgreSQL that will do: the first with `uuidv7()`."""

_LINEAGE = re.compile(r'^revision = "(?P<revision>\w+)"\ndown_revision = (?:None|"(?P<parent>\w+)")$', re.MULTILINE)

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
    return set(_parents())


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
    parents = _parents()
    heads = parents.keys() - parents.values()
    if len(heads) != 1:
        raise SchemaError("this installation's migrations are not whole; install modalbase again")
    return heads.pop()


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
    from alembic import command

    command.upgrade(_config(connection), revision)


def _revision(connection: Connection) -> str | None:
    if connection.scalar(text("SELECT to_regclass('alembic_version')")) is None:
        return None
    revision: str | None = connection.scalar(text("SELECT version_num FROM alembic_version"))
    return revision


def _parents() -> dict[str, str | None]:
    """The revision before each that this version knows, as the migrations state them; None before the first."""
    files = Path(migrations.__file__).parent.joinpath("versions").glob("[0-9]*.py")
    return {
        found["revision"]: found["parent"]
        for file in files
        if (found := _LINEAGE.search(file.read_text(encoding="utf-8"))) is not None
    }


def _config(connection: Connection | None = None) -> Config:
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    if connection is not None:
        config.attributes["connection"] = connection
    return config
