"""Judgements of series as rows."""

from typing import Any
from uuid import UUID

from sqlalchemy import Row, select
from sqlalchemy.orm import Session

from service.nouns.monitors.tables import Monitor, MonitorJudgement, MonitorSeries
from service.platform.queue.tables import Job


def last_judgement(session: Session, series: MonitorSeries) -> Row[str, str | None, str] | None:
    """How the latest judgement stands: `state`, `message` and `digest` of what it was of."""
    return session.execute(
        select(Job.state, Job.message, MonitorJudgement.digest)
        .join(Job, Job.id == MonitorJudgement.id)
        .where(MonitorJudgement.series_id == series.id)
        .order_by(MonitorJudgement.id.desc())
        .limit(1)
    ).one_or_none()


def note_judgement(session: Session, job_id: UUID, series: MonitorSeries, digest: str) -> None:
    """The row of a job that is queued."""
    session.add(MonitorJudgement(id=job_id, series_id=series.id, digest=digest))
    session.flush()


def judged(
    session: Session, job_id: UUID, *, lock: bool = False
) -> tuple[MonitorJudgement, MonitorSeries, Monitor]:
    """What a job judges; with the monitor's row held where its outcome is stored."""
    row = session.get_one(MonitorJudgement, job_id)
    series = session.get_one(MonitorSeries, row.series_id)
    held: dict[str, Any] = {"with_for_update": True, "populate_existing": True} if lock else {}
    return row, series, session.get_one(Monitor, series.monitor_id, **held)
