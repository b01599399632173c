"""Tracks of a series' runs as they are stored, so that a judgement follows only what is new.

The tracks of a run depend on it and on all runs before it in time, so each is stored with the
digest of that chain. Where the chain of the campaigns that count now leaves the stored one, runs
are followed anew from the last one before that has its state.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.nouns.monitors.tables import MonitorTracks

if TYPE_CHECKING:
    from service.nouns.monitors.counted import Counted
    from service.nouns.monitors.tables import MonitorSeries

STATES_APART = 250
"""Runs between two that keep their state: a late campaign has at most so many followed again before
those that come after it.
"""


def chained(
    seed: str, entries: Sequence[Counted], events: Sequence[tuple[datetime, str]]
) -> list[bytes]:
    """(n,) digest of each campaign with all before it.

    Args:
        seed: what all of them depend on.
        entries: in the order of time.
        events: what else has happened, in the order of time.
    """
    chain, digest, upcoming = [], hashlib.blake2b(seed.encode(), digest_size=16), list(events)[::-1]
    for entry in entries:
        while upcoming and upcoming[-1][0] <= entry.performed_at:
            digest.update(repr(upcoming.pop()).encode())
        digest.update(f"{entry.run_id}{entry.performed_at}{entry.conditions}".encode())
        chain.append(digest.digest())
    return chain


def place_to_go_on(
    session: Session, series: MonitorSeries, entries: Sequence[Counted], chain: Sequence[bytes]
) -> int:
    """How many of the first campaigns are followed as they are now, and end with a run that has its
    state.
    """
    stored = session.execute(
        select(MonitorTracks.run_id, MonitorTracks.chain, MonitorTracks.state.is_not(None))
        .where(MonitorTracks.series_id == series.id)
        .order_by(MonitorTracks.performed_at)
    ).all()
    by_run = {run: (link, keeps) for run, link, keeps in stored}
    place = 0
    for at, (entry, link) in enumerate(zip(entries, chain, strict=True), 1):
        known, keeps = by_run.get(entry.run_id, (None, False))
        if known != link:
            break
        place = at if keeps else place
    return place


def tracks_of(
    session: Session, runs: Sequence[UUID]
) -> dict[UUID, tuple[Sequence[int], Sequence[float]]]:
    """Numbers and identity standard deviations of runs that were followed."""
    query = select(MonitorTracks.run_id, MonitorTracks.numbers, MonitorTracks.identity_sd)
    rows = session.execute(query.where(MonitorTracks.run_id.in_(runs)))
    return {run: (numbers, identity) for run, numbers, identity in rows}


def state_after(session: Session, run: UUID) -> dict[str, Any]:
    """What is known after a run that has its state."""
    state: dict[str, Any] | None = session.scalars(
        select(MonitorTracks.state).where(MonitorTracks.run_id == run)
    ).one()
    assert state is not None
    return state


def keep_tracks(
    session: Session, series: MonitorSeries, rows: Iterable[dict[str, Any]], place: int
) -> None:
    """Store runs as they were followed. Only some of those before keep their state: the last of
    each `STATES_APART`.

    Args:
        session: the transaction.
        series: whose.
        rows: of the table, in the order of time.
        place: of the first one in the series.
    """
    stored = list(_thinned(rows, place))
    for part in (stored[at : at + 500] for at in range(0, len(stored), 500)):
        new = insert(MonitorTracks).values([{"series_id": series.id, **row} for row in part])
        columns = {name: new.excluded[name] for name in part[0] if name != "run_id"}
        session.execute(new.on_conflict_do_update(index_elements=["run_id"], set_=columns))
    if stored:
        behind = session.execute(
            select(MonitorTracks.run_id)
            .where(
                MonitorTracks.series_id == series.id,
                MonitorTracks.performed_at < stored[0]["performed_at"],
            )
            .order_by(MonitorTracks.performed_at.desc())
            .limit(1)
        ).scalar()
        if behind is not None and place % STATES_APART:
            session.execute(
                update(MonitorTracks).where(MonitorTracks.run_id == behind).values(state=None)
            )


def _thinned(rows: Iterable[dict[str, Any]], place: int) -> Iterator[dict[str, Any]]:
    listed = list(rows)
    for at, row in enumerate(listed, place + 1):
        kept = at % STATES_APART == 0 or at == place + len(listed)
        yield row if kept else {**row, "state": None}
