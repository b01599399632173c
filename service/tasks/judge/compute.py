"""The computation of a judgement, in the worker's child process: no database, no web.

Runs in, the series document out: each watched parameter with its baseline, scores, chart, states,
change point and rate, and the episodes of alarm, which the store turns into alarms.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any
from uuid import UUID

import numpy as np

from fecore.trend import (
    Acknowledgement,
    Assessment,
    Direction,
    Following,
    ModesOfRun,
    Moment,
    ParameterTrend,
    Series,
    State,
    TrackedMode,
    Tracks,
    assess,
    mode_series,
    worst,
)
from fecore.trend.document import describe_change, describe_judged, describe_rate, describe_trend
from fecore.trend.mode_series import EXACT, day_of
from fecore.trend.series import came_late, late_note, listed
from service.platform.queue.kinds import Reporter
from service.tasks.judge.causes import causes_of, same_mode
from service.tasks.judge.inputs import JudgementInputs, Observation


@dataclass(frozen=True)
class Episode:
    """An alarm of a parameter, from the campaign that raised it."""

    parameter: str  # which
    campaign: str  # id of the campaign that raised it
    state: str  # `alarm`, `acknowledged`, or `cleared` where the parameter came back
    # for whoever gets the alarm; None of one that a campaign before the window raised
    details: dict[str, Any] | None


@dataclass(frozen=True)
class Judgement:
    """The outcome of a judgement, ready to be stored."""

    document: dict[str, Any]
    episodes: tuple[Episode, ...]
    state: str
    # by parameter, after when its points are new (None: all), and these
    points: Mapping[str, tuple[datetime | None, Sequence[dict[str, Any]]]] = field(
        default_factory=dict
    )
    followed: Sequence[dict[str, Any]] = ()  # runs that were followed, as they are stored
    place: int = 0  # of the first of them in the series
    # after which campaign, and up to which one, alarms were judged; None: all
    within: tuple[datetime | None, datetime | None] = (None, None)


def judge(inputs: JudgementInputs, report: Reporter) -> Iterator[Judgement]:
    """Judge a series."""
    report("judging", 0.1)
    notes = list(inputs.notes)
    came = inputs.observations
    late = came_late([each.performed_at for each in came], [each.campaign for each in came])
    in_order = sorted(came, key=lambda each: each.performed_at)
    inputs = replace(inputs, observations=tuple(in_order))
    followed: list[dict[str, Any]] = []
    if inputs.of_modes:
        inputs, followed = _followed(inputs)
        series, inputs, remarks = _tracked(inputs)
        notes += remarks
    else:
        series = {}
        for name in inputs.watch.directions:
            usable, remarks = _series(name, inputs)
            notes += remarks
            if usable is not None:
                series[name] = usable
    assessment = _assessment(series, inputs) if series else Assessment({})
    notes += assessment.notes
    trends = assessment.parameters
    if late:
        notes.append(_of_late(late, trends.values()))
    states = [trend.state for trend in trends.values()]
    states += [State.NO_DATA] * (len(inputs.watch.directions) - len(trends))
    state = worst(tuple(states)).value
    described = {name: describe_trend(trend) for name, trend in trends.items()}
    points = {
        name: _new_points(trend, described[name].pop("points"), inputs)
        for name, trend in trends.items()
    }
    yield Judgement(
        document={"state": state, "notes": notes, "parameters": [*described.values()]},
        episodes=tuple(e for trend in trends.values() for e in _episodes(trend, inputs, trends)),
        state=state,
        points=points,
        followed=followed,
        place=inputs.place,
        within=(inputs.window.after, inputs.end),
    )


def _of_late(late: Sequence[str], trends: Iterable[ParameterTrend]) -> str:
    """That campaigns came late, and which of them are in a baseline."""
    based = {label for each in trends if each.baseline for label in each.baseline.labels}
    inside = [label for label in late if label in based]
    return late_note(late) + (f", with {listed(inside)} in the baseline" if inside else "")


def _followed(inputs: JudgementInputs) -> tuple[JudgementInputs, list[dict[str, Any]]]:
    """The inputs with all runs followed, and those that were not before, in the order of time."""
    following = Following() if not inputs.following else Following.from_document(inputs.following)
    rows = []
    tracks = {}
    new = [each for each in inputs.observations if each.tracks is None]
    for each in sorted(new, key=lambda each: each.performed_at):
        run = _modes_of(each)
        following, numbers, identity = following.after(run.modes, day_of(each.performed_at))
        tracks[each.campaign] = numbers, identity
        rows.append(
            {
                "run_id": UUID(each.run),
                "performed_at": each.performed_at,
                "chain": bytes.fromhex(each.chain),
                "numbers": list(numbers),
                "identity_sd": list(identity),
                "state": following.document(),
            }
        )
    observations = tuple(
        each if each.tracks is not None else replace(each, tracks=tracks[each.campaign])
        for each in inputs.observations
    )
    return replace(inputs, observations=observations), rows


def _new_points(
    trend: ParameterTrend, points: Sequence[dict[str, Any]], inputs: JudgementInputs
) -> tuple[datetime | None, list[dict[str, Any]]]:
    """After when a parameter's points are new, and these, each with the condition from then on."""
    after = inputs.after
    if after is not None and inputs.window.after is None:
        based = trend.baseline
        by_label = dict(zip(trend.series.labels, trend.series.dates, strict=True))
        if based is None or by_label[based.labels[-1]] > after:
            after = None  # all are corrected and judged by a baseline that was not there
    conditions = _conditions(trend, inputs)
    dates = trend.series.dates
    return after, [
        {**point, "condition": conditions.get(point["campaign_id"])}
        for point, date in zip(points, dates, strict=True)
        if after is None or date > after
    ]


def _conditions(trend: ParameterTrend, inputs: JudgementInputs) -> dict[str, dict[str, Any]]:
    """By campaign, the condition of a parameter from then on."""
    conditions = {}
    raised = inputs.raised.get(trend.name)
    for moment in trend.timeline:
        if moment.state is State.NORMAL:
            raised = None
        if moment.state is State.ALARM and raised is None:
            raised = moment.label
        if moment.label is not None:
            conditions[moment.label] = {
                "state": moment.state.value,
                "outside": moment.condition.outside,
                "acknowledged": moment.condition.acknowledged,
                "raised": raised,
            }
    return conditions


def _tracked(
    inputs: JudgementInputs,
) -> tuple[dict[str, Series], JudgementInputs, list[str]]:
    """Series of the modes that are watched, the inputs with each of them in its direction, and what
    is worth saying.
    """
    tracks = [each.tracks or ((), ()) for each in inputs.observations]
    followed = mode_series(
        [_modes_of(each) for each in inputs.observations],
        inputs.watch.baseline,
        Tracks([numbers for numbers, _ in tracks], [identity for _, identity in tracks]),
    )
    stated = inputs.watch.directions
    directions: dict[str, Direction] = {}
    for name in followed.series:
        direction = stated.get(name) or stated.get(name.rpartition("_")[0])
        if direction is not None:
            directions[name] = direction
    notes = [
        f"{name} is watched, and no such mode came again in the baseline"
        for name in stated
        if "_" in name.removeprefix("damping_ratio") and name not in followed.series
    ]
    notes += [
        f"a mode at {hz:.4g} Hz that the baseline had not comes again since campaign {campaign}"
        for hz, campaign in followed.newcomers
    ]
    notes += followed.notes
    if not directions:
        return {}, inputs, [*notes, "no mode has come again yet"]
    series = {name: followed.series[name] for name in directions}
    return series, replace(inputs, watch=replace(inputs.watch, directions=directions)), notes


def _modes_of(observation: Observation) -> ModesOfRun:
    rows = observation.values["modes"]
    known = len(observation.shapes) == len(rows)  # unless the mode set is gone
    shapes = observation.shapes if known else ({},) * len(rows)
    return ModesOfRun(
        observation.campaign,
        observation.performed_at,
        [
            TrackedMode(hz, shape, sd, damping_ratio=damping, damping_sd=damping_sd)
            for (hz, sd, damping, damping_sd), shape in zip(rows, shapes, strict=True)
        ],
        observation.covariates,
    )


def _assessment(series: Mapping[str, Series], inputs: JudgementInputs) -> Assessment:
    """All parameters judged, with those acknowledgements that meet an alarm: one that was withdrawn
    since meets none.
    """
    watch = replace(
        inputs.watch, directions={name: inputs.watch.directions[name] for name in series}
    )
    effective: list[Acknowledgement] = []
    assessment = assess(series, watch, inputs.as_of, window=inputs.window)
    for acknowledgement in inputs.acknowledged:
        trend = assessment.parameters.get(acknowledgement.parameter)
        if trend is not None and _state_at(trend.timeline, acknowledgement.date) is State.ALARM:
            effective.append(acknowledgement)
            assessment = assess(series, watch, inputs.as_of, effective, inputs.window)
    return assessment


def _state_at(timeline: Sequence[Moment], date: datetime) -> State:
    before = [moment.state for moment in timeline if moment.date <= date]
    return before[-1] if before else State.NO_DATA


def _series(name: str, inputs: JudgementInputs) -> tuple[Series | None, list[str]]:
    """The series of a parameter, and the campaigns that have no value of it, in words."""
    values = [_value(name, o, inputs.observations) for o in inputs.observations]
    there = [(o, v) for o, v in zip(inputs.observations, values, strict=True) if v is not None]
    without = [o.campaign for o, v in zip(inputs.observations, values, strict=True) if v is None]
    notes = [f"{name} has no value in campaign {', '.join(without)}"] if without else []
    if not there:
        return None, notes
    if any(sd is None for _, (_, sd) in there):
        notes.append(
            f"{name}: some campaigns state no standard deviation; there the scatter between"
            " campaigns decides"
        )
    estimate = np.array([v for _, (v, _) in there])
    sd = np.array([sd or max(abs(v), 1e-300) * EXACT for _, (v, sd) in there])
    covariates = {
        c: np.array([o.covariates.get(c, math.nan) for o, _ in there], float)
        for c in inputs.watch.covariates
    }
    dates, labels = [o.performed_at for o, _ in there], [o.campaign for o, _ in there]
    return Series(name, dates, estimate, sd, covariates, labels), notes


def _value(
    name: str, observation: Observation, everyone: Sequence[Observation]
) -> tuple[float, float | None] | None:
    kind, _, number = name.rpartition("_")
    if kind not in ("frequency", "damping_ratio"):
        entry = observation.values["parameters"].get(name)
        return None if entry is None else (entry[0], entry[1])
    mode = same_mode(int(number), observation, everyone)
    row = None if mode is None else observation.values["modes"][mode]
    value, sd = (None, None) if row is None else row[:2] if kind == "frequency" else row[2:]
    return None if value is None else (value, sd)


def _episodes(
    trend: ParameterTrend, inputs: JudgementInputs, trends: Mapping[str, ParameterTrend]
) -> Iterator[Episode]:
    """Stretches of the timeline from an alarm to the next normal state."""
    raised = inputs.raised.get(trend.name)
    last = State.ALARM if raised else State.NO_DATA
    for moment in trend.timeline:
        if moment.state is State.NORMAL and raised is not None:
            yield _episode(trend, raised, "cleared", inputs, trends)
            raised = None
        if moment.state is State.ALARM and raised is None:
            raised = moment.label
        last = moment.state
    if raised is not None:
        state = "alarm" if last is State.ALARM else "acknowledged"
        yield _episode(trend, raised, state, inputs, trends)


def _episode(
    trend: ParameterTrend,
    campaign: str,
    state: str,
    inputs: JudgementInputs,
    trends: Mapping[str, ParameterTrend],
) -> Episode:
    assert trend.baseline is not None
    if trend.watched is None or campaign not in trend.watched.labels:
        return Episode(trend.name, campaign, state, None)
    i = list(trend.watched.labels).index(campaign)
    details = {
        "performed_at": trend.watched.dates[i].isoformat(),
        "direction": trend.direction,
        "value": float(trend.watched.estimate[i]),
        "standard_deviation": float(trend.watched.standard_deviation[i]),
        "baseline": trend.baseline.mean,
        "baseline_sd": trend.baseline.mean_sd,
        **describe_judged(trend, i),
        "change_point": None if trend.change is None else describe_change(trend.change),
        "rate": None if trend.rate is None else describe_rate(trend.rate),
        "explanations": causes_of(trend, i, state, inputs, trends),
    }
    return Episode(trend.name, campaign, state, details)
