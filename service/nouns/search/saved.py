"""Searches that are kept under a name, for all members of a project: the table, and the routes."""

from datetime import datetime
from functools import partial
from typing import Any
from uuid import UUID

from fastapi import Response
from pydantic import Field, field_validator
from sqlalchemy import ForeignKey, UniqueConstraint, select
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.nouns.search.nouns import SEARCHED
from service.nouns.search.operations import Search, SearchQuery, names_in
from service.nouns.search.translate import LONGEST
from service.platform.access import (
    CurrentUser,
    Lookup,
    SessionDep,
    User,
    api_router,
    project_for,
    projects_of,
)
from service.platform.db.base import Base, Identified
from service.platform.errors import Conflict, Fault, Invalid, NotFound
from service.platform.web import (
    Cursor,
    Id,
    Limit,
    Name,
    Page,
    RequestModel,
    StrictModel,
    example,
    paged,
    shown_as,
    wrong,
)
from service.platform.web.bodies import SOME_ID

router = api_router(tags=["search"])


class SavedSearch(Identified, Base):
    """A search under a name."""

    __tablename__ = "saved_searches"
    __table_args__ = (UniqueConstraint("project_id", "name"),)

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    name: Mapped[str]
    noun: Mapped[str]
    query: Mapped[dict[str, Any]]


class SearchIn(RequestModel):
    """A search to keep, as `GET /search/{noun}` takes it."""

    model_config = example(
        project=SOME_ID,
        name="soft",
        noun="results",
        filter="Ex < 30e9",
    )

    project: Id = Field(description="whose members see it")
    name: Name
    noun: str = Field(json_schema_extra={"enum": list(SEARCHED)})
    filter: str = Field("", max_length=LONGEST)
    q: str = Field("", max_length=200)
    sort: str = Field("", max_length=100)
    fields: str = Field("", max_length=LONGEST)

    @field_validator("noun")
    @classmethod
    def _is_searched(cls, noun: str) -> str:
        if noun not in SEARCHED:
            raise wrong(f"expected one of {', '.join(SEARCHED)}")
        return noun


class SearchOut(StrictModel):
    """A search that is kept."""

    id: UUID
    created_at: datetime
    project_id: UUID
    name: str
    noun: str
    query: dict[str, str] = Field(description="parameters of `GET /search/{noun}`")


saved_for = Lookup(SavedSearch, "saved search", "project_id")


def list_saved(
    session: Session, user: User, cursor: Cursor = None, limit: int = 100
) -> Page[SearchOut]:
    """Searches that are kept in the user's projects."""
    query = select(SavedSearch).where(SavedSearch.project_id.in_(projects_of(user)))
    return paged(session, query, cursor, limit, partial(map, partial(shown_as, SearchOut)))


@router.post("/searches", status_code=201)
def save_search(
    body: SearchIn, session: SessionDep, user: CurrentUser, response: Response
) -> SearchOut:
    """Keep a search under a name, for all members of a project. It finds what whoever asks may
    see.
    """
    try:
        project = project_for(session, user, body.project, "editor")
    except NotFound as error:
        raise Invalid("/project", str(error)) from None
    try:
        Search(
            user,
            SEARCHED[body.noun],
            SearchQuery(body.filter, body.q, body.sort, names_in(body.fields)),
        )
    except Invalid as error:
        raise Invalid(
            [Fault(f"/{fault.pointer}", fault.detail) for fault in error.faults]
        ) from None
    query = {
        name: text for name in ("filter", "q", "sort", "fields") if (text := getattr(body, name))
    }
    kept = insert(SavedSearch).values(
        project_id=project.id, name=body.name, noun=body.noun, query=query
    )
    row = session.scalars(kept.on_conflict_do_nothing().returning(SavedSearch)).one_or_none()
    if row is None:
        raise Conflict(
            f"the project has a search {body.name!r} already; delete it first, or take another name"
        )
    saved_for.note(session, user, row, "create", name=body.name)
    response.headers["Location"] = f"/api/v1/searches/{row.id}"
    return shown_as(SearchOut, row)


@router.get("/searches")
def list_searches(
    session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[SearchOut]:
    """Searches that are kept in one's projects."""
    return list_saved(session, user, cursor, limit)


@router.get("/searches/{search_id}")
def get_search(search_id: UUID, session: SessionDep, user: CurrentUser) -> SearchOut:
    """A search that is kept."""
    return shown_as(SearchOut, saved_for(session, user, search_id))


@router.delete("/searches/{search_id}", status_code=204)
def delete_search(search_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Forget a search; what it finds stays."""
    row = saved_for(session, user, search_id, "editor")
    saved_for.note(session, user, row, "delete", name=row.name)
    session.delete(row)
