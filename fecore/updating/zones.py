"""Where the stiffness of a body has changed: in few of its sets, or in stretches of a strip that
begin and end anywhere.

One factor for the whole of a zone fits the modes of a body that is damaged between the lines by
changes of zones in which nothing is. So each zone is divided into parts, and the posterior is that
over all stretches of parts (`damage_intervals`), linearised at its own mean until that rests. Of a
zone its mean is reported, 1/s = (1/L) ∫ dx/s(x), of which modes know more than of how long and how
deep a stretch is. The model of the result has the mean changes of all parts; a zone's factor scales
its own.

Where a body of sets has lost stiffness, stage 1 is made anew: the prior of the factors of sets
expects nearly all of them to be 1. Damage sits in one place or two. A factor of its own for every
place, each with the same wide prior, would spread one place's loss over its neighbours. So each
factor's prior standard deviation is itself estimated, by the evidence (MacKay, Neural Comput. 4,
1992; Tipping, J. Mach. Learn. Res. 1, 2001): with ξ = ln of the factor, σ² its posterior and s² its
prior variance,

    γ = 1 - σ²/s²,     s² ← ξ²/γ,

where γ is the share of what is known of the factor that the data supply. A factor that the data do
not move is held ever more firmly at 1; one that they move keeps its room, up to the standard
deviation that the recipe states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.quantities import kind_of
from fecore.updating.damage_intervals import Compliance, DamageIntervals, Partitions
from fecore.updating.elastic import Misfit, fit_elastic, settled
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.parameters import Parametrisation, parametrise
from fecore.updating.recipe import Recipe
from fecore.updating.temperature import with_temperature

_PARTS, _FEWEST = 30, 3  # of a body, about; of a zone, at least
# linearisations at most; posterior standard deviations that their point may still move
_ROUNDS, _RESTS = 8, 0.2
_LEAST = 0.003  # relative: a factor that is held more firmly is 1
# of γ, so that one round changes a standard deviation by no more than sevenfold its share
_KNOWN_AT_LEAST = 0.02
_SAME = 0.1  # relative change of every standard deviation that changes nothing


def with_damage_intervals(first: ElasticResult, recipe: Recipe) -> ElasticResult:
    """The elastic update of one campaign with zones changed by stretches; as it is where no zone's
    factor is updated.

    Args:
        first: the update with one factor for the whole of each zone.
        recipe: of the update.
    """
    prior = first.prior
    zones = np.array([kind_of(name) == "zone" for name in prior.names])
    if not zones.any():
        return first
    parts = _Parts.of(prior, recipe)
    layout = first.layout.with_prior(parts.prior, reduced=False)
    misfit = Misfit(layout, use_shapes=recipe.use_shapes, fixed_pairing=first.fixed_pairing)
    x = first.x[parts.column]
    for _ in range(_ROUNDS):
        states = layout.solved(x)
        pairings = misfit.pair(states)
        shapes = misfit.shape_errors(states, pairings, first.discrepancy)
        problem = misfit.linear(
            x, states, pairings, first.weights, shapes, misfit.by_shear(states, pairings)
        )
        partitions = Partitions(
            problem, parts.compliance, parts.lines, parts.number[parts.number >= 0]
        )
        moved, x = partitions.mean - parts.compliance.of(x), parts.compliance.back(partitions.mean)
        if np.all(np.abs(moved) <= _RESTS * partitions.sd):
            break
    whole = Compliance(zones, prior.prior_mean)
    at = whole.back(parts.to_zones @ partitions.mean)
    mixture = partitions.of(parts.to_zones, whole, at)
    # MacKay, Neural Comput. 4, 1992: the variance s² of a factor's prior that has the largest
    # evidence is E ξ².
    known = prior.prior_mean * np.clip(np.sqrt(np.diag(mixture.total) + at**2), _LEAST, prior.xi_sd)
    body = replace(prior.body, profile=parts.profile(x))  # type: ignore[type-var]
    layout = first.layout.with_prior(
        replace(prior, body=body, prior_sd=np.where(zones, known, prior.prior_sd))
    )
    misfit, states = replace(misfit, layout=layout), layout.solved(at)
    pairings = misfit.pair(states)
    return replace(
        first,
        layout=layout,
        x=at,
        states=states,
        pairings=pairings,
        problem=misfit.linear(
            at, states, pairings, first.weights, shapes, misfit.by_shear(states, pairings)
        ),
        damage_intervals=DamageIntervals(parts.lines, partitions.change, mixture),
    )


def with_sparse_factors(first: ElasticResult, recipe: Recipe) -> ElasticResult:
    """The elastic update of one campaign with sparse factors of sets; as it is where none is
    updated.

    Args:
        first: the update with the recipe's priors.
        recipe: of the update.
    """
    prior = first.prior
    factors = [c for c, name in enumerate(prior.names) if kind_of(name) == "factor"]
    if not factors or prior.body.in_space is None:
        return first
    largest, result = prior.prior_sd[factors], first
    for _ in range(_ROUNDS):
        now = result.prior.xi_sd[factors]
        known = np.clip(1 - _variance(result, factors) / now**2, _KNOWN_AT_LEAST, 1.0)
        updated = np.clip(np.sqrt(result.x[factors] ** 2 / known), _LEAST, largest)
        if np.all(np.abs(np.log(updated / now)) < _SAME):
            break
        sds = prior.prior_sd.copy()
        sds[factors] = updated
        layout = first.layout.with_prior(replace(prior, prior_sd=sds))
        fitted = fit_elastic(
            layout, use_shapes=recipe.use_shapes, start=result.x, fixed_pairing=result.fixed_pairing
        )
        result = settled(fitted)
    if result is first:
        return first
    starts = tuple(replace(start, chosen=False) for start in first.starts)
    return replace(
        result, starts=starts, rivals=first.rivals, oscillating_modes=first.oscillating_modes
    )


def _variance(result: ElasticResult, factors: list[int]) -> FloatArray:
    """(z,) posterior variances of the factors' logarithms."""
    variance: FloatArray = sum(
        (np.sum(part[factors] ** 2, axis=1) for part in result.sources.values()),
        np.zeros(len(factors)),
    )
    return variance


@dataclass(frozen=True)
class _Parts:
    """The unknowns of an update with those of each zone's parts in the place of its factor."""

    prior: Parametrisation  # the parameters with parts
    number: IntArray  # (X,) of each, the part that it is the factor of, from 0; -1 of another
    column: IntArray  # (X,) its place among the parameters with zones
    lines: FloatArray  # (F + 1,) x of the lines between parts, m

    @classmethod
    def of(cls, coarse: Parametrisation, recipe: Recipe) -> _Parts:
        """Divide the zones of a strip by its parameters with zones, which a recipe has."""
        body = coarse.body
        count = max(_FEWEST, round(_PARTS / (len(body.zones) + 1)))
        finer = body.divided(count)

        def part(name: str, which: int) -> str:
            return (
                f"zone_{(_number(name) - 1) * count + which}" if kind_of(name) == "zone" else name
            )

        parameters = [
            replace(
                each,
                name=part(each.name, which),
                tied_to=each.tied_to and part(each.tied_to, which),
            )
            for each in recipe.parameters or body.default_parameters()
            for which in range(1, count + 1 if kind_of(each.name) == "zone" else 2)
        ]
        prior = parametrise(finer, parameters)
        if coarse.warmth is not None:
            prior = with_temperature(
                prior, coarse.warmth.reference, coarse.warmth.temperature, reported=False
            )
        own = zip(coarse.names, coarse.prior_sd.tolist(), strict=True)
        prior = prior.with_inputs(
            {name: sd for name, sd in own if name not in {*coarse.reported, *prior.names}}
        )
        number = np.array(
            [_number(name) - 1 if kind_of(name) == "zone" else -1 for name in prior.names]
        )
        owner = [
            f"zone_{k // count + 1}" if k >= 0 else n
            for k, n in zip(number, prior.names, strict=True)
        ]
        column = np.array([coarse.names.index(name) for name in owner])
        return cls(prior, number, column, np.array([0.0, *finer.zones, body.nominal["length"]]))

    @property
    def compliance(self) -> Compliance:
        """Which unknowns are factors of parts."""
        return Compliance(self.number >= 0, self.prior.prior_mean)

    @property
    def to_zones(self) -> FloatArray:
        """(p, X) the means over the parts of each zone; of another unknown itself."""
        mine = self.column == np.arange(self.column.max() + 1)[:, None]
        return np.asarray(mine / mine.sum(axis=1, keepdims=True))

    def profile(self, x: FloatArray) -> tuple[float, ...]:
        """Changes of compliance from 1 of the parts at an x, over their zones' means.

        Where the parts of a zone change in both directions, or not at all, its change is even.
        """
        factors, profile = self.number >= 0, np.ones(self.lines.size - 1)
        change = np.where(factors, np.exp(-x) / self.prior.prior_mean - 1, 0.0)
        mean, size = self.to_zones @ change, self.to_zones @ np.abs(change)
        uneven = np.abs(mean) > size / 2
        share = np.where(
            uneven[self.column], change / np.where(uneven, mean, 1.0)[self.column], 1.0
        )
        profile[self.number[factors]] = share[factors]
        return tuple(profile.tolist())


def _number(name: str) -> int:
    return int(name.rpartition("_")[2])
