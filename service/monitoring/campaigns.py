"""Campaigns as monitors see them: complete or not, what they hold, and what speaks against running them.

A campaign is complete when its date is stated, no import into it is queued or running, and either somebody has said so
(`POST /campaigns/{id}/complete`) or it has FRFs and nothing was added for a while.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from sqlalchemy import func, literal, select
from sqlalchemy.dialects.postgresql import aggregate_order_by, distinct_on
from sqlalchemy.orm import Session

from service.campaigns.tables import Campaign, Frf, GridPoint, Import, ModeSet
from service.jobs import Job
from service.monitoring.tables import CampaignCompletion, Monitor


@dataclass(frozen=True)
class Seen:
    """A campaign with a date.

    Attributes:
        campaign: its row.
        measured: digest of its FRFs and what they are between; None where there are none.
        fingerprint: digest of everything that a run takes from it. Climate is not in it: a series reads that afresh.
        mode_set: newest mode set that was typed in or came with a file.
        complete: whether a run may begin by itself.
        objection: why it cannot be run, whatever is done; None where nothing speaks against it.
    """

    campaign: Campaign
    measured: str | None
    fingerprint: str
    mode_set: UUID | None
    complete: bool
    objection: str | None


def seen_campaigns(session: Session, monitor: Monitor, now: datetime, settle: timedelta) -> list[Seen]:
    """The campaigns that a monitor looks at, in time order."""
    query = select(Campaign).where(
        Campaign.structure_id == monitor.structure_id,
        Campaign.deleted_at.is_(None),
        Campaign.performed_at.is_not(None),
    )
    if monitor.since is not None:
        query = query.where(Campaign.performed_at >= monitor.since)
    rows = session.scalars(
        query.order_by(Campaign.performed_at, Campaign.id), execution_options={"populate_existing": True}
    ).all()
    facts = _Facts(session, [row.id for row in rows])
    seen: list[Seen] = []
    for row in rows:
        mode_set = facts.mode_sets.get(row.id, (None, None))[0] if monitor.modes == "given" else None
        seen.append(
            Seen(
                campaign=row,
                measured=facts.frfs[row.id][0] if row.id in facts.frfs else None,
                fingerprint=facts.fingerprint(row, mode_set),
                mode_set=mode_set,
                complete=facts.complete(row, now - settle, monitor),
                objection=_objection(row, facts, monitor, mode_set, seen),
            )
        )
    return seen


def _objection(
    row: Campaign, facts: _Facts, monitor: Monitor, mode_set: UUID | None, earlier: Sequence[Seen]
) -> str | None:
    """What is wrong with a campaign, seen beside those before it."""
    if row.id not in facts.frfs:
        return "the campaign has no FRFs"
    if monitor.boundary is not None and row.boundary != monitor.boundary:
        return f"the specimen was held {row.boundary!r}; this monitor compares campaigns held {monitor.boundary!r}"
    if monitor.modes == "given" and mode_set is None:
        return "the campaign has no mode set that was typed in or came with a file, which this monitor takes its modes from"
    for other in earlier:
        if other.objection is not None:
            continue
        if other.measured == facts.frfs[row.id][0]:
            return f"holds the same FRFs as campaign {other.campaign.id}; a measurement counts once"
        if other.campaign.performed_at == row.performed_at:
            return f"was performed at the same moment as campaign {other.campaign.id}; correct one of the dates"
    return None


class _Facts:
    """What lies in other tables about some campaigns, one question a table."""

    def __init__(self, session: Session, ids: Sequence[UUID]) -> None:
        self.frfs = self._by_campaign(session, _frfs(ids))
        self.points = self._by_campaign(session, _points(ids))
        self.imports = self._by_campaign(session, _imports(ids))
        self.mode_sets = self._by_campaign(session, _mode_sets(ids))
        self.completed = self._by_campaign(
            session,
            select(CampaignCompletion.campaign_id, CampaignCompletion.completed_at).where(
                CampaignCompletion.campaign_id.in_(ids)
            ),
        )

    @staticmethod
    def _by_campaign(session: Session, query: Any) -> dict[UUID, tuple[Any, ...]]:
        return {row[0]: tuple(row[1:]) for row in session.execute(query)}

    def fingerprint(self, row: Campaign, mode_set: UUID | None) -> str:
        """Digest of what a run takes from a campaign."""
        used = {
            "frfs": self.frfs.get(row.id, (None,))[0],
            "points": self.points.get(row.id, (None,))[0],
            "boundary": row.boundary,
            "sensor": [row.instruments.get("sensor_mass_kg"), row.instruments.get("sensor_point")],
            "frame": row.frame,
            "mode_set": str(mode_set),
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
        times = (row.updated_at, self.frfs[row.id][1], last_import, self.mode_sets.get(row.id, (None, None))[1])
        return max(time for time in times if time is not None) <= quiet_since


def _frfs(ids: Sequence[UUID]) -> Any:
    """Digest and newest time of each campaign's FRFs; reads no spectrum."""
    parts = (Frf.response_point, Frf.response_direction, Frf.reference_point, Frf.reference_direction, Frf.quantity)
    axis = (Frf.start_hz, Frf.step_hz, Frf.lines)
    one = func.concat_ws(" ", func.encode(Frf.sha256, "hex"), *parts, *axis)
    return (
        select(
            Frf.campaign_id,
            func.md5(func.string_agg(one, aggregate_order_by(literal(","), one))),
            func.max(Frf.created_at),
        )
        .where(Frf.campaign_id.in_(ids))
        .group_by(Frf.campaign_id)
    )


def _points(ids: Sequence[UUID]) -> Any:
    one = func.concat_ws(" ", GridPoint.label, GridPoint.x_m, GridPoint.y_m, GridPoint.z_m)
    return (
        select(GridPoint.campaign_id, func.md5(func.string_agg(one, aggregate_order_by(literal(","), one))))
        .where(GridPoint.campaign_id.in_(ids))
        .group_by(GridPoint.campaign_id)
    )


def _imports(ids: Sequence[UUID]) -> Any:
    coming = func.count().filter(Job.state.in_(("queued", "running")))
    return (
        select(Import.campaign_id, coming, func.max(Job.finished_at))
        .join(Job, Job.id == Import.id)
        .where(Import.campaign_id.in_(ids), ~Import.dry_run)
        .group_by(Import.campaign_id)
    )


def _mode_sets(ids: Sequence[UUID]) -> Any:
    """Newest mode set of each campaign that no job has identified."""
    return (
        select(ModeSet.campaign_id, ModeSet.id, ModeSet.created_at)
        .where(ModeSet.campaign_id.in_(ids), ModeSet.origin.in_(("typed", "file")))
        .ext(distinct_on(ModeSet.campaign_id))
        .order_by(ModeSet.campaign_id, ModeSet.id.desc())
    )
