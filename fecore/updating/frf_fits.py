"""What is fitted to complex FRFs: a damping law alone, or a law and the elastic constants in turn.

Every derivative goes through the modes' eigenvalues λ_k and damping rates c_k, of which there are
few: ∂H_i/∂λ_k = -f A_ik/D_k² and ∂H_i/∂c_k = iω ∂H_i/∂λ_k. So the normal equations are accumulated
once for (λ, c), and any law is a small matrix on top of them.

A law alone (stage 2) is fitted to all FRFs and modes of a band together (Eq. 11). The modes and
their residues come from the updated elastic model and stay; the law's coefficients a and a
frequency shift δ_k of each measured mode (a misfit of a natural frequency looks like damping)
minimise

    E(a, δ) = Σ_i Σ_l w_il |r_il|²,    r = H_exp - H(λ_k (1 + δ_k)², c(a, ω_k))   (or ln H_exp/H for `log`)

by Levenberg and Marquardt's method. A law is never exact: each mode's rate is c_k exp(ε_k) with ε_k
~ N(0, s²), and the priors of the nuisance parameters join E, which for `noise` weights is the
negative log likelihood. A law that fits keeps ε at zero; one that does not is then fitted to all
modes alike, in place of to the one with the strongest signal. Modes that were not measured, above
the band say, have shifts and deviations with priors too: else their tails, taken as exact, would
show a damping that nobody measured. Rigid-body modes, and those that move on the springs of the
supports, are damped by what they hang on and not by the law: each has a rate of its own.

A law and the constants in turn are beyond the paper: the two-stage update needs modes. Where FRFs
do not let them be identified one by one, the model itself can distinguish them: its own shapes say
what each mode contributes to each FRF, and only frequencies and damping are left to find. So two
fits take turns until the constants stand still:

    1. frequency shifts δ_k and damping ratios ζ_k of the model's modes, from the FRFs with the
       model's shapes;
    2. constants θ from the shifted frequencies ω_k (1 + δ_k), as stage 1, modes kept apart by their
       shapes.

A shape of the model is good enough to distinguish modes but not to fit constants by: plate theory's
error in it would pass for data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.dynamics.damping_laws import DampingLaw, beyond, damping_rate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.frf import FrfSet, Quantity
from fecore.least_squares import Stopping, minimise
from fecore.modes import MeasuredModes
from fecore.updating.elastic import Unsettled, fit_elastic
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.elastic_starts import starts_by_frfs
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.inputs import Inputs
from fecore.updating.laws import nearest_positive
from fecore.updating.layout import Layout
from fecore.updating.misfit import FrfMisfit, NormalEquations, Weighting, residual_variance
from fecore.updating.parameters import by_name

# gain, of a value's misfit by noise: the minimum is then within 0.14 standard deviations
_NEGLIGIBLE = 0.01
_STANDS = 0.1  # standard deviations: a coefficient whose next step is smaller stands
_STEPS = 200  # the rates of modes above the band, which nobody measured, come to their place last
_BEYOND = 1e-9  # of a shift or a logarithm: which side of a bound the descent leads to
_ROUND_OFF = 1e-12  # of the weighted signal: noise-free data cannot be fitted better
_LARGEST_SHIFT = 0.1  # a mode further off than this was not paired rightly
_LARGEST_BELIEVED_SHIFT = 0.5  # of a mode that was not measured
_LARGEST_LOG_RATE = 25.0  # e²⁵ 1/s is beyond any damping: a step that overshoots must not overflow
# prior standard deviation of the logarithm of a suspended mode's rate: nobody knows it
_SUSPENSION_SD = 2.0


@dataclass(frozen=True)
class Nuisance:
    """Modes that may lie off the model in frequency, and off the law in damping."""

    modes: IntArray  # (s,) their numbers among the model's
    first_shift: FloatArray  # (s,) relative shifts to start from
    # (s,) prior standard deviation of the shifts; infinite where they are free
    shift_sd: FloatArray
    # (s,) prior standard deviation of the damping deviation ε; 0 where the law is taken as exact
    deviation_sd: FloatArray
    # (r,) numbers of the modes that the law does not damp, with a rate of their own
    suspension_modes: IntArray = field(default_factory=lambda: np.arange(0))
    # (r,) about which these are expected, within a factor of some seven, 1/s
    suspension_rate: FloatArray = field(default_factory=lambda: np.zeros(0))
    # 2/τ of an exponential window on the data, which every mode's rate has on top, 1/s
    window_rate: float = 0.0
    # (n,) numbers of the modes whose rate is known beside the misfit, from fits with residues of
    # their own
    ratio_data: IntArray = field(default_factory=lambda: np.arange(0))
    # (n,) these rates, 1/s, without the window's
    ratio_data_rate: FloatArray = field(default_factory=lambda: np.zeros(0))
    # (n,) their standard deviations, relative
    ratio_data_sd: FloatArray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of_exact_law(cls, modes: IntArray, first_shift: FloatArray) -> Nuisance:
        """Free shifts and no deviations: Eq. 11 with the frequencies let go."""
        return cls(modes, first_shift, np.full(modes.size, np.inf), np.zeros(modes.size))


@dataclass(frozen=True)
class LawPoint:
    """x with the misfit there, prior included, as `minimise` asks for it; `normal` is that of the
    data by (λ, c).
    """

    x: FloatArray
    coefficients: FloatArray
    normal: NormalEquations
    cost: float
    descent: FloatArray
    hessian: FloatArray


@dataclass(frozen=True)
class LawProblem:
    """The map from x = (coefficients a, shifts δ, logarithms ℓ of the modes' own rates) to
    eigenvalues and rates.

    A mode that may deviate has a rate of its own, exp(ℓ_k), which the data fix and which a prior
    ties to the law: ε_k = ℓ_k - ln c_k(a). So the valley along which a and ε trade is straight. A
    suspended mode's is tied to a constant.
    """

    misfit: FrfMisfit
    law: DampingLaw
    nuisance: Nuisance
    scale: float

    @property
    def count(self) -> int:
        """How many coefficients the law has."""
        return len(self.law.coefficient_names)

    @cached_property
    def tied(self) -> IntArray:
        """Numbers of the modes with a rate of their own that is tied to the law."""
        return self.nuisance.modes[self.nuisance.deviation_sd > 0]

    def basis(self, omega: FloatArray, modes: IntArray | slice = slice(None)) -> FloatArray:
        """(n, p) the law's basis at the frequencies of some modes, with these modes' strain
        energy.
        """
        strain = self.misfit.model.strain
        return self.law.basis(omega, None if strain is None else strain[modes])

    def slope(self, omega: FloatArray, modes: IntArray) -> FloatArray:
        """(n, p) the slope of the basis, likewise."""
        strain = self.misfit.model.strain
        return self.law.slope(omega, None if strain is None else strain[modes])

    @cached_property
    def own(self) -> IntArray:
        """Numbers of the modes with a rate of their own: the tied, then the suspended ones."""
        return np.concatenate([self.tied, self.nuisance.suspension_modes])

    def at(self, x: FloatArray) -> LawPoint:
        """The point at x."""
        normal = self.misfit.normal(*self.modes(x))
        hessian, descent = self.system(x, normal)
        # Along the logarithm of a rate c the misfit bends by c ∂E/∂c too: with its size, down or
        # up, steps do not creep.
        own = slice(x.size - self.own.size, None)
        at = np.arange(x.size)[own]
        hessian[at, at] += np.abs(
            normal.gradient[self.misfit.model.omega.size + self.own]
        ) * np.exp(x[own])
        # What a bound holds takes no part in a step: it would be cut off, and the fall be less than
        # was foretold.
        further = x + np.sign(descent) * _BEYOND
        held = self.within(further) != further
        descent = np.where(held, 0.0, descent)
        hessian = np.where((held[:, None] | held) & ~np.eye(x.size, dtype=bool), 0.0, hessian)
        return LawPoint(x, x[: self.count], normal, normal.cost + self.penalty(x), descent, hessian)

    def move(self, point: LawPoint, step: FloatArray) -> LawPoint | None:
        """The point that a step leads to, held to what is believable; None where a mode would be
        damped negatively.
        """
        x = self.within(point.x + step)
        return self.at(x) if self.is_allowed(x) else None

    def is_at_rest(self, point: LawPoint) -> bool:
        """Whether what is left to gain is far below the noise, or the step that is left hardly
        moves the coefficients.

        Steps leave out what little of a delay is left, and rates of modes above the band may creep
        on for long.
        """
        inverse = np.linalg.inv(point.hessian)
        step = inverse @ point.descent
        # Where the model misses, one value's misfit is more than the noise's.
        one_value = max(self.scale, point.normal.cost / float(np.sum(self.misfit.counted)))
        gain, sd = float(point.descent @ step) / 2, np.sqrt(one_value * np.diag(inverse))
        return gain < _NEGLIGIBLE * one_value or bool(
            np.all(np.abs(step / sd)[: self.count] < _STANDS)
        )

    def stopping(self) -> Stopping:
        """Converged to the round-off of the weighted signal: noise-free data cannot be fitted
        better.
        """
        return Stopping(absolute=_ROUND_OFF**2 * self.misfit.signal(), steps=_STEPS)

    def first(self, start: FloatArray) -> FloatArray | None:
        """X to start from: given coefficients, and own rates as these have them; None where they
        damp a mode negatively.
        """
        rate = self.basis(self.omega(self.nuisance.first_shift)) @ start
        if np.any(rate[self.tied] <= 0):
            return None
        own = np.log(np.concatenate([rate[self.tied], self.nuisance.suspension_rate]))
        return np.concatenate([start, self.nuisance.first_shift, own])

    def omega(self, shift: FloatArray) -> FloatArray:
        """(m,) circular frequencies of the shifted modes among the others."""
        omega = self.misfit.model.omega.copy()
        omega[self.nuisance.modes] *= 1 + shift
        return omega

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients, shifts, and logarithms of own rates."""
        ends = (self.count, self.count + self.nuisance.modes.size)
        return x[: ends[0]], x[ends[0] : ends[1]], x[ends[1] :]

    def modes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Eigenvalues and damping rates of all modes."""
        a, shift, own = self.split(x)
        omega = self.omega(shift)
        rate = self.basis(omega) @ a
        rate[self.own] = np.exp(own)
        return omega**2, rate + self.nuisance.window_rate

    def prior(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Prior residuals ρ, in standard deviations, and their Jacobian by x: shifts, deviations,
        rates known beside.
        """
        a, shift, own = self.split(x)
        omega = self.omega(shift)[self.tied]
        basis = self.basis(omega, self.tied)
        law_rate = basis @ a
        shift_weight = 1 / self.nuisance.shift_sd
        weight = 1 / self.nuisance.deviation_sd[self.nuisance.deviation_sd > 0]
        off = own - np.log(np.concatenate([law_rate, self.nuisance.suspension_rate]))
        off_weight = np.concatenate(
            [weight, np.full(self.nuisance.suspension_modes.size, 1 / _SUSPENSION_SD)]
        )
        residual = np.concatenate([shift * shift_weight, off_weight * off])
        s, first = shift.size, self.count + shift.size
        tied = s + np.arange(self.tied.size)
        jacobian = np.zeros((residual.size, x.size))
        jacobian[:s, self.count : first] = np.diag(shift_weight)
        jacobian[tied, : self.count] = -(weight / law_rate)[:, None] * basis
        moved = self.count + np.flatnonzero(self.nuisance.deviation_sd > 0)
        base = self.misfit.model.omega[self.tied]
        jacobian[tied, moved] = -weight / law_rate * (self.slope(omega, self.tied) @ a) * base
        jacobian[s:, first:] = np.diag(off_weight)
        known, by_known = self.known(x)
        return np.concatenate([residual, known]), np.vstack([jacobian, by_known])

    def known(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance of the rates from those known beside the misfit, in their standard deviations,
        and the Jacobian.
        """
        ratio_data, T, m = self.nuisance.ratio_data, self.chain(x), self.misfit.model.omega.size
        rate = self.modes(x)[1][ratio_data] - self.nuisance.window_rate
        weight = 1 / self.nuisance.ratio_data_sd
        return (
            weight * np.log(rate / self.nuisance.ratio_data_rate),
            (weight / rate)[:, None] * T[m + ratio_data],
        )

    def penalty(self, x: FloatArray) -> float:
        """The prior's share of the misfit."""
        residual, _ = self.prior(x)
        return self.scale * float(residual @ residual) / 2

    def system(self, x: FloatArray, normal: NormalEquations) -> tuple[FloatArray, FloatArray]:
        """Gauss-Newton hessian and descent gradient by x."""
        T, (residual, jacobian) = self.chain(x), self.prior(x)
        hessian = T.T @ normal.hessian @ T + self.scale * jacobian.T @ jacobian
        return hessian, T.T @ normal.gradient - self.scale * jacobian.T @ residual

    def chain(self, x: FloatArray) -> FloatArray:
        """(2m, x) ∂(λ, c)/∂x."""
        a, shift, own = self.split(x)
        base, omega, m = self.misfit.model.omega, self.omega(shift), self.misfit.model.omega.size
        T = np.zeros((2 * m, x.size))
        columns, modes = self.count + np.arange(shift.size), self.nuisance.modes
        T[m:, : self.count] = self.basis(omega)
        T[m + modes, columns] = (self.slope(omega[modes], modes) @ a) * base[modes]
        T[m + self.own] = 0
        T[modes, columns] = 2 * base[modes] * omega[modes]
        T[m + self.own, self.count + shift.size + np.arange(own.size)] = np.exp(own)
        return T

    @cached_property
    def largest_shift(self) -> FloatArray:
        """(s,) largest shifts: what a rightly paired mode may be off, or more where the prior says
        so.
        """
        believed = np.where(np.isfinite(self.nuisance.shift_sd), 3 * self.nuisance.shift_sd, 0.0)
        return np.clip(believed, _LARGEST_SHIFT, _LARGEST_BELIEVED_SHIFT)

    def within(self, x: FloatArray) -> FloatArray:
        """X with its shifts held to what a rightly paired mode may be off, and its own rates to
        what is finite.
        """
        held = x.copy()
        shifts = slice(self.count, self.count + self.nuisance.modes.size)
        held[shifts] = np.clip(held[shifts], -self.largest_shift, self.largest_shift)
        own = slice(shifts.stop, None)
        held[own] = np.clip(held[own], -_LARGEST_LOG_RATE, _LARGEST_LOG_RATE)
        return held

    def is_allowed(self, x: FloatArray) -> bool:
        """Whether every mode that counts is damped, and every coefficient has a mode that it
        damps.
        """
        a, shift, _ = self.split(x)
        omega = self.misfit.model.omega
        needed = (omega > 0) & (omega <= self.misfit.frfs.omega[-1])
        needed[self.tied] = True
        needed[self.nuisance.suspension_modes] = False
        basis = self.basis(self.omega(shift)[needed], np.flatnonzero(needed))
        # A shift past a border between two knots of a modal law would leave one of its coefficients
        # without a mode.
        return bool(np.all(basis @ a > 0) and np.all(basis.any(axis=0)))


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
) -> DampingFit | Unsettled:
    """Fit a law's coefficients and the modes' frequency shifts.

    Args:
        misfit: data and model.
        law: the law.
        start: (p,) first coefficients; or a fit of the law with the same modes off it, to go on
            where that ended.
        nuisance: modes that may lie off the model and the law.
        scale: what E of one value is by noise alone: 1 for `noise` weights. It brings priors into
            the units of E.

    Returns:
        The fit; or why there is none, with the best iterate.
    """
    problem = LawProblem(misfit, law, nuisance, scale)
    history = [] if isinstance(start, np.ndarray) else [*start.history[:-1]]

    def visit(_: int, point: LawPoint) -> None:
        if not history or point.coefficients is not history[-1]:
            history.append(point.coefficients)

    first = problem.first(start) if isinstance(start, np.ndarray) else _end(problem, start)
    if first is None:
        best = by_name(law.coefficient_names, np.asarray(start))
        message = f"the {law.name} law cannot start where it damps a mode negatively"
        return Unsettled(message, best, ())
    minimum = minimise(problem.at(first), problem.move, problem.stopping(), visit)
    if minimum.outcome == "singular":
        message = (
            f"the FRFs do not distinguish the coefficients of the {law.name} law; use a wider band,"
            " or a law with fewer"
        )
    elif minimum.outcome != "converged" and not problem.is_at_rest(minimum.point):
        message = f"the {law.name} fit did not converge; check the band, the modes and the geometry"
    else:
        return _finished(problem, minimum.point, np.array(history))
    best = by_name(law.coefficient_names, minimum.point.coefficients)
    return Unsettled(message, best, (minimum.point.normal.cost,))


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


_TURNS = 12  # of the search for constants and law, at most
_STILL = 0.01  # posterior standard deviations that the constants may move in the last turn
# prior standard deviation of a shift, while the model is not right yet, of modes in the band and
# above it
_SHIFT_SD, _OTHERS_SHIFT_SD = 0.05, 0.02


@dataclass(frozen=True)
class JointResult:
    """What the turns ended with."""

    elastic: ElasticResult
    modes: MeasuredModes  # that the FRFs show through the model's shapes
    left: float  # share of the FRFs' squares that is missed


@dataclass(frozen=True)
class JointProblem:
    """FRFs on the fitted lines, a model and a law, from which every mode's damping may deviate
    widely.
    """

    forward: ForwardModel
    frfs: FrfSet
    law: DampingLaw
    inputs: Inputs
    # points at which a sensor stood through the test, if its mass was not stated
    fixed_points: tuple[int, ...] = ()

    def update(
        self, seed: int, progress: Callable[[float], None] = lambda _: None
    ) -> JointResult | Unsettled:
        """Constants and damping from FRFs alone, the best of a few starts.

        Args:
            seed: of the draws that starts are chosen of.
            progress: called with the share that is done.

        Returns:
            The result; or where the last start ended that led to no constants that stand still.
        """
        forward, frfs, law = self.forward, self.frfs, self.law
        starts = starts_by_frfs(forward, frfs, law, seed, lambda share: progress(0.5 * share))
        outcomes: list[JointResult | Unsettled] = []
        for done, start in enumerate(starts):
            progress(0.5 + 0.5 * done / len(starts))
            outcomes.append(self.in_turns(*start))
        results = [each for each in outcomes if isinstance(each, JointResult)]
        if results:
            return min(results, key=lambda each: each.left)
        failed = [each for each in outcomes if isinstance(each, Unsettled)]
        if not failed:
            message = "no draw from the prior gives a physical specimen; widen or move the priors"
            return Unsettled(message, {})
        as_stated = (
            "the method joint takes height, sign and quantity of the FRFs as stated; two_stage"
            " says which is wrong"
        )
        return replace(failed[-1], message=f"{failed[-1].message}; {as_stated}")

    def in_turns(self, theta: FloatArray, ratio: float) -> JointResult | Unsettled:
        """Fit modes through the model's shapes, and constants to the modes, in turn."""
        frfs, measured = self.frfs, self.frfs.measured
        variance: FloatArray = np.ones(measured.shape)
        weighting: Weighting = "log" if np.all(frfs.values[measured] != 0) else "linear"
        start: FloatArray | None = None
        for _ in range(_TURNS):
            state = self.forward.solve(theta)
            model = state.frf_model(frfs.responses, frfs.references)
            moving = np.arange(state.modes.rigid, model.omega.size)
            inside = moving[model.omega[moving] < frfs.omega[-1]]
            if inside.size == 0:
                return Unsettled("the model has no mode in the band", {})
            misfit = FrfMisfit(frfs, model, weighting, variance)
            fit = self._fit(misfit, start, ratio, moving, inside)
            if isinstance(fit, Unsettled):
                return fit
            modes = self._modes(state, fit, inside)
            if modes.damping_ratio.max() >= 1:
                message = (
                    "the joint update damps a mode beyond the critical; check band, boundary and"
                    " priors"
                )
                return Unsettled(message, self._named(theta))
            layout = Layout.of_one(self.forward, modes, self.inputs, self.fixed_points)
            elastic = fit_elastic(layout)
            if isinstance(elastic, Unsettled):
                return elastic
            predicted = misfit.predict(fit.eigenvalue, fit.rate)
            residual = np.where(measured, frfs.values - predicted, 0)
            variance = residual_variance(residual, predicted, measured)
            moved = np.abs(elastic.theta - theta) / np.sqrt(np.diag(elastic.covariance))
            at_rest = weighting == "noise" and moved.max() < _STILL
            theta, start, weighting = elastic.theta, fit.coefficients, "noise"
            if at_rest:
                whole = np.sum(np.abs(frfs.values[measured]) ** 2)
                return JointResult(elastic, modes, float(np.sum(np.abs(residual) ** 2) / whole))
        message = f"the joint update did not come to rest in {_TURNS} turns"
        return Unsettled(message, self._named(theta))

    def _fit(
        self,
        misfit: FrfMisfit,
        start: FloatArray | None,
        ratio: float,
        moving: IntArray,
        inside: IntArray,
    ) -> DampingFit | Unsettled:
        """Shifts and damping ratios of the model's moving modes, those inside the band first."""
        omega, others = misfit.model.omega, np.setdiff1d(moving, inside)
        if start is None:
            strain = None if misfit.model.strain is None else misfit.model.strain[moving]
            even = np.full(moving.size, ratio)
            start = nearest_positive(self.law, omega[moving], even, strain=strain)
        rigid = omega.size - moving.size
        sd = [np.full(inside.size, _SHIFT_SD), np.full(others.size, _OTHERS_SHIFT_SD)]
        nuisance = Nuisance(
            modes=np.concatenate([inside, others]),
            first_shift=np.zeros(moving.size),
            shift_sd=np.concatenate(sd),
            # of ln ζ over the law's, which here only has to be near
            deviation_sd=np.ones(moving.size),
            suspension_modes=np.arange(rigid),
            suspension_rate=np.full(rigid, 2 * ratio * omega[inside[0]]),
        )
        return fit_law(misfit, self.law, start, nuisance)

    def _modes(self, state: ForwardState, fit: DampingFit, inside: IntArray) -> MeasuredModes:
        """The modes in the band as measured ones, with the model's shapes."""
        omega = np.sqrt(fit.eigenvalue[inside])
        ratio, order = fit.rate[inside] / (2 * omega), np.argsort(omega, kind="stable")
        shapes = state.all_shapes[inside][order] + 0j
        return MeasuredModes(omega[order] / (2 * np.pi), ratio[order], shapes, self.forward.dofs)

    def _named(self, theta: FloatArray) -> dict[str, float]:
        return by_name(self.forward.parametrisation.names, theta)
