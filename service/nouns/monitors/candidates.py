"""Campaigns as monitors see them: complete or not, what they hold, and what speaks against running
them.

A campaign is complete when its date is stated, no import into it is queued or running, and either
somebody has said so (`POST /campaigns/{id}/complete`) or it has FRFs and nothing was added for a
while.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import dated_campaigns, point_digests
from service.nouns.frfs.operations import frf_digests
from service.nouns.imports.operations import import_progress
from service.nouns.modes.operations import newest_stated
from service.nouns.monitors.tables import CampaignCompletion, Monitor

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign


@dataclass(frozen=True)
class Candidate:
    """A campaign with a date."""

    campaign: Campaign  # its row
    measured: str | None  # digest of its FRFs and what they are between; None where there are none
    # digest of everything that a run takes from it. Climate is not in it: a series reads that
    # afresh.
    fingerprint: str
    mode_set: UUID | None  # newest mode set that was typed in or came with a file
    complete: bool  # whether a run may begin by itself
    # why it cannot be run, whatever is done; None where nothing speaks against it
    objection: str | None


def candidates_of(
    session: Session, monitor: Monitor, now: datetime, settle: timedelta
) -> list[Candidate]:
    """The campaigns that a monitor looks at, in time order."""
    rows = dated_campaigns(session, monitor.structure_id, monitor.since)
    facts = _Facts(session, [row.id for row in rows])
    candidates: list[Candidate] = []
    for row in rows:
        mode_set = (
            facts.mode_sets.get(row.id, (None, None))[0] if monitor.modes == "given" else None
        )
        candidates.append(
            Candidate(
                campaign=row,
                measured=facts.frfs[row.id][0] if row.id in facts.frfs else None,
                fingerprint=facts.fingerprint(row, mode_set),
                mode_set=mode_set,
                complete=facts.complete(row, now - settle, monitor),
                objection=_objection(row, facts, monitor, mode_set, candidates),
            )
        )
    return candidates


def _objection(
    row: Campaign,
    facts: _Facts,
    monitor: Monitor,
    mode_set: UUID | None,
    earlier: Sequence[Candidate],
) -> str | None:
    """What is wrong with a campaign, seen beside those before it."""
    if row.id not in facts.frfs:
        return "the campaign has no FRFs"
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
    for other in earlier:
        if other.objection is not None:
            continue
        if other.measured == facts.frfs[row.id][0]:
            return f"holds the same FRFs as campaign {other.campaign.id}; a measurement counts once"
        if other.campaign.performed_at == row.performed_at:
            return (
                f"was performed at the same moment as campaign {other.campaign.id}; correct one of"
                " the dates"
            )
    return None


class _Facts:
    """What lies in other tables about some campaigns, one question a table."""

    def __init__(self, session: Session, ids: Sequence[UUID]) -> None:
        self.frfs = frf_digests(session, ids)
        self.points = point_digests(session, ids)
        self.imports = import_progress(session, ids)
        self.mode_sets = newest_stated(session, ids)
        completed = select(CampaignCompletion.campaign_id).where(
            CampaignCompletion.campaign_id.in_(ids)
        )
        self.completed = set(session.scalars(completed))

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
        }
        return hashlib.sha256(json.dumps(used, sort_keys=True).encode()).hexdigest()

    def complete(self, row: Campaign, quiet_since: datetime, monitor: Monitor) -> bool:
        """Whether a run may begin by itself; see the module's docstring."""
        coming, last_import = self.imports.get(row.id, (0, None))
        if coming:
            return False
        if row.id in self.completed:
            return True
        if row.id not in self.frfs or (monitor.modes == "given" and row.id not in self.mode_sets):
            return False
        times = (
            row.updated_at,
            self.frfs[row.id][1],
            last_import,
            self.mode_sets.get(row.id, (None, None))[1],
        )
        return max(time for time in times if time is not None) <= quiet_since
