"""How far a hit's FRF lies from those of the other hits of its point.

A hit at x + δ beside its point x excites mode k with φ_k(x) + ∇φ_k(x)·δ in place of φ_k(x): the poles stay, each mode's share
changes by another amount. So a misplaced hit differs from a noisy one by deviations in many bands at once. Two hits i, j are
apart in band b, after one of opposite sign is turned, by r_ijb = Σ|H_i - H_j|² / ½Σ(|H_i|² + |H_j|²), and

    distance_ij = mean over b of √(r_ijb / u_b),    u_b the campaign's median of r_ijb between hits that seem good.

The mean of roots lets no single band, such as one line of hum, speak for all. A hit's distance is the median of
those to the others, each weighted by its probability of being good: what most agree on is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.frf import Dof
from fecore.signal.shares import hit_frfs
from fecore.signal.traits import Traits

BANDS = 32  # of an FRF, compared one by one
MOST_LINES = 2048  # that are compared; of more, every k-th
_PARTNERS = 8  # hits of its point that a hit is compared with, the following ones and then from the first on
_SIGNS = 2  # partners below which no sign is decided
_HALF = 0.42  # of the weight: a median, but of two that weigh nearly the same not the larger
_FEWEST = 0.9  # partners that seem good, each by its probability, below which nobody can say which hit is wrong


@dataclass(frozen=True)
class Pairs:
    """The hits of a point beside one another.

    Attributes:
        partner: (h, m) the hits that each is compared with.
        apart: (h, m, BANDS) r_ijb, of the sensor that objects most.
        likeness: (h, m) correlation of the FRFs, -1 to 1, of the sensor that objects most.
        level: (r, h, BANDS) ln |H| of each response.
    """

    partner: IntArray
    apart: FloatArray
    likeness: FloatArray
    level: FloatArray


@dataclass(frozen=True)
class Point:
    """What the first pass keeps of a point.

    Attributes:
        force: where it was hit.
        responses: where the sensors stood.
        traits: the hits' own numbers.
        pairs: the hits beside one another.
        shares: (h, K) what each resonance has in each hit; None where places are not asked for.
        used: the hits that seemed good.
    """

    force: Dof
    responses: tuple[Dof, ...]
    traits: tuple[Traits, ...]
    pairs: Pairs
    shares: FloatArray | None
    used: tuple[int, ...] = ()


def compare_lines(start: int, stop: int) -> slice:
    """Lines of the band that hits are compared on: all, or every second, third ... of a long band."""
    return slice(start, stop, max(1, -(-(stop - start) // MOST_LINES)))


def pairs(forces: ComplexArray, responses: Sequence[ComplexArray]) -> Pairs:
    """All hits of a point beside one another, from the (h, L) spectra of the force and of each response."""
    count, lines = forces.shape
    step = np.arange(1, min(count - 1, _PARTNERS) + 1)
    partner = (np.arange(count)[:, None] + step) % count
    edges = np.linspace(0, lines, BANDS + 1).astype(int)[:-1]
    apart, likeness = np.zeros((*partner.shape, BANDS)), np.ones(partner.shape)
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
            own = np.maximum(2 * (power + beside - 2 * both) / (power + beside), 0.0)
            more = own.mean(axis=1) > apart[:, m].mean(axis=1)
            apart[more, m] = own[more]
            likeness[:, m] = np.minimum(likeness[:, m], alike)
    return Pairs(partner, apart.astype(np.float32), likeness, level)


def usual_apart(found: Sequence[Pairs], good: Sequence[BoolArray]) -> FloatArray:
    """(BANDS,) u_b of a campaign."""
    known = [p.apart[g][g[p.partner[g]]] for p, g in zip(found, good, strict=True) if p.partner.size]
    rows = np.concatenate(known) if known else np.zeros((0, BANDS))
    return np.maximum(np.median(rows, axis=0), 1e-12) if len(rows) else np.ones(BANDS)


def compare(own: Pairs, turned: BoolArray, probability: FloatArray, usual: FloatArray) -> FloatArray:
    """(h, 3) what the other hits of its point say of each hit: 1 less the correlation of its FRF with theirs, its distance, and
    the height of its FRF over theirs; NaN where too few of them seem good, or are there to decide the sign.

    Args:
        own: the point's hits beside one another.
        turned: (h,) whose pulse points the other way, which is known to reverse their FRF.
        probability: (h,) that each is good by its own numbers. Most faults leave the sign as it is, so it is asked of all.
        usual: u_b.
    """
    distance = np.sqrt(own.apart / usual).mean(axis=2)
    sign = np.where(turned, -1, 1)
    found = np.full((len(probability), 3), np.nan)
    for i, partner in enumerate(own.partner):
        weight = probability[partner]
        if partner.size >= _SIGNS:
            found[i, 0] = 1 - sign[i] * float(np.mean(sign[partner] * own.likeness[i]))
        if weight.sum() >= _FEWEST:
            off = np.array([_common(rows) for rows in own.level[:, i : i + 1] - own.level[:, partner]])
            off = np.array([row[_middle(np.abs(row), weight)] for row in off])
            found[i, 1:] = distance[i, _middle(distance[i], weight)], np.exp(off[np.argmax(np.abs(off))])
    return found


def _common(off: FloatArray) -> FloatArray:
    """(m,) what (m, BANDS) differences have in common, drawn to nil where they differ among themselves: a sensitivity or range
    moves all bands alike, another place each by another amount.
    """
    mean = off.mean(axis=1)
    return np.asarray(mean**3 / np.maximum(mean**2 + off.var(axis=1), 1e-300))


def _middle(values: FloatArray, weight: FloatArray) -> int:
    """Where the weighted median lies; of two values of about one weight, the smaller."""
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weight[order])
    return int(order[np.searchsorted(sums, _HALF * sums[-1])])
