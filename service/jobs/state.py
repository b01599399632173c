"""How a job is shown."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal
from uuid import UUID

from pydantic import Field

from service.jobs.tables import Job
from service.web import StrictModel

JobState = Literal["queued", "running", "succeeded", "failed", "cancelled"]

ENDED = ("succeeded", "failed", "cancelled")
"""States that a job does not leave by itself."""


class JobOut(StrictModel):
    """How far a job is: what the answers of all features that run one begin with."""

    id: UUID
    status: JobState
    stage: str | None
    progress: float = Field(description="0 to 1")
    attempt: int
    message: str | None
    error: dict[str, Any] | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None


def job_state(job: Job) -> dict[str, Any]:
    """A job as the API shows it, the fields of `JobOut`."""
    return {name: job.state if name == "status" else getattr(job, name) for name in JobOut.model_fields}
