"""How far a hit's FRF lies from those of the other hits of its point.

A hit at x + δ beside its point x excites mode k with φ_k(x) + ∇φ_k(x)·δ in place of φ_k(x): the
poles stay, each mode's share changes by another amount. So a misplaced hit differs from a noisy one
by deviations in many bands at once. In band b, with P the power of an FRF there, two hits i, j are
apart, after one of opposite sign is turned, by

    r_ijb = Σ|H_i - H_j|² / √(½(P_ib + P_jb) M_b),    M_b the mean of P_b over the sensor's points,
    distance_ij = mean over b of √(r_ijb / u_b),    u_b the campaign's median of r_ijb between hits that seem good.

Near a node P is small and ∇φ large, so deviations over P alone are largest there however good the
hit; over √(P M) they are about alike at all points. The mean of roots lets no single band, such as
one line of hum, speak for all. A hit's distance is the median of those to the others, each weighted
by its probability of being good: what most agree on is right.

A sensitivity or range moves all bands alike, another place each by another amount. With l_b the
difference of ln|H| between two hits, weighted by 1/s_b², s_b the campaign's median of |l_b|, all
bands share the factor exp(g),

    g = m³/(m² + v),    m the weighted mean of l_b, v its weighted variance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.frf import Dof
from fecore.signal.hit_features import HitFeatures
from fecore.signal.participation import hit_frfs

BANDS = 32  # of an FRF, compared one by one
MOST_LINES = 2048  # that are compared; of more, every k-th
# hits of its point that a hit is compared with, the following ones and then from the first on
_PARTNERS = 8
_SIGNS = 2  # partners below which no sign is decided
_HALF = 0.42  # of the weight: a median, but of two that weigh nearly the same not the larger
_LEVEL = 0.01  # that good hits' levels are at least apart
# partners that seem good, each by its probability, below which nobody can say which hit is wrong
_FEWEST = 0.9


@dataclass(frozen=True)
class Pairs:
    """The hits of a point beside one another."""

    partner: IntArray  # (h, m) the hits that each is compared with
    apart: FloatArray  # (r, h, m, BANDS) Σ|H_i - H_j|² over their mean power, of each response
    likeness: FloatArray  # (h, m) correlation of the FRFs, -1 to 1, of the sensor that objects most
    level: FloatArray  # (r, h, BANDS) ln |H| of each response

    def between(self) -> FloatArray:
        """(r, h, m, BANDS) differences of the levels of each hit and its partners."""
        return np.asarray(self.level[:, :, None] - self.level[:, self.partner])


@dataclass(frozen=True)
class Point:
    """What the first pass keeps of a point."""

    force: Dof  # where it was hit
    responses: tuple[Dof, ...]  # where the sensors stood
    features: tuple[HitFeatures, ...]  # the hits' own numbers
    pairs: Pairs  # the hits beside one another
    # (h, K) what each resonance has in each hit; None where places are not asked for
    participation: FloatArray | None
    used: tuple[int, ...] = ()  # the hits that seemed good

    def scaled(self, common: Mapping[Dof, FloatArray]) -> FloatArray:
        """(r, h, m, BANDS) r_ijb, from ½ ln M_b by sensor."""
        level, partner = self.pairs.level, self.pairs.partner
        mean = (np.logaddexp(2 * level[:, :, None], 2 * level[:, partner]) - np.log(2)) / 2
        over = mean - np.array([common[dof] for dof in self.responses])[:, None, None]
        return np.asarray(self.pairs.apart * np.exp(np.clip(over, -300, 300)))


def compare_lines(start: int, stop: int) -> slice:
    """Lines of the band that hits are compared on: all, or every second, third ... of a long
    band.
    """
    return slice(start, stop, max(1, -(-(stop - start) // MOST_LINES)))


def pairs(forces: ComplexArray, responses: Sequence[ComplexArray]) -> Pairs:
    """All hits of a point beside one another, from the (h, L) spectra of the force and of each
    response.
    """
    count, lines = forces.shape
    step = np.arange(1, min(count - 1, _PARTNERS) + 1)
    partner = (np.arange(count)[:, None] + step) % count
    edges = np.linspace(0, lines, BANDS + 1).astype(int)[:-1]
    apart, likeness = (
        np.empty((len(responses), *partner.shape, BANDS), np.float32),
        np.ones(partner.shape),
    )
    level = np.empty((len(responses), count, BANDS))
    for r, response in enumerate(responses):
        frf = hit_frfs(forces, response)
        power = np.maximum(np.add.reduceat(frf.real**2 + frf.imag**2, edges, axis=1), 1e-300)
        level[r] = np.log(power) / 2
        for m in range(partner.shape[1]):
            other, beside = frf[partner[:, m]], power[partner[:, m]]
            both = np.add.reduceat(frf.real * other.real + frf.imag * other.imag, edges, axis=1)
            alike = both.sum(axis=1) / (np.sqrt(power.sum(axis=1)) * np.sqrt(beside.sum(axis=1)))
            both = np.where(alike < 0, -1, 1)[:, None] * both  # a reversed cable is no other place
            apart[r, :, m] = np.maximum(2 * (power + beside - 2 * both) / (power + beside), 0.0)
            likeness[:, m] = np.minimum(likeness[:, m], alike)
    return Pairs(partner, apart, likeness, level)


@dataclass(frozen=True)
class Usual:
    """What good hits of a campaign are apart: ½ ln M_b by sensor, and (BANDS,) u_b and s_b."""

    common: Mapping[Dof, FloatArray]
    apart: FloatArray
    level: FloatArray


def usual_of(points: Sequence[Point], good: Sequence[BoolArray]) -> Usual:
    """What the hits that seem good are apart."""
    levels: dict[Dof, list[FloatArray]] = {}
    for point, g in zip(points, good, strict=True):
        for dof, level in zip(point.responses, point.pairs.level, strict=True):
            levels.setdefault(dof, []).append(
                np.asarray(np.median(level[g] if g.any() else level, axis=0))
            )
    common = {
        dof: np.log(np.mean(np.exp(2 * np.array(rows)), axis=0)) / 2 for dof, rows in levels.items()
    }
    chosen = [(p, g[:, None] & g[p.pairs.partner]) for p, g in zip(points, good, strict=True)]
    apart = np.concatenate([p.scaled(common)[:, both].reshape(-1, BANDS) for p, both in chosen])
    level = np.concatenate(
        [np.abs(p.pairs.between()[:, both]).reshape(-1, BANDS) for p, both in chosen]
    )
    if not len(apart):
        return Usual(common, np.ones(BANDS), np.ones(BANDS))
    return Usual(
        common,
        np.maximum(np.median(apart, axis=0), 1e-12),
        np.maximum(np.median(level, axis=0), _LEVEL),
    )


def compare(point: Point, turned: BoolArray, probability: FloatArray, usual: Usual) -> FloatArray:
    """(h, 3) what the other hits of its point say of each hit: 1 less the correlation of its FRF
    with theirs, its distance, and the height exp(g) of its FRF over theirs; NaN where too few of
    them seem good, or are there to decide the sign.

    Args:
        point: the hits beside one another.
        turned: (h,) whose pulse points the other way, which is known to reverse their FRF.
        probability: (h,) that each is good by its own numbers. Most faults leave the sign as it is,
            so it is asked of all.
        usual: of the campaign.
    """
    own, sign = point.pairs, np.where(turned, -1, 1)
    distance = np.sqrt(point.scaled(usual.common) / usual.apart).mean(axis=3).max(axis=0)
    gains = _common(own.between(), 1 / usual.level**2)
    height = np.take_along_axis(gains, np.abs(gains).argmax(axis=0)[None], axis=0)[0]
    comparison = np.full((len(probability), 3), np.nan)
    for i, partner in enumerate(own.partner):
        weight = probability[partner]
        if partner.size >= _SIGNS:
            comparison[i, 0] = 1 - sign[i] * float(np.mean(sign[partner] * own.likeness[i]))
        if weight.sum() >= _FEWEST:
            middle = (
                values[i, _middle(np.abs(values[i]), weight)] for values in (distance, height)
            )
            comparison[i, 1:] = next(middle), np.exp(next(middle))
    return comparison


def _common(off: FloatArray, weight: FloatArray) -> FloatArray:
    """The g of (..., BANDS) differences of levels."""
    mean = np.average(off, axis=-1, weights=weight)
    variance = np.average((off - mean[..., None]) ** 2, axis=-1, weights=weight)
    return np.asarray(mean**3 / np.maximum(mean**2 + variance, 1e-300))


def _middle(values: FloatArray, weight: FloatArray) -> int:
    """Where the weighted median lies; of two values of about one weight, the smaller."""
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weight[order])
    return int(order[np.searchsorted(sums, _HALF * sums[-1])])
