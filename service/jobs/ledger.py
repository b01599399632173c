"""Every change of a job's row by a worker, with its ticket's, each fenced by the attempt: what an attempt that is no
longer the present one writes, hits nothing. A job here is its row as its attempt began it.
"""

from __future__ import annotations

from typing import Any
from uuid import UUID

from sqlalchemy import delete, func, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.jobs import tickets
from service.jobs.child import CANCELLED, Failure
from service.jobs.tables import Job, JobCheckpoint


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
    its = select(Job).where(*_present(job)).with_for_update()
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
            return _give_back(session, job, failure.detail)
        case "lost":
            return lose(session, job, failure.detail)
    return _fail(session, job, failure)


def lose(session: Session, job: Job, why: str) -> str:
    """Decide about a job, locked, whose attempt is lost: it waits again, or fails when that happened too often.

    Returns:
        What was done, for the log.
    """
    job.losses += 1
    if job.cancel_requested or job.losses < job.max_attempts:
        return _give_back(session, job, f"{why}; queued again")
    detail = f"lost {job.losses} times, the last time because {why}; it is not tried again by itself"
    return _fail(session, job, Failure("lost", "WorkerDied", detail))


def _give_back(session: Session, job: Job, why: str) -> str:
    """Let it wait again, or cancel it if that was asked for. What it has saved stays."""
    if job.cancel_requested:
        return end(session, job, CANCELLED)
    job.state, job.worker, job.message = "queued", None, why
    job.stage, job.progress, job.queued_at = None, 0.0, func.now()
    session.flush()
    tickets.put_back(session, job)
    return "queued again"


def _fail(session: Session, job: Job, failure: Failure) -> str:
    job.message, job.error = failure.detail, failure.shown()
    return _finish(session, job, "failed")


def _finish(session: Session, job: Job, state: str) -> str:
    job.state, job.finished_at = state, func.clock_timestamp()
    session.flush()
    tickets.end(session, job)
    forget_checkpoint(session, job.id)
    return state


# What a long job has saved on its way: written by its attempt alone, gone when the job ends.


def save_checkpoint(session: Session, job: Job, data: bytes) -> None:
    """Keep a state in place of the one before; from an attempt that is no longer the present one, nothing is kept."""
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
