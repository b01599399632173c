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
    mean_weight,
    normal_columns,
    orthonormal,
    real_part,
    solve_normal,
)

# eigenvalue of the scaled information below which a direction is null: a large variance, not
# infinity
_VAGUE = 1e-10
_FEWEST_SESSIONS = 8  # from which their scatter is known well enough
# half bandwidths by which a pole is off over the relative error that all FRFs share (see
# `error_model`)
_SHIFT = 4.0


@dataclass(frozen=True)
class Level:
    """A fit at given poles, without its derivatives: all that a choice between series needs."""

    terms: Terms  # poles and residual terms
    linear: LinearFit  # coefficients of every FRF, with their covariance for fixed poles
    variance: FloatArray  # (N, L) noise variance that weighted the fit
    weight: FloatArray  # (N, L) 2/v of each complex value, 0 where nothing was measured
    residual: ComplexArray  # (N, L) measured minus model
    chi_squared: float  # weighted sum of squared residuals

    @cached_property
    def residues(self) -> ComplexArray:
        """(N, n) residues of the receptance."""
        c = self.linear.coefficients[:, : 2 * self.terms.pairs]
        return np.asarray(c[:, 0::2] + 1j * c[:, 1::2])

    def model(self, arrangement: Arrangement) -> ComplexArray:
        """(N, L) fitted FRFs."""
        return (
            self.linear.coefficients @ columns(arrangement.omega, self.terms, arrangement.power).T
        )


@dataclass(frozen=True, kw_only=True)
class Fit(Level):
    """A model fitted to all FRFs."""

    # twice the number of measured values less the number of unknowns, the expectation of χ²
    freedom: int
    information: FloatArray  # (parameters, parameters) matrix H of (ln ω_1 … ln ω_n, ζ_1 … ζ_n)
    # (N, q, parameters) -∂c/∂θ, by which residues inherit the uncertainty of the poles
    lever: FloatArray
    pull: FloatArray  # (N, parameters) what each FRF adds to the gradient of -χ²/2
    memory: float = 1.0  # number of lines that count as one independent line
    # (N,) number of the test that each FRF belongs to, where the scatter between tests is to count
    sessions: IntArray | None = None
    shared: FloatArray | float = 0.0  # (n,) relative error of each mode's curve that all FRFs share

    @property
    def gradient(self) -> FloatArray:
        """(parameters,) of -χ²/2."""
        return np.asarray(self.pull.sum(axis=0))

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
        own = np.einsum("nii->ni", self.linear.covariance)[:, : 2 * n] * self.inflation
        spread = own + np.einsum("nip,pq,niq->ni", lever, self.parameter_covariance, lever)
        return np.asarray(spread[:, 0::2] + spread[:, 1::2])

    @cached_property
    def parameter_covariance(self) -> FloatArray:
        """Covariance of the non-linear parameters, scaled up where the residual is larger than the
        stated noise.

        A null direction of the information gives its own parameters a large variance and touches no
        other. Where the sessions are known, each standard deviation is at least what the scatter
        between them shows (`widened`). Errors e that all FRFs share are taken to have shifted a
        pole by `_SHIFT` e half bandwidths.
        """
        scale, value, vector, null = spectrum(self.information)
        inverse = (vector[:, ~null] / value[~null]) @ vector[:, ~null].T
        part = np.where(vector.T**2 > 1e-4, vector.T**2, 0.0)  # less is round-off
        inverse[np.diag_indices_from(inverse)] += np.where(null, 1 / _VAGUE, 0.0) @ part
        inverse = inverse / scale[:, None] / scale
        shifts = np.tile((_SHIFT * self.shared * self.terms.damping_ratio) ** 2, 2)
        return np.asarray(
            widened(inverse, self.inflation, self.pull, self.sessions) + np.diag(shifts)
        )


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
    return _with_slopes(arrangement, level_at(arrangement, terms, variance))


def level_at(arrangement: Arrangement, terms: Terms, variance: FloatArray) -> Level:
    """Linear coefficients and residual at given poles.

    Raises:
        IdentificationError: an FRF has no weight on the lines of a term.
    """
    weight = np.where(arrangement.measured, 2 / np.maximum(variance, np.finfo(float).tiny), 0.0)
    basis = columns(arrangement.omega, terms, arrangement.power)
    frame, turn = orthonormal(basis, weight)
    linear = solve_normal(normal_columns(frame, weight), frame, turn, arrangement.values, weight)
    residual = np.where(
        arrangement.measured, arrangement.values - real_times(linear.coefficients, basis.T), 0
    )
    return Level(
        terms=terms,
        variance=variance,
        weight=weight,
        linear=linear,
        residual=residual,
        chi_squared=float(np.sum((weight * residual.conj() * residual).real)),
    )


def spare(arrangement: Arrangement, level: Level) -> FloatArray:
    """(L,) share of each line that a fit leaves to the errors: 1 less the leverage, in the mean
    over the FRFs and both parts.

    The hat matrix of the coefficients has the diagonal |Q_l|² of the weighted orthonormal frame;
    the poles, which N FRFs share, add an N-th of what the derivatives add to the frame.
    """
    basis = columns(arrangement.omega, level.terms, arrangement.power)
    steep = derivatives(arrangement.omega, level.terms, arrangement.power)
    both, _ = orthonormal(np.concatenate([basis, steep], axis=1), level.weight)
    own, all_ = (np.sum(np.abs(frame) ** 2, axis=1) for frame in (level.linear.frame, both))
    leverage = mean_weight(level.weight) ** 2 * (own + (all_ - own) / len(level.residual)) / 2
    return np.asarray(np.clip(1 - leverage, 0.0, 1.0))


def _with_slopes(arrangement: Arrangement, level: Level) -> Fit:
    """The same fit with its Gauss-Newton matrices.

    The derivative columns are taken less their projection on the frame, which leaves H as it is and
    spares it the cancellation.
    """
    terms, linear, frame, weight = level.terms, level.linear, level.linear.frame, level.weight
    steep = derivatives(arrangement.omega, terms, arrangement.power)
    mean = mean_weight(weight)[:, None] ** 2
    inside = real_part(frame.T, (mean * steep).T)
    steep = steep - real_times(inside.T, frame.T).T
    r = frame.shape[1]
    gram = normal_columns(np.concatenate([frame, steep], axis=1), weight, r)
    turn = _slope_combinations(terms, level.residues)
    seen = np.matmul(linear.root, np.matmul(gram[:, :r], turn))
    whole = np.matmul(turn.transpose(0, 2, 1), np.matmul(gram[:, r:], turn))
    information = (whole - np.matmul(seen.transpose(0, 2, 1), seen)).sum(axis=0)
    lever = np.matmul(
        linear.turn, np.matmul(linear.root.transpose(0, 2, 1), seen) + np.matmul(inside, turn)
    )
    pull = np.einsum("nij,ni->nj", turn, real_part(weight * level.residual, steep.T))
    return Fit(
        **{each.name: getattr(level, each.name) for each in fields(Level)},
        freedom=2 * int(arrangement.measured.sum())
        - terms.parameters
        - len(level.residual) * terms.columns,
        information=information,
        lever=lever,
        pull=pull,
    )


def refine(
    arrangement: Arrangement,
    terms: Terms,
    variance: FloatArray,
    steps: int = 40,
    enough: float = 1e-3,
) -> Fit:
    """Poles of least χ² for a given noise variance, from the given start; a step that would gain
    less than `enough` ends it.

    A decrease of χ² by 1e-3 is a move of a thirtieth of a standard deviation.

    Raises:
        IdentificationError: a term has no weight.
    """
    fit = evaluate(arrangement, terms, variance)
    damping = 1e-4
    for _ in range(steps):
        step, predicted = _step(fit, damping)
        if predicted < enough:
            break
        try:
            trial = level_at(arrangement, moved(fit.terms, step), variance)
        except IdentificationError:  # a term has no weight there: a shorter step
            trial = fit
        if trial.chi_squared < fit.chi_squared:
            gain = fit.chi_squared - trial.chi_squared
            damping = max(damping / (10 if gain > 0.7 * predicted else 2), 1e-10)
            fit = _with_slopes(arrangement, trial)
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
    zeta = fit.terms.damping_ratio
    limit = np.concatenate([np.maximum(zeta, 1e-3), np.maximum(0.7 * zeta, 1e-4)]) * scale
    root = np.sqrt(np.where(null, 1.0, value) + damping)
    along = np.where(null, 0.0, vector.T @ (fit.gradient / scale)) / root
    step = (
        scipy.optimize.lsq_linear(root[:, None] * vector.T, along, (-limit, limit), method="bvls").x
        / scale
    )
    return step, float(2 * step @ fit.gradient - step @ fit.information @ step)


def _slope_combinations(terms: Terms, residues: ComplexArray) -> FloatArray:
    """(N, 2n, 2n) how each FRF's Jacobian is made of the derivative columns."""
    n = terms.pairs
    turn = np.zeros((len(residues), 2 * n, 2 * n))
    for place, slope in enumerate(slopes(terms)):
        pull = residues * slope
        for k in range(n):
            turn[:, 2 * k, place * n + k], turn[:, 2 * k + 1, place * n + k] = (
                pull[:, k].real,
                pull[:, k].imag,
            )
    return turn
