"""Every change of a job's row by a worker, each fenced by the attempt: what an attempt that is no longer the present
one writes, hits nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import timedelta
from typing import Any
from uuid import UUID

from sqlalchemy import CursorResult, Update, cast, func, select, update
from sqlalchemy.dialects.postgresql import INTERVAL
from sqlalchemy.orm import Session

from service.jobs import checkpoints
from service.jobs.child import Failure
from service.jobs.queue import dispatch
from service.jobs.tables import Job

UNTOLD = ("extra", "trace")


class SupersededError(Exception):
    """The job is no longer this attempt's: it was cancelled, or another worker has it."""


def advance(session: Session, job_id: UUID, attempt: int, stage: str, progress: float) -> None:
    """Note how far the attempt is."""
    session.execute(_fenced(job_id, attempt).values(stage=stage, progress=progress))


def succeed(session: Session, job_id: UUID, attempt: int) -> None:
    """Mark the job done, in the transaction of its result.

    Raises:
        SupersededError: it is no longer this attempt's; roll back.
    """
    _finish(session, job_id, attempt, state="succeeded", stage="done", progress=1)


def fail(session: Session, job_id: UUID, attempt: int, failure: Failure) -> None:
    """Mark the job failed, with the reason.

    Raises:
        SupersededError: it is no longer this attempt's.
    """
    _finish(session, job_id, attempt, state="failed", message=failure.detail, error=_shown(failure))


def cancelled(session: Session, job_id: UUID, attempt: int) -> None:
    """Mark the job cancelled.

    Raises:
        SupersededError: it is no longer this attempt's.
    """
    _finish(session, job_id, attempt, state="cancelled", message="cancelled on request")


def give_back(session: Session, job: Job, why: str) -> None:
    """Put a running job in the queue again, with its dispatch. What it has saved stays."""
    job.state, job.worker, job.lease_until, job.message = "queued", None, None, why
    job.stage, job.progress, job.queued_at = None, 0.0, func.now()
    session.flush()
    dispatch(session, job)


def lose(session: Session, job: Job, why: str) -> str:
    """Decide about a running job, locked, whose attempt is lost: cancel it if that was asked for, queue it again, or
    fail it when that has happened too often.

    Returns:
        What was done, for the log.
    """
    job.losses += 1
    if job.cancel_requested:
        cancelled(session, job.id, job.attempt)
        return "cancelled"
    if job.losses < job.max_attempts:
        give_back(session, job, f"{why}; queued again")
        return "queued again"
    detail = f"lost {job.losses} times, the last time because {why}; it is not tried again by itself"
    fail(session, job.id, job.attempt, Failure("lost", "WorkerDied", detail))
    return "failed"


def locked(session: Session, job_id: UUID, attempt: int) -> Job:
    """The row of a running attempt, locked.

    Raises:
        SupersededError: it is no longer this attempt's.
    """
    job = session.scalars(
        select(Job).where(Job.id == job_id, Job.attempt == attempt, Job.state == "running").with_for_update()
    ).one_or_none()
    if job is None:
        raise SupersededError
    return job


def renew(session: Session, worker: str, job_ids: Sequence[UUID], lease: timedelta) -> set[UUID]:
    """Prolong the leases of a worker's jobs; those that are still its own."""
    mine = (Job.id.in_(job_ids), Job.worker == worker, Job.state == "running")
    return set(session.scalars(update(Job).where(*mine).values(lease_until=_from_now(lease)).returning(Job.id)))


def cancel_requests(session: Session, job_ids: Sequence[UUID]) -> set[UUID]:
    """Which of these jobs someone wants to end."""
    return set(session.scalars(select(Job.id).where(Job.id.in_(job_ids), Job.cancel_requested)))


def _fenced(job_id: UUID, attempt: int) -> Update:
    return (
        update(Job)
        .where(Job.id == job_id, Job.attempt == attempt, Job.state == "running")
        .execution_options(synchronize_session=False)
    )


def _finish(session: Session, job_id: UUID, attempt: int, **values: Any) -> None:
    hit = session.execute(
        _fenced(job_id, attempt).values(finished_at=func.clock_timestamp(), lease_until=None, **values)
    )
    assert isinstance(hit, CursorResult)
    if hit.rowcount != 1:
        raise SupersededError
    checkpoints.forget(session, job_id)


def _from_now(lease: timedelta) -> Any:
    return func.clock_timestamp() + cast(lease, INTERVAL)


def _shown(failure: Failure) -> dict[str, Any]:
    shown = {key: value for key, value in asdict(failure).items() if key not in UNTOLD and value is not None}
    return shown | (failure.extra or {})
