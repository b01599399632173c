"""Putting a job in the queue: its row and its dispatch are one transaction."""

from __future__ import annotations

from uuid import UUID

from procrastinate import App, SyncPsycopgConnector
from sqlalchemy.orm import Session

from service.jobs.kinds import JobKind
from service.jobs.tables import Job

TASK = "modalbase.run"

_dispatcher = App(connector=SyncPsycopgConnector())  # never opened: it defers on the caller's connection


def enqueue(session: Session, *, kind: JobKind, project_id: UUID, priority: int = 0) -> Job:
    """A new queued job, in the caller's transaction: after a rollback there is neither row nor dispatch.

    Args:
        session: the caller's transaction.
        kind: what to run.
        project_id: whose job it is.
        priority: higher runs first.

    Returns:
        The job's row, flushed, so that its id can be another table's key.
    """
    job = Job(
        kind=kind.name, project_id=project_id, queue=kind.queue, priority=priority, max_attempts=kind.max_attempts
    )
    session.add(job)
    session.flush()
    session.refresh(job)
    dispatch(session, job)
    return job


def dispatch(session: Session, job: Job) -> None:
    """Hand a queued job's id to the queue, in the caller's transaction."""
    raw = session.connection().connection.driver_connection
    _dispatcher.configure_task(TASK, queue=job.queue, priority=job.priority, connection=raw).defer(job_id=str(job.id))
