"""Writing a backup, beside a service that runs: one read-only transaction sees one moment of the database."""

from __future__ import annotations

import hashlib
import os
from datetime import UTC
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

from psycopg import sql
from sqlalchemy import Connection, Engine, MetaData, Table, func, select

from fecore import __version__
from service.app.backup.archive import FORMAT, MANIFEST, BackupError, Manifest, TableEntry
from service.app.backup.reading_back import read_back
from service.app.backup.verification import find_damage
from service.db.schema import require_known

COMPRESSION = 1  # spectra hardly shrink, files of text do


def write_backup(engine: Engine, file: Path) -> Manifest:
    """Write everything to a file that must not exist yet, and read it back; it is there whole, or not at all.

    Args:
        engine: on the database, at this version's schema or an earlier one.
        file: the backup; readable for its owner alone, as it holds the keys' digests.

    Returns:
        What was written. `damaged` names what the database itself holds damaged: the backup has it as it is.

    Raises:
        BackupError: the file exists, cannot be written or is not read back as it was written.
        SchemaError: the schema is unknown to this version.
    """
    if file.exists():
        raise BackupError(f"{file} exists; a backup overwrites nothing")
    partial = file.with_name(f"{file.name}.part")
    try:
        with engine.connect().execution_options(isolation_level="REPEATABLE READ") as connection:
            connection.exec_driver_sql("SET TRANSACTION READ ONLY")
            manifest = _write(connection, require_known(connection), partial)
        read_back(partial, manifest)
        partial.rename(file)
    except OSError as error:
        raise BackupError(f"cannot write {file}: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
    return manifest


def our_tables(connection: Connection) -> list[Table]:
    """Our tables as they are in the database, parents first; without the queue's and the revision's."""
    metadata = MetaData()
    metadata.reflect(
        connection, only=lambda name, _: not name.startswith("procrastinate_") and name != "alembic_version"
    )
    return metadata.sorted_tables


def _write(connection: Connection, revision: str, file: Path) -> Manifest:
    moment = connection.scalars(select(func.now())).one().astimezone(UTC).isoformat()
    damaged = find_damage(connection)
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as stream:
        with ZipFile(stream, "w", ZIP_DEFLATED, compresslevel=COMPRESSION) as archive:
            tables = [_copy_out(connection, table, archive) for table in our_tables(connection)]
            manifest = Manifest(FORMAT, __version__, revision, moment, tables, damaged)
            archive.writestr(MANIFEST, manifest.to_json())
        stream.flush()
        os.fsync(stream.fileno())
    return manifest


def _copy_out(connection: Connection, table: Table, archive: ZipFile) -> TableEntry:
    columns = [column.name for column in table.columns if column.computed is None]
    digest = hashlib.sha256()
    cursor: Any = connection.connection.cursor()
    query = sql.SQL("COPY {} ({}) TO STDOUT (FORMAT binary)")
    with cursor, archive.open(f"tables/{table.name}", "w", force_zip64=True) as member:
        with cursor.copy(query.format(sql.Identifier(table.name), _list(columns))) as copy:
            for block in copy:
                digest.update(block)
                member.write(block)
        rows = cursor.rowcount
    return TableEntry(table.name, columns, rows, digest.hexdigest())


def _list(columns: list[str]) -> sql.Composed:
    return sql.SQL(", ").join(map(sql.Identifier, columns))
