"""Factors of a body's zones, whatever the lines between them: stretches of another stiffness may begin and end anywhere.

One factor for the whole of a zone fits the modes of a body that is damaged between the lines by changes of zones in which
nothing is. So each zone is divided into parts, and the posterior is that over all stretches of parts (`stretches`), linearised
at its own mean until that rests. Of a zone its mean is reported, 1/s = (1/L) ∫ dx/s(x), of which modes know more than of how
long and how deep a stretch is. The model of the result has the mean changes of all parts; a zone's factor scales its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.constants import kind_of
from fecore.body.specimen import LayeredSpecimen, Specimen, divided
from fecore.updating.elastic import Misfit
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.layout import CampaignModel, Layout
from fecore.updating.parameters import Parametrisation
from fecore.updating.stretches import Compliance, Partitions, Stretches

_PARTS, _FEWEST = 30, 3  # of a body, about; of a zone, at least
_ROUNDS, _RESTS = 8, 0.2  # linearisations at most; posterior standard deviations that their point may still move
_LEAST = 0.003  # relative: a factor that is held more firmly is 1


def with_stretches(first: ElasticResult, *, use_shapes: bool = False) -> ElasticResult:
    """The elastic update of one campaign with zones changed by stretches; as it is where no zone's factor is updated.

    Args:
        first: the update with one factor for the whole of each zone.
        use_shapes: whether it fitted realised shapes too.
    """
    prior, only = first.prior, first.only
    zones = np.array([kind_of(name) == "zone" and name in prior.body.nominal for name in prior.names])
    if not zones.any():
        return first
    parts = _Parts.of(prior, zones)
    layout = _with(only, parts.prior, reduced=False)
    misfit, x = Misfit(layout, use_shapes=use_shapes, held=first.held), first.x[parts.column]
    for _ in range(_ROUNDS):
        states = layout.solved(x)
        problem = misfit.linear(x, states, misfit.pair(states), first.weights)
        partitions = Partitions(problem, parts.compliance, parts.lines, parts.number)
        moved, x = partitions.mean - parts.compliance.of(x), parts.compliance.back(partitions.mean)
        if np.all(np.abs(moved) <= _RESTS * partitions.sd):
            break
    whole = Compliance.of_some(zones, prior.prior_mean)
    at = whole.back(parts.to_zones @ partitions.mean)
    mixture = partitions.of(parts.to_zones, whole, at)
    # MacKay, Neural Comput. 4, 1992: the variance s² of a factor's prior that has the largest evidence is E ξ².
    known = prior.prior_mean * np.clip(np.sqrt(np.diag(mixture.total) + at**2), _LEAST, prior.xi_sd)
    own = replace(prior, body=parts.with_profile(prior, x), prior_sd=np.where(zones, known, prior.prior_sd))
    layout = _with(only, own)
    misfit, states = replace(misfit, layout=layout), layout.solved(at)
    pairings = misfit.pair(states)
    problem = misfit.linear(at, states, pairings, first.weights)
    given = problem.mixture(0.0)[0]
    change = np.zeros((mixture.weight.size, parts.lines.size - 1))
    change[:, parts.number] = partitions.mixture.shift[:, parts.compliance.factors]
    return replace(
        first,
        layout=layout,
        x=at,
        states=states,
        pairings=pairings,
        problem=problem,
        given=given,
        mixture=given,
        excursions=(only.seek_excursions(states[0]),),
        stretches=Stretches(parts.lines, change, mixture),
    )


def _with(campaign: CampaignModel, prior: Parametrisation, *, reduced: bool = True) -> Layout:
    """The layout of a campaign with other parameters and their body."""
    forward = replace(campaign.forward, specimen=prior.body, parametrisation=prior, reduced=reduced)
    return Layout.of_one(forward, campaign.modes, campaign.seek_excursions)


@dataclass(frozen=True)
class _Parts:
    """The unknowns of an update with those of each zone's parts in the place of its factor.

    Attributes:
        prior: the parameters with parts.
        column: (X,) of each, its place among the parameters with zones.
        count: how many parts a zone has.
        compliance: which are factors of parts.
        number: of the part that each of them belongs to, from 0.
        lines: (F + 1,) x of the lines between parts, m.
    """

    prior: Parametrisation
    column: IntArray
    count: int
    compliance: Compliance
    number: IntArray
    lines: FloatArray

    @classmethod
    def of(cls, prior: Parametrisation, zones: BoolArray) -> _Parts:
        """Divide the zones of a strip whose factors are the given ones of its parameters."""
        body = prior.body
        assert isinstance(body, Specimen | LayeredSpecimen), "no other body has zones"
        count = max(_FEWEST, round(_PARTS / (len(body.zones) + 1)))
        fine = replace(body, zones=divided(body.zones, body.length, count))
        each = np.where(zones, count, 1)
        column, piece = np.repeat(np.arange(zones.size), each), np.concatenate([np.arange(n) for n in each])
        names = [*fine.nominal, *(spring.name for spring in fine.springs)]
        part = np.array([int(n.rpartition("_")[2]) - 1 if kind_of(n) == "zone" else 0 for n in names])
        rows = [
            prior.constant_names.index(f"zone_{p // count + 1}" if kind_of(n) == "zone" else n)
            for n, p in zip(names, part, strict=True)
        ]
        spread = prior.spread[rows][:, column] * (~zones[column] | (part[:, None] % count == piece))
        parts = tuple(
            f"{prior.names[c]}.{p}" if zones[c] else prior.names[c] for c, p in zip(column, piece, strict=True)
        )
        finer = replace(
            prior,
            body=fine,
            names=parts,
            prior_mean=prior.prior_mean[column],
            prior_sd=prior.prior_sd[column],
            base=prior.base[rows],
            spread=spread,
        )
        compliance = Compliance.of_some(zones[column], finer.prior_mean)
        number = part[np.argmax(spread != 0, axis=0)][zones[column]]
        lines = np.array([0.0, *fine.zones, body.length])
        return cls(finer, column, count, compliance, number, lines)

    @property
    def to_zones(self) -> FloatArray:
        """(p, X) the means over the parts of each zone; of another unknown itself."""
        mine = self.column == np.arange(self.column[-1] + 1)[:, None]
        return np.asarray(mine / mine.sum(axis=1, keepdims=True))

    def with_profile(self, prior: Parametrisation, x: FloatArray) -> Specimen | LayeredSpecimen:
        """The body in zones with each zone's change of compliance from 1 spread over its parts as at an x of theirs.

        Where the parts of a zone change in both directions, or not at all, its change is even.
        """
        body, factors = prior.body, self.compliance.factors
        assert isinstance(body, Specimen | LayeredSpecimen), "no other body has zones"
        change, profile = np.where(factors, np.exp(-x) / self.prior.prior_mean - 1, 0.0), np.ones(self.lines.size - 1)
        mean, size = self.to_zones @ change, self.to_zones @ np.abs(change)
        uneven = np.abs(mean) > size / 2
        share = change / np.where(uneven, mean, 1.0)[self.column]
        profile[self.number] = np.where(uneven[self.column], share, 1.0)[factors]
        return replace(body, profile=tuple(profile.tolist()))
