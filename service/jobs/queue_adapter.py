"""Tickets: the jobs of the engine underneath (Procrastinate), each of which names the job of ours
that it runs.

A ticket is put in the queue in the transaction that queues the job, and is gone in the transaction
that ends it; in between it changes with the row, so that neither is ever without the other. What is
asked of the engine here are its own queries, on the caller's connection.
"""

import json
from collections.abc import Collection
from datetime import UTC, datetime
from typing import Any, cast

from procrastinate import App, SyncPsycopgConnector, jobs, sql
from procrastinate.manager import get_channel_for_queues
from sqlalchemy import CursorResult, text
from sqlalchemy.orm import Session

from service.jobs.tables import Job

TASK = "modalbase.run"
# a time to try again at that has passed, whatever the clocks say
LONG_AGO = datetime(2000, 1, 1, tzinfo=UTC)

# never opened: it defers on the caller's connection
_deferrer = App(connector=SyncPsycopgConnector())

# The engine fetches the highest priority first. All tickets wait with 0 until the policy has chosen
# one.
_NEXT = text("UPDATE procrastinate_jobs SET priority = 1 WHERE id = :ticket AND status = 'todo'")
_GONE = text("""
    SELECT held FROM unnest(cast(:tickets AS bigint[])) held WHERE NOT EXISTS (
      SELECT FROM procrastinate_jobs
      WHERE id = held AND status = 'doing' AND worker_id = :worker_id AND NOT abort_requested)
""")
_LEFT = text("""
    DELETE FROM procrastinate_jobs t WHERE task_name = :task AND NOT EXISTS (
      SELECT FROM jobs WHERE ticket = t.id AND state IN ('queued', 'running'))
""")
_NOTICE = text("SELECT pg_notify(channel, :notice) FROM unnest(cast(:channels AS text[])) channel")


def put(session: Session, job: Job) -> None:
    """Put a queued job's ticket in the queue; idle workers hear of it at commit."""
    raw = session.connection().connection.driver_connection
    job.ticket = _deferrer.configure_task(TASK, queue=job.queue, connection=raw).defer(
        job_id=str(job.id)
    )


def requeue(session: Session, job: Job) -> None:
    """Let the ticket of a job that ran wait again."""
    _ask(
        session,
        "retry_job",
        job_id=job.ticket,
        retry_at=LONG_AGO,
        new_priority=0,
        new_queue_name=None,
        new_lock=None,
    )
    _wake(session, job.queue)


def cancel(session: Session, job: Job) -> None:
    """Take a waiting job's ticket out of the queue; have the worker abort one that runs."""
    _ask(session, "cancel_job", job_id=job.ticket, abort=job.state == "running", delete_job=True)


def end(session: Session, job: Job) -> None:
    """Remove the ticket of a job that ends: one that its project's limit held back may start
    now.
    """
    _ask(session, "finish_job", job_id=job.ticket, status="succeeded", delete_job=True)
    _wake(session, job.queue)


def drop_left(session: Session) -> None:
    """Remove the tickets of jobs that have ended or are gone without them."""
    session.execute(_LEFT, {"task": TASK})


def take(session: Session, job: Job, worker_id: int) -> jobs.Job:
    """Have the engine fetch the ticket of this job for a worker of its; another one where the
    ticket is gone.
    """
    if not _is_next(session, job):
        put(session, job)
        _is_next(session, job)
    (row,) = _ask(session, "fetch_job", queues=[job.queue], worker_id=worker_id)
    if row["id"] != job.ticket:
        raise RuntimeError(
            f"the queue gave ticket {row['id']} for ticket {job.ticket} of job {job.id}"
        )
    return jobs.Job.from_row(row)


def stalled(session: Session, seconds: float) -> list[jobs.Job]:
    """Tickets of workers whose heart has not beaten for so long."""
    named = {"queue": None, "task_name": TASK, "seconds_since_heartbeat": seconds}
    return [
        jobs.Job.from_row(row) for row in _ask(session, "select_stalled_jobs_by_heartbeat", **named)
    ]


def held_by(session: Session, worker_id: int) -> list[jobs.Job]:
    """Tickets that a worker is said to run."""
    named = dict.fromkeys(("id", "queue_name", "lock", "queueing_lock"))
    named |= {"task_name": TASK, "status": "doing", "worker_id": worker_id}
    return [jobs.Job.from_row(row) for row in _ask(session, "list_jobs", **named)]


def beat(session: Session, worker_id: int) -> None:
    """A worker lives."""
    _ask(session, "update_heartbeat", worker_id=worker_id)


def to_abort(session: Session, worker_id: int, ticket_ids: Collection[int]) -> list[int]:
    """Which of these tickets a worker should let go of: an abort was asked for, or they are no
    longer its own.
    """
    return list(session.scalars(_GONE, {"tickets": list(ticket_ids), "worker_id": worker_id}))


def _wake(session: Session, queue: str) -> None:
    """Have idle workers look into a queue, as the insertion of a ticket does; at commit."""
    channels = [*get_channel_for_queues(None), *get_channel_for_queues([queue])]
    session.execute(
        _NOTICE, {"channels": channels, "notice": json.dumps({"type": "job_inserted", "job_id": 0})}
    )


def _is_next(session: Session, job: Job) -> bool:
    return cast(CursorResult[Any], session.execute(_NEXT, {"ticket": job.ticket})).rowcount == 1


def _ask(session: Session, query: str, **arguments: Any) -> list[dict[str, Any]]:
    rows = session.connection().exec_driver_sql(sql.queries[query], arguments)
    return [dict(row) for row in rows.mappings()]
