"""A monitor's judgement: series of watched parameters and a recipe in; states, charts, change
points and rates out.

Each parameter's scores (baseline.py) go through one chart for each direction in which it is watched
(charts.py), and the outside and inside campaigns through the states (states.py). The false-alarm
rate is the whole family's: with m charts each gets 1/m of the probability of a call within the
horizon, which holds whatever the dependence between the parameters (Bonferroni).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.errors import InputError
from fecore.trend.autocorrelation import widened
from fecore.trend.baseline import Baseline, Scores, complete_campaigns, fit_baseline, score
from fecore.trend.change import ChangePoint, Rate, change_point, rate, rate_since_onset
from fecore.trend.charts import KNOWN, Limits, control_limits
from fecore.trend.common_factor import common_factor
from fecore.trend.series import (
    SIDES,
    Direction,
    Series,
    Watch,
    days_since,
    in_time_order,
    later,
    listed,
)
from fecore.trend.states import Acknowledgement, Condition, Moment, State, timeline, worst

_FEWEST_FOR_RATE = 3  # watched campaigns
_NOTICED = 1.15  # factor of the limits from which a note says why they are wide


@dataclass(frozen=True)
class Before:
    """What the campaigns before a window leave of a parameter: all that those in it need of
    them.
    """

    date: datetime  # of the last one
    statistic: Mapping[str, float]  # chart values, by direction
    condition: Condition


@dataclass(frozen=True)
class Window:
    """The campaigns of a long series that are judged. Those before it have been, and of these only
    the baseline's and some more come again, which say how fast a parameter changes.
    """

    after: datetime | None  # the last one before it; None: all after the baseline are judged
    before: Mapping[str, Before] = field(default_factory=dict)  # by parameter that has any
    baseline_until: datetime | None = None  # a campaign after that is in no baseline
    # by parameter whose baseline is as it was: its limits, and by what they are wider
    limits: Mapping[str, tuple[Limits, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class ParameterTrend:
    """One watched parameter, judged."""

    # name, direction: as in the recipe
    name: str
    direction: Direction
    series: Series  # all campaigns in time order
    baseline: Baseline | None = None  # None while there are too few campaigns
    watched: Series | None = None  # campaigns after the baseline, None where there are none
    scores: Scores | None = None  # of the watched campaigns
    # chart values S of the watched campaigns, by direction (`fall`, `rise`)
    statistic: Mapping[str, FloatArray] = field(default_factory=dict)
    limits: Limits | None = None  # h of the charts' values and c of single scores
    # factor by which these are wider than for independent campaigns; None without a baseline
    widened_by: float | None = None
    # (m,) whether a campaign is outside in any direction
    outside: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    timeline: tuple[Moment, ...] = ()  # states as they followed each other
    change: ChangePoint | None = None  # where the change began, if any campaign is outside
    # of change over all campaigns; None below three watched ones, and where a note says why
    rate: Rate | None = None
    notes: tuple[str, ...] = ()  # what was put in order, left out, extrapolated

    @property
    def state(self) -> State:
        """The state now."""
        return self.timeline[-1].state if self.timeline else State.NO_DATA


@dataclass(frozen=True)
class Assessment:
    """All watched parameters, judged; `state` is the worst of theirs, `notes` are of all of them
    together.
    """

    parameters: Mapping[str, ParameterTrend]
    notes: tuple[str, ...] = ()

    @property
    def state(self) -> State:
        """The worst state."""
        return worst(tuple(p.state for p in self.parameters.values()))


ALL = Window(None)


def assess(
    series: Mapping[str, Series],
    watch: Watch,
    as_of: datetime | None = None,
    acknowledgements: Sequence[Acknowledgement] = (),
    window: Window = ALL,
) -> Assessment:
    """Judge the series of a structure.

    Args:
        series: by parameter; campaigns in any order.
        watch: the recipe.
        as_of: now, so that a late campaign is recognised; by default the last campaign.
        acknowledgements: of alarms, in any order.
        window: which campaigns are judged; the others in the series have been.

    Raises:
        InputError: a watched parameter without a series, two campaigns at one time, faulty values,
            an acknowledgement where there was no alarm.
    """
    for name in watch.directions:
        if name not in series:
            raise InputError(
                f"series.{name}", f"is missing; there are {', '.join(series) or 'none'}"
            )
    for note in acknowledgements:
        if note.parameter not in watch.directions:
            raise InputError("acknowledgements.parameter", f"{note.parameter!r} is not watched")
    trends = {
        name: _parameter(series[name], direction, watch, as_of, acknowledgements, window)
        for name, direction in watch.directions.items()
    }
    return Assessment(trends, _together(tuple(trends.values()), watch.covariates))


def _together(trends: Sequence[ParameterTrend], covariates: Sequence[str]) -> tuple[str, ...]:
    """What is said where the residuals of the baselines move together."""
    based = [(trend.series, trend.baseline) for trend in trends if trend.baseline is not None]
    factor = common_factor(based) if based else None
    if factor is None:
        return ()
    unexplained = f" that {' and '.join(covariates)} does not explain" if covariates else ""
    return (
        (
            "the residuals of the baseline move together beyond their noise,"
            f" {100 * factor.share:.0f} % of their variance in one direction{unexplained} (p ="
            f" {factor.p:.1g}): something not regressed out, as the climate (temperature, humidity)"
            " or the support, moves all parameters; record it, or its changes look like damage"
        ),
    )


def _parameter(
    series: Series,
    direction: Direction,
    watch: Watch,
    as_of: datetime | None,
    notes: Sequence[Acknowledgement],
    window: Window,
) -> ParameterTrend:
    ordered, order_notes = in_time_order(series)
    short = _too_short(ordered, watch, window.baseline_until)
    if short is not None:
        return ParameterTrend(series.name, direction, ordered, notes=(*order_notes, short))
    baseline, watched, left_out = fit_baseline(
        ordered, watch.baseline, watch.covariates, watch.per_kelvin.get(series.name)
    )
    begin = ordered.dates[list(ordered.labels).index(baseline.labels[-1])]
    before = window.before.get(series.name)
    if watched is not None and window.after is not None:
        watched = later(watched, window.after)
        begin = begin if before is None else before.date
    limits, wider = window.limits.get(series.name) or _limits(baseline, watch)
    scores = None if watched is None else score(baseline, watched)
    z = np.zeros(0) if scores is None else scores.score
    start = dict.fromkeys(SIDES[direction], 0.0) if before is None else before.statistic
    judged = {
        side: watch.chart.outside(sign * z, limits, start[side])
        for side, sign in SIDES[direction].items()
    }
    outside = np.any([out for _, out in judged.values()], axis=0)
    seen = [
        note.date
        for note in notes
        if note.parameter == series.name and (before is None or note.date > begin)
    ]
    moments = timeline(
        begin=begin,
        watched=watched,
        outside=outside,
        acknowledged=seen,
        pending=watch.pending,
        interval_days=watch.expected_interval_days,
        as_of=as_of,
        before=None if before is None else before.condition,
    )
    change, speed, unknown = _change_and_rate(
        ordered, watch, baseline, begin, watched, scores=scores, outside=outside
    )
    return ParameterTrend(
        name=series.name,
        direction=direction,
        series=ordered,
        baseline=baseline,
        watched=watched,
        scores=scores,
        statistic={side: values for side, (values, _) in judged.items()},
        limits=limits,
        widened_by=wider,
        outside=outside,
        timeline=moments,
        change=change,
        rate=speed,
        notes=(*order_notes, *left_out, *_cautions(watched, scores, baseline, wider), *unknown),
    )


def _too_short(ordered: Series, watch: Watch, until: datetime | None) -> str | None:
    """Why there is no baseline; None where there is one."""
    known = complete_campaigns(ordered, watch.covariates)
    complete = sum(until is None or ordered.dates[i] <= until for i in known.tolist())
    if complete >= watch.baseline:
        return None
    short = f"no baseline yet: {complete} of {watch.baseline} campaigns"
    if watch.covariates:
        short += f" with {' and '.join(watch.covariates)}"
    return short if complete == known.size else f"{short} up to {until}"


def _change_and_rate(
    ordered: Series,
    watch: Watch,
    baseline: Baseline,
    begin: datetime,
    watched: Series | None,
    scores: Scores | None,
    outside: BoolArray,
) -> tuple[ChangePoint | None, Rate | None, tuple[str, ...]]:
    """When the change began, how fast it goes, and why no rate is known: a covariate that runs with
    time cannot be separated from ageing.
    """
    if watched is None or scores is None or len(watched) < _FEWEST_FOR_RATE:
        return None, None, ()
    speed: Rate | None = None
    unknown: tuple[str, ...] = ()
    try:
        speed = rate(ordered, watch.covariates, baseline.mean, watch.per_kelvin.get(ordered.name))
    except InputError as error:
        unknown = (f"no rate of change: {error}",)
    if not np.any(outside):
        return None, speed, unknown
    change = _change(begin, watched, scores, baseline)
    # else covariates run with time, and no rate is known
    if change.pattern == "ramp" and speed is not None:
        speed = rate_since_onset(change, baseline.mean)
    return change, speed, unknown


def _limits(baseline: Baseline, watch: Watch) -> tuple[Limits, float]:
    """The charts' limits, and the factor by which they are wider as campaigns resemble their
    neighbours.

    What they depend on is rounded, to the safe side, so that limits are found once.
    """
    nu = baseline.fit.degrees_of_freedom
    rounded = float(np.floor(nu)) if nu < 20 else 20.0 * np.floor(nu / 20) if nu < 200 else KNOWN
    shared = float(np.ceil(50 * baseline.shared) / 50)
    known = max(rounded, 1.0)
    limits = control_limits(
        watch.chart, watch.side_probability, watch.horizon, watch.pending, shared, known
    )
    return widened(
        limits,
        watch.chart,
        baseline.autocorrelation,
        campaigns=watch.horizon,
        pending=watch.pending,
    )


def _change(begin: datetime, watched: Series, scores: Scores, baseline: Baseline) -> ChangePoint:
    dates = (begin, *watched.dates)
    return change_point(
        dates,
        days_since(begin, dates),
        scores.residual,
        scores.covariance(baseline),
        baseline.fit.degrees_of_freedom,
    )


def _alike(baseline: Baseline, wider: float) -> tuple[str, ...]:
    """What is said where the limits are wider by more than nobody would notice."""
    if wider < _NOTICED:
        return ()
    autocorrelation = baseline.autocorrelation
    low, high = autocorrelation.interval_95
    return (
        (
            "campaigns of the baseline resemble their neighbours (lag-1 autocorrelation"
            f" {autocorrelation.mean:.2f}, 95 % from {low:g} to {high:g}): the limits are"
            f" {100 * (wider - 1):.0f} % wider than for independent campaigns"
        ),
    )


def _cautions(
    watched: Series | None, scores: Scores | None, baseline: Baseline, wider: float
) -> tuple[str, ...]:
    """What a reader of the chart must know about its limits and covariates."""
    cautions = [*_alike(baseline, wider)]
    if watched is None or scores is None:
        return tuple(cautions)
    labels = np.array(watched.labels)
    if np.any(scores.extrapolated):
        ranges = ", ".join(
            f"{name} {low:g} to {high:g}"
            for name, low, high in zip(
                baseline.covariates, baseline.low, baseline.high, strict=True
            )
        )
        cautions.append(
            f"beyond the baseline's covariates ({ranges}), judged with more uncertainty: "
            + listed(labels[scores.extrapolated].tolist())
        )
    if np.any(scores.missing):
        cautions.append(
            "a covariate was not measured, judged as if it could be anything that the baseline"
            " saw: " + listed(labels[scores.missing].tolist())
        )
    return tuple(cautions)
