"""Responses to loads that nobody measured, to half spectra with their scatter over blocks.

Wind, traffic and machines move a structure, and only its responses x(t) are recorded. In blocks of
n samples their correlations are, divided by n - τ,

    R_ij(τ) = E[x_i(t + τ) x_j(t)],        S⁺_ij(ω) = Δt Σ_{0 ≤ τ < L} w(τ) R_ij(τ) e^{-iωτΔt},

with half weight at τ = 0 and w = e^{-βτΔt}, which is 0.05 at the last lag. Of loads that are white
over the band of a mode (Peeters, PhD thesis, K.U. Leuven, 2000; Reynders, Arch. Comput. Methods
Eng. 19, 2012)

    S⁺(ω) = Σ_n φ_n g_nᵀ/(iω + β - λ_n) + conj.:

the residue is of rank one and not symmetric, and the poles decay faster by β. At the lines
ω_k = 2πk/(LΔt) the cut at L changes residues alone, as e^{-iω_k LΔt} = 1. Loads come in gusts, and
the half spectrum of a gust is larger, not better: each block is taken in its own power, in that of
the whole recording where it is calm.

Where some sensors measure a velocity or displacement beside accelerations, they are taken to the
highest derivative, R_ẋy = dR_xy/dτ: in half spectra

    ∫ w Ṙ e^{-iωτ} dτ = (iω + β) S⁺ + w(L)R(L) - R(0).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.frf import Dof, FrfSet
from fecore.signal.block_spectra import (
    BAND,
    BLOCKS,
    LEFT,
    MOST_LAGS,
    BlockSpectra,
    Chunks,
    Groups,
    Motion,
    channel_of,
    highest_of,
    segments,
    survey,
)

_FEWEST_LAGS = 64  # of half spectra: some 25 lines
_MOST_REFERENCES = 4  # that are chosen; more add work and little else
_CALM = 0.05  # of the usual power, below which a block counts less, as its noise does not
_EXPLAINED = 0.98  # of the responses, from where no other reference is taken


@dataclass(frozen=True)
class HalfSpectra(BlockSpectra):
    """Half spectra of one recording: N responses to R of them, which are references.

    (unit of x)²/Hz, each block in the power of the recording.
    """

    # (L,) spectral kurtosis of the responses, 0 for random ones and -1 for a steady sine
    kurtosis: FloatArray
    # (N, L) and (N, R, L) one-sided power spectra of the responses, and of them with the references
    # (conjugated), (unit of x)²/Hz, of Hann segments of one lag's length
    autos: FloatArray
    crosses: ComplexArray
    quantity: Motion = "acceleration"  # x: the highest derivative among the sensors

    @property
    def singular_values(self) -> FloatArray:
        """(R, L) singular values of the power spectra of all responses with the references, the
        largest first: about each mode one rises from the others.
        """
        return np.linalg.svd(self.crosses.transpose(2, 0, 1), compute_uv=False).T

    def deflection(self, frequency_hz: float | None = None) -> tuple[float, Dof, ComplexArray]:
        """Operating deflection shape at a line: what all sensors do there together,
        S_ir / √S_rr with the reference r that moves most.

        Args:
            frequency_hz: of the line; the nearest one is taken, or the strongest of all.

        Returns:
            The line in Hz, the reference, and (N,) complex amplitudes, (unit of x)/√Hz.
        """
        line = int(np.argmax(self.singular_values[0]))
        if frequency_hz is not None:
            line = int(np.argmin(np.abs(self.frequency_hz - frequency_hz)))
        own = [self.autos[self.responses.index(dof), line] for dof in self.references]
        column = int(np.argmax(own))
        shape = self.crosses[:, column, line] / np.sqrt(own[column])
        return float(self.frequency_hz[line]), self.references[column], shape

    def mean_square(self, low_hz: float, high_hz: float) -> float:
        """Mean square of all responses over a band, the lines at its ends included: Σ S_xx Δf,
        their mean over the sensors, (unit of x)².
        """
        within = (self.frequency_hz >= low_hz) & (self.frequency_hz <= high_hz)
        return float(self.autos[:, within].sum(axis=1).mean() / self.lag_s)

    def frfs(self, setup: int = 0) -> FrfSet:
        """As mobilities, pair by pair: correlations of accelerations begin at their largest, as the
        response of a velocity to an impulse does.

        Args:
            setup: number, from 1, among several recordings that share references; 0 of one alone.
                The unknown loads stand in place of a force, others in each recording and nowhere a
                driving point: each reference of each setup is a column of its own.
        """
        columns = [column_of(dof, setup) for dof in self.references]
        return FrfSet(self.frequency_hz, *self.pairs(columns), "mobility")


def column_of(reference: Dof, setup: int) -> Dof:
    """The column of a reference of a setup, among force degrees of freedom."""
    return Dof(reference.point + (setup + 1) * _COLUMNS, reference.direction)


def reference_of(column: Dof) -> tuple[Dof, int]:
    """The reference of a column and the number of its setup; of a force itself, and 0."""
    setup, point = divmod(column.point, _COLUMNS)
    return Dof(point, column.direction), max(setup - 1, 0)


_COLUMNS = 10**10  # above all labels of points


def half_spectra(
    chunks: Chunks,
    sample_rate_hz: float,
    responses: Sequence[Dof],
    references: Sequence[Dof] | None = None,
    lag_s: float | None = None,
    quantities: Sequence[Motion] | None = None,
    among: Sequence[Dof] | None = None,
) -> HalfSpectra:
    """Half spectra of a recording.

    1. Length: how long the recording is, and the longest lag, a 40th of it.
    2. References: channels in which all responses are seen.
    3. Groups: the spectra of blocks of two lags, summed.
    4. Half spectra: of the correlations of each group.

    Args:
        chunks: gives the recording, channel by channel.
        sample_rate_hz: samples a second.
        responses: where and along what each channel measures.
        references: those that the others are correlated with; chosen where not stated.
        lag_s: longest lag; the slowest mode should have decayed to 5 % by then.
        quantities: what each channel measures; the same of all where not stated.
        among: channels that references are chosen of; all where not stated.

    Raises:
        InputError: the recording is too short, not finite or constant in a channel, or a reference
            is none of its channels.
    """
    # 1. Length.
    highest, below = highest_of(quantities, len(responses))
    length, variance = survey(chunks(), len(responses))
    lags = _lags(length, sample_rate_hz, lag_s)
    # 2. References.
    rows = (
        _choose(chunks(), lags, below, _rows_of(among or responses, responses))
        if references is None
        else _rows_of(references, responses)
    )
    for row in rows:
        if below[row]:
            raise InputError(
                "references",
                f"the sensor of point {responses[row].point} measures less than the {highest} of"
                f" others; expected sensors of {highest}",
            )
    # 3. Groups.
    groups = _Sums.of(chunks(), lags, rows, variance)
    # 4. Half spectra.
    line = scipy.fft.rfftfreq(lags, 1 / sample_rate_hz)
    keep = (line > 0) & (line <= BAND * sample_rate_hz)
    spectra: ComplexArray = np.array(
        [_transformed(each, lags, sample_rate_hz, below)[..., keep] for each in groups.correlations]
    )
    scale = (2 * np.pi * line) ** below[:, None]
    hann = 2 / (sample_rate_hz * 0.375 * lags * SEGMENTS * groups.counts.sum())
    return HalfSpectra(
        frequency_hz=line[keep],
        blocks=spectra / groups.counts[:, None, None, None],
        weights=groups.counts / groups.counts.sum(),
        responses=tuple(responses),
        references=tuple(responses[row] for row in rows),
        window_rate_per_s=float(-np.log(LEFT) * sample_rate_hz / lags),
        lag_s=lags / sample_rate_hz,
        length_s=float(groups.counts.sum()) * 2 * lags / sample_rate_hz,
        kurtosis=groups.kurtosis(scale)[keep],
        autos=(hann * scale**2 * groups.powers[0])[:, keep],
        crosses=(hann * (1j ** below[:, None] * scale)[:, None] * groups.crosses)[..., keep],
        quantity=highest,
    )


def longest_lag_s(samples: int, sample_rate_hz: float) -> float:
    """The longest lag of a recording where none is stated: a 40th of it.

    Raises:
        InputError: the recording is too short.
    """
    return _lags(samples, sample_rate_hz, None) / sample_rate_hz


def needed_s(frequency_hz: float, damping_ratio: float) -> float:
    """Length of a recording in which a mode's correlation decays to 5 % within a lag: 40 lags of
    -ln 0.05/(ζω).
    """
    return float(2 * BLOCKS * -np.log(LEFT) / (2 * np.pi * frequency_hz * damping_ratio))


def _lags(length: int, sample_rate_hz: float, stated_s: float | None) -> int:
    most = length // (2 * BLOCKS)
    lags = min(most, MOST_LAGS) if stated_s is None else round(stated_s * sample_rate_hz)
    if most < _FEWEST_LAGS:
        least = 2 * BLOCKS * _FEWEST_LAGS / sample_rate_hz
        raise InputError(
            "recording",
            f"is {length / sample_rate_hz:.3g} s long, expected {least:.3g} s or more; modes of 1 %"
            " damping need some 1900 periods of the slowest",
        )
    if not _FEWEST_LAGS <= lags <= most:
        raise InputError(
            "lag_s",
            f"is {lags / sample_rate_hz:.3g} s, expected {_FEWEST_LAGS / sample_rate_hz:.3g} to"
            f" {most / sample_rate_hz:.3g} s, a 40th of the recording",
        )
    return lags


def _rows_of(references: Sequence[Dof], responses: Sequence[Dof]) -> list[int]:
    return [channel_of(dof, responses, "references") for dof in references]


def _straight(chunks: Iterable[FloatArray], size: int) -> Iterator[FloatArray]:
    """(N, size) disjoint blocks, without their linear trends."""
    ramp = np.linspace(-1, 1, size)
    ramp /= np.linalg.norm(ramp)
    for segment in segments(chunks, size):
        block = segment - segment.mean(axis=1, keepdims=True)
        yield block - np.outer(block @ ramp, ramp)


def _transformed(correlations: FloatArray, lags: int, rate: float, below: IntArray) -> ComplexArray:
    """(N, R, K) half spectra at all lines, those of a channel below the highest derivative taken to
    it.

    Args:
        correlations: (N, R, L + 3) of blocks padded with zeros, from lag -1 on; not divided by
            n - τ.
        lags: L.
        rate: samples a second.
        below: (N,) how many derivatives each channel lies below the highest.
    """
    lag = np.arange(-1, lags + 2)
    values = correlations / (2 * lags - np.abs(lag))
    windowed = values[..., 1 : lags + 1] * LEFT ** (lag[1 : lags + 1] / lags)
    windowed[..., 0] /= 2
    spectra: ComplexArray = scipy.fft.rfft(windowed, axis=-1) / rate
    shift = -np.log(LEFT) * rate / lags + 2j * np.pi * scipy.fft.rfftfreq(lags, 1 / rate)
    for row in np.flatnonzero(below):
        own = values[row]
        begin, end = own[:, 1], own[:, lags + 1]
        for _ in range(int(below[row])):
            steep = [rate * (own[:, k + 1] - own[:, k - 1]) / 2 for k in (1, lags + 1)]
            # the trapezoidal rule's error at lag 0 (Euler and Maclaurin), which is none of a constant
            correction = (steep[0][:, None] - np.outer(begin, shift)) / (12 * rate**2)
            spectra[row] = shift * (spectra[row] + correction) + (LEFT * end - begin)[:, None]
            begin, end = steep
    return spectra


def _choose(
    chunks: Iterable[FloatArray], lags: int, below: IntArray, among: list[int]
) -> list[int]:
    """Channels that show what all show: a pivoted Cholesky decomposition of the spectra, each line
    of which counts alike, so that a weak mode asks for its channel too.

    Args:
        chunks: of the recording.
        lags: half of a block.
        below: (N,) how many derivatives each channel lies below the highest.
        among: channels that are chosen from, of which the highest derivatives are.
    """
    total = sum(_share(block, below) for block in _straight(chunks, 2 * lags))
    left = np.array(total) / np.trace(total)
    free = [row for row in among if not below[row]]
    if not free:
        raise InputError(
            "references", "measure less than the highest derivative of the setup's sensors"
        )
    rows = list[int]()
    while len(rows) < min(_MOST_REFERENCES, len(free)) and np.trace(left) > 1 - _EXPLAINED:
        row = max(free, key=lambda each: left[each, each])
        rows.append(row)
        left = left - np.outer(left[:, row], left[row]) / left[row, row]
    return rows


def _share(block: FloatArray, below: IntArray) -> FloatArray:
    """(N, N) real parts of the spectra of a block, each line in its own power."""
    spectrum = scipy.fft.rfft(block, axis=1)[:, 1 : int(BAND * block.shape[1])]
    if below.any():
        spectrum = spectrum * np.arange(1.0, spectrum.shape[1] + 1) ** below[:, None]
    power = np.sum(np.abs(spectrum) ** 2, axis=0)
    scaled = spectrum / np.sqrt(np.maximum(power, np.finfo(float).tiny))
    return np.asarray((scaled @ scaled.conj().T).real)


@dataclass(frozen=True)
class _Sums:
    """Sums over the blocks of each group, and over all segments of a lag's length."""

    correlations: FloatArray  # (G, N, R, L + 3) Σ_t x_i(t + τ) x_j(t) of blocks, from lag -1 on
    counts: FloatArray  # (G,) blocks
    powers: FloatArray  # (2, N, K) sums of |Y|² and |Y|⁴ of Hann segments Y, three a block
    crosses: ComplexArray  # (N, R, K) sums of Y_i Y_j* of the same

    @classmethod
    def of(
        cls, chunks: Iterable[FloatArray], lags: int, rows: list[int], variance: FloatArray
    ) -> _Sums:
        padded = scipy.fft.next_fast_len(3 * lags + 2, real=True)
        padded += padded % 2
        groups = Groups(lambda cross: _correlated(cross, lags))
        powers, crosses = np.zeros(()), np.zeros((), dtype=complex)
        for block in _straight(chunks, 2 * lags):
            power = np.mean(block.var(axis=1) / variance)
            spectrum = scipy.fft.rfft(block / np.sqrt(max(power, _CALM)), padded, axis=1)
            groups.add(spectrum[:, None] * spectrum[rows].conj())
            parts = _segments(block, lags)
            square = np.abs(parts) ** 2
            powers = powers + np.stack([square.sum(axis=0), (square**2).sum(axis=0)])
            crosses = crosses + np.einsum("snk,srk->nrk", parts, parts[:, rows].conj())
        return cls(*groups.done(), powers, crosses)

    def kurtosis(self, scale: FloatArray) -> FloatArray:
        """(K,) spectral kurtosis E|Y|⁴/(E|Y|²)² - 2 (Antoni, Mech. Syst. Signal Process. 20, 2006),
        of the channels by their shares of the power.

        Args:
            scale: (N, K) that takes each channel to the highest derivative.
        """
        second, fourth = self.powers / (SEGMENTS * float(self.counts.sum()))
        each = fourth / np.maximum(second**2, np.finfo(float).tiny) - 2
        power = second * scale**2
        share = power / np.maximum(power.sum(axis=0), np.finfo(float).tiny)
        return np.asarray(np.sum(share * each, axis=0))


def _correlated(cross: ComplexArray, lags: int) -> FloatArray:
    """(N, R, L + 3) correlations of the spectra of padded blocks, from lag -1 on."""
    whole = scipy.fft.irfft(cross, axis=-1)
    return np.concatenate((whole[..., -1:], whole[..., : lags + 2]), axis=-1)


SEGMENTS = 3
"""Hann segments of a block, which overlap by half."""


def _segments(block: FloatArray, lags: int) -> ComplexArray:
    """(3, N, K) spectra of the three half-overlapping Hann segments of a block."""
    window = scipy.signal.windows.hann(lags, sym=False)
    segments = np.stack([block[:, at : at + lags] for at in (0, lags // 2, lags)])
    spectra: ComplexArray = scipy.fft.rfft(segments * window, axis=-1)
    return spectra
