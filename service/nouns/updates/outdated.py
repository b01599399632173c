"""What changed since a result was computed, of what it was computed from: found when the result is
read, stored nowhere.
"""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from pydantic import Field
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import campaign_of
from service.nouns.frfs.operations import frfs_changed
from service.nouns.records.processings import hits_changed
from service.nouns.structures.operations import present_structure
from service.nouns.updates.result_schemas import ResultOut
from service.platform.access.users import first_event
from service.platform.queue.tables import Job
from service.platform.web import StrictModel

if TYPE_CHECKING:
    from service.nouns.updates.tables import UpdateJob


READ = ("boundary", "frame", "instruments", "inputs", "temperature_c")
"""Members of a campaign that an update reads."""


class OutdatedOut(StrictModel):
    """What changed since a result was computed."""

    since: datetime = Field(description="the first change")
    what: list[str] = Field(description="structure, campaign, points, hits, frfs: what changed")


class ResultNowOut(ResultOut):
    """A result as it stands today."""

    outdated: OutdatedOut | None = Field(
        description=(
            "what changed since it was computed, of what it was computed from; null where"
            " nothing did"
        )
    )


def outdated(session: Session, job: UpdateJob, document: dict[str, Any]) -> OutdatedOut | None:
    """What changed since a job read its inputs; None where the same request would compute from the
    same.

    Args:
        session: where to look.
        job: the update.
        document: its result, of which the provenance is read.
    """
    began = session.get_one(Job, job.id).started_at
    if began is None:
        return None
    campaign = campaign_of(session, job.campaign_id)
    version, _ = present_structure(session, campaign.structure_id)
    used = [UUID(frf["id"]) for frf in document["provenance"]["frfs"]]
    changes = {
        "structure": version.created_at if version.id != job.structure_version_id else None,
        "campaign": first_event(
            session, "campaign.change", [campaign.id], began, job.project_id, READ
        ),
        "points": first_event(session, "grid_points.put", [campaign.id], began, job.project_id),
        "hits": hits_changed(session, job.campaign_id, used, began),
        "frfs": frfs_changed(session, job.campaign_id, used, began),
    }
    changed = {what: at for what, at in changes.items() if at is not None}
    return OutdatedOut(since=min(changed.values()), what=list(changed)) if changed else None
