"""Files of imports in the database: what may be stored of one, and how its bytes come back."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from sqlalchemy import Engine, func, select, text, update
from sqlalchemy.orm import Session

from modalbase.formats.uff import DatasetReport, GridPoint, ModeShape
from service.compute.spectra import FrequencyAxis, encode
from service.nouns.imports.operations import Import
from service.nouns.storage.originals import (
    CHUNK_BYTES,
    READ_BYTES,
    Original,
    keep_original,
    original_chunks,
    write_original,
)
from service.platform.access import User
from service.platform.db.engine import Sessions
from service.platform.errors import Damaged, PayloadTooLarge
from service.platform.web.parameters import HEAVIEST_BYTES, paged
from service.platform.web.uploads import Spooled
from service.tasks.import_file import intake
from service.tasks.import_file.compute import EncodedFrf, Kept
from service.tasks.import_file.task import IMPORTS
from tests.integration.test_db import fill


@pytest.fixture
def stored(engine: Engine, sessions: Sessions) -> Iterator[Callable[[list[Kept]], Import]]:
    """Stores what a child read of a file of 1000 bytes."""
    with engine.begin() as connection:
        key: UUID = fill(connection)["imports"][0]["id"]
    with sessions.begin() as session:
        session.execute(update(Original).values(size=1000))

        def store(items: list[Kept]) -> Import:
            IMPORTS.kind.store(session, key, iter(items))
            return session.get_one(Import, key)

        yield store
        session.rollback()


def frf(number: int, lines: int) -> EncodedFrf:
    spectrum = encode(np.ones(lines, np.complex64))
    return EncodedFrf(
        number, "", 1, 3, 1, 3, "accelerance", FrequencyAxis(1.0, 1.0, lines), spectrum
    )


def shape(points: int) -> ModeShape:
    values = np.ones((points, 6), np.complex128)
    return ModeShape(1, "", 1, 10.0, 0.01, np.arange(1, points + 1), values, "complex")


@pytest.mark.parametrize(
    ("limits", "items", "says"),
    [
        ({"FREE_BYTES": 4000}, [frf(n, 100) for n in range(11)], "unpacks to more than 8 times"),
        ({"HELD_BYTES": 4000}, [shape(20), shape(20)], "more than 4000 bytes; import it in parts"),
        (
            {"MOST_POINTS": 100},
            [[GridPoint(n, (0.0, 0.0, 0.0)) for n in range(101, 202)]],
            "more than 100 grid points",
        ),
    ],
    ids=["ratio", "held", "points"],
)
def test_a_file_that_unpacks_to_too_much_is_refused(
    stored: Callable[[list[Kept]], Import],
    limits: dict[str, int],
    items: list[Kept],
    says: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, value in limits.items():
        monkeypatch.setattr(intake, name, value)
    with pytest.raises(PayloadTooLarge, match=says):
        stored(items)


def test_what_is_within_the_limits_is_stored(stored: Callable[[list[Kept]], Import]) -> None:
    row = stored(
        [
            [GridPoint(n, (0.0, 0.0, 0.0)) for n in range(10, 50)],
            *(frf(n, 100) for n in range(20)),
            shape(20),
        ]
    )
    assert row.counts == {"frfs": 20, "grid_points": 40, "modes": 1, "records": 0, "recordings": 0}


def test_reports_on_very_many_datasets_are_counted(stored: Callable[[list[Kept]], Import]) -> None:
    """4 MB of empty datasets once were 30 MB of answer, and a list of such imports had no end."""
    reports: list[Any] = [
        DatasetReport(n, "151", 21 * n, "refused", "ends inside") for n in range(1, 20_501)
    ]
    row = stored([frf(1, 10), DatasetReport(0, "58", 0, "read"), *reports])
    assert len(row.datasets or []) == intake.LISTED
    assert "501 datasets after the first 20000 are not listed: 501 refused" in (row.warnings or [])


def test_a_page_of_heavy_rows_is_shorter(sessions: Sessions) -> None:
    def names(rows: Sequence[User]) -> list[str]:
        return [row.name for row in rows]

    with sessions.begin() as session:
        session.add_all(User(name=str(n)) for n in range(9))
        session.flush()
        weight = func.length(User.name) * (HEAVIEST_BYTES // 4)
        pages: list[str] = []
        cursor: str | None = None
        while cursor is not None or not pages:
            page = paged(session, select(User), cursor, 6, names, weight=weight)
            pages.append("".join(page.items))
            cursor = page.next_cursor
        assert pages == ["0123", "4567", "8"]
        heavy = paged(session, select(User), None, 6, names, weight=weight * 5)
        assert heavy.items == ["0"]  # one at least, else there would be no way on


IN_OTHER_PAGES = text(
    "SELECT count(*) FROM original_chunks WHERE pg_column_toast_chunk_id(data) IS NOT NULL"
)


def some_bytes(size: int) -> bytes:
    return np.random.default_rng(size).bytes(size)


def keep(session: Session, folder: Path, content: bytes) -> bytes:
    spool, sha256 = folder / "spool", hashlib.sha256(content).digest()
    spool.write_bytes(content)
    keep_original(session, Spooled(spool, len(content), sha256))
    return sha256


@pytest.mark.parametrize("size", [1, CHUNK_BYTES, CHUNK_BYTES + 1, READ_BYTES, 2 * READ_BYTES + 17])
def test_a_file_comes_back_whole_from_rows_that_fill_a_page_each(
    sessions: Sessions, tmp_path: Path, size: int
) -> None:
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
        session.execute(
            text("INSERT INTO originals (sha256, size) VALUES (:s, :n)"),
            {"s": sha256, "n": len(content)},
        )
        for number, start in enumerate(range(0, len(content), megabyte)):
            session.execute(
                text("INSERT INTO original_chunks (sha256, number, data) VALUES (:s, :i, :d)"),
                {"s": sha256, "i": number, "d": content[start : start + megabyte]},
            )
        assert [len(block) for block in original_chunks(session, sha256)] == [
            megabyte,
            megabyte,
            402_848,
        ]
        assert b"".join(original_chunks(session, sha256)) == content


@pytest.mark.parametrize(
    "lost",
    ["number = 0", "number = 7", "number >= 129 AND number < 258", "number >= 258", "number >= 0"],
)
def test_a_file_of_which_chunks_are_lost_is_damaged(
    sessions: Sessions, tmp_path: Path, lost: str
) -> None:
    with sessions.begin() as session:
        sha256 = keep(session, tmp_path, some_bytes(3_000_000))
        session.execute(text(f"DELETE FROM original_chunks WHERE {lost}"))
        with pytest.raises(Damaged, match="checksum"):
            write_original(session, sha256, tmp_path / "again")
