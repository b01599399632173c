"""What a client gets about a project's storage, and its route."""

from uuid import UUID

from pydantic import Field

from service.nouns.storage.operations import used_bytes
from service.platform.access import CurrentUser, SessionDep, SettingsDep, api_router, project_for
from service.platform.web.bodies import StrictModel


class StorageOut(StrictModel):
    """How much a project stores, and how much it may."""

    used_bytes: int = Field(description="what is deleted counts until it is purged")
    allowed_bytes: int = Field(description="the operator's `MODALBASE_PROJECT_QUOTA_BYTES`")
    parts: dict[str, int] = Field(
        description=(
            "bytes of `files` as they were uploaded, `frfs`, `records`, `curves` of coupons,"
            " `modes`, `results`, `attachments`"
        )
    )


router = api_router(tags=["access"])


@router.get("/projects/{project_id}/storage")
def get_storage(
    project_id: UUID, session: SessionDep, user: CurrentUser, settings: SettingsDep
) -> StorageOut:
    """How many bytes a project stores, and how many it may."""
    parts = used_bytes(session, project_for(session, user, project_id).id)
    return StorageOut(
        used_bytes=sum(parts.values()), allowed_bytes=settings.project_quota_bytes, parts=parts
    )
