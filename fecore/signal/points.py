"""The hits of points before the campaign is judged, and the judgement of all points; and hits as a
person beside the hammer sees them: how they are judged, how coherent the good ones are, and each
hit's own FRF beside their average.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import Dof
from fecore.signal.blocks import Hit
from fecore.signal.comparison import Point, pairs
from fecore.signal.document import Processing
from fecore.signal.estimators import Estimate, estimate, squared
from fecore.signal.hit_features import HitFeatures, find_features
from fecore.signal.judgement import HitVerdict, judge
from fecore.signal.spectra import Source, Spectra


@dataclass(frozen=True)
class Preliminary:
    """A point before the campaign is judged."""

    point: Point  # what is kept of it
    # the FRFs of the hits that seemed good; none where there are none
    estimates: tuple[Estimate, ...]
    # (L,) mean magnitude of their forces' spectra; zeros where there are none
    excitation: FloatArray

    def frfs(
        self, spectra: Spectra, hits: Sequence[Hit], good: tuple[int, ...]
    ) -> tuple[Estimate, ...]:
        """The FRFs of the hits that are good in the end."""
        return (
            self.estimates
            if good == self.point.used
            else frfs_of(spectra, hits, self.point.features, good)
        )


def numbers_of(
    spectra: Spectra, hits: Sequence[Hit]
) -> tuple[Point, ComplexArray, list[ComplexArray]]:
    """A point with the numbers of its hits, and the spectra of their force and responses."""
    for hit in hits:
        spectra.check(hit)
    features = find_features(hits)
    forces, responses = spectra.stack(hits, features, range(len(hits)))
    point = Point(
        force=hits[0].force.dof,
        responses=hits[0].pair[1],
        features=features,
        pairs=pairs(forces[:, spectra.compared], [r[:, spectra.compared] for r in responses]),
        participation=spectra.participation(forces, responses),
    )
    return point, forces, responses


def preliminary(spectra: Spectra, hits: Sequence[Hit]) -> Preliminary:
    """Numbers of a point's hits, and the FRFs of those that seem good among themselves."""
    point, forces, responses = numbers_of(spectra, hits)
    used = tuple(i for i, v in enumerate(judge([point], spectra.processing)[0]) if v.accepted)
    if not used:
        return Preliminary(point, (), np.zeros(spectra.lines.size))
    chosen = list(used)
    estimates = tuple(
        estimate(forces[chosen], r[chosen], spectra.processing.estimator) for r in responses
    )
    return Preliminary(
        replace(point, used=used), estimates, np.sqrt(squared(forces[chosen])).mean(axis=0)
    )


def frfs_of(
    spectra: Spectra, hits: Sequence[Hit], features: Sequence[HitFeatures], good: tuple[int, ...]
) -> tuple[Estimate, ...]:
    """The FRFs of the chosen hits of a point, with the numbers of all its hits; none for no
    hits.
    """
    if not good:
        return ()
    forces, responses = spectra.stack(hits, features, good)
    return tuple(estimate(forces, r, spectra.processing.estimator) for r in responses)


@dataclass(frozen=True)
class Inspection:
    """Verdicts of all hits in their order, and the mean coherence of each place's good hits over
    the excited band.
    """

    verdicts: tuple[HitVerdict, ...]
    coherence: dict[Dof, float]


def inspect(source: Source, processing: Processing | None = None) -> Inspection:
    """Judge the hits of a few points, as they are wanted beside the hammer after each hit.

    A place has no coherence while fewer than two of its hits are good.

    Raises:
        InputError: the hits are unlike one another.
    """
    spectra = Spectra(source, processing or Processing())
    seen = [preliminary(spectra, source[number]) for number in range(len(source))]
    verdicts = judge([each.point for each in seen], spectra.processing)
    coherence = {}
    for number, (each, judged) in enumerate(zip(seen, verdicts, strict=True)):
        good = tuple(i for i, verdict in enumerate(judged) if verdict.accepted)
        if len(good) > 1:
            estimates = each.frfs(spectra, source[number], good)
            coherence[each.point.force] = float(
                np.mean([e.coherence[spectra.compared].mean() for e in estimates])
            )
    return Inspection(tuple(v for judged in verdicts for v in judged), coherence)


@dataclass(frozen=True)
class EachHit:
    """The hits of a point."""

    frequency_hz: FloatArray  # (L,) lines of the FRFs
    # (h, r, L) FRF of each hit alone, response over force; NaN where the force has nothing
    frfs: ComplexArray
    verdicts: tuple[HitVerdict, ...]  # of each hit, judged among the hits of the point
    accepted: tuple[bool, ...]  # which hits are averaged
    mean: tuple[Estimate, ...]  # their FRF for each response; empty where there are none
    # begin of the first pulse and end of the last, s from the begin of the block; a second pulse
    # that makes a double hit belongs to its hit
    pulse_s: tuple[float, float]


def each_hit(hits: Sequence[Hit], accepted: Sequence[bool] | None = None) -> EachHit:
    """Look at the hits of one point.

    Args:
        hits: of one place and one set of sensors.
        accepted: which are averaged, as a processing of the whole campaign decided; None: by the
            verdicts among themselves.

    Raises:
        InputError: there are none, or they are unlike one another.
    """
    spectra = Spectra([hits], Processing())
    seen = preliminary(spectra, hits)
    point = seen.point
    verdicts = tuple(judge([point], spectra.processing)[0])
    chosen = (
        tuple(verdict.accepted for verdict in verdicts) if accepted is None else tuple(accepted)
    )
    good = tuple(i for i, is_good in enumerate(chosen) if is_good)
    forces, responses = spectra.stack(hits, point.features, range(len(hits)))
    with np.errstate(divide="ignore", invalid="ignore"):
        frfs = np.array([response / forces for response in responses]).swapaxes(0, 1)
    return EachHit(
        frequency_hz=spectra.frequency,
        frfs=np.where(np.isfinite(frfs), frfs, np.nan),
        verdicts=verdicts,
        accepted=chosen,
        mean=seen.frfs(spectra, hits, good),
        pulse_s=_pulse_s(point.features, verdicts, spectra.sample_rate),
    )


def _pulse_s(
    features: Sequence[HitFeatures], verdicts: Sequence[HitVerdict], sample_rate_hz: float
) -> tuple[float, float]:
    begin = min(t.pulse.start for t in features)
    end = max(t.pulse.stop for t in features)
    for t, verdict in zip(features, verdicts, strict=True):
        if any(fault.criterion == "double" for fault in verdict.faults):
            end = max(end, t.pulse.second_at + t.pulse.width)
    return begin / sample_rate_hz, end / sample_rate_hz
