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
of spurious modes. The runs' modes go to tracks as one assignment of least negative log likelihood
(Bar-Shalom, Daum and Huang 2009, IEEE Control Systems 29(6); Kuhn 1955).

Shapes of modes that lie nearer than twice their standard deviations mix, and any shape of their
span is one that an identification may give. There the MAC with the span stands in place of the
MAC, which is the same for all of them, so frequency decides; and which is which stays as uncertain
as it is: `identity_sd` is what a swap would have done to a value.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.correlation import pair_modes
from fecore.errors import InputError

Shape = Mapping[tuple[int, int], complex]
"""(grid point, axis 1 to 6) to the value of a mode shape along the positive axis."""

# relative change of frequency from one run to the next up to which two modes may be the same
SAME_MODE = 0.15
LEAST_MAC = 0.5  # MAC below which modes of two sets are no pair, as of pairs with a model
FEWEST_DOFS = 3
"""Shared degrees of freedom from which on shapes are compared: any two shapes at one of them have a
MAC of 1.
"""
FEWEST_SIGHTINGS, LEAST_PRESENCE = 3, 0.25
"""How often, and in which share of the runs, a mode is there that is one of the structure."""

_SCATTER = 0.015  # sd of ln f between runs before any is known: seasons, boundaries
_MIXING = 0.005  # relative distance within which shapes mix, where no sd is stated
_DRIFT = 0.01  # sd of a random walk of ln f over a month
_WIDEST = 0.05  # sd of ln f up to which that grows
_DAYS_A_MONTH = 30.4  # between runs without dates, too
_CHANGED = 0.01  # share of runs by which a track's mode has changed by anything up to SAME_MODE
_SPURIOUS = 0.3  # modes a run and unit of ln f that belong to no track
_UNLIKE = 0.1  # mean of 1 − MAC between runs of one mode before any is known
_ANYTHING = 10.0  # mean from which on a shape says nothing
_KNOWN = 3.0  # runs that these count as
_FORBIDDEN = 1e6  # cost of what cannot be


@dataclass(frozen=True)
class TrackedMode:
    """A mode of a run."""

    frequency_hz: float  # natural frequency, above 0
    shape: Shape = field(default_factory=dict)  # empty where it is not known
    frequency_sd_hz: float | None = None  # of the frequency; None where it is not stated
    # of the shape's values, by their degrees of freedom; empty where they are not stated
    shape_sd: Mapping[tuple[int, int], float] = field(default_factory=dict)
    damping_ratio: float | None = None  # None where it is not known
    damping_sd: float | None = None  # of it; None where it is not stated


@dataclass(frozen=True)
class Tracks:
    """The modes of runs as tracks, numbered from 0 in the order in which they begin."""

    numbers: tuple[tuple[int, ...], ...]  # of each mode of each run, as the runs were handed in
    # sd of a relative change of frequency, for each mode, by that it may be another track's
    identity_sd: tuple[tuple[float, ...], ...]
    frequency_hz: FloatArray  # (T,) mean of each track

    def confirmed(self, runs: Sequence[int]) -> list[int]:
        """Tracks that are modes of the structure and not spurious ones, in ascending frequency:
        those that come again in some runs, `FEWEST_SIGHTINGS` times and in `LEAST_PRESENCE` of
        them.
        """
        seen = np.bincount(
            [k for at in runs for k in self.numbers[at]], minlength=self.frequency_hz.size
        )
        often = np.flatnonzero(seen >= max(FEWEST_SIGHTINGS, LEAST_PRESENCE * len(runs)))
        return sorted(often.tolist(), key=lambda k: float(self.frequency_hz[k]))


@dataclass
class _TrackState:
    """What is known of a track."""

    mean: float  # m, of ln f
    variance: float  # P
    shape: ComplexArray  # (D,) of unit norm; NaN where it is not known
    scatter: float = _SCATTER**2  # v
    unlike: float = _UNLIKE  # d, mean of 1 − MAC
    seen: int = 1
    compared: int = 0  # sightings with a shape
    runs: int = 1  # since it began
    total: float = 0.0  # of ln f of all sightings


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
    """Follow the modes of runs; the module says how.

    1. Sort the runs by time.
    2. Let what is known of each track age.
    3. Assign the run's modes to tracks at the least negative log likelihood.
    4. Learn from those that continue a track; the others begin one.

    Args:
        runs: the modes of each, in any order; in time order where no times are given.
        days: time of each in days; by default a month lies between two.

    Raises:
        InputError: a frequency or standard deviation is not positive, a shape not finite, or there
            is not a time for each run.
    """
    times = np.arange(len(runs)) * _DAYS_A_MONTH if days is None else np.asarray(days, float)
    if times.shape != (len(runs),) or not np.isfinite(times).all():
        raise InputError(
            "days", f"are {times.size} finite times for {len(runs)} runs, expected one each"
        )
    dofs = sorted({dof for run in runs for mode in run for dof in mode.shape})
    states: list[_TrackState] = []
    numbers: list[tuple[int, ...]] = [()] * len(runs)
    identity: list[tuple[float, ...]] = [()] * len(runs)
    before = None
    # 1. Time order.
    for at in np.argsort(times, kind="stable").tolist():
        modes = _Modes.of(runs[at], dofs)
        # 2. Age.
        elapsed = 0.0 if before is None else times[at] - before
        before = times[at]
        for state in states:
            extended = state.variance + _DRIFT**2 * elapsed / _DAYS_A_MONTH
            state.variance = min(extended, max(_WIDEST**2, state.variance))
        # 3. Assign.
        cost, likeness, mixing = _costs(modes, states)
        chosen = _assigned(cost, states)
        identity[at] = _identity_sd(modes, cost, chosen, states)
        # 4. Learn.
        continued = dict(chosen)
        for state in states:
            state.runs += 1
        for i in range(len(modes)):
            if i in continued:
                k = continued[i]
                _learn(states[k], modes, i, likeness[i, k], mixed=bool(mixing[i, k]))
            else:
                continued[i] = len(states)
                x = float(modes.log_hz[i])
                states.append(
                    _TrackState(x, _SCATTER**2 + modes.variance[i], _unit(modes.shapes[i]), total=x)
                )
        numbers[at] = tuple(continued[i] for i in range(len(modes)))
    return Tracks(
        numbers=tuple(numbers),
        identity_sd=tuple(identity),
        frequency_hz=np.exp([state.total / state.seen for state in states]),
    )


@dataclass(frozen=True)
class _Modes:
    """The n modes of a run."""

    log_hz: FloatArray  # (n,)
    variance: FloatArray  # (n,) of these, 0 where it is not stated
    stated: BoolArray  # (n,) whether it is
    shapes: ComplexArray  # (n, D), NaN where a shape has no value
    unlike: FloatArray  # (n,) mean of 1 − MAC by the shapes' own variance

    def __len__(self) -> int:
        return self.log_hz.size

    @classmethod
    def of(cls, run: Sequence[TrackedMode], dofs: Sequence[tuple[int, int]]) -> "_Modes":
        hz = np.array([mode.frequency_hz for mode in run], float)
        if not np.all(np.isfinite(hz) & (hz > 0)):
            raise InputError("frequency_hz", "must be positive and finite")
        sds = [mode.frequency_sd_hz for mode in run]
        if any(sd is not None and not (np.isfinite(sd) and sd >= 0) for sd in sds):
            raise InputError("frequency_sd_hz", "must be finite and not negative")
        at = {dof: place for place, dof in enumerate(dofs)}
        shapes = np.full((hz.size, len(dofs)), np.nan + 0j)
        unlike = np.zeros(hz.size)
        for i, mode in enumerate(run):
            values = np.array(list(mode.shape.values()), complex)
            if not np.isfinite(values).all():
                raise InputError("shape", f"of the mode at {hz[i]:g} Hz is not finite")
            shapes[i, [at[dof] for dof in mode.shape]] = values
            size = float(np.sum(np.abs(values) ** 2))
            if mode.shape_sd and size > 0:
                unlike[i] = sum(sd**2 for sd in mode.shape_sd.values()) / size
            elif mode.frequency_sd_hz and mode.damping_ratio and mode.damping_ratio > 0:
                unlike[i] = (mode.frequency_sd_hz / (mode.damping_ratio * hz[i])) ** 2
        relative = np.array([sd or 0.0 for sd in sds]) / hz if hz.size else np.zeros(0)
        # an sd beyond the reach of a track says nothing more: that of a uniform one
        variance = np.minimum(relative, SAME_MODE / np.sqrt(3)) ** 2
        return cls(np.log(hz), variance, np.array([bool(sd) for sd in sds]), shapes, unlike)


def _costs(
    modes: _Modes, states: Sequence[_TrackState]
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """(n, K) negative log likelihoods that a mode is a track's, MACs, which are NaN where shapes
    cannot be compared, and whether the shapes mix there.
    """
    n, count = len(modes), len(states)
    if not n or not count:
        return np.zeros((n, count)), np.zeros((n, count)), np.zeros((n, count), bool)
    mean, variance, scatter, unlike, seen, runs = (
        np.array([getattr(state, name) for state in states], float)
        for name in ("mean", "variance", "scatter", "unlike", "seen", "runs")
    )
    off = modes.log_hz[:, None] - mean
    total = variance + scatter + modes.variance[:, None]
    nu = _KNOWN + seen  # of Student's t, whose density follows
    level = scipy.special.gammaln((nu + 1) / 2) - scipy.special.gammaln(nu / 2)
    near = level - np.log(nu * np.pi * total) / 2 - (nu + 1) / 2 * np.log1p(off**2 / (nu * total))
    changed = np.log(_CHANGED / (2 * SAME_MODE))
    cost: FloatArray = -np.logaddexp(np.log1p(-_CHANGED) + near, changed)
    likeness = _mac(modes.shapes, np.array([state.shape for state in states]))
    # where a mode may as well be another track's by its frequency, shapes mix
    reach = 2 * np.sqrt(modes.variance[:, None] + np.minimum(variance, modes.variance[:, None]))
    reach = np.where(modes.stated[:, None], reach, _MIXING)
    within = np.abs(off) < reach
    mixing = within & (within.sum(axis=1) > 1)[:, None]
    for i in np.flatnonzero(mixing.any(axis=1)):
        others = np.flatnonzero(within[i])
        likeness[i, others] = _in_span(modes.shapes[i], [states[k].shape for k in others.tolist()])
    d = np.minimum(unlike + modes.unlike[:, None], _ANYTHING)
    # over the density 1 of a MAC of two shapes that have nothing to do with each other
    same = -(1 - likeness) / d - np.log(d * -np.expm1(-1 / d))
    cost -= np.nan_to_num(same)
    cost -= np.log((1 + seen) / (2 + runs))
    cost[np.abs(off) > np.log1p(SAME_MODE)] = _FORBIDDEN
    return cost, likeness, mixing


def _missing(states: Sequence[_TrackState]) -> FloatArray:
    """(K,) negative log likelihoods that tracks are missing."""
    return np.array([-np.log1p(-(1 + state.seen) / (2 + state.runs)) for state in states])


def _assigned(cost: FloatArray, states: Sequence[_TrackState]) -> list[tuple[int, int]]:
    """Modes and the tracks that they continue: the assignment in which everything that is left is
    a new mode or a missing track.
    """
    n, count = cost.shape
    if not n or not count:
        return []
    whole = np.full((n + count, n + count), _FORBIDDEN)
    whole[:n, :count] = cost
    whole[np.arange(n), count + np.arange(n)] = -np.log(_SPURIOUS)
    whole[n + np.arange(count), np.arange(count)] = _missing(states)
    whole[n:, count:] = 0.0
    rows, columns = scipy.optimize.linear_sum_assignment(whole)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(i, k) for i, k in pairs if i < n and k < count]


def _identity_sd(
    modes: _Modes,
    cost: FloatArray,
    chosen: Sequence[tuple[int, int]],
    states: Sequence[_TrackState],
) -> tuple[float, ...]:
    """(n,) root of the mean square of what it would do to ln f if a mode were another track's, by
    the probability of that: two are swapped, or a mode is one of a track that seems to be missing.
    """
    variance, missing = np.zeros(len(modes)), _missing(states)
    taken = {k: i for i, k in chosen}
    for i, k in chosen:
        for other, state in enumerate(states):
            if other == k or cost[i, other] >= _FORBIDDEN:
                continue
            j = taken.get(other)
            if j is None:
                more = cost[i, other] + missing[k] - cost[i, k] - missing[other]
                shift = state.mean - states[k].mean
            else:
                more = cost[i, other] + cost[j, k] - cost[i, k] - cost[j, other]
                shift = modes.log_hz[i] - modes.log_hz[j]
            variance[i] += float(scipy.special.expit(-more)) * shift**2
    return tuple(np.sqrt(variance).tolist())


def _learn(state: _TrackState, modes: _Modes, i: int, likeness: float, *, mixed: bool) -> None:
    """Update a state by the mode that continues its track."""
    x, stated = float(modes.log_hz[i]), float(modes.variance[i])
    noise = state.scatter + stated
    off = x - state.mean
    gain = state.variance / (state.variance + noise)
    # of the difference, what is the scatter's: the step of an EM for a sum of two variances
    total = state.variance + noise
    share = state.scatter / total
    scatter = (share * off) ** 2 + state.scatter * (1 - share)
    known = _KNOWN + state.seen
    state.scatter += (scatter - state.scatter) / known
    state.mean += gain * off
    state.variance *= 1 - gain
    state.seen += 1
    state.total += x
    shape = _unit(modes.shapes[i])
    if np.isnan(likeness):
        if np.isnan(state.shape).all():
            state.shape = shape
        return
    state.unlike += (1 - float(likeness) - state.unlike) / (_KNOWN + state.compared + 1)
    state.unlike = max(state.unlike, 1e-3)  # a shape of three digits
    state.compared += 1
    if mixed:
        return
    both = ~np.isnan(shape) & ~np.isnan(state.shape)
    turn = complex(np.vdot(shape[both], state.shape[both]))
    shape = shape * (turn / max(abs(turn), 1e-300))
    weight = max(1 / (1 + state.compared), 0.1)
    mixed_in = np.where(np.isnan(shape), state.shape, (1 - weight) * state.shape + weight * shape)
    state.shape = _unit(np.where(np.isnan(state.shape), shape, mixed_in))


def _unit(shape: ComplexArray) -> ComplexArray:
    """A shape of unit norm."""
    size = np.sqrt(np.nansum(np.abs(shape) ** 2))
    unit: ComplexArray = shape / size if size > 0 else shape * np.nan
    return unit


def _mac(shapes: ComplexArray, others: ComplexArray) -> FloatArray:
    """(n, K) MAC at the degrees of freedom that two shapes share; NaN where these are too few."""
    there, known = ~np.isnan(shapes), ~np.isnan(others)
    a, b = np.where(there, shapes, 0), np.where(known, others, 0)
    sizes = (np.abs(a) ** 2 @ known.T) * (there @ (np.abs(b) ** 2).T)
    shared = there.astype(int) @ known.T.astype(int)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.abs(a.conj() @ b.T) ** 2 / sizes
    return np.where((shared >= FEWEST_DOFS) & (sizes > 0), np.clip(value, 0, 1), np.nan)


def _in_span(shape: ComplexArray, others: Sequence[ComplexArray]) -> float:
    """The share of a shape in the span of others; NaN where they share too few degrees of
    freedom.
    """
    known = [other for other in others if not np.isnan(other).all()]
    both = ~np.isnan(shape)
    for other in known:
        both &= ~np.isnan(other)
    if not known or both.sum() < max(FEWEST_DOFS, len(known) + 1):
        return np.nan
    basis, _ = np.linalg.qr(np.array([other[both] for other in known]).T)
    size = float(np.sum(np.abs(shape[both]) ** 2))
    return float(np.sum(np.abs(basis.conj().T @ shape[both]) ** 2)) / size if size > 0 else np.nan


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
