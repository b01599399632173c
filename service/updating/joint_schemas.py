"""Joint updates as clients see them: one posterior of a material from several campaigns."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal
from uuid import UUID

from service.web import StrictModel


class JointCampaignOut(StrictModel):
    """One campaign of a joint update, with the structure's version that it is computed with."""

    campaign_id: UUID
    structure_version_id: UUID


class JointUpdateOut(StrictModel):
    """A joint update: how far it is, or what became of it. Its result is at `/joint-updates/{id}/result`."""

    id: UUID
    project_id: UUID
    campaigns: list[JointCampaignOut]
    request: dict[str, Any]
    status: Literal["queued", "running", "succeeded", "failed", "cancelled"]
    stage: str | None
    progress: float
    attempt: int
    priority: int
    message: str | None
    error: dict[str, Any] | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
