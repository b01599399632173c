"""Who may do what: users, API keys, projects and their members, the audit trail.

What a feature needs of it::

    from service.access import CurrentUser, SessionDep, audit, project_for

    @router.post("/projects/{project_id}/structures", status_code=201)
    def create(project_id: UUID, body: StructureIn, session: SessionDep, user: CurrentUser) ->
    StructureOut:
        project = project_for(session, user, project_id, "editor")   # NotFound or Forbidden
        ...
        structure_for.add(session, user, row)   # stores it, and notes it in the audit trail; `structure_for` is a `Lookup`
"""

from typing import TYPE_CHECKING, Any

from service.access.lookup import (
    Lookup,
    Role,
    present,
    project_for,
    projects_at_work,
    projects_of,
    role_in,
)
from service.access.tables import ApiKey, AuditEvent, Member, Project, User
from service.access.users import audit

if TYPE_CHECKING:
    from service.access.dependencies import CurrentUser, SessionDep, SettingsDep

__all__ = [
    "ApiKey",
    "AuditEvent",
    "CurrentUser",
    "Lookup",
    "Member",
    "Project",
    "Role",
    "SessionDep",
    "SettingsDep",
    "User",
    "audit",
    "present",
    "project_for",
    "projects_at_work",
    "projects_of",
    "role_in",
]


def __getattr__(name: str) -> Any:
    """What routes need brings FastAPI with it, half of the time that a command takes to start:
    imported when asked for.
    """
    if name not in ("CurrentUser", "SessionDep", "SettingsDep"):
        raise AttributeError(name)
    from service.access import dependencies

    return getattr(dependencies, name)
