"""Tickets of the queue: each names its job and changes with it; those of dead workers, of old versions, and lost ones."""

import psutil
import pytest
from sqlalchemy import Engine, text

from service.db.engine import Sessions, make_engine, make_sessions
from service.db.schema import upgrade
from service.jobs import tickets
from service.jobs.dispatch import begin_next, recover_stalled, recover_strays
from service.jobs.queue import request_cancel, retry
from tests.support.working import Gate, held, items, look, put, wait, worker

ALL = text("SELECT id, status, args->>'job_id' AS job_id FROM procrastinate_jobs ORDER BY id")
REGISTER = text(
    "INSERT INTO procrastinate_workers (last_heartbeat) VALUES (now() - cast(:ago AS interval)) RETURNING id"
)
LEASE = 30.0


def all_tickets(sessions: Sessions) -> list[tuple[int, str, str]]:
    with sessions() as session:
        return [tuple(row) for row in session.execute(ALL)]


def begin(sessions: Sessions, *, silent_for: str = "0 s", count: int = 1) -> int:
    """Begin jobs as a worker that was last heard of so long ago; its number."""
    with sessions.begin() as session:
        worker_id: int = session.execute(REGISTER, {"ago": silent_for}).scalar_one()
        for _ in range(count):
            job = begin_next(session, None, f"worker {worker_id}", None)
            assert job is not None
            assert tickets.take(session, job, worker_id).id == job.ticket
    return worker_id


def test_a_ticket_names_its_job_from_the_queue_to_the_end(sessions: Sessions) -> None:
    first, second = put(sessions, "echo", 2)
    (a, _, _), (b, _, _) = all_tickets(sessions)
    assert all_tickets(sessions) == [(a, "todo", str(first)), (b, "todo", str(second))]
    begin(sessions)
    assert all_tickets(sessions) == [(a, "doing", str(first)), (b, "todo", str(second))]
    with sessions.begin() as session:
        request_cancel(session, second)
    assert all_tickets(sessions) == [(a, "doing", str(first))]
    with sessions.begin() as session:
        retry(session, second)
    assert [row[1:] for row in all_tickets(sessions)] == [("doing", str(first)), ("todo", str(second))]


def test_a_worker_that_is_heard_of_keeps_its_job(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    begin(sessions, silent_for="20 s")
    with sessions.begin() as session:
        recover_stalled(session, LEASE)
    assert look(sessions, job_id).state == "running"


def test_a_silent_workers_job_waits_again_and_its_attempt_is_fenced(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    worker_id = begin(sessions, silent_for="40 s")
    (before,) = all_tickets(sessions)
    with sessions.begin() as session:
        recover_stalled(session, LEASE)
    job = look(sessions, job_id)
    assert (job.state, job.losses, job.message) == ("queued", 1, f"worker worker {worker_id} died; queued again")
    assert all_tickets(sessions) == [(before[0], "todo", str(job_id))]
    begin(sessions)
    with sessions.begin() as session:
        recover_stalled(session, LEASE)  # the ticket is another worker's now
        assert tickets.to_abort(session, worker_id, [before[0]]) == [before[0]]
    assert (look(sessions, job_id).state, look(sessions, job_id).attempt) == ("running", 2)


def test_a_job_that_kills_its_workers_is_given_up(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    for _ in range(3):
        begin(sessions, silent_for="40 s")
        with sessions.begin() as session:
            recover_stalled(session, LEASE)
    job = look(sessions, job_id)
    assert (job.state, job.attempt, job.losses) == ("failed", 3, 3)
    assert job.error is not None
    assert job.error["reason"] == "lost"
    assert all_tickets(sessions) == []


def test_a_cancelled_job_of_a_silent_worker_is_cancelled(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    begin(sessions, silent_for="40 s")
    with sessions.begin() as session:
        request_cancel(session, job_id)
        recover_stalled(session, LEASE)
    assert look(sessions, job_id).state == "cancelled"
    assert all_tickets(sessions) == []


def test_what_a_worker_is_said_to_run_and_does_not_waits_again(sessions: Sessions) -> None:
    first, second = put(sessions, "echo", 2)
    worker_id = begin(sessions, count=2)
    (mine, _, _), _ = all_tickets(sessions)
    with sessions.begin() as session:
        recover_strays(session, worker_id, [mine])
    assert (look(sessions, first).state, look(sessions, second).state) == ("running", "queued")


def test_a_jobs_ticket_goes_with_its_row(sessions: Sessions) -> None:
    put(sessions, "echo", 2)
    with sessions.begin() as session:
        session.execute(text("DELETE FROM projects"))
    assert all_tickets(sessions) == []


def test_a_paused_worker_lets_go_of_what_another_has_taken_over(sessions: Sessions, database: str, gate: Gate) -> None:
    (job_id,) = put(sessions, "slow")
    with worker(database, gate, job_lease_seconds=1) as first:
        held(sessions, job_id)
        family = [psutil.Process(first.pid), *psutil.Process(first.pid).children(recursive=True)]
        for process in family:
            process.suspend()
        with worker(database, job_lease_seconds=1):
            assert wait(sessions, job_id).attempt == 2
            for process in family:
                process.resume()
            (busy,) = put(sessions, "stubborn")  # one worker is busy with it, so the other has to have let go
            wait(sessions, busy, lambda job: "factorising" in (job.stage or ""))
            assert wait(sessions, put(sessions, "echo")[0]).state == "succeeded"
    assert len(items(sessions, job_id)) == 5


@pytest.fixture
def before_tickets(empty_database: str) -> Engine:
    """A database of the version whose tickets only woke a worker."""
    engine = make_engine(empty_database)
    upgrade(engine, "0009_original_rows")
    return engine


def test_jobs_of_the_version_before_run_after_the_upgrade(before_tickets: Engine, empty_database: str) -> None:
    with before_tickets.begin() as connection:
        project = connection.scalar(text("INSERT INTO projects (name) VALUES ('p') RETURNING id"))
        new = text(
            "INSERT INTO jobs (kind, project_id, queue, state, attempt, worker) "
            "VALUES ('echo', :project, 'jobs', :state, :attempt, :worker) RETURNING id"
        )
        waits = connection.scalar(new, {"project": project, "state": "queued", "attempt": 0, "worker": None})
        runs = connection.scalar(new, {"project": project, "state": "running", "attempt": 1, "worker": "old"})
        ended = connection.scalar(new, {"project": project, "state": "succeeded", "attempt": 1, "worker": "old"})
        old = "INSERT INTO procrastinate_jobs (queue_name, task_name, args, status) VALUES ('jobs', 'modalbase.run', "
        for args, status in ((f'{{"job_id": "{waits}"}}', "todo"), ('{"job_id": null}', "todo"), ("{}", "doing")):
            connection.execute(text(old + "cast(:args AS jsonb), :status)"), {"args": args, "status": status})
    upgrade(before_tickets)
    sessions = make_sessions(before_tickets)
    assert [row[1:] for row in all_tickets(sessions)] == [("todo", str(waits)), ("todo", str(runs))]
    with worker(empty_database):
        assert [wait(sessions, job_id).attempt for job_id in (waits, runs)] == [1, 2]
    assert look(sessions, ended).attempt == 1
    assert all_tickets(sessions) == []
    before_tickets.dispose()
