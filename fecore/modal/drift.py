"""How the structure drifted between the tests, and the FRFs as they would be without it.

Temperature, moved sensors or a support that comes loose turn all natural frequencies of test s by
one factor 1 + d_s. Where a resonance is as narrow as the drift, the FRFs do not fit one series:
damping comes out too large, and modes are found twice or more. With poles s_k(1 + d) the FRFs of a
test are linear in their residues, so

    χ²_s(d) = min_c Σ_l w_l |H_s(l) - Φ(l; s_k(1 + d)) c|²

is found on a grid, with one decomposition of Φ for all tests (a separable problem; Golub and
Pereyra 2003). A test drifts at most five times as far as half of them do: that is all the prior.
Poles that lie side by side, as a drift makes them, are one in this series. Drift and poles are
found in turn while the series with the drift costs less (Akaike, by independent lines) than the
series with the twins and without.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.modal.arrangement import FEW, Arrangement
from fecore.modal.basis import BESIDE, ONE, Terms, columns
from fecore.modal.error_model import memory
from fecore.modal.growth import PRICE, pole_price
from fecore.modal.linear import stacked
from fecore.modal.refinement import Level, level_at

# relative drift of a frequency to either side: 8 % of a modulus, beyond any room's temperature
_WIDEST = 0.02
_TWICE = 0.5  # share of the modes that come in pairs from which drift makes them
_ALIKE = 3.0  # ratio of their widths
# half bandwidths, and lines at least, on each side of a pole whose lines show the drift
_REACH = 6.0
_SPREAD = 5.0  # half its width, and the farthest drift, over the median of the drifts
_TONE = 0.1  # lines: a half bandwidth below is a tone's


def drift_of(
    arrangement: Arrangement,
    fit: Level,
    price: float,
    settle: Callable[[Arrangement, Terms], Terms],
) -> tuple[FloatArray, Terms] | None:
    """(N,) the drift of each FRF that lowers χ² most, and the series that shows it; None where no
    drift pays.

    Args:
        arrangement: the FRFs.
        fit: a series fitted to them.
        price: of a drift, as `drift_price`.
        settle: refines a series on aligned FRFs.
    """
    inside = arrangement.in_band(fit.terms.frequency_hz)
    if arrangement.sessions < FEW or not inside.any():
        return None
    terms, weight = _merged(fit, inside), fit.weight
    twins = (fit.terms.pairs - terms.pairs) * pole_price(fit)
    each: FloatArray = np.zeros(len(arrangement.pairs))
    reach, least = _WIDEST, fit.chi_squared + twins - price
    while True:  # every turn lowers χ² by the price of a test, so it ends
        trial, gain = _drifts(arrangement, terms, weight, reach)
        if gain <= price:
            break
        still = aligned(arrangement, terms, weight, trial)
        settled = settle(still, terms)
        left = level_at(still, settled, fit.variance).chi_squared
        if left > least:
            break
        each, terms, least = trial, settled, left - price / (arrangement.sessions - 1)
        reach = _SPREAD * float(np.median(np.abs(each)))
    return (each, terms) if np.any(each) else None


def drift_price(arrangement: Arrangement, fit: Level) -> float:
    """What a drift of all tests but one must lower χ² by (Akaike), where lines share their
    errors.
    """
    tau = memory(fit.residual, fit.variance, arrangement.measured, fit.model)
    return PRICE * (arrangement.sessions - 1) * tau


def _drifts(
    arrangement: Arrangement, terms: Terms, weight: FloatArray, reach: float
) -> tuple[FloatArray, float]:
    """(N,) the most probable drifts about their mean, on a grid about none, and what they lower χ²
    by.
    """
    grid, tests = np.linspace(-reach, reach, 41), arrangement.session
    each = _misfits(arrangement, terms, weight, grid, _lines(arrangement, terms))
    misfit: FloatArray = np.stack([np.bincount(tests, own) for own in each]).astype(float)
    drift, least = _lowest(grid, misfit)
    drift -= np.median(drift)
    most = _SPREAD * float(np.median(np.abs(drift)))
    # a test that shows nothing drifts no further than the others
    drift = np.clip(drift, -most, most)
    return np.asarray((drift - drift.mean())[tests]), float(np.sum(misfit[grid.size // 2] - least))


def aligned(
    arrangement: Arrangement, terms: Terms, weight: FloatArray, drift: FloatArray
) -> Arrangement:
    """The FRFs less what a (N,) drift makes of the series, whose residues are found for each drift
    by itself.
    """
    values = arrangement.values.copy()
    still = columns(arrangement.omega, terms, arrangement.power)
    pairs, root = slice(0, 2 * terms.pairs), np.sqrt(weight.mean(axis=0))
    for own in np.unique(drift):
        rows = np.flatnonzero(drift == own)
        moved = columns(
            arrangement.omega, _moved(arrangement, terms, float(own)), arrangement.power
        )
        coefficients = _solved(moved, arrangement.values[rows], root)
        values[rows] += coefficients[:, pairs] @ (still - moved)[:, pairs].T
    return replace(arrangement, values=np.where(arrangement.measured, values, 0))


def _moved(arrangement: Arrangement, terms: Terms, drift: float) -> Terms:
    """The series with all its resonances moved; a pole much narrower than a line is a tone, which
    stays where it is.
    """
    tone = terms.half_bandwidth_hz < _TONE * arrangement.spacing_hz
    return replace(terms, frequency_hz=terms.frequency_hz * np.where(tone, 1.0, 1 + drift))


def _merged(fit: Level, inside: BoolArray) -> Terms:
    """The series with one pole, in their middle and as narrow as the narrowest, for those side by
    side.

    Poles within half a bandwidth are what a small drift makes of one mode; those further apart may
    be true pairs, unless at least half of the modes come in pairs.
    """
    near, double = _side_by_side(fit, inside, BESIDE)
    return near if double else _side_by_side(fit, inside, ONE)[0]


def _side_by_side(fit: Level, inside: BoolArray, reach: float) -> tuple[Terms, bool]:
    """The series with one pole for those within so many summed half bandwidths, and whether half of
    the modes were more.
    """
    terms = fit.terms
    hz, zeta, gain = terms.frequency_hz.copy(), terms.damping_ratio.copy(), fit.gains
    width, gone = terms.half_bandwidth_hz, np.zeros(hz.size, dtype=bool)
    several = []
    for k in np.argsort(-gain):
        if gone[k] or not inside[k]:
            continue
        off, wide = np.abs(hz - hz[k]), np.maximum(width / width[k], width[k] / width)
        near = (
            inside
            & ~gone
            & (off < reach * (width + width[k]))
            & (off < _WIDEST * hz[k])
            & (wide < _ALIKE)
        )
        several.append(near.sum() > 1)
        hz[k], zeta[k] = hz[near].mean(), zeta[near].min()
        near[k] = False
        gone |= near
    merged = replace(terms, frequency_hz=hz[~gone], damping_ratio=zeta[~gone])
    return merged, bool(np.mean(several) >= _TWICE)


def _lines(arrangement: Arrangement, terms: Terms) -> IntArray:
    """Numbers of the lines about the poles in band."""
    inside = arrangement.in_band(terms.frequency_hz)
    off = np.abs(arrangement.frequency_hz[:, None] - terms.frequency_hz[inside])
    reach = _REACH * np.maximum(terms.half_bandwidth_hz[inside], arrangement.spacing_hz)
    return np.flatnonzero((off <= reach).any(axis=1))


def _misfits(
    arrangement: Arrangement, terms: Terms, weight: FloatArray, grid: FloatArray, lines: IntArray
) -> FloatArray:
    """(g, N) misfit of every FRF for every drift of the grid."""
    omega, values, own = arrangement.omega[lines], arrangement.values[:, lines], weight[:, lines]
    mean = own.mean(axis=0)
    root, level = np.sqrt(mean), own.sum(axis=1) / max(mean.sum(), np.finfo(float).tiny)
    target = stacked(values.T, root).T
    whole = np.sum(target**2, axis=1)
    out = np.empty((grid.size, len(values)))
    for place, drift in enumerate(grid):
        basis = stacked(
            columns(omega, _moved(arrangement, terms, float(drift)), arrangement.power), root
        )
        frame = np.linalg.qr(
            basis / np.maximum(np.linalg.norm(basis, axis=0), np.finfo(float).tiny)
        )[0]
        out[place] = level * (whole - np.sum((target @ frame) ** 2, axis=1))
    return out


def _lowest(grid: FloatArray, misfit: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(S,) where each test's misfit is least, by a parabola about the best of the grid, and how
    large it is there.
    """
    best = np.clip(np.argmin(misfit, axis=0), 1, grid.size - 2)
    low, mid, high = (misfit[best + shift, np.arange(best.size)] for shift in (-1, 0, 1))
    step, bend = grid[1] - grid[0], np.maximum(low - 2 * mid + high, 0.0)
    off = np.clip(np.where(bend > 0, (low - high) / np.where(bend > 0, 2 * bend, 1.0), 0.0), -1, 1)
    return np.asarray(grid[best] + off * step), np.asarray(
        mid + (high - low) * off / 2 + bend * off**2 / 2
    )


def _solved(basis: np.ndarray, values: np.ndarray, root: FloatArray) -> FloatArray:
    """(N, q) real coefficients, all FRFs with the same weights, each term a priori as large as the
    FRFs.

    A pole beyond the band and residual terms look nearly alike on the lines: without the prior both
    are large and cancel, and the drift of that pole alone spoils all FRFs. With B the weighted
    columns of length 1, (BᵀB + N/|H|² I) c = BᵀH (Tikhonov).
    """
    scaled = stacked(basis, root)
    size = np.maximum(np.linalg.norm(scaled, axis=0), np.finfo(float).tiny)
    both = stacked(values.T, root).T
    price = np.sqrt(len(both) / max(float(np.sum(both**2)), np.finfo(float).tiny))
    unit = scaled / size
    products = unit.T @ unit + price**2 * np.eye(size.size)
    return np.asarray(scipy.linalg.solve(products, unit.T @ both.T, assume_a="pos").T / size)
