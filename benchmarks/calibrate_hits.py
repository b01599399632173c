"""Fit and judge the probability of a hit: `python -m benchmarks calibrate_hits`.

Made campaigns (`made_hits`) are looked at, each hit's features are kept with whether it is good,
and `fecore.signal.weights` is made anew from half of them: what good hits are like by their medians
and spreads in each campaign, and the weights by Bayesian logistic regression,

    ln p(b) = Σ_k ln P(y_k | b) - Σ (b - 3)²/2σ²,    σ = 2, b ≥ 0.

The other half shows how good they are: bad hits missed and good ones refused by kind, reliability,
log loss and Brier score, and each feature's worth by leaving it out. A bad hit that does not bias
its FRF counts on neither side.

The arguments are campaigns of each half, and the first seed.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from benchmarks.calibration import print_reliability, scores
from benchmarks.made_hits import COMPARED, Position, made
from benchmarks.tables import Table
from fecore.arrays import BoolArray, FloatArray
from fecore.signal import Processing, by_point
from fecore.signal.comparison import Point
from fecore.signal.judgement import FALSE_DISCOVERY, NAMES, features_of
from fecore.signal.points import numbers_of
from fecore.signal.spectra import Spectra
from fecore.signal.weights import ALONE, CONSTANT, LEAST, WEIGHTS

_PRIOR_SD = 2.0
_PRIOR_MEAN = 3.0
_LEAST_SCATTER = 0.01  # of a logarithm


@dataclass(frozen=True)
class Looked:
    """A campaign after its first look."""

    points: list[Point]
    positions: dict[int, Position]
    faults: list[str | None]
    biases: list[bool]

    @property
    def hits(self) -> list[int]:
        """How many hits each hit's point has."""
        return [len(point.features) for point in self.points for _ in point.features]


@dataclass(frozen=True)
class Tabled:
    """Features of the hits of several campaigns: x (n, F), whether none is beside a hit, whether it
    is good; and its kind.
    """

    x: FloatArray
    alone: BoolArray
    good: BoolArray
    kind: list[str]


def looked_at(seeds: Sequence[int]) -> Iterator[Looked]:
    """Campaigns by their seeds."""
    for seed in seeds:
        own = made(seed)
        spectra = Spectra(by_point(own.hits), Processing(positions=own.positions))
        points = [numbers_of(spectra, hits)[0] for hits in by_point(own.hits)]
        yield Looked(points, own.positions, own.faults, own.biases)


def usual(campaigns: Sequence[Looked]) -> dict[str, tuple[float, float, float]]:
    """Centre, its scatter between campaigns, and the scatter within one, of the logarithm of each
    number of good hits.
    """
    rows: dict[str, list[tuple[float, float]]] = {name: [] for name in NAMES}
    for own in campaigns:
        numbers = features_of(own.points, own.positions).numbers
        logs = np.log(np.maximum(numbers, [WEIGHTS[name].least for name in NAMES]))
        numbers = np.where([WEIGHTS[name].between == 0 for name in NAMES], numbers, logs)
        good = np.array([fault is None for fault in own.faults])
        for name, values in zip(NAMES, numbers.T, strict=True):
            known = values[good & np.isfinite(values)]
            if known.size >= 4:
                low, middle, high = np.quantile(known, (0.05, 0.5, 0.95))
                rows[name].append((float(middle), float(max(high - middle, middle - low)) / 1.645))
    found = {name: np.array(row) for name, row in rows.items()}
    return {
        name: (
            float(np.median(row[:, 0])),
            float(np.std(row[:, 0])),
            max(float(np.median(row[:, 1])), _LEAST_SCATTER),
        )
        for name, row in found.items()
    }


def tabled(campaigns: Sequence[Looked]) -> Tabled:
    """The hits that are good, or bad and bias their FRF."""
    rows, alone, good, kind = [], [], [], []
    for own in campaigns:
        found = features_of(own.points, own.positions)
        for i, (fault, biases, hits) in enumerate(
            zip(own.faults, own.biases, own.hits, strict=True)
        ):
            if fault is not None and not biases:
                continue
            rows.append(np.log1p(found.u[i] ** 4))
            alone.append(found.alone[i])
            good.append(fault is None)
            few = fault in (*COMPARED, "turned") and hits < 3
            kind.append("good" if fault is None else f"{fault}, 1 or 2 hits" if few else fault)
    return Tabled(np.array(rows), np.array(alone), np.array(good), kind)


def fitted(table: Tabled, free: Sequence[int] | None = None) -> FloatArray:
    """(2 + F,) the most probable constant, what a hit alone loses, and weights; those not `free`
    are nil.
    """
    design = np.column_stack((np.ones(len(table.x)), -table.alone.astype(float), -table.x))
    mean = np.array([4.0, 0.5, *[_PRIOR_MEAN] * table.x.shape[1]])
    bounds = [(-10.0, 10.0), (0.0, 5.0), *[(0.0, 12.0)] * table.x.shape[1]]
    if free is not None:
        bounds = [b if k < 2 or k - 2 in free else (0.0, 0.0) for k, b in enumerate(bounds)]

    def cost(b: FloatArray) -> tuple[float, FloatArray]:
        logit = design @ b
        p = scipy.special.expit(logit)
        off = (b - mean) / _PRIOR_SD
        loss = -np.sum(
            np.where(table.good, scipy.special.log_expit(logit), scipy.special.log_expit(-logit))
        )
        return float(loss + off @ off / 2), design.T @ (p - table.good) + off / _PRIOR_SD

    start = np.array([np.clip(m, *b) for m, b in zip(mean, bounds, strict=True)])
    return np.asarray(
        scipy.optimize.minimize(cost, start, jac=True, bounds=bounds, method="L-BFGS-B").x
    )


def probability(table: Tabled, b: FloatArray) -> FloatArray:
    """P of each hit."""
    return np.asarray(scipy.special.expit(b[0] - b[1] * table.alone - table.x @ b[2:]))


def print_kinds(table: Tabled, p: FloatArray) -> None:
    """How many of each kind are refused."""
    hits = Counter(table.kind)
    refused = Counter(
        kind for kind, own in zip(table.kind, p, strict=True) if own < FALSE_DISCOVERY
    )
    shown = Table(
        f"refused where P < {FALSE_DISCOVERY:g}", "kind:24", "refused:d", "of:d", "share:.1%"
    )
    for kind in sorted(hits):
        shown.row(kind, refused[kind], hits[kind], refused[kind] / hits[kind])
    few = {kind for kind in hits if kind.endswith("1 or 2 hits")}
    bad = [kind for kind in hits if kind != "good" and kind not in few]
    missed = sum(hits[kind] - refused[kind] for kind in bad)
    print(f"bad hits missed, where others can be asked: {missed} of {sum(hits[k] for k in bad)}")


def print_worth(learn: Tabled, test: Tabled) -> None:
    """What each feature is worth: log loss, Brier score, good hits refused and bad ones missed
    without it.
    """
    shown = Table("", "without:12", "log loss:.4f", "Brier:.4f", "good refused:d", "bad missed:d")
    for k in (-1, *range(len(NAMES))):
        p = probability(test, fitted(learn, [j for j in range(len(NAMES)) if j != k]))
        refused = p < FALSE_DISCOVERY
        wrong = np.sum(refused & test.good), np.sum(~refused & ~test.good)
        shown.row(NAMES[k] if k >= 0 else "nothing", *scores(p, test.good), *wrong)


def calibrate_hits(campaigns: int = 200, seed: int = 0) -> None:
    """The weights of the hits' probability, its reliability, and the worth of each feature."""
    learned = list(looked_at(range(seed, seed + campaigns)))
    others = list(looked_at(range(seed + 1000, seed + 1000 + campaigns)))
    learn, test = tabled(learned), tabled(others)
    b = fitted(learn)
    used = np.array([CONSTANT, ALONE, *(WEIGHTS[name].weight for name in NAMES)])
    for name, weights in (("in use", used), ("fitted", b)):
        print(f"{name:8} log loss %.4f, Brier %.4f" % scores(probability(test, weights), test.good))
    p = probability(test, used)
    print_kinds(test, p)
    print_reliability(
        p, test.good, "hits", "that is good", (0, 0.01, 0.1, 0.3, 0.5, 0.9, 0.97, 0.99)
    )
    print_worth(learn, test)
    print(f"CONSTANT = {b[0]:.2f}\nALONE = {b[1]:.2f}")
    for name, weight, row in zip(NAMES, b[2:], usual(learned).values(), strict=True):
        own = WEIGHTS[name]
        parts = [f"unit={own.unit:g}"] * bool(own.unit)
        parts += ["centre={:.2f}, between={:.2f}, within={:.2f}".format(*row)] * bool(own.between)
        said = ", ".join(parts) + (f", least={own.least:g}" if own.least != LEAST else "")
        print(f'    "{name}": Weight({weight:.2f}, {said}),')
