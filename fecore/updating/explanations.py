"""What may be added to a body, compared by the evidence of all its data: each fitted anew, at
finite size.

For a mass or a foot at each of some places, and a support that gives way along or about each of its
axes or all of them, the
unknowns and the sizes are fitted together, the modes paired by the altered shapes, from several
sizes: the linearised evidence (`LinearProblem.log_evidence`) chooses the starts. The evidence of a
fit is that of its frequencies,

    ln p(f) = ln ∫ p(f | x, s) p(x) p(s) dx ds + Σ ln P + Σ_none ln (1 - P)/W + Σ_alone ln (πP + 1 -
    P)/W

with the terms of `posterior` for modes that are none, or have no partner; that of a place is
shared by all that were tried. Shapes say whether a model is the body's where frequencies hardly do,
as of a soft root and a mass at the tip (`of_shapes`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import Pairing, most_alike
from fecore.errors import ModelError
from fecore.quantities import CLAMP
from fecore.updating import suspects
from fecore.updating.additions import (
    SIZE_SD,
    Addition,
    AdditionScreening,
    AlteredForward,
    Effect,
    Kind,
    effect_of,
    screened,
)
from fecore.updating.elastic import Misfit, Unsettled, fit_elastic
from fecore.updating.elastic_result import ElasticResult, prior_inclusion
from fecore.updating.forward import ForwardState
from fecore.updating.inputs import TOLERANCES
from fecore.updating.layout import CampaignModel, Layout, Unknown
from fecore.updating.posterior import DISCREPANCY, FAR_OFF, LinearProblem, Mixture
from fecore.updating.suspects import SupportCompliance, likeness, of_shapes

_STARTS = (3.0, 1.0, -1.0, -3.0, -5.0)  # logarithms of sizes over their medians to start from
_SIZES = (3.0, 30.0, 300.0)  # over usual ones, at which places are compared
# of masses and of feet: the likeliest by screening, and those of them that are fitted
_SCREENED, _PLACES = 6, 2
_AGREES = 2.0  # ratio of sizes by screening and by the fit, within which screening there is trusted
_FIRM = 4.0  # logarithm of the stiffness over its median, of supports beside the one that gives way


@dataclass(frozen=True)
class Explanation:
    """Additions to one body, with the update that has them."""

    additions: tuple[Addition, ...]
    result: ElasticResult
    evidence: float  # logarithm of how much likelier the data are with them
    # size and its standard deviation, SI, wherever a mass or a foot is
    over_places: tuple[float, float] | None = None

    @property
    def sizes(self) -> list[tuple[Addition, float, float]]:
        """The additions with their sizes and these' standard deviations, SI, that the data
        determine.
        """
        if self.over_places is not None:
            return [(self.additions[0], *self.over_places)]
        count, total = len(self.additions), np.diag(self.result.mixture.total)
        sd, x = np.sqrt(total[-count:]), self.result.x[-count:]
        sizes = [
            (a, float(a.median * np.exp(xi)), float(s))
            for a, xi, s in zip(self.additions, x, sd, strict=True)
        ]
        known = [each for each in sizes if each[2] < SIZE_SD / 2] or sizes
        return [(a, size, size * s) for a, size, s in known]


def log_evidence(result: ElasticResult) -> float:
    """Ln p(f) of an update (module docstring), up to a constant that all updates of the same modes
    share.
    """
    layout, weights = result.layout, result.problem.weights
    return _log_evidence(layout, result.pairings, result.problem, weights)


def _log_evidence(
    layout: Layout, pairings: Sequence[Pairing], problem: LinearProblem, weights: FloatArray
) -> float:
    known, width = prior_inclusion(layout, pairings)
    with np.errstate(divide="ignore"):
        of_modes = np.where(weights > 0.5, np.log(known), np.log((1 - known) / width))
    of_unpaired = 0.0
    for campaign, pairing in zip(layout.campaigns, pairings, strict=True):
        left = list(pairing.unpaired_measured)
        p = campaign.probability(left)
        of_unpaired += float(np.sum(np.log((FAR_OFF * p + 1 - p) / campaign.width(left))))
    fitted = problem.log_evidence(layout.scatter) - float(weights.sum()) / 2 * np.log(2 * np.pi)
    return float(
        fitted
        + of_modes.sum()
        + of_unpaired
        + sum(_of_shapes(c, p) for c, p in zip(layout.campaigns, pairings, strict=True))
    )


def _of_shapes(campaign: CampaignModel, pairing: Pairing) -> float:
    """The part of a campaign's shapes in the log evidence; 0 where they say nothing."""
    if pairing.mac is None:
        return 0.0
    alike = likeness(pairing)
    return float(of_shapes(campaign.probability(range(alike.size)), alike))


@dataclass(frozen=True)
class Search:
    """Fits of one update with additions to one of its bodies."""

    elastic: ElasticResult
    number: int
    without: float  # log evidence
    use_shapes: bool
    known: dict[tuple[str, bytes], ForwardState] = field(default_factory=dict)  # solved models
    # that were tried
    supports: dict[tuple[str, ...], Explanation | None] = field(default_factory=dict)

    @classmethod
    def of(cls, elastic: ElasticResult, number: int) -> Search:
        """Of a campaign's body."""
        layout = elastic.layout.with_unverified_basis()
        campaigns = list(layout.campaigns)
        campaigns[number] = replace(campaigns[number], forward=campaigns[number].forward.on_basis())
        plain = replace(elastic, layout=replace(layout, campaigns=tuple(campaigns)))
        return cls(plain, number, log_evidence(elastic), "mode shapes" in elastic.problem.others)

    def best(self, hints: Hints) -> list[Explanation]:
        """The best explanation of each kind by an addition to the body, with what screening makes
        of these.
        """
        explanations = [self.of_supports(hints["support"][0])] if "support" in hints else []
        explanations += [self.of_places(*hint) for kind, hint in hints.items() if kind != "support"]
        return [each for each in explanations if each is not None]

    def of_supports(self, supports: Sequence[Addition]) -> Explanation | None:
        """The support that gives way along or about one axis, or all of them."""
        key = tuple(each.name for each in supports)
        if key not in self.supports:
            self.supports[key] = self._of_supports(supports)
        return self.supports[key]

    def _of_supports(self, supports: Sequence[Addition]) -> Explanation | None:
        choices = [[each] for each in supports]
        price = float(np.log(len(choices) + (len(choices) > 1)))
        ones = sorted(filter(None, map(self.fitted, choices)), key=lambda each: -each.evidence)
        if ones and len(choices) > 1:
            (first,) = ones[0].additions
            others = [each for each in supports if each.name != first.name]
            started = [
                np.concatenate([ones[0].result.x, np.full(len(others), size)])
                for size in (_FIRM, 0.0)
            ]
            ones += filter(
                None,
                [self.fitted([first, *others], [*started, *self._starts(len(supports))], most=2)],
            )
        best = max(ones, key=lambda each: each.evidence, default=None)
        return None if best is None else replace(best, evidence=best.evidence - price)

    def of_places(
        self, additions: Sequence[Addition], hint: AdditionScreening
    ) -> Explanation | None:
        """An addition at the likeliest of some places: those by screening, and those by screening
        again at the best fit.
        """
        likely = dict.fromkeys([place for place, each in enumerate(additions) if each.along_an_end])
        likely |= dict.fromkeys(np.argsort(-hint.share)[:_SCREENED].tolist())
        order = sorted(likely, key=lambda place: -self.promise([additions[place]]))[:_PLACES]
        tried = {
            place: explanation
            for place in order
            if (explanation := self.fitted([additions[place]])) is not None
        }
        if not tried:
            return None
        for _ in range(3):  # screening places again at the best fit
            best = max(tried, key=lambda place: tried[place].evidence)
            there = self._screened_at(additions, tried[best].result)
            likeliest = int(np.argmax(there.share))
            if (
                likeliest in tried
                or (more := self.fitted([additions[likeliest]], [tried[best].result.x])) is None
            ):
                break
            tried[likeliest] = more
        best = max(tried, key=lambda place: tried[place].evidence)
        ((_, size, _),) = tried[best].sizes
        # Where a foot makes a mode of what was a rigid motion, the modes without it say nothing of
        # other places.
        agrees = _AGREES > there.size[best] / size > 1 / _AGREES
        share = max(float(there.share[best]), 1 / len(additions)) if agrees else 1.0
        evidence = tried[best].evidence - float(np.log(share * len(additions)))
        return replace(
            tried[best], evidence=evidence, over_places=(there.mean, there.sd) if agrees else None
        )

    def _screened_at(
        self, additions: Sequence[Addition], result: ElasticResult
    ) -> AdditionScreening:
        """The additions beside each other, at a fit with one of them."""
        layout, x = self.elastic.layout, result.x[: self.elastic.x.size]
        states, problem = layout.solved(x), result.problem
        size = result.x.size - x.size
        columns = self._without_addition(result, states)
        at = result.rows[self.number]
        residual, sensitivity = problem.residual.copy(), problem.sensitivity[:, : x.size]
        rows = [row for row, _ in result.pairings[self.number].pairs]
        campaign = layout.campaigns[self.number]
        residual[at] = np.log(
            campaign.modes.frequency_hz[rows] / states[self.number].frequency_hz[columns]
        )
        plain = replace(
            problem,
            residual=residual,
            sensitivity=sensitivity,
            x=x,
            prior=layout.precision,
            others={name: each[:-size, :-size] for name, each in problem.others.items()},
            other_descent=problem.other_descent[:-size],
        )
        sigma = np.array(_SIZES)[:, None] * [each.usual for each in additions]
        effect = effect_of(states[self.number], additions)
        return screened(effect, at, columns, plain, plain.at_scatter(layout.scatter), sigma)

    def _without_addition(self, result: ElasticResult, states: Sequence[ForwardState]) -> list[int]:
        """The elastic modes of the body without its addition that are most like those with it that
        are paired.
        """
        altered, plain = result.states[self.number], states[self.number]
        columns = [column for _, column in result.pairings[self.number].pairs]
        own = plain.shapes / np.linalg.norm(plain.shapes, axis=1, keepdims=True)
        other = altered.shapes[columns] / np.linalg.norm(
            altered.shapes[columns], axis=1, keepdims=True
        )
        return [int(each) for each in most_alike(other @ own.T)]

    def fitted(
        self, additions: Sequence[Addition], starts: Sequence[FloatArray] = (), most: int = 1
    ) -> Explanation | None:
        """The best fit with some additions, from the most promising starts; None where none
        converges.
        """
        layout = self._layout(additions)
        misfit = Misfit(layout, self.use_shapes)
        ranked = self._ranked(misfit, starts or tuple(self._starts(len(additions))))
        results = []
        for promise, x in ranked[:most]:
            if np.isfinite(promise):
                fitted = _fitted(layout, start=x, use_shapes=self.use_shapes)
                results += [] if fitted is None else [fitted]
        if not results:
            return None
        gain, best = max(
            ((log_evidence(each) - self.without, each) for each in results),
            key=lambda each: each[0],
        )
        return Explanation(tuple(additions), best, gain)

    def promise(self, additions: Sequence[Addition]) -> float:
        """The best log evidence of the problem that is linear about a start."""
        misfit = Misfit(self._layout(additions), self.use_shapes)
        return self._ranked(misfit, tuple(self._starts(len(additions))))[0][0]

    def _ranked(
        self, misfit: Misfit, starts: Sequence[FloatArray]
    ) -> list[tuple[float, FloatArray]]:
        return sorted(((self._promise(misfit, x), x) for x in starts), key=lambda each: -each[0])

    def _starts(self, count: int) -> Iterator[FloatArray]:
        for size in _STARTS:
            yield np.concatenate([np.zeros(self.elastic.x.size), np.full(count, size)])
        yield np.concatenate([self.elastic.x, np.zeros(count)])

    def _promise(self, misfit: Misfit, x: FloatArray) -> float:
        """The log evidence of the problem that is linear about x."""
        layout = misfit.layout
        if not layout.are_believable(x):
            return -np.inf
        try:
            states = tuple(
                map(self._solved, layout.campaigns, [each.theta(x) for each in layout.campaigns])
            )
        except ModelError:
            return -np.inf
        pairings = misfit.pair(states)
        if misfit.without_partners(states, pairings):
            return -np.inf
        weights = [np.ones(len(each.modes)) for each in layout.campaigns]
        shapes = misfit.shape_errors(states, pairings, DISCREPANCY)
        by_shear = misfit.by_shear(states, pairings)
        problem = misfit.linear(x, states, pairings, weights, shapes, by_shear)
        return _log_evidence(layout, pairings, problem, problem.weights)

    def _solved(self, campaign: CampaignModel, theta: FloatArray) -> ForwardState:
        """A campaign's model at θ, one without additions once: many starts are of the same
        constants.
        """
        if isinstance(campaign.forward, AlteredForward):
            return campaign.forward.solve(theta)
        key = campaign.name, theta.tobytes()
        if key not in self.known:
            self.known[key] = campaign.forward.solve(theta)
        return self.known[key]

    def _layout(self, additions: Sequence[Addition]) -> Layout:
        layout, more = self.elastic.layout, len(additions)
        campaigns = []
        for number, campaign in enumerate(layout.campaigns):
            pick, forward = np.pad(campaign.pick, ((0, 0), (0, more))), campaign.forward
            if number == self.number:
                pick = np.vstack([pick, np.eye(more, pick.shape[1], pick.shape[1] - more)])
                forward = AlteredForward.of(forward, additions)
            campaigns.append(replace(campaign, pick=pick, forward=forward))
        name = layout.campaigns[self.number].name
        owner = f"campaign {name}" if name else ""
        unknowns = (*layout.unknowns, *(Unknown(each.name, owner, SIZE_SD) for each in additions))
        return replace(layout, campaigns=tuple(campaigns), unknowns=unknowns)


Hints = dict[Kind, tuple[list[Addition], AdditionScreening]]
"""By kind, what may be added to a body, and what screening makes of it."""


@dataclass(frozen=True)
class Suspects:
    """What may be added to a campaign's body, beside the body as it is stated.

    Attributes:
        elastic: the update.
        number: of the campaign.
    """

    elastic: ElasticResult
    number: int

    @cached_property
    def additions(self) -> dict[Kind, list[Addition]]:
        """Of each kind."""
        state, highest = self.elastic.states[self.number], max(self._columns)
        return {
            "mass": suspects.masses(state),
            "foot": suspects.feet(state, highest),
            "support": suspects.supports(state, highest),
        }

    def hints(
        self,
        problem: LinearProblem,
        posterior: tuple[Mixture, FloatArray],
        slips: Sequence[float],
    ) -> Hints:
        """What screening makes of them, where the clamp may yield by its tolerance.

        Args:
            problem: at the estimate.
            posterior: about it, as of `screened`.
            slips: sizes, in those that are usual.
        """
        elastic, number = self.elastic, self.number
        hints = Hints()
        for kind, effect in self._effects.items():
            sigma = np.array(slips)[:, None] * [each.usual for each in self.additions[kind]]
            hint = screened(effect, elastic.rows[number], self._columns, problem, posterior, sigma)
            hints[kind] = self.additions[kind], hint
        supports = self.additions["support"]
        if not supports:
            return hints
        yielding = compliance_of(elastic, number, supports, problem, posterior)
        hints["support"] = supports, yielding.screened(slips)
        yields = (
            elastic.layout.campaigns[number].inputs.standard_deviation(CLAMP) / TOLERANCES[CLAMP][0]
        )
        if not yields:
            return hints
        stated = max(yielding.screened([yields]).evidence, 0.0)
        return {
            kind: (some, replace(each, evidence=each.evidence - stated, stated=stated))
            for kind, (some, each) in hints.items()
        }

    @property
    def _columns(self) -> list[int]:
        return [column for _, column in self.elastic.pairings[self.number].pairs]

    @cached_property
    def _effects(self) -> dict[Kind, Effect]:
        state = self.elastic.states[self.number]
        kinds: tuple[Kind, ...] = ("mass", "foot")
        return {
            kind: effect_of(state, self.additions[kind]) for kind in kinds if self.additions[kind]
        }


def compliance_of(
    elastic: ElasticResult,
    number: int,
    supports: Sequence[Addition],
    problem: LinearProblem,
    posterior: tuple[Mixture, FloatArray],
) -> SupportCompliance:
    """What the data say of each way in which the supports of a campaign's body may give way."""
    campaign, at = elastic.layout.campaigns[number], elastic.rows[number]
    measured = campaign.modes, campaign.probability(range(len(campaign.modes)))
    state, pairing = elastic.states[number], elastic.pairings[number]
    return SupportCompliance.of(
        state, supports, at, pairing, measured, problem=problem, posterior=posterior
    )


@dataclass(frozen=True)
class LeftOpen:
    """How far a support may give way for all that the data say."""

    support: Addition
    stiffness: float  # N/m or N·m/rad
    move: FloatArray  # (X,) of x, were it so soft
    favoured: bool  # whether the data are likelier where it gives way by more than is stated


def left_open(elastic: ElasticResult, slips: Sequence[float]) -> LeftOpen | None:
    """Of an update of one campaign; None of a body that nothing holds."""
    (columns,) = ([column for _, column in pairing.pairs] for pairing in elastic.pairings)
    supports = suspects.supports(elastic.updated, max(columns))
    if not supports:
        return None
    posterior = elastic.problem.at_scatter(elastic.layout.scatter)
    yielding = compliance_of(elastic, 0, supports, elastic.problem, posterior)
    axis, compliance, change = yielding.left_open()
    favoured = yielding.screened(slips).evidence > 0
    return LeftOpen(supports[axis], 1 / compliance, -elastic.gain @ change, favoured)


def loosened(elastic: ElasticResult, place: int, slip: float) -> tuple[float, ElasticResult] | None:
    """The update where an input or prior may be off by a slip, and its log evidence over that as it
    is; None if it fails.

    Args:
        elastic: the update.
        place: of the unknown.
        slip: in its stated standard deviations.
    """
    unknowns = list(elastic.layout.unknowns)
    unknowns[place] = replace(unknowns[place], sd=slip * unknowns[place].sd)
    layout = replace(elastic.layout, unknowns=tuple(unknowns)).with_unverified_basis()
    use_shapes = "mode shapes" in elastic.problem.others
    fitted = _fitted(layout, start=elastic.x, use_shapes=use_shapes)
    return None if fitted is None else (log_evidence(fitted) - log_evidence(elastic), fitted)


def _fitted(layout: Layout, *, start: FloatArray, use_shapes: bool) -> ElasticResult | None:
    """A fit that need not succeed; None where it does not."""
    try:
        outcome = fit_elastic(layout, use_shapes=use_shapes, start=start)
    except ModelError:
        return None
    return None if isinstance(outcome, Unsettled) else outcome
