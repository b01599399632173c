"""The estimate of several campaigns: Gauss-Newton on all of them together, modes paired anew as constants move them.

    E(x) = ½ Σ_c r_cᵀ(N_c + s²)⁻¹r_c + ½ xᵀP₀x + ½ Σ_b (y_b - x_b)²/σ_b²,        r_c = ln f_measured - ln f(m_c + P_c x)

with coupons y_b, logarithms of their means over the prior's. Levenberg and Marquardt's method; the discrepancy s follows from
the residuals as in a single update, the scatter τ is the root of its posterior mean, and both are found in turn with the
pairing (Fig. 1 of the source paper, for all campaigns at once).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import Pairing
from fecore.errors import InputError, UpdatingError
from fecore.least_squares import Stopping, minimise
from fecore.updating.campaigns.layout import Campaign, Layout
from fecore.updating.campaigns.posterior import LinearProblem
from fecore.updating.elastic import UNKNOWN_FREQUENCY_SD
from fecore.updating.forward import ForwardState
from fecore.updating.pairing import pair_with
from fecore.updating.posterior import DISCREPANCY, Mixture, discrepancy

_TURNS, _STEPS = 30, 6
_ZIGZAG = 12  # turns after which steps that lower the misfit by next to nothing count as rest
_REST = 1e-4  # posterior standard deviations that an undamped step may still move
_STILL = 1e-3  # of the misfit, that a late turn's steps may lower it and be at rest: 1/22 of a standard deviation
_SAME = 0.01  # relative change of s and τ that changes nothing


@dataclass(frozen=True)
class Coupon:
    """What static tests say of one of the material's constants: a mean with its standard deviation, SI."""

    name: str
    mean: float
    standard_deviation: float


@dataclass(frozen=True)
class Fitted:
    """Where the iteration came to rest.

    Attributes:
        layout: the unknowns.
        x: (X,) estimate.
        initial, states: each campaign's model at the prior means and at the estimate.
        initial_pairings, pairings: of its measured modes.
        problem: the linear problem at the estimate.
        rows: for each campaign, the slice of its frequencies in the stacked ones.
        mixture: the posterior of x about the estimate; scatters: (m,) of its Gaussians.
        spread, scatter: the discrepancy s, and the root of the posterior mean of τ².
        history: cost of each iterate.
    """

    layout: Layout
    x: FloatArray
    initial: tuple[ForwardState, ...]
    states: tuple[ForwardState, ...]
    initial_pairings: tuple[Pairing, ...]
    pairings: tuple[Pairing, ...]
    problem: LinearProblem
    rows: tuple[slice, ...]
    mixture: Mixture
    scatters: FloatArray
    spread: float
    scatter: float
    history: tuple[float, ...]


@dataclass(frozen=True)
class _Point:
    x: FloatArray
    states: tuple[ForwardState, ...]
    problem: LinearProblem
    spread: float
    scatter: float
    cost: float
    descent: FloatArray
    hessian: FloatArray


def fit_campaigns(
    layout: Layout,
    coupons: Sequence[Coupon] = (),
    scatter_scale: float = 0.0,
    progress: Callable[[float], None] = lambda _: None,
) -> Fitted:
    """Find the most probable unknowns of all campaigns.

    Raises:
        InputError: a coupon's constant is not updated.
        UpdatingError: a campaign has no mode that is like one of its model, or the iteration does not come to rest.
    """
    problem = _Problem(layout, _coupon_terms(layout, coupons))
    x: FloatArray = np.zeros(len(layout.unknowns))
    spread, scatter = DISCREPANCY, scatter_scale
    states = initial = problem.solve(x)
    pairings = initial_pairings = problem.pair(states)
    history: list[float] = []
    for turn in range(_TURNS):
        progress(1 - 0.75**turn)

        def move(point: _Point, step: FloatArray, pairings: tuple[Pairing, ...] = pairings) -> _Point | None:
            there = point.x + step
            if not problem.is_believable(there):
                return None
            return problem.at(there, problem.solve(there), pairings, point.spread, point.scatter)

        stopping = Stopping(relative=0.0, absolute=_REST**2 / 2, steps=_STEPS)
        first = problem.at(x, states, pairings, spread, scatter)
        found = minimise(first, move, stopping, lambda _, point: history.append(point.cost))
        point, before = found.point, pairings
        x, states = point.x, point.states
        pairings = problem.pair(states)
        linear = problem.linear(x, states, pairings)
        mixture, scatters = linear.mixture(scatter_scale)
        fitted = linear.informed(spread, scatter)
        fresh = discrepancy(linear.residual, fitted, DISCREPANCY), float(np.sqrt(mixture.weight @ scatters**2))
        same = all(abs(a - b) <= _SAME * b for a, b in zip(fresh, (spread, scatter), strict=True))
        # Where modes veer, steps zigzag about the minimum for ever, each by next to nothing.
        still = turn >= _ZIGZAG and first.cost - point.cost < _STILL
        rests = found.outcome in ("converged", "stuck") or still
        if same and rests and _same(before, pairings):
            progress(1.0)
            return Fitted(
                layout, x, initial, states, initial_pairings, pairings, linear, _rows(pairings), mixture, scatters,
                spread, scatter, tuple(history),
            )  # fmt: skip
        spread, scatter = fresh
    best = dict(zip(layout.shared, map(float, layout.material(x)), strict=True))
    raise UpdatingError(
        f"the update of all campaigns together did not come to rest in {_TURNS} turns; update each by itself to see which one "
        "does not fit, and check geometry, angles and boundaries",
        best,
        tuple(history),
    )


def _same(before: tuple[Pairing, ...], after: tuple[Pairing, ...]) -> bool:
    return all(one.pairs == other.pairs for one, other in zip(before, after, strict=True))


def _rows(pairings: Sequence[Pairing]) -> tuple[slice, ...]:
    ends = np.cumsum([0, *(len(pairing.pairs) for pairing in pairings)])
    return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))


def _coupon_terms(layout: Layout, coupons: Sequence[Coupon]) -> list[tuple[int, float, float]]:
    """Place in x, value and standard deviation of each coupon there."""
    terms, coordinates = [], layout.coordinates[0]
    for index, coupon in enumerate(coupons):
        if coupon.name not in layout.shared:
            raise InputError(
                f"coupons.{index}", f"{coupon.name} is not updated; expected one of {', '.join(layout.shared)}"
            )
        place = layout.shared.index(coupon.name)
        log = bool(coordinates.logarithmic[place])
        value = float(np.log(coupon.mean)) if log else coupon.mean
        sd = coupon.standard_deviation / coupon.mean if log else coupon.standard_deviation
        terms.append((place, value - float(coordinates.mean[place]), sd))
    return terms


@dataclass(frozen=True)
class _Problem:
    layout: Layout
    coupons: list[tuple[int, float, float]]

    def solve(self, x: FloatArray) -> tuple[ForwardState, ...]:
        return tuple(f.solve(self.layout.theta(c, x)) for c, f in enumerate(self.layout.forwards))

    def is_believable(self, x: FloatArray) -> bool:
        return all(
            bool(coordinates.are_believable((coordinates.mean + pick @ x)[None])[0])
            for coordinates, pick in zip(self.layout.coordinates, self.layout.picks, strict=True)
        )

    def pair(self, states: Sequence[ForwardState]) -> tuple[Pairing, ...]:
        found = []
        for campaign, state in zip(self.layout.campaigns, states, strict=True):
            modes = campaign.modes
            pairing = pair_with(modes, state)
            if not pairing.pairs:
                raise UpdatingError(
                    f"no measured mode of campaign {campaign.name} is like any mode of its model; check its boundary, angle, "
                    "grid points and frame",
                    dict(zip(self.layout.shared, map(float, state.theta), strict=False)),
                    (),
                )
            found.append(pairing)
        return tuple(found)

    def linear(self, x: FloatArray, states: Sequence[ForwardState], pairings: Sequence[Pairing]) -> LinearProblem:
        rows = _rows(pairings)
        size, total = x.size, rows[-1].stop
        residual, noise = np.zeros(total), np.zeros((total, total))
        sensitivity = np.zeros((total, size))
        parts = zip(
            self.layout.campaigns, states, pairings, rows, self.layout.coordinates, self.layout.picks, strict=True
        )
        for campaign, state, pairing, at, coordinates, pick in parts:
            measured, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
            residual[at] = np.log(campaign.modes.frequency_hz[measured] / state.frequency_hz[columns])
            noise[at, at] = noise_of(campaign, measured)
            by = state.frequency_jacobian[columns] / state.frequency_hz[columns, None]
            sensitivity[at] = by * coordinates.slope(state.theta) @ pick
        hessian, descent = np.zeros((size, size)), np.zeros(size)
        for place, value, sd in self.coupons:
            hessian[place, place] += sd**-2
            descent[place] += (value - x[place]) / sd**2
        return LinearProblem(
            residual, noise, sensitivity, x, sd=self.layout.sd, other_hessian=hessian, other_descent=descent
        )

    def at(
        self,
        x: FloatArray,
        states: tuple[ForwardState, ...],
        pairings: Sequence[Pairing],
        spread: float,
        scatter: float,
    ) -> _Point:
        linear, precision = self.linear(x, states, pairings), self.layout.sd(scatter) ** -2
        variance = linear.noise + spread**2 * np.eye(linear.residual.size)
        weighted = np.linalg.solve(variance, np.column_stack([linear.sensitivity, linear.residual]))
        cost = float(linear.residual @ weighted[:, -1] + x @ (precision * x))
        cost += sum((value - float(x[place])) ** 2 / sd**2 for place, value, sd in self.coupons)
        return _Point(
            x,
            states,
            linear,
            spread,
            scatter,
            cost=cost / 2,
            descent=linear.sensitivity.T @ weighted[:, -1] + linear.other_descent - precision * x,
            hessian=linear.sensitivity.T @ weighted[:, :-1] + linear.other_hessian + np.diag(precision),
        )


def noise_of(campaign: Campaign, measured: list[int]) -> FloatArray:
    """(n, n) covariance of the logarithms of some of a campaign's measured frequencies by noise."""
    modes = campaign.modes
    if modes.covariance is None:
        return np.eye(len(measured)) * UNKNOWN_FREQUENCY_SD**2
    hz = modes.frequency_hz[measured]
    covariance: FloatArray = modes.covariance[np.ix_(measured, measured)] / np.outer(hz, hz)
    return covariance
