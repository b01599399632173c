"""The check of everything that is stored under a SHA-256: spectra, coherences, curves, models and
original files.
"""

import hashlib
from collections.abc import Iterator
from itertools import groupby
from operator import itemgetter
from typing import Any

from sqlalchemy import Connection, inspect, text
from sqlalchemy.exc import DBAPIError

CHECKED = (
    ("frfs", "id", "data", "sha256"),
    ("frfs", "id", "coherence", "coherence_sha256"),
    ("frfs", "id", "variance", "variance_sha256"),
    ("frfs", "id", "growth", "growth_sha256"),
    ("records", "id", "data", "sha256"),
    ("half_spectra", "recording_id", "data", "sha256"),
    ("coupon_curves", "coupon_id", "data", "sha256"),
    ("coupon_curves", "coupon_id", "file", "file_sha256"),
    ("structure_models", "id", "arrays", "arrays_sha256"),
)
"""Table, key, bytes, their digest. PostgreSQL computes the digests itself, so that no spectrum is
sent.
"""

_CHUNKS = "SELECT sha256, data FROM original_chunks ORDER BY sha256, number"
_SIZES = (
    "SELECT sha256, size FROM originals WHERE to_jsonb(originals) ->> 'bytes_deleted_at' IS NULL"
)
"""A schema of an earlier version has no such column, and no retention rule."""


_DELETED = "bytes_deleted_at IS NOT NULL"


def find_damage(connection: Connection) -> list[str]:
    """What does not have the SHA-256 that it was stored with, in order.

    Returns:
        Names such as `frfs 0199…: data`; empty where all is well.
    """
    catalogue = inspect(connection)
    tables = set(catalogue.get_table_names())
    checks = [
        _wrong_digests(connection, *check)
        for check in CHECKED
        if check[0] in tables
        and check[2] in {column["name"] for column in catalogue.get_columns(check[0])}
    ]  # a schema of an earlier version has fewer of them
    if "original_chunks" in tables:
        checks.append(_wrong_originals(connection))
    return sorted(name for check in checks for name in check)


def deleted_by_rules(connection: Connection) -> str:
    """How much retention rules have deleted, in words; empty where it is nothing, or the schema is of
    a version without such rules.
    """
    columns = inspect(connection).get_columns("originals")
    if "bytes_deleted_at" not in {column["name"] for column in columns}:
        return ""
    counts = [
        int(connection.scalar(text(f"SELECT count(*) FROM {table} WHERE {_DELETED}")) or 0)
        for table in ("originals", "records")
    ]
    files, blocks = counts
    return (
        f"{files} files and {blocks} time blocks were deleted by retention rules"
        if any(counts)
        else ""
    )


def _wrong_digests(
    connection: Connection, table: str, key: str, data: str, digest: str
) -> Iterator[str]:
    query = (
        f"SELECT {key} FROM {table} WHERE {data} IS NOT NULL AND sha256({data}) IS DISTINCT FROM"
        f" {digest}"
    )
    try:
        with connection.begin_nested():
            wrong = connection.scalars(text(query)).all()
    except DBAPIError as error:  # a damaged page, which PostgreSQL knows by its own checksum
        yield f"{table}: {first_line(error)}"
        return
    for row in wrong:
        yield f"{table} {row}: {data}"


def _wrong_originals(connection: Connection) -> Iterator[str]:
    """A file's chunks together have its size, and its SHA-256, which is also its name."""
    try:
        with connection.begin_nested():
            expected: dict[bytes, int] = {
                row.sha256: row.size for row in connection.execute(text(_SIZES))
            }
            stored = {sha256: (size, digest) for sha256, size, digest in _digests(connection)}
    except DBAPIError as error:
        yield f"originals: {first_line(error)}"
        return
    nothing = (0, hashlib.sha256().digest())
    for sha256, size in expected.items():
        if stored.get(sha256, nothing) != (size, sha256):
            yield f"originals {sha256.hex()}: data"


def _digests(connection: Connection) -> Iterator[tuple[bytes, int, bytes]]:
    """Name, size and digest of each stored file, read in its order."""
    rows: Any = connection.execute(text(_CHUNKS), execution_options={"yield_per": 256})
    for name, chunks in groupby(rows, key=itemgetter(0)):
        size, digest = 0, hashlib.sha256()
        for _, data in chunks:
            size += len(data)
            digest.update(data)
        yield name, size, digest.digest()


def first_line(error: Exception) -> str:
    """What an error says first; of a database's error what the database says."""
    return str(getattr(error, "orig", error)).strip().partition("\n")[0]
