"""Pages of what is measured and watched: structure, campaign, the report on a file, a coupon batch,
monitors.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Any
from uuid import UUID

from fastapi import Query
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from service.figures.measured import AXES
from service.figures.trend import named_covariate
from service.monitoring import routes as monitoring
from service.nouns.campaigns import routes as campaigns
from service.nouns.campaigns.climate import CLIMATE, stated
from service.nouns.campaigns.operations import campaign_for, campaigns_of, frame_of, stored_points
from service.nouns.campaigns.schemas import Boundary, CampaignOut
from service.nouns.coupons import routes as coupons
from service.nouns.frfs import routes as frfs
from service.nouns.frfs.data import specimen_points
from service.nouns.frfs.routes import FrfFilter
from service.nouns.frfs.schemas import FrfOut
from service.nouns.imports.operations import trace_lines_of
from service.nouns.modes import routes as modes
from service.nouns.modes.operations import mode_set_for
from service.nouns.modes.schemas import ModeSetOut
from service.nouns.monitors.live import look_at_monitors
from service.nouns.monitors.points import Part
from service.nouns.monitors.presentation import stated_covariates
from service.nouns.monitors.schemas import AlarmOut
from service.nouns.recordings import routes as recordings
from service.nouns.records import routes as records
from service.nouns.records.schemas import HitDecisionOut, Proposal, RecordOut
from service.nouns.structures.operations import was_another
from service.pages.look import Visit, VisitDep
from service.pages.numbers import KEY
from service.pages.tasks import cards_of
from service.pages.updates import NamedJob, joint_updates_of, name_jobs, over_time
from service.pages.viewer import has_mesh, marked, points_in_space, viewer_of
from service.platform.web.routing import UI, page_router
from service.tasks.identify import routes as identify
from service.tasks.import_file import routes as imports
from service.tasks.import_file.routes import ImportOut
from service.tasks.model import routes as models
from service.tasks.process import routes as process
from service.tasks.update import routes as updating

router = page_router(UI)
MOST, MOST_WATCHED = 500, 200  # rows of a list on a page; of monitors and alarms
Cursor = Annotated[str | None, Query(max_length=100)]


@router.get("/structures/{structure_id}")
def get_structure(
    structure_id: UUID,
    visit: VisitDep,
    boundary: Annotated[Boundary | None, Query()] = None,
    name: Annotated[str, Query(max_length=200)] = "",
    cursor: Cursor = None,
) -> HTMLResponse:
    """A structure: its tests side by side with what they gave, coupon batches, monitors."""
    listed = campaigns.nouns.page(
        visit.session, visit.user, structure_id, cursor=cursor, limit=MOST, deleted=False
    )
    shown = [c for c in listed.items if _matches(c, boundary, name)]
    jobs = updating.list_update_jobs(
        visit.session, visit.user, structure=structure_id, status=["succeeded"], limit=MOST
    ).items
    newest = _newest(name_jobs(visit, jobs, ("verdict", "parameters", "modes")))
    context = visit.in_structure(structure_id)
    sent = models.of_jobs.page(visit.session, visit.user, structure_id, limit=1).items
    return visit.show(
        "structure.html",
        **context,
        has_mesh=has_mesh(context["structure"]),
        was_another=was_another(visit.session, structure_id),
        model=(
            models.get_model(structure_id, visit.session, visit.user)
            if context["structure"].model
            else None
        ),
        sent=sent[0] if sent else None,
        cards=cards_of(visit, "structure", structure_id),
        campaigns=sorted(shown, key=lambda c: c.performed_at or c.created_at),
        all_campaigns=len(listed.items),
        following=listed.next_cursor,
        newest=newest,
        over_time=over_time(list(newest.values()), {c.id: c.performed_at for c in listed.items}),
        parameters=_parameter_names(newest.values()),
        covariates=[
            (name, named_covariate(name))
            for name in sorted(
                {*CLIMATE, *(name for each in listed.items for name in stated(each))}
            )
        ],
        batches=coupons.batches.page(visit.session, visit.user, structure_id, limit=MOST).items,
        monitors=monitoring.nouns.page(
            visit.session, visit.user, structure_id, limit=MOST, deleted=False
        ).items,
        boundary=boundary,
        name=name,
    )


@router.get("/models/{model_id}")
def get_model(model_id: UUID, visit: VisitDep) -> Response:
    """A model's structure."""
    model = models.of_jobs.one(visit.session, visit.user, model_id)
    return RedirectResponse(f"../structures/{model.structure_id}")


def _matches(campaign: CampaignOut, boundary: str | None, name: str) -> bool:
    return boundary in (None, campaign.boundary) and name.casefold() in campaign.name.casefold()


def _newest(jobs: Sequence[NamedJob]) -> dict[UUID, NamedJob]:
    """The newest result of each campaign; jobs come newest first."""
    newest: dict[UUID, NamedJob] = {}
    for job in jobs:
        newest.setdefault(job.job.campaign_id, job)
    return newest


def _parameter_names(jobs: Iterable[NamedJob]) -> list[str]:
    names: dict[str, None] = {}
    for job in jobs:
        names |= dict.fromkeys(p["name"] for p in (job.result or {}).get("parameters", []))
    return list(names)


@router.get("/campaigns/{campaign_id}")
def get_campaign(campaign_id: UUID, visit: VisitDep) -> HTMLResponse:
    """A campaign: upload, grid to scale, FRF viewer, files, mode sets, hits, updates."""
    context = visit.in_campaign(campaign_id, deleted=False)
    listed = frfs.list_frfs(campaign_id, FrfFilter(), visit.session, visit.user, limit=1000)
    campaign = campaign_for(visit.session, visit.user, campaign_id)
    points, counts = specimen_points(visit.session, campaign), _measured_points(listed.items)
    jobs = updating.list_update_jobs(
        visit.session, visit.user, campaign=campaign_id, limit=50
    ).items
    blocks = records.list_records(campaign_id, visit.session, visit.user, limit=MOST).items
    processings = process.of_jobs.page(visit.session, visit.user, campaign_id, limit=10).items
    done = next((row.result for row in processings if row.result is not None), None)
    mode_sets = modes.nouns.page(visit.session, visit.user, campaign_id, limit=50).items
    sent = _sent(visit, campaign_id)
    return visit.show(
        "campaign.html",
        **context,
        frfs=listed.items,
        viewer=viewer_of(visit, context["campaign"], listed.items, map(marked, mode_sets)),
        more_frfs=listed.next_cursor is not None,
        space=points_in_space(
            points,
            listed.items,
            counts,
            frame_of(campaign),
            trace_lines_of(visit.session, campaign_id),
        ),
        has_mesh=has_mesh(context["structure"]),
        point_count=len(points),
        imports=sent,
        reports=_reports(sent),
        starts=_starts(_reports(sent), sent),
        mode_sets=mode_sets,
        job_of=_jobs_of(mode_sets),
        other_sets=_sets_to_compare(visit, context["campaign"]),
        identifications=identify.of_jobs.page(
            visit.session, visit.user, campaign_id, limit=10
        ).items,
        records=blocks,
        hit_places=_hit_places(blocks),
        recordings=recordings.nouns.page(visit.session, visit.user, campaign_id, limit=MOST).items,
        processings=processings,
        decided=_decided(visit, campaign_id),
        judged=[] if done is None else done["hits"],
        jobs=name_jobs(visit, jobs),
        joint=joint_updates_of(visit, context["project"].id, campaign_id),
        cards=cards_of(visit, "campaign", campaign_id),
    )


def _jobs_of(mode_sets: Sequence[ModeSetOut]) -> dict[UUID, UUID | None]:
    """The job that found the poles of each mode set, of an edited one those of the set before."""
    jobs: dict[UUID, UUID | None] = {}
    for each in mode_sets:  # a set comes after that which it was made of
        before = each.details.get("edited_from")
        jobs[each.id] = each.job_id if before is None else jobs.get(UUID(before))
    return jobs


def _sent(visit: Visit, campaign_id: UUID) -> list[ImportOut]:
    """The newest files of a campaign, the last one first."""
    return imports.of_jobs.page(
        visit.session, visit.user, campaign_id, limit=MOST, newest_first=True
    ).items


def _reports(sent: Sequence[ImportOut]) -> list[ImportOut]:
    """Of the files, newest first, those whose reports stand open: the newest, and those that were
    looked at and never read.
    """
    read = {row.sha256 for row in sent if not row.dry_run and row.status != "failed"}
    looked_at = {
        row.sha256: row.id for row in reversed(sent) if row.dry_run and row.sha256 not in read
    }
    return [row for number, row in enumerate(sent) if number == 0 or row.id in looked_at.values()]


def _starts(looked_at: Sequence[ImportOut], sent: Sequence[ImportOut]) -> dict[UUID, Any]:
    """The mapping that the form of each file begins with: as it was last stated of these arrays,
    else as they suggest it.
    """
    return {
        row.id: _overruling(
            next((each.mapping for each in sent if _says_of(each, row)), row.found.mapping),
            row.found,
        )
        for row in looked_at
        if row.found is not None
    }


def _overruling(mapping: dict[str, Any], proposal: Proposal) -> dict[str, Any]:
    """A mapping whose units are shown beside those of the file, so that what a person then types in
    their place counts.
    """
    if "frf" in mapping and (unit := proposal.mapping.get("unit")):
        return {"unit": unit, **mapping, "instead_of": unit}
    own = {
        each["variable"]: each["unit"]
        for each in proposal.mapping.get("channels", ())
        if each.get("unit")
    }
    if not own or not isinstance(mapping.get("channels"), list):
        return mapping
    beside = [own.get(channel.get("variable")) for channel in mapping["channels"]]
    channels = [
        {"unit": unit, **c, "instead_of": unit}
        for c, unit in zip(mapping["channels"], beside, strict=True)
    ]
    return {**mapping, "channels": channels}


def _says_of(stated: ImportOut, row: ImportOut) -> bool:
    """Whether a mapping was stated with a file, of the kind of this one, and the file is the same
    or has the same arrays.
    """
    if not isinstance(stated.mapping, dict) or ("frf" in stated.mapping) != (row.kind == "frfs"):
        return False
    names = (
        stated.found and row.found and stated.found.variables.keys() == row.found.variables.keys()
    )
    return stated.sha256 == row.sha256 or bool(names)


def _sets_to_compare(visit: Visit, campaign: CampaignOut) -> list[tuple[UUID, str]]:
    """Mode sets of the structure, those of this campaign first: key, and a name that says where
    each is from.
    """
    others = campaigns.nouns.page(
        visit.session, visit.user, campaign.structure_id, limit=MOST, deleted=False
    ).items
    names = {
        each.id: "" if each.id == campaign.id else f", {each.name}" for each in (campaign, *others)
    }
    sets = [
        (row.id, row.name + names[row.campaign_id], row.campaign_id)
        for row in mode_set_for.all(visit.session, campaign_id=names)
    ]
    return [(key, name) for key, name, _ in sorted(sets, key=lambda each: each[2] != campaign.id)]


def _decided(visit: Visit, campaign_id: UUID) -> dict[tuple[int, int, int], HitDecisionOut]:
    """What stands by hand of each hit: of several decisions the newest, which the list has
    first.
    """
    made: dict[tuple[int, int, int], HitDecisionOut] = {}
    for row in records.list_hit_decisions(campaign_id, visit.session, visit.user, limit=MOST).items:
        made.setdefault((row.point, row.direction, row.hit), row)
    return made


def _measured_points(rows: Sequence[FrfOut]) -> dict[int, int]:
    """How many FRFs each point has as a response or reference."""
    counts: dict[int, int] = {}
    for row in rows:
        for point in {row.response_point, row.reference_point}:
            counts[point] = counts.get(point, 0) + 1
    return counts


@dataclass(frozen=True)
class HitPlace:
    """Where was hit and where the sensor stood, for a list to choose from."""

    name: str  # in the page's address
    words: str  # for a person
    query: str  # of the figure


def _hit_places(blocks: Sequence[RecordOut]) -> list[HitPlace]:
    """Every pair of a hit's place and a sensor's, in the order in which they were first sent."""
    responses = [row for row in blocks if row.quantity != "force"]
    pairs = dict.fromkeys((row.force_point, row.force_direction, row.point) for row in responses)
    return [
        HitPlace(
            name=f"{point}~{direction}~{response}",
            words=f"{point}{'+' if direction > 0 else '−'}{AXES[abs(direction)]} / {response}",
            query=f"point={point}&direction={direction}&response={response}",
        )
        for point, direction, response in pairs
    ]


@router.get("/campaigns/{campaign_id}/grid-points")
def get_points(campaign_id: UUID, visit: VisitDep) -> HTMLResponse:
    """The table of a campaign's grid points, in the file's frame."""
    context = visit.in_campaign(campaign_id)
    return visit.show(
        "grid_points.html", **context, points=stored_points(visit.session, campaign_id)
    )


@router.get("/imports/{import_id}")
def get_import(
    import_id: UUID, visit: VisitDep, part: Annotated[bool, Query()] = False
) -> HTMLResponse:
    """What became of a file, dataset by dataset; `part` is the piece that replaces itself when it
    has ended.
    """
    shown = imports.of_jobs.one(visit.session, visit.user, import_id)
    starts = _starts([shown], _sent(visit, shown.campaign_id))
    if part:
        return visit.show("import_report.html", item=shown, starts=starts)
    return visit.show(
        "import.html", **visit.in_campaign(shown.campaign_id), item=shown, starts=starts
    )


@router.get("/coupon-batches/{batch_id}")
def get_batch(batch_id: UUID, visit: VisitDep) -> HTMLResponse:
    """A batch: its specimens, their statistics, the priors that follow."""
    batch = coupons.batches.one(visit.session, visit.user, batch_id)
    specimens = coupons.coupons.page(visit.session, visit.user, batch_id, limit=MOST).items
    return visit.show(
        "batch.html",
        **visit.in_structure(batch.structure_id),
        batch=batch,
        coupons=specimens,
        as_before=next((_reading(visit, c.id) for c in reversed(specimens) if c.has_curve), {}),
        summary=coupons.get_summary(batch_id, visit.session, visit.user),
    )


def _reading(visit: Visit, coupon_id: UUID) -> dict[str, Any]:
    """How a specimen's raw curve was read, with which the form of the next one begins; its own
    sizes left out.
    """
    request = coupons.get_curve(coupon_id, visit.session, visit.user).request
    stated = request.model_dump(mode="json", include={"standard", "columns"}, exclude_none=True)
    return {**stated, "dimensions": {"unit": request.dimensions.unit}}


@router.get("/monitors")
def get_monitors(visit: VisitDep) -> HTMLResponse:
    """All monitors, worst state first, and the alarms that are open."""
    return visit.show(
        "monitors.html",
        monitors=monitoring.list_monitors(visit.session, visit.user, limit=MOST_WATCHED).items,
        **_causes(
            visit,
            [
                alarm
                for state in ("alarm", "acknowledged")
                for alarm in monitoring.list_alarms(
                    visit.session, visit.user, state=state, limit=MOST_WATCHED
                ).items
            ],
        ),
    )


def _causes(visit: Visit, alarms: Sequence[AlarmOut]) -> dict[str, Any]:
    """Alarms by what may be one cause, those of a monitor that one campaign raised, as they came;
    and the campaigns' names.
    """
    groups: dict[tuple[UUID, UUID, str], list[AlarmOut]] = {}
    for alarm in alarms:
        groups.setdefault((alarm.monitor_id, alarm.campaign_id, alarm.state), []).append(alarm)
    rows = campaigns_of(visit.session, [alarm.campaign_id for alarm in alarms])
    return {
        "alarms": list(groups.values()),
        "names": {str(key): row.name for key, row in rows.items()},
    }


@router.get("/monitors/{monitor_id}")
def get_monitor(
    monitor_id: UUID,
    visit: VisitDep,
    series: Annotated[int | None, Query(ge=1, le=1_000_000)] = None,
    show: Annotated[list[str] | None, Query(max_length=100)] = None,
    over: Annotated[str, Query(max_length=60)] = "",
    begin: Annotated[date | None, Query(alias="from")] = None,
    end: Annotated[date | None, Query(alias="to")] = None,
) -> HTMLResponse:
    """A monitor: alarms, a figure of each chosen parameter with its limits over time or a
    covariate, what they say, runs. Chosen are those that call, else the first one.
    """
    monitor = monitoring.nouns.one(visit.session, visit.user, monitor_id)
    newest = Part(limit=MOST_WATCHED)
    document = monitoring.series_shown(monitor_id, visit.session, visit.user, newest, series)
    shown_runs = monitoring.list_runs(monitor_id, visit.session, visit.user, series, limit=30).items
    noted = [document, *document["parameters"]]
    keys = {UUID(key) for each in noted for note in each["notes"] for key in KEY.findall(note)}
    keys.update(run.campaign_id for run in shown_runs)
    named = {str(key): row for key, row in campaigns_of(visit.session, [*keys]).items()}
    for each in noted:
        each["notes"] = [_with_names(note, named) for note in each["notes"]]
    rows = document["parameters"]
    calling = [row["name"] for row in rows if row["state"] in ("alarm", "pending")]
    known = stated_covariates(document)
    now = look_at_monitors(visit.session, {monitor_id}).get(monitor_id)
    return visit.show(
        "monitor.html",
        under_way=None if now is None or now.ended else now,
        **visit.in_structure(monitor.structure_id),
        monitor=monitor,
        series=document,
        campaigns=named,
        shown={"from": begin, "to": end},
        chosen=[row["name"] for row in rows if row["name"] in (show or calling)]
        or [row["name"] for row in rows[:1]],
        covariates=sorted(known),
        over=over if over in known else "",
        **_causes(
            visit,
            monitoring.list_alarms(
                visit.session, visit.user, monitor=monitor_id, limit=MOST_WATCHED
            ).items,
        ),
        runs=shown_runs,
    )


def _with_names(note: str, campaigns: Mapping[str, Any]) -> str:
    """A note with campaigns by name and date in place of their keys."""
    for key, row in campaigns.items():
        at = "" if row.performed_at is None else row.performed_at.date().isoformat()
        note = note.replace(key, f"{row.name} ({at})")
    return note
