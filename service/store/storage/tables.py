"""The table of what each project stores."""

from __future__ import annotations

from uuid import UUID

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Big, Identified


class StoredBytes(Identified, Base):
    """Bytes that one request or job stored; negative where it removed some. It goes with what it was stored for."""

    __tablename__ = "stored_bytes"
    __table_args__ = (
        Index(None, "project_id", "kind", "size"),  # sums are read from the index alone
        Index(None, "structure_id"),
        Index(None, "campaign_id"),
    )

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    structure_id: Mapped[UUID | None] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    campaign_id: Mapped[UUID | None] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    kind: Mapped[str]
    size: Mapped[Big]
