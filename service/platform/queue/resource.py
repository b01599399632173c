"""A noun of the contract whose rows are jobs: how a job is shown; started, cancelled and tried
again by the same operations.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from datetime import datetime
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar
from uuid import UUID

from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.platform.access import Lookup, User, projects_of
from service.platform.db.base import Base
from service.platform.errors import Conflict
from service.platform.queue.kinds import Compute, JobKind
from service.platform.queue.queue import enqueue, request_cancel, retry
from service.platform.queue.tables import Job
from service.platform.web import StrictModel

Row = TypeVar("Row", bound=Base)
Value = TypeVar("Value")
JobState = Literal["queued", "running", "succeeded", "failed", "cancelled"]

ENDED = ("succeeded", "failed", "cancelled")
"""States that a job does not leave by itself."""


class JobOut(StrictModel):
    """How far a job is: what the answers of all features that run one begin with."""

    id: UUID
    status: JobState
    stage: str | None
    progress: float = Field(description="0 to 1")
    attempt: int
    message: str | None
    error: dict[str, Any] | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None


def job_state(job: Job) -> dict[str, Any]:
    """A job as the API shows it, the fields of `JobOut`."""
    return {
        name: job.state if name == "status" else getattr(job, name) for name in JobOut.model_fields
    }


def jobs_under_way(session: Session, user: User, most: int) -> Sequence[Job]:
    """Jobs of one's projects that run or wait, those that run first."""
    query = select(Job).where(
        Job.project_id.in_(projects_of(user)), Job.state.in_(("running", "queued"))
    )
    return session.scalars(query.order_by(Job.state.desc(), Job.id).limit(most)).all()


def job_of(session: Session, row: Any) -> Job:
    """The job of a row, as it is now."""
    return session.get_one(Job, row.id, populate_existing=True)


def require_result(session: Session, find: Lookup[Row], row: Row, value: Value | None) -> Value:
    """What was found of a row's result.

    Raises:
        Conflict: nothing, as it has none, yet or ever; the message says why.
    """
    if value is not None:
        return value
    job = job_of(session, row)
    why = f": {job.message or 'see its error'}" if job.state in ENDED else "; it is not done yet"
    raise Conflict(f"{find.kind} {job.id} has no result: it is {job.state}{why}")


class JobNoun(Generic[Row]):
    """Operations on the rows of one noun, each in the caller's transaction.

    Attributes:
        kind: what runs.
        find: the row, if the user has at least a role in its project; an act needs an editor.
        address: where the API has one, such as `update-jobs`.
    """

    def __init__(
        self,
        address: str,
        find: Lookup[Row],
        load: Callable[[Session, Row, Path], Any],
        compute: Compute,
        store: Callable[[Session, Row, Iterator[Any]], None],
        kind: str = "",
        **limits: Any,
    ) -> None:
        """State a noun; `load` and `store` are those of its `JobKind`, given the row in place of
        its key.

        Args:
            address: of the noun.
            find: its rows.
            load: what the computation needs.
            compute: the computation.
            store: what becomes of it.
            kind: name of the kind; default: what a person calls a row.
            limits: others of `JobKind`.
        """
        self.address, self.find = address, find
        self.kind = JobKind(
            kind or find.kind.replace(" ", "_"),
            load=lambda session, key, workspace: load(session, find.row(session, key), workspace),
            compute=compute,
            store=lambda session, key, items: store(session, find.row(session, key), items),
            **limits,
        )

    def seen_at(self, address: str, find: Lookup[Row]) -> "JobNoun[Row]":
        """The same kind of job, for the rows that another lookup finds, at another address."""
        other = copy(self)
        other.find, other.address = find, address
        return other

    def start(
        self,
        session: Session,
        user: User,
        row: Row,
        *,
        priority: int = 0,
        queue: str | None = None,
        **noted: Any,
    ) -> Row:
        """Queue the job of a new row, which gets the job's key, and note it in the audit trail.

        Args:
            session: the request's transaction.
            user: who asks; that the user may is known.
            row: complete but for its key.
            priority: among the project's waiting jobs.
            queue: where it waits; default: its kind's.
            noted: what else the audit trail keeps.
        """
        project_id = self.find.project_of(session, row)
        job = enqueue(
            session, kind=self.kind, project_id=project_id, priority=priority, queue=queue
        )
        row.id = job.id  # type: ignore[attr-defined]  # every table of a job has its key
        session.add(row)
        session.flush()
        self.find.note(session, user, row, "create", **noted)
        return row

    def cancel(self, session: Session, user: User, key: UUID) -> Row:
        """Ask for a job's end: one that waits is cancelled at once, one that runs is killed by its
        worker, one that has ended stays as it is.
        """
        return self._act(session, user, key, "cancel", request_cancel)

    def retry(self, session: Session, user: User, key: UUID) -> Row:
        """Queue a job again that failed or was cancelled, from its beginning, with the inputs that
        it had.

        Raises:
            Conflict: it waits, runs or has succeeded.
        """
        return self._act(session, user, key, "retry", retry)

    def _act(
        self, session: Session, user: User, key: UUID, act: str, do: Callable[[Session, UUID], Job]
    ) -> Row:
        row = self.find(session, user, key, "editor")
        do(session, key)
        self.find.note(session, user, row, act)
        return row
