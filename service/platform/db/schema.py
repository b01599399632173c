"""Is the database's schema this version's? And how to bring it there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import psycopg

import migrations
from migrations import procrastinate_schema

if TYPE_CHECKING:
    from alembic.config import Config
    from sqlalchemy import Connection, Engine

# Alembic is imported where a schema is changed: whether one is this version's is asked at each
# start, by every process.
# SQLAlchemy is not imported here at all: who starts the others asks before it has any other use for
# it.

# an advisory lock of our own: two upgrades at once wait for each other
MIGRATION_LOCK = 0x6D6F_6461_6C62

POSTGRESQL = 18
"""The oldest PostgreSQL that will do: the first with `uuidv7()`."""

_LINEAGE = re.compile(
    r'^revision = "(?P<revision>\w+)"\ndown_revision = (?:None|"(?P<parent>\w+)")$', re.MULTILINE
)

NO_SCHEMA = "the database has no modalbase schema yet; run `modalbase db upgrade`"
LAST_WITH_OLDER = "d06347ba43a860d58563e53df261d92fd34aa68a"
"""The commit of modalbase that still upgrades databases older than the first revision here."""


class SchemaError(Exception):
    """The database's schema is not the one that this version works with; the message says which
    command mends it.
    """


def current_revision(engine: Engine) -> str | None:
    """The revision that the database is at; None where it is empty.

    Raises:
        SchemaError: the server's PostgreSQL is too old.
    """
    with engine.connect() as connection:
        return _revision(_raw(connection))


def revision_at(url: str) -> str | None:
    """The revision of the database at an address for psycopg, on a connection of its own; None
    where it is empty.

    Raises:
        SchemaError: the server's PostgreSQL is too old.
        psycopg.OperationalError: the database does not answer.
    """
    with psycopg.connect(url, autocommit=True, connect_timeout=10) as connection:
        return _revision(connection)


def require_version(connection: Connection) -> None:
    """Refuse a server whose PostgreSQL lacks what the schema needs, such as `uuidv7()`.

    Raises:
        SchemaError: with its version and the one that is needed.
    """
    _require_new(_raw(connection))


def _require_new(connection: psycopg.Connection[Any]) -> None:
    version = connection.info.server_version
    if version < 10_000 * POSTGRESQL:
        running = f"{version // 10_000}.{version % 10_000}"
        raise SchemaError(
            f"the server runs PostgreSQL {running}, modalbase needs {POSTGRESQL} or newer; use such a"
            " server"
        )


def require_known(connection: Connection) -> str:
    """The revision of a database that this version can read.

    Raises:
        SchemaError: it has none, or one that this version does not know.
    """
    current = _revision(_raw(connection))
    if current is None:
        raise SchemaError(NO_SCHEMA)
    require_readable(current)
    return current


def require_readable(revision: str) -> None:
    """Refuse a revision that this version does not know.

    Raises:
        SchemaError: a newer version made it, or one whose steps are no longer here; with what to
            install.
    """
    parents = _parents()
    if revision in parents:
        return
    if revision > min(parents):
        reason = "a newer modalbase made; install that version or a later one"
    else:
        reason = (
            f"is older than {min(parents)}, the first that this version knows; bring it there with"
            f" modalbase of commit {LAST_WITH_OLDER} (`modalbase db upgrade`), then come back"
        )
    raise SchemaError(f"the schema is at {revision}, which {reason}")


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
        SchemaError: the schema is older, or newer, or missing; or the queue's library wants another
            one for its tables.
    """
    require_fit(current_revision(engine))


def require_fit(current: str | None) -> None:
    """Refuse to work on a schema at another revision than this version's; None is that of an empty
    database.

    Raises:
        SchemaError: as `require_head`.
    """
    if (unfit := procrastinate_schema.mismatch()) is not None:
        raise SchemaError(unfit)
    head = head_revision()
    if current == head:
        return
    if current is None:
        raise SchemaError(NO_SCHEMA)
    require_readable(current)
    raise SchemaError(
        f"the schema is at {current}, this version needs {head}; run `modalbase db upgrade`"
    )


def upgrade(engine: Engine, revision: str = "head") -> None:
    """Bring the schema to a revision, in one transaction; several processes may try at once.

    Raises:
        SchemaError: the server's PostgreSQL is too old, or this version does not know the schema.
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
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({MIGRATION_LOCK})")
        yield connection


def upgrade_on(connection: Connection, revision: str) -> None:
    """Bring the schema to a revision in the transaction of `upgrading`.

    Raises:
        SchemaError: this version does not know the schema that is there.
    """
    from alembic import command

    if (current := _revision(_raw(connection))) is not None:
        require_readable(current)
    command.upgrade(_config(connection), revision)


def _raw(connection: Connection) -> psycopg.Connection[Any]:
    return cast("psycopg.Connection[Any]", connection.connection.driver_connection)


def _revision(connection: psycopg.Connection[Any]) -> str | None:
    """The revision of a database whose server is new enough; None where it is empty."""
    _require_new(connection)
    if connection.execute("SELECT to_regclass('alembic_version')").fetchone() == (None,):
        return None
    row = connection.execute("SELECT version_num FROM alembic_version").fetchone()
    return None if row is None else str(row[0])


@cache
def _parents() -> dict[str, str | None]:
    """The revision before each that this version knows, as the migrations state them; None before
    the first.
    """
    files = Path(migrations.__file__).parent.joinpath("versions").glob("[0-9]*.py")
    return {
        match["revision"]: match["parent"]
        for file in files
        if (match := _LINEAGE.search(file.read_text(encoding="utf-8"))) is not None
    }


def _config(connection: Connection | None = None) -> Config:
    from alembic.config import Config

    config = Config()
    config.set_main_option(
        "script_location", str(Path(migrations.__file__).parent).replace("%", "%%")
    )
    config.set_main_option("path_separator", "os")
    if connection is not None:
        config.attributes["connection"] = connection
    return config
