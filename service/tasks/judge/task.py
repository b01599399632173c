"""Judging a series: a job whose result, states, alarms and messages are one transaction.

A series is judged when what it would be judged on differs from what it was judged on last: a new
value, a corrected temperature, a deleted campaign, an acknowledgement, a campaign that has become
late. While runs are under way it waits for them, so a backfill is judged once and in time order.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy.orm import Session

from fecore import __version__
from fecore.trend import Acknowledgement, Limits, Watch, Window
from fecore.trend import Chart as CoreChart
from fecore.trend.assessment import ALL
from fecore.trend.series import listed
from service.nouns.campaigns.climate import stiffness_sds
from service.nouns.modes.operations import modes_of, shape_of
from service.nouns.monitors.alarms import acknowledged, set_state, update_alarms
from service.nouns.monitors.counted import (
    Counted,
    counted,
    counted_digest,
    is_under_way,
    update_job_of,
    values_of_runs,
)
from service.nouns.monitors.followed import (
    chained,
    keep_tracks,
    place_to_go_on,
    state_after,
    tracks_of,
)
from service.nouns.monitors.judgements import judged, last_judgement, note_judgement
from service.nouns.monitors.points import counts_of, keep_points, left_before
from service.nouns.monitors.runs import arrival_of, monitor_for
from service.nouns.updates.operations import arrays_of
from service.platform.queue.kinds import CORE_LIBRARIES, JobKind
from service.platform.queue.queue import enqueue
from service.tasks.judge.compute import Judgement, judge
from service.tasks.judge.inputs import JudgementInputs, ModeEffects, Observation

if TYPE_CHECKING:
    from service.nouns.monitors.tables import Alarm, Monitor, MonitorSeries

GRACE = 1.5
"""A campaign is late when this many expected intervals have passed since the one before."""

FIRST = 10
"""Priority of a judgement among a project's jobs: it is short, and somebody may wait for its
alarm.
"""


WINDOW, BETWEEN = 500, 200
"""The last campaigns of a long series of modes, which are judged anew each time, and how many of
those between the baseline's and these say how fast a parameter changes.
"""

BEYOND = 200
"""A baseline is made within four times as many runs as it has, and these."""

FOLLOWED_AT_ONCE = 2000
"""Runs that one judgement follows at most; the next one goes on, so memory is bounded."""


def judge_if_changed(
    session: Session, monitor: Monitor, series: MonitorSeries, now: datetime
) -> None:
    """Queue a judgement if there is something new to judge. The transaction holds the monitor's
    row.
    """
    if is_under_way(session, series):
        return
    digest = _digest(session, monitor, series, now)
    if digest is None or digest == series.digest:
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


def _digest(session: Session, monitor: Monitor, series: MonitorSeries, now: datetime) -> str | None:
    """Of everything that a judgement depends on; None where there never was anything to judge."""
    campaigns, last = counted_digest(session, monitor, series)
    if campaigns is None and series.digest is None:
        return None
    used = {
        "campaigns": campaigns,
        "watch": monitor.watch,
        "interval": monitor.expected_interval_days,
        "acknowledged": [str(alarm.id) for alarm in acknowledged(session, monitor)],
        "late": _late(monitor, last, now),
    }
    return hashlib.sha256(json.dumps(used, sort_keys=True).encode()).hexdigest()


def _late(monitor: Monitor, last: datetime | None, now: datetime) -> int:
    """How many campaigns should have come since the last one."""
    if monitor.expected_interval_days is None or last is None:
        return 0
    intervals = (now - last) / timedelta(days=monitor.expected_interval_days)
    return max(0, int(intervals - GRACE) + 1) if intervals > GRACE else 0


@dataclass(frozen=True)
class _Extent:
    """Which campaigns of a series a judgement takes, by their places in the order of time."""

    taken: Sequence[int]  # their places
    place: int  # of the first that is not followed yet
    end: int  # after the last one
    window: Window


def _load(session: Session, job_id: UUID, _workspace: Path) -> JudgementInputs:
    row, series, monitor = judged(session, job_id)
    now = datetime.now(UTC)
    watch, of_modes = watch_of(monitor), monitor.watches == "modes"
    entries = counted(session, monitor, series)
    seen = [_acknowledgement(alarm) for alarm in acknowledged(session, monitor)]
    seed = f"{__version__} {json.dumps(monitor.watch)} {monitor.expected_interval_days}"
    chain = chained(seed, entries, sorted((each.date, each.parameter) for each in seen))
    place = place_to_go_on(session, series, entries, chain) if of_modes else 0
    extent = _extent(entries, place, watch.baseline if of_modes else None)
    # what is judged is what is there now, unless more follows
    row.digest = (
        (_digest(session, monitor, series, now) or "") if extent.end == len(entries) else ""
    )
    left = {}
    if extent.window.after is not None:
        known = counts_of(session, series)
        left = left_before(session, series, known, extent.window.after)
    taken = [(entries[at], chain[at], at >= place) for at in extent.taken]
    arrival = arrival_of(session, series, [entry.campaign_id for entry, *_ in taken])
    taken.sort(key=lambda each: arrival[each[0].campaign_id])
    described = entries[: watch.baseline]
    return JudgementInputs(
        observations=tuple(_observations(session, taken, of_modes=of_modes)),
        watch=watch,
        as_of=now if extent.end == len(entries) else entries[extent.end - 1].performed_at,
        acknowledged=tuple(seen),
        notes=tuple(_notes(series, [entry for entry, *_ in taken], len(entries) - extent.end)),
        mode_effects=_mode_effects_of(session, described[-1]) if described else None,
        of_modes=of_modes,
        not_given=stiffness_sds(watch.covariates),
        following=state_after(session, entries[place - 1].run_id) if place else None,
        place=place,
        window=replace(
            extent.window,
            before={name: one for name, (one, _) in left.items()},
            limits=_known_limits(series, {str(each.campaign_id) for each in entries[:place]}),
        ),
        raised={name: raised for name, (_, raised) in left.items() if raised is not None},
        after=entries[place - 1].performed_at if place else None,
        end=entries[extent.end - 1].performed_at if extent.end < len(entries) else None,
    )


def _known_limits(series: MonitorSeries, as_before: set[str]) -> dict[str, tuple[Limits, float]]:
    """Limits of the parameters whose baseline's campaigns are all among those that are as they
    were; to find them takes longer than all else.
    """
    rows = (series.document or {"parameters": ()})["parameters"]
    return {
        row["name"]: (
            Limits(row["limits"]["chart"], row["limits"]["score"] or math.inf),
            row["autocorrelation"]["limits_widened_by"],
        )
        for row in rows
        if row["baseline"] is not None and as_before.issuperset(row["baseline"]["campaign_ids"])
    }


def _extent(entries: Sequence[Counted], place: int, baseline: int | None) -> _Extent:
    """What a judgement takes: all, or of a long series of modes the first campaigns, which make the
    baseline, some between, and the last ones.
    """
    n = len(entries)
    if baseline is None:
        return _Extent(range(n), 0, n, ALL)
    first = 4 * baseline + BEYOND
    end = min(n, place + FOLLOWED_AT_ONCE)
    until = entries[first - 1].performed_at if n >= first else None
    begin = min(place, end - WINDOW)
    if begin <= first + BETWEEN:
        return _Extent(range(end), place, end, Window(None, baseline_until=until))
    between = range(first, begin, math.ceil((begin - first) / BETWEEN))
    window = Window(entries[begin - 1].performed_at, baseline_until=until)
    return _Extent([*range(first), *between, *range(begin, end)], place, end, window)


def watch_of(monitor: Monitor) -> Watch:
    """The recipe of the judgement as the core takes it."""
    stored = {**monitor.watch, "chart": CoreChart(**monitor.watch["chart"])}
    return Watch(
        **{**stored, "covariates": tuple(stored["covariates"])},
        expected_interval_days=monitor.expected_interval_days,
    )


def _mode_effects_of(session: Session, entry: Counted) -> ModeEffects | None:
    """What would move a run's frequencies; None of a run of a version that did not keep it."""
    key = update_job_of(session, entry.run_id)
    arrays = None if key is None else arrays_of(session, key)
    if arrays is None or "mass_effects" not in arrays:
        return None
    stiffness, support = (
        dict(zip(arrays[f"{kind}_names"].tolist(), arrays[f"{kind}_effects"], strict=True))
        for kind in ("stiffness", "support")
    )
    return ModeEffects(
        str(entry.campaign_id), stiffness, support, arrays["mass_sites_m"], arrays["mass_effects"]
    )


def _observations(
    session: Session, taken: Sequence[tuple[Counted, bytes, bool]], *, of_modes: bool
) -> Iterator[Observation]:
    """What each run saw; of a monitor of modes with its tracks, or with the shapes by which it is
    to be followed, which its values leave where they are.
    """
    runs = [entry.run_id for entry, *_ in taken]
    values_of = values_of_runs(session, runs)
    tracks = tracks_of(session, runs) if of_modes else {}
    new = [values_of[entry.run_id] for entry, _, fresh in taken if fresh]
    sets = [UUID(each["mode_set"]) for each in new if "mode_set" in each]
    shapes = {
        key: tuple(shape_of(mode) for mode in modes)
        for key, modes in (modes_of(session, sets).items() if sets else ())
    }
    for entry, link, fresh in taken:
        values = values_of[entry.run_id]
        yield Observation(
            campaign=str(entry.campaign_id),
            performed_at=entry.performed_at,
            values=values,
            covariates={
                name: math.nan if value is None else float(value)
                for name, value in {**values.get("covariates", {}), **entry.conditions}.items()
            },
            shapes=shapes.get(UUID(values["mode_set"]), ()) if "mode_set" in values else (),
            run=str(entry.run_id),
            chain=link.hex(),
            tracks=None if fresh else tracks.get(entry.run_id),
        )


def _acknowledgement(alarm: Alarm) -> Acknowledgement:
    """An acknowledgement on the campaigns' time axis: not before the campaign that raised the
    alarm.
    """
    raised = datetime.fromisoformat(alarm.details["performed_at"])
    assert alarm.acknowledged_at is not None
    return Acknowledgement(alarm.parameter, max(alarm.acknowledged_at, raised))


def _notes(series: MonitorSeries, entries: Sequence[Counted], to_come: int) -> Iterator[str]:
    if to_come:
        yield f"{to_come} later campaigns are still to be judged"
    again = [entry for entry in entries if entry.revision > 1]
    for entry in again[-_NOTED:]:
        yield (
            f"campaign {entry.campaign_id} was run again (revision {entry.revision}); its earlier"
            " values no longer count"
        )
    others: dict[str, list[str]] = {}
    for entry in entries:
        if entry.software not in (None, series.software):
            others.setdefault(str(entry.software), []).append(str(entry.campaign_id))
    for software, campaigns in others.items():
        yield (
            f"version {series.software} opened this series, {software} ran campaign"
            f" {listed(campaigns)}; a rerun makes a uniform series"
        )


_NOTED = 20  # runs that were corrected, each in a note


def _store(session: Session, job_id: UUID, items: Iterator[Judgement]) -> None:
    """Document, state, alarms and messages: all or nothing."""
    (judgement,) = items
    row, series, monitor = judged(session, job_id, lock=True)
    if series.number < monitor.series or monitor.deleted_at is not None:
        # a later version of the series is judged already, or nobody wants to know; this one stays
        # as it was
        return
    rebased = _rebased(series.document, judgement.document)
    series.document, series.digest, series.assessed_at = (
        judgement.document,
        row.digest,
        datetime.now(UTC),
    )
    monitor.series = series.number
    keep_points(session, series, judgement.points)
    keep_tracks(session, series, judgement.followed, judgement.place)
    update_alarms(session, monitor, series, judgement.episodes, judgement.within, rebased)
    set_state(session, monitor, judgement.state)


def _rebased(before: dict[str, Any] | None, after: dict[str, Any]) -> dict[str, str]:
    """By parameter, in words, which campaigns a late or corrected one has brought into its baseline
    and which it has put out.
    """
    was, now = (_baselines(document or {}) for document in (before, after))
    words = {}
    for name in was.keys() & now.keys():
        parts = [
            f"{listed(sorted(keys))} {where}"
            for keys, where in (
                (now[name] - was[name], "is in the baseline now"),
                (was[name] - now[name], "no longer"),
            )
            if keys
        ]
        if parts:
            words[name] = f": campaign {', '.join(parts)}"
    return words


def _baselines(document: dict[str, Any]) -> dict[str, set[str]]:
    return {
        row["name"]: set(row["baseline"]["campaign_ids"])
        for row in document.get("parameters", ())
        if row["baseline"] is not None
    }


TASK = JobKind("judge", load=_load, compute=judge, store=_store, libraries=CORE_LIBRARIES)
