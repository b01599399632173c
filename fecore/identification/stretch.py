"""A tour in which the structure drifts so far that every mode is found twice: how far each test drifted, and it taken out.

Temperature turns all natural frequencies of test s by one factor 1 + d_s. Where the tests drift by more than a half bandwidth,
the FRFs together show each mode as two or three poles, each with the shapes of some tests. Another series explains them as
well with fewer unknowns: one pole for each mode, and d_s. For poles s_k(1 + d) the FRFs of a test are linear in their residues:

    d_s = argmin_d min_c Σ_l w_l |H_s(l) − Φ(l; s_k(1 + d)) c|²

is found on a grid, with one decomposition of Φ for all tests (a separable problem; Golub and Pereyra 2003). It is believed
where the fewer poles miss the FRFs by no more than the twins do, χ² for each freedom. Real pairs do not lie apart by the same
share in all modes, and each test sees both of a pair: one pole with a drift misses them by far.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import Terms, columns
from fecore.identification.drift import Drift, session_of
from fecore.identification.gains import in_band
from fecore.identification.refinement import evaluate, refine

_WIDEST = 0.02  # relative drift of a frequency to either side: 8 % of a modulus, beyond any room's temperature
_STEPS = 81  # of the grid over it: a tenth of a half bandwidth of 0.5 %
_FEWEST = 6  # tests of which a drift can be distinguished from other shapes
_TWICE = 0.5
"""Share of the modes that are found more than once from which a drift is looked for, and two of them at least."""

_ROUNDS = 3  # of drift and poles in turn
_SETTLE = 6  # steps of the poles in each
_NO_WORSE = 1.1
"""Misfit for each freedom with a drift over that of the twins up to which it is believed; real pairs have hundreds."""


def without_stretch(arrangement: Arrangement, terms: Terms, noise: FloatArray) -> tuple[Arrangement, Drift] | None:
    """The FRFs without a drift that makes twins of their modes, and the drift; None where there is none.

    Args:
        arrangement: the FRFs.
        terms: the poles that they seem to need.
        noise: (N, L) variance of their noise.
    """
    tests = session_of(arrangement)
    clusters = _clusters(arrangement, terms)
    twice = sum(len(each) > 1 for each in clusters)
    if int(tests.max()) + 1 < _FEWEST or twice < max(2, _TWICE * len(clusters)):
        return None
    twins = evaluate(arrangement, terms, noise)
    single = _merged(terms, clusters)
    total: FloatArray = np.zeros(len(tests))
    for _ in range(_ROUNDS):
        total = _drifts(arrangement, single, noise, tests)
        still = _straightened(arrangement, single, noise, total)
        fit = refine(still, single, noise, steps=_SETTLE)
        single = fit.terms
    believed = fit.chi_squared / fit.freedom < _NO_WORSE * twins.chi_squared / twins.freedom
    return (still, Drift(total, float(np.std(total)))) if believed and np.any(total) else None


def _straightened(arrangement: Arrangement, terms: Terms, noise: FloatArray, drift: FloatArray) -> Arrangement:
    """The FRFs less what a (N,) drift makes of the series, whose residues are found for each drift by itself."""
    values = arrangement.values.copy()
    weight = _line_weight(noise)
    still = columns(arrangement.omega, terms, arrangement.power)
    pairs = slice(0, 2 * terms.pairs)
    for own in np.unique(drift):
        rows = np.flatnonzero(drift == own)
        moved = columns(arrangement.omega, _moved(terms, float(own)), arrangement.power)
        coefficients = _least_squares(moved, values[rows], weight)
        values[rows] += coefficients[:, pairs] @ (still - moved)[:, pairs].T
    return replace(arrangement, values=np.where(arrangement.measured, values, 0))


def _drifts(arrangement: Arrangement, terms: Terms, noise: FloatArray, tests: IntArray) -> FloatArray:
    """(N,) the best drift of each test, about their mean."""
    grid = np.linspace(-_WIDEST, _WIDEST, _STEPS)
    weight, level = _line_weight(noise), np.median(noise, axis=1)
    misfit = np.empty((grid.size, int(tests.max()) + 1))
    for place, own in enumerate(grid):
        moved = columns(arrangement.omega, _moved(terms, float(own)), arrangement.power)
        left = arrangement.values - _least_squares(moved, arrangement.values, weight) @ moved.T
        each = np.sum(weight * np.abs(left) ** 2, axis=1) / level
        misfit[place] = np.bincount(tests, each)
    best = np.clip(np.argmin(misfit, axis=0), 1, grid.size - 2)
    around = np.array([misfit[best + step, np.arange(best.size)] for step in (-1, 0, 1)])
    bend = np.maximum(around[0] - 2 * around[1] + around[2], 1e-300)
    drift = grid[best] + np.clip((around[0] - around[2]) / (2 * bend), -1, 1) * (grid[1] - grid[0])
    centred: FloatArray = (drift - drift.mean())[tests]
    return centred


def _least_squares(basis: np.ndarray, values: np.ndarray, weight: FloatArray) -> FloatArray:
    """(N, q) real coefficients, all FRFs with the (L,) weight."""
    root = np.sqrt(weight)
    scaled = np.concatenate([(root[:, None] * basis).real, (root[:, None] * basis).imag])
    size = np.linalg.norm(scaled, axis=0)
    both = np.concatenate([(root * values).real, (root * values).imag], axis=1)
    found: FloatArray = np.linalg.lstsq(scaled / size, both.T, rcond=1e-9)[0].T / size
    return found


def _line_weight(noise: FloatArray) -> FloatArray:
    """(L,) weight that all FRFs share, 1 at the median."""
    weight: FloatArray = 1 / np.mean(noise / np.median(noise, axis=1, keepdims=True), axis=0)
    return weight


def _moved(terms: Terms, drift: float) -> Terms:
    return replace(terms, frequency_hz=terms.frequency_hz * (1 + drift))


def _clusters(arrangement: Arrangement, terms: Terms) -> list[list[int]]:
    """Poles in band by mode: neighbours within twice the widest drift of the first are one mode's."""
    clusters: list[list[int]] = []
    for k in np.argsort(terms.frequency_hz):
        if not in_band(arrangement, terms.frequency_hz[[k]])[0]:
            continue
        if clusters and terms.frequency_hz[k] < (1 + _WIDEST) * terms.frequency_hz[clusters[-1][0]]:
            clusters[-1].append(int(k))
        else:
            clusters.append([int(k)])
    return clusters


def _merged(terms: Terms, clusters: list[list[int]]) -> Terms:
    """One pole for each cluster, in its middle, as narrow as its narrowest."""
    hz, zeta, held = terms.frequency_hz.copy(), terms.damping_ratio.copy(), terms.held.copy()
    gone: list[int] = []
    for first, *others in clusters:
        both = [first, *others]
        hz[first], zeta[first] = np.mean(terms.frequency_hz[both]), np.min(terms.damping_ratio[both])
        gone += others
    return replace(
        terms,
        frequency_hz=np.delete(hz, gone),
        damping_ratio=np.delete(zeta, gone),
        held=np.delete(held, gone),
    )
