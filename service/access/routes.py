"""Routes of projects, members, API keys and the audit trail."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import Annotated
from uuid import UUID

from fastapi import Query, Response
from sqlalchemy import ColumnElement, or_, select
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.access.audit import audit
from service.access.dependencies import CurrentUser, SessionDep
from service.access.keys import create_key
from service.access.paging import Cursor, Limit, paged
from service.access.projects import project_for
from service.access.schemas import (
    AuditEventOut,
    KeyIn,
    KeyOut,
    MemberIn,
    MemberOut,
    NewKeyOut,
    ProjectIn,
    ProjectOut,
)
from service.access.tables import ApiKey, AuditEvent, Member, Project, User
from service.db.clock import transaction_time
from service.problems import Conflict, NotFound, Page, api_router

router = api_router(tags=["access"])


@router.post("/projects", status_code=201)
def create_project(body: ProjectIn, session: SessionDep, user: CurrentUser, response: Response) -> ProjectOut:
    """Make a project; its maker is its owner."""
    project = Project(name=body.name, description=body.description)
    session.add(project)
    session.flush()
    session.add(Member(project_id=project.id, user_id=user.id, role="owner"))
    audit(session, user, "project.create", "project", project.id, project.id, name=body.name)
    response.headers["Location"] = f"/api/v1/projects/{project.id}"
    return ProjectOut.model_validate(project)


@router.get("/projects")
def list_projects(
    session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[ProjectOut]:
    """Projects that one is a member of."""
    mine = select(Project).join(Member, Member.project_id == Project.id).where(Member.user_id == user.id)
    rows, following = paged(session, mine, Project.id, cursor, limit)
    return Page(items=[ProjectOut.model_validate(row) for row in rows], next_cursor=following)


@router.get("/projects/{project_id}")
def get_project(project_id: UUID, session: SessionDep, user: CurrentUser) -> ProjectOut:
    """One project."""
    return ProjectOut.model_validate(project_for(session, user, project_id))


@router.get("/projects/{project_id}/members")
def list_members(
    project_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[MemberOut]:
    """Who is in a project, and in which role."""
    project = project_for(session, user, project_id)
    query = select(Member).where(Member.project_id == project.id)
    rows, following = paged(session, query, Member.user_id, cursor, limit)
    names = _names(session, {row.user_id for row in rows})
    items = [
        MemberOut(project_id=project.id, user_id=row.user_id, user=names[row.user_id], role=row.role)  # type: ignore[arg-type]  # the column holds roles
        for row in rows
    ]
    return Page(items=items, next_cursor=following)


@router.put("/projects/{project_id}/members/{member}")
def put_member(project_id: UUID, member: str, body: MemberIn, session: SessionDep, user: CurrentUser) -> MemberOut:
    """Give a user, by name or id, a role in the project."""
    project = project_for(session, user, project_id, "owner")
    found = _user(session, member)
    if body.role != "owner":
        _keep_an_owner(session, project_id, found)
    session.execute(
        insert(Member)
        .values(project_id=project.id, user_id=found.id, role=body.role)
        .on_conflict_do_update(index_elements=["project_id", "user_id"], set_={"role": body.role})
    )
    audit(session, user, "member.put", "user", found.id, project.id, role=body.role)
    return MemberOut(project_id=project.id, user_id=found.id, user=found.name, role=body.role)


@router.delete("/projects/{project_id}/members/{member}", status_code=204)
def delete_member(project_id: UUID, member: str, session: SessionDep, user: CurrentUser) -> None:
    """Take a user out of the project."""
    project = project_for(session, user, project_id, "owner")
    found = _user(session, member)
    row = session.get(Member, (project.id, found.id))
    if row is None:
        raise NotFound("member", member)
    _keep_an_owner(session, project_id, found)
    session.delete(row)
    audit(session, user, "member.delete", "user", found.id, project.id)


def _user(session: Session, name_or_id: str) -> User:
    """A user by name or id; `NotFound` where there is none."""
    wanted: ColumnElement[bool] = User.name == name_or_id
    with suppress(ValueError):  # not an id, so a name
        wanted = or_(wanted, User.id == UUID(name_or_id))
    found = session.scalars(select(User).where(wanted)).first() if "\0" not in name_or_id else None
    if found is None:
        raise NotFound("user", name_or_id)
    return found


def _keep_an_owner(session: Session, project_id: UUID, leaving: User) -> None:
    """Refuse to take the last owner's role away."""
    owners = session.scalars(
        select(Member.user_id).where(Member.project_id == project_id, Member.role == "owner").with_for_update()
    ).all()
    if list(owners) == [leaving.id]:
        raise Conflict(f"{leaving.name} is the project's last owner; make another member an owner first")


@router.post("/api-keys", status_code=201)
def create_api_key(body: KeyIn, session: SessionDep, user: CurrentUser) -> NewKeyOut:
    """Make another key of one's own; the answer is the only place that shows it."""
    row, key = create_key(session, user, body.name)
    session.refresh(row)
    audit(session, user, "api_key.create", "api_key", row.id, name=body.name)
    return NewKeyOut(**KeyOut.model_validate(row).model_dump(), key=key)


@router.get("/api-keys")
def list_api_keys(session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100) -> Page[KeyOut]:
    """One's own keys, without their secrets."""
    rows, following = paged(session, select(ApiKey).where(ApiKey.user_id == user.id), ApiKey.id, cursor, limit)
    return Page(items=[KeyOut.model_validate(row) for row in rows], next_cursor=following)


@router.delete("/api-keys/{key_id}", status_code=204)
def revoke_api_key(key_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Revoke a key of one's own: from now on it opens nothing."""
    row = session.scalars(select(ApiKey).where(ApiKey.id == key_id, ApiKey.user_id == user.id)).one_or_none()
    if row is None:
        raise NotFound("API key", key_id)
    if row.revoked_at is None:
        row.revoked_at = transaction_time(session)
        audit(session, user, "api_key.revoke", "api_key", row.id)


@router.get("/audit-events")
def list_audit_events(
    session: SessionDep,
    user: CurrentUser,
    project: Annotated[UUID | None, Query(description="only this project's")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[AuditEventOut]:
    """What was done in one's projects and by oneself, newest first."""
    mine = select(Member.project_id).where(Member.user_id == user.id)
    query = select(AuditEvent).where(or_(AuditEvent.user_id == user.id, AuditEvent.project_id.in_(mine)))
    if project is not None:
        query = query.where(AuditEvent.project_id == project_for(session, user, project).id)
    rows, following = paged(session, query, AuditEvent.id, cursor, limit, newest_first=True)
    names = _names(session, {row.user_id for row in rows})
    items = [AuditEventOut(**row.__dict__, user=names.get(row.user_id)) for row in rows]
    return Page(items=items, next_cursor=following)


def _names(session: Session, user_ids: Iterable[UUID | None]) -> dict[UUID | None, str]:
    return {user.id: user.name for user in session.scalars(select(User).where(User.id.in_(user_ids)))}
