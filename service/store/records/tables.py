"""Tables of time blocks and of the processings that made FRFs of them."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from sqlalchemy import JSON, ForeignKey, Index, LargeBinary
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Big, Identified


class Record(Identified, Base):
    """One channel's time block of one hit, in SI; its samples lie out of line and are loaded only when asked for."""

    __tablename__ = "records"
    __table_args__ = (
        Index(None, "campaign_id", "id"),
        Index(
            "ix_records_hit",
            "campaign_id",
            "force_point",
            "force_direction",
            "hit",
            "quantity",
            "point",
            "direction",
            unique=True,
        ),
        Index(None, "import_id"),
    )

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id", deferrable=True))
    label: Mapped[str]
    filename: Mapped[str]
    quantity: Mapped[str]
    point: Mapped[Big]
    direction: Mapped[int]
    force_point: Mapped[Big]
    force_direction: Mapped[int]
    hit: Mapped[Big]
    sample_rate_hz: Mapped[float]
    samples: Mapped[int]
    sensitivity: Mapped[float]
    window_rate_per_s: Mapped[float]
    full_scale: Mapped[float | None]
    dtype: Mapped[str]
    sha256: Mapped[bytes]
    data: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)


class Processing(Base):
    """One processing of a campaign's records; its key is its job's."""

    __tablename__ = "processings"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    options: Mapped[dict[str, Any]]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
