"""Monitors as they change, for pages that watch them beside jobs: runs that are under way, and a
judgement that is to come.
"""

import json
import zlib
from uuid import UUID

from fastapi.sse import format_sse_event
from sqlalchemy import Text, cast, func, select, union_all
from sqlalchemy.orm import Session

from service.nouns.monitors.tables import Monitor, MonitorJudgement, MonitorRun, MonitorSeries
from service.nouns.structures.operations import structures_in
from service.platform.access import User, projects_of
from service.platform.queue.events import Shown
from service.platform.queue.resource import ENDED
from service.platform.queue.tables import Job


def monitors_among(session: Session, user: User, ids: set[UUID]) -> set[UUID]:
    """Those of these ids that name monitors which the user may see."""
    within = Monitor.structure_id.in_(structures_in(projects_of(user)))
    return set(session.scalars(select(Monitor.id).where(Monitor.id.in_(ids), within)))


def look_at_monitors(session: Session, ids: set[UUID]) -> dict[UUID, Shown]:
    """States of monitors that have begun a run: `running` until all runs and judgements have ended,
    then `succeeded`.
    """
    among, series = MonitorSeries.monitor_id.in_(ids), MonitorSeries.id
    runs = select(MonitorSeries.monitor_id, MonitorRun.id, MonitorRun.state)
    judgements = select(MonitorSeries.monitor_id, Job.id, Job.state)
    of_series = MonitorJudgement.series_id == series
    parts = union_all(
        runs.join(MonitorRun, MonitorRun.series_id == series).where(among),
        judgements.join(MonitorJudgement, of_series)
        .join(Job, Job.id == MonitorJudgement.id)
        .where(among),
    ).subquery()
    digest = func.sum(func.hashtext(cast(parts.c.id, Text) + parts.c.state))
    ended = func.bool_and(parts.c.state.in_((*ENDED, "refused")))
    every = select(parts.c.monitor_id, func.count(), digest, ended).group_by(parts.c.monitor_id)
    return {monitor: _shown(monitor, *state) for monitor, *state in session.execute(every)}


def _shown(monitor: UUID, parts: int, digest: int, ended: bool) -> Shown:
    version = zlib.crc32(f"{parts} {digest}".encode())
    data = json.dumps(
        {"id": str(monitor), "status": "succeeded" if ended else "running", "version": version}
    )
    return Shown(version, format_sse_event(data_str=data, event="job", id=str(version)), ended)
