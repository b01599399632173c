"""Attempts at jobs on a real database: what it and the computation may meet between the start and the end of one.

The computation runs here and not in a child, whose ends are what is given.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
from sqlalchemy import text, update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session
from structlog.testing import capture_logs

from service.db.engine import Sessions, make_engine, make_sessions
from service.jobs import attempt as attempts
from service.jobs import tickets
from service.jobs.attempt import Attempt
from service.jobs.child import CANCELLED, DRAINED, Checkpoint, Failure, Item, Message, Order, Progress
from service.jobs.dispatch import begin_next
from service.jobs.kinds import JobKind
from service.jobs.manager import Manager
from service.jobs.process import LOST, ChildEnded
from service.jobs.tables import Job
from service.settings import Settings
from tests.support import job_kinds
from tests.support.working import look, put

NOTHING = "postgresql://nobody@127.0.0.1:1/nothing"
BUG = Failure("internal", "ZeroDivisionError", "internal error", trace="where it was")


class Here:
    """What a child sends, without the child: the messages that the job's inputs are; a failure ends them."""

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

    def run(self, *sent: Message, load: Callable[[Session], Any] | None = None, **changed: Any) -> tuple[str, str]:
        """The outcome of an attempt and the job's state after it.

        Args:
            sent: by the child.
            load: what is done before that.
            changed: of the kind of job; `stop` is why it is stopped before it begins, with `lose_ticket` the queue has
                lost its ticket.
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
            assert job is not None
            if lose_ticket:
                session.execute(text("DELETE FROM procrastinate_jobs"))
            worker = session.scalar(text("INSERT INTO procrastinate_workers DEFAULT VALUES RETURNING id"))
            assert tickets.take(session, job, worker).id == job.ticket
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
    with capture_logs():  # to print a trace with the values of all its names takes longer than the attempt
        yield Trial(sessions, tmp_path)


def lose_connection(session: Session) -> None:
    session.execute(text("SELECT pg_terminate_backend(pg_backend_pid())"))


def test_ends_of_attempts(trial: Trial) -> None:
    assert trial.run(stop=CANCELLED) == ("cancelled", "cancelled")
    assert trial.run(Item(1), Item(2), store=first_alone) == ("succeeded", "succeeded")  # it leaves the second
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

    class Away:
        """Sessions on nothing for two transactions, that of the result and that of the attempt's end; then the real ones."""

        def __init__(self) -> None:
            self.left = [nowhere, nowhere]

        def begin(self) -> Any:
            """A transaction, whose first statement fails where there is no database."""
            return (self.left.pop() if self.left else sessions).begin()

    def leave(_: Session) -> None:
        assert trial.attempt is not None
        trial.attempt.sessions = Away()

    # What was drained is given back by those who see that this worker is gone.
    assert trial.run(DRAINED, load=leave) == ("abandoned", "running")
    assert trial.run(CANCELLED, load=leave) == ("cancelled", "cancelled")
    engine.dispose()
