"""The retention rule of a structure: so many days after its import a file is deleted, and so are
time blocks; their SHA-256, spectra, FRFs, modes and results stay.

What nothing was made of yet stays too: a recording without spectra, and time blocks that no
processing has seen. What is archived or deleted rests, so that what is restored has all that it
had.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import among_campaigns, campaign_for, campaign_of
from service.nouns.imports.operations import Import, has_file
from service.nouns.recordings.operations import delete_recorded, imports_without_spectra
from service.nouns.records.operations import delete_samples
from service.nouns.records.processings import in_use, old_samples
from service.nouns.storage import book
from service.nouns.storage.originals import delete_unused_bytes, original_sizes
from service.nouns.structures.operations import retention_rules
from service.platform.access import audit
from service.platform.queue.resource import ENDED
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign

MOST = 200
"""Imports of a structure whose bytes go in one transaction."""


def apply_rules(session: Session, now: datetime) -> int:
    """Delete what the rules of all structures say, at most `MOST` imports of each; another process
    that does so at the same moment takes others.

    Returns:
        How many imports, and campaigns with time blocks of scripts, lost their bytes.
    """
    return sum(
        _apply(session, structure_id, now - timedelta(days=days), now)
        for structure_id, days in retention_rules(session)
    )


def _apply(session: Session, structure_id: UUID, before: datetime, now: datetime) -> int:
    campaigns = among_campaigns(structure_id, deleted=False)
    query = (
        select(Import)
        .join(Job, Job.id == Import.id)
        .where(
            Import.campaign_id.in_(campaigns),
            Import.campaign_id.not_in(in_use(campaigns)),
            Import.id.not_in(imports_without_spectra(campaigns)),
            Import.bytes_deleted_at.is_(None),
            Job.state.in_(ENDED),
            Job.finished_at < before,
        )
        .order_by(Import.id)
        .limit(MOST)
        .with_for_update(skip_locked=True, of=Import)
    )
    by_campaign: dict[UUID, list[Import]] = {}
    for row in session.scalars(query):
        by_campaign.setdefault(row.campaign_id, []).append(row)
    for campaign_id in old_samples(session, campaigns, before, MOST):
        by_campaign.setdefault(campaign_id, [])
    for campaign_id, rows in by_campaign.items():
        _delete(session, campaign_of(session, campaign_id), rows, before, now)
    delete_unused_bytes(session, [row.sha256 for rows in by_campaign.values() for row in rows], now)
    return sum(max(1, len(rows)) for rows in by_campaign.values())


def _delete(
    session: Session, campaign: Campaign, rows: Sequence[Import], before: datetime, now: datetime
) -> None:
    """Note that the bytes of imports into a campaign are gone, and those of its old time blocks."""
    sizes = original_sizes(session, [row.sha256 for row in rows])
    for row in rows:
        row.bytes_deleted_at = now
    session.flush()
    for sha256, size in sizes.items():
        if not has_file(session, campaign, sha256):
            book(session, campaign_for, campaign, "files", -size)
    delete_recorded(session, [row.id for row in rows], now)
    blocks, samples = delete_samples(session, campaign.id, before, now)
    book(session, campaign_for, campaign, "records", -samples)
    audit(
        session,
        None,
        "campaign.retention",
        "campaign",
        campaign.id,
        campaign_for.project_of(session, campaign),
        files={row.filename: row.sha256.hex() for row in rows},
        time_blocks=blocks,
    )
