"""Tables of imports and of the files that were uploaded."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import ForeignKey, Index, LargeBinary, func
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Big


class Original(Base):
    """An uploaded file under its SHA-256; its bytes are in `original_chunks`."""

    __tablename__ = "originals"

    sha256: Mapped[bytes] = mapped_column(primary_key=True)
    size: Mapped[Big]
    created_at: Mapped[datetime] = mapped_column(server_default=func.now())


class OriginalChunk(Base):
    """A stretch of an uploaded file, of a size that fills a page: the table's `toast_tuple_target` keeps it there."""

    __tablename__ = "original_chunks"

    sha256: Mapped[bytes] = mapped_column(ForeignKey("originals.sha256", ondelete="CASCADE"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True)
    data: Mapped[bytes] = mapped_column(LargeBinary)


class Import(Base):
    """One reading of an uploaded file into a campaign; its key is its job's, and so is its status."""

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
