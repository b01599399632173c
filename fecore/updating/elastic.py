"""Stage 1: elastic constants from natural frequencies and mode shapes (Eqs. 12-14, Fig. 1).

The maximum a posteriori estimate in the coordinates ξ of `coordinates`, parameters and inputs together, by Levenberg and
Marquardt's method on the misfit

    E(ξ) = ½ rᵀ(C_noise + s² 1)⁻¹ r + ½ (ξ - ξ₀)ᵀC_p⁻¹(ξ - ξ₀),     r = ln f_exp - ln f(ξ),     S = ∂ln f/∂ξ analytic.

Measured and model modes are paired anew by MAC as constants move modes past each other, and the discrepancy s is the root of
its posterior mean. The intervals are those of the posterior with s marginalised (`posterior`), and reach on to one side where
an input is believed to be nothing but may be something (`excursions`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import Pairing
from fecore.errors import InputError, UpdatingError
from fecore.least_squares import Stopping, minimise
from fecore.modal import turn_real
from fecore.modes import MeasuredModes
from fecore.updating.coordinates import Coordinates
from fecore.updating.elastic_result import ElasticIterate, ElasticResult
from fecore.updating.excursions import Excursion
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.pairing import Partners, exchanged, has_shapes, pair_held, pair_likest, pair_with, partners_of
from fecore.updating.parameters import by_name
from fecore.updating.posterior import (
    DISCREPANCY,
    discrepancy,
    identifiability,
    marginalise,
    null_directions,
)

SHAPE_DISCREPANCY = 0.01
"""Standard deviation of a measured shape about the model's at a point, as a share of the shape's largest entry."""

UNKNOWN_FREQUENCY_SD = 0.0002  # a typed-in frequency is taken to be this sure, as a share of it
_TURNS, _STEPS = 30, 6  # pairings and discrepancies that are tried, and steps with each
_SWINGING = 12  # turns after which a fit that is not at rest swings
_REST = 1e-4  # posterior standard deviations that an undamped step may still move
_SAME_DISCREPANCY = 0.01  # relative change that changes nothing


class NoPartnersError(UpdatingError):
    """No measured mode is like any mode of the model."""


class SwingingError(UpdatingError):
    """The partners of modes change to and fro for ever.

    Attributes:
        torn: measured modes whose partners change.
        between: the pairings, each with the parameters that it was found at.
    """

    torn: tuple[int, ...] = ()
    between: tuple[tuple[Partners, FloatArray], ...] = ()


def update_elastic(
    forward: ForwardModel,
    modes: MeasuredModes,
    progress: Callable[[float], None] = lambda _: None,
    *,
    use_shapes: bool = False,
    start: FloatArray | None = None,
    seek_excursions: Callable[[ForwardState], tuple[Excursion, ...]] = lambda _: (),
    likest: bool = False,
    held: Partners | None = None,
) -> ElasticResult:
    """Estimate the parameters from measured modes.

    Args:
        forward: the model; its first points are those of the modes' shapes, in their order.
        modes: measured modes; without shapes they are paired by frequency.
        progress: called with the share of the stage that is done.
        use_shapes: fit realised shapes too; needs modes with shapes.
        start: (p,) θ to start from, the prior means by default.
        seek_excursions: what inputs may do that are believed to be nothing, at the updated model.
        likest: pair the likest shapes at the prior means, however unlike, and keep these pairs.
        held: partners to keep; by default the modes are paired anew in every turn.

    Raises:
        InputError: shapes are asked for and there are none.
        NoPartnersError: no mode could be paired.
        SwingingError: the partners of modes change to and fro.
        UpdatingError: the iteration did not converge; it carries the best iterate.
        ModelError: the eigenproblem could not be solved.
    """
    if use_shapes and modes.shapes is None:
        raise InputError("use_shapes", "the measured modes have no shapes at points of the model")
    fit = _Fit(forward, modes, use_shapes, likest, held)
    prior_mean = forward.parametrisation.prior_mean
    initial = forward.solve(prior_mean)
    initial_pairing = fit.pair(initial)
    state = initial if start is None else forward.solve(start)
    pairing, spread = fit.pair(state), DISCREPANCY
    history: list[ElasticIterate] = []
    between: dict[Partners, FloatArray] = {}
    visited = turn = 0

    def visit(_: int, point: _Point) -> None:
        nonlocal visited
        if turn >= _SWINGING:  # modes may cross within a turn too
            between.setdefault(partners_of(point.pairing, point.state.kinds), point.state.theta)
        progress(1 - 0.7**visited)
        visited += 1
        if not history or point.state.theta is not history[-1].theta:
            frequencies = _measured_order(point.state, point.pairing, len(modes))
            history.append(ElasticIterate(point.state.theta, frequencies, point.cost))

    for turn in range(_TURNS):
        stopping = Stopping(relative=0.0, absolute=_REST**2 / 2, steps=_STEPS)
        found = minimise(fit.at(state, pairing, spread), fit.move, stopping, visit)
        state, before = found.point.state, found.point.pairing
        pairing = fit.pair(state)
        if turn >= _SWINGING:
            between.setdefault(partners_of(pairing, state.kinds), state.theta)
        fresh = discrepancy(*fit.relative_residual(fit.at(state, pairing, spread)), DISCREPANCY)
        settled = abs(fresh / spread - 1) < _SAME_DISCREPANCY and before.pairs == pairing.pairs
        if settled and found.outcome in ("converged", "stuck"):
            point = fit.at(state, pairing, spread)
            return fit.finish(point, initial, initial_pairing, tuple(history), seek_excursions(state))
        spread = fresh
    if not has_shapes(modes):  # at a crossing a fit creeps along the lower of two modes, and pairs with that one alone
        between |= dict.fromkeys(exchanged(pairing, state.kinds), state.theta)
    in_all = set.intersection(*(set(partners) for partners in between))
    torn = {row for partners in between for row, *_ in set(partners) - in_all}
    error = SwingingError if torn else UpdatingError
    raised = error(
        fit.without_rest(torn),
        best=by_name(forward.parametrisation.names, state.theta),
        history=tuple(iterate.cost for iterate in history),
    )
    if isinstance(raised, SwingingError):
        raised.torn, raised.between = tuple(sorted(torn)), tuple(between.items())
    raise raised


@dataclass(frozen=True)
class _Point:
    """A solved model with the misfit there, as `minimise` asks for it."""

    state: ForwardState
    pairing: Pairing
    spread: float
    residual: FloatArray
    sensitivity: FloatArray
    weight: FloatArray
    cost: float
    descent: FloatArray
    hessian: FloatArray


@dataclass(frozen=True)
class _Fit:
    """The data of one elastic update."""

    forward: ForwardModel
    modes: MeasuredModes
    use_shapes: bool = False
    likest: bool = False
    held: Partners | None = None

    @cached_property
    def coordinates(self) -> Coordinates:
        return Coordinates(self.forward.parametrisation)

    def pair(self, state: ForwardState) -> Pairing:
        if self.likest:
            return replace(self._likest, mac=pair_likest(self.modes, state).mac)
        pairing = pair_with(self.modes, state) if self.held is None else pair_held(self.modes, state, self.held)
        if not pairing.pairs:
            raise NoPartnersError(
                "no measured mode is like any mode of the model; check the boundary, the grid points and the frame",
                best=by_name(self.forward.parametrisation.names, state.theta),
                history=(),
            )
        return pairing

    @cached_property
    def _likest(self) -> Pairing:
        return pair_likest(self.modes, self.forward.solve(self.forward.parametrisation.prior_mean))

    def noise(self, rows: list[int]) -> FloatArray:
        """(n, n) covariance of the logarithms of the paired measured frequencies by noise."""
        if self.modes.covariance is None:
            return np.eye(len(rows)) * UNKNOWN_FREQUENCY_SD**2
        hz = self.modes.frequency_hz[rows]
        return self.modes.covariance[np.ix_(rows, rows)] / np.outer(hz, hz)

    def at(self, state: ForwardState, pairing: Pairing, spread: float) -> _Point:
        """The misfit at a solved model, for a pairing and a discrepancy."""
        rows, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
        coordinates = self.coordinates
        weight = np.linalg.inv(self.noise(rows) + spread**2 * np.eye(len(rows)))
        residual = np.log(self.modes.frequency_hz[rows] / state.frequency_hz[columns])
        slope = coordinates.slope(state.theta)
        S = state.frequency_jacobian[columns] / state.frequency_hz[columns, None] * slope
        away = (coordinates.of(state.theta) - coordinates.mean) / coordinates.sd
        missed, by = self.shape_residual(state, pairing)
        by = by * slope
        return _Point(
            state,
            pairing,
            spread,
            residual,
            S,
            weight,
            cost=float(residual @ weight @ residual + away @ away + missed @ missed) / 2,
            descent=S.T @ weight @ residual - away / coordinates.sd + by.T @ missed,
            hessian=S.T @ weight @ S + np.diag(coordinates.sd**-2) + by.T @ by,
        )

    def move(self, point: _Point, step: FloatArray) -> _Point | None:
        """The point that a step in the coordinates leads to; None where no specimen could be, or a held partner is lost."""
        xi = self.coordinates.of(point.state.theta) + step
        if not self.coordinates.are_believable(xi[None])[0]:
            return None
        state, pairing = self.forward.solve(self.coordinates.values(xi)), point.pairing
        if self.held is not None:
            pairing = self.pair(state)
            if len(pairing.pairs) < len(point.pairing.pairs):  # a partner rose above the modes that were solved for
                return None
        return self.at(state, pairing, point.spread)

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

    def relative_residual(self, point: _Point) -> tuple[FloatArray, float]:
        """Residuals as shares of the frequencies, and how many parameters they determine: tr(H⁻¹ SᵀWS)."""
        informed = point.sensitivity.T @ point.weight @ point.sensitivity
        return point.residual, float(np.trace(np.linalg.solve(point.hessian, informed)))

    def without_rest(self, torn: set[int]) -> str:
        """Why an iteration goes on for ever, and what to do, in words; `torn` are the modes whose partner changed."""
        said = f"the elastic update did not converge in {_TURNS} turns of {_STEPS} steps; "
        if not torn:
            return said + "check geometry, density, boundary and priors"
        which = ", ".join(f"{row + 1} ({self.modes.frequency_hz[row]:.2f} Hz)" for row in sorted(torn))
        return said + (
            f"the partner of measured mode {which} changes to and fro, as modes of the model mix there or the points "
            "cannot distinguish them: leave it out of the mode set, measure at more points, or check boundary and geometry"
        )

    def finish(
        self,
        point: _Point,
        initial: ForwardState,
        initial_pairing: Pairing,
        history: tuple[ElasticIterate, ...],
        excursions: tuple[Excursion, ...],
    ) -> ElasticResult:
        """The result, with what its error is made of.

        The estimate is linear in data and prior means, so its error is Gε + H⁻¹C_p⁻¹(ξ₀ - ξ) with G = H⁻¹SᵀW; the variances of
        these parts, the noise's, the discrepancy's and each prior's, add up to H⁻¹.
        """
        state, pairing, coordinates = point.state, point.pairing, self.coordinates
        rows = [row for row, _ in pairing.pairs]
        noise = self.noise(rows)
        of_data = point.sensitivity.T @ point.weight @ point.sensitivity
        mixture = marginalise(
            point.residual,
            noise,
            point.sensitivity,
            point.hessian - of_data,
            point.descent - point.sensitivity.T @ point.weight @ point.residual,
        )
        inverse = np.linalg.inv(point.hessian)
        gain = inverse @ point.sensitivity.T @ point.weight
        slope = coordinates.slope(state.theta)
        prior, names = self.forward.parametrisation, self.forward.parametrisation.names
        sources = {"measurement noise": gain @ _root(noise), "model discrepancy": gain * point.spread}
        for column, name in enumerate(names):
            what = name if name not in prior.reported else f"prior of {name}"
            sources[what] = inverse[:, [column]] / coordinates.sd[column]
        return ElasticResult(
            theta=state.theta,
            coordinates=coordinates,
            mixture=mixture,
            sources=sources,
            covariance=mixture.total * np.outer(slope, slope),
            noise_covariance=(gain @ noise @ gain.T) * np.outer(slope, slope),
            excursions=excursions,
            sensitivity=point.sensitivity,
            gain=gain,
            measured_log=np.log(self.modes.frequency_hz[rows]),
            noise=noise,
            initial=initial,
            updated=state,
            initial_pairing=initial_pairing,
            pairing=pairing,
            identifiability=identifiability(names, inverse, coordinates.sd),
            null_directions=null_directions(inverse, coordinates.sd),
            discrepancy=point.spread,
            residual=point.residual,
            history=history,
            held=self.held,
            unlike=self.likest,
        )


def _root(covariance: FloatArray) -> FloatArray:
    """R with RRᵀ = a covariance that may be singular."""
    value, vectors = np.linalg.eigh(covariance)
    root: FloatArray = vectors * np.sqrt(np.maximum(value, 0))
    return root


def _measured_order(state: ForwardState, pairing: Pairing, count: int) -> FloatArray:
    frequencies = np.full(count, np.nan)
    for row, column in pairing.pairs:
        frequencies[row] = state.frequency_hz[column]
    return frequencies
