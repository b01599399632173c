"""Tables of campaigns and what was measured in them."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import ForeignKey, Index, func
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Big, Identified


class Campaign(Identified, Base):
    """One measurement of a structure. A deleted campaign keeps its row, so that results keep their lineage."""

    __tablename__ = "campaigns"
    __table_args__ = (Index(None, "structure_id", "id"),)

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    name: Mapped[str]
    boundary: Mapped[str]
    performed_at: Mapped[datetime | None]
    temperature_c: Mapped[float | None]
    humidity_percent: Mapped[float | None]
    instruments: Mapped[dict[str, Any]]
    frame: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    inputs: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    notes: Mapped[str] = mapped_column(default="")
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    deleted_at: Mapped[datetime | None]


class GridPointRow(Base):
    """A measurement point, in the file's coordinates."""

    __tablename__ = "grid_points"

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"), primary_key=True)
    label: Mapped[Big] = mapped_column(primary_key=True)
    x_m: Mapped[float]
    y_m: Mapped[float]
    z_m: Mapped[float]
