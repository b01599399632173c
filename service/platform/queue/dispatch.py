"""The policy: which waiting job starts when a worker has a free place.

Projects take turns, so that one with a thousand jobs does not keep another's one waiting: the
project with the fewest jobs running goes first, then the one that was served longest ago; one at
its limit waits. Within a project a job that workers have died with goes after those that none has,
so that one that kills its workers does not keep the others waiting; then the highest priority goes
first, then the oldest job. Who asks has a free place, and one asks at a time, in some milliseconds,
so that turns and limits hold exactly, whatever the number of workers and machines.

Jobs that nobody works on any more wait again, or are given up. Every worker looks for them with
each of its heartbeats.
"""

from collections.abc import Collection, Iterable
from uuid import UUID

import structlog
from procrastinate import jobs
from sqlalchemy import func, select, text, update
from sqlalchemy.orm import Session

from service.platform.queue import queue, queue_adapter
from service.platform.queue.tables import Job

log = structlog.stdlib.get_logger("modalbase.worker")

DISPATCH_LOCK = 0x6D6F_6461_6C63  # an advisory lock of our own

# all where :queues is NULL
_MINE = "state = 'queued' AND queue = ANY(cast(:queues AS varchar[])) IS NOT FALSE"
_WAITING = text(f"SELECT EXISTS (SELECT FROM jobs WHERE {_MINE})")
_NEXT = text(f"""
    SELECT first.id
    FROM (
      SELECT DISTINCT ON (project_id) id, project_id, priority FROM jobs
      WHERE {_MINE}
      ORDER BY project_id, losses, priority DESC, id
    ) first
    CROSS JOIN LATERAL (
      SELECT count(*) AS busy FROM jobs r WHERE r.state = 'running' AND r.project_id = first.project_id
    ) running
    CROSS JOIN LATERAL (
      SELECT max(started_at) AS served FROM jobs s WHERE s.project_id = first.project_id
    ) history
    WHERE cast(:limit AS bigint) IS NULL OR busy < :limit
    ORDER BY busy, served NULLS FIRST, first.id
    LIMIT 1
""")


def begin_next(
    session: Session, queues: Iterable[str] | None, worker: str, project_limit: int | None
) -> Job | None:
    """Begin the next attempt of the job whose turn it is.

    Args:
        session: a transaction of its own.
        queues: which queues; None: all.
        worker: whose free place it is.
        project_limit: jobs of one project that may run at a time.

    Returns:
        The job, now running; None where none may start.
    """
    parameters = {"queues": None if queues is None else list(queues), "limit": project_limit}
    if not session.scalar(_WAITING, parameters):
        return None
    lock_dispatch(session)
    while (chosen := session.scalar(_NEXT, parameters)) is not None:
        if (job := _begin(session, chosen, worker)) is not None:
            return job  # else it was cancelled at this moment
    return None


def lock_dispatch(session: Session) -> None:
    """Wait until no other transaction begins jobs, and keep others from it until this one ends."""
    session.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": DISPATCH_LOCK})


def _begin(session: Session, job_id: UUID, worker: str) -> Job | None:
    return session.scalars(
        update(Job)
        .where(Job.id == job_id, Job.state == "queued")
        .values(
            state="running",
            attempt=Job.attempt + 1,
            worker=worker,
            started_at=func.clock_timestamp(),
            stage="starting",
            progress=0,
            message=None,
            error=None,
        )
        .returning(Job)
    ).one_or_none()


def recover_stalled(session: Session, seconds: float) -> None:
    """Recover the jobs of workers that have not been heard of for so long."""
    if queue_adapter.stalled(session, seconds):
        lock_dispatch(session)  # nobody begins one of these again while it is decided about
        _recover(session, queue_adapter.stalled(session, seconds), "worker {worker} died")


def recover_strays(session: Session, worker_id: int, known: Collection[int]) -> None:
    """Recover what a worker is said to run and does not: its start or its end was lost with a
    connection.
    """
    strays = [
        ticket for ticket in queue_adapter.held_by(session, worker_id) if ticket.id not in known
    ]
    _recover(session, strays, "the database went away")


def _recover(session: Session, orphans: Iterable[jobs.Job], why: str) -> None:
    for ticket in orphans:
        running = select(Job).where(
            Job.ticket == ticket.id, Job.state == "running", Job.id == ticket.task_kwargs["job_id"]
        )
        job = session.scalars(running.with_for_update(skip_locked=True)).one_or_none()
        if job is not None:  # else its end is being written at this moment
            done = queue.mark_lost(session, job, why.format(worker=job.worker))
            log.warning("job without a worker", job_id=str(job.id), action=done)
