"""How a job is shown."""

from __future__ import annotations

from typing import Any

from service.jobs.tables import Job

ENDED = ("succeeded", "failed", "cancelled")
"""States that a job does not leave by itself."""


def job_state(job: Job) -> dict[str, Any]:
    """A job as the API shows it, to be merged into the answer of a feature."""
    return {
        "id": job.id,
        "status": job.state,
        "stage": job.stage,
        "progress": job.progress,
        "attempt": job.attempt,
        "message": job.message,
        "error": job.error,
        "created_at": job.created_at,
        "started_at": job.started_at,
        "finished_at": job.finished_at,
    }
