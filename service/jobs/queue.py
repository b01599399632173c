"""What is asked of the queue: a new job, its end, another try. A job's row and its ticket are one transaction."""

from __future__ import annotations

from datetime import UTC, datetime
from uuid import UUID

from sqlalchemy import exists, func, select, text, update
from sqlalchemy.orm import Session

from service.db.base import Base
from service.errors import Conflict
from service.jobs import tickets
from service.jobs.child import CANCELLED, PURGED
from service.jobs.kinds import JobKind
from service.jobs.ledger import forget_checkpoint
from service.jobs.tables import Job
from service.logs import current_request_id


def enqueue(session: Session, *, kind: JobKind, project_id: UUID, priority: int = 0, queue: str | None = None) -> Job:
    """A new queued job, in the caller's transaction: after a rollback there is neither row nor ticket.

    Args:
        session: the caller's transaction.
        kind: what to run.
        project_id: whose job it is.
        priority: of the project's waiting jobs, the highest runs first; between projects it counts for nothing.
        queue: the queue that it waits in; default: its kind's.

    Returns:
        The job's row, flushed, so that its id can be another table's key.
    """
    job = Job(
        kind=kind.name,
        project_id=project_id,
        queue=queue or kind.queue,
        priority=priority,
        max_attempts=kind.max_attempts,
        request_id=current_request_id(),
    )
    session.add(job)
    session.flush()
    session.refresh(job)
    tickets.put(session, job)
    return job


def request_cancel(session: Session, job_id: UUID) -> Job:
    """Ask for a job's end, in the caller's transaction: a waiting one is cancelled now, a running one by its worker.

    A job that has ended already stays as it is; look at `state`.
    """
    job = _locked(session, job_id)
    if job.state in ("queued", "running"):
        tickets.cancel(session, job)
    if job.state == "queued":
        job.state, job.message, job.finished_at = "cancelled", CANCELLED.detail, datetime.now(UTC)
        forget_checkpoint(session, job_id)
    if job.state == "running":
        job.cancel_requested = True
    session.flush()
    return job


def retry(session: Session, job_id: UUID) -> Job:
    """Put a job that failed or was cancelled in the queue again, from its beginning, in the caller's transaction.

    Raises:
        Conflict: it waits, runs or has succeeded.
    """
    job = _locked(session, job_id)
    if job.state not in ("failed", "cancelled"):
        raise Conflict(f"the job is {job.state}; only one that failed or was cancelled can be tried again")
    job.state, job.stage, job.progress, job.message, job.error = "queued", None, 0.0, None, None
    job.worker, job.started_at, job.finished_at = None, None, None
    job.cancel_requested, job.losses = False, 0
    job.queued_at, job.request_id = func.now(), current_request_id()
    session.flush()
    session.refresh(job)
    tickets.put(session, job)
    return job


def queue_again(session: Session) -> None:
    """Queue every job that waited or ran, with tickets of its own: a restored database has no others, and no worker. One that
    ran and was asked to end is cancelled.
    """
    session.execute(text("DELETE FROM procrastinate_jobs"))
    session.execute(update(Job).values(ticket=None))
    for job in session.scalars(select(Job).where(Job.state.in_(("queued", "running"))).order_by(Job.id)):
        job.state, job.worker, job.stage, job.progress = "queued", None, None, 0.0
        tickets.put(session, job)
        session.flush()
        if job.cancel_requested:
            request_cancel(session, job.id)


def cancel_purged(session: Session, project_id: UUID) -> None:
    """Cancel the waiting and running jobs of a project that have lost what they are for, in the transaction of its purge.

    That is a row of a feature's table with the job's id. A worker lets go of a job whose ticket is gone.
    """
    of_features = [
        table.c.id
        for table in Base.metadata.tables.values()
        if "id" in table.c and any(key.column is Job.__table__.c.id for key in table.c.id.foreign_keys)
    ]
    at_work = (Job.project_id == project_id, Job.state.in_(("queued", "running")))
    lost = [~exists().where(key == Job.id) for key in of_features]
    ended = {"state": "cancelled", "message": PURGED.detail, "finished_at": func.now()}
    for key in session.scalars(update(Job).where(*at_work, *lost).values(ended).returning(Job.id)).all():
        forget_checkpoint(session, key)
    tickets.drop_left(session)


def one_at_a_time(session: Session, key: str) -> None:
    """Hold up other transactions that come with the same key until this one ends: for `Idempotency-Key`."""
    session.execute(select(func.pg_advisory_xact_lock(func.hashtextextended(key, 0))))


def _locked(session: Session, job_id: UUID) -> Job:
    return session.get_one(Job, job_id, with_for_update=True, populate_existing=True)
