"""What may have caused an alarm: by a model's effects on the modes, or by the pattern of what
moved.
"""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.trend import ParameterTrend
from fecore.trend.explanations import ChangeExplanation, Effects, change_of, explanations, in_words
from fecore.trend.patterns import FEWEST_MODES as FEWEST_OF_A_PATTERN
from fecore.trend.patterns import deviations, patterns, patterns_in_words
from fecore.trend.tracking import SAME_MODE
from service.tasks.judge.inputs import JudgementInputs, ModeEffects, Observation


def causes_of(
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
