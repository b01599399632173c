"""The picture of good and bad hits in `docs/hammer.md`: `python -m tools.hits_picture` draws it anew.

Five simulated hits of one point (`benchmarks.hammer`, a fixed seed): three good ones, one double, one that came while
the body still rang. They are judged and drawn as the service does it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.hammer import campaign
from fecore.processing import by_point, each_hit
from service.show.figures.hits import HitShown, PointShown, hits_figure
from service.show.figures.look import Figure
from service.show.figures.printing import render

FILE = Path(__file__).resolve().parent.parent / "docs/images/hits.png"
SEED, POINT = 16, 3


def good_and_bad_hits() -> Figure:
    """The figure of the point."""
    _, _, simulated = campaign(np.random.default_rng(SEED), "clamped", 3, 5, 0.25, 0.0)
    hits = by_point([each.hit for each in simulated])[POINT - 1]
    found = each_hit(hits)
    shown = [
        HitShown(
            number=hit.number,
            good=verdict.accepted,
            why=", ".join(fault.criterion for fault in verdict.faults),
            sentence=" ".join(fault.sentence for fault in verdict.faults),
            force=hit.force.samples,
            response=hit.responses[0].samples,
            frf=found.frfs[number, 0],
        )
        for number, (hit, verdict) in enumerate(zip(hits, found.verdicts, strict=True))
    ]
    (mean,) = found.mean
    point = PointShown(
        title="Five hits of a point: hits 2 and 5 are left out",
        quantity="acceleration",
        frf_quantity="accelerance",
        sample_rate_hz=hits[0].sample_rate_hz,
        frequency_hz=found.frequency_hz,
        pulse_s=found.pulse_s,
        hits=shown,
        mean=mean.values,
        coherence=mean.coherence,
    )
    return hits_figure(point)


if __name__ == "__main__":
    FILE.write_bytes(render(good_and_bad_hits(), "png", dpi=90))
