"""Stage 1: elastic constants from natural frequencies and mode shapes (Eqs. 12-14, Fig. 1).

The maximum a posteriori estimate by Gauss-Newton,

    Δθ = (SᵀC_e⁻¹S + C_p⁻¹)⁻¹ [SᵀC_e⁻¹ (f_exp - f(θ)) + C_p⁻¹ (θ₀ - θ)],     S = ∂f/∂θ analytic,

with C_e = C_noise + diag((s f)²): the noise of the measured frequencies and the model's relative discrepancy s.
Measured and model modes are paired anew by MAC at every iterate, as constants move modes past each other.

The discrepancy is estimated from the residuals with a prior, and plays two parts. The *estimate* weighs data against prior
with the most probable s, whose prior is what plate theory itself misses (0.05 %: see `docs/accuracy.md`); a larger s would
let a poor prior mean pull on well-measured data. The *covariance* is the expected error of that estimate at the posterior
mean of s with the wide prior of a real body and its supports (0.2 %), so the interval admits what the estimate assumes away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import Pairing, pair_modes
from fecore.errors import InputError, UpdatingError
from fecore.identification import turn_real
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.parameters import by_name
from fecore.updating.posterior import Verdict, discrepancy, null_directions, verdicts

FREQUENCY_DISCREPANCY = 0.002
"""Prior standard deviation of the model's error in a natural frequency, as a share of it, for the intervals."""

THEORY_DISCREPANCY = 0.0005
"""The same for the estimate: what plate theory misses of a three-dimensional body's frequencies."""

SHAPE_DISCREPANCY = 0.01
"""Standard deviation of a measured shape about the model's at a point, as a share of the shape's largest entry."""

_UNKNOWN_FREQUENCY_SD = 0.0002  # a typed-in frequency is taken to be this sure, as a share of it
_MAX_ITERATIONS = 40
_SWINGING = 15  # iterations after which a fit that is not at rest swings
_MAX_HALVINGS = 12
_FAR = 2.0  # prior standard deviations from the prior mean that are worth telling
_LOWEST = 1e-3  # of its prior mean: what no positive parameter falls below
_STEP_TOLERANCE = 1e-4  # in posterior standard deviations
_SWINGING_TOLERANCE = 1e-2  # the same once it swings: large residuals make Gauss-Newton steps overshoot
_COST_ROUND_OFF = 1e-7  # eigenvalues are good to some 1e-9, so a smaller rise of the cost means nothing


@dataclass(frozen=True)
class ElasticIterate:
    """One row of the convergence history: parameters (p,), frequencies of the measured modes (n,; NaN unpaired), cost."""

    theta: FloatArray
    frequency_hz: FloatArray
    cost: float


@dataclass(frozen=True)
class ElasticResult:
    """Updated elastic parameters.

    Attributes:
        theta: (p,) estimate.
        covariance: (p, p) posterior covariance, model discrepancy included.
        noise_covariance: (p, p) covariance of the estimate under measurement noise alone.
        sampled_covariance: (p, p) Gaussian approximation of the posterior whose mode the estimate is.
        admitted_covariance: (p, p) what the discrepancy adds beyond that: the two make `covariance`.
        measured_hz, weight: (n,) paired measured frequencies and (n, n) C_e⁻¹ of the estimate.
        initial, updated: the model at the prior means and at the estimate.
        initial_pairing, pairing: measured to model modes, before and after.
        verdicts: identifiability of each parameter.
        null_directions: (q, p) unit vectors, in prior standard deviations, of which the data say next to nothing.
        discrepancy: estimated relative model error of a frequency, which the covariance includes.
        history: iterates, first to last.
        warnings: what a user must know.
    """

    theta: FloatArray
    covariance: FloatArray
    noise_covariance: FloatArray
    sampled_covariance: FloatArray
    admitted_covariance: FloatArray
    measured_hz: FloatArray
    weight: FloatArray
    initial: ForwardState
    updated: ForwardState
    initial_pairing: Pairing
    pairing: Pairing
    verdicts: tuple[Verdict, ...]
    null_directions: FloatArray
    discrepancy: float
    history: tuple[ElasticIterate, ...]
    warnings: tuple[str, ...]


def update_elastic(
    forward: ForwardModel,
    modes: MeasuredModes,
    progress: Callable[[float], None] = lambda _: None,
    *,
    use_shapes: bool = False,
) -> ElasticResult:
    """Estimate the parameters from measured modes.

    Args:
        forward: the model; its first points are those of the modes' shapes, in their order.
        modes: measured modes; without shapes they are paired by frequency.
        progress: told the share of the stage that is done.
        use_shapes: fit realised shapes too; needs modes with shapes.

    Raises:
        InputError: shapes are asked for and there are none.
        UpdatingError: no mode could be paired, or the iteration did not converge; it carries the best iterate.
        ModelError: the eigenproblem could not be solved.
    """
    if use_shapes and modes.shapes is None:
        raise InputError("use_shapes", "the measured modes have no shapes at points of the model")
    fit = _Fit(forward, modes, use_shapes)
    state = initial_state = forward.solve(forward.parametrisation.prior_mean)
    pairing = initial_pairing = fit.pair(state)
    spread = FREQUENCY_DISCREPANCY
    history: list[ElasticIterate] = []
    torn: set[int] = set()
    for iteration in range(_MAX_ITERATIONS):
        progress(1 - 0.6**iteration)
        system = fit.linearise(state, pairing, spread)
        history.append(ElasticIterate(state.theta, _measured_order(state, pairing, len(modes)), system.cost))
        step = fit.bounded_step(state.theta, system)
        tolerance = _STEP_TOLERANCE if iteration < _SWINGING else _SWINGING_TOLERANCE
        if step @ system.hessian @ step < tolerance**2:
            return fit.finish(state, pairing, spread, initial_state, initial_pairing, tuple(history))
        state = fit.descend(state, pairing, spread, step, system.cost, history)
        before, pairing = pairing, fit.pair(state)
        if iteration >= _SWINGING:
            torn |= {row for row, _ in set(before.pairs) ^ set(pairing.pairs)}
        spread = discrepancy(*fit.relative_residual(state, pairing, spread), THEORY_DISCREPANCY)
    raise UpdatingError(
        fit.without_rest(torn),
        best=by_name(forward.parametrisation.names, state.theta),
        history=tuple(iterate.cost for iterate in history),
    )


@dataclass(frozen=True)
class _System:
    """Gauss-Newton system of the negative log posterior at one iterate."""

    cost: float
    gradient: FloatArray
    hessian: FloatArray
    sensitivity: FloatArray
    weight: FloatArray


@dataclass(frozen=True)
class _Fit:
    """The data of one elastic update."""

    forward: ForwardModel
    modes: MeasuredModes
    use_shapes: bool = False

    def pair(self, state: ForwardState) -> Pairing:
        model_shapes = None if self.modes.shapes is None else state.shapes[:, : len(self.modes.dofs)]
        pairing = pair_modes(self.modes.shapes, model_shapes, self.modes.frequency_hz, state.frequency_hz)
        if not pairing.pairs:
            raise UpdatingError(
                "no measured mode is like any mode of the model; check the boundary, the grid points and the frame",
                best=by_name(self.forward.parametrisation.names, state.theta),
                history=(),
            )
        return pairing

    def noise(self, rows: list[int]) -> FloatArray:
        """(n, n) covariance of the paired measured frequencies by noise."""
        if self.modes.covariance is None:
            return np.diag((_UNKNOWN_FREQUENCY_SD * self.modes.frequency_hz[rows]) ** 2)
        return self.modes.covariance[np.ix_(rows, rows)]

    def linearise(self, state: ForwardState, pairing: Pairing, spread: float) -> _System:
        rows, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
        measured = self.modes.frequency_hz[rows]
        weight = np.linalg.inv(self.noise(rows) + np.diag((spread * measured) ** 2))
        residual = measured - state.frequency_hz[columns]
        S = state.frequency_jacobian[columns]
        prior = self.forward.parametrisation
        away = (state.theta - prior.prior_mean) / prior.prior_sd
        missed, by = self.shape_residual(state, pairing)
        return _System(
            cost=float(residual @ weight @ residual + away @ away + missed @ missed) / 2,
            gradient=-S.T @ weight @ residual + away / prior.prior_sd - by.T @ missed,
            hessian=S.T @ weight @ S + np.diag(prior.prior_sd**-2) + by.T @ by,
            sensitivity=S,
            weight=weight,
        )

    def shape_residual(self, state: ForwardState, pairing: Pairing) -> tuple[FloatArray, FloatArray]:
        """Realised measured less model shapes, each at its best scale, in standard deviations, and -∂/∂θ of them."""
        count = state.theta.size
        if not self.use_shapes or self.modes.shapes is None:
            return np.zeros(0), np.zeros((0, count))
        residuals, jacobians = [], []
        points = len(self.modes.dofs)
        for row, column in pairing.pairs:
            measured = turn_real(self.modes.shapes[row]).real
            measured = measured / np.abs(measured).max()
            model = state.shapes[column, :points]
            scale = measured @ model / (model @ model)
            by = state.shape_jacobian[:, state.modes.rigid + column, :points]
            across = by - np.outer(by @ model, model) / (model @ model)  # the best scale takes what lies along
            residuals.append((measured - scale * model) / SHAPE_DISCREPANCY)
            jacobians.append(scale * across.T / SHAPE_DISCREPANCY)
        return np.concatenate(residuals), np.vstack(jacobians)

    @property
    def lowest(self) -> FloatArray:
        """(p,) what no parameter falls below: a thousandth of its prior mean; a Poisson's ratio has no such bound."""
        prior = self.forward.parametrisation
        return np.where(prior.signed, -np.inf, _LOWEST * prior.prior_mean)

    def at_bound(self, theta: FloatArray) -> list[str]:
        """Parameters that ended at their bound, in words."""
        held = np.flatnonzero(theta <= self.lowest)
        names = self.forward.parametrisation.names
        return [
            f"{names[i]} ended at its lower bound, {theta[i]:.3g}: the data ask for less; look at the model or leave it out"
            for i in held
        ]

    def far_from_prior(self, theta: FloatArray) -> list[str]:
        """Parameters that ended where their prior did not expect them, in words."""
        prior = self.forward.parametrisation
        away = (theta - prior.prior_mean) / prior.prior_sd
        return [
            f"{prior.names[i]} ended {abs(away[i]):.1f} prior standard deviations {'above' if away[i] > 0 else 'below'} its "
            f"prior mean ({theta[i]:.3g} against {prior.prior_mean[i]:.3g}): the prior or the model is wrong, and its interval "
            "supposes neither"
            for i in np.flatnonzero(np.abs(away) > _FAR)
        ]

    def without_rest(self, torn: set[int]) -> str:
        """Why an iteration goes on for ever, and what to do, in words; `torn` are the modes whose partner changed."""
        said = f"the elastic update did not converge in {_MAX_ITERATIONS} iterations; "
        if not torn:
            return said + "check geometry, density, boundary and priors"
        which = ", ".join(f"{row + 1} ({self.modes.frequency_hz[row]:.2f} Hz)" for row in sorted(torn))
        return said + (
            f"the partner of measured mode {which} changes to and fro, as modes of the model mix there or the points "
            "cannot tell them apart: leave it out of the mode set, measure at more points, or check boundary and geometry"
        )

    def bounded_step(self, theta: FloatArray, system: _System) -> FloatArray:
        """The Gauss-Newton step of the parameters that are not held at their bound."""
        free = np.ones(theta.size, dtype=bool)
        step = np.zeros(theta.size)
        for _ in range(theta.size):
            step = np.zeros(theta.size)
            step[free] = np.linalg.solve(system.hessian[np.ix_(free, free)], -system.gradient[free])
            pressed = free & (theta <= self.lowest) & (step < 0)
            if not pressed.any() or pressed[free].all():
                break
            free &= ~pressed
        return step

    def descend(
        self,
        state: ForwardState,
        pairing: Pairing,
        spread: float,
        step: FloatArray,
        cost: float,
        history: list[ElasticIterate],
    ) -> ForwardState:
        """The next iterate: the full step, halved until it is physical and the cost does not grow."""
        for halving in range(_MAX_HALVINGS):
            theta = np.maximum(state.theta + step / 2**halving, self.lowest)
            if not self.forward.parametrisation.is_physical(theta):
                continue
            candidate = self.forward.solve(theta)
            if self.linearise(candidate, pairing, spread).cost <= cost + _COST_ROUND_OFF * (1 + cost):
                return candidate
        raise UpdatingError(
            "the elastic update diverges: no step along the Gauss-Newton direction lowers the misfit",
            best=by_name(self.forward.parametrisation.names, state.theta),
            history=tuple(iterate.cost for iterate in history),
        )

    def relative_residual(self, state: ForwardState, pairing: Pairing, spread: float) -> tuple[FloatArray, float]:
        """Residuals as shares of the frequencies, and how many parameters they determine: tr(H⁻¹ SᵀWS)."""
        rows, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
        system = self.linearise(state, pairing, spread)
        informed = system.hessian - np.diag(self.forward.parametrisation.prior_sd**-2)
        fitted = float(np.trace(np.linalg.solve(system.hessian, informed)))
        return state.frequency_hz[columns] / self.modes.frequency_hz[rows] - 1, fitted

    def finish(
        self,
        state: ForwardState,
        pairing: Pairing,
        spread: float,
        initial: ForwardState,
        initial_pairing: Pairing,
        history: tuple[ElasticIterate, ...],
    ) -> ElasticResult:
        """The result, with the expected error of the estimate θ̂ = θ₀ + G (f_exp - f(θ₀)), linear in data and prior mean:

        E[(θ̂ - θ)(θ̂ - θ)ᵀ] = G C_e Gᵀ + (1 - GS) C_p (1 - GS)ᵀ, where G belongs to the estimate's C_e and the wide C_e stands
        in the middle. With the estimate's own C_e it is the posterior covariance H⁻¹, so the rest is G (C_e - C_e,estimate) Gᵀ.
        """
        estimator = self.linearise(state, pairing, spread)
        gain = np.linalg.solve(estimator.hessian, estimator.sensitivity.T @ estimator.weight)
        wide = discrepancy(*self.relative_residual(state, pairing, spread), FREQUENCY_DISCREPANCY)
        sampled = np.linalg.inv(estimator.hessian)
        more = np.linalg.inv(self.linearise(state, pairing, wide).weight) - np.linalg.inv(estimator.weight)
        admitted = gain @ more @ gain.T
        covariance = sampled + admitted
        rows = [row for row, _ in pairing.pairs]
        prior = self.forward.parametrisation
        return ElasticResult(
            theta=state.theta,
            covariance=covariance,
            noise_covariance=gain @ self.noise(rows) @ gain.T,
            sampled_covariance=sampled,
            admitted_covariance=admitted,
            measured_hz=self.modes.frequency_hz[rows],
            weight=estimator.weight,
            initial=initial,
            updated=state,
            initial_pairing=initial_pairing,
            pairing=pairing,
            verdicts=verdicts(prior.names, prior.prior_sd, np.sqrt(np.diag(covariance))),
            null_directions=null_directions(covariance, prior.prior_sd),
            discrepancy=wide,
            history=history,
            warnings=(
                *pairing.messages(self.modes.frequency_hz, state.frequency_hz),
                *self.at_bound(state.theta),
                *self.far_from_prior(state.theta),
            ),
        )


def _measured_order(state: ForwardState, pairing: Pairing, count: int) -> FloatArray:
    frequencies = np.full(count, np.nan)
    for row, column in pairing.pairs:
        frequencies[row] = state.frequency_hz[column]
    return frequencies
