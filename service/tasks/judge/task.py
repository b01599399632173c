"""Judging a series: a job whose result, states, alarms and messages are one transaction.

A series is judged when what it would be judged on differs from what it was judged on last: a new
value, a corrected temperature, a deleted campaign, an acknowledgement, a campaign that has become
late. While runs are under way it waits for them, so a backfill is judged once and in time order.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.trend import Acknowledgement, Watch
from fecore.trend import Chart as CoreChart
from service.nouns.campaigns.climate import CLIMATE, stated, stiffness_sds
from service.nouns.modes.operations import modes_of, shape_of
from service.nouns.monitors.alarms import acknowledged, set_state, update_alarms
from service.nouns.monitors.candidates import Candidate, candidates_of
from service.nouns.monitors.judgements import judged, last_judgement, note_judgement
from service.nouns.monitors.runs import arrival_of, counted, latest_runs, monitor_for
from service.nouns.updates.operations import arrays_of
from service.platform.queue.kinds import CORE_LIBRARIES, JobKind
from service.platform.queue.queue import enqueue
from service.tasks.judge.compute import (
    Judgement,
    JudgementInputs,
    ModeEffects,
    Observation,
    judge,
)

if TYPE_CHECKING:
    from service.nouns.monitors.tables import Alarm, Monitor, MonitorRun, MonitorSeries

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
    last = last_judgement(session, series)
    if last is not None and last.state in ("queued", "running"):
        return
    if last is not None and last.state == "failed" and last.digest == digest:
        set_state(session, monitor, "no data")  # what cannot be judged is not known to be well
        return
    job = enqueue(
        session, kind=TASK, project_id=monitor_for.project_of(session, monitor), priority=FIRST
    )
    note_judgement(session, job.id, series, digest)


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
                *([one.campaign.covariates] if one.campaign.covariates else []),
            ]
            for one, run in pairs
        ],
        "watch": monitor.watch,
        "interval": monitor.expected_interval_days,
        "acknowledged": [str(alarm.id) for alarm in acknowledged(session, monitor)],
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


def _load(session: Session, job_id: UUID, _workspace: Path) -> JudgementInputs:
    row, series, monitor = judged(session, job_id)
    now = datetime.now(UTC)
    runs = latest_runs(session, series)
    pairs = counted(candidates_of(session, monitor, now, timedelta(0)), runs)
    row.digest = _digest(session, monitor, pairs, now)  # what is judged is what is there now
    described = pairs[: monitor.watch["baseline"]]
    arrival = arrival_of(session, series)
    pairs.sort(key=lambda pair: arrival[pair[0].campaign.id])
    watch = watch_of(monitor)
    return JudgementInputs(
        observations=tuple(_observations(session, pairs)),
        watch=watch,
        as_of=now,
        acknowledged=tuple(_acknowledgement(alarm) for alarm in acknowledged(session, monitor)),
        notes=tuple(_notes(series, pairs)),
        mode_effects=_mode_effects_of(session, described[-1][1]) if described else None,
        of_modes=monitor.watches == "modes",
        not_given=stiffness_sds(watch.covariates),
    )


def watch_of(monitor: Monitor) -> Watch:
    """The recipe of the judgement as the core takes it."""
    stored = {**monitor.watch, "chart": CoreChart(**monitor.watch["chart"])}
    return Watch(
        **{**stored, "covariates": tuple(stored["covariates"])},
        expected_interval_days=monitor.expected_interval_days,
    )


def _mode_effects_of(session: Session, run: MonitorRun) -> ModeEffects | None:
    """What would move a run's frequencies; None of a run of a version that did not keep it."""
    arrays = None if run.update_job_id is None else arrays_of(session, run.update_job_id)
    if arrays is None or "mass_effects" not in arrays:
        return None
    stiffness, support = (
        dict(zip(arrays[f"{kind}_names"].tolist(), arrays[f"{kind}_effects"], strict=True))
        for kind in ("stiffness", "support")
    )
    return ModeEffects(
        str(run.campaign_id), stiffness, support, arrays["mass_sites_m"], arrays["mass_effects"]
    )


def _observations(
    session: Session, pairs: list[tuple[Candidate, MonitorRun]]
) -> Iterator[Observation]:
    """What each run saw; of a monitor of modes with their shapes, which its values leave where they
    are.
    """
    values_of = {run.id: run.values or {} for _, run in pairs}
    sets = [UUID(each["mode_set"]) for each in values_of.values() if "mode_set" in each]
    shapes = {
        key: tuple(shape_of(mode) for mode in modes)
        for key, modes in (modes_of(session, sets).items() if sets else ())
    }
    for one, run in pairs:
        campaign, values = one.campaign, values_of[run.id]
        assert campaign.performed_at is not None
        yield Observation(
            campaign=str(campaign.id),
            performed_at=campaign.performed_at,
            values=values,
            covariates=stated(campaign),
            shapes=shapes.get(UUID(values["mode_set"]), ()) if "mode_set" in values else (),
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
    row, series, monitor = judged(session, job_id, lock=True)
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


TASK = JobKind("judge", load=_load, compute=judge, store=_store, libraries=CORE_LIBRARIES)
