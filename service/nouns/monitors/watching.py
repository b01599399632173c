"""Which monitors are at work, and how they hear of what has changed."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from uuid import UUID

from croniter import croniter
from sqlalchemy import and_, func, or_, select
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import structures_with
from service.nouns.imports.operations import campaigns_with
from service.nouns.monitors.tables import (
    AT_WORK,
    Monitor,
    MonitorJudgement,
    MonitorRun,
    MonitorSeries,
)
from service.nouns.structures.operations import structures_in
from service.platform.access import projects_at_work
from service.platform.queue.resource import ENDED
from service.platform.queue.tables import Job

REQUESTED = "modalbase_monitor_asked"
"""Channel of notifications with the id of a monitor that has changed through the API."""

_WATCHING = and_(AT_WORK, Monitor.structure_id.in_(structures_in(projects_at_work())))
"""What is archived, or deleted with its structure or project, rests."""


def request_check(session: Session, monitor_id: UUID) -> None:
    """Have a monitor checked as soon as the transaction is committed."""
    session.execute(select(func.pg_notify(REQUESTED, str(monitor_id))))


def watching(session: Session, changed: Sequence[UUID] | None = None) -> Sequence[UUID]:
    """Keys of the monitors at work: all, or those among these ids and those that an ended job among
    these belongs to.
    """
    query = select(Monitor.id).where(_WATCHING).order_by(Monitor.id)
    if changed is None:
        return session.scalars(query).all()
    of_run = (
        select(MonitorSeries.monitor_id)
        .join(MonitorRun)
        .join(Job, or_(Job.id == MonitorRun.update_job_id, Job.id == MonitorRun.job_id))
    )
    of_judgement = (
        select(MonitorSeries.monitor_id)
        .join(MonitorJudgement)
        .join(Job, Job.id == MonitorJudgement.id)
    )
    ended = (Job.id.in_(changed), Job.state.in_(ENDED))
    imported_into = structures_with(campaigns_with(select(Job.id).where(*ended)))
    concerned = or_(
        Monitor.id.in_(changed),
        Monitor.structure_id.in_(imported_into),
        Monitor.id.in_(of_run.where(*ended)),
        Monitor.id.in_(of_judgement.where(*ended)),
    )
    return session.scalars(query.where(concerned)).all()


def held(session: Session, monitor_id: UUID) -> Monitor | None:
    """A monitor at work with its row held; None where it rests or another holds it."""
    query = select(Monitor).where(Monitor.id == monitor_id, _WATCHING)
    return session.scalars(query.with_for_update(skip_locked=True)).one_or_none()


def next_time(schedule: str, now: datetime) -> datetime:
    """The next time of a cron schedule, UTC."""
    upcoming: datetime = croniter(schedule, now).get_next(datetime)
    return upcoming
