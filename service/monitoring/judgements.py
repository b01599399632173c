"""Judging a series: a job whose result, states, alarms and messages are one transaction.

A series is judged when what it would be judged on differs from what it was judged on last: a new
value, a corrected temperature, a deleted campaign, an acknowledgement, a campaign that has become
late. While runs are under way it waits for them, so a backfill is judged once and in time order.

Alarms are raised once, acknowledged by somebody, and cleared or withdrawn by a later judgement.
Each step is announced.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.dialects.postgresql import distinct_on
from sqlalchemy.orm import Session

from fecore.trend import Acknowledgement, State, Watch
from fecore.trend import Chart as CoreChart
from fecore.trend.states import WORST_FIRST
from service.compute.judging import Episode, Judgement, JudgementInputs, Observation, judge
from service.monitoring.campaigns import Candidate, candidates_of
from service.monitoring.notifications.messages import announce
from service.monitoring.runs import counted, latest_runs, mode_effects_of, monitor_for, unit_of
from service.monitoring.tables import (
    Alarm,
    AlarmEvent,
    Monitor,
    MonitorJudgement,
    MonitorRun,
    MonitorSeries,
)
from service.nouns.campaigns.climate import CLIMATE, stated, stiffness_sds
from service.nouns.structures.operations import structure_of
from service.platform.access import Lookup, User, audit
from service.platform.errors import Conflict, NotFound
from service.platform.queue.kinds import CORE_LIBRARIES, JobKind
from service.platform.queue.queue import enqueue
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from service.nouns.structures.operations import Structure

GRACE = 1.5
"""A campaign is late when this many expected intervals have passed since the one before."""

FIRST = 10
"""Priority of a judgement among a project's jobs: it is short, and somebody may wait for its
alarm.
"""


def judge_if_changed(
    session: Session, monitor: Monitor, series: MonitorSeries, now: datetime
) -> None:
    """Queue a judgement if there is something new to judge. The transaction holds the monitor's
    row.
    """
    runs = latest_runs(session, series)
    if any(run.state == "running" for run in runs.values()):
        return
    pairs = counted(candidates_of(session, monitor, now, timedelta(0)), runs)
    if not pairs and series.digest is None:
        return
    digest = _digest(session, monitor, pairs, now)
    if digest == series.digest:
        return
    state, last_digest = _last(session, series)
    if state in ("queued", "running"):
        return
    if state == "failed" and last_digest == digest:
        set_state(session, monitor, "no data")  # what cannot be judged is not known to be well
        return
    job = enqueue(
        session, kind=JUDGE, project_id=monitor_for.project_of(session, monitor), priority=FIRST
    )
    session.add(MonitorJudgement(id=job.id, series_id=series.id, digest=digest))
    session.flush()


def _last(session: Session, series: MonitorSeries) -> tuple[str | None, str | None]:
    """How the latest judgement stands, and of what it was."""
    last = session.execute(
        select(Job.state, MonitorJudgement.digest)
        .join(Job, Job.id == MonitorJudgement.id)
        .where(MonitorJudgement.series_id == series.id)
        .order_by(MonitorJudgement.id.desc())
        .limit(1)
    ).one_or_none()
    return (None, None) if last is None else (last[0], last[1])


def _digest(
    session: Session, monitor: Monitor, pairs: list[tuple[Candidate, MonitorRun]], now: datetime
) -> str:
    """Of everything that a judgement depends on."""
    used = {
        "runs": [
            [
                str(run.id),
                one.campaign.performed_at and one.campaign.performed_at.isoformat(),
                *(getattr(one.campaign, name) for name in CLIMATE),
            ]
            for one, run in pairs
        ],
        "watch": monitor.watch,
        "interval": monitor.expected_interval_days,
        "acknowledged": [str(alarm.id) for alarm in _acknowledged(session, monitor)],
        "late": _late(monitor, pairs, now),
    }
    return hashlib.sha256(json.dumps(used, sort_keys=True).encode()).hexdigest()


def _late(monitor: Monitor, pairs: list[tuple[Candidate, MonitorRun]], now: datetime) -> int:
    """How many campaigns should have come since the last one."""
    if monitor.expected_interval_days is None or not pairs:
        return 0
    last = pairs[-1][0].campaign.performed_at
    assert last is not None
    intervals = (now - last) / timedelta(days=monitor.expected_interval_days)
    return max(0, int(intervals - GRACE) + 1) if intervals > GRACE else 0


def _acknowledged(session: Session, monitor: Monitor) -> list[Alarm]:
    return list(
        session.scalars(
            select(Alarm)
            .where(
                Alarm.monitor_id == monitor.id,
                Alarm.acknowledged_at.is_not(None),
                Alarm.state != "withdrawn",
            )
            .order_by(Alarm.acknowledged_at)
        )
    )


def _load(session: Session, job_id: UUID, _workspace: Path) -> JudgementInputs:
    row = session.get_one(MonitorJudgement, job_id)
    series = session.get_one(MonitorSeries, row.series_id)
    monitor = session.get_one(Monitor, series.monitor_id)
    now = datetime.now(UTC)
    runs = latest_runs(session, series)
    pairs = counted(candidates_of(session, monitor, now, timedelta(0)), runs)
    row.digest = _digest(session, monitor, pairs, now)  # what is judged is what is there now
    described = pairs[: monitor.watch["baseline"]]
    arrival = _arrival(session, series)
    pairs.sort(key=lambda pair: arrival[pair[0].campaign.id])
    watch = watch_of(monitor)
    return JudgementInputs(
        observations=tuple(_observation(one, run) for one, run in pairs),
        watch=watch,
        as_of=now,
        acknowledged=tuple(_acknowledgement(alarm) for alarm in _acknowledged(session, monitor)),
        notes=tuple(_notes(series, pairs)),
        mode_effects=mode_effects_of(session, described[-1][1]) if described else None,
        not_given=stiffness_sds(watch.covariates),
    )


def watch_of(monitor: Monitor) -> Watch:
    """The recipe of the judgement as the core takes it."""
    stored = {**monitor.watch, "chart": CoreChart(**monitor.watch["chart"])}
    return Watch(
        **{**stored, "covariates": tuple(stored["covariates"])},
        expected_interval_days=monitor.expected_interval_days,
    )


def _arrival(session: Session, series: MonitorSeries) -> dict[UUID, UUID]:
    """Key of each campaign's first run: the order in which campaigns came in."""
    rows = session.execute(
        select(MonitorRun.campaign_id, MonitorRun.id)
        .where(MonitorRun.series_id == series.id)
        .ext(distinct_on(MonitorRun.campaign_id))
        .order_by(MonitorRun.campaign_id, MonitorRun.id)
    )
    return dict(rows.all())


def _observation(one: Candidate, run: MonitorRun) -> Observation:
    campaign = one.campaign
    assert campaign.performed_at is not None
    return Observation(
        campaign=str(campaign.id),
        performed_at=campaign.performed_at,
        values=run.values or {},
        covariates=stated(campaign),
    )


def _acknowledgement(alarm: Alarm) -> Acknowledgement:
    """An acknowledgement on the campaigns' time axis: not before the campaign that raised the
    alarm.
    """
    raised = datetime.fromisoformat(alarm.details["performed_at"])
    assert alarm.acknowledged_at is not None
    return Acknowledgement(alarm.parameter, max(alarm.acknowledged_at, raised))


def _notes(series: MonitorSeries, pairs: list[tuple[Candidate, MonitorRun]]) -> Iterator[str]:
    for one, run in pairs:
        if run.revision > 1:
            yield (
                f"campaign {one.campaign.id} was run again (revision {run.revision}); its earlier"
                " values no longer count"
            )
    others: dict[str, list[str]] = {}
    for one, run in pairs:
        if run.software not in (None, series.software):
            others.setdefault(str(run.software), []).append(str(one.campaign.id))
    for software, campaigns in others.items():
        yield (
            f"version {series.software} opened this series, {software} ran campaign"
            f" {', '.join(campaigns)}; a rerun makes a uniform series"
        )


def _store(session: Session, job_id: UUID, items: Iterator[Judgement]) -> None:
    """Document, state, alarms and messages: all or nothing."""
    (judgement,) = items
    row = session.get_one(MonitorJudgement, job_id)
    series = session.get_one(MonitorSeries, row.series_id)
    monitor = session.get_one(
        Monitor, series.monitor_id, with_for_update=True, populate_existing=True
    )
    if series.number < monitor.series or monitor.deleted_at is not None:
        # a later version of the series is judged already, or nobody wants to know; this one stays
        # as it was
        return
    series.document, series.digest, series.assessed_at = (
        judgement.document,
        row.digest,
        datetime.now(UTC),
    )
    monitor.series = series.number
    update_alarms(session, monitor, series, judgement.episodes)
    set_state(session, monitor, judgement.state)


def set_state(session: Session, monitor: Monitor, state: str) -> None:
    """Set a monitor's state, and announce it where nothing else does."""
    if monitor.state == state:
        return
    before, monitor.state, monitor.state_rank = monitor.state, state, rank(state)
    monitor.state_since = datetime.now(UTC)
    state_changed(session, monitor, before)
    session.flush()


def rank(state: str) -> int:
    """0 for the state that asks most for attention."""
    return WORST_FIRST.index(State(state))


JUDGE = JobKind("judge", load=_load, compute=judge, store=_store, libraries=CORE_LIBRARIES)


alarm_for = Lookup(Alarm, "alarm", "monitor_id", monitor_for)
"""The alarm, if the user has at least a role in its project; none of a deleted monitor."""


def update_alarms(
    session: Session, monitor: Monitor, series: MonitorSeries, episodes: Sequence[Episode]
) -> None:
    """Bring a monitor's alarms to what its series now says.

    An episode is the alarm that its campaign raised before, whichever series said so; else the
    oldest one of its parameter that has lost its campaign to a late or corrected one; else it is
    new. An alarm that no episode is left for is withdrawn.
    """
    rows = session.scalars(
        select(Alarm)
        .where(Alarm.monitor_id == monitor.id, Alarm.state != "withdrawn")
        .order_by(Alarm.id)
    ).all()
    known = {(alarm.parameter, str(alarm.campaign_id)): alarm for alarm in rows}
    alarmed = {(e.parameter, e.campaign) for e in episodes}
    orphans = [alarm for key, alarm in known.items() if key not in alarmed]
    for episode in episodes:
        alarm = known.get((episode.parameter, episode.campaign)) or _adopt(
            session, orphans, episode
        )
        if alarm is None:
            _raise(session, monitor, series, episode)
        else:
            alarm.details, alarm.series = episode.details, series.number
            if alarm.state == "acknowledged" and episode.state == "cleared":
                _step(session, monitor, alarm, "cleared", "the parameter came back")
            elif alarm.state == "cleared" and episode.state != "cleared":
                alarm.state = "acknowledged"
                session.add(
                    AlarmEvent(
                        alarm_id=alarm.id, event="reopened", note="late or corrected campaigns"
                    )
                )
    for alarm in orphans:
        if alarm.state != "cleared":
            why = f"series {series.number} as it stands now does not confirm it"
            _step(session, monitor, alarm, "withdrawn", why)
    session.flush()


def _adopt(session: Session, orphans: list[Alarm], episode: Episode) -> Alarm | None:
    for alarm in orphans:
        if alarm.parameter == episode.parameter and alarm.state != "cleared":
            orphans.remove(alarm)
            note = f"campaign {episode.campaign} raises it now; before it was {alarm.campaign_id}"
            alarm.campaign_id = UUID(episode.campaign)
            session.add(AlarmEvent(alarm_id=alarm.id, event="moved", note=note))
            session.flush()
            return alarm
    return None


def _raise(session: Session, monitor: Monitor, series: MonitorSeries, episode: Episode) -> None:
    alarm = Alarm(
        monitor_id=monitor.id,
        parameter=episode.parameter,
        campaign_id=UUID(episode.campaign),
        series=series.number,
        state="alarm",
        details=episode.details,
    )
    session.add(alarm)
    session.flush()
    session.refresh(alarm)
    _record(session, monitor, alarm, "raised", None, f"by campaign {episode.campaign}")


def _step(
    session: Session,
    monitor: Monitor,
    alarm: Alarm,
    state: str,
    note: str,
    user: User | None = None,
) -> None:
    alarm.state = state
    _record(session, monitor, alarm, state, user, note)


def _record(
    session: Session, monitor: Monitor, alarm: Alarm, event: str, user: User | None, note: str
) -> None:
    """Write a step into the history, the audit trail and the outbox."""
    structure = structure_of(session, monitor.structure_id)
    session.add(AlarmEvent(alarm_id=alarm.id, event=event, user_id=user and user.id, note=note))
    audit(
        session,
        user,
        f"alarm.{event}",
        "alarm",
        alarm.id,
        structure.project_id,
        parameter=alarm.parameter,
        note=note,
    )
    data = {"alarm": _summary(alarm), "note": note, "by": user and user.name}
    _announce(session, monitor, structure, f"alarm.{event}", data)


def _announce(
    session: Session, monitor: Monitor, structure: Structure, event: str, data: dict[str, Any]
) -> None:
    project_id = structure.project_id
    about = {
        "project_id": str(project_id),
        "structure": {"id": str(structure.id), "name": structure.name},
        "monitor": {"id": str(monitor.id), "name": monitor.name, "state": monitor.state},
    }
    data = {**about, **data}
    announce(
        session,
        event,
        data,
        project_id=project_id,
        monitor_id=monitor.id,
        receivers=monitor.receivers,
    )


def _summary(alarm: Alarm) -> dict[str, Any]:
    return {
        "id": str(alarm.id),
        "parameter": alarm.parameter,
        "unit": unit_of(alarm.parameter),
        "campaign_id": str(alarm.campaign_id),
        "series": alarm.series,
        "state": alarm.state,
        "details": alarm.details,
    }


def state_changed(session: Session, monitor: Monitor, before: str) -> None:
    """Announce that data stopped coming: silence would look like health."""
    if monitor.state == "no data":
        structure = structure_of(session, monitor.structure_id)
        _announce(session, monitor, structure, "monitor.no_data", {"before": before})


def acknowledge(session: Session, user: User, alarm: Alarm, note: str) -> None:
    """Note that somebody has seen an alarm. The monitor is judged anew with it.

    Raises:
        Conflict: it is no alarm, or no longer one.
        NotFound: its monitor has been deleted in between.
    """
    monitor = session.get_one(Monitor, alarm.monitor_id)
    # a judgement changes alarms too; first the monitor's row, always
    session.refresh(monitor, with_for_update=True)
    if monitor.deleted_at is not None:
        raise NotFound("alarm", alarm.id)
    session.refresh(alarm, with_for_update=True)
    if alarm.state != "alarm":
        raise Conflict(f"the alarm is {alarm.state}; only one that is open can be acknowledged")
    alarm.acknowledged_at, alarm.acknowledged_by, alarm.note = datetime.now(UTC), user.id, note
    _step(session, monitor, alarm, "acknowledged", note, user)
    session.flush()
