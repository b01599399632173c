"""ASTM D3039: tensile properties of one specimen from its raw curve and its dimension readings.

    A = w̄ t̄                     area, from the mean width and the mean thickness readings
    F = P_max / A                strength;  ε_u = ε at P_max, ultimate strain
    E = Δσ / Δε                  chord modulus, 1000–3000 µε; 25–50 % of ε_u where the specimen fails below 6000 µε
    ν = −Δε_t / Δε               over the same range
    B = 100 |ε_f − ε_b| / |ε_f + ε_b|   percent bending of two gauged faces, at the middle of the chord range

The standard takes the area as the mean of w t at three places; the product of the means differs
from it by the covariance of width and thickness, below 0.01 % for readings that vary by 1 %.

Transition strain: where the two straight parts of a bilinear stress–strain curve meet (ASTM D3039).

Two least-squares lines, one up to a break and one after it, for every break; the pair with the
smallest misfit gives the strain at which they intersect. A transition is reported only where the
curve has a knee: the two lines must explain it better than a cubic, which has as many coefficients
and no knee, and their slopes must differ.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.coupons.curves import (
    Chord,
    Curve,
    Ends,
    Reduced,
    chord,
    mean_dimension,
    single_run,
    without_jump,
)
from fecore.errors import InputError

LEAST_SLOPE_CHANGE = 0.03  # relative change of slope below which there is no transition
_FEWEST = 8  # points of each line
# difference of n ln(misfit) between cubic and two lines: "very strong" (Kass and Raftery 1995)
_EVIDENCE = 10.0


def transition_strain(strain: FloatArray, stress: FloatArray) -> float | None:
    """Strain at the intersection of the two lines, m/m, or None where the curve has no knee."""
    known = np.isfinite(strain)
    x, y = strain[known], stress[known]
    n = x.size
    if n < 2 * _FEWEST or np.ptp(x) == 0:
        return None
    x0, scale = x[0], np.ptp(x)
    u = (x - x0) / scale
    head = _line_misfits(u, y)
    tail = _line_misfits(u[::-1], y[::-1])[::-1]
    breaks = np.arange(_FEWEST, n - _FEWEST + 1)
    misfit = head[breaks - 1] + tail[breaks]
    best = int(breaks[np.argmin(misfit)])
    (b1, a1), (b2, a2) = np.polyfit(u[:best], y[:best], 1), np.polyfit(u[best:], y[best:], 1)
    cubic = float(np.sum((y - np.polyval(np.polyfit(u, y, 3), u)) ** 2))
    floor = 1e-24 * float(np.sum(y**2))  # exact lines leave nothing to divide by
    gain = n * np.log((cubic + floor) / (float(misfit.min()) + floor))
    if gain < _EVIDENCE or abs(b2 - b1) < LEAST_SLOPE_CHANGE * max(abs(b1), abs(b2)):
        return None
    meeting = (a1 - a2) / (b2 - b1)
    return float(x0 + scale * meeting) if u[0] < meeting < u[-1] else None


def _line_misfits(x: FloatArray, y: FloatArray) -> FloatArray:
    """(n,) sum of squared residuals of the line through the first 1, 2 … n points."""
    count = np.arange(1, x.size + 1)
    y = y - y.mean()
    sx, sy = np.cumsum(x), np.cumsum(y)
    sxx, sxy = np.cumsum(x * x) - sx**2 / count, np.cumsum(x * y) - sx * sy / count
    syy = np.cumsum(y * y) - sy**2 / count
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where(sxx > 0, sxy**2 / sxx, 0.0)
    return np.maximum(syy - explained, 0.0)


def knee_warning(strain: FloatArray, stress: FloatArray, start: float, stop: float) -> list[str]:
    """A sentence where the curve has a knee within a chord range, whose modulus is then of neither
    part; else nothing.

    The whole curve is searched, and then the range with as much again on either side: a knee in the
    first tenth of a long curve that bends later is too small a part of the whole to stand out
    there.

    Args:
        strain: (n,) m/m.
        stress: (n,) Pa.
        start: lower end of the chord, m/m.
        stop: its upper end, m/m.
    """
    length = stop - start
    near = (strain >= start - length) & (strain <= stop + length)
    for x, y in ((strain, stress), (strain[near], stress[near])):
        knee = transition_strain(x, y)
        if knee is not None and start < knee < stop:
            return [
                f"the curve has a knee at {knee * 1e6:.0f} µε, within the chord from"
                f" {start * 1e6:.0f} to {stop * 1e6:.0f}: the modulus mixes two slopes; choose a"
                " range on one side of it"
            ]
    return []


# m/m; within the lower half of the curve of a specimen that reaches 6000 µε
CHORD_RANGE = (1000e-6, 3000e-6)
# share of the ultimate strain, for a specimen that fails below `LOW_ULTIMATE`
SHORT_RANGE = (0.25, 0.50)
LOW_ULTIMATE = 6000e-6  # m/m
MOST_BENDING_PERCENT = 5.0  # bending above which the standard sees poor alignment (3 to 5 %)


@dataclass(frozen=True)
class TensileResult(Reduced):
    """What D3039 reports of a specimen, SI."""

    # maximum_force_n, strength_pa: P_max and F
    maximum_force_n: float
    strength_pa: float
    ultimate_strain: float | None  # m/m; None where the gauge was lost before the maximum force
    poisson_ratio: float | None  # None without a transverse strain
    transition_strain: float | None  # None where the curve has no knee
    bending_percent: float | None  # None where one face is gauged


def reduce(
    curve: Curve,
    width_m: Sequence[float],
    thickness_m: Sequence[float],
    chord_range: tuple[float, float] | None = None,
    ends: Ends = "nearest",
) -> TensileResult:
    """Reduce one specimen.

    Args:
        curve: a single run.
        width_m: readings along the gauge section, m; three by the standard.
        thickness_m: the same for the thickness.
        chord_range: strains between which the modulus is taken, where neither of the standard's
            ranges suits.
        ends: `nearest` measured points, as the standard says, or `interpolated`.

    Raises:
        InputError: readings, a curve or a range that cannot be reduced; says which and where.
    """
    width, thickness = (
        mean_dimension("width_m", width_m),
        mean_dimension("thickness_m", thickness_m),
    )
    area = width * thickness
    warnings = (
        []
        if thickness <= width
        else ["the thickness is larger than the width; are they exchanged?"]
    )
    run = without_jump(single_run(curve), warnings)
    strain, stress = run.mean_strain, run.force_n / area
    force = float(run.force_n.max())
    ultimate = float(strain[-1]) if np.isfinite(strain[-1]) else None
    start, stop = chord_range or _standard_range(strain, run.force_n, ultimate, warnings)
    if not 0 <= start < stop:
        raise InputError("chord_range", f"is {start} to {stop}, expected two rising strains, m/m")
    try:
        line = chord(strain, start, stop, ends)
    except InputError as error:  # a jump of the gauge may be the reason
        raise InputError(error.field, "; ".join([error.message, *warnings])) from error
    modulus = line.slope(stress)
    if modulus <= 0:
        raise InputError(
            "curve", "the force falls over the chord range; are force and strain of one test?"
        )
    warnings += knee_warning(strain, stress, line.start, line.stop)
    bending = _bending_percent(run, line)
    if bending is not None and bending > MOST_BENDING_PERCENT:
        warnings.append(
            f"{bending:.1f} % bending, more than {MOST_BENDING_PERCENT:.0f} %: see to the alignment"
        )
    ratio = _poisson_ratio(run, line)
    if ratio is not None and ratio < 0:
        warnings.append(
            f"Poisson's ratio is {ratio:.3f}: the transverse strain grows with the force; is its sign"
            " turned?"
        )
    return TensileResult(
        width_m=width,
        thickness_m=thickness,
        area_m2=area,
        maximum_force_n=force,
        strength_pa=force / area,
        ultimate_strain=ultimate,
        modulus_pa=modulus,
        regression_modulus_pa=line.regression_slope(strain, stress),
        chord_range=(line.start, line.stop),
        poisson_ratio=ratio,
        transition_strain=transition_strain(strain, stress),
        bending_percent=bending,
        warnings=tuple(warnings),
    )


def _standard_range(
    strain: FloatArray, force: FloatArray, ultimate: float | None, warnings: list[str]
) -> tuple[float, float]:
    """The standard's range for this specimen, by its ultimate strain, or by an estimate where the
    gauge was lost.
    """
    if ultimate is None:
        last = int(np.flatnonzero(np.isfinite(strain))[-1])
        reached = float(strain[last] * force.max() / force[last])
        warnings.append(
            f"the strain ends at {strain[last] * 1e6:.0f} µε before the maximum force; no ultimate"
            f" strain (about {reached * 1e6:.0f} µε in proportion to the force)"
        )
    else:
        reached = ultimate
    if reached <= 0:
        raise InputError(
            "strain",
            f"is {reached * 1e6:.0f} µε at the maximum force, expected above 0: is its sign turned, or"
            " is it the transverse gauge's?",
        )
    if reached >= LOW_ULTIMATE:
        return CHORD_RANGE
    if ultimate is None:
        raise InputError(
            "strain", "was lost too early to choose the chord range; state chord_range"
        )
    warnings.append(
        f"failed at {ultimate * 1e6:.0f} µε, below 6000: the chord is from 25 to 50 % of it"
    )
    return SHORT_RANGE[0] * ultimate, SHORT_RANGE[1] * ultimate


def _poisson_ratio(run: Curve, line: Chord) -> float | None:
    if run.transverse_strain is None:
        return None
    ratio = -line.slope(run.transverse_strain)
    if not np.isfinite(ratio):
        raise InputError("transverse_strain", "was lost within the chord range")
    return ratio


def _bending_percent(run: Curve, line: Chord) -> float | None:
    if run.strain_back is None:
        return None
    middle = (line.start + line.stop) / 2
    at = int(np.nanargmin(np.abs(run.mean_strain - middle)))
    front, back = float(run.strain[at]), float(run.strain_back[at])
    return 100 * abs(front - back) / abs(front + back)
