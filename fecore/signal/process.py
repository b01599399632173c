"""Hits to FRFs: judge every hit, average the good ones of each point, say what was done.

The hits come point by point and are not kept: a first pass takes each hit's numbers, compares the
hits of each point and averages those that are good by themselves; then the campaign's usual values
are known and all hits are judged. Only points whose set of used hits that changes are read a second
time. Between the passes the FRFs lie on a shelf, and they are given in parts. So where the shelf is
on disk, memory holds the hits of a few points, one part, and what is said of each hit.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol, TypeVar

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.findings import Finding
from fecore.frf import FrfSet
from fecore.signal.blocks import FRF_QUANTITY
from fecore.signal.comparison import Point
from fecore.signal.delay import Delay, DelaySearch
from fecore.signal.document import Averages, Findings, Processed, Processing
from fecore.signal.estimators import Estimate
from fecore.signal.findings import finding
from fecore.signal.frf_scale import FrfScale
from fecore.signal.judgement import HitVerdict, judge
from fecore.signal.points import Preliminary, frfs_of, preliminary
from fecore.signal.spectra import Source, Spectra
from fecore.signal.unstated import with_unstated_window

_AHEAD = 2  # results a thread that wait for the one before them

Progress = Callable[[float], None]
Result = TypeVar("Result")


class Shelf(Protocol):
    """Where the FRFs of each point lie between the passes; a `dict` holds them in memory."""

    def __setitem__(self, point: int, estimates: tuple[Estimate, ...], /) -> None: ...

    def __getitem__(self, point: int, /) -> tuple[Estimate, ...]: ...


def process(
    source: Source, processing: Processing | None = None, progress: Progress = lambda _: None
) -> Processed:
    """FRFs with variance from the hits of a campaign.

    Args:
        source: hits by point, such as `by_point(hits)`.
        processing: the choices.
        progress: called with the share of the work that is done, 0 to 1.

    Raises:
        InputError: no hits; hits of unlike sampling rate, length, window or kind of response; no
            hit of any point is
        good.
    """
    whole, findings = process_in_parts(source, processing, progress, shelf={}, part_bytes=None)
    return Processed(**{**vars(whole), **vars(findings)})


def process_in_parts(
    source: Source,
    processing: Processing | None = None,
    progress: Progress = lambda _: None,
    *,
    shelf: Shelf,
    threads: int = 1,
    part_bytes: int | None = 4 * 2**20,
) -> Iterator[Averages | Findings]:
    """The same for campaigns of any size: the FRFs in parts, in the order of the points, and in the
    end what was found.

    Args:
        source: hits by point; it is asked by several threads at once.
        processing: the choices.
        progress: called with the share of the work that is done, 0 to 1.
        shelf: where the FRFs lie between the passes.
        threads: that look at points at the same time; the result does not depend on them.
        part_bytes: of FRFs, their variance, growth and coherence that are given together; those of one
            point are not parted. None gives all as one part.

    Raises:
        InputError: as `process`; before the first part is given.
    """
    source, window = with_unstated_window(source)
    spectra = Spectra(source, processing or Processing(), 0.0 if window is None else window.sd)
    points, force = _first_pass(spectra, source, progress, shelf, threads)
    verdicts = judge(points, spectra.processing)
    good = [tuple(i for i, v in enumerate(judged) if v.accepted) for judged in verdicts]
    if not any(good):
        reasons = sorted({f.criterion for judged in verdicts for v in judged for f in v.faults})
        why = f"good ({', '.join(reasons)})" if reasons else "used: all are left out by hand"
        raise InputError(
            "hits",
            f"none of the hits is {why}; see the verdicts, and overrule where you know better",
        )
    excited, strong = (
        float(spectra.frequency[np.flatnonzero(force >= share * force.max())[-1]])
        for share in (0.1, 0.5)
    )
    count = sum(len(point.responses) for point, own in zip(points, good, strict=True) if own)
    search, scale_check = DelaySearch(count, spectra.rate), FrfScale(spectra.frequency, strong)
    most = count if part_bytes is None else max(1, part_bytes // (40 * spectra.lines.size))
    for part in _second_pass(spectra, source, points, good, shelf, most):
        search.add(part.frfs)
        scale_check.add(part.frfs)
        yield part
    progress(1.0)
    delay = search.estimate()
    yield Findings(
        verdicts=tuple(v for judged in verdicts for v in judged),
        processing=spectra.processing,
        rate_per_s=spectra.rate,
        rate_sd_per_s=spectra.rate_sd,
        coupling=spectra.coupling,
        delay=delay,
        excited_hz=excited,
        strong_hz=strong,
        notes=(
            *([window.finding] if window is not None and window.rate_per_s else []),
            *_notes(points, verdicts, delay, excited, float(spectra.frequency[-1])),
            *(_unlocated(points, verdicts) if spectra.processing.positions else []),
            *scale_check.wrong(spectra.processing.strip, spectra.strong_window()),
        ),
    )


def _first_pass(
    spectra: Spectra, source: Source, progress: Progress, shelf: Shelf, threads: int
) -> tuple[list[Point], FloatArray]:
    """What is kept of all points, and the mean magnitude of the spectra of their forces."""

    def inspected(number: int) -> Preliminary:
        return preliminary(spectra, source[number])

    points: list[Point] = []
    total, used = np.zeros(spectra.lines.size), 0
    for number, seen in enumerate(batched(inspected, len(source), threads)):
        shelf[number] = seen.estimates
        points.append(seen.point)
        if seen.point.used:
            total += seen.excitation
            used += 1
        progress(0.9 * (number + 1) / len(source))
    return points, total / used if used else np.ones(spectra.lines.size)


def batched(work: Callable[[int], Result], count: int, threads: int) -> Iterator[Result]:
    """work(0), work(1) … work(count - 1), in this order; few of them are worked on, or kept, before
    they are taken.

    Transforms, sums and products of arrays, and the reading of files, let other threads work
    meanwhile.
    """
    if threads == 1:
        yield from map(work, range(count))
        return
    with ThreadPoolExecutor(threads) as pool:
        under_way: deque[Future[Result]] = deque()
        for number in range(count):
            under_way.append(pool.submit(work, number))
            if len(under_way) > _AHEAD * threads:
                yield under_way.popleft().result()
        while under_way:
            yield under_way.popleft().result()


def _second_pass(
    spectra: Spectra,
    source: Source,
    points: Sequence[Point],
    good: Sequence[tuple[int, ...]],
    shelf: Shelf,
    most: int,
) -> Iterator[Averages]:
    """The FRFs of the good hits, in parts of so many at most."""
    rows: list[tuple[Point, tuple[int, ...], tuple[Estimate, ...]]] = []
    for number, (point, own) in enumerate(zip(points, good, strict=True)):
        if not own:
            continue
        same = own == point.used
        estimates = shelf[number] if same else frfs_of(spectra, source[number], point.features, own)
        if rows and sum(len(row[2]) for row in rows) + len(estimates) > most:
            yield _averages(spectra, rows)
            rows = []
        rows.append((point, tuple(point.features[i].number for i in own), estimates))
    yield _averages(spectra, rows)


def _averages(
    spectra: Spectra, rows: Sequence[tuple[Point, tuple[int, ...], tuple[Estimate, ...]]]
) -> Averages:
    """The FRFs of some points, each with the numbers of its hits."""
    every = [estimate for _, _, estimates in rows for estimate in estimates]
    return Averages(
        frfs=FrfSet(
            spectra.frequency,
            np.array([estimate.values for estimate in every]),
            tuple(dof for point, _, _ in rows for dof in point.responses),
            tuple(point.force for point, _, _ in rows for _ in point.responses),
            FRF_QUANTITY[spectra.quantity],
            variance=np.array([estimate.variance for estimate in every]),
            growth=np.array([estimate.growth for estimate in every]),
        ),
        coherence=np.array([estimate.coherence for estimate in every]),
        hits=np.array([estimate.hits for estimate in every]),
        used=tuple(numbers for point, numbers, _ in rows for _ in point.responses),
        rate_per_s=spectra.rate,
        rate_sd_per_s=spectra.rate_sd,
    )


def _notes(
    points: Sequence[Point],
    verdicts: Sequence[Sequence[HitVerdict]],
    delay: Delay | None,
    excited: float,
    top: float,
) -> list[Finding]:
    notes = []
    names = _names(points)
    lost = [
        name
        for name, judged in zip(names, verdicts, strict=True)
        if not any(v.accepted for v in judged)
    ]
    if lost:
        notes.append(finding("no_good_hit", points=", ".join(lost)))
    single = [
        name
        for name, judged in zip(names, verdicts, strict=True)
        if sum(v.accepted for v in judged) == 1
    ]
    if single:
        notes.append(finding("single_hit", points=", ".join(single)))
    if delay is not None and abs(delay.seconds) > max(4 * delay.sd, 2e-6):
        notes.append(finding("response_late", delay=delay.seconds * 1e6, sd=delay.sd * 1e6))
    if excited < 0.95 * top:
        notes.append(finding("weak_excitation", hz=excited))
    return notes


def _unlocated(
    points: Sequence[Point], verdicts: Sequence[Sequence[HitVerdict]]
) -> Iterator[Finding]:
    """Points beside which a hit may lie without being seen: places are known by how FRFs change
    between points.
    """
    for directions, kind in enumerate(("hits_not_located", "hits_located_one_way")):
        every = zip(_names(points), verdicts, strict=True)
        blind = [
            name
            for name, judged in every
            if max(verdict.directions for verdict in judged) == directions
        ]
        if blind:
            yield finding(kind, points=", ".join(blind))


def _names(points: Sequence[Point]) -> list[str]:
    """Where was hit, and, where one place was hit for several sets of sensors, where they stood."""
    hit = Counter(point.force for point in points)
    return [
        (
            str(point.force.point)
            if hit[point.force] == 1
            else (
                f"{point.force.point} (sensor at"
                f" {', '.join(str(dof.point) for dof in point.responses)})"
            )
        )
        for point in points
    ]
