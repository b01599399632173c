"""The table of FRFs."""

from __future__ import annotations

from uuid import UUID

from sqlalchemy import CheckConstraint, ForeignKey, Index, LargeBinary
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Big, Identified


class Frf(Identified, Base):
    """One FRF. Spectra lie in their own columns, out of line and uncompressed, and are loaded only when asked for."""

    __tablename__ = "frfs"
    __table_args__ = (
        Index(None, "campaign_id", "id"),
        Index(None, "campaign_id", "response_point", "id"),
        Index(None, "import_id", "dataset", unique=True),
        Index(None, "processing_id"),
        CheckConstraint("(step_hz IS NULL) = (axis IS NOT NULL)", name="axis"),
    )

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id", deferrable=True))
    dataset: Mapped[int | None]
    label: Mapped[str]
    response_point: Mapped[Big]
    response_direction: Mapped[int]
    reference_point: Mapped[Big]
    reference_direction: Mapped[int]
    quantity: Mapped[str]
    averages: Mapped[int | None]
    start_hz: Mapped[float]
    end_hz: Mapped[float]
    step_hz: Mapped[float | None]
    lines: Mapped[int]
    dtype: Mapped[str]
    sha256: Mapped[bytes]
    coherence_dtype: Mapped[str | None]
    coherence_sha256: Mapped[bytes | None]
    axis: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    data: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    coherence: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    processing_id: Mapped[UUID | None] = mapped_column(ForeignKey("processings.id"))
    window_rate_per_s: Mapped[float | None]
    variance_sha256: Mapped[bytes | None]
    variance: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
