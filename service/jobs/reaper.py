"""Finding jobs that nobody works on any more: their worker died, or died between the queue and the row."""

from __future__ import annotations

from datetime import timedelta

from sqlalchemy import Select, cast, func, select, text
from sqlalchemy.dialects.postgresql import INTERVAL
from sqlalchemy.orm import Session

from service.jobs import ledger
from service.jobs.child import Failure
from service.jobs.queue import dispatch
from service.jobs.tables import Job

BATCH = 100


def reap(session: Session, lease: timedelta) -> list[tuple[str, str]]:
    """Queue jobs of dead workers again, or fail those that were begun too often.

    Returns:
        Job id and what was done with it, for the log.
    """
    lapsed = select(Job).where(Job.state == "running", Job.lease_until < func.now())
    done = []
    for job in session.scalars(lapsed.limit(BATCH).with_for_update(skip_locked=True)):
        if job.attempt < job.max_attempts:
            ledger.give_back(session, job, f"worker {job.worker} died; queued again")
            done.append((str(job.id), "queued again"))
        else:
            detail = f"{job.attempt} workers died with this job; it is not tried again"
            ledger.fail(session, job.id, job.attempt, Failure("lost", "WorkerDied", detail))
            done.append((str(job.id), "failed"))
    for job in session.scalars(_undispatched(lease).limit(BATCH).with_for_update(skip_locked=True)):
        dispatch(session, job)
        job.queued_at = func.now()
        done.append((str(job.id), "dispatched again"))
    return done


def _undispatched(lease: timedelta) -> Select[Job]:
    """Jobs that wait without being in the queue: the worker that fetched them died before it claimed them.

    A dispatch too many does no harm: claiming is what counts, and one claims.
    """
    waiting = text(
        "NOT EXISTS (SELECT FROM procrastinate_jobs q WHERE q.status = 'todo' AND q.args->>'job_id' = jobs.id::text)"
    )
    return select(Job).where(Job.state == "queued", Job.queued_at < func.now() - cast(lease, INTERVAL), waiting)
