"""Tables of campaigns and what was measured in them."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any
from uuid import UUID

from sqlalchemy import JSON, BigInteger, CheckConstraint, ForeignKey, Index, LargeBinary, func, text
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Identified

Big = Annotated[int, mapped_column(BigInteger)]
"""Point labels have up to ten digits in a UFF file, and files may be larger than 2 GiB."""


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
    notes: Mapped[str] = mapped_column(default="")
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    deleted_at: Mapped[datetime | None]


class GridPoint(Base):
    """A measurement point, in the file's coordinates."""

    __tablename__ = "grid_points"

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"), primary_key=True)
    label: Mapped[Big] = mapped_column(primary_key=True)
    x_m: Mapped[float]
    y_m: Mapped[float]
    z_m: Mapped[float]


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

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id"), primary_key=True)
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    filename: Mapped[str]
    sha256: Mapped[bytes] = mapped_column(ForeignKey("originals.sha256"))
    dry_run: Mapped[bool]
    quantity: Mapped[str | None]
    counts: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    datasets: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True))
    warnings: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True))


class Frf(Identified, Base):
    """One FRF. Spectra lie in their own columns, out of line and uncompressed, and are loaded only when asked for."""

    __tablename__ = "frfs"
    __table_args__ = (
        Index(None, "campaign_id", "id"),
        Index(None, "campaign_id", "response_point", "id"),
        Index(None, "import_id", "dataset", unique=True),
        CheckConstraint("(step_hz IS NULL) = (axis IS NOT NULL)", name="axis"),
    )

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id"))
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


class ModeSet(Identified, Base):
    """Modes of a campaign: typed in, from a file, or identified."""

    __tablename__ = "mode_sets"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id"))
    job_id: Mapped[UUID | None] = mapped_column(ForeignKey("jobs.id", ondelete="SET NULL"))
    name: Mapped[str]
    origin: Mapped[str]
    covariance: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True))
    details: Mapped[dict[str, Any]] = mapped_column(server_default=text("'{}'"))


class Identification(Base):
    """One identification of modes from a campaign's FRFs; its key is its job's. Its mode set names it as `job_id`."""

    __tablename__ = "identifications"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id"), primary_key=True)
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
