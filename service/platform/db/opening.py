"""The database that the settings mean: a server of one's own, or the embedded PostgreSQL, a real
server in a folder that every process which opens the folder shares.

The first process that opens a folder starts the server, the last one that leaves stops it. Who is
in is known by shared locks on a file, which the operating system drops when a process dies, however
it dies.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import psycopg
from fasteners import InterProcessLock, InterProcessReaderWriterLock

from service.platform.db.postgres import Cluster, PostgresError
from service.platform.db.schema import head_revision, revision_at, upgrade
from service.platform.settings import Settings

if TYPE_CHECKING:
    from sqlalchemy import Engine


class DataFolderError(Exception):
    """The embedded database does not start in its data folder."""


@contextmanager
def open_database(
    settings: Settings, *, migrate_embedded: bool = False, migrate_new: bool = True
) -> Iterator[Settings]:
    """Settings whose `database_url` answers while the block runs.

    Args:
        settings: as the operator gave them.
        migrate_embedded: bring the embedded database's schema to this version's. A server of one's
            own is never
            migrated here: that is `modalbase db upgrade`'s.
        migrate_new: give a new embedded database its schema.

    Raises:
        DataFolderError: the folder cannot be made or written, the disk is full, or PostgreSQL does
            not start there.
    """
    if settings.database_url is not None:
        yield settings
        return
    if os.name == "nt":
        raise DataFolderError(
            "the embedded PostgreSQL does not run on Windows; use WSL, or name a server in"
            " MODALBASE_DATABASE_URL"
        )
    with ExitStack() as stack:
        try:
            url = stack.enter_context(embedded_server(settings.data))
        except OSError as error:
            raise DataFolderError(
                f"cannot use the data folder {settings.data}: {error.strerror or error}"
            ) from error
        except PostgresError as error:
            raise DataFolderError(
                f"PostgreSQL does not start in {settings.data}: {error}"
            ) from error
        current = revision_at(url)
        if (migrate_embedded and current != head_revision()) or (migrate_new and current is None):
            _upgrade(url)
        yield settings.model_copy(update={"database_url": url})


@contextmanager
def opened_engine(settings: Settings, *, migrate_new: bool = True) -> Iterator[Engine]:
    """An engine on the database that the settings mean, while the block runs; see
    `open_database`.
    """
    from service.platform.db.engine import make_engine

    with open_database(settings, migrate_new=migrate_new) as opened:
        engine = make_engine(opened.database_url or "")
        try:
            yield engine
        finally:
            engine.dispose()


def _upgrade(url: str) -> None:
    # takes longer to load than to ask whether it is needed
    from service.platform.db.engine import make_engine

    engine = make_engine(url)
    try:
        upgrade(engine)
    finally:
        engine.dispose()


DATABASE = "modalbase"


@contextmanager
def embedded_server(folder: Path) -> Iterator[str]:
    """Be in on the server of a data folder while the block runs.

    Args:
        folder: the data folder; made when absent, for its user alone. The server's files are in
            `postgres` below it.

    Yields:
        URL of the database `modalbase`, which is made when absent.

    Raises:
        PostgresError: the server cannot be set up or started.
    """
    folder = folder.expanduser().resolve()
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    lock = InterProcessLock(folder / ".starting")  # held while the server is started or stopped
    inside = InterProcessReaderWriterLock(folder / ".in-use")
    cluster = Cluster(folder / "postgres")
    with lock:
        inside.acquire_read_lock()
    try:
        with lock:
            cluster.initialise()
            if not cluster.runs():
                cluster.start()
            url = _database(cluster)
        yield url
    finally:
        with lock:
            inside.release_read_lock()
            if inside.acquire_write_lock(blocking=False):  # nobody else is in
                cluster.stop()
                inside.release_write_lock()
            else:
                inside.lockfile.close()  # the library leaves it open where it did not get the lock


def runs(folder: Path) -> bool:
    """Whether the server of a folder runs."""
    return Cluster(folder.expanduser().resolve() / "postgres").runs()


def keep_running(folder: Path) -> bool:
    """Start the server of a folder that one is in on again, where it died by itself. Whether it
    had.

    Raises:
        PostgresError: it does not start, for one because the last of its processes are still dying.
    """
    folder = folder.expanduser().resolve()
    cluster = Cluster(folder / "postgres")
    if cluster.runs():
        return False
    with InterProcessLock(folder / ".starting"):
        if cluster.runs():  # another who is in was first
            return False
        cluster.start()
    return True


def _database(cluster: Cluster) -> str:
    """URL of our database on the server, made when absent; text sorts alike on every machine."""
    with psycopg.connect(cluster.url("postgres"), autocommit=True) as connection:
        there = connection.execute(
            "SELECT 1 FROM pg_database WHERE datname = %s", [DATABASE]
        ).fetchone()
        if there is None:
            connection.execute(
                "CREATE DATABASE modalbase TEMPLATE template0 ENCODING 'UTF8'"
                " LOCALE_PROVIDER builtin BUILTIN_LOCALE 'C.UTF-8'"
            )
    return cluster.url(DATABASE)
