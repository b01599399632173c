"""A series as clients see it: judged values beside the campaigns they come from, the runs, and the alarms as marks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.access import User
from service.jobs.tables import Job
from service.monitoring.runs import latest_runs, unit_of
from service.monitoring.schemas import AlarmEventOut, AlarmOut, RunOut
from service.monitoring.tables import Alarm, AlarmEvent, Monitor, MonitorJudgement, MonitorRun, MonitorSeries
from service.store.campaigns.operations import campaigns_of
from service.store.structures.operations import structure_of, structures_of

if TYPE_CHECKING:
    from service.store.structures.operations import Structure


def series_document(session: Session, monitor: Monitor, series: MonitorSeries) -> dict[str, Any]:
    """What `GET /monitors/{id}/series` answers; nothing but JSON, so that figures are made of it too."""
    judged = series.document or {"state": "no data", "notes": [], "parameters": []}
    structure = structure_of(session, monitor.structure_id)
    alarms = session.scalars(select(Alarm).where(Alarm.monitor_id == monitor.id).order_by(Alarm.id)).all()
    return {
        "monitor_id": str(monitor.id),
        "monitor_name": monitor.name,
        "structure_id": str(structure.id),
        "structure_name": structure.name,
        "series": series.number,
        "software": series.software,
        "reason": series.reason,
        "current": series.number == monitor.series,
        "versions": _versions(session, monitor),
        "state": judged["state"],
        "assessed_at": None if series.assessed_at is None else series.assessed_at.isoformat(),
        "judgement": _last_judgement(session, series),
        "notes": judged["notes"],
        "campaigns": _campaigns(session, series),
        "parameters": [{**row, "unit": unit_of(row["name"])} for row in judged["parameters"]],
        "alarms": [describe_mark(alarm) for alarm in alarms],
    }


def _versions(session: Session, monitor: Monitor) -> list[dict[str, Any]]:
    rows = session.scalars(
        select(MonitorSeries).where(MonitorSeries.monitor_id == monitor.id).order_by(MonitorSeries.number)
    )
    return [
        {
            "series": row.number,
            "software": row.software,
            "reason": row.reason,
            "created_at": row.created_at.isoformat(),
            "assessed_at": None if row.assessed_at is None else row.assessed_at.isoformat(),
        }
        for row in rows
    ]


def _last_judgement(session: Session, series: MonitorSeries) -> dict[str, Any] | None:
    """How the latest judgement went: one that failed says why the series stands as it stood before."""
    job = session.scalars(
        select(Job)
        .join(MonitorJudgement, MonitorJudgement.id == Job.id)
        .where(MonitorJudgement.series_id == series.id)
        .order_by(Job.id.desc())
        .limit(1)
    ).one_or_none()
    return None if job is None else {"status": job.state, "message": job.message}


def _campaigns(session: Session, series: MonitorSeries) -> list[dict[str, Any]]:
    runs = latest_runs(session, series)
    rows = campaigns_of(session, runs)
    shown = []
    for row in sorted(rows, key=lambda r: (r.performed_at is None, r.performed_at or r.created_at, r.id)):
        run = runs[row.id]
        shown.append(
            {
                "campaign_id": str(row.id),
                "name": row.name,
                "performed_at": None if row.performed_at is None else row.performed_at.isoformat(),
                "temperature_c": row.temperature_c,
                "humidity_percent": row.humidity_percent,
                "deleted": row.deleted_at is not None,
                "run_id": str(run.id),
                "revision": run.revision,
                "state": run.state,
                "message": run.message,
                "update_job_id": None if run.update_job_id is None else str(run.update_job_id),
                "software": run.software,
            }
        )
    return shown


def describe_mark(alarm: Alarm) -> dict[str, Any]:
    """An alarm as a mark on a series."""
    return {
        "alarm_id": str(alarm.id),
        "parameter": alarm.parameter,
        "unit": unit_of(alarm.parameter),
        "campaign_id": str(alarm.campaign_id),
        "state": alarm.state,
        "performed_at": alarm.details["performed_at"],
        "value": alarm.details["value"],
        "raised_at": alarm.created_at.isoformat(),
        "note": alarm.note,
    }


def describe_runs(session: Session, rows: Sequence[MonitorRun]) -> list[RunOut]:
    """Runs as clients see them."""
    keys = {row.series_id for row in rows}
    numbers: dict[UUID, int] = dict(
        session.execute(select(MonitorSeries.id, MonitorSeries.number).where(MonitorSeries.id.in_(keys))).all()
    )
    for row in rows:
        session.refresh(row)
    shared = set(RunOut.model_fields) - {"series"}
    return [RunOut(series=numbers[row.series_id], **{name: getattr(row, name) for name in shared}) for row in rows]


def describe_alarms(session: Session, alarms: Sequence[Alarm]) -> list[AlarmOut]:
    """Alarms with their history."""
    ids = [alarm.id for alarm in alarms]
    query = select(AlarmEvent, User.name).outerjoin(User, User.id == AlarmEvent.user_id)
    history: dict[UUID, list[AlarmEventOut]] = {key: [] for key in ids}
    for event, name in session.execute(query.where(AlarmEvent.alarm_id.in_(ids)).order_by(AlarmEvent.id)):
        shown = AlarmEventOut(at=event.created_at, event=event.event, by=name, note=event.note)
        history[event.alarm_id].append(shown)
    watching = select(Monitor).join(Alarm, Alarm.monitor_id == Monitor.id).where(Alarm.id.in_(ids))
    monitors = {monitor.id: monitor for monitor in session.scalars(watching)}
    structures = structures_of(session, [monitor.structure_id for monitor in monitors.values()])
    return [_described(alarm, monitors[alarm.monitor_id], structures, history[alarm.id]) for alarm in alarms]


def _described(
    alarm: Alarm, monitor: Monitor, structures: Mapping[UUID, Structure], history: list[AlarmEventOut]
) -> AlarmOut:
    structure = structures[monitor.structure_id]
    by = next((step.by for step in reversed(history) if step.event == "acknowledged"), None)
    same = {name: getattr(alarm, name) for name in AlarmOut.model_fields if hasattr(alarm, name)}
    return AlarmOut(
        **{**same, "acknowledged_by": by},  # by name, where the row has the user's id
        monitor_name=monitor.name,
        structure_id=structure.id,
        project_id=structure.project_id,
        unit=unit_of(alarm.parameter),
        history=history,
    )
