"""Which waiting job a free worker takes: the next one of the project whose turn it is.

Projects take turns, so that one with a thousand jobs does not keep another's one waiting: the project with the fewest
jobs running goes first, then the one that was served longest ago. Within a project a job that workers have died with
goes after those that none has, so that one that kills its workers does not keep the others waiting; then the highest
priority goes first, then the oldest job. One claim happens at a time, in some milliseconds, so that turns and limits
hold exactly.
"""

from __future__ import annotations

from datetime import timedelta
from uuid import UUID

from sqlalchemy import cast, func, text, update
from sqlalchemy.dialects.postgresql import INTERVAL
from sqlalchemy.orm import Session

from service.jobs.tables import Job

CLAIM_LOCK = 0x6D6F_6461_6C63  # an advisory lock of our own

_NEXT = text("""
    SELECT first.id
    FROM (
      SELECT DISTINCT ON (project_id) id, project_id, priority FROM jobs
      WHERE state = 'queued' AND queue = :queue
      ORDER BY project_id, losses, priority DESC, id
    ) first
    CROSS JOIN LATERAL (
      SELECT count(*) AS busy FROM jobs r WHERE r.state = 'running' AND r.project_id = first.project_id
    ) running
    CROSS JOIN LATERAL (
      SELECT max(started_at) AS served FROM jobs s WHERE s.project_id = first.project_id
    ) history
    WHERE cast(:limit AS bigint) IS NULL OR busy < :limit
    ORDER BY busy, served NULLS FIRST, first.id
    LIMIT 1
""")


def claim(session: Session, queue: str, worker: str, lease: timedelta, project_limit: int | None = None) -> Job | None:
    """Begin the next attempt of the job whose turn it is.

    Args:
        session: a transaction of its own.
        queue: name of the queue.
        worker: who claims.
        lease: how long the claim holds without being renewed.
        project_limit: jobs of one project that may run at a time.

    Returns:
        The job, now running; None where none may start.
    """
    session.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": CLAIM_LOCK})
    while (chosen := session.scalar(_NEXT, {"queue": queue, "limit": project_limit})) is not None:
        if (job := _begin(session, chosen, worker, lease)) is not None:
            return job  # else it was cancelled at this moment
    return None


def _begin(session: Session, job_id: UUID, worker: str, lease: timedelta) -> Job | None:
    return session.scalars(
        update(Job)
        .where(Job.id == job_id, Job.state == "queued")
        .values(
            state="running",
            attempt=Job.attempt + 1,
            worker=worker,
            lease_until=func.clock_timestamp() + cast(lease, INTERVAL),
            started_at=func.clock_timestamp(),
            stage="starting",
            progress=0,
            message=None,
            error=None,
        )
        .returning(Job)
    ).one_or_none()
