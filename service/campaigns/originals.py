"""Uploaded files in the database: in chunks, under their SHA-256, each stored once however often it is uploaded."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.campaigns.bytea import copy_rows, stream_rows
from service.campaigns.tables import Original
from service.problems import ServiceError

CHUNK_BYTES = 1024 * 1024


class DamagedOriginalError(ServiceError):
    """The stored bytes of a file do not have the SHA-256 that they are stored under."""


@dataclass(frozen=True)
class Spooled:
    """A file on this machine's disk, hashed while it was written.

    Attributes:
        path: where it lies.
        size: bytes.
        sha256: digest of the bytes.
    """

    path: Path
    size: int
    sha256: bytes


def keep_original(session: Session, file: Spooled) -> None:
    """Store the file's bytes, unless they are stored already.

    A second upload of the same bytes at the same moment waits for the first one's commit here.
    """
    new = session.execute(
        insert(Original).values(sha256=file.sha256, size=file.size).on_conflict_do_nothing().returning(Original.sha256)
    ).one_or_none()
    if new is None:
        return
    columns = {"sha256": "bytea", "number": "int4", "data": "bytea"}
    with file.path.open("rb") as stream, copy_rows(session, "original_chunks", columns) as write:
        for number, data in enumerate(iter(lambda: stream.read(CHUNK_BYTES), b"")):
            write((file.sha256, number, data))


def original_chunks(session: Session, sha256: bytes) -> Iterator[bytes]:
    """The bytes of a stored file, chunk by chunk; until the last one is taken, the session can do nothing else."""
    query = "SELECT data FROM original_chunks WHERE sha256 = %s ORDER BY number"
    for (data,) in stream_rows(session, query, [sha256], ["bytea"]):
        yield data


def write_original(session: Session, sha256: bytes, path: Path) -> None:
    """Write a stored file to disk.

    Raises:
        DamagedOriginalError: what was stored is not what was uploaded.
    """
    with path.open("wb") as file:
        copy_original(session, sha256, file)


def copy_original(session: Session, sha256: bytes, file: IO[bytes]) -> None:
    """Copy a stored file into an open one.

    Raises:
        DamagedOriginalError: what was stored is not what was uploaded.
    """
    digest = hashlib.sha256()
    for chunk in original_chunks(session, sha256):
        digest.update(chunk)
        file.write(chunk)
    if digest.digest() != sha256:
        raise DamagedOriginalError(f"the stored file {sha256.hex()} fails its checksum; restore it from a backup")
