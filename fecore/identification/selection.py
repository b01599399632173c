"""Which poles the data support: forward selection by gain of likelihood, backward elimination, both by information
criteria.

The linear stage offers poles of all orders, true and spurious; a few more outside the band stand for what lies
beyond. From an empty model those are added whose residues lower χ² the most (the gain of a candidate, all other
coefficients re-fitted, is a 2x2 problem an FRF), the poles are refined, and what no longer pays is dropped. A term
pays when its gain exceeds Akaike's 2 per unknown; a pole that is reported as a mode must pay the stricter ln(data)
per unknown of the Bayesian criterion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from fecore.arrays import BoolArray, FloatArray
from fecore.correlation import mac
from fecore.errors import IdentificationError
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import Terms, columns
from fecore.identification.refinement import Fit, noise_of, refine, refine_with_noise, settled
from fecore.identification.residues import weights

_ROUNDS = 30
_BLOCK = 256  # lines whose products stay in the cache
_PATIENCE = 2  # rounds without a better Bayesian criterion before growing ends
_SECOND_LOOK = 6  # rounds with the records' own noise: a misfit of another kind must not be chased for long
_BATCH = 0.03  # candidates added in one round have at least this share of the round's largest gain
_APART = 2.0  # ... and lie this many summed half bandwidths from each other
_ALONE = 1e-6  # share of a candidate's power that the model's own terms leave: below it nothing new is in it
_VAGUE_FREQUENCY = 0.05  # standard deviation of ln ω from which a pole is no longer moved
_VAGUE_DAMPING = 0.7  # ... and of ln ζ
_SCALES = (1, 5, 25)  # lines over which the residual is averaged to find its peaks
_PEAKS = 6
_BEYOND = 3  # most poles outside the band
_SAME_SHAPE = 0.9  # MAC of the residues of two near poles from which they are one mode
RESIDUAL_TERMS = (-2, -1, 0, 1, 2)


@dataclass(frozen=True)
class Gains:
    """What each possible term would lower χ² by, less Akaike's price.

    Attributes:
        pole: (K,) of the candidate poles.
        exponent: of the residual terms not in the model.
        decay: of floating bodies with the rates of `_rates`.
    """

    pole: FloatArray
    exponent: dict[int, float]
    decay: dict[float, float]


def price(fit: Fit, columns_added: int, parameters_added: int) -> tuple[float, float]:
    """Least gain of χ² that pays for new unknowns by Akaike's and by the Bayesian criterion."""
    unknowns = columns_added * len(fit.residual) + parameters_added
    return 2.0 * unknowns, float(np.log(fit.freedom + fit.unknowns)) * unknowns


def select(
    arrangement: Arrangement, candidate_hz: FloatArray, candidate_zeta: FloatArray, variance: FloatArray, most: int
) -> Fit:
    """Model of all supported poles and residual terms, refined, with the noise estimated from its residual.

    Args:
        arrangement: the FRFs.
        candidate_hz: (K,) frequencies of candidate poles, in and out of band.
        candidate_zeta: (K,) their damping ratios.
        variance: (N, L) first noise variance.
        most: largest number of poles.
    """
    fit = refine(arrangement, Terms(np.empty(0), np.empty(0), (0,)), variance, steps=0)
    shut: list[tuple[float, float]] = []
    pool = (candidate_hz, candidate_zeta)
    fit = _grow_all(arrangement, fit, pool, shut, most, None)
    # a mode that is missing can pass for noise: look again with the noise that the records' roughness states
    fit = _grow_all(arrangement, settled(arrangement, fit.terms, variance), pool, shut, most, variance)
    free = replace(fit.terms, held=np.zeros(fit.terms.pairs, dtype=bool))
    fit = refine(arrangement, free, noise_of(arrangement, fit), steps=8)
    held = hold_vague(fit, ~in_band(arrangement, fit.terms.frequency_hz))
    fit = refine_with_noise(arrangement, held, noise_of(arrangement, fit))
    thrifty = _prune(arrangement, _unique(arrangement, fit)[0])  # with the noise known at last
    if thrifty is not fit:
        fit = refine_with_noise(arrangement, thrifty.terms, noise_of(arrangement, thrifty))
    return settled(arrangement, _ascending(fit.terms), fit.variance)


def _grow_all(
    arrangement: Arrangement,
    fit: Fit,
    pool: tuple[FloatArray, FloatArray],
    shut: list[tuple[float, float]],
    most: int,
    variance: FloatArray | None,
) -> Fit:
    """Add terms, refine and prune until nothing pays; the noise is `variance`, or follows the residual where None."""
    best, best_score, idle = fit, np.inf, 0
    for _ in range(_ROUNDS if variance is None else _SECOND_LOOK):
        hz, zeta = (np.concatenate(both) for both in zip(pool, residual_peaks(arrangement, fit), strict=True))
        open_ = np.all([(hz < low) | (hz > high) for low, high in shut] or [np.ones(hz.size, dtype=bool)], axis=0)
        grown = _grow(arrangement, fit, hz[open_], zeta[open_], most)
        if grown is None:
            break
        try:
            larger = refine(arrangement, grown, fit.variance, steps=8)
            if larger.chi_squared >= fit.chi_squared:  # only round-off can make a larger model the worse one
                break
            held = hold_vague(larger, ~in_band(arrangement, larger.terms.frequency_hz))
            noise = noise_of(arrangement, larger) if variance is None else variance
            fit, closed = _unique(arrangement, _prune(arrangement, settled(arrangement, held, noise)))
        except IdentificationError:  # terms that cannot be told apart: what was found before stands
            break
        shut += closed
        score = fit.misfit(arrangement.measured) + np.log(fit.freedom + fit.unknowns) * fit.unknowns
        best, best_score, idle = (fit, score, 0) if score < best_score else (best, best_score, idle + 1)
        if idle == _PATIENCE:
            break
    return best


def residual_peaks(arrangement: Arrangement, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Poles to try where the residual of all FRFs together stands out: frequencies (Hz) and damping ratios.

    The weighted square of the residual is averaged over one, five and twenty-five lines; each average's highest peaks
    are tried with half bandwidths of its own width. So a mode is found that the linear stage has missed.
    """
    square = np.where(arrangement.measured, np.abs(fit.residual) ** 2 / fit.variance, 0.0).sum(axis=0)
    found = []
    for lines in _SCALES:
        level = uniform_filter1d(square, lines, mode="nearest")
        inner = level[1:-1]
        peak = 1 + np.flatnonzero((inner >= level[:-2]) & (inner > level[2:]))
        best = peak[np.argsort(-level[peak])][:_PEAKS]
        width = np.array([0.2, 0.5, 1.5]) * lines * arrangement.spacing_hz
        hz = arrangement.frequency_hz[best]
        found += [np.stack([hz, np.clip(w / hz, 1e-4, 0.5)]) for w in width]
    pairs = np.concatenate(found, axis=1)
    return pairs[0], pairs[1]


def _ascending(terms: Terms) -> Terms:
    order = np.argsort(terms.frequency_hz)
    return replace(
        terms,
        frequency_hz=terms.frequency_hz[order],
        damping_ratio=terms.damping_ratio[order],
        held=terms.held[order],
    )


def hold_vague(fit: Fit, among: BoolArray) -> Terms:
    """The terms with every pole of those held whose frequency or damping the data hardly determine."""
    n = fit.terms.pairs
    sd = np.sqrt(np.diag(fit.parameter_covariance))
    vague = (sd[:n] > _VAGUE_FREQUENCY) | (sd[n : 2 * n] > _VAGUE_DAMPING * fit.terms.damping_ratio)
    vague &= among
    zeta = np.where(vague, np.clip(fit.terms.damping_ratio, 0.005, 0.5), fit.terms.damping_ratio)
    return replace(fit.terms, damping_ratio=zeta, held=fit.terms.held | vague)


def in_band(arrangement: Arrangement, hz: FloatArray) -> BoolArray:
    """(n,) True for frequencies within the measured lines."""
    return np.asarray((hz >= arrangement.frequency_hz[0]) & (hz <= arrangement.frequency_hz[-1]))


def _unique(arrangement: Arrangement, fit: Fit) -> tuple[Fit, list[tuple[float, float]]]:
    """Drop what is the same mode found twice, and say around which frequencies no more poles are to be tried.

    Two poles are one mode when they lie within their half bandwidths (or a line) of each other and their residues are
    the same shape, or when the lines cannot resolve them at all. True double modes differ in shape.
    """
    shut: list[tuple[float, float]] = []
    if _same_pole(arrangement, fit) is not None:  # near poles share their residues until they have come to rest
        fit = refine(arrangement, fit.terms, fit.variance)
    while (pair := _same_pole(arrangement, fit)) is not None:
        k, keep = pair
        width = 0.5 * max(fit.terms.damping_ratio[keep] * fit.terms.frequency_hz[keep], arrangement.spacing_hz)
        shut.append((fit.terms.frequency_hz[keep] - width, fit.terms.frequency_hz[keep] + width))
        fit = _prune(arrangement, refine(arrangement, without_pole(fit.terms, k), fit.variance, steps=8))
    return fit, shut


def _same_pole(arrangement: Arrangement, fit: Fit) -> tuple[int, int] | None:
    """(pole to drop, pole to keep) of the first two that are one mode, or None."""
    terms, line = fit.terms, arrangement.spacing_hz
    value = worth(fit)[0]
    inside = np.flatnonzero(in_band(arrangement, terms.frequency_hz))
    pairs = fit.linear.coefficients[:, : 2 * terms.pairs]
    residues = pairs[:, 0::2] + 1j * pairs[:, 1::2]
    width = terms.damping_ratio * terms.frequency_hz
    for place, k in enumerate(inside):
        for j in inside[place + 1 :]:
            apart = abs(terms.frequency_hz[k] - terms.frequency_hz[j])
            unresolved = apart < line and min(width[k], width[j]) < line
            alike = mac(residues[:, k], residues[:, j])[0, 0] > _SAME_SHAPE
            if unresolved or (alike and apart < max(line, width[k] + width[j])):
                return (int(k), int(j)) if value[k] < value[j] else (int(j), int(k))
    return None


def gains(arrangement: Arrangement, fit: Fit, hz: FloatArray, zeta: FloatArray) -> Gains:
    """Gain of each candidate when it is added alone and all coefficients are fitted anew, poles held."""
    terms = fit.terms
    absent = [e for e in RESIDUAL_TERMS if e not in terms.exponents]
    basis = columns(arrangement.omega, terms, arrangement.power)
    rates = _rates(arrangement) if not terms.decay.size else np.empty(0)
    extra = columns(arrangement.omega, Terms(hz, zeta, tuple(absent), rates), arrangement.power)
    weight = weights(arrangement, fit.variance)
    right = ((weight * fit.residual) @ extra.conj()).real
    cross = _cross_products(basis, extra, weight)
    projected = np.matmul(fit.linear.root, cross)
    count = 2 * hz.size
    one, two = extra[:, 0:count:2], extra[:, 1:count:2]
    entries = []
    for a, b, i, j in ((one, one, 0, 0), (one, two, 0, 1), (two, two, 1, 1)):
        raw = weight @ (a.real * b.real + a.imag * b.imag)
        kept = raw - np.einsum("nqk,nqk->nk", projected[:, :, i:count:2], projected[:, :, j:count:2])
        entries.append((raw, kept))
    (raw11, s11), (_, s12), (raw22, s22) = entries
    g1, g2 = right[:, 0:count:2], right[:, 1:count:2]
    determinant = s11 * s22 - s12**2
    alone = (s11 > _ALONE * raw11) & (s22 > _ALONE * raw22) & (determinant > _ALONE * s11 * s22)
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.where(alone, (s22 * g1**2 - 2 * s12 * g1 * g2 + s11 * g2**2) / determinant, 0.0).sum(axis=0)
    single = []
    for place in range(count, extra.shape[1]):
        raw = weight @ np.abs(extra[:, place]) ** 2
        kept = raw - np.einsum("nq,nq->n", projected[:, :, place], projected[:, :, place])
        with np.errstate(invalid="ignore", divide="ignore"):
            single.append(float(np.where(kept > _ALONE * raw, right[:, place] ** 2 / kept, 0.0).sum()))
    exponent = {e: value - price(fit, 1, 0)[0] for e, value in zip(absent, single[: len(absent)], strict=True)}
    decay = {float(a): v - price(fit, 1, 1)[0] for a, v in zip(rates, single[len(absent) :], strict=True)}
    return Gains(gain - _pole_price(arrangement, fit, hz), exponent, decay)


def _pole_price(arrangement: Arrangement, fit: Fit, hz: FloatArray) -> FloatArray:
    """Akaike's price for a pole out of band, which is but a better residual term; the Bayesian one for a mode."""
    akaike, bayes = price(fit, 2, 2)
    return np.where(in_band(arrangement, hz), bayes, akaike)


def _rates(arrangement: Arrangement) -> FloatArray:
    """Rates of floating bodies to try, 1/s: those that bend the lowest tenth of the band."""
    low, high = arrangement.omega[0], arrangement.omega[-1]
    return np.asarray(np.geomspace(max(low, 1e-3 * high), 0.1 * high, 6)) if low < 0.1 * high else np.empty(0)


def worth(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """What χ² would rise by without each pole pair (n,) and without each other term (other poles held)."""
    n = fit.terms.pairs
    c, V = fit.linear.coefficients, fit.linear.covariance
    pole = np.zeros(n)
    for k in range(n):
        part = slice(2 * k, 2 * k + 2)
        solved = np.linalg.solve(V[:, part, part], c[:, part, None])[:, :, 0]
        pole[k] = float(np.sum(c[:, part] * solved))
    spread = np.einsum("nii->ni", V)[:, 2 * n :]
    return pole, np.asarray(np.sum(c[:, 2 * n :] ** 2 / spread, axis=0))


def without_pole(terms: Terms, k: int) -> Terms:
    """The same terms without pole pair k."""
    return replace(
        terms,
        frequency_hz=np.delete(terms.frequency_hz, k),
        damping_ratio=np.delete(terms.damping_ratio, k),
        held=np.delete(terms.held, k),
    )


def _grow(arrangement: Arrangement, fit: Fit, hz: FloatArray, zeta: FloatArray, most: int) -> Terms | None:
    """The model with the best new terms, or None when none pays or the model is full."""
    gain = gains(arrangement, fit, hz, zeta)
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


def _prune(arrangement: Arrangement, fit: Fit) -> Fit:
    """Drop one by one, least worth first, what does not pay, refining in between."""
    while True:
        pole, other = worth(fit)
        count = len(fit.terms.exponents)
        dear = np.concatenate(
            [
                pole - _pole_price(arrangement, fit, fit.terms.frequency_hz),
                other[:count] - price(fit, 1, 0)[0],
                other[count:] - price(fit, 1, 1)[0],
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


def _cross_products(basis: np.ndarray, extra: np.ndarray, weight: FloatArray) -> FloatArray:
    """(N, q, k) Re Φᴴ W Ψ of every FRF, in blocks of lines that bound the memory."""
    q, k = basis.shape[1], extra.shape[1]
    across = np.ascontiguousarray(weight.T)
    products = np.zeros((q, k, weight.shape[0]))
    for start in range(0, basis.shape[0], _BLOCK):
        part = slice(start, start + _BLOCK)
        real, imag = np.ascontiguousarray(extra[part].real.T), np.ascontiguousarray(extra[part].imag.T)
        for i in range(q):
            products[i] += (real * basis[part, i].real + imag * basis[part, i].imag) @ across[part]
    return np.ascontiguousarray(products.transpose(2, 0, 1))
