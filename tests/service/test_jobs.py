"""Jobs on a real queue: real PostgreSQL, a real worker process, real children."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import UUID

import job_kinds
import psutil
import pytest
from sqlalchemy import func, select, text, update

from service.access.tables import AuditEvent, Project
from service.db.engine import Sessions, make_engine, make_sessions
from service.jobs import Job, enqueue, job_state, request_cancel
from service.settings import Settings
from service.supervisor import environment

ENDED = ("succeeded", "failed", "cancelled")
PATIENCE = 90.0


@contextmanager
def worker(database: str, **settings: Any) -> Iterator[subprocess.Popen[bytes]]:
    """A worker process of its own, that knows the kinds of the tests; killed at the end if it still runs."""
    given = environment(Settings(database_url=database, log_level="warning", **settings))
    process = subprocess.Popen([sys.executable, job_kinds.__file__], env=os.environ | given)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def shared(new_database: Callable[[], str]) -> Iterator[Sessions]:
    """Sessions on a database on which one worker works throughout this module."""
    url = new_database()
    engine = make_engine(url)
    with worker(url):
        yield make_sessions(engine)
    engine.dispose()


def put(sessions: Sessions, kind: str, count: int = 1) -> list[UUID]:
    with sessions.begin() as session:
        project = Project(name=kind)
        session.add(project)
        session.flush()
        return [enqueue(session, kind=job_kinds.KINDS[kind], project_id=project.id).id for _ in range(count)]


def look(sessions: Sessions, job_id: UUID) -> Job:
    with sessions() as session:
        return session.get_one(Job, job_id)


def wait(sessions: Sessions, job_id: UUID, until: Callable[[Job], bool] = lambda job: job.state in ENDED) -> Job:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        job = look(sessions, job_id)
        if until(job):
            return job
        time.sleep(0.02)
    raise AssertionError(f"still {job_state(job)}")


def items(sessions: Sessions, job_id: UUID) -> list[Any]:
    with sessions() as session:
        query = select(AuditEvent).where(AuditEvent.subject_id == job_id).order_by(AuditEvent.id)
        return [event.detail["value"] for event in session.scalars(query)]


def run(sessions: Sessions, kind: str) -> Job:
    return wait(sessions, put(sessions, kind)[0])


def test_row_and_dispatch_are_one_transaction(sessions: Sessions) -> None:
    queued = select(func.count()).select_from(text("procrastinate_jobs"))
    with sessions() as session:
        project = Project(name="p")
        session.add(project)
        session.commit()
        enqueue(session, kind=job_kinds.KINDS["echo"], project_id=project.id)
        assert (session.scalar(queued), session.scalar(select(func.count(Job.id)))) == (1, 1)
        session.rollback()
        assert (session.scalar(queued), session.scalar(select(func.count(Job.id)))) == (0, 0)
        job = enqueue(session, kind=job_kinds.KINDS["echo"], project_id=project.id)
        session.commit()
        assert session.scalar(text("SELECT args->>'job_id' FROM procrastinate_jobs")) == str(job.id)


def test_computes_in_a_child_and_stores(shared: Sessions) -> None:
    job = run(shared, "echo")
    assert (job.state, job.attempt, job.progress, job.error) == ("succeeded", 1, 1, None), job.message
    assert job.queued_at <= job.started_at <= job.finished_at
    name, where = items(shared, job.id)
    assert name == "echo"
    assert where["threads"] == "1"
    assert where["child"] != where["worker"] != os.getpid()


def test_progress_is_seen_while_it_runs(shared: Sessions) -> None:
    (job_id,) = put(shared, "slow")
    first = wait(shared, job_id, lambda job: job.stage == "stepping" and 0 < job.progress < 1)
    later = wait(shared, job_id, lambda job: job.progress > first.progress)
    assert later.state == "running"
    assert items(shared, job_id) == []  # the result is one transaction, and it is not over
    assert wait(shared, job_id).state == "succeeded"
    assert items(shared, job_id)[:4] == [0, 10, 20, 30]


@pytest.mark.parametrize(
    ("kind", "reason", "says"),
    [
        ("hungry", "memory", "more memory than a job may take"),
        ("overdue", "time", "longer than the 0.5 s"),
        ("crashing", "crash", "SIGSEGV"),
        ("refusing", "refused", "geometry.length_m: is 0, expected more"),
        ("buggy", "internal", "internal error (KeyError)"),
        ("bad load", "internal", "internal error (LookupError)"),
        ("bad store", "internal", "internal error (ZeroDivisionError)"),
    ],
)
def test_fails_alone_with_the_reason(shared: Sessions, kind: str, reason: str, says: str) -> None:
    job = run(shared, kind)
    assert job.state == "failed"
    assert job.error is not None
    assert job.error["reason"] == reason
    assert says in job.error["detail"] == job.message
    assert items(shared, job.id) == []
    assert run(shared, "echo").state == "succeeded"  # the worker goes on


def test_refusal_names_the_field(shared: Sessions) -> None:
    job = run(shared, "refusing")
    assert job.error == {
        "reason": "refused",
        "type": "InputError",
        "detail": "geometry.length_m: is 0, expected more",
        "field": "geometry.length_m",
    }


def test_cancel_ends_a_stubborn_computation(shared: Sessions) -> None:
    (job_id,) = put(shared, "stubborn")
    wait(shared, job_id, lambda job: job.stage == "factorising")
    with shared.begin() as session:
        request_cancel(session, job_id)
    assert wait(shared, job_id).state == "cancelled"


def test_cancelled_before_it_began_is_never_run(sessions: Sessions, database: str) -> None:
    (job_id,), (other,) = put(sessions, "echo"), put(sessions, "echo")
    with sessions.begin() as session:
        assert request_cancel(session, job_id).state == "cancelled"
    with worker(database):
        assert wait(sessions, other).state == "succeeded"
    assert wait(sessions, job_id).attempt == 0


def test_superseded_attempt_stores_nothing(sessions: Sessions, database: str) -> None:
    with worker(database):
        (job_id,) = put(sessions, "slow")
        wait(sessions, job_id, lambda job: job.progress > 0.2)
        with sessions.begin() as session:
            session.execute(update(Job).where(Job.id == job_id).values(attempt=7, lease_until=None))
        assert wait(sessions, put(sessions, "echo")[0]).state == "succeeded"  # it came after the slow one
        after = look(sessions, job_id)
    assert (after.state, after.attempt) == ("running", 7)
    assert items(sessions, job_id) == []


def test_told_to_end_it_finishes_what_runs(sessions: Sessions, database: str) -> None:
    with worker(database) as process:
        first, second = put(sessions, "slow", 2)
        wait(sessions, first, lambda job: job.progress > 0)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    assert wait(sessions, first).state == "succeeded"
    assert look(sessions, second).state == "queued"


def test_told_to_end_it_puts_back_what_does_not_end(sessions: Sessions, database: str) -> None:
    (job_id,) = put(sessions, "slow")
    with worker(database, job_drain_seconds=0.2) as process:
        wait(sessions, job_id, lambda job: job.progress > 0)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    assert look(sessions, job_id).state == "queued"
    with worker(database):
        job = wait(sessions, job_id)
    assert (job.state, job.attempt) == ("succeeded", 2)


def test_killed_worker_takes_its_child_along_and_another_reruns_the_job(sessions: Sessions, database: str) -> None:
    (job_id,) = put(sessions, "slow")
    with worker(database) as first:
        wait(sessions, job_id, lambda job: job.progress > 0)
        family = psutil.Process(first.pid).children(recursive=True)
        assert family
        first.kill()
        first.wait()
        _, alive = psutil.wait_procs(family, timeout=5)
        assert [p for p in alive if p.status() != psutil.STATUS_ZOMBIE] == []
    with sessions.begin() as session:
        session.execute(update(Job).where(Job.id == job_id).values(lease_until=func.now()))  # the lease lapses
    with worker(database):
        job = wait(sessions, job_id)
    assert (job.state, job.attempt) == ("succeeded", 2)
    assert len(items(sessions, job_id)) == 5


def test_job_that_kills_its_workers_is_given_up(sessions: Sessions, database: str) -> None:
    (job_id,) = put(sessions, "echo")
    with sessions.begin() as session:
        values = {"state": "running", "attempt": 3, "losses": 2, "worker": "gone", "lease_until": func.now()}
        session.execute(update(Job).where(Job.id == job_id).values(**values))
    with worker(database):
        job = wait(sessions, job_id)
    assert job.state == "failed"
    assert job.error is not None
    assert job.error["reason"] == "lost"


def test_lost_dispatch_is_found(sessions: Sessions, database: str) -> None:
    """A worker that died between the queue and the row leaves a job that waits but is not in the queue."""
    (job_id,) = put(sessions, "echo")
    with sessions.begin() as session:
        session.execute(text("UPDATE procrastinate_jobs SET status = 'doing'"))
        session.execute(update(Job).values(queued_at=func.now() - text("interval '1 minute'")))
    with worker(database):
        assert wait(sessions, job_id).state == "succeeded"


def test_two_workers_share_without_doing_anything_twice(sessions: Sessions, database: str) -> None:
    with worker(database), worker(database):
        jobs = [wait(sessions, job_id) for job_id in put(sessions, "echo", 20)]
    assert {(job.state, job.attempt) for job in jobs} == {("succeeded", 1)}
    assert all(len(items(sessions, job.id)) == 2 for job in jobs)


def test_worker_comes_back_when_the_database_cut_it_off(sessions: Sessions, database: str) -> None:
    cut = text(
        "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
        " WHERE datname = current_database() AND pid <> pg_backend_pid()"
    )
    with worker(database) as process:
        assert wait(sessions, put(sessions, "echo")[0]).state == "succeeded"
        with sessions.begin() as session:
            assert len(session.execute(cut).all()) >= 2
        assert wait(sessions, put(sessions, "echo")[0]).state == "succeeded"
        assert process.poll() is None


def test_workspace_is_gone_afterwards(shared: Sessions) -> None:
    where = items(shared, run(shared, "echo").id)[1]
    assert not Path(where["file"]).parent.exists()
