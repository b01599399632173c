"""Pages of updates of one campaign and of several: the form of a recipe, a job on its way, its
result; and the next tests.

Lists everywhere name update jobs by what they belong to.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated, Any, get_args
from uuid import UUID

from fastapi import Query
from fastapi.responses import HTMLResponse

from service.figures.marks import counted
from service.nouns.campaigns import routes as campaigns
from service.nouns.campaigns.operations import campaigns_of
from service.nouns.campaigns.schemas import CampaignOut
from service.nouns.coupons import routes as coupons
from service.nouns.frfs import routes as frfs
from service.nouns.frfs.routes import FrfFilter
from service.nouns.modes import routes as modes
from service.nouns.modes.operations import mode_set_for
from service.nouns.structures import routes as structures
from service.nouns.structures.operations import structures_of
from service.nouns.updates.operations import (
    joint_update_for,
    result_document,
    result_parts,
    update_job_for,
)
from service.nouns.updates.outdated import outdated
from service.nouns.updates.schemas import JointUpdateOut, RecipeIn, UpdateJobOut
from service.pages.findings import OF_FRFS, agreement, opening
from service.pages.forms import OF_PARAMETER, fields_of
from service.pages.look import Visit, VisitDep
from service.pages.numbers import KEY, leaves, moment
from service.pages.quantities import units_of_parameter
from service.pages.viewer import viewer_of
from service.platform.access import routes as access
from service.platform.queue.resource import ENDED, JobState
from service.platform.web.parameters import Cursor
from service.platform.web.routing import UI, page_router
from service.platform.web.typed import in_words
from service.reports import routes as shown
from service.reports.decks import Program
from service.reports.figures import FIGURES
from service.tasks.update import routes as updating


@dataclass(frozen=True)
class NamedJob:
    """An update job in a list."""

    job: UpdateJobOut  # itself
    campaign: str  # name of its campaign
    structure: str  # name of its structure
    structure_id: UUID  # key of that
    # the parts of its document that were asked for; None where it has none
    result: dict[str, Any] | None

    @property
    def verdict(self) -> str | None:
        """The verdict's level; None without a result."""
        return None if self.result is None else str(self.result["verdict"]["level"])


def name_jobs(
    visit: Visit, jobs: Sequence[UpdateJobOut], parts: Sequence[str] = ("verdict",)
) -> list[NamedJob]:
    """Jobs that the visitor may see, each with its names and these parts of its result."""
    campaigns = campaigns_of(visit.session, [job.campaign_id for job in jobs])
    structures = structures_of(visit.session, [row.structure_id for row in campaigns.values()])
    results = result_parts(visit.session, [job.id for job in jobs], parts)
    return [
        NamedJob(
            job=job,
            campaign=campaigns[job.campaign_id].name,
            structure=structures[campaigns[job.campaign_id].structure_id].name,
            structure_id=campaigns[job.campaign_id].structure_id,
            result=results.get(job.id),
        )
        for job in jobs
    ]


def over_time(
    jobs: Sequence[NamedJob], performed: Mapping[UUID, datetime | None]
) -> list[dict[str, Any]]:
    """Estimates with their intervals for a figure over time: one row a result, `parameters` by
    name.

    Args:
        jobs: with the part `parameters` of their results.
        performed: when each campaign was; those that do not say stand at the time of their job.
    """
    rows = [
        {
            "name": job.campaign,
            "job": str(job.job.id),
            "at": (performed.get(job.job.campaign_id) or job.job.created_at).isoformat(),
            "parameters": {
                p["name"]: {"value": p["estimate"], "interval": p["interval_95"], "unit": p["unit"]}
                for p in job.result["parameters"]
            },
        }
        for job in jobs
        if job.result is not None
    ]
    return sorted(rows, key=lambda row: str(row["at"]))


router = page_router(UI)
MOST = 100  # rows of a list on a page
PRINCIPAL = (
    "mode_set",
    "prior_from_coupon_batch",
    "method",
    "parameters",
    "damping_models",
    "posterior",
)
"""What an engineer chooses first; the rest of a recipe stands below."""
PARTS = {
    "overview": "Overview",
    "correlation": "Correlation",
    "damping": "Damping",
    "budget": "Uncertainty",
    "convergence": "Convergence",
    "recipe": "Recipe",
    "report": "Files",
}
OF_ONE = ("correlation", "damping", "convergence")
"""Parts of a result's page, anchor and what its tab says; and those of one campaign alone."""


@router.get("/campaigns/{campaign_id}/update")
def get_new_update(
    campaign_id: UUID,
    visit: VisitDep,
    like: Annotated[UUID | None, Query(description="a job to repeat")] = None,
) -> HTMLResponse:
    """The form of a recipe, made from its schema; filled in as another job's where one is named,
    else with the newest mode set where somebody edited that.
    """
    context = visit.in_campaign(campaign_id)
    fields = fields_of(RecipeIn, _choices(visit, context))
    first = sorted(
        (f for f in fields if f.name in PRINCIPAL), key=lambda f: PRINCIPAL.index(f.name)
    )
    sets = mode_set_for.all(visit.session, campaign_id=[campaign_id])
    start: dict[str, Any] = {}
    if sets and "edited_from" in sets[-1].details:
        start["mode_set"] = str(sets[-1].id)
    if like is not None:
        recipe = updating.single.one(visit.session, visit.user, like).recipe
        start = recipe.model_dump(mode="json", exclude_defaults=True, exclude_none=True)
        start |= (
            {"parameters": [_as_typed(row) for row in start["parameters"]]}
            if start.get("parameters")
            else {}
        )
    return visit.show(
        "new_update.html",
        **context,
        first=first,
        more=[f for f in fields if f.name not in PRINCIPAL],
        start=start,
    )


def _choices(visit: Visit, within: Mapping[str, Any]) -> dict[str, list[tuple[str, str]]]:
    """What a recipe may name of a campaign and its structure: keys, and words of them."""
    session, user = visit.session, visit.user
    sets = modes.nouns.page(session, user, within["campaign"].id, limit=MOST).items
    return {
        "mode_set": [
            (str(s.id), f"{s.name} ({s.origin}, {counted(len(s.modes), 'mode')})")
            for s in reversed(sets)
        ],
        "prior_from_coupon_batch": _batches(visit, within["structure"].id),
    }


def _batches(visit: Visit, structure: UUID) -> list[tuple[str, str]]:
    """Coupon batches of a structure, the newest first: key, and a name with what each gives."""
    listed = coupons.batches.page(visit.session, visit.user, structure, limit=MOST).items
    return [(str(b.id), f"{b.name} ({', '.join(b.constants)})") for b in reversed(listed)]


def _recipe(visit: Visit, within: Mapping[str, Any], recipe: RecipeIn) -> list[tuple[str, str]]:
    """What a recipe states, with mode set and coupon batch by name."""
    rows = list(leaves(recipe.model_dump(mode="json", exclude_defaults=True, exclude_none=True)))
    if not any(KEY.fullmatch(value) for _, value in rows):
        return rows
    names = {key: name for each in _choices(visit, within).values() for key, name in each}
    return [(name, names.get(value, value)) for name, value in rows]


def _as_typed(row: Mapping[str, Any]) -> dict[str, Any]:
    """A parameter of a recipe as its form has it: values in the unit that the parameter is shown
    in.
    """
    units = units_of_parameter(row["name"])
    return {
        name: in_words(value, *units, 15) if name in OF_PARAMETER else value
        for name, value in row.items()
    }


@router.get("/update-jobs")
def get_jobs(
    visit: VisitDep,
    status: Annotated[list[JobState] | None, Query()] = None,
    project: Annotated[UUID | None, Query()] = None,
    cursor: Cursor = None,
) -> HTMLResponse:
    """Update jobs, newest first."""
    listed = updating.list_update_jobs(
        visit.session, visit.user, project=project, status=status, cursor=cursor, limit=MOST
    )
    projects = access.list_projects(visit.session, visit.user, limit=MOST).items
    return visit.show(
        "jobs.html",
        jobs=name_jobs(visit, listed.items),
        following=listed.next_cursor,
        status=status[0] if status else "",
        project_id=project,
        projects=projects,
    )


@router.get("/update-jobs/{job_id}")
def get_job(job_id: UUID, visit: VisitDep) -> HTMLResponse:
    """An update: its progress while it runs, its result when it has one."""
    job = updating.single.one(visit.session, visit.user, job_id)
    within = visit.in_campaign(job.campaign_id)
    campaign, structure, project = (within[name] for name in ("campaign", "structure", "project"))
    common = {
        "job": job,
        **within,
        "address": f"update-jobs/{job_id}",
        "title": campaign.name,
        "heading": f"Update of {campaign.name}",
        "trail": [
            (f"ui/projects/{project.id}", project.name),
            (f"ui/structures/{structure.id}", structure.name),
            (f"ui/campaigns/{campaign.id}", campaign.name),
        ],
        "names": {},
    }
    if job.status != "succeeded":
        return visit.show("job.html", **common, ended=job.status in ENDED)
    row = update_job_for(visit.session, visit.user, job_id)
    result = result_document(visit.session, row)
    return _result(
        visit,
        common,
        result,
        PARTS.items(),
        figures=shown.list_figures(job_id, visit.session, visit.user).items,
        outdated=outdated(visit.session, row, result),
        viewer=_viewer(visit, campaign, job_id, result),
        of_frfs=OF_FRFS,
        agreement=agreement(result),
        recipe=_recipe(visit, within, job.recipe),
        partners={
            pair["measured"]: pair["model"]
            for pair in (result.get("pairing") or {}).get("partners", [])
        },
    )


@router.get("/joint-updates/{joint_id}")
def get_joint(joint_id: UUID, visit: VisitDep) -> HTMLResponse:
    """An update of several campaigns: the same, with what all say together and where they
    contradict.
    """
    job = updating.joint.one(visit.session, visit.user, joint_id)
    rows = campaigns_of(visit.session, [each.campaign_id for each in job.campaigns])
    names = {str(each.campaign_id): "a campaign" for each in job.campaigns}
    names |= {str(key): row.name for key, row in rows.items()}
    within = visit.in_project(job.project_id)
    common = {
        "job": job,
        **within,
        "address": f"joint-updates/{joint_id}",
        "title": f"{len(names)} campaigns",
        "heading": f"One material from {len(names)} campaigns",
        "trail": [
            ("ui/projects", "Projects"),
            (f"ui/projects/{job.project_id}", within["project"].name),
        ],
        "names": names,
        "campaign": None,
    }
    if job.status != "succeeded":
        return visit.show("job.html", **common, ended=job.status in ENDED)
    return _result(
        visit,
        common,
        result_document(visit.session, joint_update_for(visit.session, visit.user, joint_id)),
        ((key, name) for key, name in PARTS.items() if key not in OF_ONE),
        outdated=None,
        viewer=None,
        agreement=[],
        figures=shown.list_joint_figures(joint_id, visit.session, visit.user).items,
        newest=_newest_single(visit, names),
        recipe=[
            (name, names.get(value, value))
            for name, value in _stated(job.request)
            if value not in ("", "–")
        ],
    )


def _origin(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Where a result was computed and when, without the keys that the result as JSON has."""
    return [
        (name, moment(str(value)) if name.endswith("_at") else str(value))
        for name, value in provenance.items()
        if isinstance(value, str | int | float) and not KEY.fullmatch(str(value))
    ]


def _result(
    visit: Visit,
    common: Mapping[str, Any],
    result: Mapping[str, Any],
    parts: Iterable[tuple[str, str]],
    **own: Any,
) -> HTMLResponse:
    """The page of a result: what opens it, then its parts."""
    steps, notes = opening(result)
    opened = {
        "steps": steps,
        "notes": notes,
        "parts_of_page": [(key, name, None) for key, name in parts],
        "tabs": _tabs(),
        "downloads": list(_downloads(common)),
        "origin": _origin(result["provenance"]),
    }
    return visit.show("result.html", **common, result=result, **opened, **own)


def _downloads(common: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """What can be fetched of a result: address, name, format."""
    address, structure = common["address"], common.get("structure")
    if structure is not None:
        yield f"{address}/report?format=pdf", "Report", "PDF"
        yield f"{address}/report?format=html", "Report", "HTML"
        yield f"{address}/frfs/data?format=uff", "Predicted FRFs", "UFF"
        yield f"{address}/mesh?format=vtu", "Shapes on the mesh", "VTU"
        if structure.model:
            yield f"{address}/deck", "Your deck, updated", "as it was sent"
        elif not structure.shape:
            for program in get_args(Program):
                yield f"{address}/cards?format={program}", "Deck", program.capitalize()
    yield f"{address}/result", "Result", "JSON"


def _tabs() -> dict[str, list[str]]:
    """Names of the figures in each part of the page; of the correlation's the wide ones apart."""
    tabs = defaultdict(list)
    for name, each in FIGURES.items():
        wide = each.tab == "correlation" and each.width > FIGURES["mac"].width
        tabs[f"{each.tab}, wide" if wide else each.tab].append(name)
    return tabs


def _viewer(
    visit: Visit, campaign: CampaignOut, job_id: UUID, result: dict[str, Any]
) -> dict[str, Any] | None:
    """The viewer with the FRFs that were used and are still there, and the result's model; None
    where there is none.
    """
    if campaign.deleted_at is not None:
        return None
    used = {frf["id"] for frf in result["provenance"].get("frfs", [])}
    rows = frfs.list_frfs(campaign.id, FrfFilter(), visit.session, visit.user, limit=1000).items
    kept = [row for row in rows if str(row.id) in used]
    modes = [(m["number"], m["measured_hz"], m["measured_damping"]) for m in result["modes"]]
    measured = {"id": "measured", "name": "measured modes", "modes": modes}
    return viewer_of(visit, campaign, kept, [measured], job_id) if kept else None


@router.get("/projects/{project_id}/joint")
def get_new_joint(
    project_id: UUID,
    visit: VisitDep,
    campaign: Annotated[list[UUID] | None, Query(max_length=MOST)] = None,
) -> HTMLResponse:
    """The form of a joint update: campaigns to choose from, then those that were chosen with their
    mode sets.
    """
    context = visit.in_project(project_id)
    listed = structures.nouns.page(
        visit.session, visit.user, project_id, limit=MOST, deleted=False
    ).items
    tests = [
        (s, campaigns.nouns.page(visit.session, visit.user, s.id, limit=MOST, deleted=False).items)
        for s in listed
    ]
    chosen = [(s, c) for s, each in tests for c in each if c.id in set(campaign or ())]
    sets: dict[UUID, list[tuple[UUID, str]]] = {c.id: [] for _, c in chosen}
    for row in mode_set_for.all(visit.session, campaign_id=sets):
        sets[row.campaign_id].append((row.id, f"{row.name} ({row.origin})"))
    batches = [b for s in {s.id: s for s, _ in chosen} for b in _batches(visit, s)]
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
    """Where to hit next: the tests to compare, and what was measured so far; the answer is written
    below the form.
    """
    tests = campaigns.nouns.page(
        visit.session, visit.user, structure_id, limit=MOST, deleted=False
    ).items
    names = {test.id: test.name for test in tests}
    sets = [
        (row, names[row.campaign_id]) for row in mode_set_for.all(visit.session, campaign_id=names)
    ]
    return visit.show("plan.html", **visit.in_structure(structure_id), sets=sets)


def _stated(request: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What was asked for and is no default of a recipe, a line each; recipes are stored whole."""
    usual = RecipeIn.model_validate({}).model_dump(mode="json")

    def own(part: Mapping[str, Any]) -> dict[str, Any]:
        changed = {
            name: value
            for name, value in (part["recipe"] or {}).items()
            if value != usual.get(name)
        }
        return {name: changed if name == "recipe" else value for name, value in part.items()}

    yield from leaves(own({**request, "jobs": [own(job) for job in request["jobs"]]}))


def _newest_single(visit: Visit, names: Mapping[str, str]) -> dict[str, UUID]:
    """The newest result of each campaign by itself, by the campaign's key; those without one are
    left out.
    """
    newest = {}
    for key in names:
        jobs = updating.list_update_jobs(
            visit.session, visit.user, campaign=UUID(key), status=["succeeded"], limit=1
        )
        if jobs.items:
            newest[key] = jobs.items[0].id
    return newest


def joint_updates_of(
    visit: Visit, project_id: UUID, campaign_id: UUID | None = None
) -> Sequence[JointUpdateOut]:
    """The newest joint updates of a project, or those of them that a campaign takes part in."""
    listed = updating.joint.page(visit.session, visit.user, project_id, limit=MOST).items
    return [
        job
        for job in listed
        if campaign_id is None or campaign_id in {each.campaign_id for each in job.campaigns}
    ]
