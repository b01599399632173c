"""The jobs' table: the truth about every job."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import CheckConstraint, ForeignKey, Index, func, text
from sqlalchemy.orm import Mapped, mapped_column

from service.db.base import Base, Identified


class Job(Identified, Base):
    """One job. Feature tables (imports, update jobs …) have its id as their key.

    `attempt` is the fence: a result is stored only by the attempt that the row names.
    """

    __tablename__ = "jobs"
    __table_args__ = (
        CheckConstraint("state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')", "state"),
        CheckConstraint("progress BETWEEN 0 AND 1", "progress"),
        Index("ix_jobs_running_lease_until", "lease_until", postgresql_where=text("state = 'running'")),
        Index("ix_jobs_project_id_id", "project_id", "id"),
    )

    kind: Mapped[str]
    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    queue: Mapped[str]
    state: Mapped[str] = mapped_column(server_default="queued")
    priority: Mapped[int] = mapped_column(server_default="0")
    attempt: Mapped[int] = mapped_column(server_default="0")
    max_attempts: Mapped[int] = mapped_column(server_default="3")
    worker: Mapped[str | None]
    lease_until: Mapped[datetime | None]
    stage: Mapped[str | None]
    progress: Mapped[float] = mapped_column(server_default="0")
    message: Mapped[str | None]
    error: Mapped[dict[str, Any] | None]
    queued_at: Mapped[datetime] = mapped_column(server_default=func.now())
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]
    cancel_requested: Mapped[bool] = mapped_column(server_default=text("false"))
