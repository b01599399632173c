"""Series of the modes of runs: what a monitor without a model watches.

Runs are followed as tracks (`fecore.trend.tracking`). Tracks that come again in the first runs,
those that make the baseline, are the structure's modes; numbered from 1 in ascending frequency,
each gives the series `frequency_1`, `damping_ratio_1`, … A run that misses a track has no value of
it. Where two tracks may have been swapped, what that would have done is part of the standard
deviation, so a swap within what is known is no alarm.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from fecore.trend.series import Series, days_since
from fecore.trend.tracking import TrackedMode, follow

EXACT = 1e-6
"""Relative standard deviation where none is stated: the scatter between campaigns then is all
there is.
"""


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
    # tracks that came later than the baseline and stay, as (frequency, label of the first run)
    newcomers: tuple[tuple[float, str], ...] = ()


def mode_series(runs: Sequence[ModesOfRun], baseline: int) -> ModeSeries:
    """Series of frequencies and damping ratios of the modes of a structure.

    Args:
        runs: in any order.
        baseline: how many runs, of the first ones, decide which modes are watched.

    Raises:
        InputError: a mode is none (`fecore.trend.tracking.follow`).
    """
    if not runs:
        return ModeSeries({})
    order = sorted(range(len(runs)), key=lambda at: runs[at].performed_at)
    days = days_since(runs[order[0]].performed_at, [run.performed_at for run in runs])
    tracks = follow([run.modes for run in runs], days.tolist())
    watched = tracks.confirmed(order[:baseline])
    series: dict[str, Series] = {}
    for number, one in enumerate(watched, 1):
        sightings = [
            (run, mode, identity)
            for run, numbers, uncertain in zip(
                runs, tracks.numbers, tracks.identity_sd, strict=True
            )
            for mode, k, identity in zip(run.modes, numbers, uncertain, strict=True)
            if k == one
        ]
        frequencies = [
            (run, mode.frequency_hz, np.hypot(mode.frequency_sd_hz or 0.0, mode.frequency_hz * sd))
            for run, mode, sd in sightings
        ]
        damping = [
            (run, mode.damping_ratio, mode.damping_sd or 0.0)
            for run, mode, _ in sightings
            if mode.damping_ratio is not None
        ]
        for kind, values in (("frequency", frequencies), ("damping_ratio", damping)):
            if values:
                name = f"{kind}_{number}"
                series[name] = _series(name, values)
    later = tracks.confirmed(order[baseline:])
    new = [k for k in later if k not in watched and k not in _of(tracks.numbers, order[:baseline])]
    return ModeSeries(
        series,
        tuple(
            (
                float(tracks.frequency_hz[k]),
                next(runs[at].label for at in order if k in tracks.numbers[at]),
            )
            for k in new
        ),
    )


def _series(name: str, values: Sequence[tuple[ModesOfRun, float, float]]) -> Series:
    estimate = np.array([value for _, value, _ in values])
    names = dict.fromkeys(covariate for run, *_ in values for covariate in run.covariates)
    return Series(
        name,
        [run.performed_at for run, *_ in values],
        estimate,
        np.array([sd or max(abs(value), 1e-300) * EXACT for _, value, sd in values]),
        {
            covariate: np.array([run.covariates.get(covariate, np.nan) for run, *_ in values])
            for covariate in names
        },
        [run.label for run, *_ in values],
    )


def _of(numbers: Sequence[Sequence[int]], runs: Sequence[int]) -> set[int]:
    """Tracks that are in any of some runs."""
    return {k for at in runs for k in numbers[at]}
