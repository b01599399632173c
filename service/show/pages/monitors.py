"""Pages of condition monitoring: all monitors by worst state, one with its series, alarms."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import Query
from fastapi.responses import HTMLResponse

from service.monitoring import routes as monitoring
from service.show.pages.look import VisitDep
from service.web.routing import page_router

router = page_router()
MOST = 200  # rows of a list on a page


@router.get("/monitors")
def get_monitors(visit: VisitDep) -> HTMLResponse:
    """All monitors, worst state first, and the alarms that are open."""
    return visit.show(
        "monitors.html",
        monitors=monitoring.list_monitors(visit.session, visit.user, limit=MOST).items,
        alarms=[
            alarm
            for state in ("alarm", "acknowledged")
            for alarm in monitoring.list_alarms(visit.session, visit.user, state=state, limit=MOST).items
        ],
    )


@router.get("/monitors/{monitor_id}")
def get_monitor(
    monitor_id: UUID, visit: VisitDep, series: Annotated[int | None, Query(ge=1, le=1_000_000)] = None
) -> HTMLResponse:
    """A monitor: a figure of each watched parameter with its limits, what they say, alarms, runs."""
    monitor = monitoring.nouns.one(visit.session, visit.user, monitor_id)
    return visit.show(
        "monitor.html",
        **visit.in_structure(monitor.structure_id),
        monitor=monitor,
        series=monitoring.get_series(monitor_id, visit.session, visit.user, series),
        alarms=monitoring.list_alarms(visit.session, visit.user, monitor=monitor_id, limit=MOST).items,
        runs=monitoring.list_runs(monitor_id, visit.session, visit.user, series, limit=30).items,
    )
