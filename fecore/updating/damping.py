"""Stage 2: a damping law from complex FRFs, all FRFs and modes of a band together (Eq. 11).

The modes and their residues come from the updated elastic model and stay; the law's coefficients a and a frequency shift
δ_k of each measured mode (a misfit of a natural frequency looks like damping) minimise

    E(a, δ) = Σ_i Σ_l w_il |r_il|²,    r = H_exp - H(λ_k (1 + δ_k)², c(a, ω_k))   (or ln H_exp/H for `log`)

by Levenberg-Marquardt. A law is never exact: each mode's rate is c_k exp(ε_k) with ε_k ~ N(0, s²), and the priors of the
nuisance parameters join E, which for `noise` weights is the negative log likelihood. A law that fits keeps ε at zero; one
that does not is then fitted to all modes alike, in place of to the one with the strongest signal. Modes that were not
measured, above the band say, have shifts and deviations with priors too: else their tails, taken as exact, would tell a
damping that nobody measured.

Every derivative goes through the modes' eigenvalues λ_k and damping rates c_k, of which there are
few: ∂H_i/∂λ_k = -f A_ik/D_k² and ∂H_i/∂c_k = iω ∂H_i/∂λ_k. So the normal equations are accumulated once for (λ, c), and
any law is a small matrix on top of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.damping import DampingLaw
from fecore.errors import InputError, UpdatingError
from fecore.frf import FrfSet, ModalFrfModel, convert

Weighting = Literal["linear", "relative", "log", "noise"]

_MAX_ITERATIONS = 100
_TOLERANCE = 1e-9  # relative fall of the misfit, and step in posterior standard deviations, at convergence
_ROUND_OFF = 1e-12  # of the weighted signal: noise-free data cannot be fitted better
_EXACT = 1e-7  # standard deviation of a deviation that is not allowed
_LARGEST_SHIFT = 0.1  # a mode further off than this was not paired rightly


@dataclass(frozen=True)
class DampingFit:
    """A law fitted to FRFs.

    Attributes:
        law: the law.
        coefficients: (p,) estimate.
        nuisance: the modes with a shift and a deviation.
        shift: (s,) their relative frequency shifts δ_k; deviation: (s,) their ε_k.
        eigenvalue: (m,) eigenvalues as fitted, λ_k (1 + δ_k)².
        rate: (m,) damping rates as fitted, deviations included; law_rate: (m,) those of the law alone.
        cost: misfit E of the data, weighted; objective: with the deviations' prior.
        noise_covariance: (p, p) covariance of the coefficients by measurement noise alone.
        response: (p, 2m) derivative of the estimate by the misfit's gradient in (λ, c): how a wrong model moves it.
        normal: normal equations at the estimate.
        history: (iterations, p) coefficients, first to last.
    """

    law: DampingLaw
    coefficients: FloatArray
    nuisance: Nuisance
    shift: FloatArray
    deviation: FloatArray
    eigenvalue: FloatArray
    rate: FloatArray
    law_rate: FloatArray
    cost: float
    objective: float
    noise_covariance: FloatArray
    response: FloatArray
    normal: NormalEquations
    history: FloatArray


@dataclass(frozen=True)
class Nuisance:
    """Modes that may lie off the model in frequency, and off the law in damping.

    Attributes:
        modes: (s,) their numbers among the model's.
        first_shift: (s,) relative shifts to start from.
        shift_sd: (s,) prior standard deviation of the shifts; infinite where they are free.
        deviation_sd: (s,) prior standard deviation of ε; 0 where the law is taken as exact.
    """

    modes: IntArray
    first_shift: FloatArray
    shift_sd: FloatArray
    deviation_sd: FloatArray

    @classmethod
    def of_exact_law(cls, modes: IntArray, first_shift: FloatArray) -> Nuisance:
        """Free shifts and no deviations: Eq. 11 with the frequencies let go."""
        return cls(modes, first_shift, np.full(modes.size, np.inf), np.zeros(modes.size))


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

    def signal(self) -> float:
        """Weighted sum of squares that the data themselves are worth."""
        values = self.measured.values
        if self.weighting in ("relative", "log"):
            return float(values.size)
        weight = 1 / self.variance if self.weighting == "noise" else 1.0
        return float(np.sum(weight * np.abs(values) ** 2))

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
    nuisance: Nuisance,
    scale: float = 1.0,
    progress: Callable[[float], None] = lambda _: None,
) -> DampingFit:
    """Fit a law's coefficients and the modes' frequency shifts.

    Args:
        misfit: data and model.
        law: the law.
        start: (p,) first coefficients.
        nuisance: modes that may lie off the model and the law.
        scale: what E of one value is by noise alone: 1 for `noise` weights. It brings priors into the units of E.
        progress: told the share that is done.

    Raises:
        UpdatingError: no convergence; it carries the best iterate.
    """
    problem = _Problem(misfit, law, nuisance, scale)
    x = np.concatenate([start, nuisance.first_shift, np.zeros(nuisance.modes.size)])
    history = [start]
    normal = misfit.normal(*problem.modes(x))
    total = normal.cost + problem.penalty(x)
    floor = _ROUND_OFF * np.sqrt(misfit.signal())
    damping = 1e-3
    for iteration in range(_MAX_ITERATIONS):
        progress(1 - 0.7**iteration)
        T = problem.chain(x)
        hessian = T.T @ normal.hessian @ T + np.diag(problem.precision)
        gradient = T.T @ normal.gradient - problem.precision * x
        size = np.sqrt(np.diag(hessian))
        step = np.linalg.solve(hessian / np.outer(size, size) + damping * np.eye(x.size), gradient / size) / size
        candidate = x + step
        allowed = problem.is_allowed(candidate)
        cost = misfit.cost(*problem.modes(candidate)) + problem.penalty(candidate) if allowed else np.inf
        small = float(np.max(np.abs(step) * size)) <= _TOLERANCE * np.sqrt(total) + floor
        if cost <= total:
            settled = small and total - cost <= _TOLERANCE * total
            x, total, damping = candidate, cost, damping / 10
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
    """The map from x = (coefficients, shifts, deviations) to the modes' eigenvalues and rates."""

    misfit: FrfMisfit
    law: DampingLaw
    nuisance: Nuisance
    scale: float

    @property
    def count(self) -> int:
        return len(self.law.coefficient_names)

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients, shifts and deviations."""
        ends = (self.count, self.count + self.nuisance.modes.size)
        return x[: ends[0]], x[ends[0] : ends[1]], x[ends[1] :]

    @cached_property
    def precision(self) -> FloatArray:
        """(x,) prior precision of coefficients (none), shifts and deviations, in the units of E."""
        shift = self.nuisance.shift_sd**-2
        deviation = np.maximum(self.nuisance.deviation_sd, _EXACT) ** -2
        return self.scale * np.concatenate([np.zeros(self.count), shift, deviation])

    def penalty(self, x: FloatArray) -> float:
        return float(self.precision @ x**2) / 2

    def omega(self, x: FloatArray) -> FloatArray:
        stretch = np.ones_like(self.misfit.model.omega)
        stretch[self.nuisance.modes] += self.split(x)[1]
        return self.misfit.model.omega * stretch

    def law_rate(self, x: FloatArray) -> FloatArray:
        rate: FloatArray = self.law.basis(self.omega(x)) @ x[: self.count]
        return rate

    def modes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        rate = self.law_rate(x)
        rate[self.nuisance.modes] *= np.exp(self.split(x)[2])
        return self.omega(x) ** 2, rate

    def chain(self, x: FloatArray) -> FloatArray:
        """(2m, x) ∂(λ, c)/∂x; the law's dependence on a shifted ω is left to the next iterate (it is second order)."""
        base, omega, law_rate = self.misfit.model.omega, self.omega(x), self.law_rate(x)
        m, first = base.size, self.count + self.nuisance.modes.size
        factor = np.ones(m)
        factor[self.nuisance.modes] = np.exp(self.split(x)[2])
        T = np.zeros((2 * m, x.size))
        T[m:, : self.count] = factor[:, None] * self.law.basis(omega)
        for k, mode in enumerate(self.nuisance.modes):
            T[mode, self.count + k] = 2 * base[mode] * omega[mode]
            T[m + mode, first + k] = factor[mode] * law_rate[mode]
        return T

    def is_allowed(self, x: FloatArray) -> bool:
        in_band = self.misfit.model.omega <= self.misfit.measured.omega[-1]
        positive = np.all(self.law_rate(x)[in_band] > 0)
        return bool(positive and np.all(np.abs(self.split(x)[1]) < _LARGEST_SHIFT))

    def finish(self, x: FloatArray, normal: NormalEquations, history: FloatArray) -> DampingFit:
        eigenvalue, rate = self.modes(x)
        T = self.chain(x)
        inverse = np.linalg.inv(T.T @ normal.hessian @ T + np.diag(self.precision))
        by = self.misfit.derivatives(eigenvalue, rate)
        _, weight = self.misfit.residual(self.misfit.predict(eigenvalue, rate))
        # Circular noise of variance v: cov(2 Re Jᴴ W n) = 2 Re Jᴴ W² V J, which is the hessian with weights w²v.
        spread = T.T @ self.misfit.hessian(by, weight**2 * self.misfit.variance) @ T
        covariance = inverse @ spread @ inverse
        return DampingFit(
            law=self.law,
            coefficients=x[: self.count],
            nuisance=self.nuisance,
            shift=self.split(x)[1],
            deviation=self.split(x)[2],
            eigenvalue=eigenvalue,
            rate=rate,
            law_rate=self.law_rate(x),
            cost=normal.cost,
            objective=normal.cost + self.penalty(x),
            noise_covariance=covariance[: self.count, : self.count],
            response=(inverse @ T.T)[: self.count],
            normal=normal,
            history=history,
        )
