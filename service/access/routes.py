"""Routes of projects, one's own API keys and the audit trail."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import Query, Request, Response
from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from service.access.audit import audit
from service.access.dependencies import CurrentKey, CurrentUser, SessionDep
from service.access.keys import create_key
from service.access.projects import project_for, projects_of
from service.access.schemas import (
    AuditEventOut,
    KeyIn,
    KeyOut,
    NewKeyOut,
    ProjectIn,
    ProjectOut,
    ProjectPatch,
)
from service.access.tables import ApiKey, AuditEvent, Member, Project, User
from service.access.users import names_of
from service.db.clock import transaction_time
from service.errors import Conflict, Invalid, NotFound
from service.web import IF_MATCH, Page, api_router, etag_of, require_match
from service.web.paging import Cursor, Limit, paged

router = api_router(tags=["access"])


@router.post("/projects", status_code=201)
def create_project(body: ProjectIn, session: SessionDep, user: CurrentUser, response: Response) -> ProjectOut:
    """Make a project; its maker is its owner."""
    project = Project(name=body.name, description=body.description)
    session.add(project)
    session.flush()
    session.refresh(project)
    session.add(Member(project_id=project.id, user_id=user.id, role="owner"))
    audit(session, user, "project.create", "project", project.id, project.id, name=body.name)
    response.headers["Location"] = f"/api/v1/projects/{project.id}"
    return ProjectOut.model_validate(project)


@router.get("/projects")
def list_projects(
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
    deleted: Annotated[bool, Query(description="list deleted projects, which can be restored, instead")] = False,
) -> Page[ProjectOut]:
    """Projects that one is a member of, archived ones included."""
    hidden = Project.deleted_at.is_not(None) if deleted else Project.deleted_at.is_(None)
    mine = select(Project).join(Member, Member.project_id == Project.id).where(Member.user_id == user.id, hidden)
    rows, following = paged(session, mine, Project.id, cursor, limit)
    return Page(items=[ProjectOut.model_validate(row) for row in rows], next_cursor=following)


@router.get("/projects/{project_id}")
def get_project(project_id: UUID, session: SessionDep, user: CurrentUser, response: Response) -> ProjectOut:
    """One project."""
    return _shown(project_for(session, user, project_id), response)


@router.patch("/projects/{project_id}", openapi_extra=IF_MATCH)
def change_project(
    project_id: UUID, body: ProjectPatch, session: SessionDep, user: CurrentUser, request: Request, response: Response
) -> ProjectOut:
    """Rename or describe a project, archive it or take it out of the archive; for owners."""
    project = _locked(session, user, project_id)
    if project.deleted_at is not None:
        raise NotFound("project", project_id)
    require_match(request, etag_of(ProjectOut.model_validate(project)))
    if not body.model_fields_set:
        raise Invalid("", "names nothing to change")
    now = body.model_dump(exclude_unset=True)
    was = {name: getattr(project, name) for name in now if name != "archived"}
    for name, value in now.items():
        if name == "archived":
            project.archived_at = (project.archived_at or transaction_time(session)) if value else None
        else:
            setattr(project, name, value)
    project.updated_at = transaction_time(session)
    audit(session, user, "project.change", "project", project.id, project.id, was=was, now=now)
    return _shown(project, response)


@router.delete("/projects/{project_id}", status_code=204)
def delete_project(project_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Hide a project and all that is in it. It stays stored: an owner can restore it, or purge it for good."""
    project = _locked(session, user, project_id)
    if project.deleted_at is not None:
        raise NotFound("project", project_id)
    project.deleted_at = project.updated_at = transaction_time(session)
    audit(session, user, "project.delete", "project", project.id, project.id)


@router.post("/projects/{project_id}/restore")
def restore_project(project_id: UUID, session: SessionDep, user: CurrentUser, response: Response) -> ProjectOut:
    """Bring a deleted project back."""
    project = _locked(session, user, project_id)
    if project.deleted_at is None:
        raise Conflict("the project is not deleted")
    project.deleted_at, project.updated_at = None, transaction_time(session)
    audit(session, user, "project.restore", "project", project.id, project.id)
    return _shown(project, response)


def _locked(session: Session, user: User, project_id: UUID) -> Project:
    """An owner's project, archived or deleted or not, that nobody else edits until the transaction ends."""
    project = project_for(session, user, project_id, "owner", resting=True)
    session.refresh(project, with_for_update={"key_share": True})
    return project


def _shown(project: Project, response: Response) -> ProjectOut:
    shown = ProjectOut.model_validate(project)
    response.headers["ETag"] = etag_of(shown)
    return shown


@router.post("/api-keys", status_code=201)
def create_api_key(body: KeyIn, session: SessionDep, user: CurrentUser, own: CurrentKey) -> NewKeyOut:
    """Make another key of one's own, with no more rights than the one that makes it; the answer alone shows it."""
    scopes = own.scopes if body.scopes is None else list(dict.fromkeys(body.scopes))
    if more := [scope for scope in scopes if scope not in own.scopes]:
        raise Invalid("/scopes", f"has {', '.join(more)}, which the key that makes it has not")
    expires_at = body.expires_at or own.expires_at
    if expires_at is not None:
        if expires_at <= transaction_time(session):
            raise Invalid("/expires_at", "is over already")
        if own.expires_at is not None and expires_at > own.expires_at:
            end = own.expires_at.isoformat()
            raise Invalid("/expires_at", f"is later than the end of the key that makes it, {end}")
    row, key = create_key(session, user, body.name, scopes, expires_at)
    session.refresh(row)
    audit(session, user, "api_key.create", "api_key", row.id, name=body.name, scopes=scopes)
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
    query = select(AuditEvent).where(or_(AuditEvent.user_id == user.id, AuditEvent.project_id.in_(projects_of(user))))
    if project is not None:
        query = query.where(AuditEvent.project_id == project_for(session, user, project).id)
    rows, following = paged(session, query, AuditEvent.id, cursor, limit, newest_first=True)
    names = names_of(session, {row.user_id for row in rows})
    items = [AuditEventOut(**row.__dict__, user=names.get(row.user_id)) for row in rows]
    return Page(items=items, next_cursor=following)
