"""Putting jobs in the queue and taking wishes about them: a row and its dispatch are one transaction.

A dispatch is a ticket for one job of a queue, no more: which of the waiting jobs it starts is decided when a worker
comes with it (`service.jobs.claims`). A ticket too many does no harm; one too few is made up for by `top_up`.
"""

from __future__ import annotations

from datetime import UTC, datetime
from uuid import UUID

from procrastinate import App, SyncPsycopgConnector
from sqlalchemy import func, select, text
from sqlalchemy.orm import Session

from service.jobs import checkpoints
from service.jobs.kinds import JobKind
from service.jobs.tables import Job
from service.problems.errors import Conflict
from service.problems.request_id import current_request_id

TASK = "modalbase.run"

_dispatcher = App(connector=SyncPsycopgConnector())  # never opened: it defers on the caller's connection

# Tickets that are missing in a queue: jobs that may start now, less the tickets that wait.
_MISSING = text("""
    WITH startable AS (
      SELECT queue, least(waiting, greatest(cast(:limit AS bigint) - busy, 0)) AS jobs
      FROM (SELECT queue, project_id, count(*) AS waiting FROM jobs WHERE state = 'queued' GROUP BY queue, project_id) q
      CROSS JOIN LATERAL
        (SELECT count(*) AS busy FROM jobs r WHERE r.state = 'running' AND r.project_id = q.project_id) r
    )
    SELECT queue, cast(sum(jobs) AS bigint)
      - (SELECT count(*) FROM procrastinate_jobs WHERE status = 'todo' AND queue_name = queue) AS missing
    FROM startable GROUP BY queue
""")
_NO_LIMIT = 2**40


def enqueue(session: Session, *, kind: JobKind, project_id: UUID, priority: int = 0) -> Job:
    """A new queued job, in the caller's transaction: after a rollback there is neither row nor dispatch.

    Args:
        session: the caller's transaction.
        kind: what to run.
        project_id: whose job it is.
        priority: of the project's waiting jobs, the highest runs first; between projects it counts for nothing.

    Returns:
        The job's row, flushed, so that its id can be another table's key.
    """
    job = Job(
        kind=kind.name,
        project_id=project_id,
        queue=kind.queue,
        priority=priority,
        max_attempts=kind.max_attempts,
        request_id=current_request_id(),
    )
    session.add(job)
    session.flush()
    session.refresh(job)
    dispatch(session, job)
    return job


def dispatch(session: Session, job: Job) -> None:
    """Hand a queued job's id to the queue, in the caller's transaction."""
    _tickets(session, job.queue, [{"job_id": str(job.id)}])


def top_up(session: Session, project_limit: int | None) -> int:
    """Add the tickets that are missing: of workers that died with one, or that came while a project was at its limit.

    Returns:
        How many were added.
    """
    added = 0
    for queue, missing in session.execute(_MISSING, {"limit": project_limit or _NO_LIMIT}):
        if missing > 0:
            _tickets(session, queue, [{"job_id": None}] * missing)
            added += missing
    return added


def request_cancel(session: Session, job_id: UUID) -> Job:
    """Ask for a job's end, in the caller's transaction: a waiting one is cancelled now, a running one by its worker.

    A job that has ended already stays as it is; look at `state`.
    """
    job = _locked(session, job_id)
    if job.state == "queued":
        job.state, job.message, job.finished_at = "cancelled", "cancelled on request", datetime.now(UTC)
        checkpoints.forget(session, job_id)
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
    dispatch(session, job)
    return job


def one_at_a_time(session: Session, key: str) -> None:
    """Hold up other transactions that come with the same key until this one ends: for `Idempotency-Key`."""
    session.execute(select(func.pg_advisory_xact_lock(func.hashtextextended(key, 0))))


def _locked(session: Session, job_id: UUID) -> Job:
    return session.get_one(Job, job_id, with_for_update=True, populate_existing=True)


def _tickets(session: Session, queue: str, arguments: list[dict[str, str | None]]) -> None:
    raw = session.connection().connection.driver_connection
    task = _dispatcher.configure_task(TASK, queue=queue, connection=raw)
    task.batch_defer(*arguments)  # type: ignore[arg-type]  # a list of str or None is JSON, which its type cannot know
