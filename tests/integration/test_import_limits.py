"""What one uploaded file may bring, however dense it is: the worker's own process takes in what its child reads of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from sqlalchemy import Engine, func, select, update

from modalbase.formats.uff import DatasetReport, GridPoint, ModeShape
from service.access import User
from service.compute.reading import EncodedFrf, Kept
from service.compute.spectra import Axis, encode
from service.db.engine import Sessions
from service.errors import PayloadTooLarge
from service.store.imports import intake
from service.store.imports.operations import IMPORT, Import
from service.store.imports.originals import Original
from service.web.parameters import HEAVIEST_BYTES, paged
from tests.integration.test_migrations import fill


@pytest.fixture
def stored(engine: Engine, sessions: Sessions) -> Iterator[Callable[[list[Kept]], Import]]:
    """Stores what a child read of a file of 1000 bytes."""
    with engine.begin() as connection:
        key: UUID = fill(connection)["imports"][0]["id"]
    with sessions.begin() as session:
        session.execute(update(Original).values(size=1000))

        def store(items: list[Kept]) -> Import:
            IMPORT.store(session, key, iter(items))
            return session.get_one(Import, key)

        yield store
        session.rollback()


def frf(number: int, lines: int) -> EncodedFrf:
    spectrum = encode(np.ones(lines, np.complex64))
    return EncodedFrf(number, "", 1, 3, 1, 3, "accelerance", Axis(1.0, 1.0, lines), spectrum)


def shape(points: int) -> ModeShape:
    values = np.ones((points, 6), np.complex128)
    return ModeShape(1, "", 1, 10.0, 0.01, np.arange(1, points + 1), values, "complex")


@pytest.mark.parametrize(
    ("limits", "items", "says"),
    [
        ({"FREE_BYTES": 4000}, [frf(n, 100) for n in range(11)], "unpacks to more than 8 times"),
        ({"HELD_BYTES": 4000}, [shape(20), shape(20)], "more than 4000 bytes; import it in parts"),
        ({"MOST_POINTS": 100}, [[GridPoint(n, (0.0, 0.0, 0.0)) for n in range(101, 202)]], "more than 100 grid points"),
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
    row = stored([[GridPoint(n, (0.0, 0.0, 0.0)) for n in range(10, 50)], *(frf(n, 100) for n in range(20)), shape(20)])
    assert row.counts == {"frfs": 20, "grid_points": 40, "modes": 1, "records": 0}


def test_reports_on_very_many_datasets_are_counted(stored: Callable[[list[Kept]], Import]) -> None:
    """4 MB of empty datasets once were 30 MB of answer, and a list of such imports had no end."""
    reports: list[Any] = [DatasetReport(n, "151", 21 * n, "refused", "ends inside") for n in range(1, 20_501)]
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
        assert paged(session, select(User), None, 6, names, weight=weight * 5).items == [
            "0"
        ]  # one at least, else there would be no way on
