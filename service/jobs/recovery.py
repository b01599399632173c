"""Jobs that nobody works on any more: they wait again, or are given up. Every worker looks with each of its heartbeats."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import structlog
from procrastinate import jobs
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.jobs import ledger, tickets
from service.jobs.dispatch import alone
from service.jobs.tables import Job

log = structlog.stdlib.get_logger("modalbase.worker")


def recover_stalled(session: Session, seconds: float) -> None:
    """Recover the jobs of workers that have not been heard of for so long."""
    if tickets.stalled(session, seconds):
        alone(session)  # nobody begins one of these again while it is decided about
        _recover(session, tickets.stalled(session, seconds), "worker {worker} died")


def recover_strays(session: Session, worker_id: int, known: Collection[int]) -> None:
    """Recover what a worker is said to run and does not: its start or its end was lost with a connection."""
    strays = [ticket for ticket in tickets.held_by(session, worker_id) if ticket.id not in known]
    _recover(session, strays, "the database went away")


def _recover(session: Session, found: Iterable[jobs.Job], why: str) -> None:
    for ticket in found:
        running = select(Job).where(
            Job.ticket == ticket.id, Job.state == "running", Job.id == ticket.task_kwargs["job_id"]
        )
        job = session.scalars(running.with_for_update(skip_locked=True)).one_or_none()
        if job is not None:  # else its end is being written at this moment
            done = ledger.lose(session, job, why.format(worker=job.worker))
            log.warning("job without a worker", job_id=str(job.id), action=done)
