"""Who may do what: users, API keys, projects and their members, the audit trail.

What a feature needs of it::

    from service.platform.access import CurrentUser, SessionDep, api_router, project_for

    router = api_router(tags=["structures"])

    @router.post("/projects/{project_id}/structures", status_code=201)
    def create(project_id: UUID, body: StructureIn, session: SessionDep, user: CurrentUser) ->
    StructureOut:
        project = project_for(session, user, project_id, "editor")   # NotFound or Forbidden
        ...
        structure_for.add(session, user, row)   # stores it, and notes it in the audit trail; `structure_for` is a `Lookup`
"""

from typing import TYPE_CHECKING, Any

from service.platform.access.lookup import (
    Lookup,
    Role,
    present,
    project_for,
    projects_at_work,
    projects_of,
    role_in,
)
from service.platform.access.tables import ApiKey, AuditEvent, Member, Project, User
from service.platform.access.users import audit

if TYPE_CHECKING:
    from service.platform.access.dependencies import CurrentUser, SessionDep, SettingsDep
    from service.platform.access.routing import api_router

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
    "api_router",
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
    if name not in ("CurrentUser", "SessionDep", "SettingsDep", "api_router"):
        raise AttributeError(name)
    from service.platform.access import dependencies, routing

    return getattr(routing if name == "api_router" else dependencies, name)
