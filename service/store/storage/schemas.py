"""What a client gets about a project's storage."""

from __future__ import annotations

from pydantic import Field

from service.web.bodies import StrictModel


class StorageOut(StrictModel):
    """How much a project stores, and how much it may."""

    used_bytes: int = Field(description="what is deleted counts until it is purged")
    allowed_bytes: int = Field(description="the operator's `MODALBASE_PROJECT_QUOTA_BYTES`")
    parts: dict[str, int] = Field(
        description="bytes of `files` as they were uploaded, `frfs`, `records`, `curves` of coupons, `modes`, `results`"
    )
