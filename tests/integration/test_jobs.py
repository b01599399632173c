"""Jobs on a real queue: real PostgreSQL, a real worker process, real children."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import UUID

import psutil
import pytest
from sqlalchemy import delete, func, select, text, update

from service.platform.access.tables import Project
from service.platform.db.engine import Sessions, make_engine, make_sessions
from service.platform.errors import Conflict
from service.platform.queue.dispatch import begin_next
from service.platform.queue.queue import enqueue, request_cancel, retry
from service.platform.queue.tables import Job
from tests.support import job_kinds
from tests.support.waiting import PATIENCE, until
from tests.support.working import Gate, Works, held, items, look, put, run, wait, worker


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
    assert (job.state, job.attempt, job.progress, job.error) == ("succeeded", 1, 1, None), (
        job.message
    )
    assert job.queued_at <= job.started_at <= job.finished_at
    name, where = items(worked, job.id)
    assert name == "echo"
    assert where["threads"] == "1"
    assert where["child"] != where["worker"] != os.getpid()


def test_progress_is_seen_while_it_runs(works: Works) -> None:
    sessions, gate = works.sessions, works.gate
    (job_id,) = put(sessions, "slow")
    first = held(sessions, job_id, 10)
    assert (first.state, first.progress) == ("running", 0.25)
    gate.open(job_id, 10)
    later = held(sessions, job_id, 20)
    assert (later.state, later.progress) == ("running", 0.5)
    assert items(sessions, job_id) == []  # the result is one transaction, and it is not over
    gate.open(job_id, 20)
    assert wait(sessions, job_id).state == "succeeded"
    assert items(sessions, job_id)[:4] == [0, 10, 20, 30]


FAILS = [
    ("hungry", "memory", "more memory than a job may take"),
    ("overdue", "time", "longer than the 0.5 s"),
    ("crashing", "crash", "SIGSEGV"),
    ("refusing", "refused", "geometry.length_m: is 0, expected more"),
    ("diverging", "refused", "the fit has run away"),  # its details have NaN and Infinity
    ("buggy", "internal", "internal error (KeyError)"),
    ("bad load", "internal", "internal error (LookupError)"),
    ("bad store", "internal", "internal error (ZeroDivisionError)"),
]


def test_each_fails_alone_with_the_reason(worked: Sessions) -> None:
    begun = {kind: put(worked, kind)[0] for kind, *_ in FAILS}
    (after,) = put(worked, "echo")
    for kind, reason, says in FAILS:
        job = wait(worked, begun[kind])
        assert (job.state, job.error["reason"]) == ("failed", reason), kind
        assert says in job.error["detail"] == job.message
        assert items(worked, job.id) == []
    assert wait(worked, after).state == "succeeded"  # the worker goes on
    refused = look(worked, begun["refusing"])
    assert refused.error == {
        "reason": "refused",
        "type": "InputError",
        "detail": "geometry.length_m: is 0, expected more",
        "field": "geometry.length_m",
    }


@pytest.fixture
def no_notice(worked: Sessions) -> Iterator[None]:
    """The worker is not woken by what asks it to abort a job."""
    trigger = "procrastinate_jobs_notify_queue_job_aborted_v1"
    for act in ("DISABLE", "ENABLE"):
        with worked.begin() as session:
            session.execute(text(f"ALTER TABLE procrastinate_jobs {act} TRIGGER {trigger}"))
        if act == "DISABLE":
            yield


@pytest.mark.parametrize("notice", [True, False], ids=["notice", "looking"])
def test_cancelled_computation_is_gone(
    worked: Sessions, notice: bool, request: pytest.FixtureRequest
) -> None:
    if not notice:
        request.getfixturevalue("no_notice")
    (job_id,) = put(worked, "stubborn")
    stage = wait(worked, job_id, lambda job: "factorising" in (job.stage or "")).stage or ""
    child = psutil.Process(int(stage.rsplit(maxsplit=1)[1]))
    with worked.begin() as session:
        assert request_cancel(session, job_id).state == "running"
    job = wait(worked, job_id)
    assert (job.state, job.message) == ("cancelled", "cancelled on request")
    until(
        lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE,
        "the end of the child",
    )
    assert run(worked, "echo").state == "succeeded"


def test_retried_job_runs_again(worked: Sessions) -> None:
    (job_id,) = put(worked, "refusing")
    assert wait(worked, job_id).state == "failed"
    with worked.begin() as session:
        again = retry(session, job_id)
        assert (again.state, again.message, again.error, again.finished_at) == (
            "queued",
            None,
            None,
            None,
        )
    job = wait(worked, job_id)
    assert (job.state, job.attempt) == ("failed", 2)


def test_cancelled_job_can_be_retried(works: Works) -> None:
    (job_id,) = put(works.sessions, "slow")
    held(works.sessions, job_id)
    with works.sessions.begin() as session:
        request_cancel(session, job_id)
    assert wait(works.sessions, job_id).state == "cancelled"
    works.gate.open(job_id, 10, 20)
    with works.sessions.begin() as session:
        retry(session, job_id)
    assert wait(works.sessions, job_id).state == "succeeded"
    assert len(items(works.sessions, job_id)) == 5  # those of the attempt that succeeded


def test_only_what_failed_or_was_cancelled_is_retried(worked: Sessions) -> None:
    (job_id,) = put(worked, "echo")
    wait(worked, job_id)
    with pytest.raises(Conflict, match="is succeeded"), worked.begin() as session:
        retry(session, job_id)


@contextmanager
def busy(works: Works) -> Iterator[UUID]:
    """The worker has a job in hand throughout the block, which ends well afterwards."""
    (job_id,) = put(works.sessions, "slow")
    held(works.sessions, job_id)
    try:
        yield job_id
    finally:
        works.gate.open(job_id, 10, 20)


def test_cancelled_before_it_began_is_never_run(works: Works) -> None:
    with busy(works):
        (job_id,) = put(works.sessions, "echo")
        with works.sessions.begin() as session:
            assert request_cancel(session, job_id).state == "cancelled"
    assert run(works.sessions, "echo").state == "succeeded"
    assert look(works.sessions, job_id).attempt == 0


def test_a_job_whose_ticket_is_gone_runs(works: Works) -> None:
    tickets = "FROM procrastinate_jobs WHERE args->>'job_id' = :job"
    with busy(works):
        (job_id,) = put(works.sessions, "echo")
        with works.sessions.begin() as session:
            session.execute(text(f"DELETE {tickets}"), {"job": str(job_id)})
    assert wait(works.sessions, job_id).state == "succeeded"
    with works.sessions() as session:
        assert session.scalar(text(f"SELECT count(*) {tickets}"), {"job": str(job_id)}) == 0


def test_superseded_attempt_stores_nothing(works: Works) -> None:
    with busy(works) as job_id, works.sessions.begin() as session:
        session.execute(update(Job).where(Job.id == job_id).values(attempt=7))
    assert run(works.sessions, "echo").state == "succeeded"  # it came after the slow one
    after = look(works.sessions, job_id)
    assert (after.state, after.attempt) == ("running", 7)
    assert items(works.sessions, job_id) == []
    with works.sessions.begin() as session:
        # or it would be taken up again some time
        session.execute(delete(Job).where(Job.id == job_id))


def test_a_worker_that_shall_end_finishes_what_runs_or_puts_it_back(
    sessions: Sessions, database: str, gate: Gate
) -> None:
    first, second, third = put(sessions, "slow", 3)
    with worker(database, gate, worker_concurrency=2, job_drain_seconds=3.0) as process:
        held(sessions, first), held(sessions, second)
        process.send_signal(signal.SIGTERM)
        gate.open(first, 10, 20)  # which is nothing, beside what the worker waits for
        assert process.wait(PATIENCE) == 0
    assert look(sessions, first).state == "succeeded"
    assert (look(sessions, third).state, look(sessions, third).attempt) == ("queued", 0)
    job = look(sessions, second)
    assert (job.state, job.attempt, job.losses) == ("queued", 1, 0)
    with sessions.begin() as session:
        again = begin_next(session, None, "another worker", None)
        assert (again.id, again.attempt) == (second, 2)


def test_the_next_job_begins_when_one_ends(database: str) -> None:
    """A worker that waited for its next look idled half a second after each job."""
    engine = make_engine(database)
    with worker(database, work="work_that_hears_alone"):
        sessions = make_sessions(engine)
        jobs = [wait(sessions, job_id) for job_id in put(sessions, "echo", 3)]
    engine.dispose()
    assert {job.state for job in jobs} == {"succeeded"}


def test_worker_comes_back_when_the_database_cut_it_off(works: Works) -> None:
    cut = text(
        "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
        " WHERE datname = current_database() AND pid <> pg_backend_pid()"
    )
    assert run(works.sessions, "echo").state == "succeeded"
    with works.sessions.begin() as session:
        assert len(session.execute(cut).all()) >= 2
    assert run(works.sessions, "echo").state == "succeeded"
    assert works.process.poll() is None


def test_workspace_is_gone_afterwards(worked: Sessions) -> None:
    where = items(worked, run(worked, "echo").id)[1]
    folder = Path(where["file"]).parent
    until(lambda: not folder.exists(), "the end of the workspace")  # it goes after the job's end
    assert not folder.exists()


def test_a_killed_fork_server_costs_an_attempt_and_no_job(works: Works) -> None:
    with busy(works) as job_id:
        server = fork_server_of(works.process.pid)
        family = [server, *server.children()]
        server.kill()
        assert not psutil.wait_procs(family, timeout=PATIENCE)[1]
    job = wait(works.sessions, job_id)
    assert (job.state, job.attempt, job.losses) == ("succeeded", 2, 1)
    assert len(items(works.sessions, job_id)) == 5


def test_fork_server_killed_while_it_starts_a_child(works: Works) -> None:
    """It is stopped, so that the worker waits for its child, or is about to, when it is killed."""
    run(works.sessions, "echo")
    server = fork_server_of(works.process.pid)
    until(
        lambda: not server.children(),
        "the child before it to be gone, whose end the worker hears from the server",
    )
    server.suspend()
    (job_id,) = put(works.sessions, "echo")
    wait(works.sessions, job_id, lambda job: job.state == "running")
    server.kill()
    job = wait(works.sessions, job_id)
    assert (job.state, job.attempt) == ("succeeded", 1 + job.losses), job.error


def fork_server_of(worker: int) -> psutil.Process:
    (server,) = (
        child
        for child in psutil.Process(worker).children()
        if "forkserver import" in " ".join(child.cmdline())
    )
    return server


def test_what_a_request_waits_for_has_a_place_of_its_own(works: Works) -> None:
    running, waiting = put(works.sessions, "slow", 2)
    held(works.sessions, running)
    assert run(works.sessions, "asked").state == "succeeded"
    assert look(works.sessions, waiting).state == "queued"
    for job_id in (running, waiting):
        works.gate.open(job_id, 10, 20)
        assert wait(works.sessions, job_id).state == "succeeded"
