"""The hits of one point after their first look, and the judgement of all points of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.frf import Dof
from fecore.signal.blocks import Hit
from fecore.signal.comparison import FEWEST, Comparison, Deviation, compare, deviations
from fecore.signal.document import Processing
from fecore.signal.estimators import Estimate, estimate, squared
from fecore.signal.judgement import Verdict, judge, overrule
from fecore.signal.placing import locate
from fecore.signal.spectra import Spectra
from fecore.signal.traits import Traits, find_traits
from fecore.signal.usual import Usual, usual

_AT_FAULT_ALONE = ("late", "double", "overload", "polarity", "quiet", "swapped")


@dataclass(frozen=True)
class Point:
    """What the first pass keeps of a point: pairs, numbers of its hits, which of them seemed good, and of these, where hits
    can be located, the shares of resonances.
    """

    force: Dof
    responses: tuple[Dof, ...]
    numbers: tuple[int, ...]
    traits: tuple[Traits, ...]
    deviations: tuple[Deviation | None, ...]
    shares: FloatArray | None
    used: tuple[int, ...]


@dataclass(frozen=True)
class FirstLook:
    """A point after its first look.

    Attributes:
        point: what is kept of it.
        estimates: the FRFs of the hits that seemed good; none where there are none.
        excitation: (L,) mean magnitude of their forces' spectra; zeros where there are none.
    """

    point: Point
    estimates: tuple[Estimate, ...]
    excitation: FloatArray


def judge_points(points: Sequence[Point], processing: Processing) -> list[list[Verdict]]:
    """The verdicts of all hits of a campaign."""
    others = usual([traits for point in points for traits in point.traits])
    compared = compare([point.deviations for point in points])
    if processing.positions:
        compared = _located(points, compared, others, processing)
    verdicts = []
    for point, comparisons in zip(points, compared, strict=True):
        found = [
            judge(traits, others, comparison, processing.limits)
            for traits, comparison in zip(point.traits, comparisons, strict=True)
        ]
        found = _undecided(found, comparisons)
        verdicts.append([overrule(v, processing.overrules.get((v.force, v.number))) for v in found])
    return verdicts


def _located(
    points: Sequence[Point], compared: Sequence[Sequence[Comparison | None]], others: Usual, processing: Processing
) -> list[list[Comparison | None]]:
    """The same with the offset of each hit that can be located: points under the same sensors, hits that nothing else is
    said against.
    """
    found = [list(comparisons) for comparisons in compared]
    tours: dict[object, list[int]] = {}
    for i, point in enumerate(points):
        tours.setdefault((point.force.direction, point.responses), []).append(i)
    for tour in tours.values():
        places = [processing.positions.get(points[i].force.point) for i in tour]
        offsets = locate(places, [_comparable(points[i], others, processing) for i in tour])
        for i, of_point in zip(tour, offsets, strict=True):
            for k, offset in of_point.items():
                comparison = found[i][k]
                found[i][k] = comparison and replace(comparison, offset=offset)
    return found


def _comparable(point: Point, others: Usual, processing: Processing) -> dict[int, FloatArray]:
    """The shares of a point's hits that are like one another but for their place. One or two hits, which cannot be held
    against others, still say how shares change over the tour.
    """
    if point.shares is None:
        return {}
    return {
        i: own
        for i, own in zip(point.used, point.shares, strict=True)
        if ((deviation := point.deviations[i]) is None or deviation.comparable)
        and not judge(point.traits[i], others, None, processing.limits).faults
    }


def _undecided(found: list[Verdict], comparisons: Sequence[Comparison | None]) -> list[Verdict]:
    """Where half of the compared hits of a point would lie elsewhere, nobody can say which: none of them is at fault
    for it. Hits that are located have been asked in mm which of them lie together.
    """
    if any(c is not None and c.offset is not None for c in comparisons):
        return found
    compared = [i for i, c in enumerate(comparisons) if c is not None]
    far = [i for i in compared if any(f.criterion == "place" and f.failed for f in found[i].findings)]
    if not far or 2 * len(far) < len(compared):
        return found
    text = (
        f" As {len(far)} of the point's {len(compared)} hits lie apart, it is open which were hit at the right place."
    )

    def lenient(verdict: Verdict) -> Verdict:
        changed = tuple(
            replace(f, failed=False, sentence=f.sentence + text) if f.criterion == "place" and f.failed else f
            for f in verdict.findings
        )
        return replace(verdict, findings=changed)

    return [lenient(v) if i in far else v for i, v in enumerate(found)]


def first_look(spectra: Spectra, hits: Sequence[Hit]) -> FirstLook:
    """Numbers of a point's hits, and the FRFs of those that are good by themselves."""
    for hit in hits:
        spectra.check(hit)
    traits = find_traits(hits)
    others = usual(traits, before=False)
    alone = [judge(t, others, None, spectra.processing.limits) for t in traits]
    used = tuple(i for i, v in enumerate(alone) if not any(f.criterion in _AT_FAULT_ALONE for f in v.faults))
    forces, responses = spectra.stack(hits, traits, used)
    compared: list[Deviation | None] = [None] * len(hits)
    if len(used) >= FEWEST:
        found = [deviations(forces[:, spectra.compared], r[:, spectra.compared]) for r in responses]
        for k, i in enumerate(used):  # the sensor that objects most speaks for the hit
            compared[i] = max((f[k] for f in found), key=lambda d: float(d.energy.sum()))
    estimates = tuple(estimate(forces, r, spectra.processing.estimator) for r in responses) if used else ()
    excitation = np.sqrt(squared(forces)).mean(axis=0) if used else np.zeros(spectra.lines.size)
    point = Point(
        force=hits[0].force.dof,
        responses=hits[0].pair[1],
        numbers=tuple(h.number for h in hits),
        traits=traits,
        deviations=tuple(compared),
        shares=spectra.shares(forces, responses) if used else None,
        used=used,
    )
    return FirstLook(point, estimates, excitation)


def second_look(
    spectra: Spectra, hits: Sequence[Hit], traits: Sequence[Traits], good: tuple[int, ...]
) -> tuple[Estimate, ...]:
    """The FRFs of the chosen hits of a point, with the numbers of all its hits; none for no hits."""
    if not good:
        return ()
    forces, responses = spectra.stack(hits, traits, good)
    return tuple(estimate(forces, r, spectra.processing.estimator) for r in responses)
