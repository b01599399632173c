"""What each resonance has in the FRF of a hit: its shares, real numbers that change with the place
of the hit alone.

Hits excite the same poles by other amounts: in a band about a resonance H_i(ω) = Σ a_ik u_k(ω),
with shapes over frequency u_k that all hits of a campaign have in common and real a_ik = φ_k(x_i)
times what the sensor sees. The bands lie between the minima of the campaign's power spectrum; the
u_k are the strongest right singular vectors of the band's FRFs, real and imaginary parts side by
side, over a sample of hits, so no mode has to be identified and near modes share a band. A hit
whose FRF is far higher than others in a band, as a faulty one may be, counts there as much as they
do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fecore.arrays import ComplexArray, FloatArray

MOST_SENSORS = 4
"""Responses of a hit whose shares are taken."""

_PROMINENCE_DB = 6.0  # of a peak that has a band of its own
_NARROWEST = 4  # lines of a band
_MOST_BANDS = 32  # the lowest: shapes of low modes are known from few points
_A_BAND = 2  # shares
_CLEAR = 20.0  # power of a share over that of the weak ones
_SHOWN = 1e-3  # and over that of the band's first
# of the force's largest power, below which a line is taken down: there is little to divide by
_WEAKEST = 1e-4


@dataclass(frozen=True)
class Basis:
    """Bands as (first line, last line + 1), and the unit vectors u_k of each, (2 n,) real before
    imaginary parts.
    """

    bands: tuple[tuple[int, int], ...]
    vectors: tuple[FloatArray, ...]

    def participation(self, frfs: ComplexArray) -> FloatArray:
        """(h, K) shares of (h, L) FRFs."""
        return np.array(
            [
                _parts(frfs[:, low:high]) @ u
                for (low, high), u in zip(self.bands, self.vectors, strict=True)
            ]
        ).T


def hit_frfs(forces: ComplexArray, responses: ComplexArray) -> ComplexArray:
    """(h, L) FRFs of single hits; lines that a hit hardly excites are drawn to zero, not divided by
    next to nothing.
    """
    power = forces.real**2 + forces.imag**2
    least = np.maximum(_WEAKEST * power.max(axis=1, keepdims=True), 1e-300)
    frfs: ComplexArray = responses * forces.conj() / (power + least)
    return frfs


def find_basis(frfs: ComplexArray) -> Basis | None:
    """The basis of (n, L) FRFs of a sample of hits; None where they show no resonance."""
    power = np.abs(frfs) ** 2
    components = [
        (band, u)
        for band in _bands(np.median(power, axis=0))
        for u in _strongest(_parts(frfs[:, band[0] : band[1]]))
    ]
    return (
        Basis(tuple(band for band, _ in components), tuple(u for _, u in components))
        if components
        else None
    )


def _bands(power: FloatArray) -> Sequence[tuple[int, int]]:
    from scipy.signal import find_peaks  # only here: the import takes a good part of a second

    level = np.pad(10 * np.log10(np.maximum(power, 1e-300)), 1, mode="edge")
    level = (level[:-2] + level[1:-1] + level[2:]) / 3
    peaks, _ = find_peaks(level, prominence=_PROMINENCE_DB)
    if not peaks.size:
        return []
    between = [low + int(np.argmin(level[low:high])) for low, high in pairwise(peaks)]
    edges = [0, *between, power.size]
    wide = [(low, high) for low, high in pairwise(edges) if high - low >= _NARROWEST]
    return wide[:_MOST_BANDS]


def _strongest(rows: FloatArray) -> list[FloatArray]:
    """The right singular vectors of (n, 2 m) rows that stand out of the weak ones."""
    size = np.sqrt((rows**2).sum(axis=1))
    usual = float(np.median(size))
    if usual == 0:
        return []
    rows = rows / np.maximum(size, usual)[:, None]
    squares, left = np.linalg.eigh(rows @ rows.T)
    squares, left = squares[::-1], left[:, ::-1]
    weak = (
        float(np.median(squares[2 * _A_BAND + 1 :]))
        if squares.size > 2 * (2 * _A_BAND + 1)
        else float(squares[-1])
    )
    least = max(_CLEAR * weak, _SHOWN * float(squares[0]))
    return [
        np.asarray(left[:, k] @ rows / np.sqrt(squares[k]))
        for k in range(min(_A_BAND, squares.size))
        if squares[k] > least
    ]


def _parts(values: ComplexArray) -> FloatArray:
    return np.concatenate((values.real, values.imag), axis=1)
