"""Tables of mode sets, their modes, and identifications."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from sqlalchemy import JSON, ForeignKey, Index, text
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Identified


class ModeSet(Identified, Base):
    """Modes of a campaign: typed in, from a file, or identified."""

    __tablename__ = "mode_sets"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id", deferrable=True))
    job_id: Mapped[UUID | None] = mapped_column(ForeignKey("jobs.id", ondelete="SET NULL"))
    name: Mapped[str]
    origin: Mapped[str]
    covariance: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True))
    details: Mapped[dict[str, Any]] = mapped_column(server_default=text("'{}'"))


class Identification(Base):
    """One identification of modes from a campaign's FRFs; its key is its job's. Its mode set names it as `job_id`."""

    __tablename__ = "identifications"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    options: Mapped[dict[str, Any]]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


class Mode(Base):
    """One mode of a set."""

    __tablename__ = "modes"

    mode_set_id: Mapped[UUID] = mapped_column(ForeignKey("mode_sets.id", ondelete="CASCADE"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True)
    frequency_hz: Mapped[float]
    damping_ratio: Mapped[float | None]
    frequency_sd_hz: Mapped[float | None]
    damping_sd: Mapped[float | None]
    shape: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
