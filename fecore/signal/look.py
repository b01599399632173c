"""A look at hits without their FRFs: how they are judged, and how coherent the good ones of each point are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.frf import Dof
from fecore.signal.document import Processing
from fecore.signal.judgement import Verdict
from fecore.signal.points import first_look, judge_points, second_look
from fecore.signal.spectra import Source, Spectra


@dataclass(frozen=True)
class Look:
    """Verdicts of all hits in their order, and the mean coherence of each place's good hits over the excited band."""

    verdicts: tuple[Verdict, ...]
    coherence: dict[Dof, float]


def look(source: Source, processing: Processing | None = None) -> Look:
    """Judge the hits of a few points, as they are wanted beside the hammer after each hit.

    A place has no coherence while fewer than two of its hits are good.

    Raises:
        InputError: the hits are unlike one another.
    """
    spectra = Spectra(source, processing or Processing())
    seen = [first_look(spectra, source[number]) for number in range(len(source))]
    points = [each.point for each in seen]
    verdicts = judge_points(points, spectra.processing)
    coherence = {}
    for number, (each, judged) in enumerate(zip(seen, verdicts, strict=True)):
        point = each.point
        good = tuple(i for i, verdict in enumerate(judged) if verdict.accepted)
        same = good == point.used
        estimates = each.estimates if same else second_look(spectra, source[number], point.traits, good)
        if len(good) > 1:
            coherence[point.force] = float(np.mean([e.coherence[spectra.compared].mean() for e in estimates]))
    return Look(tuple(v for judged in verdicts for v in judged), coherence)
