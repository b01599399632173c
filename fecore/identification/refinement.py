"""Non-linear stage: noise-weighted output-error fit of poles, residues and residual terms.

Minimises χ²(θ, c) = Σ_il w_il |H_il - Φ(θ)_l c_i|², w = 2/v, over the poles θ = (ln ω_k, ζ_k; ln a_j), common to all
FRFs, and the linear coefficients c_i of each FRF. With Gaussian noise of variance v that is the maximum likelihood
estimate. The c_i are eliminated (variable projection, Golub and Pereyra 1973, with Kaufman's Jacobian): per FRF, J_i
= ∂(Φ c_i)/∂θ with c_i held, and

    H = Σ_i J_iᵀJ_i - J_iᵀΦ (ΦᵀΦ)⁻¹ ΦᵀJ_i,    g = Σ_i J_iᵀ r_i        (weighted inner products),

the Gauss-Newton step is H⁻¹g, damped as by Levenberg and Marquardt. At the optimum H⁻¹ is the covariance of θ. All
inner products of all FRFs come from one matrix product over the lines, since every J_i is a combination of the same
2n derivative columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import IdentificationError
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import Terms, columns, derivatives, slopes
from fecore.identification.linear import LinearFit, normal_matrices, solve_normal
from fecore.identification.noise import residual_variance
from fecore.identification.residues import known_or, weights

_ENOUGH = 1e-3  # a predicted decrease of χ² below this is a move of a thirtieth of a standard deviation
_STALLED = 0.01  # two steps in a row that gain less than this have found the floor of a flat valley
_VAGUE = 1e-10  # smallest eigenvalue of the scaled information: a vaguer one gives a large variance, not infinity
_HELD = 1e60  # information on a parameter that is held: its variance is nothing
_STEPS = 40
_RIDGE = 1e-12  # on columns of unit length: far above the round-off of their products, far below what matters
_DAMPING_RANGE = (1e-5, 0.95)


@dataclass(frozen=True)
class Fit:
    """A model fitted to all FRFs.

    Attributes:
        terms: poles and residual terms.
        linear: coefficients of every FRF, with their covariance for fixed poles.
        variance: (N, L) noise variance that weighted the fit.
        residual: (N, L) measured minus model.
        chi_squared: weighted sum of squared residuals; its expectation is `freedom`.
        freedom: twice the number of measured values less the number of unknowns.
        information: (parameters, parameters) matrix H of (ln ω_1 … ln ω_n, ζ_1 … ζ_n, ln a …).
        cross: (N, q, parameters) products ΦᵀJ, from which residues inherit the uncertainty of the poles.
    """

    terms: Terms
    linear: LinearFit
    variance: FloatArray
    residual: ComplexArray
    chi_squared: float
    freedom: int
    information: FloatArray
    cross: FloatArray
    gradient: FloatArray

    @property
    def unknowns(self) -> int:
        """Number of all unknowns, linear and non-linear."""
        return self.terms.parameters + int(self.linear.coefficients.size)

    def misfit(self, measured: np.ndarray) -> float:
        """Minus twice the log likelihood, less a constant: Σ 2 ln v + χ²."""
        return float(np.sum(2 * np.log(self.variance[measured]))) + self.chi_squared

    def model(self, arrangement: Arrangement) -> ComplexArray:
        """(N, L) fitted FRFs."""
        return self.linear.coefficients @ columns(arrangement.omega, self.terms, arrangement.power).T

    def residues(self) -> tuple[ComplexArray, FloatArray]:
        """(N, n) receptance residues and their variance E|error|², the uncertainty of the poles included.

        With c = A⁻¹(Φᵀy) and poles that err by e, δc = -A⁻¹ΦᵀJ e: Cov(c) = A⁻¹ + A⁻¹B Cov(θ) BᵀA⁻¹, B = ΦᵀJ.
        """
        n = self.terms.pairs
        lever = np.matmul(self.linear.covariance, self.cross)[:, : 2 * n]
        own = np.einsum("nii->ni", self.linear.covariance)[:, : 2 * n] * max(1.0, self.chi_squared / self.freedom)
        spread = own + np.einsum("nip,pq,niq->ni", lever, self.parameter_covariance, lever)
        c = self.linear.coefficients[:, : 2 * n]
        return c[:, 0::2] + 1j * c[:, 1::2], spread[:, 0::2] + spread[:, 1::2]

    @cached_property
    def parameter_covariance(self) -> FloatArray:
        """Covariance of the non-linear parameters, scaled up where the residual is larger than the stated noise."""
        scale = np.sqrt(np.maximum(np.diag(self.information), 1e-200))
        value, vector = np.linalg.eigh(self.information / scale[:, None] / scale)
        inverse = (vector / np.maximum(value, _VAGUE)) @ vector.T
        return np.asarray(inverse / scale[:, None] / scale * max(1.0, self.chi_squared / self.freedom))


def settled(arrangement: Arrangement, terms: Terms, variance: FloatArray) -> Fit:
    """`evaluate`, also where these weights leave terms that can hardly be told apart: so they can be pruned."""
    try:
        return evaluate(arrangement, terms, variance)
    except IdentificationError:
        return evaluate(arrangement, terms, variance, _RIDGE)


def evaluate(arrangement: Arrangement, terms: Terms, variance: FloatArray, ridge: float = 0.0) -> Fit:
    """Linear coefficients, residual and Gauss-Newton matrices at given poles.

    Raises:
        IdentificationError: terms that cannot be told apart.
    """
    weight = weights(arrangement, variance)
    basis = columns(arrangement.omega, terms, arrangement.power)
    steep = derivatives(arrangement.omega, terms, arrangement.power)
    gram = normal_matrices(np.concatenate([basis, steep], axis=1), weight)
    q = terms.columns
    linear = solve_normal(gram[:, :q, :q], basis, arrangement.values, weight, ridge)
    residual = np.where(arrangement.measured, arrangement.values - linear.coefficients @ basis.T, 0)
    pulled = weight * residual
    turn = _slope_combinations(terms, linear.coefficients)
    cross = np.matmul(gram[:, :q, q:], turn)
    whole = np.matmul(turn.transpose(0, 2, 1), np.matmul(gram[:, q:, q:], turn))
    seen = np.matmul(linear.root, cross)
    information = (whole - np.matmul(seen.transpose(0, 2, 1), seen)).sum(axis=0)
    gradient = np.einsum("nij,ni->j", turn, (pulled @ steep.conj()).real)
    still = np.concatenate([terms.held, terms.held, np.zeros(terms.decay.size, dtype=bool)])
    information[still, :] = information[:, still] = 0.0
    information[still, still] = _HELD
    gradient[still], cross[:, :, still] = 0.0, 0.0
    return Fit(
        terms,
        linear,
        variance,
        residual,
        float(np.sum((pulled.conj() * residual).real)),
        2 * int(arrangement.measured.sum()) - terms.parameters - len(residual) * q,
        information,
        cross,
        gradient,
    )


def refine(arrangement: Arrangement, terms: Terms, variance: FloatArray, steps: int = _STEPS) -> Fit:
    """Poles of least χ² for a given noise variance, from the given start.

    Raises:
        IdentificationError: a term has no weight.
    """
    fit = settled(arrangement, terms, variance)
    damping, small = 1e-4, 0
    for _ in range(steps):
        step, predicted = _step(fit, damping)
        if predicted < _ENOUGH:
            break
        trial = _try(arrangement, moved(fit.terms, step), variance)
        if trial is not None and trial.chi_squared < fit.chi_squared:
            gain = fit.chi_squared - trial.chi_squared
            damping = max(damping / (10 if gain > 0.7 * predicted else 2), 1e-10)
            small = small + 1 if gain < _STALLED else 0
            fit = trial
            if small == 2:
                break
        else:
            damping = max(damping, 1e-6) * 10
            if damping > 1e8:
                break
    return fit


def refine_with_noise(arrangement: Arrangement, terms: Terms, variance: FloatArray, passes: int = 3) -> Fit:
    """Poles with the noise variance estimated from the fit's own residual, alternating until the poles rest.

    Raises:
        IdentificationError: a term has no weight.
    """
    fit = refine(arrangement, terms, variance)
    for _ in range(passes):
        before = fit
        fit = refine(arrangement, fit.terms, noise_of(arrangement, fit))
        if _distance(before, fit) < 0.02:
            break
    return settled(arrangement, fit.terms, noise_of(arrangement, fit))


def noise_of(arrangement: Arrangement, fit: Fit) -> FloatArray:
    """(N, L) noise variance: as handed in where known, else from the residual of the fit."""
    model = arrangement.values - fit.residual
    share = fit.terms.columns + fit.terms.parameters / len(arrangement.pairs)
    return known_or(arrangement, residual_variance(fit.residual, model, arrangement.measured, share))


def moved(terms: Terms, step: FloatArray) -> Terms:
    """Terms after a step in (ln ω, ζ, ln a); damping stays within its physical range."""
    n = terms.pairs
    return replace(
        terms,
        frequency_hz=terms.frequency_hz * np.exp(step[:n]),
        damping_ratio=np.clip(terms.damping_ratio + step[n : 2 * n], *_DAMPING_RANGE),
        decay=terms.decay * np.exp(step[2 * n :]),
    )


def _step(fit: Fit, damping: float) -> tuple[FloatArray, float]:
    """Damped step, limited to the width of each pole, and the decrease of χ² that the quadratic model predicts."""
    scale = np.maximum(np.diag(fit.information), 1e-300)
    step = np.linalg.solve(fit.information + damping * np.diag(scale) + 1e-14 * np.diag(scale), fit.gradient)
    zeta = fit.terms.damping_ratio
    limit = np.concatenate([np.maximum(zeta, 1e-3), np.maximum(0.7 * zeta, 1e-4), np.full(fit.terms.decay.size, 1.0)])
    step = np.clip(step, -limit, limit)  # each by itself: one vague parameter must not hold back the others
    return step, float(2 * step @ fit.gradient - step @ fit.information @ step)


def _try(arrangement: Arrangement, terms: Terms, variance: FloatArray) -> Fit | None:
    try:
        return evaluate(arrangement, terms, variance)
    except IdentificationError:
        return None


def _distance(before: Fit, after: Fit) -> float:
    """Largest move of a parameter in its standard deviations."""
    sd = np.sqrt(np.maximum(np.diag(after.parameter_covariance), 1e-300))
    n = before.terms.pairs
    move = np.concatenate(
        [
            np.log(after.terms.frequency_hz / before.terms.frequency_hz),
            after.terms.damping_ratio - before.terms.damping_ratio,
            np.log(after.terms.decay / before.terms.decay),
        ]
    )
    return float(np.max(np.abs(move) / sd, initial=0.0)) if n or move.size else 0.0


def _slope_combinations(terms: Terms, coefficients: FloatArray) -> FloatArray:
    """(N, 2n + r, parameters) how each FRF's Jacobian is made of the derivative columns."""
    n, r = terms.pairs, terms.decay.size
    turn = np.zeros((coefficients.shape[0], 2 * n + r, terms.parameters))
    residues = coefficients[:, 0 : 2 * n : 2] + 1j * coefficients[:, 1 : 2 * n : 2]
    for place, slope in enumerate(slopes(terms)):
        pull = residues * slope
        for k in range(n):
            turn[:, 2 * k, place * n + k], turn[:, 2 * k + 1, place * n + k] = pull[:, k].real, pull[:, k].imag
    for j in range(r):
        turn[:, 2 * n + j, 2 * n + j] = coefficients[:, terms.columns - r + j]
    return turn
