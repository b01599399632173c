"""The modal series; weighted linear least squares of all FRFs at once at given poles; what more
poles would gain; and what lasts over lines or FRFs in the residual.

A receptance is, with s = iω,

    α(s) = Σ_k R_k/(s - s_k) + R̄_k/(s - s̄_k)  +  Σ_e c_e s^e,

s_k = ω_k(-ζ_k + i√(1 - ζ_k²)). The last sum is the residual terms: s⁻³ to s⁻¹ stand for modes below
the band (rigid body motion and its damping), s⁰, s¹, s² for modes above it; their coefficients are
real because α is the transform of a real function. A mobility or accelerance is α times s or s².
Everything is linear in (Re R, Im R, c) for given poles: H = Φc.

Each FRF i has its own weights w_i² = 1/v_i, so its own normal matrix G_i = Re Φᴴ W_i² Φ. Normal
matrices square the condition number of Φ. Therefore Φ is first made orthonormal under the weights'
mean over the FRFs, Φ = Q T⁻¹: what is left of G_i is as well conditioned as the FRFs' weights are
alike, and a direction of the coefficients that the lines do not determine (a singular value of the
scaled columns below round-off) is left out, so that it is 0 in the solution and touches no other
coefficient. Where the weights are one function of frequency but for a factor, w_i² = a_i p, every
G_i is a_i, and an FRF with gaps g has a_i (1 - Q_gᵀQ_g), whose inverse is (1 + Q_gᵀS⁻¹Q_g)/a_i, S =
1 - Q_g Q_gᵀ of the gaps' size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray, real_times
from fecore.errors import IdentificationError
from fecore.modal.arrangement import WHOLE, Arrangement, proportional

if TYPE_CHECKING:
    from fecore.modal.refine import LinearFit

# of the largest singular value: below it a direction of the scaled coefficients is round-off
_NULL = 1e-9
_TURNS = 30  # in which the bounds of a step are found
# eigenvalue of the scaled information below which a direction is null: a large variance, not
# infinity
VAGUE = 1e-10
# singular value of scaled columns over the largest from which their products keep 1e-6, and from
# which those of the columns that these make nearly orthonormal keep all
_WELL_CONDITIONED, _TWICE = 1e-5, 1e-7

PRICE = 2.0
"""Of an unknown (Akaike)."""

DAMPING_RANGE = (1e-5, 0.95)
"""Of ζ: a pole beyond is no resonance."""

ONE, BESIDE = 0.5, 1.5
"""Summed half bandwidths within which two poles may be one mode, and within which one bends the
other.
"""

NEAR = 3.0
"""Half bandwidths on each side of a pole within which a misfit is its own."""

_TOGETHER = 8  # candidates whose columns are made at a time, as they stay in the processor's cache
_FOR_ONE = 10  # columns for each FRF from which the products of one FRF after another take less
_SAME = 0.03  # summed half bandwidths within which a candidate is a pole that is there
_STILL = 0.05  # correlation below which the sum ends
_CAP = 3.0  # standard deviations
_TONE = 0.1  # lines: a half bandwidth below is a tone's


@dataclass(frozen=True)
class Terms:
    """What a model of the FRFs is made of."""

    frequency_hz: FloatArray  # (n,) undamped natural frequencies of the complex pole pairs, Hz
    damping_ratio: FloatArray  # (n,) their damping ratios
    exponents: tuple[int, ...]  # powers of s of the residual terms (of a receptance)

    @classmethod
    def at(cls, pole: ComplexArray) -> Terms:
        """Poles, rad/s, without residual terms."""
        size = np.abs(pole)
        return cls(size / (2 * np.pi), np.clip(-pole.real / size, *DAMPING_RANGE), ())

    @property
    def pairs(self) -> int:
        """Number of complex pole pairs."""
        return int(self.frequency_hz.size)

    @property
    def columns(self) -> int:
        """Number of real linear coefficients of each FRF."""
        return 2 * self.pairs + len(self.exponents)

    @property
    def half_bandwidth_hz(self) -> FloatArray:
        """(n,) ζf, Hz."""
        return self.frequency_hz * self.damping_ratio

    @property
    def poles(self) -> ComplexArray:
        """(n,) poles with positive imaginary part, rad/s: s = ω(-ζ + i√(1 - ζ²))."""
        zeta = self.damping_ratio
        return np.asarray(2 * np.pi * self.frequency_hz * (-zeta + 1j * np.sqrt(1 - zeta**2)))

    def some(self, which: IntArray | BoolArray) -> Terms:
        """The terms with some of the poles."""
        return replace(
            self,
            frequency_hz=self.frequency_hz[which],
            damping_ratio=self.damping_ratio[which],
        )

    def drifted(self, drift: float, spacing_hz: float) -> Terms:
        """The terms with all resonances moved; a pole much narrower than a line is a tone, which
        stays where it is.
        """
        tone = self.half_bandwidth_hz < _TONE * spacing_hz
        return replace(self, frequency_hz=self.frequency_hz * np.where(tone, 1.0, 1 + drift))

    def moved(self, step: FloatArray) -> Terms:
        """Terms after a step in (ln ω, ζ); damping stays within its physical range."""
        n = self.pairs
        return replace(
            self,
            frequency_hz=self.frequency_hz * np.exp(step[:n]),
            damping_ratio=np.clip(self.damping_ratio + step[n:], *DAMPING_RANGE),
        )

    @property
    def parameters(self) -> int:
        """Number of non-linear parameters: frequency and damping of each pair."""
        return 2 * self.pairs


def overlapping(pole: ComplexArray, others: ComplexArray, most: float = ONE) -> BoolArray:
    """(n,) whether a pole may be one with another, or within so many summed half bandwidths."""
    reach = most * -(pole.real[:, None] + others.real)
    return np.asarray((np.abs(pole[:, None] - others) <= reach).any(axis=1))


def columns(
    omega: FloatArray, terms: Terms, power: int, reference: float | None = None
) -> ComplexArray:
    """(L, q) basis: for each pole pair the factors of Re R and Im R, then residual terms.

    Those of a pair are 2(s + σ)/D and -2ω_d/D, D = (s - s_k)(s - s̄_k), σ = ζω. Residual terms are taken
    in s/ω_ref to be of like size; `reference` is ω_ref, by default the geometric mean of the first
    and the last line.
    """
    n, lift, pole = 2 * terms.pairs, (1j * omega) ** power, terms.poles[:, None]
    rows = np.empty((terms.columns, omega.size), dtype=complex)
    # the temporaries of so many entries stay in the processor's cache
    step = max(1, 10_000 // max(terms.pairs, 1))
    for part in (slice(first, first + step) for first in range(0, omega.size, step)):
        s = 1j * omega[part]
        one, other = s - pole, s - pole.conj()
        both = lift[part] / (one * other)
        np.multiply(one + other, both, out=rows[0:n:2, part])
        np.multiply(-2 * pole.imag, both, out=rows[1:n:2, part])
    scaled = omega / (reference or np.sqrt(omega[0] * omega[-1]))
    for place, e in enumerate(terms.exponents, n):
        rows[place] = lift * (1j**e * scaled**e)
    return rows.T


def derivatives(
    omega: FloatArray, terms: Terms, power: int, basis: ComplexArray | None = None
) -> ComplexArray:
    """(L, 2n) columns of which all derivatives of the model by its poles are made, see `slopes`.

    For each pole pair 1/(s - s_k)² + 1/(s - s̄_k)² and i times their difference: (a² - b²)/2 and ab of
    its two columns a and b in the basis, which may be given.
    """
    basis = columns(omega, replace(terms, exponents=()), power) if basis is None else basis
    a, b = basis.T[0::2], basis.T[1::2]
    rows = np.empty((basis.shape[1], omega.size), dtype=complex)
    drop = (1j * omega) ** -power
    first, second = rows[0::2], rows[1::2]
    np.multiply(a - b, a + b, out=first)
    first *= drop / 2
    np.multiply(a, b, out=second)
    second *= drop
    return rows.T


def slopes(terms: Terms) -> tuple[ComplexArray, ComplexArray]:
    """(n,) ∂s_k/∂ln ω_k and ∂s_k/∂ζ_k.

    With R_k the residue, ∂H/∂θ = Re(R_k ∂s_k/∂θ) E₁ + Im(R_k ∂s_k/∂θ) E₂, E the two columns of the
    pair in `derivatives`.
    """
    zeta = terms.damping_ratio
    by_zeta = 2 * np.pi * terms.frequency_hz * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))
    return terms.poles, np.asarray(by_zeta)


def slope_parts(terms: Terms, residues: ComplexArray, free: IntArray) -> FloatArray:
    """(N, 2, m, 2) of how much of its two derivative columns the derivative of each FRF by ln ω_k,
    and by ζ_k, is made.
    """
    parts = residues[:, None, free] * np.stack(slopes(terms.some(free)))
    return np.stack([parts.real, parts.imag], axis=3)


@dataclass(frozen=True)
class Weights:
    """What each value of the FRFs counts."""

    each: FloatArray  # (N, L) 2/v of each complex value, 0 where nothing was measured
    # (N,) of each FRF, where all have one function of frequency but for this factor and few gaps
    share: FloatArray | None
    root: FloatArray  # (L,) of the weights' mean over the FRFs, see `mean_weight`
    gaps: tuple[tuple[int, IntArray], ...] = ()  # number and missing lines of FRFs with a share

    @classmethod
    def of(cls, variance: FloatArray, measured: BoolArray) -> Weights:
        """The weights for a variance (N, L) of the values that were measured."""
        whole = 2 / np.maximum(variance, np.finfo(float).tiny)
        each = np.where(measured, whole, 0.0)
        if measured.mean(axis=1).min() < WHOLE or (share := proportional(whole)) is None:
            return cls(each, None, mean_weight(each))
        level = whole[0].mean()
        gaps = tuple(
            (int(i), np.flatnonzero(~measured[i])) for i in np.flatnonzero(~measured.all(1))
        )
        return cls(each, share * level, np.sqrt(whole[0] / level), gaps)


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of every FRF on one basis."""

    coefficients: FloatArray  # (N, q) real coefficients
    basis: ComplexArray  # (L, q)
    scaled: FloatArray  # (2L, q) the basis, weighted by the mean over the FRFs
    turn: FloatArray  # (q, r) coefficients of the basis from those of the frame
    # (N, r, r) R with RᵀR the inverse normal matrices of the frame; (1, r, r) where these are alike
    # but for the share. What is left of a product after projection keeps twice the digits when it
    # is made from the root.
    root: FloatArray
    share: FloatArray  # (N,) by which the normal matrices are larger than R says

    @cached_property
    def frame(self) -> ComplexArray:
        """(L, r) the basis made orthonormal, r <= q."""
        return expanded(self.turn.T, self.basis).T

    @cached_property
    def spread(self) -> FloatArray:
        """(N, q, q), or (1, q, q), covariance of the coefficients for the stated weights, times the
        share.
        """
        root = np.matmul(self.root, self.turn.T)
        spread: FloatArray = np.matmul(root.transpose(0, 2, 1), root)
        return spread

    @property
    def variance(self) -> FloatArray:
        """(N, q) variance of the coefficients for the stated weights."""
        return np.asarray(np.einsum("nii->ni", self.spread) / self.share[:, None])


def solved(basis: ComplexArray, values: ComplexArray, weights: Weights) -> Coefficients:
    """The coefficients of all FRFs (N, L) on a basis (L, q).

    Raises:
        IdentificationError: an FRF has fewer measured lines than unknowns.
    """
    scaled = stacked(basis, weights.root)
    turn = whitening(scaled)
    if weights.share is not None:
        return _alike(basis, scaled, turn, values, weights)
    frame = expanded(turn.T, basis).T
    right = real_part(weights.each * values, frame.T)
    normal = normal_columns(weights.each, frame)
    scale = np.sqrt(np.einsum("nii->ni", normal))
    _check_weight(scale)
    unit = normal / (scale[:, :, None] * scale[:, None, :])
    try:
        inverse: FloatArray = np.asarray(np.linalg.inv(np.linalg.cholesky(unit)), dtype=np.float64)
    except np.linalg.LinAlgError:
        inverse = _roots(unit)
    root = inverse / scale[:, None, :]
    own = np.matmul(root.transpose(0, 2, 1), np.matmul(root, right[:, :, None]))[:, :, 0]
    return Coefficients(own @ turn.T, basis, scaled, turn, root, np.ones(len(values)))


def expanded(real: FloatArray, columns: ComplexArray) -> ComplexArray:
    """(N, L) what real coefficients (N, q) make of columns (L, q)."""
    return real_times(real, columns.T)


def _alike(
    basis: ComplexArray,
    scaled: FloatArray,
    turn: FloatArray,
    values: ComplexArray,
    weights: Weights,
) -> Coefficients:
    """The same where the weights are alike but for a share; gaps count in the coefficients alone,
    not in their covariance.
    """
    assert weights.share is not None
    _check_weight(weights.share)
    masked = values * weights.root
    for row, lines in weights.gaps:
        masked[row, lines] = 0.0
    framed = masked.view(np.float64) @ scaled @ turn
    for row, lines in weights.gaps:
        own = at_lines(scaled, lines) @ turn
        framed[row] += own.T @ (_without(own) @ (own @ framed[row]))
    root = np.eye(turn.shape[1])[None]
    return Coefficients(framed @ turn.T, basis, scaled, turn, root, weights.share)


def _check_weight(size: FloatArray) -> None:
    if not np.all(size > 0):
        raise IdentificationError(
            "a term has no weight on the measured lines of an FRF; leave that FRF out"
        )


def _without(own: FloatArray) -> FloatArray:
    """S⁻¹ of the rows of an orthonormal frame at the gaps of an FRF."""
    return np.asarray(np.linalg.pinv(np.eye(len(own)) - own @ own.T, _NULL, hermitian=True))


def missing_slopes(frame: FloatArray, steep: FloatArray) -> FloatArray:
    """(k, p) F with FᵀF what gaps take of the products of columns less their projection on the
    frame, from the rows (k, …) of both at the gaps.
    """
    return np.asarray(np.linalg.cholesky(_without(frame)).T @ steep)


def at_lines(scaled: FloatArray, lines: IntArray) -> FloatArray:
    """(2k, q) the rows of some lines in weighted columns (2L, q)."""
    return np.asarray(scaled[np.stack([2 * lines, 2 * lines + 1], axis=1).ravel()])


def whitening(scaled: FloatArray) -> FloatArray:
    """(q, r) what makes weighted real columns (2L, q) orthonormal; null directions are left out.

    From their products where these keep the digits, from products twice where these lead near
    (Yamamoto, Nakatsukasa, Yanagisawa and Fukaya 2015), else from the columns themselves.
    """
    if not scaled.shape[1]:
        return np.empty((0, 0))
    products = scaled.T @ scaled
    length = np.sqrt(np.where(np.diag(products) > 0, np.diag(products), 1.0))
    triangle, fault = scipy.linalg.lapack.dpotrf(products / length / length[:, None])
    condition = 0.0 if fault else scipy.linalg.lapack.dtrcon(triangle)[0]
    if condition < _TWICE:
        triangle = np.linalg.qr(scaled / length, mode="r")
        _, singular, right = np.linalg.svd(triangle)
        singular, right = singular[: len(right)], right[: singular.size]
        kept = singular > _NULL * singular.max(initial=0.0)
        return np.asarray((right[kept] / singular[kept, None]).T / length[:, None])
    turn = np.asarray(scipy.linalg.lapack.dtrtri(triangle)[0] / length[:, None])
    return turn if condition >= _WELL_CONDITIONED else turn @ whitening(scaled @ turn)


def stacked(basis: ComplexArray, root: FloatArray) -> FloatArray:
    """(2L, q) real and imaginary parts of columns in turn, weighted by (L,)."""
    rows = np.ascontiguousarray(basis.T).view(np.float64) * np.repeat(root, 2)
    return rows.T


def mean_weight(weight: FloatArray) -> FloatArray:
    """(L,) root of the mean over the FRFs of their weights, each FRF's scaled to mean 1."""
    level = weight.mean(axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.mean(weight / np.where(level > 0, level, 1.0), axis=0)))


def normal_columns(weight: FloatArray, *bases: ComplexArray) -> FloatArray:
    """(N, q, p) the last basis's columns of the normal matrices Re Φᴴ W_i² Φ of all FRFs, Φ all
    bases beside each other.
    """
    q = sum(basis.shape[1] for basis in bases)
    first = q - bases[-1].shape[1]
    # so many lines at a time, and one row of the matrices: their products stay in the cache
    step = max(1, 100_000 // max(q, 1))
    parts = [slice(start, start + step) for start in range(0, weight.shape[1], step)]
    if q > _FOR_ONE * len(weight):
        each: FloatArray = np.zeros((len(weight), q, q - first))
        for part in parts:
            rows = np.concatenate([basis[part].T for basis in bases]).view(np.float64)
            for own, root in zip(each, np.sqrt(weight[:, part]).repeat(2, axis=1), strict=True):
                scaled = rows * root
                own[:first] += scaled[:first] @ scaled[first:].T
                own[first:] += scaled[first:] @ scaled[first:].T
        return each
    normal = np.zeros((q, q - first, len(weight)))
    for part in parts:
        rows = np.concatenate([basis[part].T for basis in bases])
        real, imag, across = rows.real.copy(), rows.imag.copy(), weight[:, part].T.copy()
        for i in range(q):
            start = max(i, first)
            normal[i, start - first :] += (real[start:] * real[i] + imag[start:] * imag[i]) @ across
    for i in range(first, q):
        normal[i:, i - first] = normal[i, i - first :]
    return np.ascontiguousarray(normal.transpose(2, 0, 1))


def real_part(rows: ComplexArray, others: ComplexArray) -> FloatArray:
    """(n, m) Re Y Zᴴ of (n, L) Y and (m, L) Z, as one real product."""
    own, other = (np.ascontiguousarray(each).view(np.float64) for each in (rows, others))
    product: FloatArray = own @ other.T
    return product


def _roots(normal: FloatArray) -> FloatArray:
    """(N, r, r) R with RᵀR the inverse of each matrix on the directions that it determines, 0 on
    the others.
    """
    value, vector = np.linalg.eigh(normal)
    floor = _NULL * value[:, -1:]
    inverse = np.where(value > floor, 1 / np.sqrt(np.where(value > floor, value, 1.0)), 0.0)
    return np.asarray(inverse[:, :, None] * vector.transpose(0, 2, 1))


def spectrum(information: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Scale of the parameters, eigenvalues and vectors of the scaled information, and which
    directions are null.
    """
    diagonal = np.diag(information)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    value, vector = np.linalg.eigh(information / scale[:, None] / scale)
    return scale, value, vector, value < VAGUE


def bounded_step(
    information: FloatArray, gradient: FloatArray, limit: FloatArray, damping: float
) -> tuple[FloatArray, float]:
    """The damped step of most predicted decrease of χ² between -limit and limit, and this decrease,
    from the gradient of -χ²/2.

    The limits are bounds of the quadratic problem. A step cut to them afterwards may lead uphill:
    where one vague parameter is cut, what the others did to make up for it is left.
    """
    scale, value, vector, null = spectrum(information)
    limit = limit * scale
    size = np.where(null, 1.0, value) + damping
    score = vector @ np.where(null, 0.0, vector.T @ (gradient / scale))
    step = _bounded_minimum(
        (vector * size) @ vector.T, vector @ ((vector.T @ score) / size), score, limit
    )
    step /= scale
    return step, float(2 * step @ gradient - step @ information @ step)


def _bounded_minimum(
    matrix: FloatArray, free: FloatArray, score: FloatArray, limit: FloatArray
) -> FloatArray:
    """The x of least ½ xᵀM x - pᵀx between -limit and limit, from its place without these bounds.

    Bounds that hold and their multipliers are found in turn (primal-dual active sets; Hintermüller, Ito and
    Kunisch 2002).
    """
    x, before = free, np.zeros(free.size)
    for _ in range(_TURNS):
        excess = x + score - matrix @ x
        at = np.where(excess > limit, 1.0, np.where(excess < -limit, -1.0, 0.0))
        if np.array_equal(at, before):
            return x
        before, held = at, at != 0
        x = at * limit
        if not held.all():
            left = matrix[np.ix_(~held, ~held)]
            x[~held] = np.linalg.solve(left, (score - matrix @ x)[~held])
    root = np.linalg.cholesky(matrix).T
    return np.asarray(
        scipy.optimize.lsq_linear(
            root, np.linalg.solve(root.T, score), (-limit, limit), method="bvls"
        ).x
    )


def without_drift(
    arrangement: Arrangement, terms: Terms, weight: FloatArray, drift: FloatArray
) -> Arrangement:
    """The FRFs less what a (N,) drift makes of the series, whose residues are found for each drift
    by itself.
    """
    values = arrangement.values.copy()
    unmoved = columns(arrangement.omega, terms, arrangement.power)
    pairs, root = slice(0, 2 * terms.pairs), np.sqrt(weight.mean(axis=0))
    for own in np.unique(drift):
        rows = np.flatnonzero(drift == own)
        moved = columns(
            arrangement.omega,
            terms.drifted(float(own), arrangement.spacing_hz),
            arrangement.power,
        )
        coefficients = _solved(moved, arrangement.values[rows], root)
        values[rows] += coefficients[:, pairs] @ (unmoved - moved)[:, pairs].T
    return replace(arrangement, values=np.where(arrangement.measured, values, 0))


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


def one_minus_leverage(
    arrangement: Arrangement, terms: Terms, linear: Coefficients, weights: Weights
) -> FloatArray:
    """(L,) share of each line that a fit leaves to the errors: 1 less the leverage, in the mean
    over the FRFs and both parts.

    The hat matrix of the coefficients has the diagonal |Q_l|² of the weighted orthonormal frame;
    the poles, which N FRFs share, add an N-th of what the derivatives add to the frame.
    """
    pairs = linear.basis[:, : 2 * terms.pairs]
    more = stacked(derivatives(arrangement.omega, terms, arrangement.power, pairs), weights.root)
    frame = linear.scaled @ linear.turn
    more -= frame @ (frame.T @ more)
    more = more @ whitening(more)
    own, added = (np.sum(part**2, axis=1).reshape(-1, 2).sum(axis=1) for part in (frame, more))
    leverage = (own + added / len(arrangement.pairs)) / 2
    return np.asarray(np.clip(1 - leverage, 0.0, 1.0))


def matching_pursuit(
    arrangement: Arrangement, fit: LinearFit, pool: ComplexArray, room: int, beside: int, tau: float
) -> ComplexArray:
    """The candidates of a pool that pay, at most so many, most gain first, each on top of those before
    it (orthogonal matching pursuit). The FRFs stand for so many more beside them, and the price of
    an unknown is multiplied by tau.

    A pole that is not in the series, all other coefficients fitted anew, lowers χ² by
    rᵀE(EᵀE)⁻¹Eᵀr, E its two columns less their projection on the series: a 2x2 problem.

    1. Products: of the columns of each candidate, less their projection on the series, with each
       other and with the residual; with those of all others once one is taken.
    2. Gains: what each candidate lowers the misfit by, where columns are left of it.
    3. Take: the candidate of the largest gain, while it pays.
    4. Project: its columns leave all products, and what overlaps it leaves the pool.
    """
    pool = pool[~overlapping(pool, fit.terms.poles, _SAME)]
    if not pool.size or room <= 0:
        return pool[:0]
    # 1. Products.
    root, omega, power = np.sqrt(fit.weight.mean(axis=0)), arrangement.omega, arrangement.power
    frame = stacked(fit.linear.frame, root)
    frame = (frame @ whitening(frame)).T
    extra: FloatArray = np.empty((2 * pool.size, 2 * root.size))
    for first in range(0, pool.size, _TOGETHER):
        poles = Terms.at(pool[first : first + _TOGETHER])
        rows = stacked(columns(omega, poles, power), root).T
        size = np.maximum(np.sqrt(np.einsum("kl,kl->k", rows, rows)), np.finfo(float).tiny)
        np.divide(rows, size[:, None], out=extra[2 * first : 2 * first + size.size])
    inside, target = extra @ frame.T, (fit.residual * np.sqrt(fit.weight)).view(np.float64)
    right = (target - (target @ frame.T) @ frame) @ extra.T
    a, d = 1 - np.sum(inside**2, axis=1).reshape(-1, 2).T
    b = np.einsum("kl,kl->k", extra[0::2], extra[1::2]) - np.einsum(
        "kr,kr->k", inside[0::2], inside[1::2]
    )
    gram: FloatArray = np.empty((0, 0))
    price = tau * (fit.pole_price + (PRICE - 1) * 2 * beside)
    # of a candidate's power: what the series leaves below it is round-off, or a pole that it has
    new = np.where(overlapping(pool, fit.terms.poles, BESIDE), 1e-6, 1e-10)
    taken: list[int] = []
    open_ = np.ones(pool.size, dtype=bool)
    while len(taken) < room:
        # 2. Gains.
        one, two, determinant = right[:, 0::2], right[:, 1::2], a * d - b**2
        left = open_ & (a > new) & (d > new) & (determinant > new * a * d)
        total = d * np.sum(one**2, axis=0) + a * np.sum(two**2, axis=0)
        total -= 2 * b * np.sum(one * two, axis=0)
        gain = np.where(left, total / np.where(left, determinant, 1.0), 0.0)
        # 3. Take.
        k = int(np.argmax(gain))
        if gain[k] < price and not fit.terms.pairs and not taken:
            # A first pole that most of the FRFs' own variance is gains no more than that: it pays
            # for the combinations alone.
            price = fit.pole_price
        if gain[k] < price:
            break
        gram = gram if taken else extra @ extra.T - inside @ inside.T
        taken.append(k)
        # 4. Project.
        own = slice(2 * k, 2 * k + 2)
        along = np.linalg.inv(gram[own, own]) @ gram[own]
        right = right - right[:, own] @ along
        gram -= gram[:, own] @ along
        a, b, d = gram.diagonal()[0::2], gram.diagonal(1)[0::2], gram.diagonal()[1::2]
        open_ &= ~overlapping(pool, pool[[k]])
    return pool[taken]


def memory(
    residual: ComplexArray, variance: FloatArray, measured: BoolArray, model: ComplexArray
) -> float:
    """τ, the number of lines that are worth one, from the correlation of the standardised residual;
    at least 1.

    The error is taken relative to the model, for a relative error turns with the phase of a
    resonance, and lines count by their signal to noise: what matters for a mode are the lines where
    it is seen.
    """
    z = np.where(measured, residual / np.sqrt(variance), 0)
    # one line of interference must not hide what the others share
    z = z / np.maximum(1.0, np.abs(z) / _CAP)
    z = z * model.conj() / np.sqrt(variance)
    lines = z.shape[1]
    lags = min(200, lines // 4) + 1
    unit = 1 << max((lines + lags).bit_length() - 4, 0)  # at most 16 of it: small factors alone
    size = -(-(lines + lags) // unit) * unit
    power = np.sum(np.abs(np.fft.fft(z, size, axis=1)) ** 2, axis=0)
    lagged = np.fft.ifft(power).real[:lags]
    if not lagged[0] > 0:
        return 1.0
    rho = lagged[1:] / lagged[0] / (1 - np.arange(1, lagged.size) / lines)
    ends = np.flatnonzero(rho < _STILL)
    return float(1 + 2 * np.sum(rho[: ends[0] if ends.size else rho.size]))


def shared_error(arrangement: Arrangement, fit: LinearFit) -> FloatArray:
    """(n,) the root mean square of e about each pole, less what FRFs leave whose errors do not
    depend on each other.
    """
    terms, shared = fit.terms, np.zeros(fit.terms.pairs)
    basis = fit.linear.basis
    reach = NEAR * np.maximum(terms.half_bandwidth_hz, arrangement.spacing_hz)
    for k in range(terms.pairs):
        near = np.abs(arrangement.frequency_hz - terms.frequency_hz[k]) <= reach[k]
        freedom = 2 * int(near.sum()) - 4  # two values less for the residue, two for the pole
        own = fit.linear.coefficients[:, 2 * k : 2 * k + 2] @ basis[near, 2 * k : 2 * k + 2].T
        weighted = fit.weight[:, near] * own.conj()
        power = np.sum((weighted * own).real, axis=0)
        if freedom <= 0 or not np.all(power > 0):
            continue
        each = weighted * fit.residual[:, near]
        square = float(np.sum(np.abs(each.sum(axis=0)) ** 2 / power))
        usual = (
            float(np.sum(np.abs(each) ** 2 / power))
            * (freedom + 2 * np.sqrt(2 * freedom))
            / (2 * int(near.sum()))
        )
        shared[k] = np.sqrt(max(square - usual, 0.0) / power.sum())
    return shared
