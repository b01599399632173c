"""Proof of a backup that was written: the file is read back whole, and holds every row and byte that it should."""

from __future__ import annotations

import hashlib
import io
import os
import struct
import sys
import zlib
from pathlib import Path
from typing import IO, Any
from zipfile import BadZipFile, ZipFile

from service.app.backup.archive import BLOCK_BYTES, BackupError, Manifest, TableEntry, read_manifest

UNREADABLE = (BadZipFile, EOFError, KeyError, NotImplementedError, RuntimeError, ValueError, struct.error, zlib.error)
"""What `zipfile` raises at files that are damaged in one place or another."""

_PREFIX = struct.Struct("!11sii")  # of PostgreSQL's binary COPY: its signature, flags, and the length of an extension
_SIGNATURE = b"PGCOPY\n\xff\r\n\0"
_END = -1  # in place of a row's number of fields


def read_back(file: Path, manifest: Manifest) -> None:
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
                    _compare(entry, archive)
    except (*UNREADABLE, BackupError) as error:
        raise BackupError(f"the backup was written and cannot be read back; is the disk sound? {error}") from error


def _compare(entry: TableEntry, archive: ZipFile) -> None:
    with archive.open(entry.member) as member:
        digested = _Digested(member)
        rows = _count_rows(io.BufferedReader(digested, BLOCK_BYTES))
    _require((digested.digest.hexdigest(), rows) == (entry.sha256, entry.rows), f"table {entry.name}")


def _require(same: bool, what: str) -> None:
    if not same:
        raise BackupError(f"its {what} is not what was written")


class _Digested(io.RawIOBase):
    """A stream whose bytes are digested as they are read."""

    def __init__(self, source: IO[bytes]) -> None:
        self._source, self.digest = source, hashlib.sha256()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        block = self._source.read(len(buffer))
        self.digest.update(block)
        buffer[: len(block)] = block
        return len(block)


def _count_rows(stream: io.BufferedReader) -> int:
    """Rows of PostgreSQL's binary COPY, read to its end: a number of fields, then each field's length and bytes."""
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
