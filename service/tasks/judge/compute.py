"""The computation of a judgement, in the worker's child process: no database, no web.

Runs in, the series document out: each watched parameter with its baseline, scores, chart, states,
change point and rate, and the episodes of alarm, which the store turns into alarms.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.trend import (
    Acknowledgement,
    Assessment,
    Direction,
    ModesOfRun,
    Moment,
    ParameterTrend,
    Series,
    Shape,
    State,
    TrackedMode,
    Watch,
    assess,
    mode_series,
    worst,
)
from fecore.trend.document import describe_change, describe_judged, describe_rate, describe_trend
from fecore.trend.explanations import ChangeExplanation, Effects, change_of, explanations, in_words
from fecore.trend.mode_series import EXACT
from fecore.trend.patterns import FEWEST_MODES as FEWEST_OF_A_PATTERN
from fecore.trend.patterns import deviations, patterns, patterns_in_words
from fecore.trend.tracking import SAME_MODE
from service.platform.queue.kinds import Reporter


@dataclass(frozen=True)
class Observation:
    """One campaign of the series."""

    campaign: str  # its id
    performed_at: datetime  # when it was measured
    values: Mapping[str, Any]  # of `service.nouns.monitors.runs`
    covariates: Mapping[str, float]  # by name; NaN where not measured
    shapes: Sequence[Shape] = ()  # of the modes, of a monitor of modes


@dataclass(frozen=True)
class ModeEffects:
    """What would move the frequencies of one campaign's m modes
    (`fecore.updating.forecasts.FrequencyEffects`).
    """

    campaign: str  # its id
    # stiffness, support: (m,) by name
    stiffness: Mapping[str, FloatArray]
    support: Mapping[str, FloatArray]
    sites: FloatArray  # (P, 3), m
    mass: FloatArray  # (m, P)


@dataclass(frozen=True)
class JudgementInputs:
    """A series as it is to be judged."""

    # in the order in which they came in, so that late ones can be recognised
    observations: tuple[Observation, ...]
    watch: Watch  # what is watched, and how
    as_of: datetime  # now
    acknowledged: tuple[Acknowledgement, ...]  # parameter and time of acknowledgements, by time
    notes: tuple[str, ...]  # what is known to say already
    # what would move the frequencies, of one campaign of the baseline; None where no result says it
    mode_effects: ModeEffects | None = None
    # standard deviations of a relative change of all stiffness over a season by conditions that are
    # no covariates, by name
    not_given: Mapping[str, float] = field(default_factory=dict)
    # whether tracks of modes are watched: then `watch` has directions by `frequency` of all modes
    # or `frequency_2` of one
    of_modes: bool = False


@dataclass(frozen=True)
class Episode:
    """An alarm of a parameter, from the campaign that raised it."""

    parameter: str  # which
    campaign: str  # id of the campaign that raised it
    state: str  # `alarm`, `acknowledged`, or `cleared` where the parameter came back
    details: dict[str, Any]  # for whoever gets the alarm


@dataclass(frozen=True)
class Judgement:
    """The outcome of a judgement, ready to be stored."""

    document: dict[str, Any]
    episodes: tuple[Episode, ...]
    state: str


def judge(inputs: JudgementInputs, report: Reporter) -> Iterator[Judgement]:
    """Judge a series."""
    report("judging", 0.1)
    notes = list(inputs.notes)
    if inputs.of_modes:
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
    states = [trend.state for trend in trends.values()]
    states += [State.NO_DATA] * (len(inputs.watch.directions) - len(trends))
    state = worst(tuple(states)).value
    document = {
        "state": state,
        "notes": notes,
        "parameters": [describe_trend(trend) for trend in trends.values()],
    }
    yield Judgement(
        document,
        tuple(e for trend in trends.values() for e in _episodes(trend, inputs, trends)),
        state,
    )


def _tracked(
    inputs: JudgementInputs,
) -> tuple[dict[str, Series], JudgementInputs, list[str]]:
    """Series of the modes that are watched, the inputs with each of them in its direction, and what
    is worth saying.
    """
    followed = mode_series([_modes_of(each) for each in inputs.observations], inputs.watch.baseline)
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
    assessment = assess(series, watch, inputs.as_of)
    for acknowledgement in inputs.acknowledged:
        trend = assessment.parameters.get(acknowledgement.parameter)
        if trend is not None and _state_at(trend.timeline, acknowledgement.date) is State.ALARM:
            effective.append(acknowledgement)
            assessment = assess(series, watch, inputs.as_of, effective)
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
    raised: str | None = None
    last = State.NO_DATA
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
    assert trend.watched is not None
    assert trend.baseline is not None
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
        "explanations": _explained(trend, i, state, inputs, trends),
    }
    return Episode(trend.name, campaign, state, details)


def _explained(
    trend: ParameterTrend,
    raised: int,
    state: str,
    inputs: JudgementInputs,
    trends: Mapping[str, ParameterTrend],
) -> dict[str, Any] | None:
    """What may have caused an alarm that still stands: of the campaigns since its change, or since
    it was raised.
    """
    if state == "cleared" or (inputs.mode_effects is None and not inputs.of_modes):
        return None
    assert trend.watched is not None
    assert trend.baseline is not None
    first = raised if trend.change is None else min(raised, trend.change.index)
    if inputs.mode_effects is None:
        return _pattern(trends, trend.watched.dates[first])
    return explained(
        inputs.observations,
        inputs.mode_effects,
        trend.baseline.labels,
        trend.watched.labels[first:],
        inputs.watch.covariates,
        inputs.not_given,
    )


def _pattern(trends: Mapping[str, ParameterTrend], since: datetime) -> dict[str, Any] | None:
    """What moved since a change, of modes that no model explains; None where too few are there."""
    of_frequency = [trend for name, trend in trends.items() if name.startswith("frequency_")]
    later = {
        label
        for trend in of_frequency
        for label, date in zip(trend.series.labels, trend.series.dates, strict=True)
        if date >= since
    }
    moved = deviations(of_frequency, sorted(later))
    if len(moved[0]) < FEWEST_OF_A_PATTERN:
        return None
    ranked = patterns(*moved)
    return {
        "ranked": [_described(each, ranked[0].evidence) for each in ranked],
        "text": patterns_in_words(ranked),
    }


def same_mode(number: int, observation: Observation, everyone: Sequence[Observation]) -> int | None:
    """Which mode of this campaign, from 0, is the n-th of the earliest one: the nearest in
    frequency, not further than 15 %.

    Modes of another kind of motion, where the results say it, are others, so that bending may pass
    torsion.
    """
    first = min(everyone, key=lambda o: o.performed_at)
    if number > len(first.values["modes"]):
        return None
    kind, target_hz = _kind(first, number - 1), first.values["modes"][number - 1][0]
    hz, there = _alike(observation, kind), _alike(first, kind)
    if not hz:
        return None
    nearest = min(hz, key=lambda i: abs(hz[i] - target_hz))
    rival = min(there.values(), key=lambda f: abs(f - hz[nearest]))
    return nearest if rival == target_hz and abs(hz[nearest] / target_hz - 1) <= SAME_MODE else None


def _alike(observation: Observation, kind: str | None) -> dict[int, float]:
    """Frequencies of a campaign's modes that may be of a kind, by their numbers from 0."""
    rows = enumerate(observation.values["modes"])
    return {i: row[0] for i, row in rows if kind is None or _kind(observation, i) in (None, kind)}


def _kind(observation: Observation, mode: int) -> str | None:
    """Kind of motion of a mode; None where the run is of a version that kept none, or the mode has
    no partner.
    """
    kinds = observation.values.get("kinds")
    return None if kinds is None else kinds[mode]


_FEWEST_MODES = 3  # of which a change has a pattern


def explained(
    observations: Sequence[Observation],
    mode_effects: ModeEffects,
    baseline: Sequence[str],
    later: Sequence[str],
    covariates: Sequence[str],
    not_given: Mapping[str, float],
) -> dict[str, Any] | None:
    """Explanations of a change, ranked, and in words; None where too few modes or campaigns say
    something.

    Args:
        observations: of the series.
        mode_effects: at a campaign of the baseline.
        baseline: campaigns of the baseline.
        later: campaigns since the change.
        covariates: that are regressed out.
        not_given: conditions that are not; see `JudgementInputs`.
    """
    by = {o.campaign: o for o in observations}
    row = _rows(by[mode_effects.campaign], observations)
    paired = np.array([at >= 0 and np.isfinite(mode_effects.mass[at]).all() for at in row])
    table = {name: _numbers(by[name], observations) for name in (*baseline, *later)}
    modes = paired & np.all([np.isfinite(table[name][:-1]) for name in later], axis=0)
    based = [name for name in baseline if np.isfinite(table[name][:-1][modes]).all()]
    if modes.sum() < _FEWEST_MODES or len(based) < len(covariates) + 3:
        return None
    scaled = all(np.isfinite(table[name][-1]) for name in (*based, *later))
    first, last = (
        np.array([table[name][np.append(modes, scaled)] for name in names]).reshape(len(names), -1)
        for names in (based, later)
    )
    at = _regressors([by[name] for name in based], [by[name] for name in later], covariates)
    change, slopes = change_of(first, last, *at)
    ranked = explanations(
        change, _effects(mode_effects, row[modes], covariates, slopes[1:, : modes.sum()], not_given)
    )
    return {
        "ranked": [_described(each, ranked[0].evidence) for each in ranked],
        "text": in_words(ranked, tuple(not_given)),
    }


def _described(each: ChangeExplanation, most: float) -> dict[str, Any]:
    """An explanation to the digits that mean something, its evidence over that of the likeliest."""
    return {
        "kind": each.kind,
        "probability": round(each.probability, 3),
        "evidence": _three_digits(each.evidence - most),
        "sizes": {name: [*map(_three_digits, size)] for name, size in each.sizes.items()},
    }


def _three_digits(value: float) -> float:
    return float(f"{value:.3g}")


def _rows(observation: Observation, everyone: Sequence[Observation]) -> Any:
    """(k,) the campaign's mode, from 0, that is each of the earliest campaign's; -1 where it has
    none.
    """
    count = len(min(everyone, key=lambda o: o.performed_at).values["modes"])
    matches = (same_mode(number, observation, everyone) for number in range(1, count + 1))
    return np.array([-1 if at is None else at for at in matches], dtype=int)


def _numbers(observation: Observation, everyone: Sequence[Observation]) -> FloatArray:
    """(k + 1,) logarithms of the frequencies of the earliest campaign's modes, and of the FRFs'
    scale; NaN where unknown.
    """
    hz = np.array([*(row[0] for row in observation.values["modes"]), np.nan])
    scale = observation.values.get("frf_scale")
    logarithms: FloatArray = np.log(
        np.append(hz[_rows(observation, everyone)], np.nan if scale is None else scale)
    )
    return logarithms


def _regressors(
    based: Sequence[Observation], later: Sequence[Observation], covariates: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Ones and covariates about the baseline's mean, which stands for what was not measured."""
    measured = [
        np.array([[o.covariates.get(name, np.nan) for name in covariates] for o in group]).reshape(
            len(group), -1
        )
        for group in (based, later)
    ]
    centre = measured[0].mean(axis=0)
    first, last = (np.column_stack([np.ones(len(c)), np.nan_to_num(c - centre)]) for c in measured)
    return first, last


def _effects(
    mode_effects: ModeEffects,
    rows: BoolArray,
    covariates: Sequence[str],
    slopes: FloatArray,
    not_given: Mapping[str, float],
) -> Effects:
    return Effects(
        stiffness={name: each[rows] for name, each in mode_effects.stiffness.items()},
        support={name: each[rows] for name, each in mode_effects.support.items()},
        sites=mode_effects.sites,
        mass=mode_effects.mass[rows],
        covariates=dict(zip(covariates, slopes, strict=True)),
        not_given=not_given,
    )
