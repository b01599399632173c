"""What a page shows of jobs while they run: one stream for all of them, whatever their kind."""

from typing import Annotated
from uuid import UUID

from fastapi import Depends, Query, Response
from sqlalchemy import select

from service.nouns.monitors.live import look_at_monitors, monitors_among
from service.platform.access import CurrentUser, SessionDep, projects_of
from service.platform.errors import NotFound
from service.platform.queue.events import Events, look_at_jobs
from service.platform.queue.tables import Job
from service.platform.web.routing import UI, page_router

router = page_router(UI)
MOST = 200  # that a page watches


@router.get("/events")
def get_events(
    job: Annotated[list[UUID], Query(min_length=1, max_length=MOST)],
    session: SessionDep,
    user: CurrentUser,
    events: Annotated[Events, Depends()],
) -> Response:
    """The states of jobs and monitors as server-sent events, of those among them that the visitor
    may see.
    """
    keys = set(job)
    seen = set(
        session.scalars(
            select(Job.id).where(Job.id.in_(keys), Job.project_id.in_(projects_of(user)))
        )
    )
    states = {
        **look_at_jobs(session, seen),
        **look_at_monitors(session, monitors_among(session, user, keys)),
    }
    if not states:
        raise NotFound("job", ", ".join(map(str, job)))
    return events.of_all(states)
