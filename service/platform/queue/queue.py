"""Every change of a job's row, with its ticket's, in one transaction: what a request asks for, and
what a worker writes.

What a worker writes is fenced by the attempt: one that is no longer the present one hits nothing. A
worker's job is its row as its attempt began it.
"""

from datetime import UTC, datetime
from typing import Any
from uuid import UUID

from sqlalchemy import delete, exists, func, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.platform.db.base import Base
from service.platform.errors import Conflict
from service.platform.logs import current_request_id
from service.platform.queue import queue_adapter
from service.platform.queue.child import CANCELLED, PURGED, Failure
from service.platform.queue.kinds import JobKind
from service.platform.queue.tables import Job, JobCheckpoint


def enqueue(
    session: Session,
    *,
    kind: JobKind,
    project_id: UUID,
    priority: int = 0,
    queue: str | None = None,
) -> Job:
    """A new queued job, in the caller's transaction: after a rollback there is neither row nor
    ticket.

    Args:
        session: the caller's transaction.
        kind: what to run.
        project_id: whose job it is.
        priority: of the project's waiting jobs, the highest runs first; between projects it counts
            for nothing.
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
    queue_adapter.put(session, job)
    return job


def request_cancel(session: Session, job_id: UUID) -> Job:
    """Ask for a job's end, in the caller's transaction: a waiting one is cancelled now, a running
    one by its worker.

    A job that has ended already stays as it is; look at `state`.
    """
    job = _row(session, job_id)
    if job.state in ("queued", "running"):
        queue_adapter.cancel(session, job)
    if job.state == "queued":
        job.state, job.message, job.finished_at = "cancelled", CANCELLED.detail, datetime.now(UTC)
        forget_checkpoint(session, job_id)
    if job.state == "running":
        job.cancel_requested = True
    session.flush()
    return job


def retry(session: Session, job_id: UUID) -> Job:
    """Put a job that failed or was cancelled in the queue again, from its beginning, in the
    caller's transaction.

    Raises:
        Conflict: it waits, runs or has succeeded.
    """
    job = _row(session, job_id)
    if job.state not in ("failed", "cancelled"):
        raise Conflict(
            f"the job is {job.state}; only one that failed or was cancelled can be tried again"
        )
    job.state, job.stage, job.progress, job.message, job.error = "queued", None, 0.0, None, None
    job.worker, job.started_at, job.finished_at = None, None, None
    job.cancel_requested, job.losses = False, 0
    job.queued_at, job.request_id = func.now(), current_request_id()
    session.flush()
    session.refresh(job)
    queue_adapter.put(session, job)
    return job


def queue_again(session: Session) -> None:
    """Queue every job that waited or ran, with tickets of its own: a restored database has no
    others, and no worker. One that ran and was asked to end is cancelled.
    """
    session.execute(update(Job).values(ticket=None))
    queue_adapter.drop_left(session)
    for job in session.scalars(
        select(Job).where(Job.state.in_(("queued", "running"))).order_by(Job.id)
    ):
        job.state, job.worker, job.stage, job.progress = "queued", None, None, 0.0
        queue_adapter.put(session, job)
        session.flush()
        if job.cancel_requested:
            request_cancel(session, job.id)


def cancel_purged(session: Session, project_id: UUID) -> None:
    """Cancel the waiting and running jobs of a project that have lost what they are for, in the
    transaction of its purge.

    That is a row of a feature's table with the job's id. A worker lets go of a job whose ticket is
    gone.
    """
    of_features = [
        table.c.id
        for table in Base.metadata.tables.values()
        if "id" in table.c
        and any(key.column is Job.__table__.c.id for key in table.c.id.foreign_keys)
    ]
    at_work = (Job.project_id == project_id, Job.state.in_(("queued", "running")))
    lost = [~exists().where(key == Job.id) for key in of_features]
    ended = {"state": "cancelled", "message": PURGED.detail, "finished_at": func.now()}
    for key in session.scalars(
        update(Job).where(*at_work, *lost).values(ended).returning(Job.id)
    ).all():
        forget_checkpoint(session, key)
    queue_adapter.drop_left(session)


def _row(session: Session, job_id: UUID) -> Job:
    return session.get_one(Job, job_id, with_for_update=True, populate_existing=True)


class SupersededError(Exception):
    """The job is no longer this attempt's: it was cancelled, or another worker has it."""


def _present(job: Job) -> tuple[Any, ...]:
    return Job.id == job.id, Job.attempt == job.attempt, Job.state == "running"


def advance(session: Session, job: Job, stage: str, progress: float) -> None:
    """Note how far the attempt is."""
    noted = update(Job).where(*_present(job)).values(stage=stage, progress=progress)
    session.execute(noted.execution_options(synchronize_session=False))


def locked(session: Session, job: Job) -> Job:
    """The row of a running attempt, locked, so that it can be ended.

    Raises:
        SupersededError: it is no longer this attempt's; roll back.
    """
    its = select(Job).where(*_present(job)).with_for_update(key_share=True)
    present = session.scalars(its, execution_options={"populate_existing": True}).one_or_none()
    if present is None:
        raise SupersededError
    return present


def succeed(session: Session, job: Job) -> None:
    """Mark a job done, locked, in the transaction of its result."""
    job.stage, job.progress = "done", 1
    _finish(session, job, "succeeded")


def end(session: Session, job: Job, failure: Failure) -> str:
    """Write what the end of an attempt that did not succeed means for its job, locked.

    Returns:
        What was done, for the log.
    """
    match failure.reason:
        case "cancelled":
            job.message = failure.detail
            return _finish(session, job, "cancelled")
        case "drained":
            return _requeue(session, job, failure.detail)
        case "lost":
            return mark_lost(session, job, failure.detail)
    return _fail(session, job, failure)


def mark_lost(session: Session, job: Job, why: str) -> str:
    """Decide about a job, locked, whose attempt is lost: it waits again, or fails when that
    happened too often.

    Returns:
        What was done, for the log.
    """
    job.losses += 1
    if job.cancel_requested or job.losses < job.max_attempts:
        return _requeue(session, job, f"{why}; queued again")
    detail = (
        f"lost {job.losses} times, the last time because {why}; it is not tried again by itself"
    )
    return _fail(session, job, Failure("lost", "WorkerDied", detail))


def _requeue(session: Session, job: Job, why: str) -> str:
    """Let it wait again, or cancel it if that was asked for. What it has saved stays."""
    if job.cancel_requested:
        return end(session, job, CANCELLED)
    job.state, job.worker, job.message = "queued", None, why
    job.stage, job.progress, job.queued_at = None, 0.0, func.now()
    session.flush()
    queue_adapter.requeue(session, job)
    return "queued again"


def _fail(session: Session, job: Job, failure: Failure) -> str:
    job.message, job.error = failure.detail, failure.shown()
    return _finish(session, job, "failed")


def _finish(session: Session, job: Job, state: str) -> str:
    job.state, job.finished_at = state, func.clock_timestamp()
    session.flush()
    queue_adapter.end(session, job)
    forget_checkpoint(session, job.id)
    return state


# What a long job has saved on its way: written by its attempt alone, gone when the job ends.


def save_checkpoint(session: Session, job: Job, data: bytes) -> None:
    """Keep a state in place of the one before; from an attempt that is no longer the present one,
    nothing is kept.
    """
    present = select(Job.id).where(*_present(job)).with_for_update(key_share=True)
    if session.scalar(present) is not None:
        values = {"attempt": job.attempt, "data": data, "saved_at": func.now()}
        new = insert(JobCheckpoint).values(job_id=job.id, **values)
        session.execute(new.on_conflict_do_update(index_elements=["job_id"], set_=values))


def load_checkpoint(session: Session, job_id: UUID) -> bytes | None:
    """The last state that an attempt has saved; None where none has."""
    return session.scalar(select(JobCheckpoint.data).where(JobCheckpoint.job_id == job_id))


def forget_checkpoint(session: Session, job_id: UUID) -> None:
    """Drop the state of a job that ends."""
    session.execute(delete(JobCheckpoint).where(JobCheckpoint.job_id == job_id))
