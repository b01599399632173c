"""Which modes of several runs are the same: tracks, one a mode, followed from run to run.

A track has a state: m, the mean of ln f, with variance P, and a shape. Between runs P grows as a
random walk. Mode i of a run continues track k with the likelihood

    p(ln f_i − m_k) p(MAC_ik)

of which the first is Student's t of variance P_k + v_k + s_i² (s_i as stated with the mode, v_k the
scatter between runs, which the track learns), mixed with a small share that is uniform over ±15 %:
a structure may change. The second is exponential in 1 − MAC, its mean what the track's shapes
differ by from run to run, which it learns too, and what the mode's own shape is known to: by its
stated variance, else by that a residue is known as well as its pole is in half bandwidths, (σ_f/ζf)²
(the two come from one fit of one peak). Where shapes say nothing, they decide nothing.
Against it stand a track that is missing, by how often it was, and a mode that is new, by a density
of spurious modes. A track that was seen once or twice is forgotten after `_SPURIOUS_AFTER` runs
without it, another one after `_GONE_AFTER` times as many as it was there in, so what is known of a
structure does not grow with its runs. The runs' modes go to tracks as one assignment of least negative log likelihood
(Bar-Shalom, Daum and Huang 2009, IEEE Control Systems 29(6); Kuhn 1955).

Shapes of modes that lie nearer than twice their standard deviations mix, and any shape of their
span is one that an identification may give. There the MAC with the span stands in place of the
MAC, which is the same for all of them, so frequency decides; and which is which stays as uncertain
as it is: `identity_sd` is what a swap would have done to a value.

All of this is a fold: the state after a run is a value (`Following`), made of the one before and
the run's modes, so a run that comes last is followed from there.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray
from fecore.correlation import pair_modes
from fecore.errors import InputError
from fecore.trend.track_states import (
    DAYS_A_MONTH,
    DRIFT,
    FEWEST_DOFS,
    SAME_MODE,
    SCATTER,
    WIDEST,
    Modes,
    Shape,
    TrackedMode,
    TrackState,
    assigned,
    costs,
    identity_sd,
    learned,
    unit,
)

__all__ = [
    "FEWEST_DOFS",
    "SAME_MODE",
    "Following",
    "Shape",
    "TrackedMode",
    "Tracks",
    "follow",
    "same_modes",
    "track",
]

LEAST_MAC = 0.5  # MAC below which modes of two sets are no pair, as of pairs with a model
FEWEST_SIGHTINGS, LEAST_PRESENCE = 3, 0.25
"""How often, and in which share of the runs, a mode is there that is one of the structure."""

_SPURIOUS_AFTER = 100  # runs: one in a hundred is no mode of the structure
# runs, for each in which it was: its probability to be there, 1 in 200, then is a spurious mode's
_GONE_AFTER = 200


@dataclass(frozen=True)
class Tracks:
    """The modes of runs as tracks, numbered from 0 in the order in which they begin."""

    numbers: Sequence[Sequence[int]]  # of each mode of each run, as the runs were handed in
    # sd of a relative change of frequency, for each mode, by that it may be another track's
    identity_sd: Sequence[Sequence[float]]

    def confirmed(self, runs: Sequence[int]) -> list[int]:
        """Tracks that are modes of the structure and not spurious ones: those that come again in
        some runs, `FEWEST_SIGHTINGS` times and in `LEAST_PRESENCE` of them.
        """
        seen = Counter(k for at in runs for k in self.numbers[at])
        least = max(FEWEST_SIGHTINGS, LEAST_PRESENCE * len(runs))
        return sorted(k for k, times in seen.items() if times >= least)


@dataclass(frozen=True)
class Following:
    """What is known after some runs: all that the runs to come need of them."""

    day: float | None = None  # of the last run
    dofs: tuple[tuple[int, int], ...] = ()  # of the tracks' shapes, as they came
    tracks: tuple[TrackState, ...] = ()  # those that may be continued
    begun: int = 0  # tracks, those that are forgotten too

    def document(self) -> dict[str, Any]:
        """The same as plain JSON, to the last bit."""
        return {
            "day": self.day,
            "dofs": [list(dof) for dof in self.dofs],
            "begun": self.begun,
            "tracks": [
                [*(getattr(one, name) for name in _PLAIN), _values_of(one.shape)]
                for one in self.tracks
            ],
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Following":
        """The state of such a document."""
        tracks = [
            TrackState(**dict(zip(_PLAIN, plain, strict=True)), shape=_shape_of(shape))
            for *plain, shape in document["tracks"]
        ]
        dofs = tuple((int(point), int(axis)) for point, axis in document["dofs"])
        return cls(document["day"], dofs, tuple(tracks), document["begun"])

    def after(
        self, run: Sequence[TrackedMode], day: float
    ) -> tuple["Following", tuple[int, ...], tuple[float, ...]]:
        """What is known after one more run; the module says how.

        1. Let what is known of each track age.
        2. Assign the run's modes to tracks at the least negative log likelihood.
        3. Learn from those that continue a track; the others begin one.
        4. Forget tracks that were spurious, or are gone.

        Args:
            run: its modes.
            day: its time in days, not before the last one's.

        Returns:
            The state, the number of the track of each mode, and the standard deviation of a
            relative change of its frequency by that it may be another track's.

        Raises:
            InputError: a frequency or standard deviation is none, a shape is not finite.
        """
        new = sorted({dof for mode in run for dof in mode.shape} - set(self.dofs))
        dofs = (*self.dofs, *new)
        modes = Modes.of(run, dofs)
        # 1. Age.
        elapsed = 0.0 if self.day is None else day - self.day
        states = [_aged(one, elapsed, len(new)) for one in self.tracks]
        # 2. Assign.
        cost, likeness, mixing = costs(modes, states)
        chosen = assigned(cost, states)
        identity = identity_sd(modes, cost, chosen, states)
        # 3. Learn.
        states = [replace(one, runs=one.runs + 1, missed=one.missed + 1) for one in states]
        numbers = [0] * len(modes)
        for i, k in chosen:
            numbers[i] = states[k].number
            states[k] = learned(states[k], modes, i, likeness[i, k], mixed=bool(mixing[i, k]))
        begun = self.begun
        for i in sorted(set(range(len(modes))) - {i for i, _ in chosen}):
            spread = SCATTER**2 + float(modes.variance[i])
            shape = unit(modes.shapes[i])
            states.append(TrackState(begun, float(modes.log_hz[i]), spread, shape))
            numbers[i] = begun
            begun += 1
        # 4. Forget.
        kept = tuple(one for one in states if not _gone(one))
        return Following(day, dofs, kept, begun), tuple(numbers), identity


_PLAIN = (
    "number", "mean", "variance", "scatter", "unlike", "seen", "compared", "runs", "missed",
)  # fmt: skip


def _aged(state: TrackState, elapsed: float, new_dofs: int) -> TrackState:
    extended = state.variance + DRIFT**2 * elapsed / DAYS_A_MONTH
    shape = state.shape
    if new_dofs:
        shape = np.concatenate([shape, np.full(new_dofs, np.nan + 0j)])
    return replace(
        state,
        variance=min(extended, max(WIDEST**2, state.variance)),
        shape=shape,
    )


def _gone(state: TrackState) -> bool:
    """Whether a track was spurious, or is missing for so long that it is no longer looked for."""
    if state.seen < FEWEST_SIGHTINGS:
        return state.missed > _SPURIOUS_AFTER
    return state.missed > _GONE_AFTER * state.seen


def _values_of(shape: ComplexArray) -> list[list[float] | None]:
    return [None if np.isnan(v) else [v.real, v.imag] for v in shape.tolist()]


def _shape_of(values: Sequence[Sequence[float] | None]) -> ComplexArray:
    return np.array([complex(np.nan) if v is None else complex(*v) for v in values], complex)


def track(
    campaigns: Sequence[Sequence[TrackedMode]], days: Sequence[float] | None = None
) -> list[list[int]]:
    """The number of the track of each mode of each campaign, from 0, in the order in which tracks
    begin.

    Args:
        campaigns: the modes of each; in time order where no times are given.
        days: time of each in days; by default a month lies between two.

    Raises:
        InputError: a frequency is not positive, a shape not finite, or a time is missing.
    """
    return [list(numbers) for numbers in follow(campaigns, days).numbers]


def follow(runs: Sequence[Sequence[TrackedMode]], days: Sequence[float] | None = None) -> Tracks:
    """Follow the modes of runs in the order of time: `Following.after` each of them.

    Args:
        runs: the modes of each, in any order; in time order where no times are given.
        days: time of each in days; by default a month lies between two.

    Raises:
        InputError: a frequency or standard deviation is not positive, a shape not finite, or there
            is not a time for each run.
    """
    times = np.arange(len(runs)) * DAYS_A_MONTH if days is None else np.asarray(days, float)
    if times.shape != (len(runs),) or not np.isfinite(times).all():
        raise InputError(
            "days", f"are {times.size} finite times for {len(runs)} runs, expected one each"
        )
    numbers: list[tuple[int, ...]] = [()] * len(runs)
    identity: list[tuple[float, ...]] = [()] * len(runs)
    following = Following()
    for at in np.argsort(times, kind="stable").tolist():
        following, numbers[at], identity[at] = following.after(runs[at], float(times[at]))
    return Tracks(tuple(numbers), tuple(identity))


def same_modes(modes: Sequence[TrackedMode], others: Sequence[TrackedMode]) -> dict[int, int]:
    """By the place of a mode, that of the other set's mode which it is.

    Args:
        modes: of one set.
        others: of another one.

    Raises:
        InputError: a frequency is not positive, or a shape not finite.
    """
    if not modes or not others:
        return {}
    dofs = sorted(set.intersection(*(set(mode.shape) for mode in (*modes, *others))))
    compared = len(dofs) >= FEWEST_DOFS
    paired = pair_modes(
        _values(modes, dofs) if compared else None,
        _values(others, dofs) if compared else None,
        np.array([mode.frequency_hz for mode in modes]),
        np.array([mode.frequency_hz for mode in others]),
        minimum_mac=LEAST_MAC,
        maximum_frequency_ratio=1 + SAME_MODE,
    )
    return dict(paired.pairs)


def _values(modes: Sequence[TrackedMode], dofs: Sequence[tuple[int, int]]) -> ComplexArray:
    return np.array([[mode.shape[dof] for dof in dofs] for mode in modes])
