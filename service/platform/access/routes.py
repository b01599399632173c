"""Routes of projects and their members, of keys, sessions and users, and of the audit trail.

Those of users are for administrators. None of them makes a key, so nobody acts in another's name.
"""

from collections.abc import Sequence
from functools import partial
from typing import Annotated
from uuid import UUID

from fastapi import Depends, Path, Query, Request, Response
from sqlalchemy import func, or_, select
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.platform.access.dependencies import CurrentKey, CurrentUser, SessionDep, token_of
from service.platform.access.keys import (
    COOKIE,
    LIFETIME,
    close_session,
    create_key,
    is_session_token,
    locked_key,
    open_session,
    request_token,
    revoke_key,
)
from service.platform.access.lookup import project_for, projects, projects_of
from service.platform.access.routing import api_router
from service.platform.access.schemas import (
    AuditEventOut,
    KeyEnd,
    KeyIn,
    KeyOut,
    MemberIn,
    MemberOut,
    NewKeyOut,
    ProjectIn,
    ProjectOut,
    ProjectPatch,
    SessionOut,
    UserOut,
)
from service.platform.access.tables import ApiKey, AuditEvent, Member, Project, User
from service.platform.access.users import (
    audit,
    expected_user,
    find_user,
    names_of,
    require_administrator,
    set_disabled,
    user_of_id,
    valid_key_counts,
)
from service.platform.db.base import transaction_time
from service.platform.errors import Conflict, Invalid, NotFound, not_found_as
from service.platform.web import IF_MATCH, Page, etag_of, require_match, shown_as
from service.platform.web.bodies import Name
from service.platform.web.parameters import Cursor, Limit, UnlessNamed, paged, there

router = api_router(tags=["access"])


@router.post("/projects", status_code=201, responses=there(ProjectOut))
def create_project(
    body: ProjectIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    unless_named: UnlessNamed = False,
) -> ProjectOut:
    """Make a project; its maker is its owner."""
    among = Project.id.in_(projects_of(user))
    project = projects.first_named(session, user.id, body.name, among) if unless_named else None
    if project is not None:
        response.status_code = 200
    else:
        project = projects.add(session, user, Project(**body.model_dump()), name=body.name)
        session.add(Member(project_id=project.id, user_id=user.id, role="owner"))
    response.headers["Location"] = f"/api/v1/projects/{project.id}"
    return ProjectOut.model_validate(project)


@router.get("/projects")
def list_projects(
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
    deleted: Annotated[
        bool, Query(description="list deleted projects, which can be restored, instead")
    ] = False,
) -> Page[ProjectOut]:
    """Projects that one is a member of, archived ones included."""
    hidden = Project.deleted_at.is_not(None) if deleted else Project.deleted_at.is_(None)
    mine = (
        select(Project)
        .join(Member, Member.project_id == Project.id)
        .where(Member.user_id == user.id, hidden)
    )
    return paged(session, mine, cursor, limit, partial(map, ProjectOut.model_validate))


@router.get("/projects/{project_id}")
def get_project(
    project_id: UUID, session: SessionDep, user: CurrentUser, response: Response
) -> ProjectOut:
    """One project."""
    return _shown(project_for(session, user, project_id), response)


@router.patch("/projects/{project_id}", openapi_extra=IF_MATCH)
def change_project(
    project_id: UUID,
    body: ProjectPatch,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    response: Response,
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
            project.archived_at = (
                (project.archived_at or transaction_time(session)) if value else None
            )
        else:
            setattr(project, name, value)
    project.updated_at = transaction_time(session)
    projects.note(session, user, project, "change", was=was, now=now)
    return _shown(project, response)


@router.delete("/projects/{project_id}", status_code=204)
def delete_project(project_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Hide a project and all that is in it. It stays stored: an owner can restore it, or purge it
    for good.
    """
    project = _locked(session, user, project_id)
    if project.deleted_at is not None:
        raise NotFound("project", project_id)
    projects.hide(session, user, project)


@router.post("/projects/{project_id}/restore")
def restore_project(
    project_id: UUID, session: SessionDep, user: CurrentUser, response: Response
) -> ProjectOut:
    """Bring a deleted project back."""
    project = _locked(session, user, project_id)
    projects.restore(session, user, project)
    return _shown(project, response)


def _locked(session: Session, user: User, project_id: UUID) -> Project:
    """An owner's project, archived or deleted or not, that nobody else edits until the transaction
    ends.
    """
    project = project_for(session, user, project_id, "owner", resting=True)
    session.refresh(project, with_for_update={"key_share": True})
    return project


def _shown(project: Project, response: Response) -> ProjectOut:
    shown = ProjectOut.model_validate(project)
    response.headers["ETag"] = etag_of(shown)
    return shown


@router.post("/api-keys", status_code=201)
def create_api_key(
    body: KeyIn, session: SessionDep, user: CurrentUser, own: CurrentKey, response: Response
) -> NewKeyOut:
    """Make another key of one's own, with no more rights than the one that makes it; the answer
    alone shows it.
    """
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
    response.headers["Cache-Control"] = "no-store"
    return NewKeyOut(**KeyOut.model_validate(row).model_dump(), key=key)


@router.get("/api-keys")
def list_api_keys(
    session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[KeyOut]:
    """One's own keys, without their secrets."""
    return _keys_of(session, user.id, cursor, limit)


@router.delete("/api-keys/{key_id}", status_code=204)
def revoke_api_key(key_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Revoke a key of one's own: from now on it opens nothing."""
    revoke_key(session, user, locked_key(session, user.id, key_id))


@router.get("/audit-events")
def list_audit_events(
    session: SessionDep,
    user: CurrentUser,
    project: Annotated[UUID | None, Query(description="only this project's")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[AuditEventOut]:
    """What was done in one's projects and by oneself, newest first."""
    query = select(AuditEvent).where(
        or_(AuditEvent.user_id == user.id, AuditEvent.project_id.in_(projects_of(user)))
    )
    if project is not None:
        query = query.where(AuditEvent.project_id == project_for(session, user, project).id)

    def shown(rows: Sequence[AuditEvent]) -> list[AuditEventOut]:
        names = names_of(session, {row.user_id for row in rows})
        return [AuditEventOut(**row.__dict__, user=names.get(row.user_id)) for row in rows]

    return paged(session, query, cursor, limit, shown, newest_first=True)


MOST_MEMBERS = 1000  # of one project
MemberName = Annotated[Name, Path(description="name of a user, or id of one")]


@router.get("/projects/{project_id}/members")
def list_members(
    project_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[MemberOut]:
    """Who is in a project, and in which role."""
    project = project_for(session, user, project_id)
    query = select(Member).where(Member.project_id == project.id)

    def shown(rows: Sequence[Member]) -> list[MemberOut]:
        names = names_of(session, {row.user_id for row in rows})
        return [shown_as(MemberOut, row, user=names[row.user_id]) for row in rows]

    return paged(session, query, cursor, limit, shown, key=Member.user_id)


@router.put("/projects/{project_id}/members/{member}")
def put_member(
    project_id: UUID, member: MemberName, body: MemberIn, session: SessionDep, user: CurrentUser
) -> MemberOut:
    """Give a user, by name or id, a role in the project.

    The answer to a name is the same whether or not there is such a user: who has no key yet is a
    member as soon as the operator makes one (`modalbase keys create --name NAME`).
    """
    project = project_for(session, user, project_id, "owner")
    added = expected_user(session, member)
    if body.role != "owner":
        _keep_an_owner(session, project_id, added)
    _require_place(session, project_id, added)
    session.execute(
        insert(Member)
        .values(project_id=project.id, user_id=added.id, role=body.role)
        .on_conflict_do_update(index_elements=["project_id", "user_id"], set_={"role": body.role})
    )
    audit(session, user, "member.put", "user", added.id, project.id, role=body.role)
    return MemberOut(project_id=project.id, user_id=added.id, user=added.name, role=body.role)


@router.delete("/projects/{project_id}/members/{member}", status_code=204)
def delete_member(project_id: UUID, member: str, session: SessionDep, user: CurrentUser) -> None:
    """Take a user out of the project: an owner anybody, every member themselves."""
    removed = user if member in (user.name, str(user.id)) else None
    project = project_for(
        session, user, project_id, "viewer" if removed else "owner", resting=removed is not None
    )
    # whether there is a user of that name is nobody's business
    with not_found_as("member", member):
        removed = removed or find_user(session, member)
    row = session.get(Member, (project.id, removed.id))
    if row is None:
        raise NotFound("member", member)
    _keep_an_owner(session, project_id, removed)
    session.delete(row)
    audit(session, user, "member.delete", "user", removed.id, project.id)


def _require_place(session: Session, project_id: UUID, coming: User) -> None:
    """Refuse one member too many; the role of one who is in the project already can be changed."""
    others = select(func.count()).where(
        Member.project_id == project_id, Member.user_id != coming.id
    )
    if session.scalars(others).one() >= MOST_MEMBERS:
        raise Conflict(
            f"the project has {MOST_MEMBERS} members, as many as it may; take one out first"
        )


def _keep_an_owner(session: Session, project_id: UUID, leaving: User) -> None:
    """Refuse to take the last owner's role away."""
    owners = session.scalars(
        select(Member.user_id)
        .where(Member.project_id == project_id, Member.role == "owner")
        .with_for_update()
    ).all()
    if list(owners) == [leaving.id]:
        raise Conflict(
            f"{leaving.name} is the project's last owner; make another member an owner first"
        )


@router.post("/session", status_code=201)
def sign_in(
    session: SessionDep, user: CurrentUser, key: CurrentKey, request: Request, response: Response
) -> SessionOut:
    """Begin a browser's session with the key of this request; the answer sets its cookie.

    The cookie is not readable by scripts and is sent to this host alone. A request that changes
    something and comes with the cookie needs `X-CSRF-Token` as well, which the answer holds.
    """
    if is_session_token(token_of(request)):
        raise Conflict("this is a session already; sign in with a key")
    row, token = open_session(session, key)
    audit(session, user, "session.create", "session", row.id)
    response.set_cookie(
        COOKIE,
        token,
        max_age=int(LIFETIME.total_seconds()),
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )
    response.headers["Cache-Control"] = "no-store"
    return SessionOut(user=user.name, expires_at=row.expires_at, csrf_token=request_token(token))


@router.delete("/session", status_code=204)
def sign_out(session: SessionDep, user: CurrentUser, request: Request, response: Response) -> None:
    """End the session of this request's cookie, here and for whoever has its cookie."""
    token = token_of(request)
    if not is_session_token(token):
        raise Conflict(
            "the request comes with a key and not with a session's cookie; revoke the key to end it"
        )
    close_session(session, token)
    audit(session, user, "session.delete", "session", None)
    response.delete_cookie(COOKIE, httponly=True, samesite="strict")


def _administrator(user: CurrentUser) -> None:
    require_administrator(user)


ADMINISTRATORS = [Depends(_administrator)]


@router.get("/users", dependencies=ADMINISTRATORS)
def list_users(
    session: SessionDep,
    name: Annotated[
        str | None, Query(max_length=200, description="only the user of this name")
    ] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[UserOut]:
    """All users; for administrators, with a key of the scope `admin`."""
    query = (
        select(User) if name is None else select(User).where(User.name == name.replace("\0", ""))
    )
    return paged(session, query, cursor, limit, partial(_described, session))


@router.get("/users/{user_id}", dependencies=ADMINISTRATORS)
def get_user(user_id: UUID, session: SessionDep) -> UserOut:
    """One user; for administrators."""
    return _described(session, [user_of_id(session, user_id)])[0]


@router.post("/users/{user_id}/disable", dependencies=ADMINISTRATORS)
def disable_user(user_id: UUID, session: SessionDep, user: CurrentUser) -> UserOut:
    """Disable a user: from now on none of their keys opens anything; for administrators."""
    disabled = user_of_id(session, user_id, locked=True)
    set_disabled(session, user, disabled, disabled=True)
    return _described(session, [disabled])[0]


@router.post("/users/{user_id}/enable", dependencies=ADMINISTRATORS)
def enable_user(user_id: UUID, session: SessionDep, user: CurrentUser) -> UserOut:
    """Enable a user who was disabled; for administrators."""
    enabled = user_of_id(session, user_id, locked=True)
    set_disabled(session, user, enabled, disabled=False)
    return _described(session, [enabled])[0]


@router.get("/users/{user_id}/api-keys", dependencies=ADMINISTRATORS)
def list_keys_of_user(
    user_id: UUID, session: SessionDep, cursor: Cursor = None, limit: Limit = 100
) -> Page[KeyOut]:
    """A user's keys, without their secrets; for administrators."""
    return _keys_of(session, user_of_id(session, user_id).id, cursor, limit)


@router.patch("/users/{user_id}/api-keys/{key_id}", dependencies=ADMINISTRATORS)
def end_key_of_user(
    user_id: UUID, key_id: UUID, body: KeyEnd, session: SessionDep, user: CurrentUser
) -> KeyOut:
    """Have a user's key expire, never later than it does already; for administrators."""
    key = locked_key(session, user_of_id(session, user_id).id, key_id)
    if key.revoked_at is not None:
        raise Conflict("the key is revoked")
    if body.expires_at <= transaction_time(session):
        raise Invalid("/expires_at", "is over already; DELETE revokes the key at once")
    if key.expires_at is not None and body.expires_at > key.expires_at:
        raise Invalid(
            "/expires_at", f"is later than the key's end now, {key.expires_at.isoformat()}"
        )
    key.expires_at = body.expires_at
    audit(
        session, user, "api_key.expire", "api_key", key.id, expires_at=body.expires_at.isoformat()
    )
    return KeyOut.model_validate(key)


@router.delete("/users/{user_id}/api-keys/{key_id}", status_code=204, dependencies=ADMINISTRATORS)
def revoke_key_of_user(user_id: UUID, key_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Revoke a user's key: from now on it opens nothing; for administrators."""
    revoke_key(session, user, locked_key(session, user_of_id(session, user_id).id, key_id))


def _keys_of(session: Session, user_id: UUID, cursor: str | None, limit: int) -> Page[KeyOut]:
    return paged(
        session,
        select(ApiKey).where(ApiKey.user_id == user_id),
        cursor,
        limit,
        partial(map, KeyOut.model_validate),
    )


def _described(session: Session, users: Sequence[User]) -> list[UserOut]:
    counts = valid_key_counts(session, [user.id for user in users])
    return [UserOut(**user.__dict__, valid_keys=counts.get(user.id, 0)) for user in users]
