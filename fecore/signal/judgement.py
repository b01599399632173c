"""Which hits are good: one probability for each, and the reasons against a bad one.

Each number v of a hit (`hit_features`, `comparison`, `hit_location`) is held against what is usual:
as u = v/unit; where each campaign has a level of its own as u = v/(unit e^(c - c₀)); and where it
has a scatter of its own as

    u = (ln v - c)/(3 s),    s² = (n₀ s₀² + n s_c²)/(n₀ + n),    c = (c₀/τ² + n c_c/2s²)/(1/τ² + n/2s²),

c_c and s_c middle and standard deviation of those of the campaign's n other hits that lie about
their shortest half (Rousseeuw and Leroy, 1987), which up to half of them may spoil; c₀, τ, s₀ of
`weights` a prior for campaigns of few hits. u counts on its bad side. Then

    logit P = b₀ - b₁ [no hit is beside it] - Σ b_k ln(1 + u_k⁴),

so one number that is far off is enough, and none counts that is as usual. Hits of a point are
compared among those that seem good by their own numbers; where all of a point's hits lie apart, or
have a louder floor, its scale is drawn to theirs. A hit is refused where P is below the level that
the user chooses: no refused hit is good with more than this probability.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from typing import TYPE_CHECKING

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.frf import Dof
from fecore.signal.comparison import Point, compare, usual_of
from fecore.signal.hit_features import OWN, HitFeatures
from fecore.signal.hit_location import Position, locate
from fecore.signal.reasons import Criterion, HitFinding, finding, reason
from fecore.signal.weights import ALONE, CONSTANT, LEAST, WEIGHTS, Weight

if TYPE_CHECKING:
    from fecore.signal.document import Processing

FALSE_DISCOVERY = 0.75
"""Largest probability of being good that a refused hit has."""

_PRIOR = 20.0  # n₀
_BESIDE = 2.5  # standard deviations about the shortest half up to which a value is a usual one
_TYPICAL_M = 0.006  # that a typical distance stands for at most
_ALONE_IN = 24  # hits up to which each is held against the others; of more, against all
_OWN = 5.0  # hits of its own point that the campaign's scale of distances is worth
_FULL_SCALE = 0.998  # of what is stated, from which a channel is overloaded
# u beyond which nothing more is learnt; a number that refuses a hit alone from there on refuses
# none
_FAR = 20.0
_HEAVY = 2.0  # part of the logit that is a reason; of a refused hit the largest part is one, too

NAMES = (*OWN, "offset", "unlike", "distance", "gain")
_TURNED, _FLOOR, _OFFSET, _DISTANCE = (
    OWN.index("turned"),
    OWN.index("floor"),
    len(OWN),
    len(OWN) + 2,
)
# bad where they are low, too, and how much wider u is there
_LOW = {"height": 1, "gain": 1, "floor": 3}


@dataclass(frozen=True)
class HitVerdict:
    """What is said of a hit."""

    force: Dof  # where it was hit
    number: int  # which hit of its point it is
    probability: float  # that it is good
    # of each criterion the number that weighs most, the heaviest first
    findings: tuple[HitFinding, ...]
    overruled: bool | None = None  # what a user has decided against them, or None
    directions: int = 0  # along how many it shows by millimetres where the hit landed

    @property
    def faults(self) -> tuple[HitFinding, ...]:
        """The findings that failed."""
        return tuple(f for f in self.findings if f.failed)

    @property
    def accepted(self) -> bool:
        """Whether the hit is used."""
        return not self.faults if self.overruled is None else self.overruled


@dataclass(frozen=True)
class Features:
    """Of N hits: (N, F) numbers, their u, and usual number and step of u on their bad side,
    logarithms but where a row of `weights` has a unit; (N,) whether none is beside a hit, and along
    how many directions it was located.
    """

    numbers: FloatArray
    u: FloatArray
    usual: FloatArray
    step: FloatArray
    single: BoolArray
    directions: IntArray


def features_of(points: Sequence[Point], positions: Mapping[int, Position]) -> Features:
    """The features of all hits of a campaign."""
    own = np.array([features.own for point in points for features in point.features])
    turned = own[:, _TURNED] != (np.median(own[:, _TURNED]) > 0.5)
    own[:, _TURNED] = turned
    floor = np.maximum(own[:, _FLOOR], WEIGHTS["floor"].least)
    own[:, OWN.index("early")] /= np.maximum(floor, np.median(floor))
    numbers = np.concatenate((own, np.full((len(own), 4), np.nan)), axis=1)
    edges = np.cumsum([0, *(len(point.features) for point in points)])
    parts = [slice(a, b) for a, b in pairwise(edges)]
    louder = np.maximum(_in_common(numbers[:, _FLOOR], parts, np.ones(len(own), bool)), 1.0)
    numbers[:, _FLOOR] /= louder
    seems = _probability(_logit(_scaled(numbers)[0], np.zeros(len(own), bool)))
    good = seems > 0.5
    usual = usual_of(points, [good[part] for part in parts])
    for point, part in zip(points, parts, strict=True):
        numbers[part, -3:] = compare(point, turned[part], seems[part], usual)
    numbers[:, _DISTANCE] /= _in_common(numbers[:, _DISTANCE], parts, good)
    comparable = good & ~(numbers[:, -3] > 1)
    directions = np.zeros(len(own), dtype=int)
    rows = [(numbers[part], directions[part]) for part in parts]
    _locate(points, positions, [comparable[part] for part in parts], rows)
    u, usual_numbers, step = _scaled(numbers, good)
    numbers[:, _FLOOR] *= louder
    usual_numbers[:, _FLOOR] += np.log(louder)
    return Features(
        numbers, u, usual_numbers, step, ~np.isfinite(numbers[:, _DISTANCE]), directions
    )


def _in_common(values: FloatArray, parts: Sequence[slice], good: BoolArray) -> FloatArray:
    """(N,) factor of each hit by which the good ones among the other hits of its point differ from
    the campaign's, drawn to 1 where they are few: what a point's hits share is the point's, not a
    fault of each.
    """
    logs = np.log(np.maximum(values, LEAST))
    known = good & np.isfinite(values)
    middle = np.median(logs[known]) if known.any() else 0.0
    gain = np.zeros(len(values))
    for part in parts:
        for i in range(part.start, part.stop):
            others = logs[part][known[part] & (np.arange(part.start, part.stop) != i)]
            if others.size:
                gain[i] = (np.median(others) - middle) * others.size / (others.size + _OWN)
    return np.asarray(np.exp(gain))


def _locate(
    points: Sequence[Point],
    positions: Mapping[int, Position],
    comparable: Sequence[BoolArray],
    rows: Sequence[tuple[FloatArray, IntArray]],
) -> None:
    """Fill in how far the hits that can be located landed from the others of their point, mm, and
    along how many directions: points under the same sensors. A hit whose FRF is like those of the
    others is in its place wherever it is located.
    """
    tours: dict[object, list[int]] = {}
    every = {
        i: point.participation for i, point in enumerate(points) if point.participation is not None
    }
    for i in every:
        tours.setdefault((points[i].force.direction, points[i].responses), []).append(i)
    for tour in tours.values():
        participation = [{int(k): every[i][k] for k in np.flatnonzero(comparable[i])} for i in tour]
        located = locate([positions.get(points[i].force.point) for i in tour], participation)
        for i, of_point in zip(tour, located, strict=True):
            numbers, directions = rows[i]
            for k, (offset, along) in of_point.items():
                numbers[k, _OFFSET] = 1e3 * min(offset, _TYPICAL_M * numbers[k, _DISTANCE])
                directions[k] = along


def _scaled(
    numbers: FloatArray, good: BoolArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """U of (N, F) numbers, usual numbers, and steps of u."""
    u, usual, step = (np.zeros(numbers.shape) for _ in range(3))
    for k, name in enumerate(NAMES):
        row = WEIGHTS[name]
        v = numbers[:, k] if row.unit else np.log(np.maximum(numbers[:, k], row.least))
        known = np.isfinite(v) if good is None or k < len(OWN) else good & np.isfinite(v)
        usual[:, k], step[:, k] = _usual(v, known, row)
        if name in _LOW:
            step[:, k] *= np.where(v < usual[:, k], -_LOW[name], 1)
        u[:, k] = np.maximum((v - usual[:, k]) / step[:, k], 0.0)
    return np.clip(np.nan_to_num(u), 0.0, _FAR), usual, step


def _usual(values: FloatArray, known: BoolArray, row: Weight) -> tuple[FloatArray, FloatArray]:
    """(N,) usual value and step of u that each hit is held against."""
    if row.unit and not row.between:
        return np.zeros(len(values)), np.full(len(values), row.unit)
    if row.unit:
        centre, _ = _usual(np.log(np.maximum(values, row.least)), known, row._replace(unit=0.0))
        return np.zeros(len(values)), row.unit * np.exp(centre - row.centre)
    count = np.count_nonzero(known)
    if count > _ALONE_IN:
        middle, spread, n = np.tile(
            (*_usual_of_most(values[known]), float(count)), (len(values), 1)
        ).T
    else:
        others = [values[known & (np.arange(len(values)) != i)] for i in range(len(values))]
        middle, spread, n = np.array(
            [(*_usual_of_most(o), o.size) if o.size else (0.0, 0.0, 0) for o in others]
        ).T
    square = (_PRIOR * row.within**2 + n * spread**2) / (_PRIOR + n)
    certain = 1 / row.between**2 + n / (2 * square)
    centre = (row.centre / row.between**2 + middle * n / (2 * square)) / certain
    return centre, 3 * np.sqrt(square + 1 / certain)


def _usual_of_most(values: FloatArray) -> tuple[float, float]:
    """Middle and standard deviation of the values that lie within `_BESIDE` of them about the
    shortest interval with more than half of all.
    """
    order = np.sort(values)
    half = len(order) // 2 + 1
    width = order[half - 1 :] - order[: len(order) - half + 1]
    start = int(np.argmin(width))
    middle, spread = float(order[start : start + half].mean()), float(width[start]) / 1.349
    near = order[np.abs(order - middle) <= _BESIDE * spread]
    return (float(near.mean()), float(near.std())) if near.size > 1 else (middle, spread)


def _logit(u: FloatArray, single: BoolArray) -> FloatArray:
    return np.asarray(CONSTANT - ALONE * single - parts_of(u).sum(axis=1))


def _probability(logit: FloatArray) -> FloatArray:
    return np.asarray(1 / (1 + np.exp(-np.clip(logit, -500, 500))))


def parts_of(u: FloatArray) -> FloatArray:
    """(N, F) what each feature takes from the logit."""
    return np.asarray(np.log1p(u**4) * np.array([WEIGHTS[name].weight for name in NAMES]))


def judge(points: Sequence[Point], processing: Processing) -> list[list[HitVerdict]]:
    """The verdicts of all hits of a campaign, by point, with what a user has decided against them.

    Args:
        points: their hits' numbers.
        processing: its level below which a probability refuses a hit; where the points lie, by
            which hits are located; and what a user has decided, by place and number.
    """
    level, overrules = processing.false_discovery, processing.overrules
    campaign = features_of(points, processing.positions)
    parts = parts_of(campaign.u)
    probability = _probability(_logit(campaign.u, campaign.single))
    slack = max(CONSTANT - float(np.log(level / (1 - level))), 0.0) if level > 0 else np.inf
    at = np.expm1(slack / np.array([WEIGHTS[name].weight for name in NAMES])) ** 0.25
    limit = campaign.usual + np.where(at < _FAR, at, np.inf) * campaign.step
    limit = np.where(
        [bool(WEIGHTS[name].unit) for name in NAMES],
        limit,
        np.exp(np.where(limit < 500, limit, np.inf)),
    )
    every = enumerate(features for point in points for features in point.features)
    verdicts = (
        replace(
            _verdict(
                features, float(probability[i]), level, campaign.numbers[i], limit[i], parts[i]
            ),
            overruled=overrules.get((features.force, features.number)),
            directions=int(campaign.directions[i]),
        )
        for i, features in every
    )
    return [list(islice(verdicts, len(point.features))) for point in points]


def _verdict(
    features: HitFeatures,
    probability: float,
    level: float,
    numbers: FloatArray,
    limits: FloatArray,
    parts: FloatArray,
) -> HitVerdict:
    least = min(parts.max(), _HEAVY)
    findings: dict[Criterion, HitFinding] = {}
    share, name = features.overload
    if share >= _FULL_SCALE:
        findings["overload"] = reason("full_scale", share, _FULL_SCALE, True, cut=name)
    for k in np.argsort(-parts, kind="stable"):
        if np.isfinite(numbers[k]):
            failed = probability < level and bool(parts[k] >= least)
            own = finding(features, NAMES[k], float(numbers[k]), float(limits[k]), failed)
            findings.setdefault(own.criterion, own)
    return HitVerdict(
        features.force,
        features.number,
        0.0 if share >= _FULL_SCALE else probability,
        tuple(findings.values()),
    )
