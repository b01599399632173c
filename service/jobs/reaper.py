"""Finding jobs that nobody works on any more. Every live worker looks, outside the queue; one at a time reaps."""

from __future__ import annotations

from collections.abc import Collection
from uuid import UUID

from sqlalchemy import func, select, text
from sqlalchemy.orm import Session

from service.jobs import ledger
from service.jobs.queue import top_up
from service.jobs.tables import Job

BATCH = 100
REAPER_LOCK = 0x6D6F_6461_6C72  # an advisory lock of our own
CLAIMING = text("interval '10 seconds'")  # a claim is younger than this until its worker knows of it

Reaped = list[tuple[str, str]]
"""Job id and what was done with it, for the log."""


def reap(session: Session, project_limit: int | None) -> Reaped:
    """Queue jobs of dead workers again, or fail those that were lost too often; make up for lost dispatches."""
    if not session.scalar(text("SELECT pg_try_advisory_xact_lock(:key)"), {"key": REAPER_LOCK}):
        return []
    lapsed = select(Job).where(Job.state == "running", Job.lease_until < func.now()).order_by(Job.id).limit(BATCH)
    done = [
        (str(job.id), ledger.lose(session, job, f"worker {job.worker} died"))
        for job in session.scalars(lapsed.with_for_update(skip_locked=True))
    ]
    if added := top_up(session, project_limit):
        done.append(("-", f"{added} lost dispatches made up for"))
    return done


def disown(session: Session, worker: str, running: Collection[UUID]) -> Reaped:
    """Give back what this worker is said to run and does not: its claim or its end was lost with a connection."""
    strays = select(Job).where(
        Job.state == "running",
        Job.worker == worker,
        Job.id.not_in(running),
        Job.started_at < func.now() - CLAIMING,
    )
    return [
        (str(job.id), ledger.lose(session, job, "the database went away"))
        for job in session.scalars(strays.with_for_update(skip_locked=True))
    ]
