"""The first pages: sign-in, start, projects, a new test, keys; and those that correct, delete and
restore.

A page that deletes a project, a structure or a campaign says first what it will affect.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Literal
from uuid import UUID

from fastapi import Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse

from service.figures.marks import counted
from service.monitoring import routes as monitoring
from service.nouns.campaigns import routes as campaigns
from service.nouns.campaigns.operations import campaign_for, campaigns_of, newest_campaigns
from service.nouns.frfs import routes as frfs
from service.nouns.frfs.operations import count_frfs
from service.nouns.frfs.routes import FrfFilter
from service.nouns.instruments.routes import instrument_for
from service.nouns.instruments.routes import nouns as instruments
from service.nouns.laboratory.routes import laboratory_of
from service.nouns.modes import routes as modes
from service.nouns.modes.operations import mode_set_for, modes_of
from service.nouns.monitors.runs import monitor_for
from service.nouns.notifications import routes as webhooks
from service.nouns.storage import routes as storage
from service.nouns.structures import routes as structures
from service.nouns.structures.operations import (
    structure_for,
    structures_in,
    structures_of,
    structures_to_choose,
)
from service.pages.example import paper
from service.pages.look import Visit, VisitDep, page
from service.pages.updates import NamedJob, joint_updates_of, name_jobs
from service.platform.access import Lookup, projects_of, role_in
from service.platform.access import routes as access
from service.platform.queue.resource import jobs_under_way
from service.platform.web.routing import UI, page_router
from service.tasks.kinds import TASKS
from service.tasks.update import routes as updating

open_router = page_router()
router = page_router(UI)
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


RECENT = 8  # tests on the start page
EXAMPLE = "example"  # tag of the example project


@router.get("/")
def get_start(visit: VisitDep) -> HTMLResponse:
    """Recent tests, what runs, projects, and what calls for attention."""
    projects = access.list_projects(visit.session, visit.user, limit=MOST).items
    alarms = monitoring.list_alarms(visit.session, visit.user, state="alarm", limit=20).items
    active = [project for project in reversed(projects) if project.archived_at is None]
    return visit.show(
        "start.html",
        projects=active,
        example=next((p for p in active if EXAMPLE in p.tags), None),
        to_make=_example(),
        tests=_recent_tests(visit),
        jobs=_under_way(visit),
        alarms=alarms,
    )


def _recent_tests(visit: Visit) -> list[dict[str, Any]]:
    """The newest campaigns, each with its structure, what it has, and its newest update."""
    session, user = visit.session, visit.user
    rows = newest_campaigns(session, structures_in(projects_of(user)), RECENT)
    keys = [row.id for row in rows]
    of = structures_of(session, [row.structure_id for row in rows])
    frf_counts = count_frfs(session, keys)
    newest_set = {each.campaign_id: each.id for each in mode_set_for.all(session, campaign_id=keys)}
    in_sets = modes_of(session, list(newest_set.values()))
    jobs: dict[UUID, NamedJob] = {}
    listed = updating.list_update_jobs(session, user, limit=MOST).items
    for job in name_jobs(visit, [one for one in listed if one.campaign_id in keys]):
        jobs.setdefault(job.job.campaign_id, job)
    return [
        {
            "campaign": row,
            "structure": of[row.structure_id],
            "frfs": frf_counts.get(row.id),
            "modes": len(in_sets.get(newest_set[row.id], ())) if row.id in newest_set else None,
            "job": jobs.get(row.id),
        }
        for row in rows
    ]


def _under_way(visit: Visit) -> list[dict[str, Any]]:
    """Jobs that run or wait, each with its kind, what it is of, and that page."""
    jobs = {job.id: job for job in jobs_under_way(visit.session, visit.user, MOST)}
    shown: dict[UUID, dict[str, Any]] = {}
    for task in TASKS:
        for key, row in task.noun.find.rows(visit.session, jobs).items():
            campaign, structure = (
                getattr(row, name, None) for name in ("campaign_id", "structure_id")
            )
            shown[key] = {
                "job": jobs[key],
                "kind": task.kind.capitalize(),
                "name": getattr(row, "filename", ""),
                "campaign": campaign,
                "to": f"campaigns/{campaign}" if campaign else f"structures/{structure}",
            }
    names = campaigns_of(visit.session, [one["campaign"] for one in shown.values()])
    for one in shown.values():
        one["name"] = one["name"] or (
            names[one["campaign"]].name if one["campaign"] in names else "a structure"
        )
    return [shown[key] for key in jobs if key in shown]


def _example() -> dict[str, Any]:
    """What the example project is made of, as REST takes it."""
    return {
        "project": {
            "name": "Example: a beam of a paper",
            "description": "FRFs, modes and coupons of Mondal and Chakraborty (2015)",
            "tags": [EXAMPLE],
        },
        "structure": paper.STRUCTURE,
        "campaign": paper.CAMPAIGN,
        "modes": {"name": "Table 3", "modes": paper.MODES},
        "batch": {
            "name": "Table 4",
            "constants": list(paper.COUPONS_PA),
            "published": {name: {"mean": mean} for name, mean in paper.COUPONS_PA.items()},
        },
    }


RESTORABLE: dict[str, Lookup[Any]] = {
    "structures": structure_for,
    "campaigns": campaign_for,
    "monitors": monitor_for,
    "instruments": instrument_for,
}
"""Nouns whose rows are kept when they are deleted, by their addresses; projects beside them."""


@dataclass(frozen=True)
class Deleted:
    """A row of the trash."""

    noun: str  # its address
    kind: str  # what a person calls one
    key: UUID  # its own
    name: str  # its own
    within: str  # names of what it belongs to, the project first
    at: datetime | None  # when it was deleted


@router.get("/trash")
def get_trash(visit: VisitDep) -> HTMLResponse:
    """All that was deleted and can be restored, the newest first."""
    session, user = visit.session, visit.user
    gone = [
        Deleted("projects", "project", one.id, one.name, "", one.deleted_at)
        for one in access.list_projects(session, user, limit=MOST, deleted=True).items
        if role_in(session, user, one.id) == "owner"
    ]
    for noun, find in RESTORABLE.items():
        for row, owners in find.deleted_rows(session, user, MOST):
            within = " › ".join(owner.name for owner in reversed(owners))
            name = row.name if hasattr(row, "name") else f"{row.kind} {row.serial}"
            gone.append(Deleted(noun, find.kind, row.id, name, within, row.deleted_at))
    return visit.show("trash.html", gone=sorted(gone, key=lambda one: str(one.at), reverse=True))


@router.get("/kit")
def get_kit(visit: VisitDep) -> HTMLResponse:
    """Each part that pages are made of, in each state."""
    return visit.show("kit_page.html")


@router.get("/projects")
def get_projects(visit: VisitDep, cursor: Cursor = None) -> HTMLResponse:
    """All projects."""
    listed = access.list_projects(visit.session, visit.user, cursor=cursor, limit=MOST)
    return visit.show("projects.html", projects=listed.items, following=listed.next_cursor)


@router.get("/projects/{project_id}")
def get_project(project_id: UUID, visit: VisitDep, cursor: Cursor = None) -> HTMLResponse:
    """A project: its structures, members and newest updates."""
    listed = structures.nouns.page(
        visit.session, visit.user, project_id, cursor=cursor, limit=MOST, deleted=False
    )
    stored = storage.get_storage(
        project_id, visit.session, visit.user, visit.request.app.state.settings
    )
    people = access.list_members(project_id, visit.session, visit.user, limit=MOST).items
    jobs = updating.list_update_jobs(visit.session, visit.user, project=project_id, limit=10).items
    return visit.show(
        "project.html",
        **visit.in_project(project_id),
        structures=listed.items,
        following=listed.next_cursor,
        instruments=instruments.page(
            visit.session, visit.user, project_id, limit=MOST, deleted=False
        ).items,
        members=people,
        stored=stored,
        jobs=name_jobs(visit, jobs),
        joint=joint_updates_of(visit, project_id)[:10],
    )


@router.get("/new")
def get_new_test(visit: VisitDep, structure: UUID | None = None) -> HTMLResponse:
    """A new test: files first, then what they do not say of the structure and the test."""
    listed = access.list_projects(visit.session, visit.user, limit=MOST).items
    projects = [p for p in listed if p.archived_at is None and EXAMPLE not in p.tags]
    choices = structures_to_choose(visit.session, visit.user)
    return visit.show(
        "new_test.html",
        projects=projects,
        structures=[
            (p.name, [(key, name) for owner, key, name, _ in choices if owner == p.id])
            for p in reversed(projects)
        ],
        materials=[(key, name) for _, key, name, of_material in choices if of_material],
        chosen=structure,
    )


@router.get("/laboratory")
def get_laboratory(visit: VisitDep) -> HTMLResponse:
    """Who reports are of, and for administrators a form that states it."""
    stated = laboratory_of(visit.session, visit.request.app.state.settings)
    return visit.show("laboratory.html", stated=stated, may_edit=visit.user.administrator)


@router.get("/keys")
def get_keys(visit: VisitDep) -> HTMLResponse:
    """One's keys, and a form for another one."""
    keys = access.list_api_keys(visit.session, visit.user, limit=MOST).items
    return visit.show("keys.html", keys=keys)


MOST_COUNTED = 500  # that a page counts or lists

Noun = Literal["projects", "structures", "campaigns"]


@router.get("/edit/{noun}/{item_id}")
def get_edit(noun: Noun, item_id: UUID, visit: VisitDep) -> HTMLResponse:
    """The form that corrects a project, a structure or a campaign."""
    context = CONTEXTS[noun](visit, item_id)
    return visit.show("edit.html", noun=noun, name=context["item"].name, **context)


def _project(visit: Visit, key: UUID) -> dict[str, Any]:
    item = visit.in_project(key)["project"]
    count = len(
        structures.nouns.page(
            visit.session, visit.user, key, limit=MOST_COUNTED, deleted=False
        ).items
    )
    return {
        "item": item,
        "above": [("ui/projects", "Projects"), (f"ui/projects/{key}", item.name)],
        "affects": "Name and description stand on pages and in reports that are made from now on.",
        "hides": (
            f"It hides {_count(count, 'structure')} with all campaigns, results and monitors. "
            "An owner can restore it from the trash until it is purged."
        ),
        "back": "ui/projects",
        "members": access.list_members(key, visit.session, visit.user, limit=MOST_COUNTED).items,
        "webhooks": (
            webhooks.list_webhooks(visit.session, visit.user, project=key, limit=MOST_COUNTED).items
        ),
    }


def _structure(visit: Visit, key: UUID) -> dict[str, Any]:
    within = visit.in_structure(key)
    item, project = within["structure"], within["project"]
    tests = len(
        campaigns.nouns.page(
            visit.session, visit.user, key, limit=MOST_COUNTED, deleted=False
        ).items
    )
    jobs = len(
        updating.list_update_jobs(
            visit.session, visit.user, structure=key, limit=MOST_COUNTED
        ).items
    )
    return {
        "item": item,
        "above": [(f"ui/projects/{project.id}", project.name), (f"ui/structures/{key}", item.name)],
        "affects": (
            f"Another size, density or material is version {item.version + 1}: new updates of"
            f" {_count(tests, 'campaign')} use it, {_count(jobs, 'earlier update')} keep the"
            " version that they were made with."
        ),
        "hides": (
            f"It hides {_count(tests, 'campaign')}, {_count(jobs, 'update')} and the monitors. "
            "It can be restored from the trash."
        ),
        "back": f"ui/projects/{project.id}",
    }


def _campaign(visit: Visit, key: UUID) -> dict[str, Any]:
    within = visit.in_campaign(key, deleted=False)
    item, structure = within["campaign"], within["structure"]
    jobs = len(
        updating.list_update_jobs(visit.session, visit.user, campaign=key, limit=MOST_COUNTED).items
    )
    measured = len(
        frfs.list_frfs(key, FrfFilter(), visit.session, visit.user, limit=MOST_COUNTED).items
    )
    sets = len(modes.nouns.page(visit.session, visit.user, key, limit=MOST_COUNTED).items)
    return {
        "item": item,
        "above": [
            (f"ui/structures/{structure.id}", structure.name),
            (f"ui/campaigns/{key}", item.name),
        ],
        "affects": (
            "Updates and identifications that are started from now on use what is stated here;"
            f" {_count(jobs, 'earlier update')} and {_count(sets, 'mode set')} stay as they were"
            " computed: repeat them."
        ),
        "hides": (
            f"It hides {_count(measured, 'FRF')} and {_count(sets, 'mode set')}; results stay. "
            "It can be restored from the trash."
        ),
        "back": f"ui/structures/{structure.id}",
        "boundaries": (
            ["free", "as_modelled"]
            if structure.model
            else ["cantilever", "free", "simply_supported"]
        ),
    }


CONTEXTS = {"projects": _project, "structures": _structure, "campaigns": _campaign}


def _count(number: int, noun: str) -> str:
    """A count that says where it was not finished."""
    return f"{MOST_COUNTED} and more {noun}s" if number >= MOST_COUNTED else counted(number, noun)
