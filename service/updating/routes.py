"""Routes of update jobs."""

from __future__ import annotations

from typing import Annotated, Any, Literal
from uuid import UUID

from fastapi import Header, Query, Response
from sqlalchemy import select

from service.access import CurrentUser, Cursor, Limit, Member, SessionDep, paged
from service.campaigns.operations import campaign_for
from service.jobs import Job
from service.problems import Page, Text, api_router
from service.updating import operations
from service.updating.schemas import RecipeIn, UpdateJobOut
from service.updating.tables import UpdateJob

router = api_router(tags=["update jobs"])

Status = Literal["queued", "running", "succeeded", "failed", "cancelled"]


@router.post("/campaigns/{campaign_id}/update-jobs", status_code=202)
def start_update(
    campaign_id: UUID,
    recipe: RecipeIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    idempotency_key: Annotated[Text | None, Header(max_length=255)] = None,
) -> UpdateJobOut:
    """Queue an update of the campaign's structure. `{}` is a recipe.

    With an `Idempotency-Key`, sending the same again gives the same job and not a second one.
    """
    row = operations.start_update(session, user, campaign_id, recipe, idempotency_key)
    response.headers["Location"] = f"/api/v1/update-jobs/{row.id}"
    return operations.describe(session, row)


@router.get("/update-jobs")
def list_update_jobs(
    session: SessionDep,
    user: CurrentUser,
    campaign: Annotated[UUID | None, Query(description="of this campaign only")] = None,
    status: Annotated[Status | None, Query(description="in this state only")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[UpdateJobOut]:
    """Update jobs that you may see, newest first."""
    projects = select(Member.project_id).where(Member.user_id == user.id)
    query = select(UpdateJob).where(UpdateJob.project_id.in_(projects))
    if campaign is not None:
        query = query.where(UpdateJob.campaign_id == campaign_for(session, user, campaign, deleted=True).id)
    if status is not None:
        query = query.join(Job, Job.id == UpdateJob.id).where(Job.state == status)
    rows, following = paged(session, query, UpdateJob.id, cursor, limit, newest_first=True)
    return Page(items=[operations.describe(session, row) for row in rows], next_cursor=following)


@router.get("/update-jobs/{job_id}")
def get_update_job(job_id: UUID, session: SessionDep, user: CurrentUser) -> UpdateJobOut:
    """How far an update is, or what became of it."""
    return operations.describe(session, operations.update_job_for(session, user, job_id))


@router.post("/update-jobs/{job_id}/cancel", status_code=202)
def cancel_update_job(job_id: UUID, session: SessionDep, user: CurrentUser) -> UpdateJobOut:
    """Ask for an update's end; one that has ended already stays as it is."""
    row = operations.update_job_for(session, user, job_id)
    operations.cancel_update(session, user, row)
    return operations.describe(session, row)


@router.get("/update-jobs/{job_id}/result")
def get_result(job_id: UUID, session: SessionDep, user: CurrentUser) -> dict[str, Any]:
    """Updated parameters, modes, correlation, convergence, warnings and where all of it came from."""
    return operations.result_document(session, operations.update_job_for(session, user, job_id))
