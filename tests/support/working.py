"""Jobs on a real queue: a worker of the tests' kinds of job, jobs to give it, and waiting for what
becomes of them.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
from sqlalchemy import select

from service.app.supervisor import environment
from service.platform.access.tables import AuditEvent, Project
from service.platform.db.engine import Sessions, make_engine, make_sessions
from service.platform.queue.queue import enqueue
from service.platform.queue.resource import job_state
from service.platform.queue.tables import Job
from service.platform.settings import Settings
from tests.support import job_kinds
from tests.support.computations import GATE
from tests.support.places import ROOT
from tests.support.waiting import until

ENDED = ("succeeded", "failed", "cancelled")


@dataclass(frozen=True)
class Gate:
    """Holds jobs of the kinds `slow` and `chain` in known steps, so that a test acts while they
    run.
    """

    folder: Path

    def open(self, job_id: UUID, *steps: int) -> None:
        """Let a job pass these steps."""
        for step in steps:
            (self.folder / f"{job_id} {step}").touch()


@pytest.fixture
def gate(tmp_path: Path) -> Gate:
    return Gate(tmp_path)


def held(sessions: Sessions, job_id: UUID, step: int = 10) -> Job:
    """The job, once it waits in this step."""
    return wait(sessions, job_id, lambda job: job.stage == f"held in step {step}")


@contextmanager
def worker(
    database: str, gate: Gate | None = None, work: str = "work", **settings: Any
) -> Iterator[subprocess.Popen[bytes]]:
    """A worker process of its own, that knows the kinds of the tests; killed at the end if it still
    runs.

    Args:
        database: its URL.
        gate: where its jobs wait.
        work: the function of `job_kinds` that it runs.
        settings: beside the database.
    """
    given = environment(Settings(database_url=database, log_level="warning", **settings))
    if gate is not None:
        given[GATE] = str(gate.folder)
    given["PYTHONPATH"] = str(ROOT)
    # A worker's children import the file that it was started with once more: this one has none.
    command = [sys.executable, "-c", f"from tests.support.job_kinds import {work}; {work}()"]
    process = subprocess.Popen(command, env=os.environ | given)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@dataclass(frozen=True)
class Works:
    """A worker, the database on which it works alone, and the gate that holds its jobs."""

    process: subprocess.Popen[bytes]
    url: str
    sessions: Sessions
    gate: Gate


@pytest.fixture(scope="module")
def worker_settings() -> dict[str, Any]:
    """Of the worker that works throughout a module, which may have a fixture of this name."""
    return {}


@pytest.fixture(scope="module")
def works(
    new_database: Callable[[], str],
    tmp_path_factory: pytest.TempPathFactory,
    worker_settings: dict[str, Any],
) -> Iterator[Works]:
    """A worker that works throughout a module: what one test leaves there is nothing to the
    next.
    """
    url, gate = new_database(), Gate(tmp_path_factory.mktemp("gate"))
    engine = make_engine(url)
    with worker(url, gate, **worker_settings) as process:
        yield Works(process, url, make_sessions(engine), gate)
    engine.dispose()


@pytest.fixture
def worked(works: Works) -> Sessions:
    """Sessions on the database of the module's worker."""
    return works.sessions


def put(sessions: Sessions, kind: str, count: int = 1) -> list[UUID]:
    with sessions.begin() as session:
        project = Project(name=kind)
        session.add(project)
        session.flush()
        return [
            enqueue(session, kind=job_kinds.KINDS[kind], project_id=project.id).id
            for _ in range(count)
        ]


def look(sessions: Sessions, job_id: UUID) -> Job:
    with sessions() as session:
        return session.get_one(Job, job_id)


def wait(
    sessions: Sessions,
    job_id: UUID,
    condition: Callable[[Job], bool] = lambda job: job.state in ENDED,
) -> Job:
    """The job, as soon as it is so."""

    def so() -> Job | None:
        job = look(sessions, job_id)
        return job if condition(job) else None

    return until(so, "the job", lambda: job_state(look(sessions, job_id)))


def items(sessions: Sessions, job_id: UUID) -> list[Any]:
    with sessions() as session:
        query = select(AuditEvent).where(AuditEvent.subject_id == job_id).order_by(AuditEvent.id)
        return [event.detail["value"] for event in session.scalars(query)]


def run(sessions: Sessions, kind: str) -> Job:
    return wait(sessions, put(sessions, kind)[0])
