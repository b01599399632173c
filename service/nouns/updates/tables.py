"""Tables of update jobs and their results."""

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import JSON, Float, ForeignKey, Index, LargeBinary, func
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, mapped_column

from service.nouns.updates.result_schemas import CONSTANTS
from service.platform.db.base import Base, Labelled, label_indexes


class UpdateJob(Base):
    """One update of one campaign or of several; its key is its job's, and so is its status.

    One of several names no single campaign: no lookup that goes by the campaign finds it.
    """

    __tablename__ = "update_jobs"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    # campaign_id, structure_version_id: of the only campaign; NULL of several
    campaign_id: Mapped[UUID] = mapped_column(
        ForeignKey("campaigns.id", ondelete="CASCADE"), nullable=True
    )
    structure_version_id: Mapped[UUID] = mapped_column(
        ForeignKey("structure_versions.id", deferrable=True), nullable=True
    )
    recipe: Mapped[dict[str, Any]]  # of all campaigns
    # as it was sent, of several; None of one
    request: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    campaigns: Mapped[list[Any]]  # `campaign_id` and `structure_version_id` of each

    @property
    def joint(self) -> bool:
        """Whether it is of several campaigns together."""
        return self.request is not None


class UpdateResult(Labelled, Base):
    """The result of a job, as the contract shows it, and its predicted FRFs as npz, which is empty
    of several campaigns.

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
    campaign_id: Mapped[UUID | None] = mapped_column(
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
