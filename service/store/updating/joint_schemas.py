"""Joint updates as clients see them: one posterior of a material from several campaigns."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from service.jobs.state import JobOut
from service.web import StrictModel


class JointCampaignOut(StrictModel):
    """One campaign of a joint update, with the structure's version that it is computed with."""

    campaign_id: UUID
    structure_version_id: UUID


class JointUpdateOut(JobOut):
    """A joint update: how far it is, or what became of it. Its result is at `/joint-updates/{id}/result`."""

    project_id: UUID
    campaigns: list[JointCampaignOut]
    request: dict[str, Any]
    priority: int
