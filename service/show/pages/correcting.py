"""Pages that correct, delete and restore projects, structures and campaigns; each says first what it will affect."""

from __future__ import annotations

from typing import Any, Literal
from uuid import UUID

from fastapi.responses import HTMLResponse

from service.access import routes as access
from service.monitoring.notifications import routes as webhooks
from service.show.figures.marks import counted
from service.show.pages.look import Visit, VisitDep
from service.store.campaigns import routes as campaigns
from service.store.frfs import routes as frfs
from service.store.frfs.routes import FrfFilter
from service.store.modes import routes as modes
from service.store.structures import routes as structures
from service.store.updating import routes as updating
from service.web.routing import page_router

router = page_router()
MOST = 500  # that a page counts or lists

Noun = Literal["projects", "structures", "campaigns"]


@router.get("/edit/{noun}/{item_id}")
def get_edit(noun: Noun, item_id: UUID, visit: VisitDep) -> HTMLResponse:
    """The form that corrects a project, a structure or a campaign."""
    context = CONTEXTS[noun](visit, item_id)
    return visit.show("edit.html", noun=noun, name=context["item"].name, **context)


def _project(visit: Visit, key: UUID) -> dict[str, Any]:
    item = visit.in_project(key)["project"]
    count = len(structures.nouns.page(visit.session, visit.user, key, limit=MOST, deleted=False).items)
    return {
        "item": item,
        "above": [("ui/projects", "Projects"), (f"ui/projects/{key}", item.name)],
        "affects": "Name and description stand on pages and in reports that are made from now on.",
        "hides": f"It hides {_count(count, 'structure')} with all campaigns, results and monitors. "
        "An owner can restore it from the list of projects until it is purged.",
        "back": "ui/projects",
        "below": "structures",
        "gone": structures.nouns.page(visit.session, visit.user, key, limit=MOST, deleted=True).items,
        "members": access.list_members(key, visit.session, visit.user, limit=MOST).items,
        "webhooks": webhooks.list_webhooks(visit.session, visit.user, project=key, limit=MOST).items,
    }


def _structure(visit: Visit, key: UUID) -> dict[str, Any]:
    within = visit.in_structure(key)
    item, project = within["structure"], within["project"]
    tests = len(campaigns.nouns.page(visit.session, visit.user, key, limit=MOST, deleted=False).items)
    jobs = len(updating.list_update_jobs(visit.session, visit.user, structure=key, limit=MOST).items)
    return {
        "item": item,
        "above": [(f"ui/projects/{project.id}", project.name), (f"ui/structures/{key}", item.name)],
        "affects": f"Another size, density or material is version {item.version + 1}: new updates of "
        f"{_count(tests, 'campaign')} use it, {_count(jobs, 'earlier update')} keep the version that they were made with.",
        "hides": f"It hides {_count(tests, 'campaign')}, {_count(jobs, 'update')} and the monitors. "
        "It can be restored where the project is edited.",
        "back": f"ui/projects/{project.id}",
        "below": "campaigns",
        "gone": campaigns.nouns.page(visit.session, visit.user, key, limit=MOST, deleted=True).items,
    }


def _campaign(visit: Visit, key: UUID) -> dict[str, Any]:
    within = visit.in_campaign(key, deleted=False)
    item, structure = within["campaign"], within["structure"]
    jobs = len(updating.list_update_jobs(visit.session, visit.user, campaign=key, limit=MOST).items)
    measured = len(frfs.list_frfs(key, FrfFilter(), visit.session, visit.user, limit=MOST).items)
    sets = len(modes.nouns.page(visit.session, visit.user, key, limit=MOST).items)
    return {
        "item": item,
        "above": [(f"ui/structures/{structure.id}", structure.name), (f"ui/campaigns/{key}", item.name)],
        "affects": f"Updates and identifications that are started from now on use what is stated here; "
        f"{_count(jobs, 'earlier update')} and {_count(sets, 'mode set')} stay as they were computed: repeat them.",
        "hides": f"It hides {_count(measured, 'FRF')} and {_count(sets, 'mode set')}; results stay. "
        "It can be restored where the structure is edited.",
        "back": f"ui/structures/{structure.id}",
        "below": "",
        "gone": [],
        "boundaries": ["free", "as_modelled"] if structure.model else ["cantilever", "free", "simply_supported"],
    }


CONTEXTS = {"projects": _project, "structures": _structure, "campaigns": _campaign}


def _count(number: int, noun: str) -> str:
    """A count that says where it was not finished."""
    return f"{MOST} and more {noun}s" if number >= MOST else counted(number, noun)
