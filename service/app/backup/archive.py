"""The backup file: a zip with each table as PostgreSQL's binary COPY writes it, and a manifest that
describes them.

Binary COPY keeps every value bit for bit. The queue's own tables are left out: their rows are made
anew from the jobs. A backup is written beside a service that runs, as one read-only transaction
sees one moment of the database, and read back whole.
"""

import hashlib
import io
import os
import struct
import sys
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC
from json import JSONDecodeError, dumps, loads
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile

from psycopg import sql
from sqlalchemy import Connection, Engine, MetaData, Table, func, select, text

from fecore import __version__
from service.app.backup.verification import find_damage
from service.platform.db.schema import require_known

MANIFEST = "manifest.json"
FORMAT = 1
BLOCK_BYTES = 1024 * 1024
COMPRESSION = 1  # spectra hardly shrink, files of text do
UNREADABLE = (
    BadZipFile,
    EOFError,
    KeyError,
    NotImplementedError,
    RuntimeError,
    ValueError,
    struct.error,
    zlib.error,
)
"""What `zipfile` raises at files that are damaged in one place or another."""

# of PostgreSQL's binary COPY: its signature, flags, and the length of an extension
_PREFIX = struct.Struct("!11sii")
_SIGNATURE = b"PGCOPY\n\xff\r\n\0"
_END = -1  # in place of a row's number of fields


class BackupError(Exception):
    """A backup cannot be written, read or restored; the message says why, and nothing has
    changed.
    """


@dataclass(frozen=True)
class TableEntry:
    """A table in the file."""

    name: str  # of the table
    columns: list[str]  # in the order of the copied rows
    rows: int  # how many
    sha256: str  # of the copied bytes, hexadecimal

    @property
    def member(self) -> str:
        """Its name in the zip."""
        return f"tables/{self.name}"


@dataclass(frozen=True)
class Manifest:
    """What a backup holds."""

    format: int  # of the file
    software: str  # version of modalbase that wrote it
    revision: str  # of the schema
    created_at: str  # moment that the backup shows, ISO 8601
    tables: list[TableEntry]  # what is in it, parents first
    # what was damaged in the database already, as `service.app.backup.verification` names it
    damaged: list[str]

    def to_json(self) -> str:
        """The manifest's text."""
        return dumps(asdict(self), indent=1)


def read_manifest(file: Path, archive: ZipFile) -> Manifest:
    """The manifest of an open backup.

    Raises:
        BackupError: it is no backup of ours, or one of a later format.
    """
    try:
        content = loads(archive.read(MANIFEST))
        if content["format"] != FORMAT:
            raise BackupError(
                f"{file} is a backup of format {content['format']}; install a newer modalbase"
            )
        return Manifest(
            **content | {"tables": [TableEntry(**table) for table in content["tables"]]}
        )
    except (KeyError, TypeError, JSONDecodeError, UnicodeDecodeError, BadZipFile) as error:
        raise BackupError(f"{file} is no backup of modalbase, or is damaged: {error}") from error


Watch = Callable[[int, int], object]
"""Is called with the bytes that are done and those that there are, which is about right until the
end.
"""
More = Callable[[int], None]  # is called with the bytes that were done since the last time


def counted(watch: Watch | None, total: int) -> More:
    """What counts bytes for a watcher, who is shown each thousandth; nothing where there is
    none.
    """
    done, shown = 0, 0

    def more(size: int) -> None:
        nonlocal done, shown
        done += size
        if watch is not None and done - shown >= total / 1000:
            shown = done
            watch(done, max(done, total))

    return more


def write_backup(engine: Engine, file: Path, watch: Watch | None = None) -> Manifest:
    """Write everything to a file that must not exist yet, and read it back; it is there whole, or
    not at all.

    Args:
        engine: on the database, at this version's schema or an earlier one.
        file: the backup; readable for its owner alone, as it holds the keys' digests.
        watch: is shown how far it is: all tables are written, then read back.

    Returns:
        What was written. `damaged` names what the database itself holds damaged: the backup has it
        as it is.

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
            more = counted(watch, 2 * _size(connection) if watch else 0)
            manifest = _write(connection, require_known(connection), partial, more)
        read_back(partial, manifest, more)
        partial.rename(file)
    except OSError as error:
        raise BackupError(f"cannot write {file}: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
    return manifest


# tables that an upgrade, or a trigger of others, fills
_DERIVED = ("alembic_version", "instrument_uses")


def our_tables(connection: Connection) -> list[Table]:
    """Our tables as they are in the database, parents first; without the queue's and those that are
    filled from others.
    """
    metadata = MetaData()
    metadata.reflect(
        connection,
        only=lambda name, _: not name.startswith("procrastinate_") and name not in _DERIVED,
    )
    return metadata.sorted_tables


def _size(connection: Connection) -> int:
    """Bytes of all tables."""
    query = text(
        "SELECT sum(pg_table_size(name::regclass)) FROM unnest(CAST(:names AS text[])) AS name"
    )
    return int(
        connection.scalar(query, {"names": [table.name for table in our_tables(connection)]}) or 0
    )


def _write(connection: Connection, revision: str, file: Path, more: More) -> Manifest:
    moment = connection.scalars(select(func.now())).one().astimezone(UTC).isoformat()
    damaged = find_damage(connection)
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as stream:
        with ZipFile(stream, "w", ZIP_DEFLATED, compresslevel=COMPRESSION) as archive:
            tables = [
                _copy_out(connection, table, archive, more) for table in our_tables(connection)
            ]
            manifest = Manifest(FORMAT, __version__, revision, moment, tables, damaged)
            archive.writestr(MANIFEST, manifest.to_json())
        stream.flush()
        os.fsync(stream.fileno())
    return manifest


def _copy_out(connection: Connection, table: Table, archive: ZipFile, more: More) -> TableEntry:
    columns = [column.name for column in table.columns if column.computed is None]
    digest = hashlib.sha256()
    cursor: Any = connection.connection.cursor()
    query = sql.SQL("COPY {} ({}) TO STDOUT (FORMAT binary)")
    with cursor, archive.open(f"tables/{table.name}", "w", force_zip64=True) as member:
        with cursor.copy(query.format(sql.Identifier(table.name), names(columns))) as copy:
            for block in copy:
                digest.update(block)
                member.write(block)
                more(len(block))
        rows = cursor.rowcount
    return TableEntry(table.name, columns, rows, digest.hexdigest())


def names(columns: list[str]) -> sql.Composed:
    """Names of columns, quoted, as COPY lists them."""
    return sql.SQL(", ").join(map(sql.Identifier, columns))


def read_back(file: Path, manifest: Manifest, more: More = lambda _: None) -> None:
    """Read a backup as a restore would, and compare it with what was written.

    Raises:
        BackupError: a table's bytes or rows, or the manifest, are not what was written.
        OSError: the file cannot be read.
    """
    try:
        with file.open("rb") as stream:
            if sys.platform == "linux":  # from the disk, not from memory
                os.posix_fadvise(stream.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
            with ZipFile(stream) as archive:
                _require(read_manifest(file, archive) == manifest, "manifest")
                for entry in manifest.tables:
                    _compare(entry, archive, more)
    except (*UNREADABLE, BackupError) as error:
        raise BackupError(
            f"the backup was written and cannot be read back; is the disk sound? {error}"
        ) from error


def _compare(entry: TableEntry, archive: ZipFile, more: More) -> None:
    with archive.open(entry.member) as member:
        digested = _Digested(member, more)
        rows = _count_rows(io.BufferedReader(digested, BLOCK_BYTES))
    _require(
        (digested.digest.hexdigest(), rows) == (entry.sha256, entry.rows), f"table {entry.name}"
    )


def _require(same: bool, what: str) -> None:
    if not same:
        raise BackupError(f"its {what} is not what was written")


class _Digested(io.RawIOBase):
    """A stream whose bytes are digested and counted as they are read."""

    def __init__(self, source: IO[bytes], more: More) -> None:
        self._source, self._more, self.digest = source, more, hashlib.sha256()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        block = self._source.read(len(buffer))
        self.digest.update(block)
        self._more(len(block))
        buffer[: len(block)] = block
        return len(block)


def _count_rows(stream: io.BufferedReader) -> int:
    """Rows of PostgreSQL's binary COPY, read to its end: a number of fields, then each field's
    length and bytes.
    """
    signature, _, extension = _PREFIX.unpack(stream.read(_PREFIX.size))
    if signature != _SIGNATURE:
        raise ValueError("a table has no rows in PostgreSQL's binary format")
    stream.read(extension)
    rows = 0
    while (fields := int.from_bytes(stream.read(2), signed=True)) != _END:
        if fields < 1:
            raise EOFError("a table is cut short")
        for _ in range(fields):
            stream.read(max(0, int.from_bytes(stream.read(4), signed=True)))  # −1 of NULL
        rows += 1
    if stream.read(1):
        raise ValueError("a table goes on after its end")
    return rows
