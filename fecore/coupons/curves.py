"""Raw curves of a tensile test, the checks at their door, and the chord between two strains.

Ends of a chord range: both standards say to use the closest measured points where none lies exactly
at the end, and then Δσ/Δε between those points; that is the default, `nearest`. `interpolated`
takes σ at exactly the ends, linearly between the neighbours. For a curve sampled as the standards
ask (100 points or more) they differ by far less than the gauge does.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError

Ends = Literal["nearest", "interpolated"]

FEWEST_POINTS = 5
"""Measured points that a chord range must hold; the two ends alone would hide a slipped gauge
between them.
"""

RESTART = 0.1
"""A run that falls back by this share of its maximum force and of its strain, and rises again, was
restarted.
"""

BACKWARD = 0.02
"""Strain that runs back within a chord range by more than this share of it is a slipped gauge, not
noise.
"""

# a step of strain this many times the steps around it is a jump of the extensometer, not of the
# specimen
JUMP = 10.0
LEAST_JUMP = 500e-6  # m/m; a smaller step spoils no result that is read off the curve
_STEPS_AROUND = 10  # on each side of a step that may be a jump
_END_TOLERANCE = 0.05  # of the range's length: how far the closest point may lie from an end
_LARGEST_STRAIN = 1.0  # m/m; above it the unit is surely another


@dataclass(frozen=True)
class Curve:
    """One tensile test as the machine recorded it, tension positive."""

    force_n: FloatArray  # (n,) force, N
    # (n,) longitudinal strain, m/m. NaN at the end only: a gauge that was lost or taken off before
    # failure
    strain: FloatArray
    strain_back: FloatArray | None = None  # (n,) the same on the other face, or None
    # (n,) transverse strain, m/m, negative in tension, or None
    transverse_strain: FloatArray | None = None
    time_s: FloatArray | None = None  # (n,) or None

    def __post_init__(self) -> None:
        n = self.force_n.size
        if self.force_n.ndim != 1 or n < FEWEST_POINTS:
            raise InputError(
                "force_n",
                f"has shape {self.force_n.shape}, expected at least {FEWEST_POINTS} points",
            )
        _check_finite("force_n", self.force_n)
        if not self.force_n.max() > 0:
            raise InputError("force_n", "is never positive; tension is positive, turn the sign")
        for name in ("strain", "strain_back", "transverse_strain", "time_s"):
            values = getattr(self, name)
            if values is None:
                continue
            if values.shape != (n,):
                raise InputError(name, f"has shape {values.shape}, expected ({n},) as the force")
            if name == "time_s":
                _check_finite(name, values)
            else:
                _check_strain(name, values)

    def __len__(self) -> int:
        return int(self.force_n.size)

    @property
    def mean_strain(self) -> FloatArray:
        """(n,) longitudinal strain, the mean of both faces where both are gauged."""
        return self.strain if self.strain_back is None else (self.strain + self.strain_back) / 2

    def part(self, start: int, stop: int) -> Curve:
        """Points start … stop − 1."""
        cut = slice(start, stop)
        others = (
            None if a is None else a[cut]
            for a in (self.strain_back, self.transverse_strain, self.time_s)
        )
        return Curve(self.force_n[cut], self.strain[cut], *others)


def restarts(curve: Curve) -> tuple[int, ...]:
    """Indices of the points at which a new run begins; empty for a single run.

    A run begins where time goes back, or where force and strain have both fallen back by `RESTART`
    of what they reached and then rise again by as much. The fall of force at failure is none:
    nothing rises after it.
    """
    starts = (
        []
        if curve.time_s is None
        else [int(i) + 1 for i in np.flatnonzero(np.diff(curve.time_s) < 0)]
    )
    force = curve.force_n
    # a lost gauge runs nowhere
    strain = np.nan_to_num(curve.mean_strain, nan=float(np.nanmax(curve.mean_strain)))
    fall, whole = RESTART * float(force.max()), RESTART * float(strain.max())
    start = 0
    while True:
        back = (np.maximum.accumulate(force[start:]) - force[start:] > fall) & (
            np.maximum.accumulate(strain[start:]) - strain[start:] > whole
        )
        if not back.any():
            break
        first = start + int(np.argmax(back))
        rises = force[first:] - np.minimum.accumulate(force[first:]) > fall
        if not rises.any():
            break
        again = first + int(np.argmax(rises))
        start = first + int(np.argmin(force[first:again]))
        starts.append(start)
        start = again
    return tuple(sorted(set(starts)))


def split_runs(curve: Curve) -> tuple[Curve, ...]:
    """The runs of a recording, in order, for the caller to choose from.

    Raises:
        InputError: a run has too few points to be a curve.
    """
    borders = [0, *restarts(curve), len(curve)]
    return tuple(curve.part(a, b) for a, b in itertools.pairwise(borders))


def single_run(curve: Curve) -> Curve:
    """The curve up to its maximum force.

    Raises:
        InputError: the machine was restarted; names the points, so that the caller can choose a run
            from `split_runs`. Or the force is largest almost at once.
    """
    starts = restarts(curve)
    if starts:
        where = ", ".join(f"{i + 1} ({curve.force_n[i]:.6g} N)" for i in starts)
        raise InputError(
            "curve",
            f"the machine was restarted at point {where}; hand in one run of {len(starts) + 1}"
            " (split_runs)",
        )
    stop = int(np.argmax(curve.force_n)) + 1
    if stop < FEWEST_POINTS:
        raise InputError(
            "force_n",
            f"is largest at point {stop}, expected at least {FEWEST_POINTS} points up to there",
        )
    return curve.part(0, stop)


def jump(strain: FloatArray) -> int | None:
    """Index of the first point after a jump of the extensometer, or None.

    A clip that slips moves by one step that is large beside its neighbours on both sides. A
    specimen that yields, or a machine that records at another rate from some point on, makes large
    steps one after the other.

    Args:
        strain: (n,) m/m; NaN where it was lost.
    """
    step = np.abs(np.diff(strain))
    for i in np.flatnonzero(np.nan_to_num(step) > LEAST_JUMP):
        before, after = step[max(i - _STEPS_AROUND, 0) : i], step[i + 1 : i + 1 + _STEPS_AROUND]
        usual = [float(np.nanmedian(part)) for part in (before, after) if np.isfinite(part).any()]
        if usual and step[i] > JUMP * max(usual):
            return int(i) + 1
    return None


def without_jump(curve: Curve, warnings: list[str]) -> Curve:
    """The curve with its strains taken as lost from a jump of the extensometer on, which a warning
    then says.
    """
    strains = (curve.strain, curve.strain_back, curve.transverse_strain)
    jumps = [i for values in strains if values is not None and (i := jump(values)) is not None]
    if not jumps:
        return curve
    at = min(jumps)
    warnings.append(
        f"a strain jumps at point {at + 1} by more than {JUMP:g} times the steps around it: the"
        " extensometer slipped; strains from there on are left out"
    )
    lost = np.arange(len(curve)) >= at
    front, back, transverse = (
        None if values is None else np.where(lost, np.nan, values) for values in strains
    )
    assert front is not None
    return Curve(curve.force_n, front, back, transverse, curve.time_s)


@dataclass(frozen=True)
class Chord:
    """A chord range on a curve."""

    # start, stop: abscissae that were used, measured points or the exact ends
    start: float
    stop: float
    points: int  # measured points from end to end; with interpolated ends their neighbours count
    weights: FloatArray  # (2, n) that give any recorded quantity at the two ends

    def slope(self, y: FloatArray) -> float:
        """Δy / Δx between the ends."""
        return float((self.at(y)[1] - self.at(y)[0]) / (self.stop - self.start))

    def regression_slope(self, x: FloatArray, y: FloatArray) -> float:
        """Slope of the least-squares line through the measured points from end to end.

        The chord uses two points and feels the noise of both; the line uses all of them. Where the
        two differ by more than noise, the curve bends within the range.
        """
        tolerance = 1e-9 * (self.stop - self.start)  # ends that were computed by interpolation
        inside = (x >= self.start - tolerance) & (x <= self.stop + tolerance)
        inside &= np.arange(x.size) <= int(np.flatnonzero(np.any(self.weights != 0, axis=0))[-1])
        return float(np.polyfit(x[inside], y[inside], 1)[0])

    def at(self, y: FloatArray) -> FloatArray:
        """(2,) y at the ends."""
        used = np.any(self.weights != 0, axis=0)
        return np.asarray(self.weights[:, used] @ y[used])


def chord(x: FloatArray, start: float, stop: float, ends: Ends, field: str = "strain") -> Chord:
    """Chord range between two abscissae of a rising curve.

    Raises:
        InputError: the curve does not reach the range, runs back in it, or has too few points or
            none near its ends.
    """
    known = np.flatnonzero(np.isfinite(x))
    highest = float(x[known].max()) if known.size else float("nan")
    tolerance = _END_TOLERANCE * (stop - start)
    if not known.size or highest < stop - tolerance:
        raise InputError(
            field, f"reaches {highest * 1e6:.0f} µε only, the range is {_micro(start, stop)}"
        )
    if float(x[known].min()) > start + tolerance:
        raise InputError(
            field,
            f"begins at {x[known].min() * 1e6:.0f} µε only, the range is {_micro(start, stop)}",
        )
    last = int(np.argmax(np.nan_to_num(x, nan=-np.inf) >= min(stop, highest)))
    first = int(np.flatnonzero(x[: last + 1] <= max(start, float(x[: last + 1].min())))[-1])
    inside = x[first : last + 1]
    back = np.maximum.accumulate(inside) - inside
    if back.max() > BACKWARD * (stop - start):
        at = first + int(np.argmax(back))
        raise InputError(
            field,
            f"runs back by {back.max() * 1e6:.0f} µε at point {at + 1}, within"
            f" {_micro(start, stop)}",
        )
    weights = np.array(
        [_end_weights(x, level, ends, max(first - 1, 0), last + 2) for level in (start, stop)]
    )
    used = weights != 0
    reached = np.where(used, x, 0.0)
    a, b = float(weights[0] @ reached[0]), float(weights[1] @ reached[1])
    if ends == "nearest" and max(abs(a - start), abs(b - stop)) > tolerance:
        raise InputError(
            field,
            f"the closest points to {_micro(start, stop)} are at {a * 1e6:.0f} and {b * 1e6:.0f}"
            " µε, too far; record more points or ask for interpolated ends",
        )
    spanned = np.flatnonzero(used.any(axis=0))
    points = int(spanned[-1] - spanned[0]) + 1
    if points < FEWEST_POINTS:
        raise InputError(
            field,
            f"{points} points within {_micro(start, stop)}, expected at least {FEWEST_POINTS}",
        )
    return Chord(a, b, points, weights)


def _end_weights(x: FloatArray, level: float, ends: Ends, low: int, high: int) -> FloatArray:
    """(n,) weights of the points that stand for one end; the points `low` to `high` are looked
    at.
    """
    weights = np.zeros(x.size)
    window = x[low:high]
    if ends == "nearest":
        weights[low + int(np.nanargmin(np.abs(window - level)))] = 1.0
        return weights
    above = low + int(np.argmax(np.nan_to_num(window, nan=-np.inf) >= level))
    if x[above] < level or (above == low and x[above] > level):
        raise InputError(
            "strain", f"has no points on both sides of {level * 1e6:.0f} µε to interpolate between"
        )
    if x[above] == level:
        weights[above] = 1.0
        return weights
    share = (level - x[above - 1]) / (x[above] - x[above - 1])
    weights[above - 1], weights[above] = 1 - share, share
    return weights


@dataclass(frozen=True)
class Reduced:
    """What both standards report of a specimen, SI."""

    # width_m, thickness_m, area_m2: means of the readings, and their product
    width_m: float
    thickness_m: float
    area_m2: float
    modulus_pa: float  # chord modulus
    # slope of the least-squares line through all points of the chord range
    regression_modulus_pa: float
    chord_range: tuple[float, float]  # strains that were used, m/m; of a shear test γ
    warnings: tuple[str, ...]  # what a reader of the report must know


def mean_dimension(field: str, readings: Sequence[float]) -> float:
    """Mean of dimension readings, m.

    Raises:
        InputError: no reading, one that is not positive, or readings so far apart that one must be
            in another unit.
    """
    values = np.asarray(readings, float)
    if values.size == 0:
        raise InputError(field, "has no reading")
    if not np.all(np.isfinite(values)) or np.any(values <= 0):
        raise InputError(field, "has a reading that is not a positive number")
    if values.max() > 2 * values.min():
        raise InputError(
            field,
            f"has readings from {values.min():g} to {values.max():g} m; is one in another unit?",
        )
    return float(values.mean())


def _check_finite(name: str, values: FloatArray) -> None:
    bad = ~np.isfinite(values)
    if bad.any():
        raise InputError(
            name, f"is not a number at point {int(np.argmax(bad)) + 1} of {values.size}"
        )


def _check_strain(name: str, values: FloatArray) -> None:
    if np.any(np.isinf(values)):
        raise InputError(name, f"is infinite at point {int(np.argmax(np.isinf(values))) + 1}")
    known = np.flatnonzero(np.isfinite(values))
    if known.size == 0:
        raise InputError(name, "has no number")
    gaps = np.flatnonzero(np.isnan(values[: known[-1]]))
    if gaps.size:
        raise InputError(
            name, f"is not a number at point {gaps[0] + 1}, and is again later; fill or cut the gap"
        )
    if np.nanmax(np.abs(values)) > _LARGEST_STRAIN:
        raise InputError(
            name, f"reaches {np.nanmax(np.abs(values)):.4g} m/m; is it in µε or per cent?"
        )


def _micro(start: float, stop: float) -> str:
    return f"{start * 1e6:.0f}–{stop * 1e6:.0f} µε"
