"""Campaigns as monitors see them: complete or not, what they hold, and what speaks against running
them.

A campaign is complete when its date is stated, no import into it is queued or running, and either
somebody has said so (`POST /campaigns/{id}/complete`) or it has what the monitor takes (FRFs; for a
monitor of modes, a mode set, time blocks or a recording will do) and nothing was added for a while.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy import Select, select, union
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import (
    campaigns_touched,
    dated_campaigns,
    dated_count,
    point_digests,
)
from service.nouns.frfs.operations import frf_digests, frfs_from
from service.nouns.imports.operations import import_progress, imports_from
from service.nouns.modes.operations import mode_sets_from, newest_stated
from service.nouns.monitors.tables import CampaignCompletion, Monitor
from service.nouns.recordings.operations import recordings_from, recordings_held
from service.nouns.records.operations import newest_records, records_from

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign


@dataclass(frozen=True)
class Candidate:
    """A campaign with a date."""

    campaign: Campaign  # its row
    # digest of its FRFs and what they are between; None where there are none
    measured: str | None
    unprocessed: bool  # whether FRFs or half spectra have to be made first
    # digest of everything that a run takes from it. Climate is not in it: a series reads that
    # afresh.
    fingerprint: str
    mode_set: UUID | None  # newest mode set that was typed in or came with a file
    complete: bool  # whether a run may begin by itself
    # why it cannot be run, whatever is done; None where nothing speaks against it
    objection: str | None


MOST = 1000
"""Dated campaigns of a structure up to which a monitor looks at all of them each time."""

RECENT = timedelta(days=2)


def candidates_of(
    session: Session,
    monitor: Monitor,
    now: datetime,
    settle: timedelta,
    *,
    recent: bool = False,
    only: UUID | None = None,
) -> list[Candidate]:
    """The campaigns that a monitor looks at, in time order.

    Args:
        session: where.
        monitor: which.
        now: the time.
        settle: how long a campaign must have been left alone to count as complete.
        recent: of more than `MOST`, only those that were touched within `RECENT`.
        only: this one alone.
    """
    among: Select[UUID] | list[UUID] | None = None if only is None else [only]
    if recent and among is None and dated_count(session, monitor.structure_id) > MOST:
        among = _touched(now - settle - RECENT)
    rows = dated_campaigns(session, monitor.structure_id, monitor.since, among)
    facts = _Facts(session, [row.id for row in rows])
    candidates: list[Candidate] = []
    earlier: dict[object, UUID] = {}  # by FRFs and by moment, the campaign that counts
    for row in rows:
        mode_set = facts.mode_set(row, monitor)
        candidates.append(
            Candidate(
                campaign=row,
                measured=facts.frfs[row.id][0] if row.id in facts.frfs else None,
                unprocessed=facts.unprocessed(row),
                fingerprint=facts.fingerprint(row, mode_set),
                mode_set=mode_set,
                complete=facts.complete(row, now - settle, monitor),
                objection=_objection(row, facts, monitor, mode_set, earlier),
            )
        )
    return candidates


def _touched(since: datetime) -> Select[UUID]:
    """Campaigns to which something came since a time; keys of rows say when these came."""
    first = UUID(int=int(since.timestamp() * 1000) << 80)  # of a UUIDv7
    completed = CampaignCompletion.completed_at >= since
    ended = select(CampaignCompletion.campaign_id).where(completed)
    came = (each(first) for each in _CAME)
    return select(union(campaigns_touched(since), ended, *came).subquery().c[0])


_CAME = (frfs_from, imports_from, mode_sets_from, records_from, recordings_from)


def _objection(
    row: Campaign,
    facts: _Facts,
    monitor: Monitor,
    mode_set: UUID | None,
    earlier: dict[object, UUID],
) -> str | None:
    """What is wrong with a campaign, seen beside those before it, to which it is added."""
    if not facts.has_input(row, monitor):
        return (
            "the campaign has no FRFs"
            if monitor.watches == "update"
            else "the campaign has no FRFs, no time blocks, no recording and no mode set"
        )
    if monitor.boundary is not None and row.boundary != monitor.boundary:
        return (
            f"the specimen was held {row.boundary!r}; this monitor compares campaigns held"
            f" {monitor.boundary!r}"
        )
    if monitor.modes == "given" and mode_set is None:
        return (
            "the campaign has no mode set that was typed in or came with a file, which this monitor"
            " takes its modes from"
        )
    measured = facts.frfs.get(row.id, (None,))[0]
    if measured in earlier:
        return f"holds the same FRFs as campaign {earlier[measured]}; a measurement counts once"
    if row.performed_at in earlier:
        return (
            f"was performed at the same moment as campaign {earlier[row.performed_at]}; correct one"
            " of the dates"
        )
    earlier[row.performed_at] = row.id
    if measured is not None:
        earlier[measured] = row.id
    return None


class _Facts:
    """What lies in other tables about some campaigns, one question a table."""

    def __init__(self, session: Session, ids: Sequence[UUID]) -> None:
        self.frfs = frf_digests(session, ids)
        self.points = point_digests(session, ids)
        self.imports = import_progress(session, ids)
        self.mode_sets = newest_stated(session, ids)
        self.records = newest_records(session, ids)
        self.recordings = recordings_held(session, ids)
        completed = select(CampaignCompletion.campaign_id).where(
            CampaignCompletion.campaign_id.in_(ids)
        )
        self.completed = set(session.scalars(completed))

    def mode_set(self, row: Campaign, monitor: Monitor) -> UUID | None:
        """The stated mode set that a run takes its modes from; None where it identifies them."""
        measured = (self.frfs, self.records, self.recordings)
        if monitor.modes == "given" or (
            monitor.watches == "modes" and not any(row.id in each for each in measured)
        ):
            return self.mode_sets.get(row.id, (None, None))[0]
        return None

    def has_input(self, row: Campaign, monitor: Monitor) -> bool:
        """Whether there is something that a run of this monitor takes."""
        if monitor.watches == "update":
            return row.id in self.frfs
        takes = (self.frfs, self.records, self.recordings, self.mode_sets)
        return any(row.id in each for each in takes)

    def unprocessed(self, row: Campaign) -> bool:
        """Whether a campaign's time blocks or recordings are all that it has to find modes in."""
        if row.id in self.frfs:
            return False
        held = self.recordings.get(row.id)
        return row.id in self.records if held is None else not held.processed

    def fingerprint(self, row: Campaign, mode_set: UUID | None) -> str:
        """Digest of what a run takes from a campaign."""
        used = {
            "frfs": self.frfs.get(row.id, (None,))[0],
            "points": self.points.get(row.id),
            "boundary": row.boundary,
            "sensor": [row.instruments.get("sensor_mass_kg"), row.instruments.get("sensor_point")],
            "frame": row.frame,
            "mode_set": str(mode_set),
            **({} if row.inputs is None else {"inputs": row.inputs}),
            # of a campaign that has FRFs these are what its updates know of its time blocks
            **(
                {"records": self.records[row.id].isoformat()}
                if row.id in self.records and row.id not in self.frfs
                else {}
            ),
            **(
                {"recordings": self.recordings[row.id].digest}
                if row.id in self.recordings and row.id not in self.frfs
                else {}
            ),
        }
        return hashlib.sha256(json.dumps(used, sort_keys=True).encode()).hexdigest()

    def complete(self, row: Campaign, quiet_since: datetime, monitor: Monitor) -> bool:
        """Whether a run may begin by itself; see the module's docstring."""
        coming, last_import = self.imports.get(row.id, (0, None))
        if coming:
            return False
        if row.id in self.completed:
            return True
        if not self.has_input(row, monitor) or (
            monitor.modes == "given" and row.id not in self.mode_sets
        ):
            return False
        times = (
            row.updated_at,
            self.frfs.get(row.id, (None, None))[1],
            last_import,
            self.mode_sets.get(row.id, (None, None))[1],
            self.records.get(row.id),
            self.recordings[row.id].newest if row.id in self.recordings else None,
        )
        return max(time for time in times if time is not None) <= quiet_since
