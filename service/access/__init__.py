"""Who may do what: users, API keys, projects and their members, the audit trail; paging and versions of what is edited.

What a feature needs of it::

    from service.access import CurrentUser, SessionDep, audit, project_for

    @router.post("/projects/{project_id}/structures", status_code=201)
    def create(project_id: UUID, body: StructureIn, session: SessionDep, user: CurrentUser) -> StructureOut:
        project = project_for(session, user, project_id, "editor")   # NotFound or Forbidden
        ...
        audit(session, user, "structure.create", "structure", row.id, project.id)
"""

from service.access.audit import audit
from service.access.dependencies import CurrentUser, SessionDep, SettingsDep
from service.access.etag import IF_MATCH, etag_of, require_match
from service.access.hiding import bring_back, hide
from service.access.paging import Cursor, Limit, paged
from service.access.projects import Role, project_for
from service.access.tables import ApiKey, AuditEvent, Member, Project, User

__all__ = [
    "IF_MATCH",
    "ApiKey",
    "AuditEvent",
    "CurrentUser",
    "Cursor",
    "Limit",
    "Member",
    "Project",
    "Role",
    "SessionDep",
    "SettingsDep",
    "User",
    "audit",
    "bring_back",
    "etag_of",
    "hide",
    "paged",
    "project_for",
    "require_match",
]
