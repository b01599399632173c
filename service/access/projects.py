"""Projects and roles: what a user may see and do."""

from __future__ import annotations

from typing import Literal
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.access.tables import Member, Project, User
from service.problems.errors import Forbidden, NotFound

Role = Literal["viewer", "editor", "owner"]

_RANK: dict[str, int] = {"viewer": 0, "editor": 1, "owner": 2}


def project_for(session: Session, user: User, project_id: UUID, role: Role = "viewer") -> Project:
    """The project, if the user has at least this role in it.

    Raises:
        NotFound: there is no such project, or the user is not a member.
        Forbidden: the user is a member of a lower role.
    """
    row = session.execute(
        select(Project, Member.role)
        .join(Member, Member.project_id == Project.id)
        .where(Project.id == project_id, Member.user_id == user.id)
    ).one_or_none()
    if row is None:
        raise NotFound("project", project_id)
    project, held = row
    if _RANK[held] < _RANK[role]:
        raise Forbidden(f"this needs the role {role} in the project; yours is {held}")
    return project
