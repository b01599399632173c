"""The route of a project's storage."""

from __future__ import annotations

from uuid import UUID

from service.access import CurrentUser, SessionDep, SettingsDep, project_for
from service.store.storage.operations import used_bytes
from service.store.storage.schemas import StorageOut
from service.web import api_router

router = api_router(tags=["access"])


@router.get("/projects/{project_id}/storage")
def get_storage(project_id: UUID, session: SessionDep, user: CurrentUser, settings: SettingsDep) -> StorageOut:
    """How many bytes a project stores, and how many it may."""
    parts = used_bytes(session, project_for(session, user, project_id).id)
    return StorageOut(used_bytes=sum(parts.values()), allowed_bytes=settings.project_quota_bytes, parts=parts)
