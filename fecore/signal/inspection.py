"""Hits as a person beside the hammer sees them, before there are FRFs of the campaign: how they are judged, how coherent the
good ones are, and each hit's own FRF beside their average.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import Dof
from fecore.signal.blocks import Hit
from fecore.signal.document import Processing
from fecore.signal.estimators import Estimate
from fecore.signal.judgement import Verdict
from fecore.signal.points import judge_points, preliminary
from fecore.signal.spectra import Source, Spectra
from fecore.signal.traits import Traits


@dataclass(frozen=True)
class Inspection:
    """Verdicts of all hits in their order, and the mean coherence of each place's good hits over the excited band."""

    verdicts: tuple[Verdict, ...]
    coherence: dict[Dof, float]


def inspect(source: Source, processing: Processing | None = None) -> Inspection:
    """Judge the hits of a few points, as they are wanted beside the hammer after each hit.

    A place has no coherence while fewer than two of its hits are good.

    Raises:
        InputError: the hits are unlike one another.
    """
    spectra = Spectra(source, processing or Processing())
    seen = [preliminary(spectra, source[number]) for number in range(len(source))]
    verdicts = judge_points([each.point for each in seen], spectra.processing)
    coherence = {}
    for number, (each, judged) in enumerate(zip(seen, verdicts, strict=True)):
        good = tuple(i for i, verdict in enumerate(judged) if verdict.accepted)
        if len(good) > 1:
            estimates = each.frfs(spectra, source[number], good)
            coherence[each.point.force] = float(np.mean([e.coherence[spectra.compared].mean() for e in estimates]))
    return Inspection(tuple(v for judged in verdicts for v in judged), coherence)


@dataclass(frozen=True)
class EachHit:
    """The hits of a point.

    Attributes:
        frequency_hz: (L,) lines of the FRFs.
        frfs: (h, r, L) FRF of each hit alone, response over force; NaN where the force has nothing.
        verdicts: of each hit, judged among the hits of the point.
        accepted: which hits are averaged.
        mean: their FRF for each response; empty where there are none.
        pulse_s: begin of the first pulse and end of the last, s from the begin of the block; a second pulse that makes a double
            hit belongs to its hit.
    """

    frequency_hz: FloatArray
    frfs: ComplexArray
    verdicts: tuple[Verdict, ...]
    accepted: tuple[bool, ...]
    mean: tuple[Estimate, ...]
    pulse_s: tuple[float, float]


def each_hit(hits: Sequence[Hit], accepted: Sequence[bool] | None = None) -> EachHit:
    """Look at the hits of one point.

    Args:
        hits: of one place and one set of sensors.
        accepted: which are averaged, as a processing of the whole campaign decided; None: by the verdicts among themselves.

    Raises:
        InputError: there are none, or they are unlike one another.
    """
    spectra = Spectra([hits], Processing())
    seen = preliminary(spectra, hits)
    point = seen.point
    verdicts = tuple(judge_points([point], spectra.processing)[0])
    chosen = tuple(verdict.accepted for verdict in verdicts) if accepted is None else tuple(accepted)
    good = tuple(i for i, is_good in enumerate(chosen) if is_good)
    forces, responses = spectra.stack(hits, point.traits, range(len(hits)))
    with np.errstate(divide="ignore", invalid="ignore"):
        frfs = np.array([response / forces for response in responses]).swapaxes(0, 1)
    return EachHit(
        frequency_hz=spectra.frequency,
        frfs=np.where(np.isfinite(frfs), frfs, np.nan),
        verdicts=verdicts,
        accepted=chosen,
        mean=seen.frfs(spectra, hits, good),
        pulse_s=_pulse_s(point.traits, verdicts, spectra.sample_rate),
    )


def _pulse_s(traits: Sequence[Traits], verdicts: Sequence[Verdict], sample_rate_hz: float) -> tuple[float, float]:
    begin = min(t.pulse.start for t in traits)
    end = max(t.pulse.stop for t in traits)
    for t, verdict in zip(traits, verdicts, strict=True):
        if any(fault.criterion == "double" for fault in verdict.faults):
            end = max(end, t.pulse.second_at + t.pulse.width)
    return begin / sample_rate_hz, end / sample_rate_hz
