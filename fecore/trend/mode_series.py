"""Series of the modes of runs: what a monitor without a model watches.

Runs are followed as tracks (`fecore.trend.tracking`). Tracks that come again in the first runs,
those that make the baseline, are the structure's modes; numbered from 1 in ascending frequency,
each gives the series `frequency_1`, `damping_ratio_1`, … A run that misses a track has no value of
it. Where two tracks may have been swapped, what that would have done is part of the standard
deviation, so a swap within what is known is no alarm.

Some output-only codes state standard deviations of ten times what runs differ by. Where the median of
|x_i+1 − x_i| / sqrt(s_i² + s_i+1²) over 0.6745 in the baseline, which is 1 for right ones, is below
one third, they say nothing of which run is better known. There none counts as better known than the
median one, and a note says that a change will be noticed late.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fecore.normal import SD_OF_MAD
from fecore.trend.series import Series, days_since
from fecore.trend.tracking import TrackedMode, Tracks, follow

EXACT = 1e-6
"""Relative standard deviation where none is stated: the scatter between campaigns then is all
there is.
"""
_FAR_TOO_LARGE = 1 / 3  # share of the stated sds by which runs differ
_FEWEST_PAIRS = 10  # of which the median is below that once in 120 times where the sds are right


@dataclass(frozen=True)
class ModesOfRun:
    """The modes of a structure at a time."""

    label: str  # of the run
    performed_at: datetime  # when
    modes: Sequence[TrackedMode]  # in any order
    covariates: Mapping[str, float] = field(default_factory=dict)  # by name, where measured


@dataclass(frozen=True)
class ModeSeries:
    """The watched tracks of runs."""

    series: Mapping[str, Series]  # by name; those of a mode stand together
    notes: tuple[str, ...] = ()  # whose standard deviations are far too large
    # tracks that came later than the baseline and stay, as (frequency, label of the first run)
    newcomers: tuple[tuple[float, str], ...] = ()


def mode_series(
    runs: Sequence[ModesOfRun], baseline: int, tracks: Tracks | None = None
) -> ModeSeries:
    """Series of frequencies and damping ratios of the modes of a structure.

    Args:
        runs: in any order.
        baseline: how many runs, of the first ones, decide which modes are watched.
        tracks: of the runs; by default they are followed. Where they are known, any of the runs
            after the baseline may be left out.

    Raises:
        InputError: a mode is none (`fecore.trend.tracking.follow`).
    """
    if not runs:
        return ModeSeries({})
    order = sorted(range(len(runs)), key=lambda at: runs[at].performed_at)
    if tracks is None:
        days = [day_of(run.performed_at) for run in runs]
        tracks = follow([run.modes for run in runs], days)
    hz = _frequencies(runs, tracks)
    watched = sorted(tracks.confirmed(order[:baseline]), key=lambda k: hz[k])
    until = runs[order[min(baseline, len(runs)) - 1]].performed_at
    series: dict[str, Series] = {}
    notes: list[str] = []
    for number, one in enumerate(watched, 1):
        sightings = [
            (runs[at], mode, identity)
            for at in order
            for mode, k, identity in zip(
                runs[at].modes, tracks.numbers[at], tracks.identity_sd[at], strict=True
            )
            if k == one
        ]
        frequencies = [
            _Value(run, mode.frequency_hz, mode.frequency_sd_hz, mode.frequency_hz * identity)
            for run, mode, identity in sightings
        ]
        damping = [
            _Value(run, mode.damping_ratio, mode.damping_sd)
            for run, mode, _ in sightings
            if mode.damping_ratio is not None
        ]
        for kind, values in (("frequency", frequencies), ("damping_ratio", damping)):
            if not values:
                continue
            name = f"{kind}_{number}"
            ratio, usual = _compared([each for each in values if each.run.performed_at <= until])
            overstated = ratio < _FAR_TOO_LARGE
            series[name] = _series(name, values, usual if overstated else 0.0)
            if overstated:
                notes.append(
                    f"{name}: runs differ by {ratio:.2g} of their stated standard deviations, so a"
                    " change will be noticed late; state smaller ones if you know them"
                )
    later = sorted(tracks.confirmed(order[baseline:]), key=lambda k: hz[k])
    new = [k for k in later if k not in watched and k not in _of(tracks.numbers, order[:baseline])]
    return ModeSeries(
        series,
        tuple(notes),
        tuple(
            (
                hz[k],
                next(runs[at].label for at in order if k in tracks.numbers[at]),
            )
            for k in new
        ),
    )


def day_of(date: datetime) -> float:
    """A date as days from one origin for all."""
    return float(days_since(datetime(2000, 1, 1, tzinfo=date.tzinfo), [date])[0])


def _frequencies(runs: Sequence[ModesOfRun], tracks: Tracks) -> dict[int, float]:
    """Mean frequency of each track."""
    seen: dict[int, list[float]] = {}
    for run, numbers in zip(runs, tracks.numbers, strict=True):
        for mode, k in zip(run.modes, numbers, strict=True):
            seen.setdefault(k, []).append(math.log(mode.frequency_hz))
    return {k: math.exp(math.fsum(each) / len(each)) for k, each in seen.items()}


class _Value(NamedTuple):
    """A value of a track in a run."""

    run: ModesOfRun
    value: float
    sd: float | None  # None where it is not stated
    identity_sd: float = 0.0  # by that it may be another track's


def _compared(values: Sequence[_Value]) -> tuple[float, float]:
    """The share of the stated standard deviations by which values differ from one to the next, 1
    where there are too few of them; and their median.
    """
    ratios = [
        abs(a.value - b.value) / math.hypot(a.sd, b.sd)
        for a, b in pairwise(values)
        if a.sd and b.sd
    ]
    if len(ratios) < _FEWEST_PAIRS:
        return 1.0, 0.0
    return SD_OF_MAD * float(np.median(ratios)), float(np.median([v.sd for v in values if v.sd]))


def _series(name: str, values: Sequence[_Value], least_sd: float) -> Series:
    estimate = np.array([each.value for each in values])
    sd = [math.hypot(max(each.sd or 0.0, least_sd), each.identity_sd) for each in values]
    covariates = dict.fromkeys(key for each in values for key in each.run.covariates)
    return Series(
        name,
        [each.run.performed_at for each in values],
        estimate,
        np.array(
            [s or max(abs(each.value), 1e-300) * EXACT for s, each in zip(sd, values, strict=True)]
        ),
        {
            key: np.array([each.run.covariates.get(key, math.nan) for each in values])
            for key in covariates
        },
        [each.run.label for each in values],
    )


def _of(numbers: Sequence[Sequence[int]], runs: Sequence[int]) -> set[int]:
    """Tracks that are in any of some runs."""
    return {k for at in runs for k in numbers[at]}
