"""Control charts of scores: EWMA (Roberts 1959), CUSUM (Page 1954) and Shewhart's, one side each.

Upwards, with scores z and S₀ = 0, all are

    S_i = min(2h, max(0, a S_{i−1} + b z_i − c)),   outside where S_i > h

EWMA with weight λ: a = 1 − λ, b = λ, c = 0; CUSUM with reference value k: a = b = 1, c = k;
Shewhart: a = c = 0, b = 1. The floor at 0 keeps a chart from falling asleep on the good side; the
cap at 2h lets it return when a structure has been repaired. Downwards the scores change sign.

A chart with memory is slow to see what is plain in one campaign, so a campaign is outside too where
its own score is above a limit c: the combined chart (Lucas and Saccucci 1990). Both limits together
are set from the false-alarm rate.

How long a chart runs before it calls: run lengths by Markov chain (Brook and Evans 1972), and
limits from them.

The chart's value is cut into cells; a score's distribution gives the probability of going from the
middle of one cell into another, and powers of that matrix the distribution of the run length N.

A limit is set from a false-alarm rate α a campaign: over the first H campaigns after the baseline
the probability that an unchanged structure is called shall be 1 − (1 − α)^H. The baseline is short,
so its mean and scatter are wrong by amounts that all later scores share. Given the error e of its
mean (in standard deviations of a campaign) and the ratio q of its scatter to the true one, scores
are independent with

    P(z ≤ u | e, q) = Φ(q √(1+g) T_ν⁻¹(Φ(u)) + e),   e ~ N(0, g),  q² ~ χ²_ν / ν

g = the variance of the baseline's mean over that of a campaign (1/n for n equal campaigns). P(N ≤
H) is averaged over e (Gauss–Hermite) and q (Gauss–Legendre in probability).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, overload

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.errors import InputError

CAP = 2.0  # highest value of a chart, in units of its limit

Kind = Literal["ewma", "cusum", "shewhart"]


@dataclass(frozen=True)
class Limits:
    """Where a campaign is outside."""

    chart: float  # h, for the chart's value
    score: float = float("inf")  # c, for the campaign's own score; infinite where there is none


@dataclass(frozen=True)
class Chart:
    """A kind of chart."""

    kind: Kind = "ewma"  # `ewma`, `cusum` or `shewhart`
    # λ of an EWMA, 0 < λ ≤ 1. Small for slow and small changes, large for sudden ones
    weight: float = 0.3
    reference: float = 0.5  # k of a CUSUM, half the change to be found, in standard deviations
    # share of the false alarms that the limit on single scores may take; 0 for none
    jump_share: float = 0.5

    def __post_init__(self) -> None:
        if self.kind not in ("ewma", "cusum", "shewhart"):
            raise InputError("chart.kind", f"is {self.kind!r}, expected ewma, cusum or shewhart")
        if not 0 < self.weight <= 1:
            raise InputError("chart.weight", f"is {self.weight}, expected 0 < weight ≤ 1")
        if not 0 < self.reference < 10:
            raise InputError("chart.reference", f"is {self.reference}, expected 0 < reference < 10")
        if not 0 <= self.jump_share < 1:
            raise InputError(
                "chart.jump_share", f"is {self.jump_share}, expected 0 ≤ jump_share < 1"
            )

    @property
    def recursion(self) -> tuple[float, float, float]:
        """(a, b, c) of the recursion."""
        if self.kind == "cusum":
            return 1.0, 1.0, self.reference
        weight = 1.0 if self.kind == "shewhart" else self.weight
        return 1 - weight, weight, 0.0

    def run(self, scores: FloatArray, limit: float, before: float = 0.0) -> FloatArray:
        """The chart's values S for scores that rise with the change looked for, after S₀."""
        a, b, c = self.recursion
        values = np.empty(scores.size)
        s = before
        for i, z in enumerate(scores):
            s = min(CAP * limit, max(0.0, a * s + b * float(z) - c))
            values[i] = s
        return values

    def outside(
        self, scores: FloatArray, limits: Limits, before: float = 0.0
    ) -> tuple[FloatArray, BoolArray]:
        """The chart's values after S₀, and whether each campaign is outside."""
        values = self.run(scores, limits.chart, before)
        return values, (values > limits.chart) | (scores > limits.score)


CELLS = 60  # cells between 0 and the limit; 60 hold the average run length of usual charts to 0.5 %
KNOWN = 1000.0  # degrees of freedom from which the scatter counts as known
_MEMORYLESS = 2  # cells of a Shewhart chart, which goes anywhere from anywhere: exact
_SHIFTS = 7  # quadrature nodes of e; with twice as many, limits move by less than 0.5 % (ν ≥ 5)
_RATIOS = 6  # quadrature nodes of q
_LOG_LIMITS = (np.log(0.02), np.log(60.0))  # between which limits are looked for


def average_run_length(
    chart: Chart, limits: Limits, shift: float = 0.0, pending: int = 1, cells: int = CELLS
) -> float:
    """Mean number of campaigns up to the alarm, for independent normal scores with mean `shift` and
    S₀ = 0.

    Args:
        chart: kind and constants.
        limits: h and c.
        shift: mean of the scores, standard deviations.
        pending: consecutive campaigns outside that make an alarm.
        cells: of the Markov chain between 0 and h.
    """
    scores, inside = _edges(chart, limits, cells, pending)
    return _mean_run_length(
        _chain(
            scipy.special.ndtr(scores - shift),
            scipy.special.ndtr(limits.score - shift),
            inside,
            pending,
        )
    )


def alarm_probability(
    chart: Chart,
    limits: Limits,
    campaigns: int,
    pending: int = 1,
    shared: float = 0.0,
    degrees_of_freedom: float = KNOWN,
) -> float:
    """P(N ≤ campaigns) of an unchanged structure, averaged over what the baseline does not know.

    Args:
        chart: kind and constants.
        limits: h and c.
        campaigns: H.
        pending: consecutive campaigns outside that make an alarm.
        shared: g, variance of the baseline's mean in units of a campaign's variance; 0 where it is
            known.
        degrees_of_freedom: ν of the baseline's scatter.
    """
    scores, inside = _edges(chart, limits, CELLS, pending)
    deviates, highest = (
        _deviate(scores, degrees_of_freedom),
        _deviate(limits.score, degrees_of_freedom),
    )
    total = 0.0
    for e, q, weight in _unknowns(shared, degrees_of_freedom):
        scale = q * np.sqrt(1 + shared)
        below = scipy.special.ndtr(scale * deviates + e), scipy.special.ndtr(scale * highest + e)
        total += weight * _called_within(_chain(*below, inside, pending), campaigns)
    return total


@lru_cache(maxsize=512)
def control_limits(
    chart: Chart,
    probability: float,
    campaigns: int,
    pending: int = 1,
    shared: float = 0.0,
    degrees_of_freedom: float = KNOWN,
) -> Limits:
    """The limits at which `alarm_probability` is `probability`, `chart.jump_share` of it from
    single scores.

    Raises:
        InputError: a probability or number of campaigns out of range.
    """
    if not 0 < probability < 1:
        raise InputError("probability", f"is {probability}, expected between 0 and 1")
    if campaigns < pending or pending < 1:
        raise InputError(
            "campaigns",
            f"{campaigns} campaigns and a pending period of {pending}: nothing can be called",
        )

    def solve(kind: Chart, target: float, score: float) -> float:
        def excess(log_limit: float) -> float:
            limits = Limits(float(np.exp(log_limit)), score)
            called = alarm_probability(kind, limits, campaigns, pending, shared, degrees_of_freedom)
            return float(
                scipy.special.logit(np.clip(called, 1e-12, 1 - 1e-12)) - scipy.special.logit(target)
            )

        return float(np.exp(scipy.optimize.brentq(excess, *_LOG_LIMITS, xtol=1e-3)))

    if chart.kind == "shewhart" or chart.jump_share == 0:
        return Limits(solve(chart, probability, float("inf")))
    score = solve(Chart("shewhart"), probability * chart.jump_share, float("inf"))
    return Limits(solve(chart, probability, score), score)


def _unknowns(shared: float, degrees_of_freedom: float) -> list[tuple[float, float, float]]:
    """Nodes (e, q) and their weights."""
    if shared > 0:
        x, w = np.polynomial.hermite_e.hermegauss(_SHIFTS)
        shifts = list(zip(np.sqrt(shared) * x, w / w.sum(), strict=True))
    else:
        shifts = [(0.0, 1.0)]
    if degrees_of_freedom < KNOWN:
        x, w = np.polynomial.legendre.leggauss(_RATIOS)
        q = np.sqrt(scipy.special.chdtri(degrees_of_freedom, (1 - x) / 2) / degrees_of_freedom)
        ratios = list(zip(q, w / 2, strict=True))
    else:
        ratios = [(1.0, 1.0)]
    return [(float(e), float(q), float(we * wq)) for e, we in shifts for q, wq in ratios]


@overload
def _deviate(scores: float, degrees_of_freedom: float) -> float: ...
@overload
def _deviate(scores: FloatArray, degrees_of_freedom: float) -> FloatArray: ...
def _deviate(scores: float | FloatArray, degrees_of_freedom: float) -> float | FloatArray:
    """T_ν⁻¹(Φ(u)) of scores u: the same for all e and q."""
    return (
        scores
        if degrees_of_freedom >= KNOWN
        else np.interp(scores, *_t_of_normal(degrees_of_freedom))
    )


@lru_cache(maxsize=64)
def _t_of_normal(degrees_of_freedom: float) -> tuple[FloatArray, FloatArray]:
    """T_ν⁻¹(Φ(u)) on a grid of u; linear between, which is exact to 1e-4 of a standard
    deviation.
    """
    half = np.linspace(0, 8, 801)
    t = -scipy.special.stdtrit(degrees_of_freedom, scipy.special.ndtr(-half))
    return np.concatenate([-half[:0:-1], half]), np.concatenate([-t[:0:-1], t])


@dataclass(frozen=True)
class _Chain:
    """Markov chain of a chart: transitions by scores within c, by scores above c, and how many
    cells are inside h.
    """

    within: FloatArray
    above: FloatArray
    inside: int
    pending: int

    def start(self) -> FloatArray:
        """S₀ = 0; row j holds the distribution of charts that were outside j times running."""
        waiting = np.zeros((self.pending, self.within.shape[0]))
        waiting[0, 0] = 1.0
        return waiting

    def advance(self, waiting: FloatArray) -> FloatArray:
        """One campaign later; what is missing has been called."""
        moved = waiting @ self.within
        following = np.zeros_like(waiting)
        following[0, : self.inside] = moved[:, : self.inside].sum(axis=0)
        following[1:, self.inside :] = moved[:-1, self.inside :]
        following[1:] += waiting[:-1] @ self.above
        return following


def _edges(chart: Chart, limits: Limits, cells: int, pending: int) -> tuple[FloatArray, int]:
    """Scores that lead from each cell to the upper edge of each, and how many cells are inside h.

    Cell 0 is [0, w/2] and stands for 0; h is the upper edge of the last cell inside. Where one
    campaign outside is an alarm, the cells above the limit are not needed.
    """
    a, b, c = chart.recursion
    cells = _MEMORYLESS if chart.kind == "shewhart" else cells
    width = limits.chart / (cells - 0.5)
    number = cells if pending == 1 else int(np.ceil(CAP * limits.chart / width))
    middle = width * np.arange(number)
    scores = (middle + width / 2 + c - a * middle[:, None]) / b
    if pending > 1:
        scores[:, -1] = np.inf  # the cap
    return scores, cells


def _chain(reached: FloatArray, single: float, inside: int, pending: int) -> _Chain:
    """The chain of P(score ≤ edge), and of P(score ≤ c)."""
    below = np.minimum(reached, single)
    within = np.diff(below, axis=1, prepend=0.0)
    return _Chain(within, np.diff(reached - below, axis=1, prepend=0.0), inside, pending)


def _called_within(chain: _Chain, campaigns: int) -> float:
    """P(N ≤ campaigns)."""
    waiting = chain.start()
    for _ in range(campaigns):
        # Most charts call at the first campaign outside, and limits take ten thousands of these
        # steps.
        waiting = waiting @ chain.within if chain.pending == 1 else chain.advance(waiting)
    return float(1 - waiting.sum())


def _mean_run_length(chain: _Chain) -> float:
    """Σ P(N > i): (I − Q)⁻¹ 1 where one campaign outside is enough, else summed until the tail is
    geometric.
    """
    if chain.pending == 1:
        n = chain.within.shape[0]
        return float(np.linalg.solve(np.eye(n) - chain.within, np.ones(n))[0])
    waiting, total, alive, ratio = chain.start(), 0.0, 1.0, 0.0
    while True:
        total += alive
        waiting = chain.advance(waiting)
        left = float(waiting.sum())
        if left < 1e-12 or abs(left / alive - ratio) < 1e-12:
            return total + (left / (1 - left / alive) if left < alive else 0.0)
        alive, ratio = left, left / alive
