"""A series as clients see it: judged values beside the campaigns they come from, the runs, and the
alarms as marks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.normal import Z_95
from service.nouns.campaigns.climate import CLIMATE
from service.nouns.campaigns.operations import campaigns_of
from service.nouns.monitors.judgements import last_judgement
from service.nouns.monitors.points import Part, counts_of, extremes, points_of, shown_runs
from service.nouns.monitors.runs import covariates_of, latest_runs, unit_of
from service.nouns.monitors.schemas import AlarmEventOut, AlarmOut, RunOut
from service.nouns.monitors.tables import (
    Alarm,
    AlarmEvent,
    Monitor,
    MonitorPoint,
    MonitorRun,
    MonitorSeries,
)
from service.nouns.structures.operations import structure_of, structures_of
from service.platform.access import User
from service.platform.web import shown_as

if TYPE_CHECKING:
    from service.nouns.structures.operations import Structure


OF_RUN = ("revision", "state", "message", "update_job_id", "job_id", "software")
"""What a series has of each run."""


def series_document(
    session: Session,
    monitor: Monitor,
    series: MonitorSeries,
    part: Part,
    parameter: str | None = None,
) -> dict[str, Any]:
    """What `GET /monitors/{id}/series` answers; nothing but JSON, so that figures are made of it
    too.

    Args:
        session: where.
        monitor: which.
        series: a version of it.
        part: which campaigns are shown.
        parameter: this one's points alone, thinned to those that stand out; None: all parameters'
            of the campaigns that are shown.
    """
    judged = series.document or {"state": "no data", "notes": [], "parameters": []}
    part = part.of(len(judged["parameters"]))
    shown, total, stride = shown_runs(session, series, part)
    if parameter is not None and stride > 1:
        points = {parameter: extremes(session, series, monitor, parameter, part)}
        campaigns = [UUID(point["campaign_id"]) for point in points[parameter]]
    else:
        campaigns = shown
        points = points_of(session, series, campaigns)
    counts = counts_of(session, series)
    # one that failed says why the series stands as it stood before
    last = last_judgement(session, series)
    structure = structure_of(session, monitor.structure_id)
    alarms = session.scalars(
        select(Alarm).where(Alarm.monitor_id == monitor.id).order_by(Alarm.id)
    ).all()
    return {
        "monitor_id": str(monitor.id),
        "monitor_name": monitor.name,
        "structure_id": str(structure.id),
        "structure_name": structure.name,
        "series": series.number,
        **_members(series, "software", "reason", "assessed_at"),
        "current": series.number == monitor.series,
        "versions": _versions(session, monitor),
        "state": judged["state"],
        "judgement": None if last is None else {"status": last.state, "message": last.message},
        "notes": judged["notes"],
        "total": total,
        "stride": stride,
        "campaigns": _campaigns(session, series, campaigns),
        "parameters": [
            {
                **row,
                "timeline": _moments(row["timeline"], part),
                "unit": unit_of(row["name"]),
                "count": counts.get(row["name"], 0),
                "points": points.get(row["name"], []),
            }
            for row in judged["parameters"]
        ],
        "alarms": [_mark(alarm) for alarm in alarms],
    }


def _moments(timeline: Sequence[Mapping[str, Any]], part: Part) -> list[Mapping[str, Any]]:
    """Of a timeline the last moments of a part, at most as many as it has campaigns."""
    within = [
        moment
        for moment in timeline
        for at in [datetime.fromisoformat(moment["date"])]
        if (part.begin is None or at >= part.begin) and (part.end is None or at <= part.end)
    ]
    return within[-part.limit :]


def stated_covariates(document: Mapping[str, Any]) -> set[str]:
    """Names of the covariates, and of the climate, that campaigns of a series' document state."""
    return {
        name
        for each in document["campaigns"]
        for name in (*each["covariates"], *(n for n in CLIMATE if each[n] is not None))
    }


def _versions(session: Session, monitor: Monitor) -> list[dict[str, Any]]:
    rows = session.scalars(
        select(MonitorSeries)
        .where(MonitorSeries.monitor_id == monitor.id)
        .order_by(MonitorSeries.number)
    )
    members = ("software", "reason", "created_at", "assessed_at")
    return [{"series": row.number, **_members(row, *members)} for row in rows]


def _members(row: object, *names: str) -> dict[str, Any]:
    """Members of a row as JSON has them."""
    members = {name: getattr(row, name) for name in names}
    plain = {name: str(value) for name, value in members.items() if isinstance(value, UUID)}
    return (
        members
        | plain
        | {name: at.isoformat() for name, at in members.items() if isinstance(at, datetime)}
    )


def _campaigns(
    session: Session, series: MonitorSeries, campaigns: Sequence[UUID]
) -> list[dict[str, Any]]:
    runs = latest_runs(session, series, campaigns)
    shown = []
    for row in sorted(
        campaigns_of(session, runs).values(),
        key=lambda r: (r.performed_at is None, r.performed_at or r.created_at, r.id),
    ):
        run = runs[row.id]
        of_run = _members(run, *OF_RUN)
        of_campaign = _members(row, "name", "performed_at", *CLIMATE)
        of_campaign["covariates"] = covariates_of(run, row)
        keys = {"campaign_id": str(row.id), "run_id": str(run.id)}
        shown.append({**keys, **of_campaign, "deleted": row.deleted_at is not None, **of_run})
    return shown


def _mark(alarm: Alarm) -> dict[str, Any]:
    """An alarm as a mark on a series."""
    return {
        "alarm_id": str(alarm.id),
        **_members(alarm, "parameter", "campaign_id", "state", "note"),
        "unit": unit_of(alarm.parameter),
        "performed_at": alarm.details["performed_at"],
        "value": alarm.details["value"],
        "raised_at": alarm.created_at.isoformat(),
    }


def describe_runs(session: Session, rows: Sequence[MonitorRun]) -> list[RunOut]:
    """Runs as clients see them."""
    keys = {row.series_id for row in rows}
    numbers: dict[UUID, int] = dict(
        session.execute(
            select(MonitorSeries.id, MonitorSeries.number).where(MonitorSeries.id.in_(keys))
        ).all()
    )
    for row in rows:
        session.refresh(row)
    return [shown_as(RunOut, row, series=numbers[row.series_id]) for row in rows]


def describe_alarms(session: Session, alarms: Sequence[Alarm]) -> list[AlarmOut]:
    """Alarms with their history."""
    ids = [alarm.id for alarm in alarms]
    query = select(AlarmEvent, User.name).outerjoin(User, User.id == AlarmEvent.user_id)
    history: dict[UUID, list[AlarmEventOut]] = {key: [] for key in ids}
    for event, name in session.execute(
        query.where(AlarmEvent.alarm_id.in_(ids)).order_by(AlarmEvent.id)
    ):
        shown = AlarmEventOut(at=event.created_at, event=event.event, by=name, note=event.note)
        history[event.alarm_id].append(shown)
    watching = select(Monitor).join(Alarm, Alarm.monitor_id == Monitor.id).where(Alarm.id.in_(ids))
    monitors = {monitor.id: monitor for monitor in session.scalars(watching)}
    structures = structures_of(session, [monitor.structure_id for monitor in monitors.values()])
    return [
        _described(alarm, monitors[alarm.monitor_id], structures, history[alarm.id])
        for alarm in alarms
    ]


def _described(
    alarm: Alarm,
    monitor: Monitor,
    structures: Mapping[UUID, Structure],
    history: list[AlarmEventOut],
) -> AlarmOut:
    structure = structures[monitor.structure_id]
    by = next((step.by for step in reversed(history) if step.event == "acknowledged"), None)
    return shown_as(
        AlarmOut,
        alarm,
        acknowledged_by=by,  # by name, where the row has the user's id
        monitor_name=monitor.name,
        structure_id=structure.id,
        project_id=structure.project_id,
        unit=unit_of(alarm.parameter),
        history=history,
    )


def flat_rows(
    session: Session, series: MonitorSeries, points: Sequence[MonitorPoint]
) -> list[dict[str, Any]]:
    """Points as rows as dashboards read them: no member is nested but the covariates, which are
    members of their own names.
    """
    campaigns = campaigns_of(session, {point.campaign_id for point in points})
    runs = latest_runs(session, series, list(campaigns))
    parameters = {row["name"]: row for row in (series.document or {"parameters": ()})["parameters"]}
    rows = []
    for point in points:
        campaign, judged = campaigns.get(point.campaign_id), point.judged or {}
        parameter = parameters.get(point.parameter)
        if campaign is None or parameter is None:
            continue  # deleted, or judged anew, since
        half, base = Z_95 * point.standard_deviation, parameter["baseline"]
        rows.append(
            {
                "time": point.performed_at.isoformat(),
                "parameter": point.parameter,
                "unit": unit_of(point.parameter),
                "campaign_id": str(point.campaign_id),
                "campaign": campaign.name,
                "value": point.raw,
                "standard_deviation": point.standard_deviation,
                "low": point.raw - half,
                "high": point.raw + half,
                "corrected": point.corrected,
                "baseline": None if base is None else base["mean"],
                "in_baseline": point.in_baseline,
                "score": judged.get("score"),
                "outside": judged.get("outside"),
                **{name: getattr(campaign, name) for name in CLIMATE},
                **covariates_of(runs.get(point.campaign_id), campaign),
            }
        )
    return rows
