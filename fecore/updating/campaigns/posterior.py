"""The posterior of several campaigns, Gaussian for a given discrepancy s and scatter τ, which both are marginalised.

With the stacked residuals r = ln f_measured - ln f of all campaigns, their derivative S by the unknowns x, the noise N and the
prior precision P(τ) (which holds coupons and shapes too), as in `fecore.updating.posterior`,

    H = SᵀW_sS + P(τ),    W_s = (N + s²)⁻¹,    log p(s, τ | f) = log p(s) + log p(τ)
                                                + ½ (log|W_s| + log|P₀(τ)| - log|H| - rᵀW_sr - x̂ᵀP₀x̂ + gᵀH⁻¹g) + const.

s has the prior of a single update. τ, the relative deviation of one specimen's modulus from the material's, has a scaled
inverse χ² of two degrees of freedom about its scale (Gelman et al., Bayesian Data Analysis, 3rd ed., 5 and 11.6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.updating.posterior import DISCREPANCY, DISCREPANCY_DOF, Mixture

SCATTER = 0.02
"""Prior scale of the scatter τ of a modulus between specimens: what coupons of one panel show."""

_DISCREPANCIES = DISCREPANCY * np.exp(np.linspace(np.log(0.1), np.log(30.0), 41))
_SCATTERS = np.exp(np.linspace(np.log(0.1), np.log(8.0), 9))  # over the scale


@dataclass(frozen=True)
class LinearProblem:
    """The problem at an estimate, linear in the step from it.

    Attributes:
        residual: (n,) ln f_measured - ln f.
        noise: (n, n) covariance of ln f_measured.
        sensitivity: (n, X) derivative of ln f by x.
        x: (X,) the estimate; the prior's mean is 0.
        sd: prior standard deviations (X,) for a scatter.
        other_hessian, other_descent: (X, X) and (X,) of what is no frequency: coupons, shapes.
    """

    residual: FloatArray
    noise: FloatArray
    sensitivity: FloatArray
    x: FloatArray
    sd: Callable[[float], FloatArray]
    other_hessian: FloatArray
    other_descent: FloatArray

    def solve(self, spread: float, scatter: float) -> tuple[FloatArray, FloatArray, float]:
        """(X,) step and (X, X) covariance at a discrepancy and a scatter, and the logarithm of the evidence."""
        step, covariance, evidence = self._solve_all(np.array([spread]), np.array([scatter]))
        return step[0, 0], covariance[0, 0], float(evidence[0, 0])

    def informed(self, spread: float, scatter: float) -> float:
        """How many unknowns the frequencies determine at a discrepancy and a scatter: tr(H⁻¹SᵀW_sS)."""
        _, covariance, _ = self.solve(spread, scatter)
        variance = self.noise + spread**2 * np.eye(self.residual.size)
        return float(np.trace(covariance @ self.sensitivity.T @ np.linalg.solve(variance, self.sensitivity)))

    def _solve_all(self, spreads: FloatArray, scatters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(t, s, X) steps, (t, s, X, X) covariances and (t, s) evidence at every pair of t scatters and s discrepancies."""
        data = [self._of_data(float(spread)) for spread in spreads]
        own, pull, misfit = (np.array(part) for part in zip(*data, strict=True))
        precision = np.array([self.sd(float(scatter)) for scatter in scatters]) ** -2
        hessian = own + precision[:, None, :, None] * np.eye(self.x.size)
        descent = pull - (precision * self.x)[:, None]
        covariance = np.linalg.inv(hessian)
        step = (covariance @ descent[..., None])[..., 0]
        gain = np.sum(descent * step, axis=-1) - misfit - ((precision * self.x) @ self.x)[:, None]
        logs = np.sum(np.log(precision), axis=-1)[:, None] - np.linalg.slogdet(hessian)[1]
        return step, covariance, (gain + logs) / 2

    def _of_data(self, spread: float) -> tuple[FloatArray, FloatArray, float]:
        """What no scatter changes: SᵀW_sS and SᵀW_sr with what is no frequency, and rᵀW_sr - log|W_s|."""
        variance = self.noise + spread**2 * np.eye(self.residual.size)
        weighted = np.linalg.solve(variance, np.column_stack([self.sensitivity, self.residual]))
        S, r = weighted[:, :-1], weighted[:, -1]
        hessian, descent = self.sensitivity.T @ S + self.other_hessian, self.sensitivity.T @ r + self.other_descent
        return hessian, descent, float(self.residual @ r + np.linalg.slogdet(variance)[1])

    def only(self, rows: BoolArray) -> LinearProblem:
        """The problem of some frequencies alone: (n,) `rows` says which."""
        return LinearProblem(
            self.residual[rows],
            self.noise[np.ix_(rows, rows)],
            self.sensitivity[rows],
            self.x,
            sd=self.sd,
            other_hessian=self.other_hessian,
            other_descent=self.other_descent,
        )

    def mixture(self, scatter_scale: float) -> tuple[Mixture, FloatArray]:
        """The posterior about the estimate, and (m,) the scatter of each of its Gaussians; a scale of 0 has no scatter."""
        scatters = scatter_scale * _SCATTERS if scatter_scale else np.zeros(1)
        step, covariance, evidence = self._solve_all(_DISCREPANCIES, scatters)
        log_weight = evidence + _log_prior(_DISCREPANCIES, DISCREPANCY)
        if scatter_scale:
            log_weight += _log_prior(scatters, scatter_scale)[:, None]
        weight, size = np.exp(log_weight - scipy.special.logsumexp(log_weight)).ravel(), self.x.size
        spread = np.tile(_DISCREPANCIES, scatters.size)
        mixture = Mixture(weight, step.reshape(-1, size), covariance.reshape(-1, size, size), spread)
        return mixture, np.repeat(scatters, _DISCREPANCIES.size)


def _log_prior(value: FloatArray, scale: float) -> FloatArray:
    """Of ln s for a scaled inverse χ² of two degrees of freedom, up to a constant."""
    log: FloatArray = -DISCREPANCY_DOF * (np.log(value) + scale**2 / (2 * value**2))
    return log
