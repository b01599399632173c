"""Where a body has lost stiffness: factors of zones, with a prior that expects nearly all of them to be 1.

Damage sits in one place or two. A factor of its own for every zone, each with the same wide prior, would spread one zone's loss
over its neighbours. So each factor's prior standard deviation is itself estimated, by the evidence (MacKay, Neural Comput. 4,
1992; Tipping, J. Mach. Learn. Res. 1, 2001): with ξ = ln of the factor, σ² its posterior and s² its prior variance,

    γ = 1 - σ²/s²,     s² ← ξ²/γ,

where γ is the share of what is known of the factor that the data supply. A factor that the data do not move is held ever more
firmly at 1; one that they move keeps its room, up to the standard deviation that the recipe states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.specimen import kind_of
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.layout import Layout

_ROUNDS = 8  # updates anew at most: standard deviations settle in three to five
_LEAST = 0.003  # relative: a factor that is held more firmly is 1
_KNOWN_AT_LEAST = 0.02  # of γ, so that one round changes a standard deviation by no more than sevenfold its share
_SAME = 0.1  # relative change of every standard deviation that changes nothing


def sparse_zones(first: ElasticResult, refit: Callable[[Layout, ElasticResult], ElasticResult]) -> ElasticResult:
    """The elastic update of one campaign with sparse factors of zones; as it is where no zone's factor is updated.

    Args:
        first: the update with the recipe's priors.
        refit: the update anew with other priors, from a former result.
    """
    prior = first.only.forward.parametrisation
    zones = [c for c, name in enumerate(prior.names) if name in prior.body.nominal and kind_of(name) == "zone"]
    if not zones:
        return first
    largest, result = prior.prior_sd[zones], first
    for _ in range(_ROUNDS):
        now = result.coordinates.sd[zones]
        known = np.clip(1 - _variance(result, zones) / now**2, _KNOWN_AT_LEAST, 1.0)
        wanted = np.clip(np.sqrt(result.x[zones] ** 2 / known), _LEAST, largest)
        if np.all(np.abs(np.log(wanted / now)) < _SAME):
            break
        sds = prior.prior_sd.copy()
        sds[zones] = wanted
        result = refit(first.layout.with_priors(sds), result)
    if result is first:
        return first
    starts = tuple(replace(start, chosen=False) for start in first.starts)
    return replace(result, starts=starts, rivals=first.rivals, torn=first.torn)


def _variance(result: ElasticResult, zones: list[int]) -> FloatArray:
    """(z,) posterior variances of the zones' logarithms."""
    variance: FloatArray = sum(
        (np.sum(part[zones] ** 2, axis=1) for part in result.sources.values()), np.zeros(len(zones))
    )
    return variance
