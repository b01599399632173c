"""What speaks for a pole being a mode: a few features, all from the joint fit. Why these:
`docs/identification.md`.

phase   r, the median over the FRFs, weighted by |R|, of cos 2∠(2iω_d R), R the residue of the receptance.
rise    ρ, the local misfit without the pole over that with it, within 1 and 10³.
share   s, the pole's height over the FRFs at its frequency, within 0.03 and 1.
damping z = |ln ζ/ζ_t|, ζ_t a robust trend c + a₀/2ω + a₁ω/2 with coefficients >= 0 through all
poles of the set.
apart   d = √(1 - C), at least 0.01, C = 4σ_kσ_j/|s_k + s̄_j|² the MAC of its resonance curve with that of the larger pole
        nearest by it, σ = ζω.
shape   q = (1 - M + 0.01)^√C, M the MAC of its residues with those of a larger pole, of the one that makes q least.
reach   n = 1 - max|R|²/Σ|R|², at least 0.01, the share of it that other FRFs show than the strongest.

Shape and reach need four FRFs. A delay d of a channel turns the phase of residues by -ωd, and a
wrong quantity by 90°: both are found first, from the strong poles.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.modal.arrangement import FEW, Arrangement
from fecore.modal.basis import Terms, columns
from fecore.modal.refinement import Level

_REACH = 3.0  # half bandwidths on each side of a pole within which the misfit is local
_LEAST_REACH = 2  # ... and at least lines
_LASTS = 0.02  # lines: a half bandwidth below swings through the whole record
_RISE = (1.0, 1e3)  # least and most that counts
_SHARE = (0.03, 1.0)  # least and most that counts
_LEAST = 0.01  # distance, share in other FRFs, and 1 - MAC of one shape that errors leave
_DELAY_PRIOR = 2e-4  # s, one standard deviation
_STRONG = 10.0  # rise from which a pole shows the delay
USUAL = 0.3
"""Scatter of ln ζ about its trend."""


@dataclass(frozen=True)
class Evidence:
    """Features of n poles, NaN where the set cannot give one."""

    # phase, rise, share, damping, apart, shape, reach: (n,) see above
    phase: FloatArray
    rise: FloatArray
    share: FloatArray
    damping: FloatArray
    apart: FloatArray
    shape: FloatArray
    reach: FloatArray
    # (n,) number of the larger pole that it is nearest to; any where there is none
    neighbour: IntArray
    # (n,) number of the larger pole of most alike curve and shape, of most alike curve for few FRFs
    twin: IntArray
    trend: FloatArray  # (n,) ζ_t
    tone: BoolArray  # (n,) whether it hardly dies away within a record, as interference does
    delay: float  # of the channels, s
    turned: bool  # whether all residues are turned by 90°


def evidence_of(arrangement: Arrangement, fit: Level) -> Evidence:
    """The features of all poles of a series fitted to FRFs."""
    terms = fit.terms
    residues = fit.residues
    rise = _rise(arrangement, fit)
    height, share = _share(arrangement, fit)
    inside = arrangement.in_band(terms.frequency_hz)
    tone = inside & (terms.half_bandwidth_hz < _LASTS * arrangement.spacing_hz)
    strength = np.where(inside & ~tone, np.log10(rise) * share, 0.0)
    delay, turned = _delay(terms, residues, np.where(rise > _STRONG, strength, 0.0))
    phase = _phase(terms, residues, delay, turned)
    trend = _trend(terms, strength * np.maximum(phase, 0.1))
    curves = _curves(terms, height)
    shape, twin = _shape(residues, curves)
    return Evidence(
        phase=phase,
        rise=rise,
        share=share,
        damping=np.abs(np.log(terms.damping_ratio / trend)),
        apart=np.sqrt(np.maximum(1 - curves.max(axis=1, initial=0.0), _LEAST**2)),
        shape=shape,
        reach=_reach(residues),
        neighbour=_largest(curves),
        twin=twin,
        trend=trend,
        tone=tone,
        delay=delay,
        turned=turned,
    )


def _rise(arrangement: Arrangement, fit: Level) -> FloatArray:
    off = np.abs(arrangement.frequency_hz[:, None] - fit.terms.frequency_hz)
    near = off <= np.maximum(
        _REACH * fit.terms.half_bandwidth_hz, _LEAST_REACH * arrangement.spacing_hz
    )
    misfit = np.sum(fit.weight * np.abs(fit.residual) ** 2, axis=0)
    lines = np.maximum(near.sum(axis=0), 1)
    # clean data leave nothing
    usual = 2.0 * np.mean(arrangement.measured.sum(axis=0)) * lines * 0.05
    with_it = np.maximum(misfit @ near, usual)
    return np.asarray(np.clip(1 + fit.gains / with_it, *_RISE))


def _share(arrangement: Arrangement, fit: Level) -> tuple[FloatArray, FloatArray]:
    """(n,) height of each pole at the line next to its frequency, and over the FRFs there: a needle
    between lines has none.
    """
    terms, n = fit.terms, fit.terms.pairs
    place = np.argmin(np.abs(arrangement.frequency_hz[:, None] - terms.frequency_hz), axis=0)
    omega = arrangement.omega[place]
    reference = float(np.sqrt(arrangement.omega[0] * arrangement.omega[-1]))
    at = columns(omega, terms, arrangement.power, reference)  # (n, q), line k at pole k
    own = at[np.arange(n)[:, None], np.stack([2 * np.arange(n), 2 * np.arange(n) + 1], axis=1)]
    c = fit.linear.coefficients
    height = np.abs(c[:, 0 : 2 * n : 2] * own[:, 0] + c[:, 1 : 2 * n : 2] * own[:, 1])
    beside = np.broadcast_to(fit.background, fit.residual.shape)[:, place]
    whole = np.abs(beside + c @ at.T)
    total = np.sqrt(np.sum(height**2, axis=0))
    share = total / np.maximum(np.sqrt(np.sum(whole**2, axis=0)), np.finfo(float).tiny)
    return total, np.asarray(np.clip(share, *_SHARE))


def _turns(terms: Terms, residues: ComplexArray) -> ComplexArray:
    """(N, n) 2iω_d R, whose phase is 0 or 180° for a mode."""
    return np.asarray(2j * terms.poles.imag * residues)


def _delay(terms: Terms, residues: ComplexArray, strength: FloatArray) -> tuple[float, bool]:
    """The delay (s) that turns the strong poles' residues back, and whether they all stand at 90°
    to a mode's.

    Maximises Σ_k w_k cos(2(φ_k + ω_k d)) less d²/2d₀² over a grid, φ_k = ½ arg Σ_i (2iω_d R_ik)².
    """
    if np.sum(strength > 0) < 3:
        return 0.0, False
    turns = _turns(terms, residues)
    square = np.sum(turns**2, axis=0)
    angle, omega = np.angle(square), 2 * np.pi * terms.frequency_hz
    purity = np.abs(square) / np.maximum(np.sum(np.abs(turns) ** 2, axis=0), np.finfo(float).tiny)
    weight = strength * purity
    weight = weight / weight.sum() * np.sum(strength > 0)
    step = 0.05 / omega[strength > 0].max()
    most = np.ceil(5 * _DELAY_PRIOR / step)
    grid = step * np.arange(-most, most + 1)
    merit = np.cos(angle + 2 * grid[:, None] * omega) @ weight
    prior = (grid / _DELAY_PRIOR) ** 2 / 2
    straight, crossed = merit - prior, -merit - prior
    best = int(np.argmax(straight))
    across = int(np.argmin(np.abs(grid)))
    turned = bool(crossed[across] > 0.8 * weight.sum() and straight.max() < 0.5 * weight.sum())
    return (0.0, True) if turned else (float(grid[best]), False)


def _phase(terms: Terms, residues: ComplexArray, delay: float, turned: bool) -> FloatArray:
    """(n,) r."""
    turns = (
        _turns(terms, residues)
        * np.exp(1j * delay * 2 * np.pi * terms.frequency_hz)
        * (1j if turned else 1)
    )
    cosine, weight = np.cos(2 * np.angle(turns)), np.abs(turns)
    order = np.argsort(cosine, axis=0)
    summed = np.cumsum(np.take_along_axis(weight, order, axis=0), axis=0)
    place = np.argmax(summed >= summed[-1] / 2, axis=0)
    return np.asarray(
        np.take_along_axis(np.take_along_axis(cosine, order, axis=0), place[None], axis=0)[0]
    )


def _trend(terms: Terms, strength: FloatArray) -> FloatArray:
    """(n,) ζ_t, by non-negative least squares of ζ/ζ_t = 1, poles far off counting less and less
    (Cauchy's weights).
    """
    zeta, omega = terms.damping_ratio, 2 * np.pi * terms.frequency_hz
    use = strength > 0
    if not use.any():
        return np.asarray(np.full(zeta.size, np.median(zeta)) if zeta.size else zeta)
    middle = float(np.exp(np.average(np.log(omega[use]), weights=strength[use])))
    shape = np.stack([np.ones(omega.size), middle / omega, omega / middle], axis=1)
    order = np.argsort(zeta[use])
    at = np.searchsorted(np.cumsum(strength[use][order]), strength[use].sum() / 2)
    usual = zeta[use][order][min(at, order.size - 1)]
    trend = np.full(zeta.size, usual)
    for _ in range(6):  # the weights change little after these
        off = np.log(zeta / trend)
        weight = np.sqrt(np.where(use, strength, 0.0) / (1 + (off / USUAL) ** 2)) / np.sqrt(
            zeta * trend
        )
        found = scipy.optimize.nnls(shape * weight[:, None], zeta * weight)[0]
        trend = np.maximum(shape @ found, 0.1 * zeta[use].min())
    return np.asarray(trend)


def _curves(terms: Terms, height: FloatArray) -> FloatArray:
    """(n, n) C of the resonance curves of each pole and each larger one, 0 of others."""
    s = terms.poles
    alike = 4 * np.outer(s.real, s.real) / np.abs(s[:, None] + s.conj()) ** 2
    return np.asarray(np.where(height[None, :] > height[:, None], alike, 0.0))


def _largest(alike: FloatArray) -> IntArray:
    """(n,) the column where each row is largest."""
    return alike.argmax(axis=1) if alike.size else np.empty(0, dtype=np.int64)


def _shape(residues: ComplexArray, curves: FloatArray) -> tuple[FloatArray, IntArray]:
    """(n,) q, and the number of the larger pole that gives it."""
    if len(residues) < FEW or not curves.size:
        return np.full(len(curves), np.nan), _largest(curves)
    scaled = residues / np.maximum(np.linalg.norm(residues, axis=0), np.finfo(float).tiny)
    mac = np.minimum(np.abs(scaled.conj().T @ scaled) ** 2, 1.0)
    distinct = (1 - mac + _LEAST) ** np.sqrt(curves)
    return distinct.min(axis=1), _largest(-distinct)


def _reach(residues: ComplexArray) -> FloatArray:
    """(n,) n."""
    if len(residues) < FEW:
        return np.full(residues.shape[1], np.nan)
    power = np.abs(residues / np.maximum(np.abs(residues).max(axis=0), np.finfo(float).tiny)) ** 2
    return np.asarray(np.maximum(1 - 1 / np.maximum(power.sum(axis=0), 1.0), _LEAST))
