"""Loads that are steady: sines, with what each channel has of them, and loads that repeat.

A sum of sines need not repeat within a recording, and no period of it is a whole number of samples.
Under a Hann window its spectrum is a few peaks; the frequency of each lies where the parabola
through the logarithms of the three highest lines has its top. In segments all channels are fitted
by a straight line and by a cosine and a sine of each frequency (least squares; as IEEE Std 1057
does), whose amplitudes are spectra without leakage. The phase of a load that advances from segment
to segment by 2πfT + θ has the frequency f + θ/(2πT): so the axis is known far better than a line.
"""

from __future__ import annotations

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray

MOST = 32
"""Sines of a load; one with more lines is taken as one that repeats."""

_LEAST = 0.05  # of the largest amplitude, from which a peak is a sine of the load
_WHOLE = 0.98  # of the power, that the sines of each load have
_BESIDE = 3  # lines on each side of a peak that are its own under a Hann window
_PART = 2**14  # samples of the parts between which the phases of sines are compared, at most
_REPEATS = 0.98  # correlation with itself from which a load repeats
_CYCLES = 3.0  # of the lowest sine, or of the beat of two, that a segment holds at least


def sines_in(loads: FloatArray, sample_rate_hz: float) -> FloatArray:
    """(K,) ascending frequencies of the sines that loads (R, n) are the sum of, Hz; none where one
    of them is more than that.
    """
    none, samples = np.empty(0), loads.shape[1]
    straight = scipy.signal.detrend(loads, axis=1)
    window = scipy.signal.windows.hann(samples, sym=False)
    power = np.abs(scipy.fft.rfft(straight * window, axis=1)) ** 2
    power /= np.maximum(power.max(axis=1, keepdims=True), np.finfo(float).tiny)
    peaks = [scipy.signal.find_peaks(own, height=_LEAST**2, distance=_BESIDE)[0] for own in power]
    lines = np.unique(np.concatenate(peaks))
    if not 0 < lines.size <= MOST or lines[0] < _BESIDE:
        return none
    near = np.unique(lines[:, None] + np.arange(-_BESIDE, _BESIDE + 1))
    near = near[near < power.shape[1]]
    if np.any(power[:, near].sum(axis=1) < _WHOLE * power.sum(axis=1)):
        return none
    three = np.log(power.sum(axis=0)[lines[:, None] + np.array([-1, 0, 1])])
    bend = three[:, 0] - 2 * three[:, 1] + three[:, 2]
    tops = (lines + (three[:, 0] - three[:, 2]) / (2 * bend)) * sample_rate_hz / samples
    return _refined(loads, tops, sample_rate_hz)


def _refined(loads: FloatArray, tops: FloatArray, sample_rate_hz: float) -> FloatArray:
    """(K,) the frequencies of sines by the phases of the loads, where parts of them resolve
    these.
    """
    size = min(loads.shape[1] // 4, _PART)
    if segment_s(tops) * sample_rate_hz > size:
        return tops
    parts = loads[:, : loads.shape[1] // size * size].reshape(len(loads), -1, size)
    each = parts @ amplitudes_of(tops, size, sample_rate_hz)
    products = np.sum(each[:, 1:] * each[:, :-1].conj(), axis=(0, 1))
    return advanced(tops, products, size, sample_rate_hz)


def segment_s(frequency_hz: FloatArray) -> float:
    """The shortest segment, s, that resolves sines."""
    return float(_CYCLES / np.min(np.diff(frequency_hz, prepend=0.0)))


def amplitudes_of(frequency_hz: FloatArray, samples: int, sample_rate_hz: float) -> ComplexArray:
    """(n, K) what takes the samples of a segment to the complex amplitudes c of its sines,
    Re Σ c e^{iωt} with t from its first sample.
    """
    turns = 2 * np.pi / sample_rate_hz * np.outer(np.arange(samples), frequency_hz)
    ramp = np.linspace(-1, 1, samples)[:, None]
    basis = np.concatenate([np.cos(turns), -np.sin(turns), np.ones_like(ramp), ramp], axis=1)
    real, imag = np.split(np.linalg.pinv(basis)[: 2 * frequency_hz.size], 2)
    return np.asarray((real + 1j * imag).T)


def advanced(
    frequency_hz: FloatArray, products: ComplexArray, hop: int, sample_rate_hz: float
) -> FloatArray:
    """(K,) the frequencies by the sums (K,) of each segment's amplitudes times the conjugates of
    those of the segment before, whose first samples lie so many apart.
    """
    beyond = np.angle(products * np.exp(-2j * np.pi * frequency_hz * hop / sample_rate_hz))
    return np.asarray(frequency_hz + beyond / (2 * np.pi) * sample_rate_hz / hop)


def period_of(loads: FloatArray) -> float:
    """Samples after which all loads (R, n) repeat, to a fraction of one; 0 where they do not."""
    seen = loads.shape[1]
    part = loads - loads.mean(axis=1, keepdims=True)
    power = np.abs(scipy.fft.rfft(part, 2 * seen, axis=1)) ** 2
    correlation = scipy.fft.irfft(power, axis=1)[:, : seen // 3]
    correlation /= correlation[:, :1] * (1 - np.arange(seen // 3) / seen)
    least = correlation.min(axis=0)  # over the loads
    gone = int(np.argmax(least < _REPEATS / 2))
    again = np.flatnonzero(least[gone:] >= _REPEATS) if gone else np.empty(0)
    if not again.size:
        return 0.0
    period = gone + again[0]
    top = int(np.argmax(least[period : period + max(2, int(period) // 2)]))
    period = float(period + top)
    for times in range(2, seen // 3 // max(int(period), 1)):
        about = round(times * period)
        near = least[about - 1 : about + 2]
        if near.size < 3 or near.max() < _REPEATS:
            return 0.0 if near.size == 3 else period
        bend = near[0] - 2 * near[1] + near[2]
        off = (near[0] - near[2]) / (2 * bend) if bend < 0 else 0.0
        period = (about + float(np.clip(off, -1, 1))) / times
    return period
