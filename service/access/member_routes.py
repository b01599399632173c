"""Routes of a project's members."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import Path
from sqlalchemy import func, select
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.access.audit import audit
from service.access.dependencies import CurrentUser, SessionDep
from service.access.projects import project_for
from service.access.schemas import MemberIn, MemberOut
from service.access.tables import Member, User
from service.access.users import expected_user, find_user, names_of
from service.errors import Conflict, NotFound, not_found_as
from service.web import Page, api_router
from service.web.bodies import Name
from service.web.paging import Cursor, Limit, paged

router = api_router(tags=["access"])
MOST_MEMBERS = 1000  # of one project
MemberName = Annotated[Name, Path(description="name of a user, or id of one")]


@router.get("/projects/{project_id}/members")
def list_members(
    project_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[MemberOut]:
    """Who is in a project, and in which role."""
    project = project_for(session, user, project_id)
    query = select(Member).where(Member.project_id == project.id)
    rows, following = paged(session, query, Member.user_id, cursor, limit)
    names = names_of(session, {row.user_id for row in rows})
    items = [
        MemberOut(project_id=project.id, user_id=row.user_id, user=names[row.user_id], role=row.role)  # type: ignore[arg-type]  # the column holds roles
        for row in rows
    ]
    return Page(items=items, next_cursor=following)


@router.put("/projects/{project_id}/members/{member}")
def put_member(
    project_id: UUID, member: MemberName, body: MemberIn, session: SessionDep, user: CurrentUser
) -> MemberOut:
    """Give a user, by name or id, a role in the project.

    The answer to a name is the same whether or not there is such a user: who has no key yet is a member as soon as the
    operator makes one (`modalbase keys create --name NAME`).
    """
    project = project_for(session, user, project_id, "owner")
    found = expected_user(session, member)
    if body.role != "owner":
        _keep_an_owner(session, project_id, found)
    _require_place(session, project_id, found)
    session.execute(
        insert(Member)
        .values(project_id=project.id, user_id=found.id, role=body.role)
        .on_conflict_do_update(index_elements=["project_id", "user_id"], set_={"role": body.role})
    )
    audit(session, user, "member.put", "user", found.id, project.id, role=body.role)
    return MemberOut(project_id=project.id, user_id=found.id, user=found.name, role=body.role)


@router.delete("/projects/{project_id}/members/{member}", status_code=204)
def delete_member(project_id: UUID, member: str, session: SessionDep, user: CurrentUser) -> None:
    """Take a user out of the project: an owner anybody, every member themselves."""
    found = user if member in (user.name, str(user.id)) else None
    project = project_for(session, user, project_id, "viewer" if found else "owner", resting=found is not None)
    with not_found_as("member", member):  # whether there is a user of that name is nobody's business
        found = found or find_user(session, member)
    row = session.get(Member, (project.id, found.id))
    if row is None:
        raise NotFound("member", member)
    _keep_an_owner(session, project_id, found)
    session.delete(row)
    audit(session, user, "member.delete", "user", found.id, project.id)


def _require_place(session: Session, project_id: UUID, coming: User) -> None:
    """Refuse one member too many; the role of one who is in the project already can be changed."""
    others = select(func.count()).where(Member.project_id == project_id, Member.user_id != coming.id)
    if session.scalars(others).one() >= MOST_MEMBERS:
        raise Conflict(f"the project has {MOST_MEMBERS} members, as many as it may; take one out first")


def _keep_an_owner(session: Session, project_id: UUID, leaving: User) -> None:
    """Refuse to take the last owner's role away."""
    owners = session.scalars(
        select(Member.user_id).where(Member.project_id == project_id, Member.role == "owner").with_for_update()
    ).all()
    if list(owners) == [leaving.id]:
        raise Conflict(f"{leaving.name} is the project's last owner; make another member an owner first")
