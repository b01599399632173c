"""Projects and roles: what a user may see and do."""

from __future__ import annotations

from typing import Literal
from uuid import UUID

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from service.access.tables import Member, Project, User
from service.errors import Conflict, Forbidden, NotFound

Role = Literal["viewer", "editor", "owner"]

_RANK: dict[str, int] = {"viewer": 0, "editor": 1, "owner": 2}


def project_for(
    session: Session, user: User, project_id: UUID, role: Role = "viewer", *, resting: bool = False
) -> Project:
    """The project, if the user has at least this role in it.

    Args:
        session: the request's transaction.
        user: who asks.
        project_id: which one.
        role: what the act needs.
        resting: find a deleted one too, and let an archived one be changed.

    Raises:
        NotFound: there is no such project, it is deleted, or the user is not a member.
        Forbidden: the user is a member of a lower role.
        Conflict: the act would change a project that is archived.
    """
    row = session.execute(
        select(Project, Member.role)
        .join(Member, Member.project_id == Project.id)
        .where(Project.id == project_id, Member.user_id == user.id)
    ).one_or_none()
    if row is None:
        raise NotFound("project", project_id)
    require_role(row[0], row[1], role, resting=resting)
    return row[0]


def require_role(project: Project, held: str | None, role: Role, *, resting: bool = False) -> None:
    """Refuse what a user may not do in a project.

    Args:
        project: which one.
        held: the user's role in it; None of who is no member.
        role: what the act needs.
        resting: a deleted one will do, and an archived one may be changed.

    Raises:
        NotFound: it is deleted, or the user is not a member.
        Forbidden: the user is a member of a lower role.
        Conflict: the act would change a project that is archived.
    """
    if held is None or (project.deleted_at is not None and not resting):
        raise NotFound("project", project.id)
    if _RANK[held] < _RANK[role]:
        raise Forbidden(f"this needs the role {role} in the project; yours is {held}")
    if project.archived_at is not None and role != "viewer" and not resting:
        raise Conflict('the project is archived; PATCH it with {"archived": false} to change what is in it')


def projects_at_work() -> Select[UUID]:
    """Keys of the projects that are neither archived nor deleted, as part of a query."""
    return select(Project.id).where(Project.archived_at.is_(None), Project.deleted_at.is_(None))


def projects_of(user: User) -> Select[UUID]:
    """Keys of the projects that a user is a member of, as part of a query."""
    return (
        select(Member.project_id)
        .join(Project, Project.id == Member.project_id)
        .where(Member.user_id == user.id, Project.deleted_at.is_(None))
    )
