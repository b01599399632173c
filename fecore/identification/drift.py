"""How the structure drifted between the FRFs, and the FRFs as they would be without it.

Temperature, a moved sensor or a loosened support turn all natural frequencies of FRF i by a common factor 1 + d_i. Where a
resonance is as narrow as the drift, the FRFs do not fit one series: the damping comes out too large and halves of modes
appear. At
the fitted series the drift of each FRF is a regression of its residual on its own slope, d_i = Re(J_iᴴW r_i)/(J_iᴴW J_i),
J_i = ∂H_i/∂ln ω.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import Terms, columns
from fecore.identification.gains import in_band
from fecore.identification.refinement import Fit, frequency_slope
from fecore.identification.residues import weights
from fecore.identification.shapes import of_rank_two

_FEWEST = 4  # FRFs of which a drift can be found
_CLEAR = 4.0  # mean square of the drifts over their own variance from which they are believed
_ALIKE = 0.5  # scatter within the sessions over that between them, from which each FRF has a drift of its own
_MOST = 0.005  # relative drift beyond which an FRF is another structure's, and is left as it is


@dataclass(frozen=True)
class Drift:
    """Relative drifts of the FRFs (N,), and their standard deviation."""

    each: FloatArray
    sd: float

    def plus(self, more: Drift) -> Drift:
        """Both one after the other."""
        each = self.each + more.each
        return Drift(each, float(np.std(each)))


def drift_of(arrangement: Arrangement, fit: Fit) -> Drift | None:
    """The drift of each FRF against the series; None where it is within its own uncertainty."""
    if len(arrangement.pairs) < _FEWEST:
        return None
    inside = in_band(arrangement, fit.terms.frequency_hz)
    # Two modes in one pole move it from FRF to FRF without any drift.
    inside &= ~of_rank_two(arrangement, *fit.residues())
    if not inside.any():
        return None
    slope = frequency_slope(arrangement, fit, inside)
    weight = weights(arrangement, fit.variance)
    information = np.maximum(np.sum(weight * np.abs(slope) ** 2, axis=1), 1e-300)
    each = np.sum(weight * (slope.conj() * fit.residual).real, axis=1) / information
    if np.mean(np.minimum(each**2 * information / fit.inflation, 1e3)) < _CLEAR:
        return None
    each = _pooled(arrangement, np.where(np.abs(each) < _MOST, each, 0.0), information)
    return Drift(each - np.mean(each), float(np.std(each)))


def _pooled(arrangement: Arrangement, each: FloatArray, information: FloatArray) -> FloatArray:
    """The drifts, one for all FRFs of a session where these agree better with each other than with the others'."""
    groups = session_of(arrangement)
    count = np.bincount(groups)
    if count.max() == 1:
        return each
    weight = information / np.median(information[information > 0])
    weight = np.minimum(weight, 10.0)  # one strong FRF must not speak for its session alone
    mean = np.bincount(groups, weight * each) / np.maximum(np.bincount(groups, weight), 1e-300)
    within = float(np.mean((each - mean[groups]) ** 2))
    return mean[groups] if within < _ALIKE * float(np.var(mean)) else each


def aligned(arrangement: Arrangement, fit: Fit, drift: Drift) -> Arrangement:
    """The FRFs less what the drift of the poles makes of the fitted series."""
    inside = in_band(arrangement, fit.terms.frequency_hz)
    hz, zeta = fit.terms.frequency_hz[inside], fit.terms.damping_ratio[inside]
    pairs = fit.linear.coefficients[:, : 2 * fit.terms.pairs].reshape(len(drift.each), -1, 2)[:, inside]
    pairs = pairs.reshape(len(drift.each), -1)
    still = pairs @ columns(arrangement.omega, Terms(hz, zeta, ()), arrangement.power).T
    values = arrangement.values.copy()
    for row, own in enumerate(drift.each):
        moved = columns(arrangement.omega, Terms(hz * (1 + own), zeta, ()), arrangement.power)
        values[row] -= moved @ pairs[row] - still[row]
    return replace(arrangement, values=np.where(arrangement.measured, values, 0))


def session_of(arrangement: Arrangement) -> IntArray:
    """(N,) number of the test that each FRF belongs to: the sensors of one hit, or the hits of one sensor, share theirs."""
    side = max((0, 1), key=lambda i: len({pair[i] for pair in arrangement.pairs}))
    dofs = sorted({pair[side] for pair in arrangement.pairs})
    place = {dof: number for number, dof in enumerate(dofs)}
    return np.array([place[pair[side]] for pair in arrangement.pairs], dtype=np.int64)


def sessions(arrangement: Arrangement) -> int:
    """Number of tests that may have drifted on their own."""
    return int(session_of(arrangement).max()) + 1
