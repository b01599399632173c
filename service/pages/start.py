"""The first pages: sign-in, start, projects, a new test, keys; and those that correct, delete and
restore.

A page that deletes a project, a structure or a campaign says first what it will affect.
"""

from typing import Annotated, Any, Literal
from uuid import UUID

from fastapi import Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse

from service.figures.marks import counted
from service.monitoring import routes as monitoring
from service.nouns.campaigns import routes as campaigns
from service.nouns.frfs import routes as frfs
from service.nouns.frfs.routes import FrfFilter
from service.nouns.instruments.routes import nouns as instruments
from service.nouns.modes import routes as modes
from service.nouns.notifications import routes as webhooks
from service.nouns.storage import routes as storage
from service.nouns.structures import routes as structures
from service.nouns.structures.operations import structures_to_choose
from service.pages.look import Visit, VisitDep, page
from service.pages.updates import joint_updates_of, name_jobs
from service.platform.access import routes as access
from service.platform.web.routing import UI, page_router
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


@router.get("/")
def get_start(visit: VisitDep) -> HTMLResponse:
    """Projects, the newest updates, and what calls for attention."""
    projects = access.list_projects(visit.session, visit.user, limit=MOST).items
    jobs = updating.list_update_jobs(visit.session, visit.user, limit=8).items
    alarms = monitoring.list_alarms(visit.session, visit.user, state="alarm", limit=20).items
    active = [project for project in reversed(projects) if project.archived_at is None]
    return visit.show("start.html", projects=active, jobs=name_jobs(visit, jobs), alarms=alarms)


@router.get("/kit")
def get_kit(visit: VisitDep) -> HTMLResponse:
    """Each part that pages are made of, in each state."""
    return visit.show("kit_page.html")


@router.get("/projects")
def get_projects(visit: VisitDep, cursor: Cursor = None) -> HTMLResponse:
    """All projects."""
    listed = access.list_projects(visit.session, visit.user, cursor=cursor, limit=MOST)
    gone = access.list_projects(visit.session, visit.user, limit=MOST, deleted=True).items
    return visit.show(
        "projects.html", projects=listed.items, following=listed.next_cursor, gone=gone
    )


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


_PLY = {"E1_Pa": 23e9, "E2_Pa": 8.5e9, "G12_Pa": 3e9, "G13_Pa": 3e9, "G23_Pa": 2.4e9, "nu_12": 0.27}
EXAMPLES: dict[str, tuple[str, dict[str, Any]]] = {
    "plate": (
        "a strip",
        {
            "name": "FRP beam",
            "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01012},
            "density_kg_m3": 2012,
            "material": {
                "Ex_Pa": 33.05e9,
                "Ey_Pa": 31.8e9,
                "Gxy_Pa": 5.73e9,
                "Gxz_Pa": 4.5e9,
                "Gyz_Pa": 4.5e9,
                "nu_xy": 0.15,
            },
        },
    ),
    "i": (
        "an I-profile",
        {
            "name": "I-beam",
            "density_kg_m3": 1900,
            "shape": {
                "length_m": 1.5,
                "width_m": 0.06,
                "height_m": 0.12,
                "walls": {"flange": {"thickness_m": 0.006}, "web": {"thickness_m": 0.006}},
                "material": _PLY,
            },
        },
    ),
}
"""What a new test may be filled in with, by the kind of its structure: words of the link, and the
structure.
"""


@router.get("/new")
def get_new_test(
    visit: VisitDep,
    example: Annotated[str, Query(max_length=20)] = "",
    structure: UUID | None = None,
) -> HTMLResponse:
    """A new test in one form: a structure, new or there, the test, its file; filled in where an
    example is asked for.
    """
    projects = [
        p
        for p in access.list_projects(visit.session, visit.user, limit=MOST).items
        if p.archived_at is None
    ]
    choices = structures_to_choose(visit.session, visit.user)
    start = {}
    if example in EXAMPLES:
        test = {"name": "first test", "boundary": "cantilever"}
        start = {
            "project": {"name": "laboratory"},
            "structure": EXAMPLES[example][1],
            "campaign": test,
        }
    return visit.show(
        "new_test.html",
        projects=projects,
        structures=[
            (p.name, [(key, name) for owner, key, name in choices if owner == p.id])
            for p in reversed(projects)
        ],
        chosen=structure,
        examples=[(name, words) for name, (words, _) in EXAMPLES.items()],
        kind=example if example in EXAMPLES else "",
        start=start,
    )


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
            "An owner can restore it from the list of projects until it is purged."
        ),
        "back": "ui/projects",
        "below": "structures",
        "gone": (
            structures.nouns.page(
                visit.session, visit.user, key, limit=MOST_COUNTED, deleted=True
            ).items
        ),
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
            "It can be restored where the project is edited."
        ),
        "back": f"ui/projects/{project.id}",
        "below": "campaigns",
        "gone": (
            campaigns.nouns.page(
                visit.session, visit.user, key, limit=MOST_COUNTED, deleted=True
            ).items
        ),
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
            "It can be restored where the structure is edited."
        ),
        "back": f"ui/structures/{structure.id}",
        "below": "",
        "gone": [],
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
