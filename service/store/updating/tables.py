"""Tables of update jobs and their results."""

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import JSON, Float, ForeignKey, Index, LargeBinary, func
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Labelled, label_indexes
from service.store.updating.result_schemas import CONSTANTS


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
    structure_version_id: Mapped[UUID] = mapped_column(
        ForeignKey("structure_versions.id", deferrable=True)
    )
    recipe: Mapped[dict[str, Any]]
    idempotency_key: Mapped[str | None]  # of versions before `idempotency_keys`, which has it too


class JointUpdate(Base):
    """One update of a material from several campaigns, and its result when it has one; its key is
    its job's.
    """

    __tablename__ = "joint_updates"
    __table_args__ = (Index(None, "project_id", "idempotency_key", unique=True),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    request: Mapped[dict[str, Any]]
    campaigns: Mapped[list[Any]]
    idempotency_key: Mapped[str | None]  # as above
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


class UpdateResult(Labelled, Base):
    """The result of a job, as the contract shows it, and its predicted FRFs as npz.

    Results are found by their campaign, which is the job's, by their verdict, and by `CONSTANTS`:
    the estimate of each, such as `ex`, its standard deviation `ex_sd`, and the ends of its 95 %
    interval, `ex_low` and `ex_high`. Others, such as those of sets, are in `constants`: by name
    `estimate`, `sd`, `low`, `high`.
    """

    __tablename__ = "update_results"
    __table_args__ = label_indexes("update_results")

    id: Mapped[UUID] = mapped_column(
        ForeignKey("update_jobs.id", ondelete="CASCADE"), primary_key=True
    )
    campaign_id: Mapped[UUID] = mapped_column(
        ForeignKey("campaigns.id", ondelete="CASCADE"), index=True
    )
    created_at: Mapped[datetime] = mapped_column(server_default=func.now())
    verdict: Mapped[str | None]
    constants: Mapped[dict[str, Any]] = mapped_column(server_default="{}", default=dict)
    # keeps the order of its members, which JSONB does not
    document: Mapped[dict[str, Any]] = mapped_column(JSON)
    prediction: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)


for _name in CONSTANTS:
    for _end in ("", "_sd", "_low", "_high"):
        setattr(
            UpdateResult,
            _column := f"{_name}{_end}".lower(),
            mapped_column(_column, Float, index=not _end),
        )
