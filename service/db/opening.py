"""The database that the settings mean: a server of one's own, or the embedded one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from service.db.embedded import embedded_server
from service.db.engine import make_engine
from service.db.schema import current_revision, upgrade
from service.settings import Settings


@contextmanager
def open_database(settings: Settings, *, migrate_embedded: bool = False) -> Iterator[Settings]:
    """Settings whose `database_url` answers while the block runs.

    Args:
        settings: as the operator gave them.
        migrate_embedded: bring the embedded database's schema to this version's; a new one always is. A server of
            one's own is never migrated here: that is `modalbase db upgrade`'s.
    """
    if settings.database_url is not None:
        yield settings
        return
    with embedded_server(settings.data) as url:
        engine = make_engine(url)
        try:
            if migrate_embedded or current_revision(engine) is None:
                upgrade(engine)
        finally:
            engine.dispose()
        yield settings.model_copy(update={"database_url": url})
