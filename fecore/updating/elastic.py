"""Stage 1: elastic constants from natural frequencies and mode shapes (Eqs. 12-14, Fig. 1), of one
campaign or of several.

The maximum a posteriori estimate of all unknowns x together (`layout`), by Levenberg and
Marquardt's method on the misfit

    E(x) = ½ rᵀ(N + s²)⁻¹r + ½ xᵀP(τ)x + ½ Σ_b (y_b - C_b x)²/σ_b²,     r = ln f_exp - ln f(x),     ∂ln f/∂x analytic,

with the residuals of all campaigns stacked and coupons y_b, logarithms of their means over the
prior's. Measured and model modes are paired anew by MAC as constants move modes past each other,
and weighed by how far they are believed to be modes (`posterior`). The discrepancy s follows
from the residuals, the scatter τ between specimens is the root of its posterior mean. The intervals
are those of the posterior with both marginalised (`posterior`), and reach on to one side where an
input is believed to be nothing but may be something (`systematic_effects`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import Pairing
from fecore.errors import InputError, ModelError, UpdatingError
from fecore.least_squares import Stopping, minimise
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult, prior_inclusion, stacked
from fecore.updating.forward import (
    ForwardState,
    Partners,
    exchanged,
    has_shapes,
    pair_best_match,
    pair_fixed,
    pair_with,
    partners_of,
)
from fecore.updating.inputs import SHEAR_CORRECTION_SD, by_shear_correction, discrepancy_scale
from fecore.updating.layout import CampaignModel, Layout
from fecore.updating.posterior import DISCREPANCY, LinearProblem, weights_of
from fecore.updating.result import ConvergenceStep
from fecore.updating.state import ShapeErrors

_OUTER_ITERATIONS, _STEPS = 30, 6  # pairings and discrepancies that are tried, and steps with each
# iterations after which a fit whose partners change goes round, and steps that gain next to nothing
# are rest
_FINAL_PHASE = 12
_REST = 1e-4  # posterior standard deviations that an undamped step may still move
# of the misfit, that steps of the final phase may lower it and be at rest: 1/22 of a standard
# deviation
_STALLED = 1e-3
_SAME = 0.01  # relative change of discrepancy and scatter that changes nothing
_STANDING = 1e-6  # and that changes no step
_THERE = 0.01  # posterior standard deviations within which an iteration ends where another did


@dataclass(frozen=True)
class Unsettled:
    """A fit that gave no result: why, and where it ended."""

    message: str
    best: Mapping[str, float]  # parameters of the best iterate, SI
    history: tuple[float, ...] = ()  # the misfit of each iterate
    # no measured mode of a campaign is like any mode of its model
    without_partners: bool = False
    # campaigns and measured modes whose partners change to and fro for ever
    oscillating_modes: tuple[tuple[int, int], ...] = ()
    # the partners in every campaign that they change between, each with the x they were found at
    between: tuple[tuple[tuple[Partners, ...], FloatArray], ...] = ()

    @property
    def error(self) -> UpdatingError:
        """What an update that ends with it raises."""
        return UpdatingError(self.message, self.best, self.history)


T = TypeVar("T")


def settled(outcome: T | Unsettled) -> T:
    """The result of a fit.

    Raises:
        UpdatingError: it gave none; it carries the best iterate.
    """
    if isinstance(outcome, Unsettled):
        raise outcome.error
    return outcome


def fit_elastic(
    layout: Layout,
    progress: Callable[[float], None] = lambda _: None,
    *,
    use_shapes: bool = False,
    start: FloatArray | None = None,
    force_best_match: bool = False,
    fixed_pairing: tuple[Partners, ...] | None = None,
) -> ElasticResult | Unsettled:
    """Stage 1 from one start: the most probable unknowns by measured modes (Eqs. 12-14, Fig. 1).

    1. Solve the model at the prior means and at the start, and pair the measured modes with its
       own. The discrepancy s is that of the prior, and every measured mode is believed to be one.
    2. With pairs and scales held, go down the misfit E(x) by at most six of Levenberg and
       Marquardt's steps, each with the model solved and its derivatives ∂ln f/∂x.
    3. Pair the modes anew where these steps end.
    4. Estimate the scales anew there: s from the residuals, the scatter τ between specimens, which
       modes are believed to be modes, and the errors by shear and of shapes. In the final phase all
       but s and τ stay, so that the fit comes to rest.
    5. Where neither pairs nor scales have changed and no step gains anything, this is the estimate.
    6. Else go on from step 2 with the new pairs and scales. Where the final phase ends an iteration
       at a point at which it has ended one before, partners go to and fro and the fit has no
       result; nor has it where no step was taken and the scales stand, as each further iteration
       would be the same, nor after the last iteration.

    Args:
        layout: the unknowns, and the campaigns with their models and modes.
        progress: called with the share of the stage that is done.
        use_shapes: fit realised shapes too; needs modes with shapes.
        start: (X,) x to start from, the prior means by default.
        force_best_match: pair the likest shapes at the prior means, however unlike, and keep these
            pairs.
        fixed_pairing: partners to keep, of each campaign; by default the modes are paired anew in
            every outer iteration.

    Returns:
        The result, or where the fit ended without one.

    Raises:
        InputError: shapes are asked for and there are none, or a coupon's constant is not updated.
        ModelError: the eigenproblem could not be solved.
    """
    if use_shapes and any(campaign.modes.shapes is None for campaign in layout.campaigns):
        raise InputError("use_shapes", "the measured modes have no shapes at points of the model")
    misfit = Misfit(layout, use_shapes, force_best_match, fixed_pairing)
    # 1. Models and pairs at the prior means and at the start.
    scales = _Scales.at_first(layout)
    initial = misfit.paired(np.zeros(len(layout.unknowns)), scales)
    if isinstance(initial, Unsettled):
        return initial
    point = initial if start is None else misfit.paired(start, scales)
    if isinstance(point, Unsettled):
        return point
    path = _Path(layout, progress)
    stopping = Stopping(relative=0.0, absolute=_REST**2 / 2, steps=_STEPS)
    for iteration in range(_OUTER_ITERATIONS):
        path.final_phase = iteration >= _FINAL_PHASE
        # 2. Down the misfit.
        minimum, first = minimise(point, misfit.move, stopping, path.visit), point
        end = minimum.point
        # 3. The modes paired anew.
        pairings = misfit.pair(end.states)
        if lost := misfit.without_partners(end.states, pairings):
            return lost
        point = misfit.at(end.x, end.states, pairings, first.scales)
        path.note_partners(point)
        # 4. The scales anew.
        fresh = misfit.fresh_scales(point, final_phase=path.final_phase)
        # 5. At rest. Steps may zigzag about the minimum, as where modes veer; without shapes a fit
        # creeps to a crossing.
        same = fresh.are_those_of(point.scales) and all(
            a.pairs == b.pairs for a, b in zip(end.pairings, point.pairings, strict=True)
        )
        gained = first.cost - end.cost
        stalled = path.final_phase and layout.by_shapes and gained < _STALLED
        if same and (stalled or minimum.outcome in ("converged", "stuck")):
            progress(1.0)
            return misfit.result(point, initial, tuple(path.history))
        # 6. On from here, unless it goes round.
        point = misfit.at(point.x, point.states, point.pairings, fresh)
        stands = end is first and same and fresh.are_those_of(first.scales, _STANDING)
        if path.final_phase and (path.recurs(point) or stands):
            break
    return path.unsettled(point)


@dataclass(frozen=True)
class _Scales:
    """What each outer iteration estimates anew: discrepancy, scatter, and of each campaign's
    measured modes the weights, and the errors by shear and of shapes.

    Within one modes pass one another, and a partner's share of shear would jump.
    """

    discrepancy: float
    scatter: float
    weights: tuple[FloatArray, ...]
    by_shear: tuple[FloatArray, ...]
    shapes: tuple[ShapeErrors, ...]  # none where shapes are not fitted

    @classmethod
    def at_first(cls, layout: Layout) -> _Scales:
        """Those of the prior: every mode is one, and no error is known yet."""
        weights = tuple(np.ones(len(campaign.modes)) for campaign in layout.campaigns)
        no_shear = tuple(np.zeros(each.size) for each in weights)
        shapes = tuple(ShapeErrors() for _ in weights)
        return cls(DISCREPANCY, layout.scatter, weights, no_shear, shapes)

    def are_those_of(self, other: _Scales, share: float = _SAME) -> bool:
        """Whether they differ by no more than what changes nothing."""
        mine, theirs = (self.discrepancy, self.scatter), (other.discrepancy, other.scatter)
        same = all(abs(new - old) <= share * old for new, old in zip(mine, theirs, strict=True))
        same &= all(a.are_those_of(b) for a, b in zip(self.shapes, other.shapes, strict=True))
        same &= all(
            np.all(np.abs(a - b) <= share) for a, b in zip(self.weights, other.weights, strict=True)
        )
        both = zip(self.by_shear, other.by_shear, strict=True)
        return same and all(np.all(np.abs(a - b) <= share * SHEAR_CORRECTION_SD) for a, b in both)


@dataclass(frozen=True)
class _Point:
    """Solved models with the misfit there, as `minimise` asks for it."""

    states: tuple[ForwardState, ...]
    pairings: tuple[Pairing, ...]
    problem: LinearProblem
    scales: _Scales
    cost: float
    descent: FloatArray
    hessian: FloatArray

    @property
    def x(self) -> FloatArray:
        return self.problem.x

    @cached_property
    def partners(self) -> tuple[Partners, ...]:
        return tuple(
            partners_of(p, state.kinds) for p, state in zip(self.pairings, self.states, strict=True)
        )


@dataclass(frozen=True)
class Misfit:
    """The data of one fit."""

    layout: Layout
    use_shapes: bool = False
    force_best_match: bool = False
    fixed_pairing: tuple[Partners, ...] | None = None

    def paired(self, x: FloatArray, scales: _Scales) -> _Point | Unsettled:
        """The misfit at x, the modes paired there."""
        states = self.layout.solved(x)
        pairings = self.pair(states)
        return self.without_partners(states, pairings) or self.at(x, states, pairings, scales)

    def pair(self, states: Sequence[ForwardState]) -> tuple[Pairing, ...]:
        """The pairing of each campaign's modes with those of its solved model."""
        return tuple(
            self._pair(number, campaign.modes, state)
            for number, (campaign, state) in enumerate(
                zip(self.layout.campaigns, states, strict=True)
            )
        )

    def _pair(self, number: int, modes: MeasuredModes, state: ForwardState) -> Pairing:
        if self.force_best_match:
            return replace(self._best_match[number], mac=pair_best_match(modes, state).mac)
        if self.fixed_pairing is None:
            return pair_with(modes, state)
        return pair_fixed(modes, state, self.fixed_pairing[number])

    def partners(self, states: Sequence[ForwardState]) -> tuple[Pairing, ...]:
        """The same.

        Raises:
            UpdatingError: no measured mode of a campaign has a partner.
        """
        pairings = self.pair(states)
        if lost := self.without_partners(states, pairings):
            raise lost.error
        return pairings

    def without_partners(
        self, states: Sequence[ForwardState], pairings: Sequence[Pairing]
    ) -> Unsettled | None:
        """The end of a fit in which no measured mode of a campaign has a partner; None where each
        has one.
        """
        for campaign, state, pairing in zip(self.layout.campaigns, states, pairings, strict=True):
            if not pairing.pairs:
                return _without_partners(self.layout, campaign, state)
        return None

    @cached_property
    def _best_match(self) -> tuple[Pairing, ...]:
        return tuple(
            pair_best_match(c.modes, c.forward.solve(c.prior.prior_mean))
            for c in self.layout.campaigns
        )

    def at(
        self,
        x: FloatArray,
        states: tuple[ForwardState, ...],
        pairings: tuple[Pairing, ...],
        scales: _Scales,
    ) -> _Point:
        """The misfit at solved models, for pairings, a discrepancy, a scatter and the modes'
        weights.
        """
        problem = self.linear(x, states, pairings, scales.weights, scales.shapes, scales.by_shear)
        return _Point(
            states, pairings, problem, scales, *problem.at(scales.discrepancy, scales.scatter)
        )

    def linear(
        self,
        x: FloatArray,
        states: Sequence[ForwardState],
        pairings: Sequence[Pairing],
        weights: Sequence[FloatArray],
        shapes: Sequence[ShapeErrors],
        by_shear: Sequence[FloatArray],
    ) -> LinearProblem:
        """The problem that is linear in the step from x."""
        rows = stacked(pairings)
        size, total = x.size, rows[-1].stop
        residual = np.zeros(total)
        noise = np.zeros((total, total))
        sensitivity = np.zeros((total, size))
        weight, shear = (
            np.concatenate(
                [each[[row for row, _ in p.pairs]] for each, p in zip(some, pairings, strict=True)]
            )
            for some in (weights, by_shear)
        )
        residuals: list[FloatArray] = [np.zeros(0)]
        by: list[FloatArray] = [np.zeros((0, size))]
        for campaign, state, pairing, at, errors in zip(
            self.layout.campaigns, states, pairings, rows, shapes, strict=True
        ):
            measured, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
            chain = campaign.prior.slope(state.theta)[:, None] * campaign.pick
            residual[at] = np.log(
                campaign.modes.frequency_hz[measured] / state.frequency_hz[columns]
            )
            noise[at, at] = campaign.noise(measured)
            sensitivity[at] = (
                state.frequency_jacobian[columns] / state.frequency_hz[columns, None] @ chain
            )
            if self.use_shapes:
                off, of_theta = errors.residual(campaign.modes, state, pairing, np.sqrt(weight[at]))
                residuals.append(off)
                by.append(of_theta @ chain)
        J, m = np.vstack(by), np.concatenate(residuals)
        descent: FloatArray = J.T @ m
        others: dict[str, FloatArray] = {"mode shapes": J.T @ J} if self.use_shapes else {}
        cost = float(m @ m)
        if self.layout.coupons:
            combinations, values, sds = self.layout.of_coupons
            C, off = combinations / sds[:, None], (values - combinations @ x) / sds
            others["coupons"] = C.T @ C
            descent, cost = descent + C.T @ off, cost + float(off @ off)
        known = (
            residual,
            noise + np.outer(shear, shear),
            sensitivity,
            x,
            self.layout.precision,
            others,
        )
        scale = max(discrepancy_scale(c.forward.specimen, c.inputs) for c in self.layout.campaigns)
        return LinearProblem(
            *known, other_descent=descent, other_cost=cost / 2, weight=weight, scale=scale
        )

    def by_shear(
        self, states: Sequence[ForwardState], pairings: Sequence[Pairing]
    ) -> tuple[FloatArray, ...]:
        """Of each campaign's measured modes, what the shear correction may miss of their partners;
        0 without one.
        """
        errors = tuple(np.zeros(len(campaign.modes)) for campaign in self.layout.campaigns)
        for own, state, pairing in zip(errors, states, pairings, strict=True):
            rows, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
            own[rows] = by_shear_correction(state)[columns]
        return errors

    def move(self, point: _Point, step: FloatArray) -> _Point | None:
        """The point that a step leads to; None where no specimen could be, the model is none, or a
        held partner is lost.
        """
        x = point.x + step
        if not self.layout.are_believable(x):
            return None
        try:
            states = self.layout.solved(x)
        except ModelError:  # as where what a mesh misses is extrapolated too far
            return None
        pairings = point.pairings
        if self.fixed_pairing is not None:
            pairings = self.pair(states)
            if any(
                len(a.pairs) < len(b.pairs) for a, b in zip(pairings, point.pairings, strict=True)
            ):
                return None  # a partner rose above the modes that were solved for
        return self.at(x, states, pairings, point.scales)

    def fresh_scales(self, point: _Point, *, final_phase: bool) -> _Scales:
        """All scales as they are at a point; in the final phase weights and errors of shapes stay,
        so that the fit comes to rest.
        """
        problem, old = point.problem, point.scales
        discrepancy, scatter = problem.discrepancy(old.discrepancy, old.scatter), 0.0
        if self.layout.scatter:
            mixture, scatters = problem.mixture(self.layout.scatter)
            scatter = float(np.sqrt(mixture.weight @ scatters**2))
        if final_phase:
            return _Scales(discrepancy, scatter, old.weights, old.by_shear, old.shapes)
        inclusion = weights_of(problem, *prior_inclusion(self.layout, point.pairings), old.scatter)
        likeliest, weights = np.round(inclusion), [np.ones(each.size) for each in old.weights]
        for own, pairing, at in zip(weights, point.pairings, stacked(point.pairings), strict=True):
            own[[row for row, _ in pairing.pairs]] = likeliest[at]
        by_shear = self.by_shear(point.states, point.pairings)
        shapes = self.shape_errors(point.states, point.pairings, discrepancy)
        return _Scales(discrepancy, scatter, tuple(weights), by_shear, shapes)

    def shape_errors(
        self, states: Sequence[ForwardState], pairings: Sequence[Pairing], discrepancy: float
    ) -> tuple[ShapeErrors, ...]:
        """Of each campaign, the errors of the paired modes' shapes at a discrepancy of the
        frequencies.
        """
        if not self.use_shapes:
            return tuple(ShapeErrors() for _ in self.layout.campaigns)
        campaigns = zip(self.layout.campaigns, states, pairings, strict=True)
        return tuple(
            ShapeErrors.of(campaign.modes, state, pairing, discrepancy)
            for campaign, state, pairing in campaigns
        )

    def result(
        self, point: _Point, initial: _Point, history: tuple[ConvergenceStep, ...]
    ) -> ElasticResult:
        """The result at the point of rest."""
        return ElasticResult(
            layout=self.layout,
            x=point.x,
            initial_states=initial.states,
            states=point.states,
            initial_pairings=initial.pairings,
            pairings=point.pairings,
            problem=point.problem,
            discrepancy=point.scales.discrepancy,
            scatter=point.scales.scatter,
            history=history,
            fixed_pairing=self.fixed_pairing,
            unlike=self.force_best_match,
        )


@dataclass
class _Path:
    """How a fit goes: its iterates, and the partners that modes have in its final phase."""

    layout: Layout
    progress: Callable[[float], None]
    final_phase: bool = False
    visited: int = 0
    history: list[ConvergenceStep] = field(default_factory=list)
    between: dict[tuple[Partners, ...], FloatArray] = field(default_factory=dict)
    _last: FloatArray | None = None
    # of iterations of the final phase
    _ends: list[tuple[tuple[Partners, ...], FloatArray]] = field(default_factory=list)

    def visit(self, _: int, point: _Point) -> None:
        """Note an iterate."""
        self.note_partners(point)  # modes may cross within an iteration too
        self.progress(1 - 0.7**self.visited)
        self.visited += 1
        if self._last is not point.x:
            self._last = point.x
            # NaN: without a partner
            hz = [np.full(len(campaign.modes), np.nan) for campaign in self.layout.campaigns]
            for own, state, pairing in zip(hz, point.states, point.pairings, strict=True):
                for row, column in pairing.pairs:
                    own[row] = state.frequency_hz[column]
            self.history.append(
                ConvergenceStep(self.layout.parameters(point.x), np.concatenate(hz), point.cost)
            )

    def note_partners(self, point: _Point) -> None:
        """Note who is paired with whom, where the fit should have come to rest by then."""
        if self.final_phase:
            self.between.setdefault(point.partners, point.x)

    def recurs(self, point: _Point) -> bool:
        """Whether an iteration of the final phase ends where one before the last did, and the last
        did not: then it goes round for ever.
        """
        there = [
            partners == point.partners
            and (point.x - x) @ point.hessian @ (point.x - x) <= _THERE**2
            for partners, x in self._ends
        ]
        self._ends.append((point.partners, point.x))
        return any(there) and not there[-1]

    def unsettled(self, point: _Point) -> Unsettled:
        """The end of a fit that goes on for ever."""
        between = dict(self.between)
        for number, campaign in enumerate(self.layout.campaigns):
            # At a crossing a fit creeps along the lower of two modes, and pairs with that one
            # alone.
            if not has_shapes(campaign.modes):
                for other in exchanged(point.pairings[number], point.states[number].kinds):
                    between[*point.partners[:number], other, *point.partners[number + 1 :]] = (
                        point.x
                    )
        seen = [
            {(c, *each) for c, own in enumerate(partners) for each in own} for partners in between
        ]
        everywhere = seen[0].intersection(*seen)
        oscillating = {(c, row) for one in seen for c, row, *_ in one - everywhere}
        return Unsettled(
            _nonconvergence_message(self.layout, oscillating),
            best=self.layout.parameters(point.x),
            history=tuple(iterate.cost for iterate in self.history),
            oscillating_modes=tuple(sorted(oscillating)),
            between=tuple(between.items()) if oscillating else (),
        )


def _without_partners(layout: Layout, campaign: CampaignModel, state: ForwardState) -> Unsettled:
    """The end of a fit at parameters at which no measured mode of a campaign has a partner."""
    message = (
        "no measured mode is like any mode of the model; check the boundary, the grid points and"
        " the frame"
    )
    if campaign.name:
        message = (
            f"no measured mode of campaign {campaign.name} is like any mode of its model; check its"
            " boundary, angle, grid points and frame"
        )
    names = layout.shared if campaign.name else campaign.prior.names
    best = dict(zip(names, map(float, state.theta), strict=False))
    return Unsettled(message, best, without_partners=True)


def _nonconvergence_message(layout: Layout, oscillating: set[tuple[int, int]]) -> str:
    """Why an iteration goes on for ever, and what to do, in words; `oscillating` are the modes
    whose partner changed.
    """
    message = "the elastic update did not converge; "
    if oscillating:
        which = ", ".join(
            layout.campaigns[number].named(row) for number, row in sorted(oscillating)
        )
        return (
            message
            + f"the partner of measured mode {which} changes to and fro, as modes of the model mix"
            " there or the points cannot distinguish them: leave it out of the mode set, measure"
            " at more points, or check boundary and geometry"
        )
    if len(layout.campaigns) > 1:
        message += "update each campaign by itself to see which one does not fit; "
    return message + "check geometry, density, boundary and priors"
