"""The search for the poles that FRFs need, and for the drift of the structure between the tests.

The FRFs of one structure are real combinations of as many functions of frequency as there are modes
and residual terms, so N FRFs span few dimensions above their noise. With a_i the noise of FRF i,
the rows H_i/a_i (real beside imaginary parts) have a singular value decomposition U S Vᵀ; its
leading rows UᵀH/a are themselves FRFs with the same poles: real combinations keep the conjugate
symmetry of the series.

The candidates that pay are taken (`matching_pursuit`). Then all poles are refined together, poles
that no longer pay leave, and the residual offers new candidates, a few rounds in all.

Drift. Temperature, moved sensors or a support that comes loose turn all natural frequencies of test s by
one factor 1 + d_s. Where a resonance is as narrow as the drift, the FRFs do not fit one series:
damping comes out too large, and modes are found twice or more. With poles s_k(1 + d) the FRFs of a
test are linear in their residues, so

    χ²_s(d) = min_c Σ_l w_l |H_s(l) - Φ(l; s_k(1 + d)) c|²

is found on a grid, with one decomposition of Φ for all tests (a separable problem; Golub and
Pereyra 2003). A test drifts at most five times as far as half of them do: that is all the prior.
Poles that lie side by side, as a drift makes them, are one in this series.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError
from fecore.modal.arrangement import (
    CLEAR,
    FEW,
    NARROW,
    Arrangement,
    LinearPoles,
    Part,
    clusters,
    linear_poles,
)
from fecore.modal.errors import pulled
from fecore.modal.judge import (
    REFUSED,
    Evidence,
    RefusedPole,
    curves_alike,
    evidence_of,
    judge,
)
from fecore.modal.refine import (
    HOPELESS,
    PASSES,
    LinearFit,
    count_modes,
    linear_fit,
    local_variance,
    plausible,
    pruned,
    refine,
    refined_modes,
    reweighted_fit,
    with_poles,
    with_residual_terms,
)
from fecore.modal.series import (
    BESIDE,
    ONE,
    PRICE,
    Terms,
    columns,
    matching_pursuit,
    overlapping,
    stacked,
    whitening,
    without_drift,
)

ROUNDS = 5
"""Of growth on the residual."""

# distance below which the residues of two poles cancel, and have no phase of their own
_CANCEL = 0.05
# distance below which two poles may be one mode whose frequency differs between tests
_MOVED = 0.5
_RESIDUAL_ORDER = 10  # of the linear stage on the residual

STEPS = 8
"""Of the refinement in each round."""

REFINED, SETTLED = 16, 1e-2
"""Steps of the refinement of poles that are searched no more, and the decrease of χ² that ends them:
a move of a tenth of a standard deviation.
"""

ENOUGH = 1.0
"""Decrease of χ² that a step is worth before the last round."""

_MOST = 24  # combinations kept, and more while these leave so much of the power
_LEFT = 0.005  # of all power, that combinations which are not kept may hold
_SHORT = 0.02  # of the lines: a gap up to here is bridged for the search
_FIRST = 2  # steps after which new poles are looked at
_SMOOTHEST = 3.0  # lines that are worth one, at most: a mode that lacks makes a smooth residual too
_SPARE = 6  # poles beside twice those that are not refused, from which a search must find more
# FRFs up to which the first round looks at groups: where more differ by a drift, doubles would pay
# too
_FEW = 2
# relative drift of a frequency to either side: 8 % of a modulus, beyond any room's temperature
_WIDEST = 0.02
_ALIKE = 3.0  # ratio of the widths of poles that a drift makes of one mode
# half bandwidths, and lines at least, on each side of a pole whose lines show the drift
_REACH = 6.0
_ONE_CURVE = 0.5  # MAC of the resonance curves from which poles of two octaves are one


@dataclass(frozen=True)
class CombinedFrfs:
    """All FRFs and the few combinations that stand for them, each with the variance of its
    noise.
    """

    arrangement: Arrangement
    noise: FloatArray
    few: Arrangement
    few_noise: FloatArray

    @classmethod
    def of(cls, arrangement: Arrangement, noise: FloatArray) -> CombinedFrfs:
        """FRFs with the variance (N, L) of their noise, and their combinations."""
        few, few_noise = compress(arrangement, noise)
        return cls(arrangement, noise, replace(few, blocks=None), few_noise)

    def aligned(self, weight: FloatArray, terms: Terms, drift: FloatArray) -> CombinedFrfs:
        """The FRFs less what a (N,) drift makes of a series, by weights (N, L)."""
        arrangement = without_drift(self.arrangement, terms, weight, drift)
        return CombinedFrfs.of(arrangement, self.noise)

    def refined(
        self,
        terms: Terms,
        before: Terms | None = None,
        steps: int = STEPS,
        enough: float = ENOUGH,
    ) -> Terms:
        """The poles refined on the combinations, under the variance that they leave, or poles
        before them.

        Where poles left, the others would make a variance large first that then lets them stray.
        """
        variance = reweighted_fit(self.few, before or terms, self.few_noise).variance
        fit = linear_fit(self.few, terms, variance)
        return refined_modes(self.few, fit, steps, enough=enough).terms

    def misfit(self, terms: Terms, variance: FloatArray) -> float:
        """χ² of the series with all FRFs under a variance (N, L), its poles refined."""
        refined = self.refined(terms)
        return linear_fit(self.arrangement, refined, variance).chi_squared

    def fitted(self, terms: Terms) -> LinearFit:
        """The series with all FRFs, without poles and residual terms that do not pay."""
        terms = with_residual_terms(self.arrangement, terms)
        return pruned(self.arrangement, reweighted_fit(self.arrangement, terms, self.noise))


def compress(arrangement: Arrangement, noise: FloatArray) -> tuple[Arrangement, FloatArray]:
    """The leading combinations under a noise variance (N, L), as if they were FRFs, and the (r, L)
    variance of their noise.

    Their pairs name no true dofs. FRFs that are few or full of gaps stay as they are.
    """
    rows = len(arrangement.pairs)
    if rows <= _MOST // 2:  # nothing is gained
        return arrangement, noise
    values, bridged = _bridged(arrangement)
    if 2 * bridged.sum() < rows:
        return arrangement, noise
    own = np.sqrt(np.median(noise[bridged], axis=1))
    scaled = values[bridged] / own[:, None]
    weight = 1 / np.sqrt(
        np.mean(noise[bridged] / own[:, None] ** 2 + np.abs(scaled) ** 2 * 1e-4, axis=0)
    )
    flat = np.concatenate([scaled.real * weight, scaled.imag * weight], axis=1)
    value, vector = np.linalg.eigh(flat @ flat.T)
    count = _rank(value[::-1], flat.shape[1])
    if count >= rows:
        return arrangement, noise
    mixing = np.zeros((count, rows))
    mixing[:, bridged] = vector[:, ::-1][:, :count].T / own
    few = replace(
        arrangement,
        values=mixing @ values,
        measured=np.ones((count, arrangement.frequency_hz.size), dtype=bool),
        variance=np.full((count, arrangement.frequency_hz.size), np.nan),
        growth=np.full((count, arrangement.frequency_hz.size), np.nan, dtype=complex),
        pairs=arrangement.pairs[:count],
        row=arrangement.row[:count],
        source=arrangement.source[:count],
    )
    return few, np.asarray(mixing**2 @ noise)


def _rank(value: FloatArray, columns: int) -> int:
    """Combinations above the noise: eigenvalues over twice the edge (1 + √(N/columns))² of those of
    noise alone; at most as many as leave little of all power.
    """
    usual = float(np.median(value[len(value) // 2 :]))
    edge = 2 * usual * (1 + np.sqrt(len(value) / columns)) ** 2
    left = 1 - np.cumsum(value) / np.sum(value)
    return int(np.clip(np.sum(value > edge), 4, max(_MOST, 1 + int(np.sum(left > _LEFT)))))


def _bridged(arrangement: Arrangement) -> tuple[ComplexArray, BoolArray]:
    """The values with short gaps bridged by straight lines, and (N,) the FRFs in which that was
    possible.
    """
    gaps = ~arrangement.measured
    fine = np.ones(len(gaps), dtype=bool)
    if not gaps.any():
        return arrangement.values, fine
    values = arrangement.values.copy()
    line = np.arange(arrangement.frequency_hz.size)
    longest = max(2, _SHORT * line.size)
    for row in np.flatnonzero(gaps.any(axis=1)):
        known = np.concatenate([[-1], line[~gaps[row]], [line.size]])
        fine[row] = np.diff(known).max() <= longest + 1
        if fine[row]:
            values[row] = np.interp(line, known[1:-1], values[row, known[1:-1]])
    return values, fine


def forward_selection(
    data: CombinedFrfs,
    start: Terms,
    pool: ComplexArray,
    most: int,
    step: Callable[[int], None],
    rounds: int = ROUNDS,
) -> Terms:
    """The poles that the combinations of FRFs need.

    In every round

    1. Candidates: what the residual shows, and those of the pool.
    2. Choose: those that pay, each on top of those before it.
    3. Refuse: what is no mode after a first refinement is error: it leaves, and its power goes into
       the variance of its lines.
    4. Refine: all poles, with all residual terms, and the variance, in turn.
    5. Prune: what does not pay any more; the rounds end where they add no mode.

    Args:
        data: the FRFs.
        start: the series to start from.
        pool: candidates, rad/s; in every round those that the residual shows are added.
        most: largest number of poles.
        step: called after every round with the number of poles.
        rounds: most rounds.
    """
    arrangement, noise = data.few, data.few_noise
    beside = len(data.arrangement.pairs) - len(arrangement.pairs)
    first = np.append(pool, _beyond(arrangement))
    fit = reweighted_fit(arrangement, start, noise)
    count = count_modes(arrangement, fit)
    for number in range(rounds):
        # 1. Candidates.
        pairs = fit.terms.pairs
        candidates = first
        if pairs:
            weak_poles = linear_poles(
                arrangement.omega, fit.residual, fit.weight, _RESIDUAL_ORDER, (NARROW,)
            )
            candidates = np.append(clusters(weak_poles), first)
        elif len(fit.residual) <= _FEW:
            # Under its own variance, which follows what it misses, no mode of a group of overlapping
            # ones can gain more than two for each line of the group, and none pays alone: the
            # variance is what the fit would leave with all candidates in it.
            all_of_them = with_poles(fit.terms, candidates[:most])
            whole = linear_fit(arrangement, all_of_them, fit.variance)
            variance = local_variance(arrangement, whole.residual, noise)
            fit = linear_fit(arrangement, fit.terms, variance)
        # 2. Choose.
        # lines that share their errors count once: what bends the modes that are there is no other
        tau = min(fit.residual_memory, _SMOOTHEST) if pairs else 1.0
        added = matching_pursuit(arrangement, fit, candidates, most - pairs, beside, tau)
        if not added.size:
            break
        # 3. Refuse.
        terms = with_poles(fit.terms, added)
        larger = linear_fit(arrangement, terms, fit.variance)
        larger = refined_modes(arrangement, larger, _FIRST, HOPELESS)
        keep = plausible(arrangement, larger, HOPELESS)
        if not keep.all():
            terms = larger.terms.some(keep)
            larger = linear_fit(arrangement, terms, larger.variance, larger.weights)
        # 4. Refine.
        for _ in range(PASSES):
            larger = refined_modes(arrangement, larger, STEPS)
            # Not before there are poles, as residual terms would take the place of a broad one;
            # then all of them again, as a better fit may need what a poor one did without.
            terms, variance = with_residual_terms(arrangement, larger.terms), larger.variance
            whole = linear_fit(arrangement, terms, variance, larger.weights)
            own = local_variance(arrangement, whole.residual, noise)
            larger = linear_fit(arrangement, terms, own, basis=whole.linear.basis)
            if np.mean(np.log(variance / own)) < 1:
                break
        # 5. Prune.
        fit = pruned(arrangement, larger, beside)
        step(fit.terms.pairs)
        before, count = count, count_modes(arrangement, fit)
        more = count > before or fit.terms.pairs <= _SPARE + 2 * count
        if (number and fit.terms.pairs <= pairs) or not more:
            break
    return fit.terms


def _beyond(arrangement: Arrangement) -> ComplexArray:
    """Candidates outside the band, for modes whose skirts reach into it."""
    low, high = arrangement.omega[0], arrangement.omega[-1]
    at = np.append(high * np.array([1.03, 1.1, 1.25, 1.6]), low * np.array([0.6, 0.8, 0.95]))
    return np.asarray((np.array([[-0.01], [-0.05]]) + 1j) * at).ravel()


def aligned_search(
    data: CombinedFrfs, terms: Terms, pool: ComplexArray, most: int, step: Callable[[int], None]
) -> tuple[CombinedFrfs, Terms, FloatArray]:
    """The FRFs and the series that they need, extended from a first one: without the drift of their
    tests where it pays.

    Poles that the series lacks may pass for a drift, and a drift for poles. So both are extended on aligned
    FRFs first, and the same poles, refined, must do worse by the price of the drift without it.
    """
    fit = data.fitted(terms)
    pool = np.append(pool, terms.poles)
    # of a drift of all tests but one (Akaike), where lines share their errors
    price = PRICE * (data.arrangement.sessions - 1) * fit.residual_memory
    drift, merged = _drift_of(data, fit, price)
    if np.any(drift):
        frfs = data.aligned(fit.weight, merged, drift)
        extended = forward_selection(frfs, merged, pool, most, step)
        frfs = data.aligned(fit.weight, extended, drift)
        left, without = (of.misfit(extended, fit.variance) for of in (frfs, data))
        if without - left > price:
            return frfs, extended, drift
    return data, forward_selection(data, terms, pool, most, step), np.zeros(drift.shape)


def _drift_of(data: CombinedFrfs, fit: LinearFit, price: float) -> tuple[FloatArray, Terms]:
    """(N,) the drift of each FRF that lowers χ² most, and the series that shows it; 0 where no drift
    pays its price.
    """
    arrangement = data.arrangement
    each: FloatArray = np.zeros(len(arrangement.pairs))
    inside = arrangement.in_band(fit.terms.frequency_hz)
    if arrangement.sessions < FEW or not inside.any():
        return each, fit.terms
    terms = _merged(fit, inside)
    twins = (fit.terms.pairs - terms.pairs) * fit.pole_price
    reach, least = _WIDEST, fit.chi_squared + twins - price
    while True:  # every turn lowers χ² by the price of a test, so it ends
        trial, gain = _drifts(arrangement, terms, fit.weight, reach)
        if gain <= price:
            break
        frfs = data.aligned(fit.weight, terms, trial)
        refined = frfs.refined(terms)
        left = linear_fit(frfs.arrangement, refined, fit.variance).chi_squared
        if left > least:
            break
        each, terms, least = trial, refined, left - price / (arrangement.sessions - 1)
        reach = CLEAR * float(np.median(np.abs(each)))
    return each, terms


def _merged(fit: LinearFit, inside: BoolArray) -> Terms:
    """The series with one pole, in their middle and as narrow as the narrowest, for those side by
    side.

    Poles within half a bandwidth are what a small drift makes of one mode; those further apart may
    be true pairs, unless at least half of the modes come in pairs.
    """
    near, double = _side_by_side(fit, inside, BESIDE)
    return near if double else _side_by_side(fit, inside, ONE)[0]


def _side_by_side(fit: LinearFit, inside: BoolArray, reach: float) -> tuple[Terms, bool]:
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
    return merged, bool(np.mean(several) >= 0.5)


def _drifts(
    arrangement: Arrangement, terms: Terms, weight: FloatArray, reach: float
) -> tuple[FloatArray, float]:
    """(N,) the most probable drifts about their mean, on a grid about none, and what they lower χ²
    by.
    """
    grid, tests = np.linspace(-reach, reach, 41), arrangement.session
    lines = _lines(arrangement, terms)
    each = _misfits(arrangement, terms, weight, grid, lines)
    misfit: FloatArray = np.stack([np.bincount(tests, own) for own in each]).astype(float)
    # where each test's misfit is least, by a parabola about the best of the grid
    best = np.clip(np.argmin(misfit, axis=0), 1, grid.size - 2)
    low, mid, high = (misfit[best + shift, np.arange(best.size)] for shift in (-1, 0, 1))
    step, bend = grid[1] - grid[0], np.maximum(low - 2 * mid + high, 0.0)
    off = np.clip(np.where(bend > 0, (low - high) / np.where(bend > 0, 2 * bend, 1.0), 0.0), -1, 1)
    drift, least = grid[best] + off * step, mid + (high - low) * off / 2 + bend * off**2 / 2
    drift -= np.median(drift)
    most = CLEAR * float(np.median(np.abs(drift)))
    # a test that shows nothing drifts no further than the others
    drift = np.clip(drift, -most, most)
    return np.asarray((drift - drift.mean())[tests]), float(np.sum(misfit[grid.size // 2] - least))


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
            columns(omega, terms.drifted(float(drift), arrangement.spacing_hz), arrangement.power),
            root,
        )
        frame = basis @ whitening(basis)
        out[place] = level * (whole - np.sum((target @ frame) ** 2, axis=1))
    return out


def without_spurious(
    data: CombinedFrfs, fit: LinearFit
) -> tuple[LinearFit, tuple[RefusedPole, ...]]:
    """The fit without refused poles that only bend a better one beside them, that no distance
    separates from a larger one, or that are a mode beside them in the tests that pull it most; and
    the refused poles that have left.
    """
    refused: tuple[RefusedPole, ...] = ()
    for _ in range(PASSES):
        if not fit.terms.pairs:
            break
        evidence = evidence_of(data.arrangement, fit)
        verdict = judge(data.arrangement, fit, evidence, REFUSED)
        one = pulled(data.arrangement, fit, evidence.neighbour) & (evidence.apart < _MOVED)
        gone = _spurious(data.arrangement, fit, evidence, verdict.probability) | one
        if not gone.any():
            break
        leaving = fit.terms.frequency_hz[gone]
        refused += tuple(each for each in verdict.refused if each.frequency_hz in leaving)
        fit = data.fitted(data.refined(fit.terms.some(~gone), fit.terms))
    return fit, refused


def _spurious(
    arrangement: Arrangement, fit: LinearFit, evidence: Evidence, probability: FloatArray
) -> BoolArray:
    """(n,) refused poles in band that do not come again in each block of a recording, and overlap one
    that is rather a mode; and poles hardly apart from a larger one.
    """
    terms, width = fit.terms, fit.terms.half_bandwidth_hz
    good, poor = probability >= 0.5, probability < REFUSED
    apart = np.abs(terms.frequency_hz[:, None] - terms.frequency_hz) / (width[:, None] + width)
    beside = arrangement.in_band(terms.frequency_hz) & (apart[:, good] < BESIDE).any(axis=1)
    # nearer ones may be one mode, or two shapes that the references see under one pole
    once = ~(evidence.repeat > CLEAR) | (apart[:, good] < ONE).any(axis=1)
    return np.asarray((poor & once & beside) | (evidence.apart < _CANCEL))


def with_stated(data: CombinedFrfs, fit: LinearFit, stated: Terms) -> tuple[LinearFit, IntArray]:
    """The fit with the poles that a person stated, and (s,) their numbers: one is a pole of the fit
    where it may be one with it, else it is added and refined with the others.

    Raises:
        IdentificationError: it does not stay where it is.
    """
    if not stated.pairs:
        return fit, np.empty(0, dtype=np.int64)
    arrangement, s, other = data.arrangement, stated.poles, fit.terms.poles
    new = ~overlapping(s, other)
    off = np.abs(s[:, None] - other) / -(s.real[:, None] + other.real)
    at = off.argmin(axis=1) if other.size else np.zeros(s.size, dtype=np.int64)
    at = np.where(new, other.size + np.cumsum(new) - 1, at)
    free = np.union1d(np.flatnonzero(plausible(arrangement, fit)), at)
    terms = with_poles(fit.terms, s[new])
    refined = refine(arrangement, terms, fit.variance, REFINED, SETTLED, free=free).terms
    for k, pole, hz in zip(at, s, stated.frequency_hz, strict=True):
        near, there = int(np.argmin(np.abs(refined.poles - pole))), refined.frequency_hz
        beyond = not arrangement.in_band(there[[k]])[0]
        if near != k or beyond:
            where = "beyond the lines" if beyond else f"and that at {there[near]:.2f} Hz is nearer"
            raise IdentificationError(
                f"the FRFs hold no pole of its own at {hz:g} Hz: fitted from there, it goes to"
                f" {there[k]:.2f} Hz, {where}; leave it out of the poles to fit"
            )
    return reweighted_fit(arrangement, refined, data.noise), at


@dataclass(frozen=True)
class Searched:
    """What FRFs show: the poles that they need, and the drift of their tests."""

    data: CombinedFrfs  # the FRFs without the drift, where it pays
    series: LinearFit
    drift: FloatArray  # (N,) relative drift of each FRF's frequencies
    linear: LinearPoles  # the linear poles
    refused: tuple[RefusedPole, ...] = ()  # poles that have left beside a better one


def joined(
    arrangement: Arrangement, noise: FloatArray, parts: Sequence[Part], searched: Sequence[Searched]
) -> Searched:
    """What the FRFs of a band show, from what its parts do: of each its own poles, where no lower
    part has their curve; and the median of the drifts, where it pays in the whole band.
    """
    if len(parts) == 1:
        return searched[0]
    refused = tuple(
        pole
        for part, each in zip(parts, searched, strict=True)
        for pole in each.refused
        if part.ends_hz[0] <= pole.frequency_hz < part.ends_hz[1]
    )
    poles: ComplexArray = np.empty(0, dtype=complex)
    for part, each in zip(parts, searched, strict=True):
        own = part.own(each.series.terms)
        poles = np.append(poles, own[~(curves_alike(own, poles) >= _ONE_CURVE).any(axis=1)])
    data = CombinedFrfs.of(arrangement, noise)
    series = data.fitted(Terms.at(poles))
    within = [
        each.linear.between(*part.ends_hz) for part, each in zip(parts, searched, strict=True)
    ]
    linear = LinearPoles(*map(np.concatenate, zip(*map(astuple, within), strict=True)))
    drifts = [each.drift for each in searched if each.drift.any()]
    drift: FloatArray = np.median(drifts, axis=0) if drifts else np.zeros(len(noise))
    if drifts:
        trial = data.aligned(series.weight, series.terms, drift)
        left = linear_fit(trial.arrangement, series.terms, series.variance).chi_squared
        price = PRICE * (arrangement.sessions - 1) * series.residual_memory
        if left < series.chi_squared - price:
            return Searched(trial, trial.fitted(series.terms), drift, linear, refused)
    return Searched(data, series, np.zeros(len(noise)), linear, refused)
