"""Uploaded files in the database."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import text
from sqlalchemy.orm import Session

from service.db.engine import Sessions
from service.errors import Damaged
from service.store.imports.originals import (
    CHUNK_BYTES,
    READ_BYTES,
    keep_original,
    original_chunks,
    write_original,
)
from service.web.uploads import Spooled

IN_OTHER_PAGES = text("SELECT count(*) FROM original_chunks WHERE pg_column_toast_chunk_id(data) IS NOT NULL")


def some_bytes(size: int) -> bytes:
    return np.random.default_rng(size).bytes(size)


def keep(session: Session, folder: Path, content: bytes) -> bytes:
    spool, sha256 = folder / "spool", hashlib.sha256(content).digest()
    spool.write_bytes(content)
    keep_original(session, Spooled(spool, len(content), sha256))
    return sha256


@pytest.mark.parametrize("size", [1, CHUNK_BYTES, CHUNK_BYTES + 1, READ_BYTES, 2 * READ_BYTES + 17])
def test_a_file_comes_back_whole_from_rows_that_fill_a_page_each(sessions: Sessions, tmp_path: Path, size: int) -> None:
    content = some_bytes(size)
    with sessions.begin() as session:
        sha256 = keep(session, tmp_path, content)
        assert session.scalar(IN_OTHER_PAGES) == 0
        write_original(session, sha256, tmp_path / "again")
        assert max(map(len, original_chunks(session, sha256))) <= READ_BYTES
    assert (tmp_path / "again").read_bytes() == content


def test_a_file_in_the_large_chunks_of_earlier_versions_is_read(sessions: Sessions) -> None:
    content, megabyte = some_bytes(2_500_000), 1024 * 1024
    sha256 = hashlib.sha256(content).digest()
    with sessions.begin() as session:
        session.execute(text("INSERT INTO originals (sha256, size) VALUES (:s, :n)"), {"s": sha256, "n": len(content)})
        for number, start in enumerate(range(0, len(content), megabyte)):
            session.execute(
                text("INSERT INTO original_chunks (sha256, number, data) VALUES (:s, :i, :d)"),
                {"s": sha256, "i": number, "d": content[start : start + megabyte]},
            )
        assert [len(block) for block in original_chunks(session, sha256)] == [megabyte, megabyte, 402_848]
        assert b"".join(original_chunks(session, sha256)) == content


@pytest.mark.parametrize(
    "lost", ["number = 0", "number = 7", "number >= 129 AND number < 258", "number >= 258", "number >= 0"]
)
def test_a_file_of_which_chunks_are_lost_is_damaged(sessions: Sessions, tmp_path: Path, lost: str) -> None:
    with sessions.begin() as session:
        sha256 = keep(session, tmp_path, some_bytes(3_000_000))
        session.execute(text(f"DELETE FROM original_chunks WHERE {lost}"))
        with pytest.raises(Damaged, match="checksum"):
            write_original(session, sha256, tmp_path / "again")
