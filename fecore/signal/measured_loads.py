"""Any measured load, to FRFs with their scatter over blocks.

Shakers, pulses and chirps load a structure for as long as it is recorded, at R points at once. In
segments of n samples under a Hann window, with their spectra X and F (Bendat and Piersol, Random
Data, 4th ed., ch. 7),

    H = S_xf S_ff⁻¹,    S_xf = Σ X Fᴴ,    γ² = H S_xfᴴ/S_xx    (multiple coherence).

A window widens resonances: where the loads are smooth over a few lines, what H shows is the impulse
response h times the window's own correlation v, 1 at lag 0 and 0 at lag n. Taking v out and an
exponential window in,

    H'(ω) = Σ_{τ<L} h v · e^{-βτΔt}/v · e^{-iωτΔt},    L = n/2,    e^{-βLΔt} = 0.05,

leaves poles that decay faster by β, which is taken out of them afterwards. At the lines
ω_k = 2πk/(LΔt) the cut at L changes residues alone.

Errors of lines and pairs share the same segments. Group g of them moves H by
δH_g = (S_xf,g - H S_ff,g) S_ff⁻¹; a block of the result is H' of H + δH_g/w_g, w_g the group's share.

Loads that repeat after a period are cut into whole numbers of it and need no window. They have
power at some lines only, and H is known there alone. Steady sines need no period
(`fecore.signal.steady_loads`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.findings import Finding, listed, make, remark
from fecore.frf import Dof, FrfSet, Quantity
from fecore.signal.block_spectra import (
    BAND,
    LEFT,
    MOST_LAGS,
    BlockSpectra,
    Chunks,
    Groups,
    Motion,
    highest_of,
    segments,
    survey,
)
from fecore.signal.blocks import FRF_QUANTITY
from fecore.signal.estimators import pooled
from fecore.signal.steady_loads import advanced, amplitudes_of, period_of, segment_s, sines_in

_FEWEST_SEGMENTS, _MORE = 10, 2  # that a recording holds side by side, and for each load besides
_FEWEST_SAMPLES = 128  # of a segment: some 25 lines
_HOPS = 4  # a segment's length over the way to the next: each sample counts alike
_ACAUSAL = 1 / 4  # of the longest lag, up to which what comes before 0 is kept: filters ring there
_APART = 0.01  # smallest eigenvalue of the loads' coherence, below which they are alike
_ACTIVE = 1e-4  # of a periodic load's strongest line, from where it has power in a line

finding = partial(
    make,
    {
        "loads_alike": remark(
            "the loads at points {points} are alike from {low:.4g} to {high:.4g} Hz, so that their"
            " FRFs cannot be separated there and are left out",
            "drive the shakers by signals of their own",
        ),
        "load_periodic": remark(
            "the load repeats after {period:.6g} s: the FRFs are those of whole periods, at the"
            " {lines} lines that the load has"
        ),
        "load_of_sines": remark(
            "the load is {lines} steady sines, at whose frequencies alone the FRFs are known"
        ),
    },
)


@dataclass(frozen=True)
class LoadFrfs(BlockSpectra):
    """FRFs of one recording between N responses and R loads, with an exponential window."""

    quantity: Quantity
    coherence: FloatArray  # (N, L) multiple coherence, 0 to 1
    separable: BoolArray  # (R, L) where a load differs from the others, and has power
    notes: tuple[Finding, ...] = ()

    @property
    def variance(self) -> FloatArray:
        """(N, R, L) E|n|² of each value, from the scatter of the groups of blocks."""
        count = self.weights.size
        off = self.blocks - self.mean
        seen = np.einsum("g,gnrl->nrl", self.weights**2, np.abs(off) ** 2) * count / (count - 1)
        rows = np.ascontiguousarray(self.mean.reshape(-1, seen.shape[-1]))
        pairs = zip(rows, seen.reshape(rows.shape), strict=True)
        return np.array([pooled(*pair, count) for pair in pairs]).reshape(seen.shape)

    def frfs(self, *, with_variance: bool = True) -> FrfSet:
        """FRFs pair by pair, those of a response side by side."""
        values, responses, references = self.pairs(self.references)
        return FrfSet(
            self.frequency_hz,
            values,
            responses,
            references,
            self.quantity,
            variance=self.variance.reshape(values.shape) if with_variance else None,
            measured=np.tile(self.separable, (len(self.responses), 1)),
        )


def frfs_of_loads(
    chunks: Chunks,
    sample_rate_hz: float,
    responses: Sequence[Dof],
    loads: Sequence[Dof],
    quantities: Sequence[Motion] | None = None,
    lag_s: float | None = None,
    period_s: float | None = None,
) -> LoadFrfs:
    """FRFs of a recording of responses and of the loads that cause them.

    1. Length: how long the recording is, and whether its loads are sines or repeat.
    2. Segments: their spectra, summed in groups.
    3. FRFs: of all segments, with the multiple coherence, at lines where loads differ.
    4. Scatter: what each group moves them by.
    5. Window: that of the segments is exchanged for an exponential one.

    Args:
        chunks: gives the recording, N responses and below them R loads.
        sample_rate_hz: samples a second.
        responses: where and along what each response is measured.
        loads: where and along what each load acts.
        quantities: what each response measures, accelerations where not stated; all are taken to the
            highest derivative.
        lag_s: longest lag; a 24th of the recording with one load, less with more, where not stated.
        period_s: after which all loads repeat; found where not stated.

    Raises:
        InputError: the recording is too short, not finite or constant in a channel, or no load can
            be separated from the others.
    """
    n, r = len(responses), len(loads)
    highest, below = highest_of(quantities, n)
    # 1. Length.
    length, _ = survey(chunks(), n + r)
    sines, period = _steady(chunks(), n, length, sample_rate_hz, period_s)
    steady = bool(period or sines.size)
    size = _size(length, r, sample_rate_hz, lag_s, period, sines)
    # 2. Segments.
    hop, spectra, hz = _transform(size, period, sines, sample_rate_hz)
    scale = (2j * np.pi * hz) ** below[:, None]
    groups, own = Groups(np.asarray, 1 if steady else _HOPS), np.zeros((n, hz.size))
    before, advance = np.zeros((r, hz.size), dtype=complex), np.zeros(hz.size, dtype=complex)
    for place, segment in enumerate(segments(chunks(), size, hop)):
        if steady and place == 0:
            continue  # until the response is steady
        spectrum = spectra(segment)
        spectrum[:n] *= scale
        groups.add(spectrum[:, None] * spectrum[n:].conj())
        own += np.abs(spectrum[:n]) ** 2
        advance += np.sum(spectrum[n:] * before.conj(), axis=0)
        before = spectrum[n:]
    # 3. FRFs.
    sums, counts = groups.done()
    cross, force = sums.sum(axis=0)[:n], sums.sum(axis=0)[n:]
    constant = None if sines.size else 0
    inverse, separable = separated(force, constant, _ACTIVE if steady else 1e-16)
    _require_separable(separable, loads)
    values = np.einsum("nrl,rsl->nsl", cross, inverse)
    coherence = np.einsum("nrl,nrl->nl", values, cross.conj()).real / np.maximum(own, _TINY)
    # 4. Scatter.
    weights = counts / counts.sum()
    moved = sums[:, :n] - np.einsum("nrl,grsl->gnsl", values, sums[:, n:])
    blocks = values + np.einsum("gnrl,rsl->gnsl", moved, inverse) / weights[:, None, None, None]
    # 5. Window.
    lines, rate = np.arange(1, hz.size), 0.0
    if sines.size:
        lines, hz = np.arange(hz.size), advanced(hz, advance, hop, sample_rate_hz)
    elif not period:
        blocks, rate = (
            _exchange(blocks, separable, size),
            -np.log(LEFT) * sample_rate_hz / (size // 2),
        )
        lines = lines[1::2]
    notes = _notes(separable[:, lines], hz[lines], loads, period / sample_rate_hz, sines.size)
    lines = lines[separable[:, lines].any(axis=0)]
    return LoadFrfs(
        frequency_hz=hz[lines],
        blocks=blocks[..., lines],
        weights=weights,
        responses=tuple(responses),
        references=tuple(loads),
        window_rate_per_s=float(rate),
        lag_s=(size if steady else size // 2) / sample_rate_hz,
        length_s=length / sample_rate_hz,
        quantity=FRF_QUANTITY[highest],
        coherence=np.clip(coherence[:, lines], 0, 1),
        separable=separable[:, lines],
        notes=notes,
    )


_TINY = float(np.finfo(float).tiny)


def _hann(size: int) -> FloatArray:
    window: FloatArray = scipy.signal.windows.hann(size, sym=False)
    return window


def _transform(
    size: int, period: float, sines: FloatArray, sample_rate_hz: float
) -> tuple[int, Callable[[FloatArray], ComplexArray], FloatArray]:
    """Samples from segment to segment, what takes a segment of so many to its spectra, and the
    lines of these, Hz.
    """
    if sines.size:
        amplitudes = amplitudes_of(sines, size, sample_rate_hz)
        return size, lambda segment: segment @ amplitudes, sines
    kept, window = int(size * BAND) + 1, np.ones(size) if period else _hann(size)

    def spectra(segment: FloatArray) -> ComplexArray:
        straight = scipy.signal.detrend(segment, type="constant" if period else "linear")
        return np.asarray(scipy.fft.rfft(straight * window, axis=1)[:, :kept])

    return size if period else size // _HOPS, spectra, np.arange(kept) * sample_rate_hz / size


def _steady(
    chunks: Iterable[FloatArray],
    first: int,
    length: int,
    sample_rate_hz: float,
    period_s: float | None,
) -> tuple[FloatArray, float]:
    """The frequencies of the sines that all loads are, or the samples after which they repeat."""
    if period_s is not None:
        return np.empty(0), period_s * sample_rate_hz
    part = next(iter(segments(chunks, min(length, 2**20))))[first:]
    sines = sines_in(part, sample_rate_hz)
    sines = sines[sines <= BAND * sample_rate_hz] if sines.size else sines
    return sines, 0.0 if sines.size else period_of(part)


def require_length(samples: int, loads: int, sample_rate_hz: float) -> int:
    """How many segments a recording holds side by side.

    Raises:
        InputError: it is too short for them.
    """
    pieces = _FEWEST_SEGMENTS + _MORE * loads
    if samples < pieces * _FEWEST_SAMPLES:
        raise InputError(
            "recording",
            f"is {samples / sample_rate_hz:.3g} s long, expected"
            f" {pieces * _FEWEST_SAMPLES / sample_rate_hz:.3g} s or more",
        )
    return pieces


def _size(
    length: int,
    loads: int,
    sample_rate_hz: float,
    lag_s: float | None,
    period: float,
    sines: FloatArray,
) -> int:
    """Samples of a segment: in which sines are resolved, whole periods of periodic loads, else
    two of the longest lags.
    """
    pieces = require_length(length, loads, sample_rate_hz)
    if sines.size:
        least_s = segment_s(sines)
        if 3 * least_s * sample_rate_hz > length:
            raise InputError(
                "recording",
                f"is {length / sample_rate_hz:.3g} s long, expected {3 * least_s:.3g} s or more for"
                f" its load's sines from {sines[0]:.4g} Hz on",
            )
        return max(min(length // pieces, 2 * MOST_LAGS), int(np.ceil(least_s * sample_rate_hz)))
    if period:
        times = max(1, int(min(length / pieces, 2 * MOST_LAGS) / period))
        if round(times * period) * 3 > length:
            raise InputError(
                "recording",
                f"is {length / sample_rate_hz:.3g} s long, expected three periods of the load"
                f" or more, which is {period / sample_rate_hz:.3g} s",
            )
        return round(times * period)
    most = min(length // pieces, 2 * MOST_LAGS)
    size = most if lag_s is None else round(2 * lag_s * sample_rate_hz)
    if not _FEWEST_SAMPLES <= size <= length // pieces:
        raise InputError(
            "lag_s",
            f"is {size / 2 / sample_rate_hz:.3g} s, expected"
            f" {_FEWEST_SAMPLES / 2 / sample_rate_hz:.3g} to"
            f" {length / pieces / 2 / sample_rate_hz:.3g} s",
        )
    return size // (2 * _HOPS) * 2 * _HOPS


def separated(
    force: ComplexArray, constant: int | None = None, least: float = 1e-16
) -> tuple[ComplexArray, BoolArray]:
    """(R, R, L) inverse of the spectra of loads or references, at lines where they can be separated,
    0 elsewhere; and (R, L) which can be.

    Args:
        force: (R, R, L) spectra.
        constant: the line at 0 Hz, which is left out; None where there is none.
        least: of the strongest line's power, from where one has power in a line.
    """
    level = np.sqrt(np.maximum(np.einsum("rrl->rl", force).real, _TINY))
    there = level**2 > least * level.max(axis=1, keepdims=True) ** 2
    there[:, [] if constant is None else [constant]] = False
    scaled = np.moveaxis(force / (level[:, None] * level), -1, 0)
    both = there.T[:, :, None] & there.T[:, None]
    scaled = np.where(both, scaled, 0) + np.eye(len(level)) * ~there.T[:, :, None]
    size, vectors = np.linalg.eigh(scaled)
    alike = np.einsum("lrk,lk->lr", np.abs(vectors) > 0.3, size < _APART).T > 0
    inverse = np.einsum("lrk,lk,lsk->rsl", vectors, 1 / np.maximum(size, _APART), vectors.conj())
    separable = there & ~alike
    inverse *= separable[:, None] & separable
    return inverse / (level[:, None] * level), separable


def _exchange(blocks: ComplexArray, separable: BoolArray, size: int) -> ComplexArray:
    """Spectra whose segments' window is exchanged for the exponential one. Lines that are not known
    go in as those between which they lie.
    """
    own = scipy.signal.fftconvolve(_hann(size), _hann(size)[::-1])[size - 1 :]
    lags, early = size // 2, int(size // 2 * _ACAUSAL)
    steps = np.arange(-early, lags)
    window = np.zeros(size)
    window[steps] = LEFT ** (steps / lags) / (own[np.abs(steps)] / own[0])
    window[-early:] *= np.cos(np.pi / 2 * np.arange(early, 0, -1) / early) ** 2
    kept = blocks.shape[-1]
    whole = np.zeros((*blocks.shape[:-1], size // 2 + 1), dtype=complex)
    whole[..., :kept] = blocks
    for row, known in enumerate(separable):
        lines = np.flatnonzero(known)
        for gap in np.setdiff1d(np.arange(1, kept), lines):
            near = lines[
                np.clip(np.searchsorted(lines, gap) + np.array([-1, 0]), 0, lines.size - 1)
            ]
            whole[:, :, row, gap] = blocks[:, :, row, near].mean(axis=-1)
    fade = np.arange(kept, size // 2 + 1)
    whole[..., kept:] = (
        whole[..., kept - 1 : kept] * np.cos(np.pi / 2 * (fade - kept) / max(fade.size, 1)) ** 2
    )
    turned = scipy.fft.rfft(scipy.fft.irfft(whole, size, axis=-1) * window, axis=-1)
    return np.asarray(turned[..., :kept])


def _notes(
    separable: BoolArray, hz: FloatArray, loads: Sequence[Dof], period_s: float, sines: int
) -> tuple[Finding, ...]:
    lines = int(separable.any(axis=0).sum())
    if sines:
        return (finding("load_of_sines", lines=lines),)
    if period_s:
        return (finding("load_periodic", period=period_s, lines=lines),)
    notes, missing = [], ~separable
    edges = np.flatnonzero(np.diff(np.pad(missing.any(axis=0), 1).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        points = [
            dof.point for dof, row in zip(loads, missing[:, begin:end], strict=True) if row.any()
        ]
        notes.append(
            finding("loads_alike", points=listed(points, 4), low=hz[begin], high=hz[end - 1])
        )
    return tuple(notes)


def _require_separable(separable: BoolArray, loads: Sequence[Dof]) -> None:
    never = [str(dof.point) for dof, row in zip(loads, separable, strict=True) if not row.any()]
    if never:
        raise InputError(
            "loads",
            f"those at points {', '.join(never)} are alike in all lines, so that their FRFs cannot"
            " be separated; drive the shakers by signals of their own",
        )
