"""What speaks for a pole being a mode: a few features, all from the joint fit, and one probability of
them. Why these: `docs/identification.md`.

phase   r, the median over the FRFs, weighted by |R|, of cos 2∠(2iω_d R), R the residue of the receptance.
rise    ρ, the local misfit without the pole over that with it, within 1 and 10³.
share   s, the pole's height over the FRFs at its frequency, within 0.03 and 1.
damping z = |ln ζ/ζ_t|, ζ_t a robust trend c + a₀/2ω + a₁ω/2 with coefficients >= 0 through all
poles of the set.
apart   d = √(1 - C), at least 0.01, C = 4σ_kσ_j/|s_k + s̄_j|² the MAC of its resonance curve with that of the larger pole
        nearest by it, σ = ζω.
shape   q = (1 - M + 0.01)^√C, M the MAC of its residues with those of a larger pole, of the one that makes q least.
reach   n = 1 - max|R|²/Σ|R|², at least 0.01, the share of it that other FRFs show than the strongest.
growth  g = √(Σ|ΔR|²/Σ|R|²), ΔR what R changes by, beyond noise, in hits harder by one standard deviation of ln of their height.

repeat  t = m/sd m, m = Σ_b w_b Re R̄_bᴴR_b, of half spectra of one recording's blocks b: R_b the residues of block b at the same
        poles, R̄_b their mean over the other blocks. No weight: it keeps a pole beside a better one in the fit. Of several
        recordings it is not known: a drift makes poles twice in each block.

Shape and reach need four FRFs. A delay d of a channel turns the phase of residues by -ωd, and a
wrong quantity by 90°: both are found first, from the strong poles.

    logit P = b₀ + Λ(r) + b₁ lg ρ + b₂ lg s - b₃ ln(1 + (z/0.3)²) - b₄ ln(1 + (0.15/d)²) + b₅ lg q +
    b₆ lg n - b₇ ln(1 + (g/0.1)²),

lg = log₁₀ and Λ = ln p₁(r)/p₀(r), the densities of the phase for modes and for others,

    p₁ = 0.8 e^{-(1-r)/σ}/√(πσ(1-r)) + 0.2 (1+r)/(2π√(1-r²)),    p₀ = 0.2/(π√(1-r²)) + 0.8/2,    σ = 0.1.

A mode's phase θ is off by up to 90° where another pole overlaps it or a spring is not linear, but
not in proportion: (1+r)/2 = cos²θ. What is no mode has any phase: one for all FRFs, or each its own,
whose median r spreads evenly. A feature that a set cannot give drops out. The weights' own variance
v of the logit a widens P towards ½ (MacKay 1992): P = σ(a/√(1 + πv/8)).

The weights b are a Bayesian fit to 1,286 poles of made sets, 729 of them modes (seeds 5000 to 5009;
26 November 2026; `python -m benchmarks calibrate`). That of growth is of three days later, from 783
poles: with few others (66) left by the search, the fit before says more of the rest. The prior means
of constant, rise and share are those of an earlier fit to measured and made sets, those of damping
and growth are the exponent of Cauchy's law. A fit gives up what the weights in use refuse beside a
better pole, so the poles that it leaves say little of the distance: its prior is the fit before this
one. For two modes at n independent points p(1 - M) goes as (1 - M)^(n/2 - 3/2), M their MAC; for one
shape seen twice it ends at the errors. So that of the shape is about ln 10 (n - 1)/2, with its share
of what is known of the distance: 4, as for four or five points, ± 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.modal.arrangement import CLEAR, FEW, Arrangement, counted, row_medians
from fecore.modal.series import NEAR, Terms

if TYPE_CHECKING:
    from fecore.modal.refine import LinearFit

_LEAST_REACH = 2  # lines on each side of a pole, at least, within which a misfit is its own
_LASTS = 0.02  # lines: a half bandwidth below swings through the whole record
_NARROW, _BESIDE = 0.5, 8  # lines: a half bandwidth below may be one line's alone; lines looked at
_RISE = 1e3  # most that counts; the least is 1
_SHARE = 0.03  # least that counts; the most is 1
_LEAST = 0.01  # distance, share in other FRFs, and 1 - MAC of one shape that errors leave
_DELAY_PRIOR = 2e-4  # s, one standard deviation
_STRONG = 10.0  # rise from which a pole shows the delay

USUAL = 0.3
"""Scatter of ln ζ about its trend."""

_SIGMA = 0.1  # of 1 - r of modes
_RARE = (
    # share of the modes whose phase is anything up to 90°, and of what is no mode that has one
    # phase for all FRFs
    0.2
)
_OVERDAMPED = 0.6  # ζ from which a pole is a trend of the record
_DOUBLE = 0.15  # distance below which two poles are rather one mode
_GROWTH = 0.1  # that places of hits make
NAMES = ("phase", "rise", "share", "damping", "apart", "shape", "reach", "growth")
_REASONS = 3  # features that are said of a pole

REFUSED = 0.1
"""Probability below which a pole is refused."""

_NONE = np.empty(0, dtype=np.int64)

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.0, 9.6, 4.0, 1.0, 1.0])
"""Of b₀ … b₇: constant, rise, share, damping, apart, shape, reach, growth."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 1.5, 3.0, 3.0, 0.6])
MEAN = np.array([3.090, 1.268, 6.738, 0.599, 9.256, 7.070, 5.746, 0.824])
COVARIANCE = np.array(
    [
        [0.5663, -0.1364, 0.2776, 0.0964, 0.0234, 0.1834, 0.1282, 0.0000],
        [-0.1364, 0.0990, 0.0186, -0.0023, 0.0098, 0.0530, 0.0973, 0.0000],
        [0.2776, 0.0186, 1.1681, 0.0402, -0.0127, 0.1042, -0.0238, 0.0000],
        [0.0964, -0.0023, 0.0402, 0.0639, -0.0089, 0.0277, 0.0050, 0.0000],
        [0.0234, 0.0098, -0.0127, -0.0089, 2.2366, -0.0624, -0.0108, 0.0000],
        [0.1834, 0.0530, 0.1042, 0.0277, -0.0624, 2.1577, 0.1386, 0.0000],
        [0.1282, 0.0973, -0.0238, 0.0050, -0.0108, 0.1386, 1.2628, 0.0000],
        [0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0922],
    ]
)


@dataclass(frozen=True)
class Growth:
    """What hits change that are harder by one standard deviation of the hits' heights."""

    shift: FloatArray  # (parameters,) of ln ω and ζ
    residue: FloatArray  # (n,) relative change of the residues beyond noise, rms over the FRFs


@dataclass(frozen=True)
class Evidence:
    """Features of n poles, NaN where the set cannot give one."""

    # phase, rise, share, damping, apart, shape, reach, growth, repeat: (n,) see above
    phase: FloatArray
    rise: FloatArray
    share: FloatArray
    damping: FloatArray
    apart: FloatArray
    shape: FloatArray
    reach: FloatArray
    growth: FloatArray
    repeat: FloatArray
    # (n,) number of the larger pole that it is nearest to; any where there is none
    neighbour: IntArray
    # (n,) number of the larger pole of most alike curve and shape, of most alike curve for few FRFs
    twin: IntArray
    trend: FloatArray  # (n,) ζ_t
    # (n,) whether it hardly dies away within a record, or is seen in one line, as interference is
    tone: BoolArray
    delay: float  # of the channels, s
    turned: bool  # whether all residues are turned by 90°


@dataclass(frozen=True)
class Feature:
    """One reason for or against a pole."""

    name: str  # one of `NAMES`
    value: float  # the feature
    weight: float  # what it adds to the logit of P
    words: str  # what it says, in words of the field


@dataclass(frozen=True)
class RefusedPole:
    """A pole that the fit needed, and that is not a mode."""

    frequency_hz: float  # its natural frequency
    damping_ratio: float  # its damping ratio
    reason: str  # why it is not a mode, in words
    probability: float  # that it is one all the same
    # the reasons for and against it, those that weigh most first
    features: tuple[Feature, ...]


@dataclass(frozen=True)
class Verdict:
    """The poles of a fit that are modes or uncertain, `kept` in ascending frequency, and those
    refused.
    """

    kept: IntArray
    probability: FloatArray  # (n,) of all poles
    features: tuple[tuple[Feature, ...], ...]  # n, those that weigh most first
    doubt: tuple[str | None, ...]  # n reasons why a pole is uncertain; None for modes
    refused: tuple[RefusedPole, ...]
    stated: IntArray  # (s,) those that a person stated, in the order of the statement

    def of(self, old: IntArray, frequency_hz: FloatArray) -> Verdict:
        """The verdict of new poles with these frequencies, each with that of an old one."""
        kept = np.concatenate([np.flatnonzero(old == k) for k in self.kept])
        kept = kept[np.argsort(frequency_hz[kept], kind="stable")]
        features = tuple(self.features[k] for k in old)
        doubt = tuple(self.doubt[k] for k in old)
        stated = np.array([np.flatnonzero(old == k)[0] for k in self.stated], dtype=np.int64)
        return Verdict(kept, self.probability[old], features, doubt, self.refused, stated)

    def with_refused(self, more: tuple[RefusedPole, ...]) -> Verdict:
        """The same with poles that another fit had, and whose verdict has refused them."""
        refused = sorted([*self.refused, *more], key=lambda each: each.frequency_hz)
        return replace(self, refused=tuple(refused))


def evidence_of(arrangement: Arrangement, fit: LinearFit, growth: Growth | None = None) -> Evidence:
    """The features of all poles of a series fitted to FRFs, with what harder hits change where that
    is known.
    """
    terms = fit.terms
    each = fit.linear.variance[:, : 2 * terms.pairs]
    variance = np.maximum(each[:, 0::2] + each[:, 1::2], np.finfo(float).tiny)
    known = _known(arrangement, terms, variance)
    residues = fit.residues * known
    rise = _rise(arrangement, fit)
    clear = np.abs(fit.residues) ** 2 > CLEAR**2 * variance
    height, share = _share(arrangement, fit, np.where(clear, 1.0, known))
    inside = arrangement.in_band(terms.frequency_hz)
    tone = inside & (terms.half_bandwidth_hz < _LASTS * arrangement.spacing_hz)
    tone |= inside & _of_one_line(arrangement, fit)
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
        growth=np.full(terms.pairs, np.nan) if growth is None else growth.residue,
        repeat=_repeat(arrangement, fit),
        neighbour=_largest(curves),
        twin=twin,
        trend=trend,
        tone=tone,
        delay=delay,
        turned=turned,
    )


def _rise(arrangement: Arrangement, fit: LinearFit) -> FloatArray:
    off = np.abs(arrangement.frequency_hz[:, None] - fit.terms.frequency_hz)
    near = off <= np.maximum(
        NEAR * fit.terms.half_bandwidth_hz, _LEAST_REACH * arrangement.spacing_hz
    )
    misfit = np.sum(fit.weight * np.abs(fit.residual) ** 2, axis=0)
    # clean data leave nothing
    usual = 0.1 * np.mean(arrangement.measured.sum(axis=0)) * np.maximum(near.sum(axis=0), 1)
    with_it = np.maximum(misfit @ near, usual)
    return np.asarray(np.clip(1 + fit.gains / with_it, 1.0, _RISE))


def _of_one_line(arrangement: Arrangement, fit: LinearFit) -> BoolArray:
    """(n,) poles far narrower than a line that the lines beside their nearest one do not pay for: the
    one is as well interference.
    """
    terms, hz = fit.terms, arrangement.frequency_hz
    one = terms.half_bandwidth_hz < _NARROW * arrangement.spacing_hz
    for k in np.flatnonzero(one):
        place = int(np.argmin(np.abs(hz - terms.frequency_hz[k])))
        beside = np.abs(np.arange(hz.size) - place)
        beside = np.flatnonzero((beside > 0) & (beside <= _BESIDE))
        both = slice(2 * k, 2 * k + 2)
        own = fit.linear.coefficients[:, both] @ fit.linear.basis[beside, both].T
        one[k] = np.sum(fit.weight[:, beside] * np.abs(own) ** 2) < fit.pole_price
    return np.asarray(one)


def _known(arrangement: Arrangement, terms: Terms, variance: FloatArray) -> FloatArray:
    """(N, n) what each FRF counts in the features of each pole: 1, less by the variance of its
    residue, of (N, n), where that is clearly larger than is usual, and 0 without a line about
    the pole.
    """
    reach = np.maximum(NEAR * terms.half_bandwidth_hz, _LEAST_REACH * arrangement.spacing_hz)
    ends = np.clip(terms.frequency_hz, *arrangement.frequency_hz[[0, -1]])
    near = np.abs(arrangement.frequency_hz[:, None] - ends) <= reach
    seen = arrangement.measured.astype(float) @ near > 0
    seen |= ~seen.any(axis=0)
    usual = row_medians(np.where(seen, variance, np.nan).T)
    return np.where(seen, counted(variance, usual), 0.0)


def _share(
    arrangement: Arrangement, fit: LinearFit, known: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(n,) height of each pole at the line next to its frequency, and over the FRFs there: a needle
    between lines has none.
    """
    terms, n = fit.terms, fit.terms.pairs
    place = np.argmin(np.abs(arrangement.frequency_hz[:, None] - terms.frequency_hz), axis=0)
    at = fit.linear.basis[place]  # (n, q), line k at pole k
    own = at[np.arange(n)[:, None], np.stack([2 * np.arange(n), 2 * np.arange(n) + 1], axis=1)]
    c = fit.linear.coefficients
    height = np.abs(c[:, 0 : 2 * n : 2] * own[:, 0] + c[:, 1 : 2 * n : 2] * own[:, 1])
    beside = np.broadcast_to(fit.background, fit.residual.shape)[:, place]
    height, whole = known * height, known * np.abs(beside + c @ at.T)
    total = np.sqrt(np.sum(height**2, axis=0))
    share = total / np.maximum(np.sqrt(np.sum(whole**2, axis=0)), np.finfo(float).tiny)
    return total, np.asarray(np.clip(share, _SHARE, 1.0))


def _turns(terms: Terms, residues: ComplexArray) -> ComplexArray:
    """(N, n) 2iω_d R, whose phase is 0 or 180° for a mode."""
    return np.asarray(2j * terms.poles.imag * residues)


def _delay(terms: Terms, residues: ComplexArray, strength: FloatArray) -> tuple[float, bool]:
    """The delay (s) that turns the strong poles' residues back, and whether they all stand at 90°
    to a mode's.

    Maximises Σ_k w_k cos(2(φ_k + ω_k d)) less d²/2d₀² over a grid, φ_k = ½ arg Σ_i (2iω_d R_ik)².
    """
    if np.sum(strength > 0) < 2:
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
    several = np.sum(strength > 0) > 2
    return (0.0, True) if turned else (float(grid[best]) if several else 0.0, False)


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
        factors = scipy.optimize.nnls(shape * weight[:, None], zeta * weight)[0]
        trend = np.maximum(shape @ factors, 0.1 * zeta[use].min())
    return np.asarray(trend)


def curves_alike(pole: ComplexArray, others: ComplexArray) -> FloatArray:
    """(n, m) MAC of the resonance curves of poles and others, 4σ_kσ_j/|s_k + s̄_j|², σ = ζω."""
    both = np.abs(pole[:, None] + others.conj()) ** 2
    return np.asarray(4 * np.outer(pole.real, others.real) / both)


def _curves(terms: Terms, height: FloatArray) -> FloatArray:
    """(n, n) C of the resonance curves of each pole and each larger one, 0 of others."""
    alike = curves_alike(terms.poles, terms.poles)
    return np.asarray(np.where(height[None, :] > height[:, None], alike, 0.0))


def _repeat(arrangement: Arrangement, fit: LinearFit) -> FloatArray:
    """(n,) t, NaN where no blocks are known."""
    n, linear, blocks = fit.terms.pairs, fit.linear, arrangement.blocks
    if blocks is None:
        return np.full(n, np.nan)
    background = np.broadcast_to(fit.background, arrangement.values.shape)
    place = np.searchsorted(blocks.frequency_hz, arrangement.frequency_hz * (1 - 1e-9))
    own = blocks.blocks.reshape(blocks.weights.size, -1, blocks.frequency_hz.size)
    own = (own[:, arrangement.source][..., place] - background) * fit.weights.root
    c = np.ascontiguousarray(own).view(np.float64) @ linear.scaled @ linear.turn @ linear.turn.T
    residues = c[..., 0 : 2 * n : 2] + 1j * c[..., 1 : 2 * n : 2]
    weight = blocks.weights[:, None, None]
    others = (np.sum(weight * residues, axis=0) - weight * residues) / (1 - weight)
    each, share = np.einsum("gik,gik->gk", others.conj(), residues).real, weight[:, 0]
    mean, groups = np.sum(share * each, axis=0), len(share)
    variance = groups / (groups - 1) * np.sum(share**2 * (each - mean) ** 2, axis=0)
    return np.asarray(mean / np.sqrt(np.maximum(variance, np.finfo(float).tiny)))


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


def probability(evidence: Evidence, damping_ratio: FloatArray) -> FloatArray:
    """(n,) P of each pole; 0 of one that cannot be a mode."""
    ratio, x = design(evidence)
    return np.where(no_mode(evidence, damping_ratio), 0.0, judged(ratio, x, MEAN, COVARIANCE))


def no_mode(evidence: Evidence, damping_ratio: FloatArray) -> BoolArray:
    """(n,) poles that do not swing, or are tones."""
    return np.asarray((damping_ratio > _OVERDAMPED) | evidence.tone)


def design(evidence: Evidence) -> tuple[FloatArray, FloatArray]:
    """(n,) Λ, and (n, 8) what the weights multiply."""
    x = np.stack(
        [
            np.ones(evidence.phase.size),
            np.log10(evidence.rise),
            np.log10(evidence.share),
            -np.log1p((evidence.damping / USUAL) ** 2),
            -np.log1p((_DOUBLE / evidence.apart) ** 2),
            np.log10(evidence.shape),
            np.log10(evidence.reach),
            -np.log1p((evidence.growth / _GROWTH) ** 2),
        ],
        axis=1,
    )
    return phase_ratio(evidence.phase), np.where(np.isnan(x), 0.0, x)


def phase_ratio(r: FloatArray) -> FloatArray:
    """Λ(r) = ln p₁(r)/p₀(r), both densities times π√(1-r²)."""
    r = np.clip(r, 1e-6 - 1, 1)  # Λ stays finite
    usual = np.sqrt(np.pi * (1 + r) / _SIGMA) * np.exp(-(1 - r) / _SIGMA)
    of_modes = (1 - _RARE) * usual + _RARE * (1 + r) / 2
    of_others = _RARE + (1 - _RARE) * np.pi * np.sqrt(1 - r**2) / 2
    return np.asarray(np.log(of_modes / of_others))


def judged(
    ratio: FloatArray, x: FloatArray, mean: FloatArray, covariance: FloatArray
) -> FloatArray:
    """P of poles with a design, under weights with a covariance."""
    return predictive(ratio + x @ mean, np.einsum("ni,ij,nj->n", x, covariance, x))


def predictive(logit: FloatArray, variance: FloatArray) -> FloatArray:
    """P for a logit that is known with a variance."""
    return np.asarray(1 / (1 + np.exp(-logit / np.sqrt(1 + np.pi * variance / 8))))


def judge(
    arrangement: Arrangement,
    fit: LinearFit,
    evidence: Evidence,
    threshold: float,
    stated: IntArray = _NONE,
) -> Verdict:
    """Which poles of a fit are modes, from a probability on or because a person stated them,
    uncertain, or refused.
    """
    f, zeta = fit.terms.frequency_hz, fit.terms.damping_ratio
    p, reasons = probability(evidence, zeta), features(evidence, f, zeta)
    order = np.argsort(f, kind="stable")
    order = order[arrangement.in_band(f)[order]]
    may_be = (p[order] >= REFUSED) | np.isin(order, stated)
    refused = tuple(
        RefusedPole(
            float(f[k]), float(zeta[k]), _against(reasons[k]), float(p[k]), reasons[k][:_REASONS]
        )
        for k in order[~may_be]
    )
    most = tuple(each[:_REASONS] for each in reasons)
    doubt = tuple(
        None
        if own >= threshold or k in stated
        else f"a mode with probability {own:.2f}: {'; '.join(one.words for one in each)}"
        for k, (own, each) in enumerate(zip(p, most, strict=True))
    )
    return Verdict(order[may_be], p, most, doubt, refused, stated)


def _against(reasons: tuple[Feature, ...]) -> str:
    """What speaks most against a pole, in words."""
    against = [each.words for each in reasons if each.weight < 0][:2]
    return "; ".join(against) if against else "nothing speaks for it clearly"


def features(
    evidence: Evidence, frequency_hz: FloatArray, damping_ratio: FloatArray
) -> list[tuple[Feature, ...]]:
    """The features of each pole, those that weigh most first."""
    ratio, x = design(evidence)
    added = np.concatenate([ratio[:, None], x[:, 1:] * MEAN[1:]], axis=1)
    out = []
    for k in range(len(x)):
        each = [
            Feature(
                name,
                float(value),
                float(weight),
                _words(name, evidence, k, frequency_hz, damping_ratio),
            )
            for name, weight in zip(NAMES, added[k], strict=True)
            if np.isfinite(value := getattr(evidence, name)[k])
        ]
        out.append(tuple(sorted(each, key=lambda feature: -abs(feature.weight))))
    return out


def _words(
    name: str, evidence: Evidence, k: int, frequency_hz: FloatArray, damping_ratio: FloatArray
) -> str:
    if name == "phase":
        r = evidence.phase[k]
        like = (
            "a mode's"
            if r > 0.8
            else "a quadratic distortion's"
            if r < -0.5
            else "neither a mode's nor clear"
        )
        return f"the phase of its residues is {like} (r = {r:.2f})"
    if name == "rise":
        most = "at least " if evidence.rise[k] >= _RISE else ""
        return f"without it the local misfit is {most}{float(f'{evidence.rise[k]:.3g}'):g} times as large"
    if name == "share":
        return f"it is {100 * evidence.share[k]:.0f} % of the FRFs at its frequency"
    if name == "damping":
        times = damping_ratio[k] / evidence.trend[k]
        return f"its damping of {100 * damping_ratio[k]:.2g} % is {times:.2g} times the set's trend"
    if name == "apart":
        other = evidence.neighbour[k]
        width = frequency_hz[k] * damping_ratio[k] + frequency_hz[other] * damping_ratio[other]
        if evidence.apart[k] > 0.99:
            return "no larger pole is beside it"
        return (
            f"the larger pole at {frequency_hz[other]:.2f} Hz is"
            f" {abs(frequency_hz[k] - frequency_hz[other]) / width:.2g} bandwidths away; the"
            " nearer, the likelier both are one mode that moves from test to test"
        )
    if name == "shape":
        other = evidence.twin[k]
        return (
            f"shape and curve part it from the larger pole at {frequency_hz[other]:.2f} Hz by"
            f" {evidence.shape[k]:.2f} of 1; one mode seen twice has one shape"
        )
    if name == "growth":
        return f"harder hits change its part in the FRFs by {100 * evidence.growth[k]:.0f} %"
    return f"the FRF that shows it best has {100 - 100 * evidence.reach[k]:.0f} % of it"


def no_mode_message(arrangement: Arrangement, refused: tuple[RefusedPole, ...], full: bool) -> str:
    """What was seen and what to try, for a record without a mode."""
    band = f"{arrangement.frequency_hz[0]:g} to {arrangement.frequency_hz[-1]:g} Hz"
    seen = [f"{p.frequency_hz:.1f} Hz ({p.reason})" for p in refused[:8]]
    return (
        f"no mode is supported by the {len(arrangement.pairs)} FRFs from {band}. "
        + (
            f"Poles seen and refused: {'; '.join(seen)}. "
            if seen
            else "No pole lowers the misfit by what it costs. "
        )
        + ("The search stopped at most_modes; raise it, or leave it out. " if full else "")
        + "Try a band around a resonance, more averages, or a higher order; check that responses"
        " and forces are not swapped, and that the imaginary part has the sign of exp(+iωt)."
    )
