"""Windows of a hammer test, and the exact correction of damping for them.

A force window keeps the pulse and sets the noise behind it to zero. An exponential window exp(-r t) on the response
makes a record that has not died away end near zero. Applied to force and response alike (t from the block's first
sample) the ratio of their spectra is the FRF of the same body at s = iω + r: every pole p = -ζω₀ + iω_d is seen at p -
r, so

    ζ_true ω₀ = ζ_seen ω₀,seen - r,    ω_d the same,

exactly, whatever the pulse, where the response has died away at the end. So a window that an analyser has put on one
channel is completed on the other before the transform, and both always carry the same rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.signal.blocks import Block, Hit, exponential
from fecore.signal.pulse import Pulse

_FORCE_BEFORE = 0.25
"""Share of the force window that lies before the pulse's peak; the ringing of a filter is on both sides."""

_TAPER = 0.2
"""Share of the force window's length that fades in, and fades out."""


@dataclass(frozen=True)
class Windows:
    """What multiplies the blocks before their transform.

    Attributes:
        force_length_s: length of the force window about the pulse, s; None leaves the whole block (rectangular).
        rate_per_s: r of the exponential window on both channels, 1/s, beside what the analyser has applied; 0 for none.
    """

    force_length_s: float | None = None
    rate_per_s: float = 0.0

    def __post_init__(self) -> None:
        if self.force_length_s is not None and not (np.isfinite(self.force_length_s) and self.force_length_s > 0):
            raise InputError(
                "windows.force_length_s", f"is {self.force_length_s}, expected a positive number of seconds"
            )
        if not (np.isfinite(self.rate_per_s) and self.rate_per_s >= 0):
            raise InputError("windows.rate_per_s", f"is {self.rate_per_s}, expected 0 or more per second")


def total_rate(hit: Hit, windows: Windows) -> float:
    """Rate of the exponential window that the FRFs of a hit carry in the end, 1/s."""
    return max(block.window_rate_per_s for block in (hit.force, *hit.responses)) + windows.rate_per_s


_ALL = slice(None)


def windowed(
    block: Block, baseline: float, sample_rate_hz: float, rate_per_s: float, into: FloatArray, kept: slice = _ALL
) -> None:
    """Put the samples, all or those of a part, without the offset `baseline` (as it was before the analyser's window), under
    exp(-rate t) in all, into an array as long as they are.
    """
    applied, samples = block.window_rate_per_s, block.samples.size
    offset = baseline * exponential(samples, applied / sample_rate_hz)[kept] if applied else baseline
    into[:] = block.samples[kept]
    into -= offset
    if rate_per_s > applied:
        into *= exponential(samples, (rate_per_s - applied) / sample_rate_hz)[kept]


def force_window(pulse: Pulse, length: int, samples: int) -> tuple[slice, FloatArray]:
    """The samples about the pulse that a force window of so many samples keeps, and their weights: raised cosines at both
    ends, unless these lie outside the block.
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
    """Natural frequencies, Hz, and damping ratios without the exponential window of `rate_per_s` that the FRFs carry.

    Poles p_seen = -ζω₀ + iω₀√(1 - ζ²) are moved by +r; natural frequency and ratio follow from the moved pole. A ratio
    at or below zero says that the stated rate is larger than all damping that was seen.

    Raises:
        InputError: the rate is negative or not finite.
    """
    if not (np.isfinite(rate_per_s) and rate_per_s >= 0):
        raise InputError("rate_per_s", f"is {rate_per_s}, expected 0 or more per second")
    omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
    zeta = np.asarray(damping_ratio, dtype=float)
    poles: ComplexArray = -zeta * omega + rate_per_s + 1j * omega * np.sqrt(np.maximum(1 - zeta**2, 0))
    natural = np.abs(poles)
    with np.errstate(divide="ignore", invalid="ignore"):
        return natural / (2 * np.pi), np.where(natural > 0, -poles.real / natural, zeta)
