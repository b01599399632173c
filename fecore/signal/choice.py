"""Windows chosen from the blocks, where none are stated.

The force window is some widths of the pulse. The exponential window is as weak as can be: every mode that the response
shows shall have fallen to 1 % of its amplitude by the end of the block. How fast modes fall is read from the spectra
of the first and the second half of the response behind the pulse: at a peak, α = ln(P1/P2)/(2 t_half). The mode that
falls slowest decides, so a loud fast mode does not hide a quiet slow one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fecore.arrays import FloatArray
from fecore.frf import MAINS_HZ
from fecore.signal.blocks import Hit
from fecore.signal.traits import Traits
from fecore.signal.windows import Windows

LEFT_AT_END = 0.01
"""Share of a mode's amplitude that may be left at the end of a block."""

FORCE_WIDTHS = 10
"""Length of the force window in widths of the pulse."""

_SHOWN = 1e-4  # of the strongest line's power: 40 dB
_ABOVE_NOISE = 10.0  # power of a peak over the noise's from which it counts
_STEADY = 0.2  # logarithm of the fall between the halves below which a peak does not decay
_FIRST_LINE = 5  # below which drift lies


def choose_windows(sample: Sequence[tuple[Hit, Traits]]) -> Windows:
    """Windows for hits like these; the rectangular ones where there is nothing to gain."""
    clear = [(hit, traits) for hit, traits in sample if abs(traits.pulse.height) > 20 * traits.pulse.noise]
    if not clear:
        return Windows()
    width = float(np.median([t.pulse.width / hit.sample_rate_hz for hit, t in clear]))
    needed = [max(_needed_rate(hit, channel, t) for channel in range(len(hit.responses))) for hit, t in clear]
    length = max(FORCE_WIDTHS * width, 24 / clear[0][0].sample_rate_hz)
    return Windows(float(f"{length:.3g}"), float(np.ceil(10 * np.percentile(needed, 75)) / 10))


def _needed_rate(hit: Hit, channel: int, traits: Traits) -> float:
    """Rate that one response wants beside what the analyser has applied, 1/s."""
    start = traits.pulse.stop
    half = (hit.samples - start) // 2
    if half < 64:
        return 0.0
    values = np.asarray(hit.responses[channel].samples[start : start + 2 * half], dtype=float)
    taper = np.hanning(half)
    first, second = (np.abs(np.fft.rfft(taper * part)) ** 2 for part in (values[:half], values[half:]))
    rate = _slowest(first, second, half / hit.sample_rate_hz)
    left = (hit.samples - start) / hit.sample_rate_hz
    return max(0.0, np.log(1 / LEFT_AT_END) / left - rate) if np.isfinite(rate) else 0.0


def _slowest(first: FloatArray, second: FloatArray, half_s: float) -> float:
    """Smallest decay rate of the peaks of the first half's power that stand above noise in the second, 1/s; infinite
    for none.
    """
    noise = float(np.percentile(second, 25)) / 0.288  # of exponentially distributed power, the mean
    middle = first[1:-1]
    peak = (middle > first[:-2]) & (middle >= first[2:]) & (middle > _SHOWN * first[_FIRST_LINE:].max())
    lines = np.flatnonzero(peak) + 1
    lines = lines[(lines >= _FIRST_LINE) & (second[lines] > _ABOVE_NOISE * noise)]
    fall = np.log(first[lines] / second[lines]) / 2
    off = np.min(
        [np.abs(lines / half_s / mains - np.round(lines / half_s / mains)) * mains for mains in MAINS_HZ], axis=0
    )
    fall = fall[(off > 1.5 / half_s) | (fall > _STEADY)]  # what stands still at the mains' harmonics is hum
    return float(fall.min()) / half_s if fall.size else np.inf
