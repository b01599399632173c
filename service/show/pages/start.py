"""The first pages: sign-in, start, projects, a new test, keys."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse

from service.access import routes as access
from service.monitoring import routes as monitoring
from service.show.pages.joint import joint_updates_of
from service.show.pages.look import VisitDep, page
from service.show.pages.names import name_jobs
from service.store.instruments.routes import nouns as instruments
from service.store.storage import routes as storage
from service.store.structures import routes as structures
from service.store.updating import routes as updating
from service.web.routing import page_router

open_router = page_router()
router = page_router()
MOST = 200  # rows of a list on a page
Cursor = Annotated[str | None, Query(max_length=100)]


@open_router.get("/")
def to_start() -> RedirectResponse:
    """A browser that was given the service's bare address."""
    return RedirectResponse("ui/")


@open_router.get("/sign-in")
def get_sign_in(request: Request) -> HTMLResponse:
    """The form for a key."""
    return page(request, "sign_in.html")


@router.get("/")
def get_start(visit: VisitDep) -> HTMLResponse:
    """Projects, the newest updates, and what calls for attention."""
    projects = access.list_projects(visit.session, visit.user, limit=MOST).items
    jobs = updating.list_update_jobs(visit.session, visit.user, limit=8).items
    alarms = monitoring.list_alarms(visit.session, visit.user, state="alarm", limit=20).items
    active = [project for project in reversed(projects) if project.archived_at is None]
    return visit.show("start.html", projects=active, jobs=name_jobs(visit, jobs), alarms=alarms)


@router.get("/projects")
def get_projects(visit: VisitDep, cursor: Cursor = None) -> HTMLResponse:
    """All projects."""
    listed = access.list_projects(visit.session, visit.user, cursor=cursor, limit=MOST)
    gone = access.list_projects(visit.session, visit.user, limit=MOST, deleted=True).items
    return visit.show("projects.html", projects=listed.items, following=listed.next_cursor, gone=gone)


@router.get("/projects/{project_id}")
def get_project(project_id: UUID, visit: VisitDep, cursor: Cursor = None) -> HTMLResponse:
    """A project: its structures, members and newest updates."""
    listed = structures.nouns.page(visit.session, visit.user, project_id, cursor=cursor, limit=MOST, deleted=False)
    stored = storage.get_storage(project_id, visit.session, visit.user, visit.request.app.state.settings)
    people = access.list_members(project_id, visit.session, visit.user, limit=MOST).items
    jobs = updating.list_update_jobs(visit.session, visit.user, project=project_id, limit=10).items
    return visit.show(
        "project.html",
        **visit.in_project(project_id),
        structures=listed.items,
        following=listed.next_cursor,
        instruments=instruments.page(visit.session, visit.user, project_id, limit=MOST, deleted=False).items,
        members=people,
        stored=stored,
        jobs=name_jobs(visit, jobs),
        joint=joint_updates_of(visit, project_id)[:10],
    )


@router.get("/new")
def get_new_test(visit: VisitDep) -> HTMLResponse:
    """A new test in one form: project, specimen, campaign and file."""
    projects = access.list_projects(visit.session, visit.user, limit=MOST).items
    return visit.show("new_test.html", projects=[p for p in projects if p.archived_at is None])


@router.get("/keys")
def get_keys(visit: VisitDep) -> HTMLResponse:
    """One's keys, and a form for another one."""
    keys = access.list_api_keys(visit.session, visit.user, limit=MOST).items
    return visit.show("keys.html", keys=keys)
