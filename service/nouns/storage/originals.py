"""Uploaded files in the database: in chunks, under their SHA-256, each stored once however often it
is uploaded.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, TYPE_CHECKING

from sqlalchemy import Column, ForeignKey, LargeBinary, delete, func, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.platform.db.base import Base, Big
from service.platform.db.bytea import copy_rows, stream_rows
from service.platform.errors import Damaged

if TYPE_CHECKING:
    from service.platform.web.uploads import Spooled


class Original(Base):
    """An uploaded file under its SHA-256; its bytes are in `original_chunks`."""

    __tablename__ = "originals"

    sha256: Mapped[bytes] = mapped_column(primary_key=True)
    size: Mapped[Big]
    created_at: Mapped[datetime] = mapped_column(server_default=func.now())
    bytes_deleted_at: Mapped[datetime | None]  # by retention rules; the chunks are gone then


class OriginalChunk(Base):
    """A stretch of an uploaded file, of a size that fills a page: the table's `toast_tuple_target`
    keeps it there.
    """

    __tablename__ = "original_chunks"

    sha256: Mapped[bytes] = mapped_column(
        ForeignKey("originals.sha256", ondelete="CASCADE"), primary_key=True
    )
    number: Mapped[int] = mapped_column(primary_key=True)
    data: Mapped[bytes] = mapped_column(LargeBinary)


CHUNK_BYTES = 8092
"""A row with a chunk of this size just fills a page, so that it is stored there at once; PostgreSQL
would cut a larger one into pieces of 2 kB, each with an entry in an index and a record in the log
of its own.
"""
READ_BYTES = 1024 * 1024

# As many chunks at a time as make READ_BYTES; those of earlier versions are of 1 MiB.
_READ = """
    SELECT coalesce((
      SELECT string_agg(data, '' ORDER BY number) FROM original_chunks
      WHERE sha256 = file.sha256 AND number >= start AND number < start + step
    ), '')
    FROM (
      SELECT sha256, greatest(1, %s / greatest(1, length(data))) AS step FROM original_chunks WHERE sha256 = %s AND number = 0
    ) file
    CROSS JOIN LATERAL generate_series(0, (SELECT max(number) FROM original_chunks o WHERE o.sha256 = file.sha256), step) start
"""


def keep_original(session: Session, file: Spooled) -> None:
    """Store the file's bytes in chunks under their SHA-256, unless they are stored already and were
    not deleted since.

    A second upload of the same bytes at the same moment waits for the first one's commit here.

    """
    new = session.execute(
        insert(Original)
        .values(sha256=file.sha256, size=file.size)
        .on_conflict_do_update(
            index_elements=[Original.sha256],
            set_={"bytes_deleted_at": None},
            where=Original.bytes_deleted_at.is_not(None),
        )
        .returning(Original.sha256)
    ).one_or_none()
    if new is None:
        return
    with file.path.open("rb") as stream, copy_rows(session, OriginalChunk) as write:
        for number, data in enumerate(iter(lambda: stream.read(CHUNK_BYTES), b"")):
            write((file.sha256, number, data))


def original_chunks(session: Session, sha256: bytes) -> Iterator[bytes]:
    """The bytes of a stored file, block by block, without verifying them; until the last one is
    taken, the session can do nothing else.

    `copy_original` verifies what it copies.
    """
    for (data,) in stream_rows(session, _READ, [READ_BYTES, sha256], ["bytea"]):
        yield data


def write_original(session: Session, sha256: bytes, path: Path) -> None:
    """Write a stored file to disk.

    Args:
        session: the transaction.
        sha256: of the file, 32 bytes.
        path: where to; a file that is there is replaced.

    Raises:
        Damaged: what was stored is not what was uploaded.
    """
    with path.open("wb") as file:
        copy_original(session, sha256, file)


def copy_original(session: Session, sha256: bytes, file: IO[bytes]) -> None:
    """Copy a stored file into an open one, block by block, and verify its SHA-256 at the end.

    Args:
        session: the transaction.
        sha256: of the file, 32 bytes.
        file: open for writing bytes.

    Raises:
        Damaged: what was stored is not what was uploaded; what was written must not be used.
    """
    digest = hashlib.sha256()
    for chunk in original_chunks(session, sha256):
        digest.update(chunk)
        file.write(chunk)
    if digest.digest() != sha256:
        raise Damaged("file", sha256)


def original_sizes(session: Session, keys: Iterable[bytes]) -> dict[bytes, int]:
    """Bytes of stored files, by their SHA-256."""
    query = select(Original.sha256, Original.size).where(Original.sha256.in_(set(keys)))
    return {row.sha256: row.size for row in session.execute(query)}


def forget_originals(session: Session) -> None:
    """Remove the stored files to which no table refers any more."""
    kept = (select(column) for column in _references())
    session.execute(delete(Original).where(*(Original.sha256.not_in(named) for named in kept)))


def delete_unused_bytes(session: Session, keys: Iterable[bytes], now: datetime) -> None:
    """Delete the bytes of stored files that nothing needs any more: each import of them has lost
    them to a retention rule, and they are no model and no attachment. The files' rows stay.
    """
    # who stores one of them at this moment is waited for, so that its row is seen below
    held = select(Original.sha256).where(Original.sha256.in_(set(keys))).order_by(Original.sha256)
    mine = session.scalars(held.with_for_update()).all()
    for column in _references():
        deleted_at = column.table.c.get("bytes_deleted_at")
        needed = select(column).where(column.in_(mine))
        if deleted_at is not None:
            needed = needed.where(deleted_at.is_(None))
        mine = sorted(set(mine) - set(session.scalars(needed)))
    session.execute(update(Original).where(Original.sha256.in_(mine)).values(bytes_deleted_at=now))
    session.execute(delete(OriginalChunk).where(OriginalChunk.sha256.in_(mine)))


def _references() -> Iterator[Column[bytes]]:
    """The columns that refer to stored files, but for those of their chunks."""
    for table in Base.metadata.tables.values():
        for column in table.c:
            names = (key.target_fullname for key in column.foreign_keys)
            if "originals.sha256" in names and table.name != "original_chunks":
                yield column
