"""The campaigns that make a series, in the order of time: those whose latest run has succeeded and
that are what the monitor looks at. Of ten years of hourly runs they are read in a second, and their
digest in a quarter of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any, NamedTuple
from uuid import UUID

from sqlalchemy import Subquery, Text, cast, func, literal, select
from sqlalchemy.dialects.postgresql import aggregate_order_by, distinct_on
from sqlalchemy.orm import Session

from service.nouns.campaigns.climate import CLIMATE
from service.nouns.campaigns.operations import campaign_facts
from service.nouns.monitors.tables import MonitorRun

if TYPE_CHECKING:
    from service.nouns.monitors.tables import Monitor, MonitorSeries


class Counted(NamedTuple):
    """A campaign of a series with the run that counts."""

    campaign_id: UUID
    run_id: UUID
    performed_at: datetime
    revision: int
    software: str | None
    conditions: dict[str, Any]  # covariates as the campaign states them


def _counted(monitor: Monitor, series: MonitorSeries) -> Subquery:
    """Of several campaigns of one moment the first one counts."""
    latest = (
        select(MonitorRun.id, MonitorRun.campaign_id, MonitorRun.revision)
        .add_columns(MonitorRun.state, MonitorRun.software)
        .where(MonitorRun.series_id == series.id)
        .ext(distinct_on(MonitorRun.campaign_id))
        .order_by(MonitorRun.campaign_id, MonitorRun.revision.desc())
        .subquery()
    )
    campaign = campaign_facts().c
    columns = (campaign.performed_at, campaign.covariates, *(campaign[name] for name in CLIMATE))
    query = (
        select(latest.c.campaign_id, latest.c.id, latest.c.revision, latest.c.software, *columns)
        .join(campaign.id.table, campaign.id == latest.c.campaign_id)
        .where(
            latest.c.state == "succeeded",
            campaign.structure_id == monitor.structure_id,
            campaign.deleted_at.is_(None),
            campaign.performed_at.is_not(None),
        )
    )
    if monitor.since is not None:
        query = query.where(campaign.performed_at >= monitor.since)
    if monitor.boundary is not None:
        query = query.where(campaign.boundary == monitor.boundary)
    order = (campaign.performed_at, campaign.id)
    return query.ext(distinct_on(campaign.performed_at)).order_by(*order).subquery()


def counted(session: Session, monitor: Monitor, series: MonitorSeries) -> list[Counted]:
    """The campaigns of a series."""
    rows = _counted(monitor, series).c
    columns = (rows.campaign_id, rows.id, rows.performed_at, rows.revision, rows.software)
    conditions = (rows.covariates, *(rows[name] for name in CLIMATE))
    every: Any = session.execute(select(*columns, *conditions).order_by(rows.performed_at))
    return [
        Counted(run, key, at, revision, software, dict(zip(CLIMATE, climate, strict=True)) | stated)
        for run, key, at, revision, software, stated, *climate in every
    ]


def counted_digest(
    session: Session, monitor: Monitor, series: MonitorSeries
) -> tuple[str | None, datetime | None]:
    """Of what a judgement takes from the campaigns of a series, None where there are none; and the
    date of the last one.
    """
    rows = _counted(monitor, series).c
    taken = (rows.id, rows.performed_at, rows.covariates, *(rows[name] for name in CLIMATE))
    one = func.concat_ws("|", *(cast(each, Text) for each in taken))
    every = func.md5(func.string_agg(one, aggregate_order_by(literal(","), rows.performed_at)))
    digest, last = session.execute(select(every, func.max(rows.performed_at))).one()
    return digest, last


def is_under_way(session: Session, series: MonitorSeries) -> bool:
    """Whether a run has not ended."""
    running = MonitorRun.series_id == series.id, MonitorRun.state == "running"
    return session.scalar(select(select(MonitorRun.id).where(*running).exists())) or False


def values_of_runs(session: Session, runs: Sequence[UUID]) -> dict[UUID, dict[str, Any]]:
    """What runs took of their results, by run."""
    query = select(MonitorRun.id, MonitorRun.values).where(MonitorRun.id.in_(runs))
    return {key: values or {} for key, values in session.execute(query)}


def update_job_of(session: Session, run: UUID) -> UUID | None:
    """The update of a run; None of one of modes."""
    return session.get_one(MonitorRun, run).update_job_id
