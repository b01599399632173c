"""What lies in a response before the pulse, the hum of the mains taken out.

Hum is in all hits of a campaign alike but for its phase. Before the pulse there is often less than one of its periods, so
that one hit has a slope there and another a top: as it stands, the same hum is loud before one hit and quiet before the next,
and hides a body that still rings. The samples before the pulse of one hit are

    x_j = c + Σ_k (a_k cos ω_k j Δt + b_k sin ω_k j Δt) + e_j,    a_k, b_k ~ N(0, p_k),    e_j ~ N(0, σ²),

ω_k the multiples of 2π 50 or 60 Hz, c the channel's offset. The p_k and σ² are those of greatest likelihood over the
campaign's quiet hits, by expectation and maximisation (Dempster, Laird & Rubin, J. R. Stat. Soc. B 39, 1977), for the mains
of greater likelihood. With C the covariance of x that they state, y = σ² C⁻¹ x is what is left of x when its own hum is taken
out, as far as the hum may be that large; x·y/n is its power, and |v(f)ᴴ y|² / (σ² v(f)ᴴ C⁻¹ v(f)) that of one line
v(f) = exp(2πi f j) beside the hum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.frf import MAINS_HZ

TAIL = 256
"""Samples before the pulse that are looked at, at most."""

_HARMONICS = 5  # multiples of the mains' frequency that are heard
_ROUNDS = 12  # of expectation and maximisation
_MOST_HITS = 32  # that say how large the hum is; of more, every k-th
_QUIET = 3.0  # times the level of the quietest half, up to which a hit says it
_LEAST_HUM = 1e-6  # of the noise: what is taken for none
_LEAST_NOISE = 1e-3  # of the whole power: what noise is at least
_LEAST_SEEN = 0.02  # of a line's power, that is seen beside the hum


@dataclass(frozen=True)
class Hum:
    """The hum of one response in a campaign: `mains_hz`, the variance of the white noise beside it, (k,) variances p."""

    mains_hz: float
    noise: float
    powers: FloatArray


@dataclass(frozen=True)
class Cleaned:
    """Of h hits: (h,) root mean square and (h, 256) power of the lines k/512, k = 1 to 256, hum taken out; σ² for noise."""

    level: FloatArray
    lines: FloatArray


def without_hum(tails: Sequence[FloatArray], sample_rate_hz: float) -> Cleaned:
    """What lies before the pulse of the hits of one response.

    Args:
        tails: of each hit, the last samples before its pulse, up to 256 and one at least.
        sample_rate_hz: samples a second.
    """
    counts = np.array([tail.size for tail in tails])
    table = np.zeros((len(tails), TAIL))
    for row, tail in zip(table, tails, strict=True):
        row[: tail.size] = tail - tail.mean()
    chosen = _quiet(table, counts)
    fits = [_fit(table[chosen], counts[chosen], sample_rate_hz, mains) for mains in MAINS_HZ]
    hum, _ = max(fits, key=lambda found: found[1])
    return _cleaned(table, counts, sample_rate_hz, hum)


def _quiet(table: FloatArray, counts: IntArray) -> IntArray:
    """Rows of the hits that say how large the hum is."""
    level = np.sqrt((table**2).sum(axis=1) / counts)
    rows = np.flatnonzero(level <= _QUIET * np.median(np.sort(level)[: level.size // 2 + 1]))
    return rows[:: -(-rows.size // _MOST_HITS)]


def _waves(sample_rate_hz: float, mains_hz: float) -> FloatArray:
    """(256, 1 + 2 k): one, cosines and sines."""
    phase = 2 * np.pi * mains_hz / sample_rate_hz * np.arange(TAIL)[:, None] * np.arange(1, _HARMONICS + 1)
    return np.hstack((np.ones((TAIL, 1)), np.cos(phase), np.sin(phase)))


def _products(waves: FloatArray) -> FloatArray:
    """(257, 1 + 2 k, 1 + 2 k) products of the waves over the first n samples."""
    each = waves[:, :, None] * waves[:, None]
    return np.concatenate((np.zeros((1, *each.shape[1:])), np.cumsum(each, axis=0)))


def _precision(noise: float, powers: FloatArray) -> FloatArray:
    """Diagonal matrix of 1/p; the offset may be anything."""
    return np.diag(np.concatenate(([1e-9 / noise], 1 / powers, 1 / powers)))


def _fit(table: FloatArray, counts: IntArray, sample_rate_hz: float, mains_hz: float) -> tuple[Hum, float]:
    """The hum of greatest likelihood, and the logarithm of that."""
    waves = _waves(sample_rate_hz, mains_hz)
    products, seen, power = _products(waves)[counts], table @ waves, (table**2).sum(axis=1)
    whole = max(float(np.median(power / counts)), 1e-300)
    noise, powers = whole / 2, np.full(_HARMONICS, whole / _HARMONICS)
    for _ in range(_ROUNDS):
        spread = np.linalg.inv(products / noise + _precision(noise, powers))
        mean = np.einsum("iab,ib->ia", spread, seen) / noise
        each = (mean**2 + np.einsum("iaa->ia", spread))[:, 1:].mean(axis=0)
        left = power - 2 * (mean * seen).sum(axis=1) + np.einsum("ia,iab,ib->i", mean, products, mean)
        left += np.einsum("iab,iba->i", products, spread)
        noise = max(float(left.sum() / counts.sum()), _LEAST_NOISE * whole)
        powers = np.maximum((each[:_HARMONICS] + each[_HARMONICS:]) / 2, _LEAST_HUM * noise)
    inner = products / noise + _precision(noise, powers)
    reached = np.einsum("ia,iab,ib->", seen, np.linalg.inv(inner), seen) / noise
    likelihood = (power.sum() - reached) / noise + counts.sum() * np.log(noise)
    likelihood += 2 * len(table) * np.log(powers).sum() + np.linalg.slogdet(inner)[1].sum()
    return Hum(mains_hz, noise, powers), -0.5 * float(likelihood)


def _cleaned(table: FloatArray, counts: IntArray, sample_rate_hz: float, hum: Hum) -> Cleaned:
    waves = _waves(sample_rate_hz, hum.mains_hz)
    products, precision = _products(waves), _precision(hum.noise, hum.powers)
    power, lines = np.empty(len(table)), np.empty(table.shape, np.float32)
    for n in np.unique(counts):
        rows = np.flatnonzero(counts == n)
        inner = products[n] / hum.noise + precision
        own = table[rows, :n]
        left = own - np.linalg.solve(inner, waves[:n].T @ own.T / hum.noise).T @ waves[:n].T
        power[rows] = (own * left).sum(axis=1) / n
        heard = np.fft.rfft(waves[:n], 2 * TAIL, axis=0)[1:]
        of_hum = (heard.conj() * np.linalg.solve(inner, heard.T).T).sum(axis=1).real / hum.noise
        lines[rows] = np.abs(np.fft.rfft(left, 2 * TAIL, axis=1)[:, 1:]) ** 2 / np.maximum(n - of_hum, _LEAST_SEEN * n)
    return Cleaned(np.sqrt(np.maximum(power, 0.0)), lines)
