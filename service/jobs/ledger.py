"""Every change of a job's row by a worker, with its ticket's, each fenced by the attempt: what an attempt that is no
longer the present one writes, hits nothing. A job here is its row as its attempt began it.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any
from uuid import UUID

from sqlalchemy import Update, delete, func, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.jobs import tickets
from service.jobs.child import Failure
from service.jobs.tables import Job, JobCheckpoint

UNTOLD = ("extra", "trace")


class SupersededError(Exception):
    """The job is no longer this attempt's: it was cancelled, or another worker has it."""


def advance(session: Session, job: Job, stage: str, progress: float) -> None:
    """Note how far the attempt is."""
    session.execute(_fenced(job).values(stage=stage, progress=progress))


def succeed(session: Session, job: Job) -> None:
    """Mark the job done, in the transaction of its result.

    Raises:
        SupersededError: it is no longer this attempt's; roll back.
    """
    _finish(session, job, state="succeeded", stage="done", progress=1)


def fail(session: Session, job: Job, failure: Failure) -> None:
    """Mark the job failed, with the reason.

    Raises:
        SupersededError: it is no longer this attempt's.
    """
    _finish(session, job, state="failed", message=failure.detail, error=_shown(failure))


def cancelled(session: Session, job: Job, why: str = "cancelled on request") -> None:
    """Mark the job cancelled.

    Raises:
        SupersededError: it is no longer this attempt's.
    """
    _finish(session, job, state="cancelled", message=why)


def give_back(session: Session, job: Job, why: str) -> str:
    """Let a running job, locked, wait again, or cancel it if that was asked for. What it has saved stays.

    Returns:
        What was done, for the log.
    """
    if job.cancel_requested:
        cancelled(session, job)
        return "cancelled"
    job.state, job.worker, job.message = "queued", None, why
    job.stage, job.progress, job.queued_at = None, 0.0, func.now()
    session.flush()
    tickets.put_back(session, job)
    return "queued again"


def lose(session: Session, job: Job, why: str) -> str:
    """Decide about a running job, locked, whose attempt is lost: give it back, or fail it when that happened too often.

    Returns:
        What was done, for the log.
    """
    job.losses += 1
    if job.cancel_requested or job.losses < job.max_attempts:
        return give_back(session, job, f"{why}; queued again")
    detail = f"lost {job.losses} times, the last time because {why}; it is not tried again by itself"
    fail(session, job, Failure("lost", "WorkerDied", detail))
    return "failed"


def locked(session: Session, job: Job) -> Job:
    """The row of a running attempt, locked.

    Raises:
        SupersededError: it is no longer this attempt's.
    """
    its = select(Job).where(Job.id == job.id, Job.attempt == job.attempt, Job.state == "running")
    if (present := session.scalars(its.with_for_update()).one_or_none()) is None:
        raise SupersededError
    return present


def _fenced(job: Job) -> Update:
    return (
        update(Job)
        .where(Job.id == job.id, Job.attempt == job.attempt, Job.state == "running")
        .execution_options(synchronize_session=False)
    )


def _finish(session: Session, job: Job, **values: Any) -> None:
    ended = _fenced(job).values(finished_at=func.clock_timestamp(), **values).returning(Job.ticket, Job.queue)
    row = session.execute(ended).one_or_none()
    if row is None:
        raise SupersededError
    tickets.end(session, row.ticket, row.queue)
    forget_checkpoint(session, job.id)


def _shown(failure: Failure) -> dict[str, Any]:
    shown = {key: value for key, value in asdict(failure).items() if key not in UNTOLD and value is not None}
    return shown | (failure.extra or {})


# What a long job has saved on its way: written by its attempt alone, gone when the job ends.


def save_checkpoint(session: Session, job_id: UUID, attempt: int, data: bytes) -> None:
    """Keep a state in place of the one before; from an attempt that is no longer the present one, nothing is kept."""
    present = select(Job.id).where(Job.id == job_id, Job.attempt == attempt, Job.state == "running")
    if session.scalar(present.with_for_update(key_share=True)) is None:
        return
    new = insert(JobCheckpoint).values(job_id=job_id, attempt=attempt, data=data)
    values = {"attempt": attempt, "data": data, "saved_at": func.now()}
    session.execute(new.on_conflict_do_update(index_elements=["job_id"], set_=values))


def load_checkpoint(session: Session, job_id: UUID) -> bytes | None:
    """The last state that an attempt has saved; None where none has."""
    return session.scalar(select(JobCheckpoint.data).where(JobCheckpoint.job_id == job_id))


def forget_checkpoint(session: Session, job_id: UUID) -> None:
    """Drop the state of a job that ends."""
    session.execute(delete(JobCheckpoint).where(JobCheckpoint.job_id == job_id))
