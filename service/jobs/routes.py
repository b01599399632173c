"""Routes of nouns whose rows are jobs: list, get, cancel, retry, watch. Each noun says which of them it has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, Generic, TypeVar
from uuid import UUID

from fastapi import APIRouter, Depends, Path, Response
from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from service.access import CurrentUser, SessionDep, User, project_for
from service.jobs.events import STREAM, Events
from service.jobs.resource import JobNoun, Row
from service.jobs.tables import Job
from service.web import Cursor, Limit, Page, paged

Out = TypeVar("Out")


class JobRoutes(Generic[Row, Out]):
    """Adds routes of a noun to a router. Each has the name by which the client calls it, and a text for the documentation."""

    def __init__(
        self,
        router: APIRouter,
        noun: JobNoun[Row],
        model: type[Out],
        describe: Callable[[Session, Sequence[tuple[Row, Job]]], Sequence[Out]],
        key: str,
        *,
        newest_first: bool = True,
        weight: ColumnElement[int] | None = None,
    ) -> None:
        """State a noun.

        Args:
            router: takes the routes.
            noun: what they do.
            model: of what clients see of a row.
            describe: (session, rows and their jobs) -> what clients see of them.
            key: name of a row's id in paths, such as `job_id`.
            newest_first: the order of a list.
            weight: bytes of a row, as `paged` takes it.
        """
        self._router, self._noun, self._model, self._describe, self._key = router, noun, model, describe, key
        self._newest_first, self._weight = newest_first, weight

    def one(self, session: SessionDep, user: User, key: UUID) -> Out:
        """A row as clients see it."""
        return self.shown(session, self._noun.find(session, user, key))

    def shown(self, session: Session, row: Row) -> Out:
        """A row as clients see it, with the state of its job as it is now."""
        return self.all_shown(session, [row])[0]

    def all_shown(self, session: Session, rows: Sequence[Any]) -> list[Out]:
        """Rows as clients see them, in the order given. They and their jobs are read at one moment, so that a job that has
        succeeded never stands beside a row without its result.
        """
        table: Any = self._noun.find.table
        query = select(table, Job).join(Job, Job.id == table.id).where(table.id.in_([row.id for row in rows]))
        found = {job.id: (row, job) for row, job in session.execute(query.execution_options(populate_existing=True))}
        return list(self._describe(session, [found[row.id] for row in rows]))

    def page(
        self, session: SessionDep, user: User, owner_id: UUID, cursor: Cursor = None, limit: Limit = 100
    ) -> Page[Out]:
        """Rows of one owner, a campaign or a project, as clients see them."""
        find, table = self._noun.find, self._noun.find.table
        owner = (find.owner or project_for)(session, user, owner_id)
        query = select(table).where(getattr(table, find.owner_key) == owner.id)
        shown = partial(self.all_shown, session)
        return paged(session, query, cursor, limit, shown, newest_first=self._newest_first, weight=self._weight)

    def listing(self, name: str, text: str, rows: int = 100) -> None:
        """Add `GET /campaigns/{campaign_id}/…`, with so many rows in a page by default."""
        find, owner = self._noun.find, Path(alias=self._noun.find.owner_key)

        def get_page(
            session: SessionDep, user: CurrentUser, owner_id: UUID = owner, cursor: Cursor = None, limit: Limit = rows
        ) -> Any:
            return self.page(session, user, owner_id, cursor, limit)

        path = f"/{find.owner_key.removesuffix('_id')}s/{{{find.owner_key}}}/{self._noun.address}"
        self._add(name, text, get_page, path, response_model=Page[self._model])  # type: ignore[name-defined]

    def getting(self, name: str, text: str) -> None:
        """Add `GET …/{id}`."""
        self._of_row(name, text, self.one)

    def cancelling(self, name: str, text: str) -> None:
        """Add `POST …/{id}/cancel`."""
        self._act(name, text, "cancel", self._noun.cancel)

    def retrying(self, name: str, text: str) -> None:
        """Add `POST …/{id}/retry`."""
        self._act(name, text, "retry", self._noun.retry)

    def watching(self, name: str, text: str) -> None:
        """Add `GET …/{id}/events`: the states of the job as server-sent events."""
        row_id = Path(alias=self._key)

        def watch(
            session: SessionDep, user: CurrentUser, events: Annotated[Events, Depends()], key: UUID = row_id
        ) -> Response:
            return events.of(self._noun.job_of(session, self._noun.find(session, user, key)))

        path = f"{self._path}/events"
        self._add(name, text, watch, path, response_model=None, response_class=Response, responses=STREAM)

    def _act(self, name: str, text: str, act: str, do: Callable[..., Row]) -> None:
        def acted(session: SessionDep, user: User, key: UUID) -> Out:
            return self.shown(session, do(session, user, key))

        self._of_row(name, text, acted, f"{self._path}/{act}", methods=["POST"], status_code=202)

    def _of_row(self, name: str, text: str, do: Callable[..., Out], path: str | None = None, **given: Any) -> None:
        row_id = Path(alias=self._key)

        def route(session: SessionDep, user: CurrentUser, key: UUID = row_id) -> Any:
            return do(session, user, key)

        self._add(name, text, route, path or self._path, response_model=self._model, **given)

    @property
    def _path(self) -> str:
        return f"/{self._noun.address}/{{{self._key}}}"

    def _add(self, name: str, text: str, route: Callable[..., Any], path: str, **given: Any) -> None:
        route.__name__, route.__doc__ = name, text
        self._router.add_api_route(path, route, **given)
