"""Update jobs with the names of what they belong to, for lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any
from uuid import UUID

from service.show.pages.look import Visit
from service.store.campaigns.operations import campaigns_of
from service.store.structures.operations import structures_of
from service.store.updating.operations import result_parts
from service.store.updating.schemas import UpdateJobOut


@dataclass(frozen=True)
class NamedJob:
    """An update job in a list."""

    job: UpdateJobOut  # itself
    campaign: str  # name of its campaign
    structure: str  # name of its structure
    structure_id: UUID  # key of that
    result: dict[str, Any] | None  # the parts of its document that were asked for; None where it has none

    @property
    def verdict(self) -> str | None:
        """The verdict's level; None without a result."""
        return None if self.result is None else str(self.result["verdict"]["level"])


def name_jobs(visit: Visit, jobs: Sequence[UpdateJobOut], parts: Sequence[str] = ("verdict",)) -> list[NamedJob]:
    """Jobs that the visitor may see, each with its names and these parts of its result."""
    campaigns = campaigns_of(visit.session, [job.campaign_id for job in jobs])
    structures = structures_of(visit.session, [row.structure_id for row in campaigns.values()])
    results = result_parts(visit.session, [job.id for job in jobs], parts)
    return [
        NamedJob(
            job=job,
            campaign=campaigns[job.campaign_id].name,
            structure=structures[campaigns[job.campaign_id].structure_id].name,
            structure_id=campaigns[job.campaign_id].structure_id,
            result=results.get(job.id),
        )
        for job in jobs
    ]


def over_time(jobs: Sequence[NamedJob], performed: Mapping[UUID, datetime | None]) -> list[dict[str, Any]]:
    """Estimates with their intervals for a figure over time: one row a result, `parameters` by name.

    Args:
        jobs: with the part `parameters` of their results.
        performed: when each campaign was; those that do not say stand at the time of their job.
    """
    rows = [
        {
            "name": job.campaign,
            "job": str(job.job.id),
            "at": (performed.get(job.job.campaign_id) or job.job.created_at).isoformat(),
            "parameters": {
                p["name"]: {"value": p["estimate"], "interval": p["interval_95"], "unit": p["unit"]}
                for p in job.result["parameters"]
            },
        }
        for job in jobs
        if job.result is not None
    ]
    return sorted(rows, key=lambda row: str(row["at"]))
