"""Whether a pole comes back from order to order: the stabilisation diagram as a witness.

A resonance is found by linear estimates of nearly every order that is large enough; a pole that one order needs for its errors
is elsewhere in the next. Over a whole band of many modes the poles of any order are too few for all of them, so each pole is
also looked for in a band of its own about it.
"""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.errors import IdentificationError
from fecore.identification.gains import in_band
from fecore.identification.lscf import lscf
from fecore.identification.refinement import Fit
from fecore.identification.search import Search
from fecore.identification.stabilisation import Stabilisation

_REACH_WIDTHS, _REACH_LINES = 8.0, 30  # half of a pole's own band: half bandwidths, and at least lines
_HIGHEST = 24  # order of the local models
_FEWEST_LINES = 20  # of a local band that a model is fitted to
MOVED = 0.75
"""Half bandwidths (of at least a line, of halves half a line) between two fits up to which a pole is the same."""

BROADER = 2.5
"""Ratio of the damping of two fits up to which a pole is the same."""


def comes_back(search: Search, fit: Fit, diagram: Stabilisation) -> FloatArray:
    """(n,) share of the orders in which each pole of a series is found again, 0 to 1; 0 for poles out of band.

    The larger of two shares: of the upper half of the diagram's orders over the whole band, and of the upper two thirds of the
    orders in a band about the pole.
    """
    line = search.arrangement.spacing_hz
    share = np.zeros(fit.terms.pairs)
    # The drift's part has its largest value at a resonance, and would hide it from a linear fit.
    variance = search.errors.noise
    for k in np.flatnonzero(in_band(search.arrangement, fit.terms.frequency_hz)):
        f = float(fit.terms.frequency_hz[k])
        half = max(f * float(fit.terms.damping_ratio[k]), line / 2)
        top = int(diagram.order.max())
        whole = _share(diagram.order, diagram.frequency_hz, diagram.damping_ratio, f, (half, line), (top // 2, top))
        share[k] = max(whole, _near(search, variance, f, half))
    return share


def _near(search: Search, variance: FloatArray, f: float, half: float) -> float:
    """The share in a band about the pole."""
    arrangement = search.arrangement
    reach = max(_REACH_WIDTHS * half, _REACH_LINES * arrangement.spacing_hz)
    band = np.abs(arrangement.frequency_hz - f) <= reach
    if band.sum() < _FEWEST_LINES:
        return 0.0
    top = min(_HIGHEST, int(band.sum()) // 3)
    one = slice(None), None, band
    try:
        found = lscf(
            arrangement.omega[band],
            arrangement.values[one],
            arrangement.measured[one],
            1 / variance[:, band],
            tuple(range(max(2, top // 3), top + 1)),  # the orders whose share is asked
        )
    except IdentificationError:  # lines without weight in this band: nothing can be said
        return 0.0
    return _share(
        found.order, found.frequency_hz, found.damping_ratio, f, (half, arrangement.spacing_hz), (top // 3, top)
    )


def _share(
    order: IntArray, hz: FloatArray, zeta: FloatArray, f: float, widths: tuple[float, float], orders: tuple[int, int]
) -> float:
    """Share of the orders, both ends included, that have a pole like this one; bandwidth and line spacing are `widths`."""
    half, line = widths
    broader = np.abs(np.log(np.maximum(zeta * hz, line) / max(half, line)))
    like = (np.abs(hz - f) < MOVED * max(half, line)) & (broader < np.log(BROADER))
    seen = np.unique(order[like])
    return float(np.sum((seen >= orders[0]) & (seen <= orders[1])) / (orders[1] - orders[0] + 1))
