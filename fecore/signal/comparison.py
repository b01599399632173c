"""How far a hit's FRF lies from those of the other hits of its point.

A hit at x + δ beside its point x excites mode k with φ_k(x) + ∇φ_k(x)·δ in place of φ_k(x): the poles stay, each mode's share
changes by another amount. So a misplaced hit differs from a noisy one by deviations in many bands at once, and from a strong or
a weak one by bands that change unlike one another. Each hit i is held against the median H̄_i of the point's other hits (real
and imaginary parts apart; a median with the hit itself would follow it half-way where hits are few), and |H_i - H̄_i|² is summed
in bands b. A band is measured by what it usually is over all hits of the campaign, U_b; a point where shapes are steep scatters
more than others, so the other hits of the point count too, with the campaign's word worth ten hits:

    distance_i = mean over b of √(E_ib / V_b),    V_b = (10 U_b + Σ_j E_jb) / (10 + n),

over the point's n other hits but the farthest, in units of its median over the campaign. The mean of roots lets no single band,
such as one line of hum, speak for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray

BANDS = 32  # of an FRF, compared one by one
FEWEST = 3
"""Hits of one point below which nobody can say which is wrong."""

HIGHEST = 4.0
"""Height over the point's median hit from which a sensitivity or range was another; a place 12 mm off changes it by tenths."""

_MOST_EXCHANGED = 12  # rows that are sorted by exchanges
MOST_LINES = 2048  # that are compared; of more, every k-th
_CAMPAIGN = 10.0  # hits of its own point that what is usual in the campaign is worth
_TRIM = 0.8  # share of the hits, the best alike, that say what is usual
_FEW = 3.0  # by which the unit grows, over the number of hits


@dataclass(frozen=True)
class Deviation:
    """One hit beside the others of its point.

    Attributes:
        likeness: correlation of its FRF with the median, -1 to 1; negative is the opposite sign.
        height: its FRF over that of the point's median hit, as geometric mean over the bands.
        energy: (BANDS,) sum of |H_i - H̄_i|² in each band, times (h - 1)/h.
    """

    likeness: float
    height: float
    energy: FloatArray

    @property
    def comparable(self) -> bool:
        """Whether its distance says where it was hit: neither its sign nor its height is another."""
        return self.likeness > 0 and 1 / HIGHEST < self.height < HIGHEST


@dataclass(frozen=True)
class Offset:
    """How far a hit landed from the others of its point: `distance_m` ± `sd_m`; a limit below `usual_m` would refuse hits
    that land as the campaign's usually do.
    """

    distance_m: float
    sd_m: float
    usual_m: float = 0.0


@dataclass(frozen=True)
class Comparison:
    """The same on the campaign's scale: `distance` in typical distances, see the module; `offset` in metres where the hit
    could be located.
    """

    likeness: float
    height: float
    distance: float
    offset: Offset | None = None


def compare_lines(start: int, stop: int) -> slice:
    """Lines of the band that hits are compared on: all, or every second, third ... of a long band."""
    return slice(start, stop, max(1, -(-(stop - start) // MOST_LINES)))


def deviations(forces: ComplexArray, responses: ComplexArray) -> list[Deviation]:
    """Each of the (h, L) hits of a point beside the others.

    Args:
        forces: (h, L) spectra of the force.
        responses: (h, L) spectra of one response.
    """
    frf = responses / np.where(forces == 0, 1e-300, forces)
    parts = np.ascontiguousarray(frf.real), np.ascontiguousarray(frf.imag)
    order = [_sorted(part) for part in parts]
    usual = [_median(rows) for rows in order]
    edges = np.linspace(0, frf.shape[1], BANDS + 1).astype(int)[:-1]
    off = sum((part - _median_of_others(part, rows)) ** 2 for part, rows in zip(parts, order, strict=True))
    energy = np.add.reduceat(off, edges, axis=1) * (len(frf) - 1) / len(frf)
    power, own, both = (
        np.add.reduceat(values, edges, axis=-1)
        for values in (
            usual[0] ** 2 + usual[1] ** 2,
            parts[0] ** 2 + parts[1] ** 2,
            parts[0] * usual[0] + parts[1] * usual[1],
        )
    )
    weight = 1 / np.maximum(power, 1e-300)  # each band counts alike
    likeness = both @ weight / np.maximum(np.sqrt((own @ weight) * (power @ weight)), 1e-300)
    level = np.log(np.maximum(own, 1e-300)) / 2
    height = np.exp((level - _median(_sorted(level))).mean(axis=1))
    return [Deviation(float(a), float(s), e) for a, s, e in zip(likeness, height, energy, strict=True)]


def _sorted(values: FloatArray) -> FloatArray:
    """(h, L) each line's values in rising order. Few rows are sorted by exchanges of whole rows, which is many times as
    fast as a sort of each short column.
    """
    if len(values) > _MOST_EXCHANGED:
        return np.sort(values, axis=0)
    spare, *rows = np.concatenate((values[:1], values))
    for end in range(len(rows) - 1, 0, -1):
        for i in range(end):
            low = np.minimum(rows[i], rows[i + 1], out=spare)
            np.maximum(rows[i], rows[i + 1], out=rows[i + 1])
            spare, rows[i] = rows[i], low
    return np.array(rows)


def _median(order: FloatArray) -> FloatArray:
    """(L,) median of rows in rising order."""
    middle: FloatArray = (order[(len(order) - 1) // 2] + order[len(order) // 2]) / 2
    return middle


def _median_of_others(values: FloatArray, order: FloatArray) -> FloatArray:
    """(h, L) for each row the median of the others, from the order of all.

    Of the two values in the middle of an even number of rows, or the three of an odd one, a row takes one away: its own,
    or the outer one on its side. What is left is the median of the others, or its double.
    """
    low, high = (len(order) - 2) // 2, (len(order) - 1) // 2 + 1
    middle: FloatArray = order[low : high + 1].sum(axis=0) - np.clip(values, order[low], order[high])
    if high - low == 2:
        middle /= 2
    return middle


def compare(found: Sequence[Sequence[Deviation | None]]) -> list[list[Comparison | None]]:
    """The deviations of all hits of a campaign, point by point, on one scale.

    Few hits make an uncertain scale: the distance is lessened by 1 + 3/h for h hits in all. Where half of a point's
    hits would be far, nobody can say which of them are right, and none of them is far.
    """
    known = [d for point in found for d in point if d is not None and d.comparable]
    if not known:
        return [[None if d is None else Comparison(d.likeness, d.height, 0.0) for d in point] for point in found]
    energies = np.sort(np.array([d.energy for d in known]), axis=0)
    usual = energies[: max(int(_TRIM * len(known)), 2)].mean(axis=0)
    usual = np.maximum(usual, 1e-12 * max(float(usual.max()), 1e-300))
    far = [_roots([None if d is None else d.energy / usual for d in point]) for point in found]
    middle = [
        f for point, ds in zip(far, found, strict=True) for f, d in zip(point, ds, strict=True) if d and d.comparable
    ]
    unit = float(np.median(middle)) * (1 + _FEW / len(known))
    return [
        [
            None if d is None else Comparison(d.likeness, d.height, f / unit if unit > 0 else 0.0)
            for d, f in zip(ds, point, strict=True)
        ]
        for ds, point in zip(found, far, strict=True)
    ]


def _roots(shares: Sequence[FloatArray | None]) -> list[float]:
    """The distance of each hit of a point, of its energies as shares of the campaign's; 0 where it was not compared."""
    found = []
    means = {j: float(s.mean()) for j, s in enumerate(shares) if s is not None}
    order = sorted(means, key=means.__getitem__)
    for i, own in enumerate(shares):
        others = [shares[j] for j in order if j != i]
        near = np.array(others[: max(len(others) - 1, 1)]).reshape(-1, BANDS)
        scale = (_CAMPAIGN + near.sum(axis=0)) / (_CAMPAIGN + len(near))
        found.append(0.0 if own is None else float(np.mean(np.sqrt(own / scale))))
    return found
