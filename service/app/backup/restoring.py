"""Restoring a backup into an empty database, all in one transaction: what fails leaves nothing."""

import hashlib
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import psycopg
from psycopg import sql
from sqlalchemy import Connection, Engine, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from service.app.backup.archive import (
    BLOCK_BYTES,
    MANIFEST,
    UNREADABLE,
    BackupError,
    Manifest,
    More,
    TableEntry,
    Watch,
    counted,
    names,
    our_tables,
    read_manifest,
)
from service.app.backup.verification import find_damage, first_line
from service.platform.db.schema import SchemaError, require_readable, upgrade_on, upgrading
from service.platform.queue.queue import queue_again


def restore_backup(engine: Engine, file: Path, watch: Watch | None = None) -> Manifest:
    """Fill an empty database from a backup, bring its schema to this version's, and check every
    stored SHA-256.

    Jobs that waited or ran when the backup was made wait again.

    Args:
        engine: on a database without rows; a schema without rows is replaced.
        file: what `write_backup` wrote, also with an earlier version of modalbase.
        watch: is shown how far it is.

    Raises:
        BackupError: the database is not empty, or the file is no backup, incomplete, damaged, or
            of a schema that this version does not know.
    """
    try:
        with file.open("rb") as stream, ZipFile(stream) as archive:
            manifest = read_manifest(file, archive)
            try:
                require_readable(manifest.revision)
            except SchemaError as error:
                raise BackupError(f"{file} is of modalbase {manifest.software}: {error}") from error
            with upgrading(engine) as connection:
                more = counted(
                    watch,
                    sum(one.file_size for one in archive.infolist() if one.filename != MANIFEST),
                )
                _restore(connection, manifest, archive, more)
    except UNREADABLE as error:
        raise BackupError(f"{file} is no backup of modalbase, or is damaged: {error}") from error
    except OSError as error:
        raise BackupError(f"cannot read {file}: {error.strerror or error}") from error
    except DBAPIError as error:
        raise BackupError(f"the database does not take the backup: {first_line(error)}") from error
    return manifest


def _restore(connection: Connection, manifest: Manifest, archive: ZipFile, more: More) -> None:
    _clear(connection)
    upgrade_on(connection, manifest.revision)
    tables = our_tables(connection)
    entries = {entry.name: entry for entry in manifest.tables}
    if entries.keys() != {table.name for table in tables}:
        raise BackupError("the backup's tables are not those of its schema; the file is damaged")
    for table in tables:
        _copy_in(connection, entries[table.name], archive, more)
    upgrade_on(connection, "head")
    connection.execute(text("ANALYZE"))
    damaged = [name for name in find_damage(connection) if name not in manifest.damaged]
    if damaged:
        raise BackupError(f"{len(damaged)} of the restored data are damaged, first {damaged[0]}")
    with Session(connection, join_transaction_mode="create_savepoint") as session:
        queue_again(session)
        session.commit()


def _clear(connection: Connection) -> None:
    """Drop a schema of ours that holds no rows; refuse any other database that is not empty."""
    tables = our_tables(connection)
    for table in tables:
        if connection.scalar(text(f'SELECT EXISTS (SELECT FROM "{table.name}")')):
            raise BackupError(
                f"the database is not empty: {table.name} has rows; restore into an empty database"
                " or folder"
            )
    ours = connection.scalar(text("SELECT to_regclass('alembic_version') IS NOT NULL"))
    if tables and not ours:
        raise BackupError(
            f"the database is not empty: it has a table {tables[0].name}; restore into an empty"
            " database"
        )
    if ours:
        for statement in connection.scalars(text(_DROP_ALL)).all():
            connection.exec_driver_sql(statement)


_DROP_ALL = """
WITH others AS (SELECT objid FROM pg_depend WHERE deptype = 'e')
SELECT format('DROP TABLE IF EXISTS %s CASCADE', oid::regclass) FROM pg_class
  WHERE relnamespace = current_schema()::regnamespace AND relkind IN ('r', 'p') AND oid NOT IN (TABLE others)
UNION ALL
SELECT format('DROP ROUTINE IF EXISTS %s CASCADE', oid::regprocedure) FROM pg_proc
  WHERE pronamespace = current_schema()::regnamespace AND oid NOT IN (TABLE others)
UNION ALL
SELECT format('DROP TYPE IF EXISTS %s CASCADE', oid::regtype) FROM pg_type
  WHERE typnamespace = current_schema()::regnamespace AND oid NOT IN (TABLE others)
    AND (typtype IN ('e', 'd') OR typrelid IN (SELECT oid FROM pg_class WHERE relkind = 'c'))
"""


def _copy_in(connection: Connection, entry: TableEntry, archive: ZipFile, more: More) -> None:
    digest = hashlib.sha256()
    cursor: Any = connection.connection.cursor()
    query = sql.SQL("COPY {} ({}) FROM STDIN (FORMAT binary)").format(
        sql.Identifier(entry.name), names(entry.columns)
    )
    with cursor, archive.open(entry.member) as member:
        try:
            with cursor.copy(query) as copy:
                while block := member.read(BLOCK_BYTES):
                    digest.update(block)
                    copy.write(block)
                    more(len(block))
        # such as one that was cut short
        except (psycopg.DataError, psycopg.IntegrityError) as error:
            raise BackupError(
                f"the backup's table {entry.name} is damaged: {first_line(error)}"
            ) from error
        rows = cursor.rowcount
    if (digest.hexdigest(), rows) != (entry.sha256, entry.rows):
        raise BackupError(f"the backup's table {entry.name} is damaged: it is not what was written")
