"""The errors that a fit's own residual shows: sizes of noise, model error and drift, lines of interference.

The mean square of the residual over the FRFs is a sum of three known functions of frequency with unknown non-negative factors,
E|r_l|² = A n²_l + ε²|H_l|² + σ²|∂H_l/∂ln ω|². Noise and model error
lie in all combinations alike, a drift in the leading ones (it is of rank one for each mode). They are found by least squares
of relative errors, with single lines capped, and
are weighed with their priors by the number of data that each is worth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from fecore.arrays import IntArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.error_model import DRIFT, RELATIVE, ErrorModel
from fecore.identification.refinement import Fit
from fecore.identification.search import Search

_PRIOR_LINES = 5.0  # lines that the priors of ε² and σ² are worth
_MOST_DRIFT = 2 * DRIFT  # what seems more is another misfit
_CAP = 9.0  # times what is foretold: a line further off is capped
_PASSES = 6  # of the errors and their weights in turn
_LEAST_NOISE = 1e-3  # of the first estimate of the noise
# Growth of the noise in one step, and of ε and σ over their priors, while poles may be missing.
_MOST_NOISE, _MOST_ERROR = 2.0, 4.0
_TONE = 25.0  # mean square over the errors of a line of interference
_BESIDE = 10.0  # ... and over that of the lines three off
_TOUCHED = 9.0  # mean square from which a neighbour of such a line is left out with it


def learn(search: Search, fit: Fit, *, upwards: bool = False) -> Search:
    """The search with the errors that the fit shows; none smaller than before where only `upwards` is asked for."""
    small, errors = search.small, search.errors
    records = len(small.source.pairs)
    square = np.sum(np.abs(fit.residual) ** 2, axis=0)
    parts = np.stack(
        [errors.noise.sum(axis=0), errors.level.sum(axis=0), search.slope(fit).mean(axis=0) * records], axis=1
    )
    use = small.arrangement.measured.any(axis=0) & (square > 0)
    square, parts = square[use], parts[use]
    size = parts @ np.array([1.0, RELATIVE**2, DRIFT**2])
    factor = np.array([1.0, RELATIVE**2, DRIFT**2])
    belief = _PRIOR_LINES**0.5 * np.diag(1 / factor)[1:]
    for _ in range(_PASSES):
        capped = np.minimum(square, _CAP * size)
        factor, _ = scipy.optimize.nnls(
            np.vstack([parts / size[:, None], belief]), np.append(capped / size, _PRIOR_LINES**0.5 * np.ones(2))
        )
        size = np.maximum(parts @ factor, 1e-12 * square.max())
    relative, drift = (float(np.sqrt(part)) for part in factor[1:])
    drift = min(drift, _MOST_DRIFT)
    floor = max(float(factor[0]), _LEAST_NOISE)
    if upwards:
        floor = float(np.clip(floor, 1.0, _MOST_NOISE))
        relative = float(np.clip(relative, errors.relative, _MOST_ERROR * RELATIVE))
        drift = max(drift, errors.drift)
    return replace(search, errors=ErrorModel(errors.noise * floor, errors.level, relative, drift))


def tones(fit: Fit) -> IntArray:
    """Lines on which interference stands: far off the fit, and their neighbours are not."""
    square = np.mean(np.abs(fit.residual) ** 2 / fit.variance, axis=0)
    far = np.pad(square, 3, mode="edge")
    beside = np.maximum(far[:-6], far[6:])
    peak = (square > _TONE) & (square > _BESIDE * beside)
    near = np.convolve(peak, np.ones(3), mode="same") > 0
    return np.flatnonzero(peak | (near & (square > _TOUCHED)))


def without_lines(search: Search, lines: IntArray) -> Search:
    """The search without some lines."""
    small = search.small
    cut = replace(small, arrangement=_cut(small.arrangement, lines), source=_cut(small.source, lines))
    return replace(search, small=cut)


def _cut(arrangement: Arrangement, lines: IntArray) -> Arrangement:
    measured = arrangement.measured.copy()
    measured[:, lines] = False
    return replace(arrangement, measured=measured, values=np.where(measured, arrangement.values, 0))
