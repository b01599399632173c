"""Stage 2: a damping law from complex FRFs, all FRFs and modes of a band together (Eq. 11).

The modes and their residues come from the updated elastic model and stay; the law's coefficients a and a frequency shift
δ_k of each measured mode (a misfit of a natural frequency looks like damping) minimise

    E(a, δ) = Σ_i Σ_l w_il |r_il|²,    r = H_exp - H(λ_k (1 + δ_k)², c(a, ω_k))   (or ln H_exp/H for `log`)

by Levenberg-Marquardt. Every derivative goes through the modes' eigenvalues λ_k and damping rates c_k, of which there are
few: ∂H_i/∂λ_k = -f A_ik/D_k² and ∂H_i/∂c_k = iω ∂H_i/∂λ_k. So the normal equations are accumulated once for (λ, c), and
any law is a small matrix on top of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.damping import DampingLaw
from fecore.errors import InputError, UpdatingError
from fecore.frf import FrfSet, ModalFrfModel, convert

Weighting = Literal["linear", "relative", "log", "noise"]

_MAX_ITERATIONS = 100
_TOLERANCE = 1e-9  # relative fall of the misfit, and step in posterior standard deviations, at convergence
_LARGEST_SHIFT = 0.1  # a mode further off than this was not paired rightly


@dataclass(frozen=True)
class DampingFit:
    """A law fitted to FRFs.

    Attributes:
        law: the law.
        coefficients: (p,) estimate.
        shift: (s,) relative frequency shifts of the shifted modes.
        shifted: (s,) numbers of those modes among the model's.
        eigenvalue, rate: (m,) modes as fitted: λ_k (1 + δ_k)², c_k.
        cost: misfit E, weighted.
        noise_covariance: (p, p) covariance of the coefficients by measurement noise alone.
        response: (p, 2m) derivative of the estimate by the misfit's gradient in (λ, c): how a wrong model moves it.
        normal: normal equations at the estimate.
        history: (iterations, p) coefficients, first to last.
    """

    law: DampingLaw
    coefficients: FloatArray
    shift: FloatArray
    shifted: IntArray
    eigenvalue: FloatArray
    rate: FloatArray
    cost: float
    noise_covariance: FloatArray
    response: FloatArray
    normal: NormalEquations
    history: FloatArray


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of the misfit by u = (λ_1 … λ_m, c_1 … c_m) at one point: cost, (2m,) gradient, (2m, 2m) hessian."""

    cost: float
    gradient: FloatArray
    hessian: FloatArray


@dataclass(frozen=True)
class FrfMisfit:
    """Measured FRFs, the model's residues, and the weighting between them.

    Attributes:
        measured: measured FRFs in the fitted band.
        model: the elastic model's part of the synthesis.
        weighting: name of the residual.
        variance: (N, L) noise variance E|n|², for `noise` weights and for the covariance of the estimate.
    """

    measured: FrfSet
    model: ModalFrfModel
    weighting: Weighting
    variance: FloatArray

    def __post_init__(self) -> None:
        if self.weighting not in get_args(Weighting):
            raise InputError("weighting", f"is {self.weighting!r}, expected one of {', '.join(get_args(Weighting))}")
        if self.weighting in ("relative", "log") and np.any(self.measured.values == 0):
            raise InputError(
                "weighting", f"{self.weighting!r} needs FRFs without zeros; leave out the lines that are 0"
            )

    def predict(self, eigenvalue: FloatArray, rate: FloatArray) -> ComplexArray:
        """(N, L) FRFs with other eigenvalues and rates but the model's residues."""
        return self.model.with_eigenvalue(eigenvalue).synthesise(
            self.measured.frequency_hz, rate, self.measured.quantity
        )

    def residual(self, predicted: ComplexArray) -> tuple[ComplexArray, FloatArray]:
        """(N, L) residuals in units of H, and their weights."""
        values = self.measured.values
        if self.weighting == "log":
            # r = H ln(H_exp/H) has the derivative -∂H of the log residual times H, to first order.
            return predicted * np.log(values / predicted), np.abs(predicted) ** -2
        if self.weighting == "noise":
            return values - predicted, 1 / self.variance
        if self.weighting == "relative":
            return values - predicted, np.abs(values) ** -2
        return values - predicted, np.ones(values.shape)

    def cost(self, eigenvalue: FloatArray, rate: FloatArray) -> float:
        """E at given eigenvalues and rates."""
        residual, weight = self.residual(self.predict(eigenvalue, rate))
        return float(np.sum(weight * np.abs(residual) ** 2))

    def normal(self, eigenvalue: FloatArray, rate: FloatArray) -> NormalEquations:
        """Normal equations at given eigenvalues and rates."""
        residual, weight = self.residual(self.predict(eigenvalue, rate))
        by = self.derivatives(eigenvalue, rate)
        return NormalEquations(
            float(np.sum(weight * np.abs(residual) ** 2)),
            self.gradient(by, weight * residual),
            self.hessian(by, weight),
        )

    def derivatives(self, eigenvalue: FloatArray, rate: FloatArray) -> ComplexArray:
        """(2, m, L) factors d of ∂H_i/∂u_k = A_ik d_k(ω) for u = λ, c."""
        omega = self.measured.omega
        denominator = eigenvalue[:, None] - omega**2 + 1j * omega * rate[:, None]
        by_eigenvalue = -convert(omega, self.measured.quantity) / denominator**2
        return np.stack([by_eigenvalue, 1j * omega * by_eigenvalue])

    def gradient(self, by: ComplexArray, weighted: ComplexArray) -> FloatArray:
        """(2m,) 2 Re Jᴴ(w r): the descent direction's data."""
        projected = self.model.residues.T @ weighted
        both: FloatArray = 2 * np.real(np.sum(by.conj() * projected, axis=2))
        return both.ravel()

    def hessian(self, by: ComplexArray, weight: FloatArray) -> FloatArray:
        """(2m, 2m) 2 Re JᴴWJ."""
        A = self.model.residues
        m = A.shape[1]
        pairs = (A[:, :, None] * A[:, None, :]).reshape(len(A), m * m)
        coupling = (weight.T @ pairs).reshape(-1, m, m)
        both: FloatArray = 2 * np.real(np.einsum("akl,bjl,lkj->akbj", by.conj(), by, coupling, optimize=True))
        return both.reshape(2 * m, 2 * m)


def fit_law(
    misfit: FrfMisfit,
    law: DampingLaw,
    start: FloatArray,
    shifted: IntArray,
    shift: FloatArray,
    progress: Callable[[float], None] = lambda _: None,
) -> DampingFit:
    """Fit a law's coefficients and the modes' frequency shifts.

    Args:
        misfit: data and model.
        law: the law.
        start: (p,) first coefficients.
        shifted: (s,) numbers of the modes that carry a shift, among the model's.
        shift: (s,) first shifts, relative.
        progress: told the share that is done.

    Raises:
        UpdatingError: no convergence; it carries the best iterate.
    """
    problem = _Problem(misfit, law, shifted)
    x = np.concatenate([start, shift])
    history = [start]
    normal = misfit.normal(*problem.modes(x))
    damping = 1e-3
    for iteration in range(_MAX_ITERATIONS):
        progress(1 - 0.7**iteration)
        T = problem.chain(x)
        hessian, gradient = T.T @ normal.hessian @ T, T.T @ normal.gradient
        scale = np.sqrt(np.diag(hessian))
        step = np.linalg.solve(hessian / np.outer(scale, scale) + damping * np.eye(x.size), gradient / scale) / scale
        candidate = x + step
        cost = misfit.cost(*problem.modes(candidate)) if problem.is_allowed(candidate) else np.inf
        small = float(np.max(np.abs(step) * scale)) <= _TOLERANCE * np.sqrt(normal.cost)
        if cost <= normal.cost:
            settled = small and normal.cost - cost <= _TOLERANCE * normal.cost
            x, damping = candidate, damping / 10
            normal = misfit.normal(*problem.modes(x))
            history.append(x[: start.size])
            if settled:
                return problem.finish(x, normal, np.array(history))
        elif small:
            return problem.finish(x, normal, np.array(history))
        else:
            damping *= 10
    raise UpdatingError(
        f"the {law.name} fit did not converge in {_MAX_ITERATIONS} iterations; check the band and the modes",
        best=dict(zip(law.coefficient_names, map(float, x[: start.size]), strict=True)),
        history=(normal.cost,),
    )


@dataclass(frozen=True)
class _Problem:
    """The map from x = (coefficients, shifts) to the modes' eigenvalues and rates."""

    misfit: FrfMisfit
    law: DampingLaw
    shifted: IntArray

    @property
    def count(self) -> int:
        return len(self.law.coefficient_names)

    def modes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        base = self.misfit.model.omega
        stretch = np.ones_like(base)
        stretch[self.shifted] += x[self.count :]
        omega = base * stretch
        return omega**2, self.law.basis(omega) @ x[: self.count]

    def chain(self, x: FloatArray) -> FloatArray:
        """(2m, x) ∂(λ, c)/∂x; the law's dependence on a shifted ω is left to the next iterate (it is second order)."""
        base = self.misfit.model.omega
        eigenvalue, _ = self.modes(x)
        m = base.size
        T = np.zeros((2 * m, x.size))
        T[m:, : self.count] = self.law.basis(np.sqrt(eigenvalue))
        for column, mode in enumerate(self.shifted, start=self.count):
            T[mode, column] = 2 * base[mode] * np.sqrt(eigenvalue[mode])
        return T

    def is_allowed(self, x: FloatArray) -> bool:
        _, rate = self.modes(x)
        in_band = self.misfit.model.omega <= self.misfit.measured.omega[-1]
        return bool(np.all(rate[in_band] > 0) and np.all(np.abs(x[self.count :]) < _LARGEST_SHIFT))

    def finish(self, x: FloatArray, normal: NormalEquations, history: FloatArray) -> DampingFit:
        eigenvalue, rate = self.modes(x)
        T = self.chain(x)
        inverse = np.linalg.inv(T.T @ normal.hessian @ T)
        by = self.misfit.derivatives(eigenvalue, rate)
        _, weight = self.misfit.residual(self.misfit.predict(eigenvalue, rate))
        # Circular noise of variance v: cov(2 Re Jᴴ W n) = 2 Re Jᴴ W² V J, which is the hessian with weights w²v.
        spread = T.T @ self.misfit.hessian(by, weight**2 * self.misfit.variance) @ T
        covariance = inverse @ spread @ inverse
        return DampingFit(
            law=self.law,
            coefficients=x[: self.count],
            shift=x[self.count :],
            shifted=self.shifted,
            eigenvalue=eigenvalue,
            rate=rate,
            cost=normal.cost,
            noise_covariance=covariance[: self.count, : self.count],
            response=(inverse @ T.T)[: self.count],
            normal=normal,
            history=history,
        )
