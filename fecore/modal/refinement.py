"""Non-linear stage: noise-weighted output-error fit of poles, residues and residual terms.

Minimises χ²(θ, c) = Σ_il w_il |H_il - Φ(θ)_l c_i|², w = 2/v, over the poles θ = (ln ω_k, ζ_k),
common to all FRFs, and the linear coefficients c_i of each FRF. With Gaussian noise of variance v
that is the maximum likelihood estimate. The c_i are eliminated (variable projection, Golub and
Pereyra 1973, with Kaufman's Jacobian): per FRF, J_i = ∂(Φ c_i)/∂θ with c_i held, and

    H = Σ_i J_iᵀJ_i - J_iᵀΦ (ΦᵀΦ)⁻¹ ΦᵀJ_i,    g = Σ_i J_iᵀ r_i        (weighted inner products),

the Gauss-Newton step is H⁻¹g, damped as by Levenberg and Marquardt. At the optimum H⁻¹ is the
covariance of θ. All inner products of all FRFs come from one matrix product over the lines, since
every J_i is a combination of the same 2n derivative columns.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray, real_times
from fecore.errors import IdentificationError
from fecore.modal.arrangement import Arrangement
from fecore.modal.basis import DAMPING_RANGE, Terms, columns, derivatives, slopes
from fecore.modal.linear import (
    LinearFit,
    Weights,
    missing_slopes,
    normal_columns,
    orthonormal,
    real_part,
    solved,
    stacked,
)

# eigenvalue of the scaled information below which a direction is null: a large variance, not
# infinity
_VAGUE = 1e-10
_FEWEST_SESSIONS = 8  # from which their scatter is known well enough
# half bandwidths by which a pole is off over the relative error that all FRFs share (see
# `error_model`)
_SHIFT = 4.0
_TURNS = 30  # in which the bounds of a step are found


@dataclass(frozen=True)
class Level:
    """A fit at given poles, without its derivatives: all that a choice between series needs."""

    terms: Terms  # poles and residual terms
    linear: LinearFit  # coefficients of every FRF, with their covariance for fixed poles
    variance: FloatArray  # (N, L) noise variance that weighted the fit
    weights: Weights  # what each value counts
    residual: ComplexArray  # (N, L) measured minus model
    chi_squared: float  # weighted sum of squared residuals
    # (N, L) what stands fixed beside the terms, taken from the FRFs before they are fitted
    background: ComplexArray | float = 0.0

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
    def model(self) -> ComplexArray:
        """(N, L) fitted FRFs."""
        return np.asarray(self.background + self.part(np.arange(self.terms.columns)))

    def part(self, which: IntArray) -> ComplexArray:
        """(N, L) what some of the terms' columns make of the FRFs."""
        return real_times(self.linear.coefficients[:, which], self.linear.basis[:, which].T)


@dataclass(frozen=True, kw_only=True)
class Fit(Level):
    """A model fitted to all FRFs."""

    # twice the number of measured values less the number of unknowns, the expectation of χ²
    freedom: int
    information: FloatArray  # (parameters, parameters) matrix H of (ln ω_1 … ln ω_n, ζ_1 … ζ_n)
    # (N, q, 2m), or (1, q, 2m), coefficients of the basis in the derivative columns
    inside: FloatArray
    free: IntArray  # (m,) numbers of the poles that are refined, whose f and ζ are the parameters
    pull: FloatArray  # (N, parameters) what each FRF adds to the gradient of -χ²/2
    memory: float = 1.0  # number of lines that count as one independent line
    # (N,) number of the test that each FRF belongs to, where the scatter between tests is to count
    sessions: IntArray | None = None
    shared: FloatArray | float = 0.0  # (n,) relative error of each mode's curve that all FRFs share
    # (parameters,) change of ln ω and ζ where the values are weighted in another way
    change: FloatArray | float = 0.0

    @property
    def gradient(self) -> FloatArray:
        """(parameters,) of -χ²/2."""
        return np.asarray(self.pull.sum(axis=0))

    @property
    def lever(self) -> FloatArray:
        """(N, q, parameters) -∂c/∂θ, by which residues inherit the uncertainty of the poles."""
        turn, n = _slope_parts(self.terms, self.residues, self.free), self.free.size
        inside = self.inside.reshape(*self.inside.shape[:2], n, 2)
        return np.asarray(
            np.einsum("nqka,npka->nqpk", inside, turn).reshape(
                len(turn), self.inside.shape[1], 2 * n
            )
        )

    @property
    def inflation(self) -> float:
        """Factor of all variances: the residual's size over the stated noise, and the lines that
        are worth one.
        """
        return max(1.0, self.chi_squared / self.freedom) * self.memory

    @cached_property
    def residue_variance(self) -> FloatArray:
        """(N, n) E|error|² of the residues, the uncertainty of the poles included.

        With c = A⁻¹(Φᵀy) and poles that err by e, δc = -A⁻¹ΦᵀJ e: Cov(c) = A⁻¹ + A⁻¹B Cov(θ) BᵀA⁻¹,
        B = ΦᵀJ.
        """
        n = self.terms.pairs
        lever = self.lever[:, : 2 * n]
        own = self.linear.variance[:, : 2 * n] * self.inflation
        spread = own + np.sum(np.matmul(lever, self.parameter_covariance) * lever, axis=2)
        return np.asarray(spread[:, 0::2] + spread[:, 1::2])

    @cached_property
    def parameter_covariance(self) -> FloatArray:
        """Covariance of the non-linear parameters, scaled up where the residual is larger than the
        stated noise.

        A null direction of the information gives its own parameters a large variance and touches no
        other. Where the sessions are known, each standard deviation is at least what the scatter
        between them shows (`widened`). Errors e that all FRFs share are taken to have shifted a
        pole by `_SHIFT` e half bandwidths. Then each is at least the change under other weights:
        where the series is the whole truth, both fits estimate the same poles, and differ by what
        noise does to them (Hausman 1978).
        """
        scale, value, vector, null = spectrum(self.information)
        inverse = (vector[:, ~null] / value[~null]) @ vector[:, ~null].T
        part = np.where(vector.T**2 > 1e-4, vector.T**2, 0.0)  # less is round-off
        inverse[np.diag_indices_from(inverse)] += np.where(null, 1 / _VAGUE, 0.0) @ part
        inverse = inverse / scale[:, None] / scale
        shifts = np.tile((_SHIFT * self.shared * self.terms.damping_ratio) ** 2, 2)
        spread = widened(inverse, self.inflation, self.pull, self.sessions) + np.diag(shifts)
        lacking = np.maximum(np.square(self.change) - np.diag(spread), 0.0)
        return np.asarray(spread + np.diag(lacking))


def gains(c: FloatArray, spread: FloatArray, share: FloatArray, pairs: int) -> FloatArray:
    """(n,) the gains of poles by their coefficients (N, q), see `Level.gains` and `LinearFit`."""
    one, two = c[:, 0 : 2 * pairs : 2], c[:, 1 : 2 * pairs : 2]
    at = 2 * np.arange(pairs)
    a, b, d = spread[:, at, at], spread[:, at, at + 1], spread[:, at + 1, at + 1]
    determinant = np.maximum(a * d - b**2, 1e-12 * a * d + np.finfo(float).tiny)
    return np.asarray(share @ ((d * one**2 - 2 * b * one * two + a * two**2) / determinant))


def widened(
    inverse: FloatArray, inflation: float, pull: FloatArray, sessions: IntArray | None
) -> FloatArray:
    """The covariance H⁻¹ times the inflation, each standard deviation at least what the scatter
    between sessions shows:

    H⁻¹ (Σ_s g_s g_sᵀ) H⁻¹ · S/(S - 1), g_s the sessions' own gradients about the optimum (White
    1980, for clusters Liang and Zeger 1986). It asks nothing of the errors within a session, so it
    holds where these last over lines, channels or modes. Of S sessions it is known to 1 ± 1/√(2(S -
    1)).
    """
    grow = np.sqrt(inflation) * np.ones(len(inverse))
    if sessions is not None and (count := int(sessions.max()) + 1) >= _FEWEST_SESSIONS:
        sums = np.zeros((count, pull.shape[1]))
        np.add.at(sums, sessions, pull)
        between = np.sqrt(np.sum((sums @ inverse) ** 2, axis=0) * count / (count - 1))
        usual = np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
        grow = np.maximum(grow, between / usual / (1 + 1 / np.sqrt(2 * count - 2)))
    return np.asarray(inverse * np.outer(grow, grow))


def spectrum(information: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Scale of the parameters, eigenvalues and vectors of the scaled information, and which
    directions are null.
    """
    diagonal = np.diag(information)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    value, vector = np.linalg.eigh(information / scale[:, None] / scale)
    return scale, value, vector, value < _VAGUE


def evaluate(arrangement: Arrangement, terms: Terms, variance: FloatArray) -> Fit:
    """Linear coefficients, residual and Gauss-Newton matrices at given poles.

    Raises:
        IdentificationError: an FRF has no weight on the lines of a term.
    """
    level = level_at(arrangement, terms, variance)
    return _with_slopes(arrangement, level, np.arange(terms.pairs))


def level_at(
    arrangement: Arrangement,
    terms: Terms,
    variance: FloatArray,
    weights: Weights | None = None,
    background: ComplexArray | float = 0.0,
) -> Level:
    """Linear coefficients and residual at given poles.

    Args:
        arrangement: the FRFs.
        terms: poles and residual terms.
        variance: (N, L) of the FRFs' noise.
        weights: those of the variance, where they are known.
        background: (N, L) what stands fixed beside the terms.

    Raises:
        IdentificationError: an FRF has no weight on the lines of a term.
    """
    weights = weights or Weights.of(variance, arrangement.measured)
    basis = columns(arrangement.omega, terms, arrangement.power)
    values = arrangement.values - background
    linear = solved(basis, values, weights)
    residual = values - real_times(linear.coefficients, basis.T)
    residual[~arrangement.measured] = 0
    square = residual.real**2 + residual.imag**2
    return Level(
        terms=terms,
        variance=variance,
        weights=weights,
        linear=linear,
        residual=residual,
        chi_squared=float(np.vdot(weights.each, square)),
        background=background,
    )


def spare(arrangement: Arrangement, level: Level) -> FloatArray:
    """(L,) share of each line that a fit leaves to the errors: 1 less the leverage, in the mean
    over the FRFs and both parts.

    The hat matrix of the coefficients has the diagonal |Q_l|² of the weighted orthonormal frame;
    the poles, which N FRFs share, add an N-th of what the derivatives add to the frame.
    """
    basis = columns(arrangement.omega, level.terms, arrangement.power)
    steep = derivatives(arrangement.omega, level.terms, arrangement.power)
    root = level.weights.root
    both, _ = orthonormal(np.concatenate([basis, steep], axis=1), root)
    own, all_ = (np.sum(np.abs(frame) ** 2, axis=1) for frame in (level.linear.frame, both))
    leverage = root**2 * (own + (all_ - own) / len(level.residual)) / 2
    return np.asarray(np.clip(1 - leverage, 0.0, 1.0))


def _with_slopes(arrangement: Arrangement, level: Level, free: IntArray) -> Fit:
    """The same fit with its Gauss-Newton matrices.

    The derivative columns are taken less their projection on the frame, which leaves H as it is and
    spares it the cancellation.
    """
    terms, linear, weights = level.terms, level.linear, level.weights
    steep = derivatives(arrangement.omega, terms.some(free), arrangement.power)
    onto = linear.turn.T @ real_part(linear.basis.T, (weights.root[:, None] ** 2 * steep).T)
    steep = steep - real_times((linear.turn @ onto).T, linear.basis.T).T
    turn = _slope_parts(terms, level.residues, free)
    n, inside = free.size, onto[None]
    if weights.share is None:
        r = len(onto)
        gram = normal_columns(np.concatenate([linear.frame, steep], axis=1), weights.each, r)
        seen = np.matmul(linear.root, gram[:, :r])
        products = gram[:, r:] - np.matmul(seen.transpose(0, 2, 1), seen)
        inside = inside + np.matmul(linear.root.transpose(0, 2, 1), seen)
        half = np.einsum("nkalb,nqlb->nkaql", products.reshape(len(turn), n, 2, n, 2), turn)
        information = np.einsum("npka,nkaql->pkql", turn, half)
    else:
        flat = turn.reshape(len(turn), -1)
        pairs = (flat.T @ (weights.share[:, None] * flat)).reshape(2, n, 2, 2, n, 2)
        own = stacked(steep, weights.root)
        products = (own.T @ own).reshape(n, 2, n, 2)
        information = np.einsum("pkaqlb,kalb->pkql", pairs, products)
        for row, lines in weights.gaps:
            lost = missing_slopes(linear.frame, steep, weights.root, lines).reshape(
                2 * lines.size, n, 2
            )
            lost = np.einsum("gka,pka->gpk", lost, turn[row])
            information -= weights.share[row] * np.einsum("gpk,gql->pkql", lost, lost)
    pull = real_part(weights.each * level.residual, steep.T).reshape(len(turn), n, 2)
    return Fit(
        **{each.name: getattr(level, each.name) for each in fields(Level)},
        freedom=2 * int(arrangement.measured.sum()) - 2 * n - len(level.residual) * terms.columns,
        information=information.reshape(2 * n, 2 * n),
        inside=np.matmul(linear.turn, inside),
        free=free,
        pull=np.einsum("npka,nka->npk", turn, pull).reshape(len(turn), 2 * n),
    )


def refine(
    arrangement: Arrangement,
    terms: Terms,
    variance: FloatArray,
    steps: int = 40,
    enough: float = 1e-3,
    background: ComplexArray | float = 0.0,
    free: IntArray | None = None,
) -> Fit:
    """Poles of least χ² for a given noise variance and background, from the given start; a step that
    would gain less than `enough` ends it. The poles numbered `free` move, all of them where it is
    None.

    A decrease of χ² by 1e-3 is a move of a thirtieth of a standard deviation.

    Raises:
        IdentificationError: a term has no weight.
    """
    free = np.arange(terms.pairs) if free is None else free
    both = np.concatenate([free, terms.pairs + free])
    start = level_at(arrangement, terms, variance, None, background)
    fit = _with_slopes(arrangement, start, free)
    damping = 1e-4
    for _ in range(steps):
        own, predicted = _step(fit, damping)
        if predicted < enough:
            break
        step = np.zeros(terms.parameters)
        step[both] = own
        try:
            trial = level_at(arrangement, moved(fit.terms, step), variance, fit.weights, background)
        except IdentificationError:  # a term has no weight there: a shorter step
            trial = fit
        if trial.chi_squared < fit.chi_squared:
            gain = fit.chi_squared - trial.chi_squared
            damping = max(damping / (10 if gain > 0.7 * predicted else 2), 1e-10)
            fit = _with_slopes(arrangement, trial, free)
        else:
            damping = max(damping, 1e-6) * 10
            if damping > 1e8:
                break
    return fit


def moved(terms: Terms, step: FloatArray) -> Terms:
    """Terms after a step in (ln ω, ζ); damping stays within its physical range."""
    n = terms.pairs
    return replace(
        terms,
        frequency_hz=terms.frequency_hz * np.exp(step[:n]),
        damping_ratio=np.clip(terms.damping_ratio + step[n:], *DAMPING_RANGE),
    )


def _step(fit: Fit, damping: float) -> tuple[FloatArray, float]:
    """The damped step of most predicted decrease of χ² that moves no pole by more than its width,
    and this decrease.

    The limits are bounds of the quadratic problem. A step cut to them afterwards may lead uphill:
    where one vague parameter is cut, what the others did to make up for it is left.
    """
    scale, value, vector, null = spectrum(fit.information)
    zeta = fit.terms.damping_ratio[fit.free]
    limit = np.concatenate([np.maximum(zeta, 1e-3), np.maximum(0.7 * zeta, 1e-4)]) * scale
    size = np.where(null, 1.0, value) + damping
    pull = vector @ np.where(null, 0.0, vector.T @ (fit.gradient / scale))
    step = _within((vector * size) @ vector.T, vector @ ((vector.T @ pull) / size), pull, limit)
    step /= scale
    return step, float(2 * step @ fit.gradient - step @ fit.information @ step)


def _within(
    matrix: FloatArray, free: FloatArray, pull: FloatArray, limit: FloatArray
) -> FloatArray:
    """The x of least ½ xᵀM x - pᵀx between -limit and limit, from its place without these bounds.

    Bounds that hold and that pull are found in turn (primal-dual active sets; Hintermüller, Ito and
    Kunisch 2002).
    """
    x, before = free, np.zeros(free.size)
    for _ in range(_TURNS):
        excess = x + pull - matrix @ x
        at = np.where(excess > limit, 1.0, np.where(excess < -limit, -1.0, 0.0))
        if np.array_equal(at, before):
            return x
        before, held = at, at != 0
        x = at * limit
        if not held.all():
            left = matrix[np.ix_(~held, ~held)]
            x[~held] = np.linalg.solve(left, (pull - matrix @ x)[~held])
    root = np.linalg.cholesky(matrix).T
    return np.asarray(
        scipy.optimize.lsq_linear(
            root, np.linalg.solve(root.T, pull), (-limit, limit), method="bvls"
        ).x
    )


def _slope_parts(terms: Terms, residues: ComplexArray, free: IntArray) -> FloatArray:
    """(N, 2, m, 2) of how much of its two derivative columns the derivative of each FRF by ln ω_k,
    and by ζ_k, is made.
    """
    pull = residues[:, None, free] * np.stack(slopes(terms.some(free)))
    return np.stack([pull.real, pull.imag], axis=3)
