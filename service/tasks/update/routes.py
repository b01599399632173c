"""Routes of update jobs, and of joint updates, which `POST /update-jobs` begins with `joint`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any
from uuid import UUID

from fastapi import Query, Request, Response
from fastapi.responses import JSONResponse
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import campaigns_of
from service.nouns.updates import operations
from service.nouns.updates.document import LARGE_PARTS, slim
from service.nouns.updates.outdated import ResultNowOut, outdated
from service.nouns.updates.result_schemas import JointResultOut
from service.nouns.updates.schemas import (
    JointUpdateOut,
    RecipeIn,
    UpdateBatchIn,
    UpdateBatchOut,
    UpdateJobOut,
)
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Invalid
from service.platform.queue.resource import JobState
from service.platform.queue.routes import JobRoutes
from service.platform.web import (
    IF_MATCH,
    Confirm,
    Cursor,
    Limit,
    Page,
    etag_of,
    paged,
    require_match,
    require_usual,
)
from service.platform.web.bodies import Labels
from service.tasks.update import task
from service.tasks.update.batches import start_batch, start_joint

if TYPE_CHECKING:
    from service.nouns.updates.tables import UpdateJob

router = api_router(tags=["update jobs"])


def _with_campaigns(session: Session, rows: Sequence[UpdateJob]) -> list[dict[str, Any]]:
    campaigns = campaigns_of(session, {row.campaign_id for row in rows})
    return [{"campaign_name": campaigns[row.campaign_id].name} for row in rows]


single = JobRoutes(router, task.UPDATES, UpdateJobOut, "job_id", _with_campaigns)
joint = JobRoutes(
    router, task.JOINT_UPDATES, JointUpdateOut, "joint_id", lambda _, rows: [{} for _ in rows]
)

Priority = Annotated[
    int, Query(ge=-100, le=100, description="of the project's waiting jobs the highest runs first")
]

Include = Annotated[
    str | None,
    Query(
        max_length=100,
        description=f"parts to add, with commas between them: {', '.join(LARGE_PARTS)}",
    ),
]


@router.post("/campaigns/{campaign_id}/update-jobs", status_code=202)
def start_update(
    campaign_id: UUID,
    recipe: RecipeIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    priority: Priority = 0,
    confirm: Confirm = False,
) -> UpdateJobOut:
    """Queue an update of the campaign's structure. `{}` is a recipe."""
    require_usual(recipe, confirm)
    task.require_used(session, user, campaign_id, recipe)
    row = task.start_update(session, user, campaign_id, recipe, priority)
    return single.made(session, row, response)


@router.post("/update-jobs", status_code=202)
def start_updates(
    batch: UpdateBatchIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    priority: Priority = 0,
    confirm: Confirm = False,
) -> UpdateBatchOut:
    """Queue updates of many campaigns: all of them, or with any fault none.

    With `joint` they are one update: one material from all campaigns, at `/joint-updates/{id}`,
    which `Location` names.
    """
    require_usual(batch, confirm)
    if batch.joint:
        row = start_joint(session, user, batch, priority)
        return UpdateBatchOut(items=[], joint=joint.made(session, row, response))
    rows = start_batch(session, user, batch, priority)
    return UpdateBatchOut(items=single.all_shown(session, rows))


@router.get("/update-jobs")
def list_update_jobs(
    session: SessionDep,
    user: CurrentUser,
    project: Annotated[UUID | None, Query(description="of this project only")] = None,
    structure: Annotated[UUID | None, Query(description="of this structure only")] = None,
    campaign: Annotated[UUID | None, Query(description="of this campaign only")] = None,
    status: Annotated[
        list[JobState] | None, Query(description="in these states only; may be repeated")
    ] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[UpdateJobOut]:
    """Update jobs that you may see, newest first; those of deleted structures are left out."""
    query = operations.updates_seen(
        session, user, project=project, structure=structure, campaign=campaign, states=status
    )
    return paged(
        session, query, cursor, limit, partial(single.all_shown, session), newest_first=True
    )


single.getting("get_update_job", "How far an update is, or what became of it.")
single.cancelling(
    "cancel_update_job", "Ask for an update's end; one that has ended already stays as it is."
)
single.retrying("retry_update_job", "Queue an update again that failed or was cancelled.")
single.watching(
    "watch_update_job",
    """The state of an update now and whenever it changes, as server-sent events of the type `job`; ends when the job has.

    Each event has an id; with that of the last one in `Last-Event-ID` a client that comes back gets what is new.
    """,
)


@router.get(
    "/update-jobs/{job_id}/result", response_model=None, responses={200: {"model": ResultNowOut}}
)
def get_result(
    job_id: UUID, session: SessionDep, user: CurrentUser, include: Include = None
) -> Response:
    """The result of an update: verdict and warnings first, then parameters, modes, correlation, and where all of it came
    from.

    What only a figure needs is left out unless `include` names it: the stabilisation diagram, the
    iterates.
    """
    named = set(filter(None, (include or "").split(",")))
    if unknown := named - set(LARGE_PARTS):
        raise Invalid(
            "include", f"names {', '.join(sorted(unknown))}; there are {', '.join(LARGE_PARTS)}"
        )
    job = operations.update_job_for(session, user, job_id)
    document = operations.result_document(session, job)
    changed = outdated(session, job, document)
    shown = slim(document, leave_out=set(LARGE_PARTS) - named)
    now = None if changed is None else changed.model_dump(mode="json")
    return JSONResponse({**shown, "outdated": now})


@router.get("/update-jobs/{job_id}/labels")
def get_result_labels(
    job_id: UUID, session: SessionDep, user: CurrentUser, response: Response
) -> Labels:
    """Tags and metadata of a result."""
    labels = operations.result_labels(session, operations.update_job_for(session, user, job_id))
    response.headers["ETag"] = etag_of(labels)
    return labels


@router.put("/update-jobs/{job_id}/labels", openapi_extra=IF_MATCH)
def label_result(
    job_id: UUID,
    labels: Labels,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    response: Response,
) -> Labels:
    """Give a result tags and metadata in place of its own; the result itself stays as it is."""
    row = operations.update_job_for(session, user, job_id, "editor", lock=True)
    require_match(request, etag_of(operations.result_labels(session, row)))
    operations.label_result(session, user, row, labels)
    response.headers["ETag"] = etag_of(labels)
    return labels


joint.listing("list_joint_updates", "Joint updates of a project, newest first.")
joint.getting("get_joint_update", "How far a joint update is, or what became of it.")
joint.cancelling(
    "cancel_joint_update",
    "Ask for a joint update's end; one that has ended already stays as it is.",
)
joint.retrying("retry_joint_update", "Queue a joint update again that failed or was cancelled.")
joint.watching(
    "watch_joint_update",
    "The state of a joint update now and whenever it changes, as server-sent events of the type `job`; ends"
    " when the job has.",
)


@router.get(
    "/joint-updates/{joint_id}/result",
    response_model=None,
    responses={200: {"model": JointResultOut}},
)
def get_joint_result(joint_id: UUID, session: SessionDep, user: CurrentUser) -> Response:
    """The material's constants from all campaigns, each campaign's part, and whether they agree."""
    row = operations.joint_update_for(session, user, joint_id)
    return JSONResponse(operations.result_document(session, row))
