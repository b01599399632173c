"""Tables of update jobs and their results."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import JSON, ForeignKey, Index, LargeBinary, func
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base


class UpdateJob(Base):
    """One update of a campaign; its key is its job's, and so is its status."""

    __tablename__ = "update_jobs"
    __table_args__ = (
        Index(None, "campaign_id", "id"),
        Index(None, "project_id", "idempotency_key", unique=True),
    )

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    structure_version_id: Mapped[UUID] = mapped_column(ForeignKey("structure_versions.id", deferrable=True))
    recipe: Mapped[dict[str, Any]]
    idempotency_key: Mapped[str | None]


class JointUpdate(Base):
    """One update of a material from several campaigns, and its result when it has one; its key is its job's."""

    __tablename__ = "joint_updates"
    __table_args__ = (Index(None, "project_id", "idempotency_key", unique=True),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    request: Mapped[dict[str, Any]]
    campaigns: Mapped[list[Any]]
    idempotency_key: Mapped[str | None]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


class UpdateResult(Base):
    """The result of a job, as the contract shows it, and its predicted FRFs as npz."""

    __tablename__ = "update_results"

    id: Mapped[UUID] = mapped_column(ForeignKey("update_jobs.id", ondelete="CASCADE"), primary_key=True)
    created_at: Mapped[datetime] = mapped_column(server_default=func.now())
    verdict: Mapped[str | None]
    document: Mapped[dict[str, Any]] = mapped_column(JSON)  # keeps the order of its members, which JSONB does not
    prediction: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)


class ResultConstant(Base):
    """A constant of a result with its 95 % interval, by which results are found; the document says more."""

    __tablename__ = "result_constants"
    __table_args__ = (Index(None, "name", "estimate", "result_id"),)

    result_id: Mapped[UUID] = mapped_column(ForeignKey("update_results.id", ondelete="CASCADE"), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    estimate: Mapped[float]
    standard_deviation: Mapped[float | None]
    low: Mapped[float | None]
    high: Mapped[float | None]
