"""Imports as rows: what became of a file, and what rests on it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import ColumnElement, ForeignKey, Index, Select, and_, func, or_, select
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, Session, aliased, mapped_column

from service.nouns.campaigns.operations import among_campaigns, campaign_for, campaign_of
from service.nouns.frfs.operations import remove_frfs
from service.nouns.modes.operations import remove_mode_sets
from service.nouns.recordings.operations import remove_recordings
from service.nouns.records.operations import remove_records
from service.nouns.storage import book
from service.nouns.storage.originals import (
    forget_originals,
    original_sizes,
)
from service.platform.access import Lookup, User
from service.platform.db.base import Base
from service.platform.errors import Conflict
from service.platform.queue.resource import ENDED, job_of
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign


class Import(Base):
    """One reading of an uploaded file into a campaign; its key is its job's, and so is its
    status.
    """

    __tablename__ = "imports"
    __table_args__ = (Index(None, "campaign_id", "sha256"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    filename: Mapped[str]
    sha256: Mapped[bytes] = mapped_column(ForeignKey("originals.sha256"))
    dry_run: Mapped[bool]
    quantity: Mapped[str | None]
    format: Mapped[str | None]
    kind: Mapped[str | None]
    mapping: Mapped[Any | None] = mapped_column(JSONB(none_as_null=True))
    found: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    counts: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    datasets: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True))
    warnings: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True))
    trace_lines: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True), deferred=True)
    bytes_deleted_at: Mapped[datetime | None]  # of its file, by a retention rule


REPORT_BYTES = func.pg_column_size(Import.datasets)
"""Of the report on an import's datasets, which makes its row heavy."""

import_for = Lookup(Import, "import", "campaign_id", campaign_for)


def new_import(**stated: Any) -> Import:
    """A row to be: what the client calls a file, and what to do with it."""
    return Import(**stated)


def has_file(session: Session, campaign: Campaign, sha256: bytes) -> bool:
    """Whether an import into the campaign has brought this file already, be it a dry run or one
    that failed, and no retention rule has deleted it.
    """
    query = select(Import.id).where(
        Import.campaign_id == campaign.id,
        Import.sha256 == sha256,
        Import.bytes_deleted_at.is_(None),
    )
    return session.scalars(query.limit(1)).first() is not None


def same_bytes(session: Session, draft: Import) -> Import | None:
    """The import that has these bytes, read by the same mapping, or is about to."""
    same_mapping = (
        Import.mapping.is_(None) if draft.mapping is None else Import.mapping == draft.mapping
    )
    return session.scalars(
        select(Import)
        .join(Job, Job.id == Import.id)
        .where(
            Import.campaign_id == draft.campaign_id,
            Import.sha256 == draft.sha256,
            same_mapping,
            ~Import.dry_run,
            Job.state.in_(("queued", "running", "succeeded")),
        )
        .order_by(Import.id)
        .limit(1)
    ).one_or_none()


def imports_into(
    structure_id: UUID, sha256s: Sequence[bytes] = (), *, deleted: bool = False
) -> Select[Import]:
    """The query of imports into a structure's campaigns, or into its deleted ones, without dry
    runs; with digests those of these bytes alone.
    """
    campaigns = among_campaigns(structure_id, deleted=deleted)
    query = select(Import).where(Import.campaign_id.in_(campaigns), ~Import.dry_run)
    return query.where(Import.sha256.in_(sha256s)) if sha256s else query


def known_bytes(session: Session, structure_id: UUID, sha256: bytes) -> Import | None:
    """The import into a structure that has these bytes: one that was read or will be before one
    that failed, and the newest of them.

    Raises:
        Conflict: a deleted campaign has them.
    """
    for deleted in (False, True):
        query = imports_into(structure_id, [sha256], deleted=deleted)
        unread = Job.state.in_(("failed", "cancelled"))
        order = (unread, Import.id.desc())
        row = session.scalars(query.join(Job, Job.id == Import.id).order_by(*order)).first()
        if row is not None and deleted:
            raise Conflict(
                f"campaign {row.campaign_id}, which is deleted, has these bytes: restore or purge it"
            )
        if row is not None:
            return row
    return None


def left_unread(session: Session, structure_id: UUID, name: str, filename: str) -> UUID | None:
    """The newest campaign of a structure, by its name, of which all that is known is that files of
    one name could not be read; None where there is none.
    """
    campaigns = among_campaigns(structure_id, deleted=False, name=name)
    unread = Job.state.in_(("failed", "cancelled")), Import.filename == filename
    return session.scalars(
        select(Import.campaign_id)
        .join(Job, Job.id == Import.id)
        .where(Import.campaign_id.in_(campaigns), ~Import.dry_run)
        .group_by(Import.campaign_id)
        .having(func.bool_and(and_(*unread)))
        .order_by(Import.campaign_id.desc())
        .limit(1)
    ).first()


def is_listed() -> ColumnElement[bool]:
    """The condition that an import is in lists: a dry run leaves once its file was read."""
    other = aliased(Import)
    same = other.campaign_id == Import.campaign_id, other.sha256 == Import.sha256
    read = select(other.id).join(Job, Job.id == other.id).where(*same, ~other.dry_run)
    return or_(~Import.dry_run, ~read.where(Job.state == "succeeded").exists())


def remove_import(session: Session, user: User, row: Import) -> None:
    """Remove what a file brought into its campaign: FRFs, time blocks, recordings and modes; grid
    points stay, and so does the audit trail.

    Args:
        session: the request's transaction.
        user: who asks; that the user may is known.
        row: the import, locked.

    Raises:
        Conflict: it waits or runs.
    """
    job = job_of(session, row)
    if job.state not in ENDED:
        raise Conflict(f"the import is {job.state}; delete it when it has ended")
    import_for.note(session, user, row, "delete", sha256=row.sha256.hex(), counts=row.counts)
    campaign = campaign_of(session, row.campaign_id)
    book(session, campaign_for, campaign, "frfs", -remove_frfs(session, row.id))
    book(session, campaign_for, campaign, "records", -remove_records(session, row.id))
    book(session, campaign_for, campaign, "spectra", -remove_recordings(session, row.id))
    remove_mode_sets(session, row.id)
    there = row.bytes_deleted_at is None
    size = original_sizes(session, [row.sha256])[row.sha256]
    session.delete(row)
    session.flush()
    if there and not has_file(session, campaign, row.sha256):
        book(session, campaign_for, campaign, "files", -size)
    session.delete(job)
    session.flush()
    forget_originals(session)


def campaigns_with(jobs: Select[UUID]) -> Select[UUID]:
    """Keys of the campaigns that some imports, by their jobs, are into, as part of a query."""
    return select(Import.campaign_id).where(Import.id.in_(jobs))


def imports_from(first: UUID) -> Select[UUID]:
    """Campaigns to which imports came whose keys are at least this one, as part of a query."""
    return select(Import.campaign_id).where(Import.id >= first)


def import_progress(
    session: Session, campaign_ids: Sequence[UUID]
) -> dict[UUID, tuple[int, datetime | None]]:
    """How many imports into each campaign wait or run, and when the last one ended; without any it
    is left out.
    """
    coming = func.count().filter(Job.state.in_(("queued", "running")))
    query = (
        select(Import.campaign_id, coming, func.max(Job.finished_at))
        .join(Job, Job.id == Import.id)
        .where(Import.campaign_id.in_(campaign_ids), ~Import.dry_run)
        .group_by(Import.campaign_id)
    )
    return {campaign: (count, at) for campaign, count, at in session.execute(query)}


def trace_lines_of(session: Session, campaign_id: UUID) -> list[list[int]]:
    """Labels of the points along each trace line of a campaign's files, whoever asks; 0 lifts the
    pen.
    """
    query = select(Import.trace_lines).where(
        Import.campaign_id == campaign_id,
        Import.dry_run.is_(False),
        Import.trace_lines.is_not(None),
    )
    return [line for lines in session.scalars(query.order_by(Import.id)) for line in lines or ()]
