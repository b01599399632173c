"""The database that the settings mean: a server of one's own, or the embedded one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from service.db.embedded import embedded_server
from service.db.postgres import PostgresError
from service.db.schema import head_revision, revision_at, upgrade
from service.settings import Settings


class DataFolderError(Exception):
    """The embedded database does not start in its data folder."""


@contextmanager
def open_database(
    settings: Settings, *, migrate_embedded: bool = False, migrate_new: bool = True
) -> Iterator[Settings]:
    """Settings whose `database_url` answers while the block runs.

    Args:
        settings: as the operator gave them.
        migrate_embedded: bring the embedded database's schema to this version's. A server of one's own is never
            migrated here: that is `modalbase db upgrade`'s.
        migrate_new: give a new embedded database its schema.

    Raises:
        DataFolderError: the folder cannot be made or written, the disk is full, or PostgreSQL does not start there.
    """
    if settings.database_url is not None:
        yield settings
        return
    if os.name == "nt":
        raise DataFolderError(
            "the embedded PostgreSQL does not run on Windows; use WSL, or name a server in MODALBASE_DATABASE_URL"
        )
    with ExitStack() as stack:
        try:
            url = stack.enter_context(embedded_server(settings.data))
        except OSError as error:
            raise DataFolderError(f"cannot use the data folder {settings.data}: {error.strerror or error}") from error
        except PostgresError as error:
            raise DataFolderError(f"PostgreSQL does not start in {settings.data}: {error}") from error
        current = revision_at(url)
        if (migrate_embedded and current != head_revision()) or (migrate_new and current is None):
            _upgrade(url)
        yield settings.model_copy(update={"database_url": url})


def _upgrade(url: str) -> None:
    from service.db.engine import make_engine  # takes longer to load than to ask whether it is needed

    engine = make_engine(url)
    try:
        upgrade(engine)
    finally:
        engine.dispose()
