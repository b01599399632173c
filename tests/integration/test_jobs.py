"""Jobs on a real queue: real PostgreSQL, a real worker process, real children."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import psutil
import pytest
from sqlalchemy import func, select, text, update

from service.access.tables import Project
from service.db.engine import Sessions
from service.jobs.queue import enqueue, request_cancel
from service.jobs.tables import Job
from tests.support import job_kinds
from tests.support.waiting import PATIENCE
from tests.support.working import Gate, held, items, look, put, run, wait, worker


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


def test_computes_in_a_child_and_stores(worked: Sessions) -> None:
    job = run(worked, "echo")
    assert (job.state, job.attempt, job.progress, job.error) == ("succeeded", 1, 1, None), job.message
    assert job.queued_at <= job.started_at <= job.finished_at
    name, where = items(worked, job.id)
    assert name == "echo"
    assert where["threads"] == "1"
    assert where["child"] != where["worker"] != os.getpid()


def test_progress_is_seen_while_it_runs(sessions: Sessions, database: str, gate: Gate) -> None:
    (job_id,) = put(sessions, "slow")
    with worker(database, gate):
        first = held(sessions, job_id, 10)
        assert (first.state, first.progress) == ("running", 0.25)
        gate.open(10)
        later = held(sessions, job_id, 20)
        assert (later.state, later.progress) == ("running", 0.5)
        assert items(sessions, job_id) == []  # the result is one transaction, and it is not over
        gate.open(20)
        assert wait(sessions, job_id).state == "succeeded"
    assert items(sessions, job_id)[:4] == [0, 10, 20, 30]


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
def test_fails_alone_with_the_reason(worked: Sessions, kind: str, reason: str, says: str) -> None:
    job = run(worked, kind)
    assert job.state == "failed"
    assert job.error is not None
    assert job.error["reason"] == reason
    assert says in job.error["detail"] == job.message
    assert items(worked, job.id) == []
    assert run(worked, "echo").state == "succeeded"  # the worker goes on


def test_refusal_names_the_field(worked: Sessions) -> None:
    job = run(worked, "refusing")
    assert job.error == {
        "reason": "refused",
        "type": "InputError",
        "detail": "geometry.length_m: is 0, expected more",
        "field": "geometry.length_m",
    }


def test_cancel_ends_a_stubborn_computation(worked: Sessions) -> None:
    (job_id,) = put(worked, "stubborn")
    wait(worked, job_id, lambda job: "factorising" in (job.stage or ""))
    with worked.begin() as session:
        request_cancel(session, job_id)
    assert wait(worked, job_id).state == "cancelled"


def test_cancelled_before_it_began_is_never_run(sessions: Sessions, database: str) -> None:
    (job_id,), (other,) = put(sessions, "echo"), put(sessions, "echo")
    with sessions.begin() as session:
        assert request_cancel(session, job_id).state == "cancelled"
    with worker(database):
        assert wait(sessions, other).state == "succeeded"
    assert wait(sessions, job_id).attempt == 0


def test_superseded_attempt_stores_nothing(sessions: Sessions, database: str, gate: Gate) -> None:
    with worker(database, gate):
        (job_id,) = put(sessions, "slow")
        held(sessions, job_id)
        with sessions.begin() as session:
            session.execute(update(Job).where(Job.id == job_id).values(attempt=7))
        gate.open(10, 20)
        assert wait(sessions, put(sessions, "echo")[0]).state == "succeeded"  # it came after the slow one
        after = look(sessions, job_id)
    assert (after.state, after.attempt) == ("running", 7)
    assert items(sessions, job_id) == []


def test_a_worker_that_shall_end_finishes_what_runs(sessions: Sessions, database: str, gate: Gate) -> None:
    with worker(database, gate) as process:
        first, second = put(sessions, "slow", 2)
        held(sessions, first)
        process.send_signal(signal.SIGTERM)
        gate.open(10, 20)
        assert process.wait(PATIENCE) == 0
    assert wait(sessions, first).state == "succeeded"
    assert look(sessions, second).state == "queued"


def test_a_worker_that_shall_end_puts_back_what_does_not_end(sessions: Sessions, database: str, gate: Gate) -> None:
    (job_id,) = put(sessions, "slow")
    with worker(database, gate, job_drain_seconds=0.2) as process:
        held(sessions, job_id)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    assert look(sessions, job_id).state == "queued"
    with worker(database):
        job = wait(sessions, job_id)
    assert (job.state, job.attempt) == ("succeeded", 2)


def test_killed_worker_takes_its_child_along_and_another_reruns_the_job(
    sessions: Sessions, database: str, gate: Gate
) -> None:
    (job_id,) = put(sessions, "slow")
    with worker(database, gate) as first:
        held(sessions, job_id)
        family = psutil.Process(first.pid).children(recursive=True)
        assert family
        first.kill()
        first.wait()
        _, alive = psutil.wait_procs(family, timeout=PATIENCE)
        assert [p for p in alive if p.status() != psutil.STATUS_ZOMBIE] == []
    with worker(database, job_lease_seconds=1):
        job = wait(sessions, job_id)
    assert (job.state, job.attempt) == ("succeeded", 2)
    assert len(items(sessions, job_id)) == 5


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


def test_workspace_is_gone_afterwards(worked: Sessions) -> None:
    where = items(worked, run(worked, "echo").id)[1]
    assert not Path(where["file"]).parent.exists()


def test_a_killed_fork_server_costs_an_attempt_and_no_job(sessions: Sessions, database: str, gate: Gate) -> None:
    (job_id,) = put(sessions, "slow")
    with worker(database, gate) as process:
        held(sessions, job_id)
        server = fork_server_of(process.pid)
        family = [server, *server.children()]
        server.kill()
        assert not psutil.wait_procs(family, timeout=PATIENCE)[1]
        gate.open(10, 20)
        job = wait(sessions, job_id)
    assert (job.state, job.attempt, job.losses) == ("succeeded", 2, 1)
    assert len(items(sessions, job_id)) == 5


def test_fork_server_killed_while_it_starts_a_child(sessions: Sessions, database: str) -> None:
    """It is stopped, so that the worker waits for its child, or is about to, when it is killed."""
    with worker(database) as process:
        wait(sessions, put(sessions, "echo")[0])
        server = fork_server_of(process.pid)
        server.suspend()
        (job_id,) = put(sessions, "echo")
        wait(sessions, job_id, lambda job: job.state == "running")
        server.kill()
        job = wait(sessions, job_id)
    assert (job.state, job.attempt) == ("succeeded", 1 + job.losses), job.error


def fork_server_of(worker: int) -> psutil.Process:
    (server,) = (
        child for child in psutil.Process(worker).children() if "forkserver import" in " ".join(child.cmdline())
    )
    return server
