"""Routes of monitors, their runs and series, and alarms."""

from functools import partial
from typing import Annotated, Any, Literal
from uuid import UUID

from fastapi import Query, Request, Response
from fastapi.responses import JSONResponse
from sqlalchemy.orm import Session

from modalbase.formats.arrays_out import ARRAY_WRITERS
from service.monitoring import runs
from service.nouns.campaigns.operations import campaign_for
from service.nouns.monitors import operations as monitors
from service.nouns.monitors.alarms import acknowledge, alarm_for, alarms_seen, raised_with
from service.nouns.monitors.parameters import From, PartDep, To, Version, part_of
from service.nouns.monitors.points import Part, points_page
from service.nouns.monitors.presentation import (
    describe_alarms,
    describe_runs,
    flat_rows,
    series_document,
)
from service.nouns.monitors.runs import monitor_for, runs_of
from service.nouns.monitors.schemas import (
    AcknowledgedOut,
    AcknowledgementIn,
    AlarmOut,
    CompletionOut,
    MonitorIn,
    MonitorOut,
    MonitorPatch,
    RunOut,
    RunsIn,
    State,
)
from service.nouns.monitors.series_schemas import SeriesOut
from service.nouns.monitors.watching import request_check
from service.nouns.notifications.routes import DeliveryOut, deliveries_of_monitor
from service.platform.access import (
    CurrentUser,
    SessionDep,
    SettingsDep,
    User,
    api_router,
)
from service.platform.access.nouns import NounRoutes
from service.platform.db.base import at_one_moment
from service.platform.errors import Invalid
from service.platform.web import (
    IF_MATCH,
    Confirm,
    Cursor,
    Limit,
    Page,
    UnlessNamed,
    etag_of,
    paged,
    require_match,
    require_usual,
)
from service.platform.web.downloads import spooled
from service.platform.web.parameters import form_of, there

router = api_router(tags=["monitoring"])
nouns = NounRoutes(router, monitor_for, MonitorOut, monitors.describe_all, "monitors", "monitor_id")

Deleted = Annotated[
    bool, Query(description="list deleted monitors, which can be restored, instead")
]


@router.post("/structures/{structure_id}/monitors", status_code=201, responses=there(MonitorOut))
def create_monitor(
    structure_id: UUID,
    body: MonitorIn,
    session: SessionDep,
    user: CurrentUser,
    settings: SettingsDep,
    response: Response,
    confirm: Confirm = False,
    unless_named: UnlessNamed = False,
) -> MonitorOut:
    """Watch a structure: a frozen recipe, a baseline, parameters and how often it may call in
    vain.
    """
    require_usual(body, confirm)
    present = (
        nouns.first_named(session, user, structure_id, body.name, response)
        if unless_named
        else None
    )
    monitor = present or monitors.create_monitor(session, user, structure_id, body, settings)
    response.headers["Location"] = f"/api/v1/monitors/{monitor.id}"
    return nouns.tagged(session, monitor, response)


nouns.listing("list_monitors_of_structure", "Monitors of a structure.", hides=True)


@router.get("/monitors")
def list_monitors(
    session: SessionDep,
    user: CurrentUser,
    state: Annotated[State | None, Query(description="in this state only")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
    deleted: Deleted = False,
) -> Page[MonitorOut]:
    """One's monitors of all structures, worst state first."""
    rows, following = monitors.page_worst_first(session, user, state, deleted, cursor, limit)
    return Page(items=monitors.describe_all(session, rows), next_cursor=following)


nouns.getting("get_monitor", "A monitor and its state.", tagged=True)


@router.patch("/monitors/{monitor_id}", openapi_extra=IF_MATCH)
def change_monitor(
    monitor_id: UUID,
    body: MonitorPatch,
    session: SessionDep,
    user: CurrentUser,
    settings: SettingsDep,
    request: Request,
    response: Response,
) -> MonitorOut:
    """Change a monitor: its name, a receiver, the expected interval, or whether it is at rest. What
    decides is frozen.
    """
    monitor = monitor_for(session, user, monitor_id, "editor", lock=True)
    require_match(request, etag_of(nouns.shown(session, monitor)))
    if not body.model_fields_set:
        raise Invalid("", "names nothing to change")
    monitors.change_monitor(session, user, monitor, body, settings)
    return nouns.tagged(session, monitor, response)


# The updates of a monitor that run end as results of their own.
nouns.deleting(
    "delete_monitor",
    "Hide a monitor with its series and alarms, and end its work. It stays stored and can be"
    " restored.",
)


nouns.restoring(
    "restore_monitor",
    "Bring a deleted monitor back; campaigns that came in between are run.",
    lambda session, monitor: request_check(session, monitor.id),
)


@router.post(
    "/monitors/{monitor_id}/runs",
    status_code=202,
    responses={200: {"model": Page[RunOut], "description": "No campaign is left to run"}},
)
def start_runs(
    monitor_id: UUID, body: RunsIn, session: SessionDep, user: CurrentUser, response: Response
) -> Page[RunOut]:
    """Run campaigns by hand: one, all that have not been run (backfill, in time order), or all
    anew.

    The answer lists the runs that are new; a campaign that has been run as it is now gets no second
    run: then it is 200.
    """
    monitor = monitor_for(session, user, monitor_id, "editor", lock=True)
    if body.rerun:
        started = runs.rerun(session, user, monitor, body.reason)
    else:
        started = runs.run_by_hand(session, user, monitor, body.campaign)
    response.status_code = 202 if started else 200
    return Page(items=describe_runs(session, started))


@router.get("/monitors/{monitor_id}/runs")
def list_runs(
    monitor_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    series: Version = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[RunOut]:
    """Every run of a monitor, with the ones that were superseded or refused, newest first."""
    monitor = monitor_for(session, user, monitor_id)
    query = runs_of(monitor, series)
    return paged(session, query, cursor, limit, partial(describe_runs, session), newest_first=True)


@router.get(
    "/monitors/{monitor_id}/series", response_model=None, responses={200: {"model": SeriesOut}}
)
def get_series(
    monitor_id: UUID, session: SessionDep, user: CurrentUser, part: PartDep, series: Version = None
) -> Response:
    """The series: values with their uncertainty, baseline, limits, corrected and raw, alarms and
    campaigns as marks. Of a long one every k-th campaign, unless a part of it is asked for.
    """
    return JSONResponse(series_shown(monitor_id, session, user, part, series))


def series_shown(
    monitor_id: UUID, session: Session, user: User, part: Part, series: int | None
) -> dict[str, Any]:
    """What `GET /monitors/{id}/series` answers."""
    at_one_moment(session)  # a judgement may end meanwhile
    monitor = monitor_for(session, user, monitor_id)
    return series_document(session, monitor, monitors.series_for(session, monitor, series), part)


ROW_TYPES = {"json": "application/json", "parquet": ARRAY_WRITERS["parquet"].media_type}


@router.get(
    "/monitors/{monitor_id}/series/rows",
    response_model=Page[dict[str, Any]],
    responses={200: {"content": {ROW_TYPES["parquet"]: {}}}},
)
def get_series_rows(
    request: Request,
    monitor_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    form: Annotated[str, form_of(ROW_TYPES)],
    series: Version = None,
    parameter: Annotated[
        list[str] | None,
        Query(max_length=100, description="these only, such as `frequency_1`; default: all"),
    ] = None,
    begin: From = None,
    end: To = None,
    cursor: Cursor = None,
    limit: Annotated[int, Query(ge=1, le=10_000, description="at most so many rows")] = 1000,
) -> Any:
    """The series as flat rows, one for each value, with ISO times, in the order of time: what the
    JSON and Infinity sources of Grafana read; or as Parquet, whose next page stands in the header
    `Link`.
    """
    at_one_moment(session)
    monitor = monitor_for(session, user, monitor_id)
    version = monitors.series_for(session, monitor, series)
    names = [row["name"] for row in (version.document or {"parameters": ()})["parameters"]]
    watched = [*monitor.watch["directions"], *names]
    if unknown := sorted(set(parameter or ()) - set(watched)):
        raise Invalid("parameter", f"{unknown[0]!r} is not watched; {', '.join(watched)} are")
    page, following = points_page(session, version, cursor, part_of(begin, end, limit), parameter)
    rows = flat_rows(session, version, page)
    if form == "json":
        return Page(items=rows, next_cursor=following)
    columns = dict.fromkeys(name for row in rows for name in row)
    following_page = request.url.include_query_params(cursor=following)
    link = {"Link": f'<?{following_page.query}>; rel="next"'} if following else {}
    return spooled(
        lambda file: ARRAY_WRITERS[form].write(
            {name: [row.get(name) for row in rows] for name in columns}, file
        ),
        ROW_TYPES[form],
        "series.parquet",
        {"Vary": "Accept", **link},
    )


@router.post("/campaigns/{campaign_id}/complete")
def complete_campaign(campaign_id: UUID, session: SessionDep, user: CurrentUser) -> CompletionOut:
    """Say that everything of a campaign is in, so that its structure's monitors need not wait.
    Saying it twice is fine.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    row, started = runs.complete_campaign(session, user, campaign)
    return CompletionOut(
        campaign_id=row.campaign_id,
        completed_at=row.completed_at,
        runs=describe_runs(session, started),
    )


@router.get("/alarms")
def list_alarms(
    session: SessionDep,
    user: CurrentUser,
    state: Annotated[
        Literal["alarm", "acknowledged", "cleared", "withdrawn"] | None,
        Query(description="in this state only"),
    ] = None,
    monitor: Annotated[UUID | None, Query(description="of this monitor only")] = None,
    project: Annotated[UUID | None, Query(description="of this project only")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[AlarmOut]:
    """Alarms of one's projects, newest first, each with its history; those of deleted monitors are
    left out.
    """
    query = alarms_seen(session, user, state, monitor, project)
    return paged(
        session, query, cursor, limit, partial(describe_alarms, session), newest_first=True
    )


@router.get("/alarms/{alarm_id}")
def get_alarm(alarm_id: UUID, session: SessionDep, user: CurrentUser) -> AlarmOut:
    """An alarm with its history."""
    return describe_alarms(session, [alarm_for(session, user, alarm_id)])[0]


@router.post("/alarms/{alarm_id}/acknowledge")
def acknowledge_alarm(
    alarm_id: UUID, body: AcknowledgementIn, session: SessionDep, user: CurrentUser
) -> AcknowledgedOut:
    """Say that you have seen an alarm, and what you make of it. The monitor is judged anew with
    that.
    """
    alarm = alarm_for(session, user, alarm_id, "editor")
    acknowledge(session, user, alarm, body.note)
    others = raised_with(session, alarm) if body.together else ()
    for other in others:
        acknowledge(session, user, other, body.note)
    request_check(session, alarm.monitor_id)
    (shown,) = describe_alarms(session, [alarm])
    return AcknowledgedOut(**shown.model_dump(), together=[other.id for other in others])


@router.get("/monitors/{monitor_id}/deliveries")
def list_deliveries_of_monitor(
    monitor_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[DeliveryOut]:
    """The messages of a monitor, by webhook and mail, newest first."""
    monitor = monitor_for(session, user, monitor_id)
    return deliveries_of_monitor(session, monitor.id, cursor, limit)
