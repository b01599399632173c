"""What stage 1 gives: the updated elastic parameters with their posterior, and how the fit came to
them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from fecore.arrays import ROUND_OFF, FloatArray
from fecore.correlation import Pairing
from fecore.modal import turn_real
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardState, Partners, partners_of
from fecore.updating.inputs import (
    MESH,
    SHEAR_CORRECTION,
    SystematicEffect,
    by_shear_correction,
    systematic_effects,
)
from fecore.updating.layout import CampaignModel, Layout
from fecore.updating.parameters import Parametrisation
from fecore.updating.posterior import (
    COMMON,
    Identifiability,
    LinearProblem,
    Mixture,
    identifiability,
    null_directions,
    over_sets,
    root,
    spread_over,
    weights_of,
)
from fecore.updating.result import ConvergenceStep, ModeComparison, StartHistory
from fecore.updating.state import Mixing, mixings

REFUTED = 5.0
"""Log evidence by which a pairing must be behind to be ruled out."""

NOISE = "measurement noise"

DISCREPANCY_OF_MODEL = "model discrepancy"

MODEL_OF_JOINTS = "model of the joints"

_NEGLIGIBLE = 1e-6  # weight of a Gaussian in a budget

SAME_SHAPE = 0.8
"""MAC below which two shapes are not taken to be those of one mode."""

HOPELESS_MISS = 0.03
"""Of frequencies, root mean square, from which model and measurement do not belong together."""

BELIEVED = 0.5
"""Weight from which a measured mode is more likely one than none."""


def stacked(pairings: Sequence[Pairing]) -> tuple[slice, ...]:
    """For each campaign, the slice of its paired frequencies in the stacked ones."""
    ends = np.cumsum([0, *(len(pairing.pairs) for pairing in pairings)])
    return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))


def prior_inclusion(layout: Layout, pairings: Sequence[Pairing]) -> tuple[FloatArray, FloatArray]:
    """(n,) P of the paired modes of all campaigns, and (n,) W (`posterior`)."""
    each = [
        (c, [row for row, _ in p.pairs]) for c, p in zip(layout.campaigns, pairings, strict=True)
    ]
    known, width = (
        [getattr(c, name)(rows) for c, rows in each] for name in ("probability", "width")
    )
    return np.concatenate(known), np.concatenate(width)


@dataclass(frozen=True)
class Rival:
    """Another pairing of the modes, at the best point that a start with it came to; or other
    constants with the same pairing.
    """

    other: ElasticResult  # the result there
    evidence: float  # logarithm of how much more the chosen point is supported


@dataclass(frozen=True)
class ElasticResult:
    """Updated elastic parameters, the laboratory's inputs among them, of one campaign or of
    several.
    """

    layout: Layout  # the unknowns, and the campaigns that see them
    # (X,) estimate, as deviations from the prior means in the coordinates in which the posterior is
    # nearly Gaussian
    x: FloatArray
    # initial_states, states: each campaign's model at the prior means and at the estimate
    initial_states: tuple[ForwardState, ...]
    states: tuple[ForwardState, ...]
    # initial_pairings, pairings: measured to model modes of each, before and after
    initial_pairings: tuple[Pairing, ...]
    pairings: tuple[Pairing, ...]
    problem: LinearProblem  # the linear problem at the estimate
    discrepancy: float  # s, the estimated relative model error of a frequency
    scatter: float  # τ, the estimated relative deviation of a specimen's modulus
    history: tuple[ConvergenceStep, ...]  # iterates, first to last
    # every start that was tried, this one among them; empty where there was no choice of starts
    starts: tuple[StartHistory, ...] = ()
    # the best point of each other pairing that a start came to, and other constants with the same
    # pairing, the likest first
    rivals: tuple[Rival, ...] = ()
    # the partners that the fit held in each campaign; None where it paired the modes anew in every
    # turn
    fixed_pairing: tuple[Partners, ...] | None = None
    # campaigns and measured modes, from 0, whose partners changed to and fro in the fit from the
    # prior means
    oscillating_modes: tuple[tuple[int, int], ...] = ()
    # no measured mode was like any of the model's, so the likest were paired, for a comparison
    # alone
    unlike: bool = False
    # where the stiffness has changed, of a body in zones
    damage_intervals: DamageIntervals | None = None

    @cached_property
    def inverse(self) -> FloatArray:
        """(X, X) H⁻¹, the posterior covariance at the estimated discrepancy and scatter."""
        return self.problem.solve(self.discrepancy, self.scatter)[1]

    @cached_property
    def gain(self) -> FloatArray:
        """(X, n) ∂x̂/∂ln f_measured."""
        return self.problem.gain(self.discrepancy, self.scatter)

    @cached_property
    def conditional_posterior(self) -> Mixture:
        """The posterior of x about the estimate, given the partners of the modes and which are
        real, without excursions.
        """
        return self.problem.mixture(self.layout.scatter)[0]

    @cached_property
    def mixture(self) -> Mixture:
        """The same over which of the modes are real (`posterior`)."""
        if self.damage_intervals is not None:
            return self.conditional_posterior
        inclusion = weights_of(
            self.problem, *prior_inclusion(self.layout, self.pairings), self.scatter
        )
        return over_sets(self.problem, inclusion, self.layout.scatter, self.conditional_posterior)

    @cached_property
    def systematic_effects(self) -> tuple[tuple[SystematicEffect, ...], ...]:
        """Of each campaign, inputs that may be something, for what they do, as the frequencies
        leave them.
        """
        effects, unchanged = [], np.zeros(self.problem.residual.size)
        for c, state, pairing, at in zip(
            self.layout.campaigns, self.states, self.pairings, self.rows, strict=True
        ):
            own = list(systematic_effects(state, c.inputs, c.fixed_points))
            for place, each in enumerate(own):
                if each.kind == "one-sided" and each.name != MESH:
                    by = unchanged.copy()
                    shift = each.shift[[column for _, column in pairing.pairs]]
                    # what is linear may go below nothing
                    by[at] = np.log1p(np.maximum(shift, ROUND_OFF - 1))
                    own[place] = each.conditioned(
                        *self.problem.of_another(by, self.discrepancy, self.scatter)
                    )
            effects.append(tuple(own))
        return tuple(effects)

    @property
    def sources(self) -> dict[str, FloatArray]:
        """As `sources_at`, at the estimated discrepancy and scatter."""
        return self.sources_at(self.discrepancy, self.scatter)

    def sources_at(self, discrepancy: float, scatter: float) -> dict[str, FloatArray]:
        """By name of its source, (X, k) independent standard deviations of which the error of x is
        made.

        The estimate is linear in data and prior means, so its error is Gε + Gδ + H⁻¹P(x₀ - x); the
        variances of these parts, the noise's, the discrepancy's and each prior's, add up to H⁻¹.
        """
        gain = self.problem.gain(discrepancy, scatter)
        inverse = self.problem.solve(discrepancy, scatter)[1]
        of_data, of_others = self._roots
        parts = {name: [gain @ each] for name, each in of_data.items()}
        parts[DISCREPANCY_OF_MODEL] = [np.asarray(gain * discrepancy)]
        for name, each in of_others.items():
            parts[name] = [inverse @ each]
        if self.layout.common:
            parts[COMMON] = [inverse @ root(self.layout.coupling(scatter))]
        for place, (unknown, sd) in enumerate(
            zip(self.layout.unknowns, self.layout.sd(scatter), strict=True)
        ):
            parts.setdefault(unknown.source, []).append(inverse[:, [place]] / sd)
        return {name: np.hstack(columns) for name, columns in parts.items()}

    @cached_property
    def _roots(self) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
        """By source, (n, k) roots of the covariance of the frequencies, and (X, k) of the
        information of what is none.
        """
        model_error, by_shear = np.zeros((2, self.problem.residual.size))
        each = zip(self.layout.campaigns, self.states, self.pairings, self.rows, strict=True)
        for campaign, state, pairing, at in each:
            model_error[at] = campaign.model_error
            by_shear[at] = by_shear_correction(state)[[column for _, column in pairing.pairs]]
        known = np.diag(model_error**2) + np.outer(by_shear, by_shear)
        of_data = {NOISE: root(self.problem.noise - known, of=self.problem.noise)}
        if model_error.any():
            of_data[MODEL_OF_JOINTS] = np.diag(model_error)
        if by_shear.any():
            of_data[SHEAR_CORRECTION] = by_shear[:, None]
        return of_data, {name: root(each) for name, each in self.problem.others.items()}

    def variance_by_source(self, along: FloatArray) -> dict[str, float]:
        """By name of its source, variances of an (X,) combination of the unknowns that add up to
        that of `conditional_posterior`.
        """
        variances = dict[str, float]()
        for share, sources, shift in self._made_of:
            for name, part in sources.items():
                variances[name] = variances.get(name, 0.0) + share * float(
                    np.sum((along @ part) ** 2)
                )
            variances[DISCREPANCY_OF_MODEL] += share * float(along @ shift) ** 2
        total = sum(variances.values())
        # Of round-off, and of what was neglected.
        left = float(along @ self.conditional_posterior.total @ along) / total if total else 0.0
        return {name: part * left for name, part in variances.items()}

    @cached_property
    def _made_of(self) -> list[tuple[float, dict[str, FloatArray], FloatArray]]:
        """The Gaussians of `conditional_posterior`: weight, and sources as `sources_at` has them at
        a discrepancy and a scatter of its own, and how far its mean lies from the estimate, which
        is the discrepancy's.
        """
        mixture, scatters = self.problem.mixture(self.layout.scatter)
        kept = np.flatnonzero(mixture.weight > _NEGLIGIBLE)
        known = zip(
            mixture.weight[kept],
            mixture.scale[kept],
            scatters[kept],
            mixture.shift[kept],
            strict=True,
        )
        return [(float(w), self.sources_at(float(s), float(t)), shift) for w, s, t, shift in known]

    @cached_property
    def identifiability(self) -> tuple[Identifiability, ...]:
        """Of each unknown, whichever of the modes are real and whichever partners that are not
        ruled out they have.
        """
        sd = self.layout.marginal_sd(self.scatter)
        known = identifiability(self.layout.labels, self.inverse, sd)
        return spread_over(
            known,
            self.model_averaged_posterior.total
            + np.diag(self.systematic_variance(*self.all_systematic_effects)),
            sd,
        )

    @property
    def has_uncertain_modes(self) -> bool:
        """Whether a measured mode may be none."""
        return self.mixture is not self.conditional_posterior

    @property
    def null_directions(self) -> FloatArray:
        """(d, X) unit vectors, in prior standard deviations, of which the data say next to
        nothing.
        """
        return null_directions(self.inverse, self.layout.marginal_sd(self.scatter))

    @property
    def admissible_rivals(self) -> tuple[Rival, ...]:
        """The rivals that are not ruled out, where there are no shapes to say so, or shapes let
        partners go to and fro.
        """
        if not self.oscillating_modes and all(pairing.mac is not None for pairing in self.pairings):
            return ()
        return tuple(rival for rival in self.rivals if rival.evidence <= REFUTED)

    @cached_property
    def model_averaged_posterior(self) -> Mixture:
        """The posterior of x about the estimate over stretches, or over all pairings that are not
        ruled out.
        """
        if self.damage_intervals is not None:
            return self.damage_intervals.mixture
        if not self.admissible_rivals:
            return self.mixture
        others = [rival.other for rival in self.admissible_rivals]
        share = np.exp([0.0, *(-rival.evidence for rival in self.admissible_rivals)])
        shift = np.array([each.x - self.x for each in (self, *others)])
        return Mixture.joined(
            share / share.sum(), shift, [each.mixture for each in (self, *others)]
        )

    @property
    def rows(self) -> tuple[slice, ...]:
        """For each campaign, the slice of its frequencies in the stacked ones."""
        return stacked(self.pairings)

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals, of modes as far as they are believed."""
        return self.rms_residual(slice(None))

    def rms_residual(self, rows: slice) -> float:
        """The same of some of them, such as one campaign's."""
        weights = self.problem.weights[rows]
        return float(
            np.sqrt(weights @ self.problem.residual[rows] ** 2 / max(weights.sum(), 1e-300))
        )

    def believed(self, number: int) -> Pairing:
        """A campaign's pairing without the measured modes that are more likely none."""
        pairing, weights = self.pairings[number], self.problem.weights[self.rows[number]]
        kept = tuple(
            pair for pair, weight in zip(pairing.pairs, weights, strict=True) if weight >= BELIEVED
        )
        return replace(pairing, pairs=kept)

    @property
    def prior_z_score(self) -> FloatArray:
        """(X,) prior standard deviations between the estimate and the prior means."""
        scores: FloatArray = self.x / self.layout.marginal_sd(max(self.scatter, 1e-12))
        return scores

    @property
    def weights(self) -> tuple[FloatArray, ...]:
        """Of each campaign, of each measured mode whether it is taken for one; 1 without a
        partner.
        """
        weights = [np.ones(len(campaign.modes)) for campaign in self.layout.campaigns]
        for own, pairing, at in zip(weights, self.pairings, self.rows, strict=True):
            own[[row for row, _ in pairing.pairs]] = self.problem.weights[at]
        return tuple(weights)

    @property
    def all_systematic_effects(self) -> tuple[SystematicEffect, ...]:
        """The excursions of all campaigns."""
        return tuple(each for effects in self.systematic_effects for each in effects)

    @cached_property
    def bias_sensitivity(self) -> FloatArray:
        """(X, e) change of x by one standard deviation of each excursion: what the frequencies then
        belong to.
        """
        parts: list[FloatArray] = [np.zeros((self.x.size, 0))]
        for effects, pairing, at in zip(
            self.systematic_effects, self.pairings, self.rows, strict=True
        ):
            columns = [column for _, column in pairing.pairs]
            parts += [-self.gain[:, at] @ each.shift[columns][:, None] for each in effects]
        return np.hstack(parts)

    @cached_property
    def by_mesh(self) -> FloatArray:
        """(X,) mean square of what x may be off by as even the finest mesh misses something."""
        return self.systematic_variance(
            *(each for each in self.all_systematic_effects if each.name == MESH)
        )

    def systematic_variance(self, *chosen: SystematicEffect) -> FloatArray:
        """(X,) mean square of what x may be off by as some of the excursions are something."""
        variance = np.zeros(self.x.size)
        for each, sensitivity in zip(
            self.all_systematic_effects, self.bias_sensitivity.T, strict=True
        ):
            if any(each is one for one in chosen):
                variance += (each.rms * sensitivity) ** 2
        return variance

    @cached_property
    def on_own_mesh(self) -> FloatArray:
        """(X,) change of x if the bodies' own meshes were taken to be right.

        What the constants cannot follow counts as the model's error, as it would: else known inputs
        would have to.
        """
        off = np.zeros(self.problem.residual.size)
        for state, pairing, at in zip(self.states, self.pairings, self.rows, strict=True):
            if state.by_mesh is not None:
                off[at] = np.log1p(state.by_mesh[0][[column for _, column in pairing.pairs]])
        own = replace(self.problem, residual=self.problem.residual - off)
        there, here = (each.at_scatter(self.scatter)[0] for each in (own, self.problem))
        return np.asarray(there.weight @ there.shift - here.weight @ here.shift)

    @property
    def partners(self) -> tuple[Partners, ...]:
        """Who is paired with whom, in each campaign."""
        return tuple(
            partners_of(p, s.kinds) for p, s in zip(self.pairings, self.states, strict=True)
        )

    def compared_modes(
        self,
        number: int,
        modes: MeasuredModes,
        predicted: Callable[[int], float | None] = lambda _: None,
    ) -> tuple[ModeComparison, ...]:
        """A campaign's measured modes beside its model's; `predicted` gives the damping ratio of a
        model's elastic mode.
        """
        pairing, updated = self.pairings[number], self.states[number]
        moved = updated.by_mesh
        first, last = dict(self.initial_pairings[number].pairs), dict(pairing.pairs)
        comparisons = []
        for row, measured in enumerate(map(float, modes.frequency_hz)):
            before, after = first.get(row), last.get(row)
            hz = None if after is None else float(updated.frequency_hz[after])
            initial = (
                None if before is None else float(self.initial_states[number].frequency_hz[before])
            )
            comparisons.append(
                ModeComparison(
                    number=row + 1,
                    kind=None if after is None else updated.kinds[after],
                    measured_hz=measured,
                    initial_hz=initial,
                    updated_hz=hz,
                    error_percent=None if hz is None else 100 * (hz / measured - 1),
                    mac=(
                        None
                        if pairing.mac is None or after is None
                        else float(pairing.mac[row, after])
                    ),
                    measured_damping=_finite(modes.damping_ratio, row),
                    predicted_damping=None if after is None else predicted(after),
                    measured_damping_sd=_finite(modes.damping_sd, row),
                    own_mesh_hz=(
                        None if hz is None or moved is None else hz * float(1 + moved[0][after])
                    ),
                    **({} if after is None else updated.fractions(after)),
                )
            )
        return tuple(comparisons)

    def mixings(
        self, number: int, rows: Sequence[int], columns: Sequence[int], hz: FloatArray
    ) -> tuple[Mixing, ...]:
        """Which of a campaign's (n,) measured modes, with their elastic partners and frequencies,
        may be mixed with others.
        """
        campaign, state = self.layout.campaigns[number], self.states[number]
        chain = campaign.prior.slope(state.theta)[:, None] * campaign.pick
        shapes = campaign.modes.shapes
        seen = (
            None
            if shapes is None or not rows
            else np.array([turn_real(shapes[row]).real for row in rows])
        )
        return mixings(
            state,
            columns,
            hz,
            seen,
            self.discrepancy,
            chain @ self.model_averaged_posterior.total @ chain.T,
        )

    # --- of an update of one campaign

    @property
    def only(self) -> CampaignModel:
        """The one campaign."""
        (only,) = self.layout.campaigns
        return only

    @property
    def prior(self) -> Parametrisation:
        """Its parameters θ, their coordinates and prior."""
        return self.only.prior

    @property
    def theta(self) -> FloatArray:
        """(p,) estimate of θ, SI."""
        return self.updated.theta

    @property
    def initial(self) -> ForwardState:
        """Its model at the prior means."""
        return self.initial_states[0]

    @property
    def updated(self) -> ForwardState:
        """Its model at the estimate."""
        return self.states[0]

    @property
    def pairing(self) -> Pairing:
        """Its measured to model modes at the estimate."""
        return self.pairings[0]

    @cached_property
    def covariance(self) -> FloatArray:
        """(p, p) posterior covariance of θ given the partners, discrepancy included, excursions
        not.
        """
        slope = self.prior.slope(self.theta)
        return self.mixture.total * np.outer(slope, slope)


def _finite(values: FloatArray | None, row: int) -> float | None:
    return float(values[row]) if values is not None and np.isfinite(values[row]) else None


@dataclass(frozen=True)
class DamageIntervals:
    """Which parts of a body have another stiffness, as far as its modes show."""

    lines: FloatArray  # (F + 1,) x of the lines between parts, m
    # (m, F) changes of compliance of the parts, by partition; 0 outside its stretches
    change: FloatArray
    # the posterior of the reported unknowns about their estimate, one Gaussian a partition
    mixture: Mixture

    @property
    def probability(self) -> float:
        """That any stretch has another stiffness."""
        return float(self.mixture.weight @ self.change.any(axis=1))

    def extent(self, probability: float = 0.95) -> tuple[float, float, float, float]:
        """Between which x, m, so much of the change lies, and the least and the greatest length, m,
        that it may be spread over.

        The length of a partition is (∫|δ| dx)²/∫δ² dx, which of one stretch is its own.
        """
        some, long, tail = self.change.any(axis=1), np.diff(self.lines), (1 - probability) / 2
        weight, size = self.mixture.weight[some], np.abs(self.change[some])
        length = (size @ long) ** 2 / (size**2 @ long)
        there = np.concatenate(
            [[0.0], np.cumsum(long * (weight @ (size / (size @ long)[:, None])))]
        )
        begin, end = np.interp([tail, 1 - tail], there / there[-1], self.lines).tolist()
        order = np.argsort(length)
        least, most = np.interp(
            [tail, 1 - tail], np.cumsum(weight[order]) / weight.sum(), length[order]
        ).tolist()
        return begin, end, least, most
