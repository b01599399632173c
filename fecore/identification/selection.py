"""Which poles the data support: forward selection by evidence, backward elimination, both under the error model.

The linear stage offers poles of all orders, true and spurious; a few more outside the band stand for what lies beyond. From an
empty model those are added that the evidence favours most (the gain of a candidate, all other coefficients re-fitted, is a 2x2
problem an FRF), the poles are refined, and what no longer pays is dropped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.correlation import mac
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import Terms
from fecore.identification.gains import Worth, evidence, gains, in_band, loss, pole_power, pole_price, price, worth
from fecore.identification.learning import learn
from fecore.identification.refinement import Fit, evaluate, refine
from fecore.identification.search import Search

_FEW = 0.25  # poles added in a round, over those there, from which the residual is taken for errors
_PARTED = 0.05  # damping up to which a pole may be two
_POOR = 4.0  # misfit over the errors of a pole that is parted
_ENOUGH = 1.0  # decrease of χ² that a step while poles are missing is worth
_PATIENCE = 3  # rounds in a row after which growing ends when what was added was dropped again
_BATCH = 0.03  # candidates added in one round have at least this share of the round's largest gain
_APART = 2.0  # ... and lie this many summed half bandwidths from each other
_VAGUE_FREQUENCY = 0.05  # standard deviation of ln ω from which a pole is no longer moved
_VAGUE_DAMPING = 0.7  # ... and of ln ζ
_SCALES = (1, 5, 25)  # lines over which the residual is averaged to find its peaks
_PEAKS = 6  # of the residual that are tried in a round
_BEYOND = 3  # most poles outside the band
_SAME_SHAPE = 0.9  # MAC of the residues of two near poles from which they are one mode


def grow(
    search: Search, start: Terms, pool: tuple[FloatArray, FloatArray], most: int, step: Callable[[Fit], None]
) -> tuple[Search, Fit]:
    """Add terms, refine and prune until nothing pays.

    Args:
        search: FRFs and their errors.
        start: terms to start from.
        pool: frequencies (Hz) and damping ratios of candidate poles, in and out of band.
        most: largest number of poles.
        step: called after every round with the fit so far.

    Returns:
        The search, with larger errors where the residual shows them once few poles are added, and the fit.
    """
    arrangement = search.arrangement
    fit = evaluate(arrangement, start, search.variance(None))
    if start.pairs:
        fit = evaluate(arrangement, start, search.variance(fit))
    shut: list[tuple[float, float]] = []
    largest, idle = 0, 0
    while idle < _PATIENCE:
        if (parted := _part(search, fit)) is not None:
            fit = parted
        hz, zeta = (np.concatenate(both) for both in zip(pool, residual_peaks(arrangement, fit), strict=True))
        open_ = _open(hz, shut, fit.terms.frequency_hz)
        grown = _grow(arrangement, fit, hz[open_], zeta[open_], most, search.scale(fit))
        if grown is None:
            break
        pairs = fit.terms.pairs
        larger = refine(arrangement, grown, fit.variance, steps=8, enough=_ENOUGH)
        held = hold_vague(larger, ~in_band(arrangement, larger.terms.frequency_hz))
        larger = evaluate(arrangement, held, search.variance(larger))
        fit, closed = _unique(search, _prune(search, larger))
        shut += closed
        if 0 <= fit.terms.pairs - pairs <= _FEW * pairs - 0.5:
            search = learn(search, fit, upwards=True)
        idle = 0 if fit.terms.columns > largest else idle + 1
        largest = max(largest, fit.terms.columns)
        step(fit)
    return search, fit


def _part(search: Search, fit: Fit) -> Fit | None:
    """The fit with the worst-fitted pole parted in two, where that pays.

    From one pole that lies between two modes, a second one that is added beside it may lead nowhere.
    """
    arrangement, terms = search.arrangement, fit.terms
    inside = np.flatnonzero(in_band(arrangement, terms.frequency_hz) & (terms.damping_ratio < _PARTED))
    if not inside.size:
        return None
    power = pole_power(arrangement, terms.frequency_hz[inside], terms.damping_ratio[inside])
    misfit = np.sum(np.abs(fit.residual) ** 2 / fit.variance, axis=0) @ (power / power.sum(axis=0))
    k = int(inside[np.argmax(misfit)])
    if misfit.max() < _POOR * len(search.small.source.pairs):
        return None
    f, zeta = terms.frequency_hz[k], terms.damping_ratio[k]
    both = f * (1 + np.array([-0.7, 0.7]) * zeta)
    two = without_pole(terms, k)
    two = replace(
        two,
        frequency_hz=np.append(two.frequency_hz, both),
        damping_ratio=np.append(two.damping_ratio, [zeta / 2, zeta / 2]),
        held=np.append(two.held, [False, False]),
    )
    trial = refine(arrangement, two, fit.variance, steps=12)
    gain = np.array([fit.chi_squared - trial.chi_squared])
    scale = search.scale(trial)
    power = pole_power(arrangement, terms.frequency_hz[[k]], terms.damping_ratio[[k]])
    pays = evidence(gain, arrangement, trial, power, scale, gained=True)
    if pays[0] < price(trial, scale.records, 2, 2)[1]:
        return None
    return evaluate(arrangement, trial.terms, search.variance(trial))


def _open(hz: FloatArray, shut: list[tuple[float, float]], present: FloatArray) -> BoolArray:
    """(K,) False for candidates beside a pole where a second one was found to be the same mode."""
    free = np.ones(hz.size, dtype=bool)
    for low, high in shut:
        if np.any((present >= low) & (present <= high)):
            free &= (hz < low) | (hz > high)
    return free


def residual_peaks(arrangement: Arrangement, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Poles to try where the residual of all FRFs together stands out: frequencies (Hz) and damping ratios.

    The weighted square of the residual is averaged over one, five and twenty-five lines; each average's highest peaks
    are tried with half bandwidths of its own width. So a mode is found that the linear stage has missed.
    """
    square = np.where(arrangement.measured, np.abs(fit.residual) ** 2 / fit.variance, 0.0).sum(axis=0)
    found = []
    for lines in _SCALES:
        level = scipy.ndimage.uniform_filter1d(square, lines, mode="nearest")
        inner = level[1:-1]
        peak = 1 + np.flatnonzero((inner >= level[:-2]) & (inner > level[2:]))
        best = peak[np.argsort(-level[peak])][:_PEAKS]
        width = np.array([0.2, 0.5, 1.5]) * lines * arrangement.spacing_hz
        hz = arrangement.frequency_hz[best]
        found += [np.stack([hz, np.clip(w / hz, 1e-4, 0.5)]) for w in width]
    pairs = np.concatenate(found, axis=1)
    return pairs[0], pairs[1]


def hold_vague(fit: Fit, among: BoolArray) -> Terms:
    """The terms with every pole of those held whose frequency or damping the data hardly determine."""
    n = fit.terms.pairs
    sd = np.sqrt(np.diag(fit.parameter_covariance))
    vague = (sd[:n] > _VAGUE_FREQUENCY) | (sd[n : 2 * n] > _VAGUE_DAMPING * fit.terms.damping_ratio)
    vague &= among
    zeta = np.where(vague, np.clip(fit.terms.damping_ratio, 0.005, 0.5), fit.terms.damping_ratio)
    return replace(fit.terms, damping_ratio=zeta, held=fit.terms.held | vague)


def _unique(search: Search, fit: Fit) -> tuple[Fit, list[tuple[float, float]]]:
    """Drop what is the same mode found twice, and say around which frequencies no more poles are to be tried.

    Two poles are one mode when they lie within a half bandwidth (or a line) of each other and their residues are
    the same shape, or when the lines cannot resolve them at all. True double modes differ in shape.
    """
    arrangement = search.arrangement
    shut: list[tuple[float, float]] = []
    if same_pole(arrangement, fit) is not None:  # near poles share their residues until they have come to rest
        fit = refine(arrangement, fit.terms, fit.variance)
    while (pair := same_pole(arrangement, fit)) is not None:
        k, keep = pair
        narrower = min(fit.terms.damping_ratio[i] * fit.terms.frequency_hz[i] for i in pair)
        width = 0.5 * max(narrower, arrangement.spacing_hz)
        shut.append((fit.terms.frequency_hz[keep] - width, fit.terms.frequency_hz[keep] + width))
        fit = _prune(search, refine(arrangement, without_pole(fit.terms, k), fit.variance, steps=8))
    return fit, shut


def same_pole(arrangement: Arrangement, fit: Fit) -> tuple[int, int] | None:
    """(pole to drop, pole to keep) of the first two that are one mode, or None."""
    terms, line = fit.terms, arrangement.spacing_hz
    value = loss(fit)[0]
    inside = np.flatnonzero(in_band(arrangement, terms.frequency_hz))
    pairs = fit.linear.coefficients[:, : 2 * terms.pairs]
    residues = pairs[:, 0::2] + 1j * pairs[:, 1::2]
    width = terms.damping_ratio * terms.frequency_hz
    for place, k in enumerate(inside):
        for j in inside[place + 1 :]:
            apart = abs(terms.frequency_hz[k] - terms.frequency_hz[j])
            unresolved = apart < line / 2 and min(width[k], width[j]) < line
            near = apart < max(line, width[k], width[j])
            if unresolved or (near and mac(residues[:, k], residues[:, j])[0, 0] > _SAME_SHAPE):
                return (int(k), int(j)) if value[k] < value[j] else (int(j), int(k))
    return None


def without_pole(terms: Terms, k: int) -> Terms:
    """The same terms without pole pair k."""
    return replace(
        terms,
        frequency_hz=np.delete(terms.frequency_hz, k),
        damping_ratio=np.delete(terms.damping_ratio, k),
        held=np.delete(terms.held, k),
    )


def _grow(
    arrangement: Arrangement, fit: Fit, hz: FloatArray, zeta: FloatArray, most: int, scale: Worth
) -> Terms | None:
    """The model with the best new terms, or None when none pays or the model is full."""
    gain = gains(arrangement, fit, hz, zeta, scale)
    terms, room = fit.terms, most - fit.terms.pairs
    best_pole = float(gain.pole.max(initial=0.0)) if room > 0 else 0.0
    # a residual term is simpler than a pole: prefer it unless the pole does far better
    exponent = max(gain.exponent, key=lambda e: gain.exponent[e], default=0)
    decay = max(gain.decay, key=lambda a: gain.decay[a], default=0.0)
    by_exponent, by_decay = gain.exponent.get(exponent, 0.0), gain.decay.get(decay, 0.0)
    if by_decay > max(0.0, 1.05 * by_exponent, 0.5 * best_pole):
        return replace(terms, decay=np.append(terms.decay, decay))
    if by_exponent > max(0.0, 0.5 * best_pole):
        return replace(terms, exponents=tuple(sorted((*terms.exponents, exponent))))
    if best_pole <= 0:
        return None
    inside, line = in_band(arrangement, hz), arrangement.spacing_hz
    beyond = _BEYOND - int(np.sum(~in_band(arrangement, terms.frequency_hz)))
    chosen: list[int] = []
    for k in np.argsort(-gain.pole):
        if gain.pole[k] < max(_BATCH * best_pole, 1e-9) or len(chosen) == room:
            break
        width = zeta[k] * hz[k]
        if not inside[k] and sum(~inside[chosen]) >= beyond:
            continue
        if all(abs(hz[k] - hz[j]) > max(_APART * (width + zeta[j] * hz[j]), 2 * line) for j in chosen):
            chosen.append(int(k))
    if not chosen:
        return None
    return replace(
        terms,
        frequency_hz=np.append(terms.frequency_hz, hz[chosen]),
        damping_ratio=np.append(terms.damping_ratio, zeta[chosen]),
        held=np.append(terms.held, np.zeros(len(chosen), dtype=bool)),
    )


def _prune(search: Search, fit: Fit) -> Fit:
    """Drop one by one, least worth first, what does not pay, refining in between."""
    arrangement, records = search.arrangement, len(search.small.source.pairs)
    while True:
        pole, other = worth(arrangement, fit, search.scale(fit))
        count = len(fit.terms.exponents)
        dear = np.concatenate(
            [
                pole - pole_price(arrangement, fit, records, fit.terms.frequency_hz),
                other[:count] - price(fit, records, 1, 0)[0],
                other[count:] - price(fit, records, 1, 1)[0],
            ]
        )
        if not dear.size or dear.min() >= 0:
            return fit
        fit = refine(arrangement, _without(fit.terms, int(dear.argmin())), fit.variance, steps=3)


def _without(terms: Terms, which: int) -> Terms:
    """The same terms without the pole pair, residual term or body of that number, counted in this order."""
    if which < terms.pairs:
        return without_pole(terms, which)
    which -= terms.pairs
    if which < len(terms.exponents):
        return replace(terms, exponents=terms.exponents[:which] + terms.exponents[which + 1 :])
    return replace(terms, decay=np.delete(terms.decay, which - len(terms.exponents)))
