"""The hits of one point before the campaign is judged, and the judgement of all points of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.signal.blocks import Hit
from fecore.signal.comparison import Point, pairs
from fecore.signal.document import Processing
from fecore.signal.estimators import Estimate, estimate, squared
from fecore.signal.judgement import Verdict, judge
from fecore.signal.spectra import Spectra
from fecore.signal.traits import Traits, find_traits


@dataclass(frozen=True)
class Preliminary:
    """A point before the campaign is judged.

    Attributes:
        point: what is kept of it.
        estimates: the FRFs of the hits that seemed good; none where there are none.
        excitation: (L,) mean magnitude of their forces' spectra; zeros where there are none.
    """

    point: Point
    estimates: tuple[Estimate, ...]
    excitation: FloatArray

    def frfs(self, spectra: Spectra, hits: Sequence[Hit], good: tuple[int, ...]) -> tuple[Estimate, ...]:
        """The FRFs of the hits that are good in the end."""
        return self.estimates if good == self.point.used else frfs_of(spectra, hits, self.point.traits, good)


def judge_points(points: Sequence[Point], processing: Processing) -> list[list[Verdict]]:
    """The verdicts of all hits of a campaign, with what a user has decided against them."""
    return judge(points, processing.false_discovery, processing.positions, processing.overrules)


def numbers_of(spectra: Spectra, hits: Sequence[Hit]) -> tuple[Point, ComplexArray, list[ComplexArray]]:
    """A point with the numbers of its hits, and the spectra of their force and responses."""
    for hit in hits:
        spectra.check(hit)
    traits = find_traits(hits)
    forces, responses = spectra.stack(hits, traits, range(len(hits)))
    point = Point(
        force=hits[0].force.dof,
        responses=hits[0].pair[1],
        traits=traits,
        pairs=pairs(forces[:, spectra.compared], [r[:, spectra.compared] for r in responses]),
        shares=spectra.shares(forces, responses),
    )
    return point, forces, responses


def preliminary(spectra: Spectra, hits: Sequence[Hit]) -> Preliminary:
    """Numbers of a point's hits, and the FRFs of those that seem good among themselves."""
    point, forces, responses = numbers_of(spectra, hits)
    used = tuple(i for i, v in enumerate(judge_points([point], spectra.processing)[0]) if v.accepted)
    if not used:
        return Preliminary(point, (), np.zeros(spectra.lines.size))
    chosen = list(used)
    estimates = tuple(estimate(forces[chosen], r[chosen], spectra.processing.estimator) for r in responses)
    return Preliminary(replace(point, used=used), estimates, np.sqrt(squared(forces[chosen])).mean(axis=0))


def frfs_of(
    spectra: Spectra, hits: Sequence[Hit], traits: Sequence[Traits], good: tuple[int, ...]
) -> tuple[Estimate, ...]:
    """The FRFs of the chosen hits of a point, with the numbers of all its hits; none for no hits."""
    if not good:
        return ()
    forces, responses = spectra.stack(hits, traits, good)
    return tuple(estimate(forces, r, spectra.processing.estimator) for r in responses)
