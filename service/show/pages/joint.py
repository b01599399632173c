"""Pages of joint updates: one material from several campaigns, asked for, on its way and as a result; and of the next tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any
from uuid import UUID

from fastapi import Query
from fastapi.responses import HTMLResponse

from service.jobs.resource import ENDED
from service.show.pages.comparing import leaves
from service.show.pages.forms import fields_of
from service.show.pages.look import Visit, VisitDep
from service.show.results import routes as shown
from service.store.campaigns import routes as campaigns
from service.store.campaigns.operations import campaigns_of
from service.store.coupons import routes as coupons
from service.store.modes.operations import mode_set_for
from service.store.structures import routes as structures
from service.store.updating import routes as updating
from service.store.updating.operations import joint_document, joint_update_for
from service.store.updating.schemas import JointUpdateOut, RecipeIn
from service.web.routing import page_router

router = page_router()
MOST = 100  # rows of a list on a page


@router.get("/projects/{project_id}/joint")
def get_new_joint(
    project_id: UUID, visit: VisitDep, campaign: Annotated[list[UUID] | None, Query(max_length=MOST)] = None
) -> HTMLResponse:
    """The form of a joint update: campaigns to choose from, then those that were chosen with their mode sets."""
    context = visit.in_project(project_id)
    found = structures.nouns.page(visit.session, visit.user, project_id, limit=MOST, deleted=False).items
    tests = [(s, campaigns.nouns.page(visit.session, visit.user, s.id, limit=MOST, deleted=False).items) for s in found]
    chosen = [(s, c) for s, each in tests for c in each if c.id in set(campaign or ())]
    sets: dict[UUID, list[tuple[UUID, str]]] = {c.id: [] for _, c in chosen}
    for row in mode_set_for.all(visit.session, campaign_id=sets):
        sets[row.campaign_id].append((row.id, f"{row.name} ({row.origin})"))
    batches = [
        b for s in {s.id: s for s, _ in chosen} for b in coupons.batches.page(visit.session, visit.user, s).items
    ]
    parameters = next(f for f in fields_of(RecipeIn, {}) if f.name == "parameters")
    return visit.show(
        "new_joint.html",
        **context,
        tests=tests,
        chosen=chosen if len(chosen) > 1 else [],
        sets=sets,
        batches=batches,
        parameters=replace(parameters, name="recipe/parameters"),
    )


@router.get("/structures/{structure_id}/plan")
def get_plan(structure_id: UUID, visit: VisitDep) -> HTMLResponse:
    """Where to hit next: the tests to compare, and what was measured so far; the answer is written below the form."""
    tests = campaigns.nouns.page(visit.session, visit.user, structure_id, limit=MOST, deleted=False).items
    names = {test.id: test.name for test in tests}
    sets = [(row, names[row.campaign_id]) for row in mode_set_for.all(visit.session, campaign_id=names)]
    return visit.show("plan.html", **visit.in_structure(structure_id), sets=sets)


@router.get("/joint-updates/{joint_id}")
def get_joint(joint_id: UUID, visit: VisitDep, part: Annotated[bool, Query()] = False) -> HTMLResponse:
    """A joint update: its progress while it runs, then what all campaigns say together, and where they contradict.

    `part` is the piece with the progress alone, as of a single update.
    """
    job = updating.joint.one(visit.session, visit.user, joint_id)
    if part:
        return visit.show_progress(job, "joint-updates")
    rows = campaigns_of(visit.session, [each.campaign_id for each in job.campaigns])
    names = {str(key): row.name for key, row in rows.items()}
    common = {"job": job, **visit.in_project(job.project_id), "names": names, "kind": "joint-updates"}
    if job.status != "succeeded":
        return visit.show("joint_job.html", **common, ended=job.status in ENDED)
    return visit.show(
        "joint_result.html",
        **common,
        result=joint_document(visit.session, joint_update_for(visit.session, visit.user, joint_id)),
        figures=shown.list_joint_figures(joint_id, visit.session, visit.user).items,
        alone=_newest_alone(visit, names),
        asked=[(name, names.get(said, said)) for name, said in _stated(job.request) if said not in ("", "–")],
    )


def _stated(request: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What was asked for and is no default of a recipe, a line each; recipes are stored whole."""
    usual = RecipeIn.model_validate({}).model_dump(mode="json")

    def own(part: Mapping[str, Any]) -> dict[str, Any]:
        changed = {name: value for name, value in (part["recipe"] or {}).items() if value != usual.get(name)}
        return {name: changed if name == "recipe" else value for name, value in part.items()}

    yield from leaves(own({**request, "jobs": [own(job) for job in request["jobs"]]}))


def _newest_alone(visit: Visit, names: Mapping[str, str]) -> dict[str, UUID]:
    """The newest result of each campaign by itself, by the campaign's key; those without one are left out."""
    found = {}
    for key in names:
        jobs = updating.list_update_jobs(visit.session, visit.user, campaign=UUID(key), status=["succeeded"], limit=1)
        if jobs.items:
            found[key] = jobs.items[0].id
    return found


def joint_updates_of(visit: Visit, project_id: UUID, campaign_id: UUID | None = None) -> Sequence[JointUpdateOut]:
    """The newest joint updates of a project, or those of them that a campaign takes part in."""
    listed = updating.joint.page(visit.session, visit.user, project_id, limit=MOST).items
    return [job for job in listed if campaign_id is None or campaign_id in {each.campaign_id for each in job.campaigns}]
