"""What is known of a track, the likelihoods by which it is continued, and what it learns.

The equations stand in `fecore.trend.tracking`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.errors import InputError

Shape = Mapping[tuple[int, int], complex]
"""(grid point, axis 1 to 6) to the value of a mode shape along the positive axis."""

# relative change of frequency from one run to the next up to which two modes may be the same
SAME_MODE = 0.15
FEWEST_DOFS = 3
"""Shared degrees of freedom from which on shapes are compared: any two shapes at one of them have a
MAC of 1.
"""

SCATTER = 0.015  # sd of ln f between runs before any is known: seasons, boundaries
_MIXING = 0.005  # relative distance within which shapes mix, where no sd is stated
DRIFT = 0.01  # sd of a random walk of ln f over a month
WIDEST = 0.05  # sd of ln f up to which that grows
DAYS_A_MONTH = 30.4  # between runs without dates, too
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
class TrackState:
    """What is known of a track."""

    number: int  # from 0, in the order in which tracks begin
    mean: float  # m, of ln f
    variance: float  # P
    shape: ComplexArray  # (D,) of unit norm; NaN where it is not known
    scatter: float = SCATTER**2  # v
    unlike: float = _UNLIKE  # d, mean of 1 − MAC
    seen: int = 1
    compared: int = 0  # sightings with a shape
    runs: int = 1  # since it began
    missed: int = 0  # runs since it was last there


@dataclass(frozen=True)
class Modes:
    """The n modes of a run."""

    log_hz: FloatArray  # (n,)
    variance: FloatArray  # (n,) of these, 0 where it is not stated
    stated: BoolArray  # (n,) whether it is
    shapes: ComplexArray  # (n, D), NaN where a shape has no value
    unlike: FloatArray  # (n,) mean of 1 − MAC by the shapes' own variance

    def __len__(self) -> int:
        return self.log_hz.size

    @classmethod
    def of(cls, run: Sequence[TrackedMode], dofs: Sequence[tuple[int, int]]) -> "Modes":
        """Those of a run, their shapes at these degrees of freedom."""
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


def costs(modes: Modes, states: Sequence[TrackState]) -> tuple[FloatArray, FloatArray, BoolArray]:
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


def missing(states: Sequence[TrackState]) -> FloatArray:
    """(K,) negative log likelihoods that tracks are missing."""
    return np.array([-np.log1p(-(1 + state.seen) / (2 + state.runs)) for state in states])


def assigned(cost: FloatArray, states: Sequence[TrackState]) -> list[tuple[int, int]]:
    """Modes and the tracks that they continue: the assignment in which everything that is left is
    a new mode or a missing track.
    """
    n, count = cost.shape
    if not n or not count:
        return []
    whole = np.full((n + count, n + count), _FORBIDDEN)
    whole[:n, :count] = cost
    whole[np.arange(n), count + np.arange(n)] = -np.log(_SPURIOUS)
    whole[n + np.arange(count), np.arange(count)] = missing(states)
    whole[n:, count:] = 0.0
    rows, columns = scipy.optimize.linear_sum_assignment(whole)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(i, k) for i, k in pairs if i < n and k < count]


def identity_sd(
    modes: Modes,
    cost: FloatArray,
    chosen: Sequence[tuple[int, int]],
    states: Sequence[TrackState],
) -> tuple[float, ...]:
    """(n,) root of the mean square of what it would do to ln f if a mode were another track's, by
    the probability of that: two are swapped, or a mode is one of a track that seems to be missing.
    """
    variance, absent = np.zeros(len(modes)), missing(states)
    taken = {k: i for i, k in chosen}
    for i, k in chosen:
        for other, state in enumerate(states):
            if other == k or cost[i, other] >= _FORBIDDEN:
                continue
            j = taken.get(other)
            if j is None:
                more = cost[i, other] + absent[k] - cost[i, k] - absent[other]
                shift = state.mean - states[k].mean
            else:
                more = cost[i, other] + cost[j, k] - cost[i, k] - cost[j, other]
                shift = modes.log_hz[i] - modes.log_hz[j]
            variance[i] += float(scipy.special.expit(-more)) * shift**2
    return tuple(np.sqrt(variance).tolist())


def learned(state: TrackState, modes: Modes, i: int, likeness: float, *, mixed: bool) -> TrackState:
    """The state after the mode that continues its track."""
    x, stated = float(modes.log_hz[i]), float(modes.variance[i])
    off = x - state.mean
    # of the difference, what is the scatter's: the step of an EM for a sum of two variances
    total = state.variance + state.scatter + stated
    gain, share = state.variance / total, state.scatter / total
    scatter = (share * off) ** 2 + state.scatter * (1 - share)
    after = replace(
        state,
        scatter=state.scatter + (scatter - state.scatter) / (_KNOWN + state.seen),
        mean=state.mean + gain * off,
        variance=state.variance * (1 - gain),
        seen=state.seen + 1,
        missed=0,
    )
    shape = unit(modes.shapes[i])
    if np.isnan(likeness):
        return replace(after, shape=shape) if np.isnan(state.shape).all() else after
    unlike = state.unlike + (1 - float(likeness) - state.unlike) / (_KNOWN + state.compared + 1)
    compared = state.compared + 1
    # at least that of a shape of three digits
    after = replace(after, unlike=max(unlike, 1e-3), compared=compared)
    if mixed:
        return after
    both = ~np.isnan(shape) & ~np.isnan(state.shape)
    turn = complex(np.vdot(shape[both], state.shape[both]))
    shape = shape * (turn / max(abs(turn), 1e-300))
    weight = max(1 / (1 + compared), 0.1)
    mixed_in = np.where(np.isnan(shape), state.shape, (1 - weight) * state.shape + weight * shape)
    return replace(after, shape=unit(np.where(np.isnan(state.shape), shape, mixed_in)))


def unit(shape: ComplexArray) -> ComplexArray:
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
