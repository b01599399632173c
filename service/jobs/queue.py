"""Putting a job in the queue: its row and its dispatch are one transaction."""

from __future__ import annotations

from datetime import UTC, datetime
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


def request_cancel(session: Session, job_id: UUID) -> Job:
    """Ask for a job's end, in the caller's transaction: a waiting one is cancelled now, a running one by its worker.

    A job that has ended already stays as it is; look at `state`.
    """
    job = session.get_one(Job, job_id, with_for_update=True, populate_existing=True)
    if job.state == "queued":
        job.state, job.message, job.finished_at = "cancelled", "cancelled on request", datetime.now(UTC)
    if job.state == "running":
        job.cancel_requested = True
    session.flush()
    return job
