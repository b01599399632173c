"""Routes of joint updates: one material from several campaigns. They are begun by `POST /update-jobs` with `joint`."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import UUID

from fastapi import Depends, Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep, project_for
from service.jobs.events import STREAM, Events
from service.jobs.tables import Job
from service.store.updating.joint_operations import cancel_joint, describe_joint, joint_document, joint_update_for
from service.store.updating.joint_schemas import JointUpdateOut
from service.store.updating.result_schemas import JointResultOut
from service.store.updating.tables import JointUpdate
from service.web import Cursor, Limit, Page, api_router, paged

router = api_router(tags=["update jobs"])


@router.get("/projects/{project_id}/joint-updates")
def list_joint_updates(
    project_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[JointUpdateOut]:
    """Joint updates of a project, newest first."""
    query = select(JointUpdate).where(JointUpdate.project_id == project_for(session, user, project_id).id)
    rows, following = paged(session, query, JointUpdate.id, cursor, limit, newest_first=True)
    return Page(items=[describe_joint(session, row) for row in rows], next_cursor=following)


@router.get("/joint-updates/{joint_id}")
def get_joint_update(joint_id: UUID, session: SessionDep, user: CurrentUser) -> JointUpdateOut:
    """How far a joint update is, or what became of it."""
    return describe_joint(session, joint_update_for(session, user, joint_id))


@router.post("/joint-updates/{joint_id}/cancel", status_code=202)
def cancel_joint_update(joint_id: UUID, session: SessionDep, user: CurrentUser) -> JointUpdateOut:
    """Ask for a joint update's end; one that has ended already stays as it is."""
    row = joint_update_for(session, user, joint_id)
    cancel_joint(session, user, row)
    return describe_joint(session, row)


@router.get("/joint-updates/{joint_id}/events", response_class=Response, responses=STREAM)
def watch_joint_update(
    joint_id: UUID, session: SessionDep, user: CurrentUser, events: Annotated[Events, Depends()]
) -> Response:
    """The job's state now and whenever it changes, as server-sent events of the type `job`; ends when the job has."""
    row = joint_update_for(session, user, joint_id)
    return events.of(session.get_one(Job, row.id, populate_existing=True))


@router.get("/joint-updates/{joint_id}/result", response_model=None, responses={200: {"model": JointResultOut}})
def get_joint_result(joint_id: UUID, session: SessionDep, user: CurrentUser) -> dict[str, Any]:
    """The material's constants from all campaigns, each campaign's part, and whether they agree."""
    return joint_document(session, joint_update_for(session, user, joint_id))
