"""Files that somebody keeps beside a project, structure, campaign, update or monitor: photographs,
drawings, notes. Nothing reads them but people and the report.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from uuid import UUID

from sqlalchemy import ForeignKey, FromClause, Index, func, select, text
from sqlalchemy.orm import Mapped, Session, mapped_column, synonym

from service.platform.db.base import Base, Big, Identified

OWNERS = ("structure_id", "campaign_id", "update_job_id", "monitor_id")
"""Columns that name what an attachment is beside; of a project's own all are empty."""
PHOTOS = ("image/jpeg", "image/png", "image/webp")
SHOWN = (*PHOTOS, "application/pdf")
"""Media types that a browser shows in place; every other file is only downloaded."""
OTHER = "application/octet-stream"


WORDS = (
    "to_tsvector('simple'::regconfig, (translate(name::text, '._-'::text, '   '::text)"
    " || ' '::text) || caption::text)"
)
"""What a free search reads of an attachment: `clamp_side.jpg` by each of its words."""


class Attachment(Identified, Base):
    """A file with its name and a caption; its bytes are an original's."""

    __tablename__ = "attachments"
    __table_args__ = (
        *(Index(None, name, "id") for name in ("project_id", *OWNERS)),
        Index(None, "sha256"),
        Index("ix_attachments_words", text(WORDS), postgresql_using="gin"),
    )

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    structure_id: Mapped[UUID | None] = mapped_column(
        ForeignKey("structures.id", ondelete="CASCADE")
    )
    campaign_id: Mapped[UUID | None] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    update_job_id: Mapped[UUID | None] = mapped_column(
        ForeignKey("update_jobs.id", ondelete="CASCADE")
    )
    monitor_id: Mapped[UUID | None] = mapped_column(ForeignKey("monitors.id", ondelete="CASCADE"))
    joint_id: Mapped[UUID | None] = synonym("update_job_id")
    """The same of an update of several campaigns, which has no campaign's rights."""
    name: Mapped[str]
    caption: Mapped[str]
    media_type: Mapped[str]
    size: Mapped[Big]
    sha256: Mapped[bytes] = mapped_column(ForeignKey("originals.sha256"))


def media_type(beginning: bytes) -> str:
    """The media type of a file that a browser may show, by its first bytes; a name says nothing.

    >>> media_type(b"%PDF-1.7"), media_type(b"<svg onload='x'>")
    ('application/pdf', 'application/octet-stream')
    """
    if beginning.startswith(b"\x89PNG\r\n\x1a\n"):
        return "image/png"
    if beginning.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    if beginning[:4] == b"RIFF" and beginning[8:12] == b"WEBP":
        return "image/webp"
    return "application/pdf" if beginning.startswith(b"%PDF-") else OTHER


def attached_to(session: Session, **among: Iterable[UUID]) -> Sequence[Attachment]:
    """What is beside any of some things, by their column, oldest first, whoever asks."""
    named = (getattr(Attachment, column).in_(set(keys)) for column, keys in among.items())
    return session.scalars(select(Attachment).where(*named).order_by(Attachment.id)).all()


def beside_projects(session: Session, project_ids: Iterable[UUID]) -> Sequence[Attachment]:
    """What is beside projects themselves, oldest first, whoever asks."""
    empty = (getattr(Attachment, column).is_(None) for column in OWNERS)
    its = Attachment.project_id.in_(set(project_ids))
    return session.scalars(select(Attachment).where(its, *empty).order_by(Attachment.id)).all()


def photos_of(
    session: Session, structure_id: UUID, campaign_id: UUID, job_id: UUID
) -> list[Attachment]:
    """The photographs of a report: those of the update first, then of its campaign, then of the
    structure.
    """
    beside = {"update_job_id": job_id, "campaign_id": campaign_id, "structure_id": structure_id}
    rows = (
        row for column, key in beside.items() for row in attached_to(session, **{column: [key]})
    )
    return [row for row in rows if row.media_type in PHOTOS]


def present_attachments() -> FromClause:
    """Those of what is not deleted, for a search."""
    tables = Base.metadata.tables
    attached = tables["attachments"]
    campaign, structure, monitor = (
        tables[name].alias() for name in ("campaigns", "structures", "monitors")
    )
    own = func.coalesce(attached.c.structure_id, campaign.c.structure_id, monitor.c.structure_id)
    joined = (
        attached.outerjoin(campaign, attached.c.campaign_id == campaign.c.id)
        .outerjoin(monitor, attached.c.monitor_id == monitor.c.id)
        .outerjoin(structure, structure.c.id == own)
    )
    there = (one.c.deleted_at.is_(None) for one in (campaign, structure, monitor))
    return select(attached).select_from(joined).where(*there).subquery()
