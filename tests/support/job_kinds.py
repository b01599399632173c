"""Kinds of job for the tests, and a worker that runs them."""

import asyncio
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch
from uuid import UUID

from procrastinate import jobs
from procrastinate.manager import JobManager, NotificationCallback
from sqlalchemy import select
from sqlalchemy.orm import Session

import service.platform.queue.worker
from service.platform.access.tables import AuditEvent
from service.platform.db.engine import make_engine, make_sessions
from service.platform.logs import configure_logs
from service.platform.queue.kinds import REQUESTS, JobKind
from service.platform.queue.manager import Manager
from service.platform.queue.queue import request_cancel
from service.platform.queue.tables import Job
from service.platform.queue.worker import run_worker
from service.platform.settings import Settings
from tests.support import computations

ITEM = "test.item"


def load(session: Session, job_id: UUID, workspace: Path) -> dict[str, Any]:
    kind = session.scalars(select(Job.kind).where(Job.id == job_id)).one()
    (workspace / "input.txt").write_text(kind)
    return {"file": str(workspace / "input.txt"), "worker": os.getpid(), "job": str(job_id)}


def store(session: Session, job_id: UUID, items: Iterator[Any]) -> None:
    """Each item becomes a row; audit events are a table at hand."""
    for item in items:
        session.add(
            AuditEvent(action=ITEM, subject_type="job", subject_id=job_id, detail={"value": item})
        )
        session.flush()


def load_badly(session: Session, job_id: UUID, workspace: Path) -> None:
    raise LookupError(f"nothing to load for {job_id} in {session} and {workspace}")


def store_half(session: Session, job_id: UUID, items: Iterator[Any]) -> None:
    store(session, job_id, iter([next(items)]))
    raise ZeroDivisionError


def load_seconds(session: Session, job_id: UUID, _workspace: Path) -> dict[str, Any]:
    """A second; of an update that a service was asked for, what its recipe's seed says in ms."""
    from service.nouns.updates.tables import UpdateJob  # a fifth of a worker's start

    asked = session.get(UpdateJob, job_id)
    return {"job": str(job_id), "seconds": asked.recipe["seed"] / 1000 if asked else 1.0}


KINDS = {
    kind.name: kind
    for kind in (
        JobKind("echo", load=load, compute=computations.echo, store=store),
        JobKind("asked", load=load, compute=computations.echo, store=store, queue=REQUESTS),
        JobKind("slow", load=load, compute=computations.slow, store=store),
        JobKind("stubborn", load=load, compute=computations.stubborn, store=store),
        JobKind("overdue", load=load, compute=computations.stubborn, store=store, wall_seconds=0.5),
        JobKind(
            "hungry",
            load=load,
            compute=computations.hungry,
            store=store,
            memory_bytes=200 * computations.MIB,
        ),
        JobKind("crashing", load=load, compute=computations.crashing, store=store),
        JobKind("refusing", load=load, compute=computations.refusing, store=store),
        JobKind("diverging", load=load, compute=computations.diverging, store=store),
        JobKind("buggy", load=load, compute=computations.buggy, store=store),
        JobKind("chain", load=load, compute=computations.chain, store=store),
        JobKind("bad load", load=load_badly, compute=computations.echo, store=store),
        JobKind("bad store", load=load, compute=computations.echo, store=store_half),
        # Where every second or so the worker of some job is killed on purpose, a job may well meet
        # that a dozen times.
        JobKind(
            "update", load=load_seconds, compute=computations.busy, store=store, max_attempts=100
        ),
        JobKind("busy", load=load_seconds, compute=computations.busy, store=store, max_attempts=5),
        JobKind("idle", load=load_seconds, compute=computations.idle, store=store, max_attempts=5),
        JobKind("empty", load=lambda *_: None, compute=computations.empty, store=lambda *_: None),
    )
}


def work() -> None:
    """Be a worker of these kinds; settings from the environment."""
    configure_logs(Settings())
    run_worker(Settings(), tuple(KINDS.values()))


def work_that_hears_alone() -> None:
    """Be a worker that never looks for tickets whose notice did not come."""
    service.platform.queue.worker.LOOK_SECONDS = 1e6
    work()


def work_where_an_abort_comes_first() -> None:
    """Be a worker whose first job is cancelled once it has begun; the notice of that is the next
    thing that the engine does, before the task that it has made for the job.
    """
    sessions = make_sessions(make_engine(Settings().database_url or ""))
    fetch, listen = Manager.fetch_job, JobManager.listen_for_jobs
    hear, notices = list[NotificationCallback](), list[asyncio.Task[None]]()

    async def listen_too(*given: Any, **named: Any) -> None:
        hear.append(named["on_notification"])
        await listen(*given, **named)

    async def fetch_and_cancel(manager: Manager, *given: Any, **named: Any) -> jobs.Job | None:
        ticket = await fetch(manager, *given, **named)
        if ticket is not None and ticket.id is not None and not notices:
            with sessions.begin() as session:
                request_cancel(session, manager.running[ticket.id].id)
            abort: jobs.Notification = {"type": "abort_job_requested", "job_id": ticket.id}
            notices.append(asyncio.create_task(hear[0](channel="", notification=abort)))
        return ticket

    with (
        patch.multiple(Manager, fetch_job=fetch_and_cancel),
        patch.multiple(JobManager, listen_for_jobs=listen_too),
    ):
        work()
