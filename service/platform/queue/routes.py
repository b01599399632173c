"""Routes of nouns whose rows are jobs: those of every noun, and cancel, retry, watch."""

from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any
from uuid import UUID

from fastapi import APIRouter, Depends, Path, Response
from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from service.platform.access import CurrentUser, SessionDep
from service.platform.access.nouns import NounRoutes, Out, Row
from service.platform.queue.events import STREAM, Events
from service.platform.queue.resource import JobNoun, job_of, job_state
from service.platform.queue.tables import Job
from service.platform.web import shown_as


class JobRoutes(NounRoutes[Row, Out]):
    """Adds routes of a noun of jobs to a router."""

    def __init__(
        self,
        router: APIRouter,
        noun: JobNoun[Row],
        model: type[Out],
        key: str,
        own: Callable[[Session, Sequence[Row]], Iterable[dict[str, Any]]],
        *,
        newest_first: bool = True,
        listed: tuple[ColumnElement[bool], ...] = (),
        weight: ColumnElement[int] | None = None,
    ) -> None:
        """State a noun; as of `NounRoutes`, but that `own` says only what is in neither a row nor
        its job.
        """
        super().__init__(
            router, noun.find, model, self._with_jobs, noun.address, key, weight=weight
        )
        self._noun, self._own = noun, own
        self.newest_first, self.listed = newest_first, listed

    def _with_jobs(self, session: Session, rows: Sequence[Any]) -> Iterable[Out]:
        """Rows and their jobs are read at one moment, so that a job that has succeeded never stands
        beside a row without its result.
        """
        table: Any = self._noun.find.table
        query = (
            select(table, Job)
            .join(Job, Job.id == table.id)
            .where(table.id.in_([row.id for row in rows]))
        )
        by_id = {
            job.id: (row, job)
            for row, job in session.execute(query.execution_options(populate_existing=True))
        }
        read = [by_id[row.id] for row in rows]
        own = self._own(session, [row for row, _ in read])
        return [self._both(*both, **members) for both, members in zip(read, own, strict=True)]

    def _both(self, row: Row, job: Job, **own: Any) -> Out:
        priority = {"priority": job.priority} if "priority" in self._model.model_fields else {}
        return shown_as(self._model, row, **job_state(job), **priority, **own)

    def cancelling(self, name: str, text: str) -> None:
        """Add `POST …/{id}/cancel`."""
        self._act(name, text, "cancel", self._noun.cancel)

    def retrying(self, name: str, text: str) -> None:
        """Add `POST …/{id}/retry`."""
        self._act(name, text, "retry", self._noun.retry)

    def watching(self, name: str, text: str) -> None:
        """Add `GET …/{id}/events`: the states of the job as server-sent events."""
        row_id = Path(alias=self._id)

        def watch(
            session: SessionDep,
            user: CurrentUser,
            events: Annotated[Events, Depends()],
            key: UUID = row_id,
        ) -> Response:
            return events.of(job_of(session, self._noun.find(session, user, key)))

        path = f"{self._path}/events"
        self._add(
            name, text, watch, path, response_model=None, response_class=Response, responses=STREAM
        )

    def _act(self, name: str, text: str, act: str, do: Callable[[Session, Any, UUID], Row]) -> None:
        row_id = Path(alias=self._id)

        def acted(session: SessionDep, user: CurrentUser, key: UUID = row_id) -> Any:
            return self.shown(session, do(session, user, key))

        self._add(name, text, acted, f"{self._path}/{act}", methods=["POST"], status_code=202)
