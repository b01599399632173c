"""The last saved state of a job that runs: written by its attempt alone, gone when the job ends."""

from __future__ import annotations

from uuid import UUID

from sqlalchemy import delete, func, select
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.jobs.tables import Job, JobCheckpoint


def save(session: Session, job_id: UUID, attempt: int, data: bytes) -> None:
    """Keep a state in place of the one before; from an attempt that is no longer the present one, nothing is kept."""
    present = select(Job.id).where(Job.id == job_id, Job.attempt == attempt, Job.state == "running")
    if session.scalar(present.with_for_update(key_share=True)) is None:
        return
    new = insert(JobCheckpoint).values(job_id=job_id, attempt=attempt, data=data)
    values = {"attempt": attempt, "data": data, "saved_at": func.now()}
    session.execute(new.on_conflict_do_update(index_elements=["job_id"], set_=values))


def load(session: Session, job_id: UUID) -> bytes | None:
    """The last state that an attempt has saved; None where none has."""
    return session.scalar(select(JobCheckpoint.data).where(JobCheckpoint.job_id == job_id))


def forget(session: Session, job_id: UUID) -> None:
    """Drop the state of a job that ends."""
    session.execute(delete(JobCheckpoint).where(JobCheckpoint.job_id == job_id))
