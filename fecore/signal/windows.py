"""Windows of a hammer test, their choice, and the exact correction of damping for them.

A force window keeps the pulse and sets the noise behind it to zero. An exponential window exp(-r t)
on the response makes a record that has not died away end near zero. Applied to force and response
alike (t from the block's first sample) the ratio of their spectra is the FRF of the same body at s
= iω + r: every pole p = -ζω₀ + iω_d is seen at p - r, so

    ζ_true ω₀ = ζ_seen ω₀,seen - r,    ω_d the same,

exactly, whatever the pulse, where the response has died away at the end. So a window that an
analyser has put on one channel is completed on the other before the transform, and both always
carry the same rate.

Where none are stated, they are chosen. The force window is some widths of the pulse. The
exponential window is as weak
as can be: every mode that the response shows shall have fallen to 1 % of its amplitude by the end
of the block. How fast
modes fall is read from the spectra of the first and the second half of the response behind the
pulse: at a peak, α = ln(P1/P2)/(2 t_half). The mode that falls slowest decides, so a loud fast mode
does not hide a quiet slow one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.frf import MAINS_HZ
from fecore.signal.blocks import Block, Hit, exponential
from fecore.signal.hit_features import HitFeatures
from fecore.signal.pulse import Pulse

_FORCE_BEFORE = 0.25
"""Share of the force window that lies before the pulse's peak; the ringing of a filter is on both
sides.
"""

_TAPER = 0.2
"""Share of the force window's length that fades in, and fades out."""

LEFT_AT_END = 0.01
"""Share of a mode's amplitude that may be left at the end of a block."""

_FORCE_WIDTHS = 10
"""Length of the force window in widths of the pulse."""

_SHOWN = 1e-4  # of the strongest line's power: 40 dB
_ABOVE_NOISE = 10.0  # power of a peak over the noise's from which it counts
_STEADY = 0.2  # logarithm of the fall between the halves below which a peak does not decay
_FIRST_LINE = 5  # below which drift lies


@dataclass(frozen=True)
class Windows:
    """What multiplies the blocks before their transform."""

    # length of the force window about the pulse, s; None leaves the whole block (rectangular)
    force_length_s: float | None = None
    # r of the exponential window on both channels, 1/s, beside what the analyser has applied; 0 for
    # none
    rate_per_s: float = 0.0

    def __post_init__(self) -> None:
        if self.force_length_s is not None and not (
            np.isfinite(self.force_length_s) and self.force_length_s > 0
        ):
            raise InputError(
                "windows.force_length_s",
                f"is {self.force_length_s}, expected a positive number of seconds",
            )
        if not (np.isfinite(self.rate_per_s) and self.rate_per_s >= 0):
            raise InputError(
                "windows.rate_per_s", f"is {self.rate_per_s}, expected 0 or more per second"
            )


def choose_windows(sample: Sequence[tuple[Hit, HitFeatures]]) -> Windows:
    """Windows for hits like these; the rectangular ones where there is nothing to gain."""
    clear = [
        (hit, features)
        for hit, features in sample
        if abs(features.pulse.height) > 20 * features.pulse.noise
    ]
    if not clear:
        return Windows()
    width = float(np.median([t.pulse.width / hit.sample_rate_hz for hit, t in clear]))
    needed = [
        max(_needed_rate(hit, channel, t) for channel in range(len(hit.responses)))
        for hit, t in clear
    ]
    length = max(_FORCE_WIDTHS * width, 24 / clear[0][0].sample_rate_hz)
    return Windows(float(f"{length:.3g}"), float(np.ceil(10 * np.percentile(needed, 75)) / 10))


def _needed_rate(hit: Hit, channel: int, features: HitFeatures) -> float:
    """Rate that one response wants beside what the analyser has applied, 1/s."""
    start = features.pulse.stop
    half = (hit.samples - start) // 2
    if half < 64:
        return 0.0
    values = np.asarray(hit.responses[channel].samples[start : start + 2 * half], dtype=float)
    taper = np.hanning(half)
    first, second = (
        np.abs(np.fft.rfft(taper * part)) ** 2 for part in (values[:half], values[half:])
    )
    rate = _slowest(first, second, half / hit.sample_rate_hz)
    left = (hit.samples - start) / hit.sample_rate_hz
    return max(0.0, np.log(1 / LEFT_AT_END) / left - rate) if np.isfinite(rate) else 0.0


def _slowest(first: FloatArray, second: FloatArray, half_s: float) -> float:
    """Smallest decay rate of the peaks of the first half's power that stand above noise in the
    second, 1/s; infinite for none.
    """
    noise = float(np.percentile(second, 25)) / 0.288  # of exponentially distributed power, the mean
    middle = first[1:-1]
    peak = (
        (middle > first[:-2])
        & (middle >= first[2:])
        & (middle > _SHOWN * first[_FIRST_LINE:].max())
    )
    lines = np.flatnonzero(peak) + 1
    lines = lines[(lines >= _FIRST_LINE) & (second[lines] > _ABOVE_NOISE * noise)]
    fall = np.log(first[lines] / second[lines]) / 2
    off = np.min(
        [
            np.abs(lines / half_s / mains - np.round(lines / half_s / mains)) * mains
            for mains in MAINS_HZ
        ],
        axis=0,
    )
    # what stands still at the mains' harmonics is hum
    fall = fall[(off > 1.5 / half_s) | (fall > _STEADY)]
    return float(fall.min()) / half_s if fall.size else np.inf


def total_rate(hit: Hit, windows: Windows) -> float:
    """Rate of the exponential window that the FRFs of a hit carry in the end, 1/s."""
    return (
        max(block.window_rate_per_s for block in (hit.force, *hit.responses)) + windows.rate_per_s
    )


_ALL = slice(None)


def windowed(
    block: Block,
    baseline: float,
    sample_rate_hz: float,
    rate_per_s: float,
    into: FloatArray,
    kept: slice = _ALL,
) -> None:
    """Put the samples, all or those of a part, without the offset `baseline` (as it was before the
    analyser's window), under exp(-rate t) in all, into an array as long as they are.
    """
    applied, samples = block.window_rate_per_s, block.samples.size
    offset = (
        baseline * exponential(samples, applied / sample_rate_hz)[kept] if applied else baseline
    )
    into[:] = block.samples[kept]
    into -= offset
    if rate_per_s > applied:
        into *= exponential(samples, (rate_per_s - applied) / sample_rate_hz)[kept]


def force_window(pulse: Pulse, length: int, samples: int) -> tuple[slice, FloatArray]:
    """The samples about the pulse that a force window of so many samples keeps, and their weights:
    raised cosines at both ends, unless these lie outside the block.
    """
    length = max(length, pulse.width + 4)
    start = pulse.peak - max(int(_FORCE_BEFORE * length), pulse.peak - pulse.start + 2)
    stop = start + length
    taper = max(int(_TAPER * length), 2)
    ramp = _ramp(taper)
    weights: FloatArray = np.ones(length)
    if start >= 0:
        weights[:taper] *= ramp
    if stop <= samples:
        weights[-taper:] *= ramp[::-1]
    kept = slice(max(start, 0), min(stop, samples))
    return kept, weights[kept.start - start : kept.stop - start]


@lru_cache(maxsize=16)
def _ramp(samples: int) -> FloatArray:
    """(n,) the rising half of a raised cosine."""
    weights: FloatArray = 0.5 - 0.5 * np.cos(np.pi * (np.arange(samples) + 0.5) / samples)
    weights.flags.writeable = False
    return weights


def remove_window(
    frequency_hz: FloatArray, damping_ratio: FloatArray, rate_per_s: float
) -> tuple[FloatArray, FloatArray]:
    """Natural frequencies, Hz, and damping ratios without the exponential window of `rate_per_s`
    that the FRFs carry.

    Poles p_seen = -ζω₀ + iω₀√(1 - ζ²) are moved by +r; natural frequency and ratio follow from the
    moved pole. A ratio at or below zero says that the stated rate is larger than all damping that
    was seen.

    Raises:
        InputError: the rate is negative or not finite.
    """
    if not (np.isfinite(rate_per_s) and rate_per_s >= 0):
        raise InputError("rate_per_s", f"is {rate_per_s}, expected 0 or more per second")
    omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
    zeta = np.asarray(damping_ratio, dtype=float)
    poles: ComplexArray = (
        -zeta * omega + rate_per_s + 1j * omega * np.sqrt(np.maximum(1 - zeta**2, 0))
    )
    natural = np.abs(poles)
    with np.errstate(divide="ignore", invalid="ignore"):
        return natural / (2 * np.pi), np.where(natural > 0, -poles.real / natural, zeta)
