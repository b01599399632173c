"""Stage 2: a damping law from complex FRFs, all FRFs and modes of a band together (Eq. 11).

The modes and their residues come from the updated elastic model and stay; the law's coefficients a
and a frequency shift δ_k of each measured mode (a misfit of a natural frequency looks like damping)
minimise

    E(a, δ) = Σ_i Σ_l w_il |r_il|²,    r = H_exp - H(λ_k (1 + δ_k)², c(a, ω_k))   (or ln H_exp/H for `log`)

by Levenberg and Marquardt's method. A law is never exact: each mode's rate is c_k exp(ε_k) with ε_k
~ N(0, s²), and the priors of the nuisance parameters join E, which for `noise` weights is the
negative log likelihood. A law that fits keeps ε at zero; one that does not is then fitted to all
modes alike, in place of to the one with the strongest signal. Modes that were not measured, above
the band say, have shifts and deviations with priors too: else their tails, taken as exact, would
show a damping that nobody measured. Rigid-body modes, and those that move on the springs of the
supports, are damped by what they hang on and not by the law: each has a rate of its own.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.dynamics.damping_laws import DampingLaw, beyond, damping_rate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.errors import UpdatingError
from fecore.frf import Quantity
from fecore.least_squares import minimise
from fecore.updating.law_problem import LawPoint, LawProblem, Nuisance
from fecore.updating.misfit import FrfMisfit, NormalEquations
from fecore.updating.parameters import by_name


@dataclass(frozen=True)
class DampingFit:
    """A law fitted to FRFs."""

    law: DampingLaw
    coefficients: FloatArray  # (p,) estimate
    nuisance: Nuisance  # the modes with a shift and a deviation
    shift: FloatArray  # (s,) their relative frequency shifts δ_k
    eigenvalue: FloatArray  # (m,) eigenvalues as fitted, λ_k (1 + δ_k)²
    rate: FloatArray  # (m,) damping rates as fitted, deviations and the window's rate included
    law_rate: FloatArray  # (m,) those of the law alone
    cost: float  # misfit E of the data, weighted
    objective: float  # the same with the deviations' prior
    noise_covariance: FloatArray  # (p, p) covariance of the coefficients by measurement noise alone
    # (p, 2m) derivative of the estimate by the misfit's gradient in (λ, c): how a wrong model moves
    # it
    response: FloatArray
    # (p, m) the same by the logarithm of the law's rate of each mode with a rate of its own, 0 of
    # the others
    tie: FloatArray
    # (p, m) the same by the logarithm of the rate known beside the misfit of each mode, 0 of the
    # others
    ratio_data: FloatArray
    normal: NormalEquations  # normal equations at the estimate
    history: FloatArray  # (iterations, p) coefficients, first to last

    def synthesise(
        self, model: ModalFrfModel, frequency_hz: FloatArray, quantity: Quantity
    ) -> ComplexArray:
        """(N, L) FRFs of the elastic model between any dofs under the law, modes that the model
        leaves out included.
        """
        tail = beyond(self.law, self.coefficients, float(model.omega[-1]), model.strain)
        return model.synthesise(frequency_hz, self.rates(model), quantity, tail)

    def rates(self, model: ModalFrfModel) -> FloatArray:
        """(m,) rates to predict FRFs of a model's modes with: the law's, but a suspended mode's
        own.
        """
        rates = (
            damping_rate(self.law, self.coefficients, model.omega, model.strain)
            + self.nuisance.window_rate
        )
        rates[self.nuisance.suspension_modes] = self.rate[self.nuisance.suspension_modes]
        return rates


def fit_law(
    misfit: FrfMisfit,
    law: DampingLaw,
    start: FloatArray | DampingFit,
    nuisance: Nuisance,
    scale: float = 1.0,
) -> DampingFit:
    """Fit a law's coefficients and the modes' frequency shifts.

    Args:
        misfit: data and model.
        law: the law.
        start: (p,) first coefficients; or a fit of the law with the same modes off it, to go on
            where that ended.
        nuisance: modes that may lie off the model and the law.
        scale: what E of one value is by noise alone: 1 for `noise` weights. It brings priors into
            the units of E.

    Raises:
        UpdatingError: no convergence; it carries the best iterate.
    """
    problem = LawProblem(misfit, law, nuisance, scale)
    history: list[FloatArray] = []

    def visit(_: int, point: LawPoint) -> None:
        if not history or point.coefficients is not history[-1]:
            history.append(point.coefficients)

    first = problem.first(start) if isinstance(start, np.ndarray) else _end(problem, start)
    minimum = minimise(problem.at(first), problem.move, problem.stopping(), visit)
    best = by_name(law.coefficient_names, minimum.point.coefficients)
    if minimum.outcome == "singular":
        raise UpdatingError(
            f"the FRFs do not distinguish the coefficients of the {law.name} law; use a wider band,"
            " or a law with fewer",
            best=best,
            history=(minimum.point.normal.cost,),
        )
    if minimum.outcome != "converged" and not problem.is_at_rest(minimum.point):
        raise UpdatingError(
            f"the {law.name} fit did not converge; check the band, the modes and the geometry",
            best=best,
            history=(minimum.point.normal.cost,),
        )
    return _finished(problem, minimum.point, np.array(history))


def _end(problem: LawProblem, fit: DampingFit) -> FloatArray:
    """X where a fit ended."""
    own = np.log(fit.rate[problem.own] - problem.nuisance.window_rate)
    return np.concatenate([fit.coefficients, fit.shift, own])


def _finished(problem: LawProblem, point: LawPoint, history: FloatArray) -> DampingFit:
    """The fit at the minimum, with how noise and a wrong model move it."""
    x, nuisance, count = point.x, problem.nuisance, problem.count
    eigenvalue, rate = problem.modes(x)
    inverse = np.linalg.inv(problem.system(x, point.normal)[0])
    a, shift, _ = problem.split(x)
    _, by_prior = problem.prior(x)
    rows = shift.size + np.arange(problem.tied.size)
    tie, ratio_data = np.zeros((count, eigenvalue.size)), np.zeros((count, eigenvalue.size))
    tie[:, problem.tied] = problem.scale * (inverse @ by_prior[rows].T)[:count]
    tie[:, problem.tied] /= nuisance.deviation_sd[nuisance.deviation_sd > 0]
    ratio_data[:, nuisance.ratio_data] = (
        problem.scale * (inverse @ problem.known(x)[1].T)[:count] / nuisance.ratio_data_sd
    )
    return DampingFit(
        law=problem.law,
        coefficients=a,
        nuisance=nuisance,
        shift=shift,
        eigenvalue=eigenvalue,
        rate=rate,
        law_rate=problem.basis(problem.omega(shift)) @ a,
        cost=point.normal.cost,
        objective=point.cost,
        noise_covariance=_covariance(problem, point, inverse)[:count, :count],
        response=(inverse @ problem.chain(x).T)[:count],
        tie=tie,
        ratio_data=ratio_data,
        normal=point.normal,
        history=history,
    )


def _covariance(problem: LawProblem, point: LawPoint, inverse: FloatArray) -> FloatArray:
    """Covariance of x by measurement noise; `inverse` is that of the hessian."""
    misfit, (eigenvalue, rate) = problem.misfit, problem.modes(point.x)
    predicted = misfit.predict(eigenvalue, rate)
    _, weight = misfit.residual(predicted)
    # Circular noise of variance v: cov(2 Re Jᴴ W n) = 2 Re Jᴴ W² V J, which is the hessian with
    # weights w²v.
    moved = point.normal.reduction @ problem.chain(point.x)
    spread = (
        moved.T
        @ misfit.jacobian(eigenvalue, rate, predicted).hessian(misfit.scatter(weight))
        @ moved
    )
    # a misfit above the noise is the model's error, which scatters likewise
    if misfit.weighting == "noise":
        spread = problem.scale * spread
    known = problem.known(point.x)[1]
    covariance = inverse @ (spread + problem.scale**2 * known.T @ known) @ inverse
    at = np.arange(len(covariance))
    # where the noise is next to nothing, round-off is not
    covariance[at, at] = np.maximum(covariance[at, at], 0)
    return covariance
