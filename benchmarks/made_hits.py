"""Made campaigns with bad hits of every kind, and what each hit's FRF is off by.

The bodies, analysers and habits of `tests.support.hammer` and `habits`, with 1 to 5 hits a point
and up to 40 % of the hits bad. Beside the faults of `hammer.FAULTS`:

`saturated` a soft amplifier; `truncated` the recording ends before the block; `dropout` the
sensor's cable is loose for a while; `spike` it sparks; `dead` there is no sensor; `neighbour`
another grid point was hit; `turned` a cable is reversed or the hit came from the other side;
`sensitivity` a range was another; `hard` a hit so hard that the body is stiffer; `swapped` force
and response are exchanged.

A fault need not harm: a cut tail that had died away, or a place that no mode minds. A hit *biases*
where its fault moves its FRF, under the processing's own windows, from that of the same hit without
it: by more than 5 % of the exact one, and by three times what three in four good hits of the
campaign are off it, in one of the eight with the most power of 16 bands of the excited range.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from benchmarks.tables import Table
from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.signal import Hit, Processing, by_point, process
from fecore.signal.hit_features import find_features
from fecore.signal.points import frfs_of
from fecore.signal.spectra import Spectra
from fecore.signal.windows import total_rate
from tests.support.habits import HABITS, HabitBench
from tests.support.hammer import FAULTS, Simulated, random_body, random_laboratory

MORE = (
    "saturated",
    "truncated",
    "dropout",
    "spike",
    "dead",
    "neighbour",
    "turned",
    "sensitivity",
    "hard",
    "swapped",
)
KINDS = (*FAULTS, *MORE)
# faults that only the other hits of the point show
COMPARED = ("off_place", "neighbour", "sensitivity", "hard")
_BANDS, _OFF, _WORSE = 16, 0.05, 3.0
Position = tuple[float, float, float]


@dataclass(frozen=True)
class Made:
    """A campaign: its hits, their faults, whether each biases, and where the points lie."""

    hits: list[Hit]
    faults: list[str | None]
    biases: list[bool]
    positions: dict[int, Position]


class MadeBench(HabitBench):
    """A bench whose hits may have every fault; `twins` are its hits as they had been without."""

    faults = KINDS
    twins: list[Hit]

    def hit(
        self, label: int, place: tuple[float, float], number: int, fault: str | None = None
    ) -> Simulated:
        """One hit of the grid point `label`."""
        rng, body, lab = self.rng, self.body, self.laboratory
        before = rng.bit_generator.state
        twin = super().hit(label, place, number)
        self.twins.append(twin.hit)
        if fault is None:
            return twin
        rng.bit_generator.state = before
        if fault == "neighbour":
            other = self.places[int(rng.choice([k for k in self.places if k != label]))]
            return replace(super().hit(label, other, number), fault=fault)
        if fault == "hard":
            self.body = replace(
                body, frequency_hz=body.frequency_hz * (1 + rng.uniform(0.003, 0.012))
            )
            self.laboratory = replace(lab, force_n=lab.force_n * rng.uniform(4, 10))
        found = super().hit(
            label, place, number, fault if fault in (*FAULTS, "saturated") else None
        )
        self.body, self.laboratory = body, lab
        return (
            found
            if fault not in MORE
            else replace(found, hit=self._spoilt(found.hit, fault), fault=fault)
        )

    def _spoilt(self, hit: Hit, fault: str) -> Hit:
        force, response = hit.force, hit.responses[0]
        f, x = force.samples.copy(), response.samples.copy()
        rng, n = self.rng, x.size
        peak = int(np.argmax(np.abs(f)))
        if fault == "truncated":
            end = peak + int((n - peak) * rng.uniform(0.05, 0.6))
            f[end:], x[end:] = 0.0, 0.0
        elif fault == "dropout":
            start = peak + int((n - peak) * rng.uniform(0.01, 0.3))
            x[start : start + int(n * rng.uniform(0.02, 0.3))] = 0.0
        elif fault == "spike":
            at = rng.integers(0, n - 4)
            x[at : at + rng.integers(1, 4)] += (
                rng.choice([-1, 1]) * rng.uniform(0.3, 2) * np.abs(x).max()
            )
        elif fault == "dead":
            x = (
                np.round(self.laboratory.response_noise * rng.standard_normal(n) / 1e-4)
                * 1e-4
                * self.scale
            )
        elif fault == "turned":
            f, x = (-f, x) if rng.random() < 0.5 else (f, -x)
        elif fault == "sensitivity":
            x = x * np.exp(rng.choice([-1, 1]) * rng.uniform(np.log(1.3), np.log(10)))
        elif fault == "swapped":
            f, x = x, f
        return replace(
            hit, force=replace(force, samples=f), responses=(replace(response, samples=x),)
        )


def made(seed: int) -> Made:
    """A campaign; the same seed gives the same."""
    rng = np.random.default_rng([35, seed])
    habit = str(rng.choice(HABITS[:-1])) if rng.random() < 0.4 else "as simulated"
    body = random_body(rng, ("clamped", "free", "plate")[seed % 3])
    sensor = 0.96 * body.length_m, 0.45 * body.width_m
    bench = MadeBench(body, random_laboratory(rng), sensor, rng, habit)
    bench.twins = []
    simulated = bench.tour(int(rng.integers(3, 9)), int(rng.integers(1, 6)), rng.uniform(0.0, 0.4))
    faults, places = (
        [s.fault for s in simulated],
        {k: (*place, 0.0) for k, place in bench.places.items()},
    )
    return Made([s.hit for s in simulated], faults, _biases(bench, simulated), places)


def _biases(bench: MadeBench, simulated: Sequence[Simulated]) -> list[bool]:
    hits, good = [s.hit for s in simulated], np.array([s.fault is None for s in simulated])
    spectra = Spectra(
        by_point([h for h, sound in zip(hits, good, strict=True) if sound] or hits), Processing()
    )
    hz, rate = spectra.frequency[spectra.compared], total_rate(hits[0], spectra.windows)
    exact = np.array(
        [bench.accelerance(hz, bench.places[hit.force.dof.point], rate) for hit in hits]
    )
    found, sound = (np.array([_frf(spectra, hit) for hit in some]) for some in (hits, bench.twins))
    power = _banded(np.abs(exact) ** 2)
    off, moved = (np.sqrt(_banded(np.abs(found - other) ** 2) / power) for other in (exact, sound))
    usual = np.quantile(off[good], 0.75, axis=0) if good.any() else np.zeros(_BANDS)
    loud = power >= np.median(power, axis=1, keepdims=True)
    far = loud & (moved > np.maximum(_OFF, _WORSE * usual))
    return [bool(bands.any()) for bands in far]


def _frf(spectra: Spectra, hit: Hit) -> ComplexArray:
    """(L,) FRF of a hit on the lines that are compared."""
    force, (response,) = spectra.stack([hit], find_features([hit]), [0])
    lines = spectra.compared
    return np.asarray(response[0, lines] / np.where(force[0, lines] == 0, 1e-150, force[0, lines]))


def _banded(values: FloatArray) -> FloatArray:
    """(..., 16) sums over bands."""
    edges = np.linspace(0, values.shape[-1], _BANDS + 1).astype(int)[:-1]
    return np.asarray(np.add.reduceat(values, edges, axis=-1))


def _moves(spectra: Spectra, hits: Sequence[Hit], used: Sequence[int], one: int) -> float:
    """By how many of its stated standard deviations the FRF of used hits of a point moves by one of
    them: root mean square over the bands with the most power; NaN where it is alone.
    """
    rest = [i for i in used if i != one]
    if not rest:
        return np.nan
    traits, lines = find_features(hits), spectra.compared
    (whole,), (less,) = (frfs_of(spectra, hits, traits, tuple(some)) for some in (used, rest))
    off, variance, power = (
        _banded(values[lines])
        for values in (
            np.abs(whole.values - less.values) ** 2,
            whole.variance,
            np.abs(less.values) ** 2,
        )
    )
    loud = power >= np.median(power)
    return float(np.sqrt(off[loud].sum() / variance[loud].sum()))


def made_hits(campaigns: int = 140, seed: int = 1000) -> None:
    """Bad hits of 17 kinds that bias an FRF and are missed, and good ones refused.

    They are counted by how many hits a point has where only these show the fault; then how many of
    these have two good hits beside them, and how far bad hits that are used move the FRF of their
    point.
    """
    hits, refused, shown, moves = Counter[str](), Counter[str](), Counter[bool](), list[float]()
    for number in range(seed, seed + campaigns):
        own = made(number)
        points, processing = by_point(own.hits), Processing(positions=own.positions)
        try:
            accepted = [v.accepted for v in process(points, processing).verdicts]
        except InputError:  # not one good hit: all are refused
            accepted = [False] * len(own.hits)
        spectra, edges = Spectra(points, processing), np.cumsum([0, *map(len, points)])
        for point, (a, b) in zip(points, pairwise(edges), strict=True):
            used, faults = accepted[a:b], own.faults[a:b]
            for k, (fault, biases) in enumerate(zip(faults, own.biases[a:b], strict=True)):
                by_others = fault in (*COMPARED, "turned")
                kind = fault or "none: good"
                kind += "" if biases or fault is None else ", harmless"
                kind += ", 1 or 2 hits" if by_others and b - a < 3 else ""
                hits[kind] += 1
                refused[kind] += not used[k]
                if biases and not (by_others and faults.count(None) < 2):
                    shown[used[k]] += 1
                if biases and used[k] and "," not in kind:
                    moves.append(_moves(spectra, point, np.flatnonzero(used).tolist(), k))
    table = Table("", "kind:36", "refused:d", "of:d", "share:.1%")
    for kind in sorted(hits):
        table.row(kind, refused[kind], hits[kind], refused[kind] / hits[kind])
    bad = [kind for kind in hits if "," not in kind and kind != "none: good"]
    total = sum(hits[kind] for kind in bad)
    print(f"bad hits that bias, missed: {total - sum(refused[kind] for kind in bad)} of {total}")
    far = [sum(move > most for move in moves) for most in (1, 2)]
    print(
        f"that move the FRF of their point by more than its sd: {far[0]}, by more than two:"
        f" {far[1]}; ",
        end="",
    )
    print(f"that are used alone: {int(np.isnan(moves).sum())}")
    print(
        f"without those that fewer than two good hits could show: {shown[True]} of {shown.total()}"
    )
