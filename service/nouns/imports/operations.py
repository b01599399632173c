"""Imports: an uploaded file, its job, and what became of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import ForeignKey, Index, Select, func, select
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.compute.reading import Kept, ReadingInputs, read_upload
from service.nouns.campaigns.operations import campaign_for, campaign_of
from service.nouns.frfs.operations import quantities_of, remove_frfs, writing_frfs
from service.nouns.imports.intake import Intake
from service.nouns.modes.operations import remove_mode_sets
from service.nouns.records.operations import RecordIntake, remove_records
from service.nouns.storage import book
from service.nouns.storage.originals import (
    forget_originals,
    keep_original,
    original_sizes,
    write_original,
)
from service.nouns.structures.models import models_files
from service.platform.access import Lookup, User
from service.platform.db.base import Base, one_at_a_time
from service.platform.errors import Conflict
from service.platform.queue.kinds import REQUESTS
from service.platform.queue.resource import ENDED, JobNoun, job_of
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign
    from service.platform.web.uploads import Spooled


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


def _load(session: Session, row: Import, workspace: Path) -> ReadingInputs:
    """Put the original on the worker's disk."""
    path = workspace / "original"
    write_original(session, row.sha256, path)
    stated = (row.quantity, row.filename, row.format, row.kind, row.mapping, row.dry_run)
    return ReadingInputs(path, *stated)  # type: ignore[arg-type]  # the columns hold what the route let in


def _store(session: Session, row: Import, items: Iterator[Kept]) -> None:
    """Take in a file. A dry run goes the same way and writes the report alone.

    Raises:
        Conflict: a grid point of the file lies elsewhere than the campaign has it.
        QuotaExceeded: the project has no room for what is in the file.
        PayloadTooLarge: more is in the file than one import may bring.
        Invalid: nothing at all of the file could be read.
    """
    # Imports into one campaign are stored one after the other, so that each sees the points of the
    # one before.
    one_at_a_time(session, str(row.campaign_id))
    size = original_sizes(session, [row.sha256])[row.sha256]
    with RecordIntake() as records:
        intake = Intake(session, row, size, records)
        with writing_frfs(session) as write_frf:
            for item in items:
                intake.take(item, write_frf)
        intake.finish()


import_for = Lookup(Import, "import", "campaign_id", campaign_for)
IMPORTS = JobNoun("imports", import_for, _load, read_upload, _store)


def start_import(
    session: Session,
    user: User,
    campaign_id: UUID,
    file: Spooled,
    draft: Import,
    *,
    urgent: bool = False,
) -> tuple[Import, bool]:
    """Store the file and queue its reading, in one transaction.

    The same bytes are not read into a campaign twice: the import that has them, or is about to, is
    returned instead. Bytes that the campaign has as another quantity or kind are refused.

    Args:
        session: the request's transaction.
        user: who asks; an editor of the project at least.
        campaign_id: the campaign that takes the file.
        file: where it lies, with its SHA-256.
        draft: the row to be: what the client calls the file, and what to do with it.
        urgent: a request waits for it: it has a queue of its own, and is read also where the
            campaign has these bytes already.

    Returns:
        The import, and whether it is a new one.

    Raises:
        Conflict: the campaign has these bytes as another quantity or kind.
        QuotaExceeded: the project has no room for the file.
    """
    campaign = campaign_for(session, user, campaign_id, "editor", lock=True)
    draft.campaign_id, draft.sha256 = campaign.id, file.sha256
    if not draft.dry_run and (known := _same_bytes(session, draft)) is not None:
        _require_alike(session, known, draft)
        if not urgent:
            return known, False
    if not _has_file(session, campaign, file.sha256):
        book(session, campaign_for, campaign, "files", file.size)
    keep_original(session, file)
    queue = REQUESTS if urgent else None
    return IMPORTS.start(session, user, draft, queue=queue, sha256=file.sha256.hex()), True


def _has_file(session: Session, campaign: Campaign, sha256: bytes) -> bool:
    """Whether an import into the campaign has brought this file already, be it a dry run or one
    that failed.
    """
    query = select(Import.id).where(Import.campaign_id == campaign.id, Import.sha256 == sha256)
    return session.scalars(query.limit(1)).first() is not None


def _same_bytes(session: Session, draft: Import) -> Import | None:
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


def _require_alike(session: Session, known: Import, draft: Import) -> None:
    """Refuse bytes that an import has read as something else than is stated now.

    Raises:
        Conflict: it has; names both, and the import.
    """
    quantities = [known.quantity] if known.quantity else quantities_of(session, known.id)
    for name, read in (("quantity", quantities), ("kind", [known.kind] if known.kind else [])):
        stated = getattr(draft, name)
        if stated is None or read == [stated]:
            continue
        state = (
            f"has read it as {' and '.join(read)}"
            if read
            else f"reads it without a stated {name}, or found none"
        )
        raise Conflict(
            f"{name} is {stated}, and import {known.id} ({known.filename}) {state}; where that is"
            f" wrong, DELETE /imports/{known.id} first, then send the file again"
        )


def remove_import(session: Session, user: User, row: Import) -> None:
    """Remove what a file brought into its campaign: FRFs, time blocks and modes; grid points stay,
    and so does the audit trail.

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
    remove_mode_sets(session, row.id)
    size = original_sizes(session, [row.sha256])[row.sha256]
    session.delete(row)
    session.flush()
    if not _has_file(session, campaign, row.sha256):
        book(session, campaign_for, campaign, "files", -size)
    session.delete(job)
    session.flush()
    forget_originals(session, select(Import.sha256), models_files())


def campaigns_with(jobs: Select[UUID]) -> Select[UUID]:
    """Keys of the campaigns that some imports, by their jobs, are into, as part of a query."""
    return select(Import.campaign_id).where(Import.id.in_(jobs))


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
