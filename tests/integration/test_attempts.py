"""Attempts at jobs on a real database and the tickets that name them: what is met between the start
and the end of one.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import UUID

import psutil
import pytest
from sqlalchemy import text, update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session
from structlog.testing import capture_logs

from service.platform.db.engine import Sessions, make_engine, make_sessions
from service.platform.queue import attempt as attempts
from service.platform.queue import queue_adapter
from service.platform.queue.attempt import Attempt
from service.platform.queue.child import (
    CANCELLED,
    DRAINED,
    Checkpoint,
    Failure,
    Item,
    Message,
    Order,
    Progress,
)
from service.platform.queue.dispatch import begin_next, recover_stalled, recover_strays
from service.platform.queue.kinds import JobKind
from service.platform.queue.manager import Manager
from service.platform.queue.process import LOST, Child, ChildEnded, preload
from service.platform.queue.queue import request_cancel, retry
from service.platform.queue.tables import Job
from service.platform.settings import Settings
from tests.support import computations, job_kinds
from tests.support.lengths import long
from tests.support.working import Gate, held, items, look, put, wait, worker

NOTHING = "postgresql://nobody@127.0.0.1:1/nothing"
BUG = Failure("internal", "ZeroDivisionError", "internal error", trace="where it was")


class Here:
    """What a child sends, without the child: the messages that the job's inputs are; a failure ends
    them.
    """

    def __init__(self, order: Order) -> None:
        self.sent: list[Message] = order.inputs

    def messages(self) -> Iterator[Message]:
        """In order."""
        for message in self.sent:
            if isinstance(message, Failure):
                raise ChildEnded(message)
            yield message

    def kill(self, why: Failure) -> None:
        """Nothing runs."""

    def close(self) -> None:
        """Nothing is open."""


def first_alone(session: Session, job_id: UUID, items: Iterator[Any]) -> None:
    job_kinds.store(session, job_id, iter([next(items)]))


@dataclass
class Trial:
    """Runs attempts at jobs of their own.

    Attributes:
        sessions: on the database.
        folder: of the attempts.
        attempt: the last one.
    """

    sessions: Sessions
    folder: Path
    attempt: Attempt | None = None

    def run(
        self, *sent: Message, load: Callable[[Session], Any] | None = None, **changed: Any
    ) -> tuple[str, str]:
        """The outcome of an attempt and the job's state after it.

        Args:
            sent: by the child.
            load: what is done before that.
            changed: of the kind of job; `stop` is why it is stopped before it begins, with
                `lose_ticket` the queue has lost its ticket.
        """
        stop, lose_ticket = changed.pop("stop", None), changed.pop("lose_ticket", False)

        def loaded(session: Session, _job: UUID, _folder: Path) -> list[Message]:
            if load is not None:
                load(session)
            return list(sent)

        kind: JobKind = replace(job_kinds.KINDS["echo"], load=loaded, **changed)
        (job_id,) = put(self.sessions, "echo")
        with self.sessions.begin() as session:
            job = begin_next(session, ["jobs"], "a worker", None)
            if lose_ticket:
                session.execute(text("DELETE FROM procrastinate_jobs"))
            worker = session.scalar(
                text("INSERT INTO procrastinate_workers DEFAULT VALUES RETURNING id")
            )
            assert queue_adapter.take(session, job, worker).id == job.ticket
            session.expunge(job)
        self.attempt = Attempt(self.sessions, Settings(), kind, job)
        if stop is not None:
            self.attempt.stop(stop)
        outcome = self.attempt.run(self.folder)
        state = look(self.sessions, job_id).state
        with self.sessions.begin() as session:
            session.execute(update(Job).values(state="cancelled"))
        return outcome, state


@pytest.fixture
def trial(sessions: Sessions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Trial]:
    monkeypatch.setattr(attempts, "Child", Here)
    monkeypatch.setattr(attempts, "AGAIN_SECONDS", 0.0)
    # to print a trace with the values of all its names takes longer than the attempt
    with capture_logs():
        yield Trial(sessions, tmp_path)


def lose_connection(session: Session) -> None:
    session.execute(text("SELECT pg_terminate_backend(pg_backend_pid())"))


def test_ends_of_attempts(trial: Trial) -> None:
    assert trial.run(stop=CANCELLED) == ("cancelled", "cancelled")
    # it leaves the second
    assert trial.run(Item(1), Item(2), store=first_alone) == ("succeeded", "succeeded")
    assert trial.run(Progress("half", 0.5), Checkpoint(b"x"), Item(1)) == ("succeeded", "succeeded")
    assert trial.run(LOST) == ("queued again", "queued")
    assert trial.run(LOST, lose_ticket=True) == ("queued again", "queued")
    assert trial.run(BUG) == ("failed", "failed")


def test_what_the_database_refuses_is_a_failure_and_what_passes_is_not(trial: Trial) -> None:
    def superseded(session: Session, job_id: UUID, items: Iterator[Any]) -> None:
        with trial.sessions.begin() as other:
            other.execute(update(Job).where(Job.id == job_id).values(attempt=7))
        job_kinds.store(session, job_id, items)

    tries: list[bool] = []

    def cut_off_once(session: Session, job_id: UUID, items: Iterator[Any]) -> None:
        job_kinds.store(session, job_id, items)
        tries.append(True)
        if len(tries) == 1:
            lose_connection(session)

    def wrong(session: Session, *_: Any) -> None:
        session.execute(text("SELECT 1 / 0"))

    assert trial.run(load=lose_connection) == ("abandoned", "running")
    assert trial.run(load=wrong) == ("failed", "failed")
    assert trial.run(Item(1), store=wrong) == ("failed", "failed")
    assert trial.run(Progress("a stage with a \0", 0.5), Item(1)) == ("failed", "failed")
    assert trial.run(Item(1), store=superseded) == ("superseded", "running")
    assert trial.run(Item(1), store=cut_off_once) == ("succeeded", "succeeded")
    assert len(tries) == 2
    with trial.sessions() as session, pytest.raises(DBAPIError) as refused:
        wrong(session)
    with pytest.raises(DBAPIError):
        Manager._outlive(None, refused.value)


def test_an_end_waits_for_the_database(trial: Trial, sessions: Sessions) -> None:
    engine = make_engine(NOTHING)
    nowhere = make_sessions(engine)

    class Unreachable:
        """Sessions for a transaction each, the last of them first, then the real ones."""

        def __init__(self, left: list[Sessions]) -> None:
            self.left = left

        def begin(self) -> Any:
            """A transaction, whose first statement fails where there is no database."""
            return (self.left.pop() if self.left else sessions).begin()

    def leave(*left: Sessions) -> Callable[[Session], None]:
        return lambda _: setattr(trial.attempt, "sessions", Unreachable([*left]))

    # What was drained is given back by those who see that this worker is gone.
    assert trial.run(DRAINED, load=leave(nowhere, nowhere)) == ("abandoned", "running")
    assert trial.run(CANCELLED, load=leave(nowhere, nowhere)) == ("cancelled", "cancelled")
    # the work goes on without a progress that cannot be written
    away = leave(nowhere, sessions)  # the result's transaction is begun
    assert trial.run(Progress("half", 0.5), Item(1), load=away) == ("succeeded", "succeeded")
    assert trial.attempt.sessions.left == []
    engine.dispose()


# --- tickets of the queue
# -----------------------------------------------------------------------------------------------

ALL = text("SELECT id, status, args->>'job_id' AS job_id FROM procrastinate_jobs ORDER BY id")
REGISTER = text(
    "INSERT INTO procrastinate_workers (last_heartbeat) VALUES (now() - cast(:ago AS interval))"
    " RETURNING id"
)
LEASE = 30.0


def queued_tickets(sessions: Sessions) -> list[tuple[int, str, str]]:
    with sessions() as session:
        return [tuple(row) for row in session.execute(ALL)]


def begin(sessions: Sessions, *, silent_for: str = "0 s", count: int = 1) -> int:
    """Begin jobs as a worker that was last heard of so long ago; its number."""
    with sessions.begin() as session:
        worker_id: int = session.execute(REGISTER, {"ago": silent_for}).scalar_one()
        for _ in range(count):
            job = begin_next(session, None, f"worker {worker_id}", None)
            assert queue_adapter.take(session, job, worker_id).id == job.ticket
    return worker_id


@pytest.mark.parametrize("count", [24, long(100)])
def test_children_of_several_threads_each_end_for_their_own_reason(count: int) -> None:
    """The status of a child can be read once, and whoever starts another one asks for it too."""
    preload([computations.__name__], threads=1)

    def end(_: int) -> str:
        child = Child(Order(computations.crashing, {}, None, 1 << 30))
        with closing(child), pytest.raises(ChildEnded) as ended:
            list(child.messages())
        return ended.value.failure.detail

    # Their fork server stays: an API of this process may have children too.
    with ThreadPoolExecutor(4) as threads:
        ends = set(threads.map(end, range(count)))
    assert ends == {"the computation crashed with SIGSEGV"}


def test_a_ticket_names_its_job_from_the_queue_to_the_end(sessions: Sessions) -> None:
    first, second = put(sessions, "echo", 2)
    (a, _, _), (b, _, _) = queued_tickets(sessions)
    assert queued_tickets(sessions) == [(a, "todo", str(first)), (b, "todo", str(second))]
    begin(sessions)  # on a ticket of its own, which no other worker fetches
    _, (c, _, _) = queued_tickets(sessions)
    assert queued_tickets(sessions) == [(b, "todo", str(second)), (c, "doing", str(first))]
    with sessions.begin() as session:
        request_cancel(session, second)
    assert queued_tickets(sessions) == [(c, "doing", str(first))]
    with sessions.begin() as session:
        retry(session, second)
    assert [row[1:] for row in queued_tickets(sessions)] == [
        ("doing", str(first)),
        ("todo", str(second)),
    ]


def test_a_worker_that_is_heard_of_keeps_its_job(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    begin(sessions, silent_for="20 s")
    with sessions.begin() as session:
        recover_stalled(session, LEASE)
    assert look(sessions, job_id).state == "running"


def test_a_silent_workers_job_waits_again_and_its_attempt_is_fenced(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    worker_id = begin(sessions, silent_for="40 s")
    (before,) = queued_tickets(sessions)
    with sessions.begin() as session:
        recover_stalled(session, LEASE)
    job = look(sessions, job_id)
    assert (job.state, job.losses, job.message) == (
        "queued",
        1,
        f"worker worker {worker_id} died; queued again",
    )
    assert queued_tickets(sessions) == [(before[0], "todo", str(job_id))]
    begin(sessions)
    with sessions.begin() as session:
        recover_stalled(session, LEASE)  # the ticket is another worker's now
        assert queue_adapter.to_abort(session, worker_id, [before[0]]) == [before[0]]
    assert (look(sessions, job_id).state, look(sessions, job_id).attempt) == ("running", 2)


def test_a_job_that_kills_its_workers_is_given_up(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    for _ in range(3):
        begin(sessions, silent_for="40 s")
        with sessions.begin() as session:
            recover_stalled(session, LEASE)
    job = look(sessions, job_id)
    assert (job.state, job.attempt, job.losses) == ("failed", 3, 3)
    assert job.error["reason"] == "lost"
    assert queued_tickets(sessions) == []


def test_a_cancelled_job_of_a_silent_worker_is_cancelled(sessions: Sessions) -> None:
    (job_id,) = put(sessions, "echo")
    begin(sessions, silent_for="40 s")
    with sessions.begin() as session:
        request_cancel(session, job_id)
        recover_stalled(session, LEASE)
    assert look(sessions, job_id).state == "cancelled"
    assert queued_tickets(sessions) == []


def test_what_a_worker_is_said_to_run_and_does_not_waits_again(sessions: Sessions) -> None:
    first, second = put(sessions, "echo", 2)
    worker_id = begin(sessions, count=2)
    (mine, _, _), _ = queued_tickets(sessions)
    with sessions.begin() as session:
        recover_strays(session, worker_id, [mine])
    assert (look(sessions, first).state, look(sessions, second).state) == ("running", "queued")


def test_a_jobs_ticket_goes_with_its_row(sessions: Sessions) -> None:
    put(sessions, "echo", 2)
    with sessions.begin() as session:
        session.execute(text("DELETE FROM projects"))
    assert queued_tickets(sessions) == []


def test_a_paused_worker_lets_go_of_what_another_has_taken_over(
    sessions: Sessions, database: str, gate: Gate
) -> None:
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
            # one worker is busy with it, so the other has to have let go
            (busy,) = put(sessions, "stubborn")
            wait(sessions, busy, lambda job: "factorising" in (job.stage or ""))
            assert wait(sessions, put(sessions, "echo")[0]).state == "succeeded"
            with sessions.begin() as session:
                request_cancel(session, busy)
            jobs = [wait(sessions, each) for each in put(sessions, "echo", 8)]  # both share them
    assert {(job.state, job.attempt) for job in jobs} == {("succeeded", 1)}
    assert all(len(items(sessions, job.id)) == 2 for job in jobs)
    assert len(items(sessions, job_id)) == 5
