"""Is the database's schema this version's? And how to bring it there."""

from __future__ import annotations

from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine, text

import migrations

MIGRATION_LOCK = 0x6D6F_6461_6C62  # an advisory lock of our own: two upgrades at once wait for each other


class SchemaError(Exception):
    """The database's schema is not the one that this version works with; the message says which command mends it."""


def current_revision(engine: Engine) -> str | None:
    """The revision that the database is at; None where it is empty."""
    with engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def head_revision() -> str:
    """The revision that this version works with."""
    head = ScriptDirectory.from_config(_config()).get_current_head()
    if head is None:
        raise SchemaError("this installation holds no migrations; install modalbase again")
    return head


def require_head(engine: Engine) -> None:
    """Refuse to work on another schema than this version's.

    Raises:
        SchemaError: the schema is older, or newer, or missing.
    """
    current, head = current_revision(engine), head_revision()
    if current == head:
        return
    if current is None:
        raise SchemaError("the database has no modalbase schema yet; run `modalbase db upgrade`")
    known = {script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()}
    if current in known:
        raise SchemaError(f"the schema is at {current}, this version needs {head}; run `modalbase db upgrade`")
    raise SchemaError(f"the schema is at {current}, which a newer modalbase made; install that version or a later one")


def upgrade(engine: Engine, revision: str = "head") -> None:
    """Bring the schema to a revision, in one transaction; several processes may try at once."""
    with engine.begin() as connection:
        connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": MIGRATION_LOCK})
        command.upgrade(_config(connection), revision)


def _config(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    if connection is not None:
        config.attributes["connection"] = connection
    return config
