"""Pages of updates: the form of a recipe, a job on its way, its result."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import UUID

from fastapi import Query
from fastapi.responses import HTMLResponse

from service.access import routes as access
from service.jobs.resource import ENDED, JobState
from service.show.figures.marks import counted
from service.show.pages.comparing import leaves
from service.show.pages.forms import fields_of
from service.show.pages.found import opening
from service.show.pages.look import Visit, VisitDep
from service.show.pages.names import name_jobs
from service.show.pages.viewer import viewer_of
from service.show.results import routes as shown
from service.store.campaigns.schemas import CampaignOut
from service.store.coupons import routes as coupons
from service.store.frfs import routes as frfs
from service.store.frfs.routes import FrfFilter
from service.store.modes import routes as modes
from service.store.updating import routes as updating
from service.store.updating.operations import result_document, update_job_for
from service.store.updating.schemas import RecipeIn
from service.web.parameters import Cursor
from service.web.routing import page_router

router = page_router()
MOST = 100  # rows of a list on a page
PRINCIPAL = ("mode_set", "prior_from_coupon_batch", "method", "parameters", "damping_models", "posterior")
"""What an engineer chooses first; the rest of a recipe stands below."""


@router.get("/campaigns/{campaign_id}/update")
def get_new_update(
    campaign_id: UUID, visit: VisitDep, like: Annotated[UUID | None, Query(description="a job to repeat")] = None
) -> HTMLResponse:
    """The form of a recipe, made from its schema; filled in as another job's where one is named."""
    context = visit.in_campaign(campaign_id)
    sets = modes.nouns.page(visit.session, visit.user, campaign_id, limit=MOST).items
    batches = coupons.batches.page(visit.session, visit.user, context["structure"].id, limit=MOST).items
    choices = {
        "mode_set": [(str(s.id), f"{s.name} ({s.origin}, {counted(len(s.modes), 'mode')})") for s in reversed(sets)],
        "prior_from_coupon_batch": [(str(b.id), f"{b.name} ({', '.join(b.constants)})") for b in reversed(batches)],
    }
    fields = fields_of(RecipeIn, choices)
    first = sorted((f for f in fields if f.name in PRINCIPAL), key=lambda f: PRINCIPAL.index(f.name))
    start: dict[str, Any] = {}
    if like is not None:
        recipe = updating.single.one(visit.session, visit.user, like).recipe
        start = recipe.model_dump(mode="json", exclude_defaults=True, exclude_none=True)
    return visit.show(
        "new_update.html", **context, first=first, more=[f for f in fields if f.name not in PRINCIPAL], start=start
    )


@router.get("/update-jobs")
def get_jobs(
    visit: VisitDep,
    status: Annotated[list[JobState] | None, Query()] = None,
    project: Annotated[UUID | None, Query()] = None,
    cursor: Cursor = None,
) -> HTMLResponse:
    """Update jobs, newest first."""
    listed = updating.list_update_jobs(
        visit.session, visit.user, project=project, status=status, cursor=cursor, limit=MOST
    )
    projects = access.list_projects(visit.session, visit.user, limit=MOST).items
    return visit.show(
        "jobs.html",
        jobs=name_jobs(visit, listed.items),
        following=listed.next_cursor,
        status=status[0] if status else "",
        project_id=project,
        projects=projects,
    )


@router.get("/update-jobs/{job_id}")
def get_job(job_id: UUID, visit: VisitDep, part: Annotated[bool, Query()] = False) -> HTMLResponse:
    """A job: its progress while it runs, its result when it has one.

    `part` is the piece with the progress alone, which replaces itself; when the job has ended, it has the page loaded anew.
    """
    job = updating.single.one(visit.session, visit.user, job_id)
    if part:
        return visit.show_progress(job, "update-jobs")
    common = {"job": job, **visit.in_campaign(job.campaign_id)}
    if job.status != "succeeded":
        return visit.show("job.html", **common, ended=job.status in ENDED, kind="update-jobs")
    result = result_document(visit.session, update_job_for(visit.session, visit.user, job_id))
    figures = shown.list_figures(job_id, visit.session, visit.user).items
    steps, notes = opening(result)
    return visit.show(
        "result.html",
        **common,
        result=result,
        viewer=_viewer(visit, common["campaign"], job_id, result),
        figures=figures,
        steps=steps,
        notes=notes,
        recipe=list(leaves(job.recipe.model_dump(mode="json", exclude_defaults=True, exclude_none=True))),
        partners={pair["measured"]: pair["model"] for pair in (result.get("pairing") or {}).get("partners", [])},
    )


def _viewer(visit: Visit, campaign: CampaignOut, job_id: UUID, result: dict[str, Any]) -> dict[str, Any] | None:
    """The viewer with the FRFs that were used and are still there, and the result's model; None where there is none."""
    if campaign.deleted_at is not None:
        return None
    used = {frf["id"] for frf in result["provenance"].get("frfs", [])}
    rows = frfs.list_frfs(campaign.id, FrfFilter(), visit.session, visit.user, limit=1000).items
    kept = [row for row in rows if str(row.id) in used]
    modes = [(m["number"], m["measured_hz"], m["measured_damping"]) for m in result["modes"]]
    measured = {"id": "measured", "name": "measured modes", "modes": modes}
    return viewer_of(visit, campaign, kept, [measured], job_id) if kept else None
