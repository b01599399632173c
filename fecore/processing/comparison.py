"""How far a hit's FRF lies from those of the other hits of its point.

The hits of a point, H_i = A_i/F_i, are compared with their median H (real and imaginary parts apart). A hit beside its
point changes every mode by another share, so |H_i - H|² is summed in bands, and each band is measured by what it
usually is over all hits of the campaign: the scatter of good hits, about as large in every band, is then near 1, and a
hit several times farther away than the others stands out in one number,

    distance = √(mean over bands of |H_i - H|² / usual |H_j - H|²)   in units of its median over the campaign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray

BANDS = 32  # of an FRF, compared one by one
FEWEST = 3
"""Hits of one point below which nobody can say which is wrong."""

MOST_LINES = 2048  # that are compared; of more, every k-th
_TRIM = 0.8  # share of the hits, the best alike, that say what is usual
_FEW = 3.0  # by which the unit grows, over the number of hits


@dataclass(frozen=True)
class Deviation:
    """One hit beside the others of its point.

    Attributes:
        likeness: correlation of its FRF with the median, -1 to 1; negative is the opposite sign.
        energy: (BANDS,) sum of |H_i - H|² in each band.
    """

    likeness: float
    energy: FloatArray


@dataclass(frozen=True)
class Comparison:
    """The same on the campaign's scale: `distance` in typical distances; see the module."""

    likeness: float
    distance: float


def compare_lines(band: IntArray) -> IntArray:
    """Lines of the band that hits are compared on: all, or every second, third ... of a long band."""
    return band[:: max(1, -(-band.size // MOST_LINES))]


def deviations(forces: ComplexArray, responses: ComplexArray) -> list[Deviation]:
    """Each of the (h, L) hits of a point beside the others.

    Args:
        forces: (h, L) spectra of the force.
        responses: (h, L) spectra of one response.
    """
    frf = responses / np.where(forces == 0, 1e-300, forces)
    usual: ComplexArray = np.median(frf.real, axis=0) + 1j * np.median(frf.imag, axis=0)
    edges = np.linspace(0, usual.size, BANDS + 1).astype(int)[:-1]
    scale = np.add.reduceat(np.abs(usual) ** 2, edges)
    weight = 1 / np.repeat(np.maximum(scale, 1e-300), np.diff(np.append(edges, usual.size)))
    energy = np.add.reduceat(np.abs(frf - usual) ** 2, edges, axis=1)
    norm = np.sqrt(np.sum(weight * np.abs(frf) ** 2, axis=1) * np.sum(weight * np.abs(usual) ** 2))
    likeness = np.sum(weight * (frf * usual.conj()).real, axis=1) / np.maximum(norm, 1e-300)
    return [Deviation(float(a), e) for a, e in zip(likeness, energy, strict=True)]


def compare(found: Sequence[Sequence[Deviation | None]]) -> list[list[Comparison | None]]:
    """The deviations of all hits of a campaign, point by point, on one scale.

    Few hits make an uncertain scale: the distance is lessened by 1 + 3/h for h hits in all. Where half of a point's
    hits would be far, nobody can say which of them are right, and none of them is far.
    """
    known = [d for point in found for d in point if d is not None and d.likeness > 0]
    if not known:
        return [[None if d is None else Comparison(d.likeness, 0.0) for d in point] for point in found]
    energies = np.sort(np.array([d.energy for d in known]), axis=0)
    usual = energies[: max(int(_TRIM * len(known)), 2)].mean(axis=0)
    usual = np.maximum(usual, 1e-12 * max(float(usual.max()), 1e-300))
    unit = float(np.median([np.sqrt(np.mean(d.energy / usual)) for d in known])) * (1 + _FEW / len(known))

    def distance(d: Deviation) -> float:
        return float(np.sqrt(np.mean(d.energy / usual))) / unit if unit > 0 else 0.0

    return [[None if d is None else Comparison(d.likeness, distance(d)) for d in point] for point in found]
