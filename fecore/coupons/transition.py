"""Transition strain: where the two straight parts of a bilinear stress–strain curve meet (ASTM D3039).

Two least-squares lines, one up to a break and one after it, for every break; the pair with the smallest misfit gives the
strain at which they intersect. A transition is reported only where the curve has a knee: the two lines must explain it better
than a cubic, which has as many coefficients and no knee, and their slopes must differ.
"""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray

LEAST_SLOPE_CHANGE = 0.03
"""Relative change of slope below which there is no transition."""

_FEWEST = 8  # points of each line
_EVIDENCE = 10.0  # difference of n ln(misfit) between cubic and two lines: "very strong" (Kass and Raftery 1995)


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
    sxx, sxy, syy = (
        np.cumsum(x * x) - sx**2 / count,
        np.cumsum(x * y) - sx * sy / count,
        np.cumsum(y * y) - sy**2 / count,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where(sxx > 0, sxy**2 / sxx, 0.0)
    return np.maximum(syy - explained, 0.0)


def knee_warning(strain: FloatArray, stress: FloatArray, start: float, stop: float) -> list[str]:
    """A sentence where the curve has a knee within a chord range, whose modulus is then of neither part; else nothing.

    The whole curve is searched, and then the range with as much again on either side: a knee in the first tenth of a
    long curve that bends later is too small a part of the whole to stand out there.

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
                f"the curve has a knee at {knee * 1e6:.0f} µε, within the chord from {start * 1e6:.0f} to "
                f"{stop * 1e6:.0f}: the modulus mixes two slopes; choose a range on one side of it"
            ]
    return []
