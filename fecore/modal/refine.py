"""Fits of the modal series to FRFs: at given poles, at the poles of least misfit, and without poles
that do not pay; and the errors of what they give.

Minimises χ²(θ, c) = Σ_il w_il |H_il - Φ(θ)_l c_i|², w = 2/v, over the poles θ = (ln ω_k, ζ_k),
common to all FRFs, and the linear coefficients c_i of each FRF. With Gaussian noise of variance v
that is the maximum likelihood estimate. The c_i are eliminated (variable projection, Golub and
Pereyra 1973, with Kaufman's Jacobian): per FRF, J_i = ∂(Φ c_i)/∂θ with c_i held, and

    H = Σ_i J_iᵀJ_i - J_iᵀΦ (ΦᵀΦ)⁻¹ ΦᵀJ_i,    g = Σ_i J_iᵀ r_i        (weighted inner products),

the Gauss-Newton step is H⁻¹g, damped as by Levenberg and Marquardt. At the optimum H⁻¹ is the
covariance of θ. All inner products of all FRFs come from one matrix product over the lines, since
every J_i is a combination of the same 2n derivative columns.

The variance follows the local misfit, v_il = g_i p_l, at least the noise. A pole is worth its place
where χ² would rise without it by more than Akaike's price of 2 for each unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError
from fecore.modal.arrangement import WHOLE, Arrangement
from fecore.modal.errors import SHIFT, ErrorModel, widened
from fecore.modal.judge import REFUSED, Growth, evidence_of, probability
from fecore.modal.series import (
    PRICE,
    VAGUE,
    Coefficients,
    Terms,
    Weights,
    at_lines,
    bounded_step,
    columns,
    derivatives,
    expanded,
    memory,
    missing_slopes,
    normal_columns,
    one_minus_leverage,
    real_part,
    slope_parts,
    solved,
    spectrum,
    stacked,
)

PASSES = 2
"""Turns of two estimates that each need the other, a variance and a fit: the first fit's own is too
large for clean data.
"""

EXPONENTS = tuple(range(-3, 3))
"""Powers of iω of the receptance that stand for the modes outside the band and for rigid body
motion with its damping.
"""

HARDLY = 0.02
"""Probability below which a pole is not refined."""

HOPELESS = 0.001
"""... where it is new."""

_WORTH = 30.0  # times its price that a pole gains which may stay all the same

# what hits of usual height change, over what one standard deviation of their heights (a factor of
# 1.6 of a spring's force y³, where hits count by their power)
_OF_HEIGHT = 2.0
_LOCAL = 25  # lines over which the misfit is averaged
_MOST_RELATIVE = 0.05  # largest ε
_FREEDOM = 8.0  # of Student's law
_LAST = 3  # steps with all FRFs and a weight for each value

OUTLYING = (_FREEDOM + 2 - 0.1 * _FREEDOM) / 2
"""|r|² over its variance v/u from which a value's weight u is below 0.1."""


@dataclass(frozen=True)
class LinearFit:
    """A fit at given poles, without its derivatives: all that a choice between series needs."""

    terms: Terms  # poles and residual terms
    linear: Coefficients  # coefficients of every FRF, with their covariance for fixed poles
    variance: FloatArray  # (N, L) noise variance that weighted the fit
    weights: Weights  # what each value counts
    residual: ComplexArray  # (N, L) measured minus model
    chi_squared: float  # weighted sum of squared residuals
    # (N, L) what stands fixed beside the terms, taken from the FRFs before they are fitted
    background: ComplexArray | float

    @property
    def weight(self) -> FloatArray:
        """(N, L) 2/v of each complex value, 0 where nothing was measured."""
        return self.weights.each

    @cached_property
    def residues(self) -> ComplexArray:
        """(N, n) residues of the receptance."""
        c = self.linear.coefficients[:, : 2 * self.terms.pairs]
        return np.asarray(c[:, 0::2] + 1j * c[:, 1::2])

    @cached_property
    def gains(self) -> FloatArray:
        """(n,) what χ² would rise by without each pole, all other coefficients fitted anew: Σ_i
        cᵀV⁻¹c, V the covariance of c.
        """
        linear = self.linear
        return gains(linear.coefficients, linear.spread, linear.share, self.terms.pairs)

    @property
    def pole_price(self) -> float:
        """Akaike's price of a pole, of two unknowns an FRF and two for the pole, and that of having
        looked for it at every line.
        """
        rows, lines = self.residual.shape
        return float(PRICE * (2 * rows + 2) + 2 * np.log(lines))

    @property
    def model(self) -> ComplexArray:
        """(N, L) fitted FRFs."""
        return np.asarray(self.background + self.part(np.arange(self.terms.columns)))

    @cached_property
    def residual_memory(self) -> float:
        """Number of lines of the residual that are worth one, see `memory`."""
        return memory(self.residual, self.variance, self.weight > 0, self.model)

    def part(self, which: IntArray) -> ComplexArray:
        """(N, L) what some of the terms' columns make of the FRFs."""
        return expanded(self.linear.coefficients[:, which], self.linear.basis[:, which])

    def without(self, arrangement: Arrangement, gone: BoolArray) -> LinearFit:
        """The fit to FRFs without some poles and background, under the same variance."""
        return linear_fit(arrangement, self.terms.some(~gone), self.variance, self.weights)


def gains(c: FloatArray, spread: FloatArray, share: FloatArray, pairs: int) -> FloatArray:
    """(n,) the gains of poles by their coefficients (N, q), see `Level.gains` and `LinearFit`."""
    one, two = c[:, 0 : 2 * pairs : 2], c[:, 1 : 2 * pairs : 2]
    at = 2 * np.arange(pairs)
    a, b, d = spread[:, at, at], spread[:, at, at + 1], spread[:, at + 1, at + 1]
    determinant = np.maximum(a * d - b**2, 1e-12 * a * d + np.finfo(float).tiny)
    return np.asarray(share @ ((d * one**2 - 2 * b * one * two + a * two**2) / determinant))


def linear_fit(
    arrangement: Arrangement,
    terms: Terms,
    variance: FloatArray,
    weights: Weights | None = None,
    background: ComplexArray | float = 0.0,
    basis: ComplexArray | None = None,
) -> LinearFit:
    """Linear coefficients and residual at given poles.

    Args:
        arrangement: the FRFs.
        terms: poles and residual terms.
        variance: (N, L) of the FRFs' noise.
        weights: those of the variance, where they are known.
        background: (N, L) what stands fixed beside the terms.
        basis: (L, q) columns of the terms, where they are known.

    Raises:
        IdentificationError: an FRF has no weight on the lines of a term.
    """
    weights = weights or Weights.of(variance, arrangement.measured)
    basis = columns(arrangement.omega, terms, arrangement.power) if basis is None else basis
    values = arrangement.values - background if np.any(background) else arrangement.values
    linear = solved(basis, values, weights)
    residual = expanded(linear.coefficients, basis)
    np.subtract(values, residual, out=residual)
    residual[~arrangement.measured] = 0
    square = residual.real**2 + residual.imag**2
    return LinearFit(
        terms=terms,
        variance=variance,
        weights=weights,
        linear=linear,
        residual=residual,
        chi_squared=float(np.vdot(weights.each, square)),
        background=background,
    )


def local_variance(
    arrangement: Arrangement,
    residual: ComplexArray,
    noise: FloatArray,
    *,
    one_minus_leverage: FloatArray | float = 1.0,
    alike: bool = True,
) -> FloatArray:
    """(N, L) variance that follows the local misfit: the mean of |residual|² over 25 lines, at
    least the noise, and at least the share ε²|H|² that is usual where the FRFs are large: errors of
    the chain stand on the few lines of a peak.

    Args:
        arrangement: the FRFs.
        residual: (N, L) of a fit.
        noise: (N, L) variance of the noise.
        one_minus_leverage: (L,) share of each line that the fit leaves to its errors, 1 less the leverage: on
            the two or three lines of a narrow peak the residue and the pole take up most of them.
        alike: take the variances as one function of frequency but for a factor, v_il = g_i p_l,
            where few values are missing.
    """
    measured, size = arrangement.measured, arrangement.squares
    square = residual.real**2 + residual.imag**2
    least = _relative(square, size * one_minus_leverage, arrangement.large) * size
    square = scipy.ndimage.uniform_filter1d(
        np.where(measured, square, 0.0), _LOCAL, axis=1, mode="nearest"
    )
    count = scipy.ndimage.uniform_filter1d(
        measured * one_minus_leverage, _LOCAL, axis=1, mode="nearest"
    )
    variance = np.maximum(np.where(measured, noise, 0.0), square / np.maximum(count, 1 / _LOCAL))
    variance = np.maximum(variance, np.maximum(least, np.finfo(float).tiny))
    if not alike or measured.mean(axis=1).min() < WHOLE:
        return np.asarray(variance)
    log = np.log(variance)
    level = np.mean(log, axis=1, keepdims=True, where=measured)
    size = np.exp(log - level)
    shape = np.mean(size, axis=0, where=measured | ~measured.any(axis=0))
    return np.asarray(np.exp(level) * shape)


def _relative(square: FloatArray, size: FloatArray, large: IntArray) -> float:
    """ε², the usual |residual|² over |H|² of the largest of these, at most 0.05²."""
    share = square.ravel()[large] / np.maximum(size.ravel()[large], np.finfo(float).tiny ** 0.5)
    return float(min(np.median(share) / np.log(2), _MOST_RELATIVE**2))


def reweighted_fit(arrangement: Arrangement, terms: Terms, noise: FloatArray) -> LinearFit:
    """The fit at given poles under the variance of its own misfit, at least the noise (N, L)."""
    missed_by, basis = arrangement.values, None
    for _ in range(1 + PASSES):
        variance = local_variance(arrangement, missed_by, noise)
        fit = linear_fit(arrangement, terms, variance, basis=basis)
        missed_by, basis = fit.residual, fit.linear.basis
    return fit


def with_residual_terms(arrangement: Arrangement, terms: Terms) -> Terms:
    """The terms with all residual terms that the lines carry, fewer where these are few."""
    lines = int(arrangement.measured.sum(axis=1).min())
    return replace(terms, exponents=EXPONENTS if lines >= 8 * len(EXPONENTS) else (-2, 0))


def with_poles(terms: Terms, pole: ComplexArray) -> Terms:
    """The terms with more poles, rad/s."""
    new = Terms.at(pole)
    return replace(
        terms,
        frequency_hz=np.append(terms.frequency_hz, new.frequency_hz),
        damping_ratio=np.append(terms.damping_ratio, new.damping_ratio),
    )


@dataclass(frozen=True, kw_only=True)
class PoleFit(LinearFit):
    """A model fitted to all FRFs."""

    # twice the number of measured values less the number of unknowns, the expectation of χ²
    freedom: int
    information: FloatArray  # (parameters, parameters) matrix H of (ln ω_1 … ln ω_n, ζ_1 … ζ_n)
    # (N, q, 2m), or (1, q, 2m), coefficients of the basis in the derivative columns
    inside: FloatArray
    free: IntArray  # (m,) numbers of the poles that are refined, whose f and ζ are the parameters
    scores: FloatArray  # (N, parameters) what each FRF adds to the gradient of -χ²/2
    by_frf: FloatArray  # (N, parameters) what each FRF adds to the diagonal of H
    errors: ErrorModel | None = None  # what is known of them, beside their variance

    @property
    def memory(self) -> float:
        """Number of lines that count as one independent line."""
        return 1.0 if self.errors is None else self.errors.memory

    @property
    def gradient(self) -> FloatArray:
        """(parameters,) of -χ²/2."""
        return np.asarray(self.scores.sum(axis=0))

    @property
    def pole_jacobian(self) -> FloatArray:
        """(N, q, parameters) -∂c/∂θ, by which residues inherit the uncertainty of the poles."""
        turn, n = slope_parts(self.terms, self.residues, self.free), self.free.size
        inside = self.inside.reshape(*self.inside.shape[:2], n, 2)
        return np.asarray(
            np.einsum("nqka,npka->nqpk", inside, turn).reshape(
                len(turn), self.inside.shape[1], 2 * n
            )
        )

    @property
    def excess(self) -> float:
        """Variance of the residual over the stated noise, at least 1."""
        return max(1.0, self.chi_squared / self.freedom)

    @property
    def inflation(self) -> float:
        """Factor of all variances: the excess, and the lines that are worth one."""
        return self.excess * self.memory

    def growth(self, arrangement: Arrangement) -> Growth | None:
        """What harder hits change, where it is known of all FRFs.

        Their growth is what the FRFs lack at one step of Gauss and Newton from the fit.
        """
        values = np.where(arrangement.measured, arrangement.growth, 0)
        if not np.all(np.isfinite(values)):
            return None
        level = linear_fit(
            replace(arrangement, values=values), self.terms, self.variance, self.weights
        )
        n, turn = self.terms.pairs, slope_parts(self.terms, self.residues, self.free)
        basis = self.linear.basis[:, : 2 * n]
        steep = derivatives(arrangement.omega, self.terms, arrangement.power, basis)
        score = real_part(self.weight * level.residual, steep.T).reshape(len(turn), n, 2)
        gradient = np.einsum("npka,nka->pk", turn, score).ravel()
        step = bounded_step(self.information, gradient, np.ones(2 * n), 0.0)[0]
        c = level.linear.coefficients - self.pole_jacobian @ step
        square = np.sum(c[:, : 2 * n] ** 2, axis=0).reshape(n, 2).sum(axis=1)
        square -= self.residue_variance.sum(axis=0)
        power = np.sum(np.abs(self.residues) ** 2, axis=0)
        share = np.maximum(square, 0.0) / np.maximum(power, np.finfo(float).tiny)
        return Growth(step, np.sqrt(share))

    @cached_property
    def residue_variance(self) -> FloatArray:
        """(N, n) E|error|² of the residues, the uncertainty of the poles included.

        With c = A⁻¹(Φᵀy) and poles that err by e, δc = -A⁻¹ΦᵀJ e: Cov(c) = A⁻¹ + A⁻¹B Cov(θ) BᵀA⁻¹,
        B = ΦᵀJ.
        """
        n = self.terms.pairs
        jacobian = self.pole_jacobian[:, : 2 * n]
        own = self.linear.variance[:, : 2 * n] * self.inflation
        spread = own + np.sum(np.matmul(jacobian, self.parameter_covariance) * jacobian, axis=2)
        return np.asarray(spread[:, 0::2] + spread[:, 1::2])

    @cached_property
    def parameter_covariance(self) -> FloatArray:
        """Covariance of the non-linear parameters, scaled up where the residual is larger than the
        stated noise.

        A null direction of the information gives its own parameters a large variance and touches no
        other. Where the sessions are known, each standard deviation is at least what the scatter
        between them shows (`widened`). Errors e that all FRFs share are taken to have shifted a
        pole by `SHIFT` e half bandwidths. Then each is at least the change under other weights:
        where the series is the whole truth, both fits estimate the same poles, and differ by what
        noise does to them (Hausman 1978). What changes with the height of hits, beyond its variance, is
        off by as much and more at none, or by what all FRFs share: the larger, as one spring makes both.
        Frequencies that are means over the sessions have the variance of these.
        """
        scale, value, vector, null = spectrum(self.information)
        inverse = (vector[:, ~null] / value[~null]) @ vector[:, ~null].T
        part = np.where(vector.T**2 > 1e-4, vector.T**2, 0.0)  # less is round-off
        inverse[np.diag_indices_from(inverse)] += np.where(null, 1 / VAGUE, 0.0) @ part
        inverse = inverse / scale[:, None] / scale
        if (errors := self.errors) is None:
            return np.asarray(inverse * self.inflation)
        spread = widened(inverse, self.inflation, self.scores, errors.sessions, errors.leverage)
        shared = np.tile((SHIFT * errors.shared * self.terms.damping_ratio) ** 2, 2)
        own, factor = np.diag(spread), np.ones(len(spread))
        lacking = np.maximum(np.square(errors.change) - own - shared, 0.0)
        if errors.shift is not None:
            shared = np.maximum(shared, _OF_HEIGHT**2 * (np.square(errors.shift) - own))
        if errors.mean is not None:
            least, n = np.diag(inverse) * self.inflation, self.terms.pairs
            factor[:n] = np.sqrt(np.maximum(errors.mean.variance, least[:n]) / own[:n])
        return np.asarray(spread * np.outer(factor, factor) + np.diag(shared + lacking))


def refine(
    arrangement: Arrangement,
    terms: Terms,
    variance: FloatArray,
    steps: int = 40,
    enough: float = 1e-3,
    background: ComplexArray | float = 0.0,
    free: IntArray | None = None,
) -> PoleFit:
    """Poles of least χ² for a given noise variance and background, from the given start; a step that
    would gain less than `enough` ends it. The poles numbered `free` move, all of them where it is
    None.

    A decrease of χ² by 1e-3 is a move of a thirtieth of a standard deviation.

    Raises:
        IdentificationError: a term has no weight.
    """
    free = np.arange(terms.pairs) if free is None else free
    start = linear_fit(arrangement, terms, variance, None, background)
    fit, slopes = _least_misfit(arrangement, start, free, steps, enough)
    return slopes or _with_slopes(arrangement, fit, free)


def robust_fit(
    arrangement: Arrangement, fit: LinearFit, noise: FloatArray, free: BoolArray
) -> PoleFit:
    """The free poles of a fit, fitted anew with a variance for each value by Student's law; the other
    poles stay as they are, as background.
    """
    variance = student(arrangement, fit, noise)
    background = fit.part(np.flatnonzero(np.repeat(~free, 2))) if not free.all() else 0.0
    terms = fit.terms.some(free)
    return refine(arrangement, terms, variance, steps=_LAST, background=background)


def _least_misfit(
    arrangement: Arrangement, fit: LinearFit, free: IntArray, steps: int, enough: float
) -> tuple[LinearFit, PoleFit | None]:
    """The fit from which no step gains enough, or after so many steps; with its matrices where a
    step was looked for from there.
    """
    both = np.concatenate([free, fit.terms.pairs + free])
    slopes: PoleFit | None = None
    damping, growth = 1e-4, 10.0
    for _ in range(steps):
        slopes = slopes or _with_slopes(arrangement, fit, free)
        zeta = fit.terms.damping_ratio[free]  # no pole moves by more than its width
        limit = np.concatenate([np.maximum(zeta, 1e-3), np.maximum(0.7 * zeta, 1e-4)])
        own, predicted = bounded_step(slopes.information, slopes.gradient, limit, damping)
        if predicted < enough:
            break
        step = np.zeros(fit.terms.parameters)
        step[both] = own
        try:
            trial = linear_fit(
                arrangement, fit.terms.moved(step), fit.variance, fit.weights, fit.background
            )
        except IdentificationError:  # a term has no weight there: a shorter step
            trial = fit
        if trial.chi_squared < fit.chi_squared:
            gain = fit.chi_squared - trial.chi_squared
            damping = max(damping / (10 if gain > 0.7 * predicted else 2), 1e-10)
            fit, slopes, growth = trial, None, 10.0
        else:
            damping, growth = max(damping, 1e-5) * growth, 10 * growth
            if damping > 1e8:
                break
    return fit, slopes


def _with_slopes(arrangement: Arrangement, level: LinearFit, free: IntArray) -> PoleFit:
    """The same fit with its Gauss-Newton matrices.

    The derivative columns are taken less their projection on the frame, which leaves H as it is and
    spares it the cancellation.
    """
    terms, linear, weights = level.terms, level.linear, level.weights
    turn = slope_parts(terms, level.residues, free)
    known = linear.basis.T[(2 * free[:, None] + [0, 1]).ravel()].T
    steep = derivatives(arrangement.omega, terms.some(free), arrangement.power, known)
    own = stacked(steep, weights.root)
    onto = linear.turn.T @ (linear.scaled.T @ own)
    over = (linear.turn @ onto).T
    n, inside = free.size, onto[None]
    if weights.share is None:
        r = len(onto)
        steep -= expanded(over, linear.basis).T
        gram = normal_columns(weights.each, linear.frame, steep)
        framed = np.matmul(linear.root, gram[:, :r])
        products = gram[:, r:] - np.matmul(framed.transpose(0, 2, 1), framed)
        inside = inside + np.matmul(linear.root.transpose(0, 2, 1), framed)
        products = products.reshape(len(turn), n, 2, n, 2)
        half = np.einsum("nkalb,nqlb->nkaql", products, turn)
        information = np.einsum("npka,nkaql->pkql", turn, half)
        by_frf = np.einsum("npka,nkab,npkb->npk", turn, np.einsum("nkakb->nkab", products), turn)
        score = real_part(weights.each * level.residual, steep.T)
    else:
        rows = own.T
        rows -= over @ linear.scaled.T
        flat = turn.reshape(len(turn), -1)
        pairs = (flat.T @ (weights.share[:, None] * flat)).reshape(2, n, 2, 2, n, 2)
        products = (own.T @ own).reshape(n, 2, n, 2)
        information = np.einsum("pkaqlb,kalb->pkql", pairs, products)
        by_frf = np.einsum("npka,kab,npkb->npk", turn, np.einsum("kakb->kab", products), turn)
        by_frf *= weights.share[:, None, None]
        for row, lines in weights.gaps:
            frame = at_lines(linear.scaled, lines) @ linear.turn
            lost = missing_slopes(frame, at_lines(own, lines))
            lost = lost.reshape(len(lost), n, 2)
            lost = np.sqrt(weights.share[row]) * np.einsum("gka,pka->gpk", lost, turn[row])
            information -= np.einsum("gpk,gql->pkql", lost, lost)
            by_frf[row] -= np.sum(lost**2, axis=0)
        weighted = (weights.share[:, None] * weights.root) * level.residual
        score = weighted.view(np.float64) @ own
    score = score.reshape(len(turn), n, 2)
    return PoleFit(
        **{each.name: getattr(level, each.name) for each in fields(LinearFit)},
        freedom=2 * int(arrangement.measured.sum()) - 2 * n - len(level.residual) * terms.columns,
        information=information.reshape(2 * n, 2 * n),
        inside=np.matmul(linear.turn, inside),
        free=free,
        scores=np.einsum("npka,nka->npk", turn, score).reshape(len(turn), 2 * n),
        by_frf=by_frf.reshape(len(turn), 2 * n),
    )


def plausible(arrangement: Arrangement, fit: LinearFit, least: float = HARDLY) -> BoolArray:
    """(n,) poles that may be modes, stand out of band, or hide most of what is beside them: of the
    last as many as there are others.
    """
    p, poor = _in_band(arrangement, fit)
    poor &= p < least
    worth = np.where(poor, fit.gains / fit.pole_price, 0.0)
    strong = np.argsort(-worth, kind="stable")[: int(np.sum(p >= least))]
    poor[strong[worth[strong] > _WORTH]] = False
    return ~poor


def _in_band(arrangement: Arrangement, fit: LinearFit) -> tuple[FloatArray, BoolArray]:
    """(n,) P of each pole, 0 out of band and of tones, and which ones these are not."""
    evidence = evidence_of(arrangement, fit)
    within = arrangement.in_band(fit.terms.frequency_hz) & ~evidence.tone
    return np.where(within, probability(evidence, fit.terms.damping_ratio), 0.0), within


def count_modes(arrangement: Arrangement, fit: LinearFit) -> int:
    """Number of the poles that are not refused."""
    return int(np.sum(_in_band(arrangement, fit)[0] >= REFUSED))


def refined_modes(
    arrangement: Arrangement,
    fit: LinearFit,
    steps: int,
    least: float = HARDLY,
    enough: float = 1.0,
) -> LinearFit:
    """The fit with its poles refined under its own variance, but for those of a probability below
    the least: they stay as they are meanwhile.
    """
    free = np.flatnonzero(plausible(arrangement, fit, least))
    return _least_misfit(arrangement, fit, free, steps, enough)[0]


def pruned(arrangement: Arrangement, fit: LinearFit, beside: int = 0) -> LinearFit:
    """The fit without poles that do not pay, the broadest of them first: what a narrower one
    explains must not outlive it.

    Combinations stand for more FRFs, `beside` them. In each of these a pole has two unknowns too,
    that gain 1 each from noise. Residual terms that do not pay go after the poles, the least worth first.
    """
    terms, c, C, share = fit.terms, fit.linear.coefficients, fit.linear.spread, fit.linear.share
    price = fit.pole_price + (PRICE - 1) * 2 * beside
    while terms.pairs:
        poor = gains(c, C, share, terms.pairs) < price
        if not poor.any():
            break
        k = int(np.argmax(np.where(poor, terms.half_bandwidth_hz, -1.0)))
        c, C = _left_out(c, C, [2 * k, 2 * k + 1])
        terms = terms.some(np.arange(poor.size) != k)
    while len(terms.exponents) > 1:
        spread = np.einsum("nii->ni", C)[:, 2 * terms.pairs :]
        gain = share @ (c[:, 2 * terms.pairs :] ** 2 / np.maximum(spread, np.finfo(float).tiny))
        least = int(np.argmin(gain))
        if gain[least] > PRICE * len(fit.residual) + (PRICE - 1) * beside:
            break
        c, C = _left_out(c, C, [2 * terms.pairs + least])
        terms = replace(terms, exponents=terms.exponents[:least] + terms.exponents[least + 1 :])
    return fit if terms is fit.terms else linear_fit(arrangement, terms, fit.variance, fit.weights)


def _left_out(c: FloatArray, C: FloatArray, gone: list[int]) -> tuple[FloatArray, FloatArray]:
    """Coefficients (N, q) and their covariance, or one for all, without some columns, the others fitted anew: c -
    C_g C_gg⁻¹ c_g.
    """
    own = C[:, :, gone]
    back = np.matmul(own, np.linalg.pinv(own[:, gone], hermitian=True))
    c = c - np.matmul(back, c[:, gone, None])[:, :, 0]
    C = C - np.matmul(back, own.transpose(0, 2, 1))
    return np.delete(c, gone, axis=1), np.delete(np.delete(C, gone, axis=1), gone, axis=2)


def student(arrangement: Arrangement, fit: LinearFit, noise: FloatArray) -> FloatArray:
    """(N, L) variance of each value by Student's law with ν degrees of freedom about the local one:
    v/u, at least the noise.

    u = (ν + 2)/(ν + 2|r|²/v), v the local mean of u|r|² (expectation maximisation; Lange, Little
    and Taylor 1989): a line of interference or an overload counts for little, and does not raise
    the variance of the lines beside it.
    """
    left = one_minus_leverage(arrangement, fit.terms, fit.linear, fit.weights)
    weight, square = np.ones(fit.residual.shape), np.abs(fit.residual) ** 2
    for _ in range(3):  # the weights change little after these
        v = local_variance(
            arrangement,
            fit.residual * np.sqrt(weight),
            noise,
            one_minus_leverage=left,
            alike=False,
        )
        weight = (_FREEDOM + 2) / (_FREEDOM + 2 * square / v)
    return np.asarray(v / np.minimum(weight, 1.0))
