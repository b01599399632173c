"""Hits to FRFs: judge every hit, average the good ones of each point, say what was done.

The hits come point by point and are not kept: a first pass takes each hit's numbers, compares the hits of each point
and averages those that are good by themselves; then the campaign's usual values are known and all hits are judged.
Only points whose set of used hits that changes are read a second time. So memory holds one point's hits and the FRFs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fecore.errors import InputError
from fecore.frf import FrfSet
from fecore.processing.blocks import FRF_QUANTITY
from fecore.processing.delay import Delay, estimate_delay
from fecore.processing.document import Processed, Processing
from fecore.processing.estimators import Estimate
from fecore.processing.heights import wrong_heights
from fecore.processing.judgement import Verdict
from fecore.processing.points import Point, first_look, judge_points, second_look
from fecore.processing.spectra import Source, Spectra


def process(
    source: Source, processing: Processing | None = None, progress: Callable[[float], None] = lambda _: None
) -> Processed:
    """FRFs with variance from the hits of a campaign.

    Args:
        source: hits by point, such as `by_point(hits)`.
        processing: the choices.
        progress: called with the share of the work that is done, 0 to 1.

    Raises:
        InputError: no hits; hits of unlike sampling rate, length, window or kind of response; no hit of any point is
        good.
    """
    spectra = Spectra(source, processing or Processing())
    points = []
    for number in range(len(source)):
        points.append(first_look(spectra, source[number]))
        progress(0.9 * (number + 1) / len(source))
    verdicts = judge_points(points, spectra.processing)
    results = []
    for number, (point, point_verdicts) in enumerate(zip(points, verdicts, strict=True)):
        good = tuple(i for i, v in enumerate(point_verdicts) if v.accepted)
        results.append(point.estimates if good == point.used else second_look(spectra, source[number], good))
    progress(1.0)
    return _result(spectra, points, verdicts, results)


def _result(
    spectra: Spectra,
    points: Sequence[Point],
    verdicts: Sequence[Sequence[Verdict]],
    results: Sequence[tuple[Estimate, ...]],
) -> Processed:
    """All of it in one place, with warnings."""
    rows = [
        (point, dof, value, tuple(n for n, v in zip(point.numbers, judged, strict=True) if v.accepted))
        for point, judged, found in zip(points, verdicts, results, strict=True)
        for dof, value in zip(point.responses, found, strict=False)
    ]
    if not rows:
        reasons = sorted({f.criterion for judged in verdicts for v in judged for f in v.faults})
        raise InputError(
            "hits",
            f"none of the hits is good ({', '.join(reasons)}); see the verdicts, and overrule where you know better",
        )
    frfs = FrfSet(
        spectra.frequency,
        np.array([r[2].values for r in rows]),
        tuple(r[1] for r in rows),
        tuple(r[0].force for r in rows),
        FRF_QUANTITY[spectra.kinds[0]],
        np.array([r[2].variance for r in rows]),
    )
    delay = estimate_delay(frfs, spectra.rate)
    force = np.mean([p.excitation for p in points if p.used] or [np.ones(spectra.lines.size)], axis=0)
    excited, strong = (
        float(spectra.frequency[np.flatnonzero(force >= share * force.max())[-1]]) for share in (0.1, 0.5)
    )
    return Processed(
        frfs=frfs,
        coherence=np.array([r[2].coherence for r in rows]),
        hits=np.array([r[2].hits for r in rows]),
        used=tuple(r[3] for r in rows),
        verdicts=tuple(v for judged in verdicts for v in judged),
        processing=spectra.processing,
        rate_per_s=spectra.rate,
        coupling=spectra.coupling,
        delay=delay,
        excited_hz=excited,
        strong_hz=strong,
        warnings=(
            *_warnings(points, verdicts, delay, excited, float(spectra.frequency[-1])),
            *wrong_heights(frfs, strong, spectra.processing.strip),
        ),
    )


def _warnings(
    points: Sequence[Point], verdicts: Sequence[Sequence[Verdict]], delay: Delay | None, excited: float, top: float
) -> tuple[str, ...]:
    found = []
    lost = [
        str(p.force.point) for p, judged in zip(points, verdicts, strict=True) if not any(v.accepted for v in judged)
    ]
    if lost:
        found.append(
            f"no hit of point {', '.join(lost)} is good, so there is no FRF; see the verdicts, and overrule where "
            f"you know better"
        )
    single = [
        str(p.force.point) for p, judged in zip(points, verdicts, strict=True) if sum(v.accepted for v in judged) == 1
    ]
    if single:
        found.append(f"a single good hit at point {', '.join(single)}: the FRF has no variance")
    if delay is not None and abs(delay.seconds) > max(4 * delay.sd, 2e-6):
        found.append(
            f"the response seems to come {delay.seconds * 1e6:.1f} ± {delay.sd * 1e6:.1f} µs after the force, which "
            f"a fit takes for "
            "damping; state it as delay_s to take it out"
        )
    if excited < 0.95 * top:
        found.append(f"the hammer excites the body up to {excited:.0f} Hz; above that the FRFs are mostly noise")
    return tuple(found)
