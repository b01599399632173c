"""The database that the settings mean: a server of one's own, or the embedded one."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from service.db.embedded import embedded_server
from service.db.engine import make_engine
from service.db.schema import current_revision, upgrade
from service.settings import Settings


class DataFolderError(Exception):
    """The embedded database does not start in its data folder."""


@contextmanager
def open_database(settings: Settings, *, migrate_embedded: bool = False) -> Iterator[Settings]:
    """Settings whose `database_url` answers while the block runs.

    Args:
        settings: as the operator gave them.
        migrate_embedded: bring the embedded database's schema to this version's; a new one always is. A server of
            one's own is never migrated here: that is `modalbase db upgrade`'s.

    Raises:
        DataFolderError: the folder cannot be made or written, the disk is full, or PostgreSQL does not start there.
    """
    if settings.database_url is not None:
        yield settings
        return
    with ExitStack() as stack:
        try:
            url = stack.enter_context(embedded_server(settings.data))
        except OSError as error:
            raise DataFolderError(f"cannot use the data folder {settings.data}: {error.strerror or error}") from error
        except subprocess.SubprocessError as error:
            reason = "the lines above say why" if isinstance(error, subprocess.CalledProcessError) else str(error)
            raise DataFolderError(f"PostgreSQL does not start in {settings.data}: {reason}") from error
        engine = make_engine(url)
        try:
            if migrate_embedded or current_revision(engine) is None:
                upgrade(engine)
        finally:
            engine.dispose()
        yield settings.model_copy(update={"database_url": url})
