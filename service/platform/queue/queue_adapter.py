"""Tickets: the jobs of the engine underneath (Procrastinate), each of which names the job of ours
that it runs.

A ticket is put in the queue in the transaction that queues the job, and is gone in the transaction
that ends it; in between it changes with the row, so that neither is ever without the other. What is
asked of the engine here goes through its job manager, on the caller's connection; it has no function
that removes a running ticket or wakes idle workers, which are SQL.
"""

import json
from collections.abc import Collection, Coroutine
from datetime import UTC, datetime
from typing import Any, TypeVar

from procrastinate import App, BaseConnector, SyncPsycopgConnector, jobs
from procrastinate.manager import JobManager, get_channel_for_queues
from sqlalchemy import text
from sqlalchemy.orm import Session

from service.platform.queue.tables import Job

TASK = "modalbase.run"
# a time to try again at that has passed, whatever the clocks say
LONG_AGO = datetime(2000, 1, 1, tzinfo=UTC)

# never opened: it defers on the caller's connection
_deferrer = App(connector=SyncPsycopgConnector())

_LEFT = text("""
    DELETE FROM procrastinate_jobs t WHERE task_name = :task AND NOT EXISTS (
      SELECT FROM jobs WHERE ticket = t.id AND state IN ('queued', 'running'))
""")
_NOTICE = text("SELECT pg_notify(channel, :notice) FROM unnest(cast(:channels AS text[])) channel")


Answer = TypeVar("Answer")


class _Transaction(BaseConnector):
    """Connects the engine to a session's transaction; it waits for nothing but the database."""

    def __init__(self, session: Session) -> None:
        self._connection = session.connection()

    async def execute_query_async(self, query: str, **arguments: Any) -> None:
        self._connection.exec_driver_sql(query, arguments)

    async def execute_query_one_async(self, query: str, **arguments: Any) -> dict[str, Any]:
        return dict(self._connection.exec_driver_sql(query, arguments).mappings().one())

    async def execute_query_all_async(self, query: str, **arguments: Any) -> list[dict[str, Any]]:
        return [dict(row) for row in self._connection.exec_driver_sql(query, arguments).mappings()]


def _manager(session: Session) -> JobManager:
    return JobManager(_Transaction(session))


def _answer(coroutine: Coroutine[Any, Any, Answer]) -> Answer:
    """What a coroutine of the engine returns, which never waits on a `_Transaction`."""
    try:
        coroutine.send(None)
    except StopIteration as done:
        answer: Answer = done.value
        return answer
    raise RuntimeError("the engine waits for something else than the database")


def put(session: Session, job: Job, priority: int = 0) -> None:
    """Put a queued job's ticket in the queue; idle workers hear of it at commit."""
    raw = session.connection().connection.driver_connection
    task = _deferrer.configure_task(TASK, queue=job.queue, priority=priority, connection=raw)
    job.ticket = task.defer(job_id=str(job.id))


def requeue(session: Session, job: Job) -> None:
    """Let the ticket of a job that ran wait again."""
    _answer(_manager(session).retry_job_by_id_async(_ticket(job), LONG_AGO, priority=0))
    _wake(session, job.queue)


def cancel(session: Session, job: Job) -> None:
    """Take a waiting job's ticket out of the queue; have the worker abort one that runs."""
    runs = job.state == "running"
    _answer(_manager(session).cancel_job_by_id_async(_ticket(job), abort=runs, delete_job=True))


def end(session: Session, job: Job) -> None:
    """Remove the ticket of a job that ends: one that its project's limit held back may start
    now.
    """
    ended = jobs.Status.SUCCEEDED
    _answer(_manager(session).finish_job_by_id_async(_ticket(job), ended, delete_job=True))
    _wake(session, job.queue)


def drop_left(session: Session) -> None:
    """Remove the tickets of jobs that have ended or are gone without them."""
    session.execute(_LEFT, {"task": TASK})


def take(session: Session, job: Job, worker_id: int) -> jobs.Job:
    """Have the engine fetch a ticket of this job for a worker of its. The engine fetches the
    highest priority first; all tickets wait with 0 until the policy has chosen one, which gets
    another.
    """
    if job.ticket is not None:
        _answer(_manager(session).cancel_job_by_id_async(job.ticket, delete_job=True))
    put(session, job, priority=1)
    session.flush()
    ticket = _answer(_manager(session).fetch_job([job.queue], worker_id))
    if ticket is None or ticket.id != job.ticket:
        raise RuntimeError(f"the queue gave {ticket} for ticket {job.ticket} of job {job.id}")
    return ticket


def stalled(session: Session, seconds: float) -> list[jobs.Job]:
    """Tickets of workers whose heart has not beaten for so long."""
    listing = _manager(session).get_stalled_jobs(task_name=TASK, seconds_since_heartbeat=seconds)
    return list(_answer(listing))


def held_by(session: Session, worker_id: int) -> list[jobs.Job]:
    """Tickets that a worker is said to run."""
    doing = jobs.Status.DOING.value
    listing = _manager(session).list_jobs_async(task=TASK, status=doing, worker_id=worker_id)
    return list(_answer(listing))


def beat(session: Session, worker_id: int) -> None:
    """A worker lives."""
    _answer(_manager(session).update_heartbeat(worker_id))


def to_abort(session: Session, worker_id: int, ticket_ids: Collection[int]) -> list[int]:
    """Which of these tickets a worker should let go of: an abort was asked for, or they are no
    longer its own.
    """
    held = {one.id for one in held_by(session, worker_id) if not one.abort_requested}
    return [one for one in ticket_ids if one not in held]


def _ticket(job: Job) -> int:
    assert job.ticket is not None  # of one that waits or runs
    return job.ticket


def _wake(session: Session, queue: str) -> None:
    """Have idle workers look into a queue, as the insertion of a ticket does; at commit."""
    channels = [*get_channel_for_queues(None), *get_channel_for_queues([queue])]
    session.execute(
        _NOTICE, {"channels": channels, "notice": json.dumps({"type": "job_inserted", "job_id": 0})}
    )
