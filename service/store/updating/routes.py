"""Routes of update jobs, and of joint updates, which `POST /update-jobs` begins with `joint`."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import UUID

from fastapi import Depends, Header, Query, Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep, project_for, projects_of
from service.errors import Invalid
from service.jobs.events import STREAM, Events
from service.jobs.state import JobState
from service.jobs.tables import Job
from service.store.campaigns.operations import campaign_for, campaigns_in
from service.store.structures.operations import structure_for, structures_in
from service.store.updating import operations
from service.store.updating.batches import start_batch, start_joint
from service.store.updating.document import LARGE_PARTS, slim
from service.store.updating.result_schemas import JointResultOut, ResultOut
from service.store.updating.schemas import JointUpdateOut, RecipeIn, UpdateBatchIn, UpdateBatchOut, UpdateJobOut
from service.store.updating.tables import JointUpdate, UpdateJob
from service.web import Confirm, Cursor, Limit, Page, Text, api_router, paged, require_usual

router = api_router(tags=["update jobs"])

IdempotencyKey = Annotated[
    Text | None, Header(max_length=255, description="one of your own: the same again gives the same, no second one")
]
Priority = Annotated[int, Query(ge=-100, le=100, description="of the project's waiting jobs the highest runs first")]

Include = Annotated[
    str | None, Query(max_length=100, description=f"parts to add, with commas between them: {', '.join(LARGE_PARTS)}")
]


@router.post("/campaigns/{campaign_id}/update-jobs", status_code=202)
def start_update(
    campaign_id: UUID,
    recipe: RecipeIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    idempotency_key: IdempotencyKey = None,
    priority: Priority = 0,
    confirm: Confirm = False,
) -> UpdateJobOut:
    """Queue an update of the campaign's structure. `{}` is a recipe.

    With an `Idempotency-Key`, sending the same again gives the same job and not a second one.
    """
    require_usual(recipe, confirm)
    row = operations.start_update(session, user, campaign_id, recipe, idempotency_key, priority)
    response.headers["Location"] = f"/api/v1/update-jobs/{row.id}"
    return operations.describe(session, row)


@router.post("/update-jobs", status_code=202)
def start_updates(
    batch: UpdateBatchIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    idempotency_key: IdempotencyKey = None,
    priority: Priority = 0,
    confirm: Confirm = False,
) -> UpdateBatchOut:
    """Queue updates of many campaigns: all of them, or with any fault none.

    With `joint` they are one update: one material from all campaigns, at `/joint-updates/{id}`, which `Location` names.
    """
    require_usual(batch, confirm)
    if batch.joint:
        row = start_joint(session, user, batch, idempotency_key, priority)
        response.headers["Location"] = f"/api/v1/joint-updates/{row.id}"
        return UpdateBatchOut(items=[], joint=operations.describe_joint(session, row))
    rows = start_batch(session, user, batch, idempotency_key, priority)
    return UpdateBatchOut(items=operations.describe_all(session, rows))


@router.get("/update-jobs")
def list_update_jobs(
    session: SessionDep,
    user: CurrentUser,
    project: Annotated[UUID | None, Query(description="of this project only")] = None,
    structure: Annotated[UUID | None, Query(description="of this structure only")] = None,
    campaign: Annotated[UUID | None, Query(description="of this campaign only")] = None,
    status: Annotated[list[JobState] | None, Query(description="in these states only; may be repeated")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[UpdateJobOut]:
    """Update jobs that you may see, newest first; those of deleted structures are left out."""
    query = select(UpdateJob).where(UpdateJob.campaign_id.in_(campaigns_in(structures_in(projects_of(user)))))
    if project is not None:
        query = query.where(UpdateJob.project_id == project_for(session, user, project).id)
    if structure is not None:
        query = query.where(UpdateJob.campaign_id.in_(campaigns_in([structure_for(session, user, structure).id])))
    if campaign is not None:
        query = query.where(UpdateJob.campaign_id == campaign_for(session, user, campaign, deleted=True).id)
    if status is not None:
        query = query.join(Job, Job.id == UpdateJob.id).where(Job.state.in_(status))
    rows, following = paged(session, query, UpdateJob.id, cursor, limit, newest_first=True)
    return Page(items=operations.describe_all(session, rows), next_cursor=following)


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


@router.post("/update-jobs/{job_id}/retry", status_code=202)
def retry_update_job(job_id: UUID, session: SessionDep, user: CurrentUser) -> UpdateJobOut:
    """Queue an update again that failed or was cancelled."""
    row = operations.update_job_for(session, user, job_id)
    operations.retry_update(session, user, row)
    return operations.describe(session, row)


@router.get("/update-jobs/{job_id}/events", response_class=Response, responses=STREAM)
def watch_update_job(
    job_id: UUID, session: SessionDep, user: CurrentUser, events: Annotated[Events, Depends()]
) -> Response:
    """The job's state now and whenever it changes, as server-sent events of the type `job`; ends when the job has.

    Each event has an id; with that of the last one in `Last-Event-ID` a client that comes back gets what is new.
    """
    row = operations.update_job_for(session, user, job_id)
    return events.of(operations.job_of(session, row))


@router.get("/update-jobs/{job_id}/result", response_model=None, responses={200: {"model": ResultOut}})
def get_result(job_id: UUID, session: SessionDep, user: CurrentUser, include: Include = None) -> dict[str, Any]:
    """Verdict and warnings first, then parameters, modes, correlation, and where all of it came from.

    What only a figure needs is left out unless `include` names it: the stabilisation diagram, the iterates.
    """
    named = set(filter(None, (include or "").split(",")))
    if unknown := named - set(LARGE_PARTS):
        raise Invalid("include", f"names {', '.join(sorted(unknown))}; there are {', '.join(LARGE_PARTS)}")
    document = operations.result_document(session, operations.update_job_for(session, user, job_id))
    return slim(document, leave_out=set(LARGE_PARTS) - named)


@router.get("/projects/{project_id}/joint-updates")
def list_joint_updates(
    project_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[JointUpdateOut]:
    """Joint updates of a project, newest first."""
    query = select(JointUpdate).where(JointUpdate.project_id == project_for(session, user, project_id).id)
    rows, following = paged(session, query, JointUpdate.id, cursor, limit, newest_first=True)
    return Page(items=[operations.describe_joint(session, row) for row in rows], next_cursor=following)


@router.get("/joint-updates/{joint_id}")
def get_joint_update(joint_id: UUID, session: SessionDep, user: CurrentUser) -> JointUpdateOut:
    """How far a joint update is, or what became of it."""
    return operations.describe_joint(session, operations.joint_update_for(session, user, joint_id))


@router.post("/joint-updates/{joint_id}/cancel", status_code=202)
def cancel_joint_update(joint_id: UUID, session: SessionDep, user: CurrentUser) -> JointUpdateOut:
    """Ask for a joint update's end; one that has ended already stays as it is."""
    row = operations.joint_update_for(session, user, joint_id)
    operations.cancel_update(session, user, row)
    return operations.describe_joint(session, row)


@router.get("/joint-updates/{joint_id}/events", response_class=Response, responses=STREAM)
def watch_joint_update(
    joint_id: UUID, session: SessionDep, user: CurrentUser, events: Annotated[Events, Depends()]
) -> Response:
    """The job's state now and whenever it changes, as server-sent events of the type `job`; ends when the job has."""
    row = operations.joint_update_for(session, user, joint_id)
    return events.of(operations.job_of(session, row))


@router.get("/joint-updates/{joint_id}/result", response_model=None, responses={200: {"model": JointResultOut}})
def get_joint_result(joint_id: UUID, session: SessionDep, user: CurrentUser) -> dict[str, Any]:
    """The material's constants from all campaigns, each campaign's part, and whether they agree."""
    return operations.joint_document(session, operations.joint_update_for(session, user, joint_id))
