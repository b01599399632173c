"""The jobs' table: the truth about every job; and what long ones have saved on their way."""

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import BigInteger, CheckConstraint, ForeignKey, Index, LargeBinary, desc, func, text
from sqlalchemy.orm import Mapped, mapped_column

from service.platform.access.tables import Project
from service.platform.db.base import Base, Identified

CHANGED = "modalbase_job_changed"
"""Channel of the ids of jobs whose visible state has changed."""


class Job(Identified, Base):
    """One job. Feature tables (imports, update jobs …) have its id as their key.

    `attempt` is the fence: a result is stored only by the attempt that the row names. `losses`
    counts the attempts whose worker died. `ticket` is the engine's job that runs it, there from the
    first to the last moment of the states `queued` and `running`. `version` grows with every change
    that a client can see: a trigger counts it and notifies the channel above at commit, so who
    changes a row need not think of who watches it.
    """

    __tablename__ = "jobs"
    __table_args__ = (
        CheckConstraint(
            "state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')", "state"
        ),
        CheckConstraint("progress BETWEEN 0 AND 1", "progress"),
        Index(
            "ix_jobs_running_project_id", "project_id", postgresql_where=text("state = 'running'")
        ),
        Index("ix_jobs_project_id_id", "project_id", "id"),
        Index("ix_jobs_project_id_started_at", "project_id", "started_at"),
        Index(
            "ix_jobs_queued",
            "queue",
            "project_id",
            "losses",
            desc("priority"),
            "id",
            postgresql_where=text("state = 'queued'"),
        ),
    )

    kind: Mapped[str]
    project_id: Mapped[UUID] = mapped_column(ForeignKey(Project.id, ondelete="CASCADE"))
    queue: Mapped[str]
    state: Mapped[str] = mapped_column(server_default="queued")
    priority: Mapped[int] = mapped_column(server_default="0")
    attempt: Mapped[int] = mapped_column(server_default="0")
    losses: Mapped[int] = mapped_column(server_default="0")
    max_attempts: Mapped[int] = mapped_column(server_default="3")
    worker: Mapped[str | None]
    ticket: Mapped[int | None] = mapped_column(BigInteger)
    stage: Mapped[str | None]
    progress: Mapped[float] = mapped_column(server_default="0")
    message: Mapped[str | None]
    error: Mapped[dict[str, Any] | None]
    queued_at: Mapped[datetime] = mapped_column(server_default=func.now())
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]
    cancel_requested: Mapped[bool] = mapped_column(server_default=text("false"))
    request_id: Mapped[str | None]
    version: Mapped[int] = mapped_column(server_default="0")


class JobCheckpoint(Base):
    """What a running job needs to go on after a kill: the last state that its computation saved."""

    __tablename__ = "job_checkpoints"

    job_id: Mapped[UUID] = mapped_column(
        ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True
    )
    attempt: Mapped[int]
    saved_at: Mapped[datetime] = mapped_column(server_default=func.now())
    data: Mapped[bytes] = mapped_column(LargeBinary)
