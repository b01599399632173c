"""The hammer's pulse in a force block: where it lies, what the channel's noise is, and whether a second one follows.

All of it is one or two passes over the block, because a campaign has thousands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.signal.blocks import Block

FOOT = 0.05
"""A pulse reaches to where the force falls below this share of its peak."""

SMALLEST_SECOND = 0.015
"""Smallest second pulse that is looked for, as a share of the first."""

_MEAN_TO_SD = float(np.sqrt(np.pi) / 2)  # of the difference of two white samples, to the sd of one
_LEAD = 256  # samples before a pulse that its baseline is taken from
_ALONE = 2.0  # times that a second pulse is higher than what half of the other parts of the block reach
_KNOWN = 0.03  # of the analyser's window, down to which the channel's offset is taken from the block
_SEGMENTS = 32  # noise is taken in so many parts of a block, since a window lowers it along the block


@dataclass(frozen=True)
class Pulse:
    """The largest excursion of a force block.

    Attributes:
        peak: sample of the largest magnitude.
        start, stop: first sample of the pulse, and the one behind its last.
        height: signed value at the peak over the baseline, N, the analyser's window undone.
        baseline: offset of the channel before the pulse (of the whole block where nothing is before it), N.
        noise: standard deviation of the white noise of one sample, N.
        second: largest other pulse of the block as a share of the height, in the same window-free unit.
        second_z: the same over the noise of its own neighbourhood.
        second_at: sample where it lies.
    """

    peak: int
    start: int
    stop: int
    height: float
    baseline: float
    noise: float
    second: float
    second_z: float
    second_at: int

    @property
    def width(self) -> int:
        """Samples from foot to foot."""
        return self.stop - self.start


def find_pulse(block: Block, sample_rate_hz: float) -> Pulse:
    """The pulse of a force block."""
    raw = block.samples
    window = block.window(sample_rate_hz)
    peak = _peak(raw, window)
    baseline = _baseline(raw, window, peak, peak - 4)
    weight = 1.0 if window is None else float(window[peak])
    height = (float(raw[peak]) - baseline) / weight
    if height == 0:
        return Pulse(
            peak=peak,
            start=peak,
            stop=peak + 1,
            height=0.0,
            baseline=baseline,
            noise=0.0,
            second=0.0,
            second_z=0.0,
            second_at=peak,
        )
    start, stop = _feet(raw, window, baseline, peak)
    if peak - start > _LEAD // 8:  # the flank of a soft tip's pulse is in the baseline
        baseline = _baseline(raw, window, peak, start - (peak - start) // 2)
        height = (float(raw[peak]) - baseline) / weight
        start, stop = _feet(raw, window, baseline, peak)
    noise = _noise(raw[stop + 8 :] if raw.size - stop > 64 else raw[: max(start - 8, 2)])
    second, z, at = 0.0, 0.0, peak
    if _another(raw, window, baseline, height, start, stop):
        level = baseline if window is None else baseline / weight * window
        second, z, at = _second(np.asarray(raw, dtype=float) - level, window, peak, start, stop, height)
    return Pulse(
        peak=peak,
        start=start,
        stop=stop,
        height=height,
        baseline=baseline / weight,
        noise=noise,
        second=second,
        second_z=z,
        second_at=at,
    )


def _peak(raw: FloatArray, window: FloatArray | None) -> int:
    """Sample of the largest magnitude over the channel's offset, the window undone."""
    if window is not None:
        raw = raw / np.maximum(window, 1e-3)
    high, low = int(np.argmax(raw)), int(np.argmin(raw))
    few = slice(0, None if window is None else int(np.searchsorted(-window, -_KNOWN)), max(1, raw.size // 512))
    offset = float(raw[few].mean())
    return high if float(raw[high]) - offset >= offset - float(raw[low]) else low


def _baseline(raw: FloatArray, window: FloatArray | None, peak: int, end: int) -> float:
    """Median of what lies before the sample `end`, as it would be at the peak; of the whole block where that is nothing."""
    lead = slice(max(end - _LEAD, 0), max(end, 0))
    part = raw[lead] if window is None else raw[lead] * (window[peak] / window[lead])
    if part.size < 8:
        part = raw[:: max(1, raw.size // 512)]
    return float(np.partition(part, part.size // 2)[part.size // 2])


def _another(raw: FloatArray, window: FloatArray | None, baseline: float, height: float, start: int, stop: int) -> bool:
    """Whether any sample outside the first pulse and its ringing is worth a look: one pass, for nearly all hits the last."""
    guard = ringing(start, stop)
    for cut in (slice(0, max(start - guard, 0)), slice(stop + guard, raw.size)):
        part = raw[cut]
        if not part.size:
            continue
        if window is None:
            far = float(part.max()) - baseline if height > 0 else baseline - float(part.min())
        else:
            far = float(
                ((part - baseline * window[cut] / window[0]) / np.maximum(window[cut], 1e-3) * np.sign(height)).max()
            )
        if far > SMALLEST_SECOND * abs(height):
            return True
    return False


def ringing(start: int, stop: int) -> int:
    """Samples on either side of a pulse that the ringing of the anti-alias filter may reach."""
    return 3 * (stop - start) + 4


def _feet(raw: FloatArray, window: FloatArray | None, baseline: float, peak: int) -> tuple[int, int]:
    """First sample of the pulse and the one behind its last. The channel's offset is under the analyser's window as well."""
    reach = 32
    while True:  # a pulse is a few samples to a few hundred
        low, high = max(peak - reach, 0), min(peak + reach + 1, raw.size)
        level = baseline if window is None else baseline * (window[low:high] / window[peak])
        x = (raw[low:high] - level) * np.sign(raw[peak] - baseline)
        outside = x <= FOOT * x[peak - low]
        left, right = np.flatnonzero(outside[: peak - low]), np.flatnonzero(outside[peak - low + 1 :])
        if (left.size or low == 0) and (right.size or high == raw.size):
            start = low + int(left[-1]) + 1 if left.size else 0
            return start, peak + 1 + int(right[0]) if right.size else raw.size
        reach *= 4


def _noise(x: FloatArray) -> float:
    """Standard deviation of white noise from mean |difference|, by the quietest quarter of the first parts of the
    block.
    """
    part = max(x.size // _SEGMENTS, 16)
    count = max(min(x.size // part, 8), 1)
    x = x[: count * part]
    jumps = np.abs(x[1:] - x[:-1]) if x.size > 1 else np.zeros(1)
    means = np.add.reduceat(jumps, np.arange(0, jumps.size, part)) / part
    return float(np.sort(means)[max(count // 2, 1) // 2]) * _MEAN_TO_SD


def _second(
    x: FloatArray, window: FloatArray | None, peak: int, start: int, stop: int, height: float
) -> tuple[float, float, int]:
    """Height over the first one's, height over noise, and place of the largest other pulse.

    The block, less its offset, is smoothed over the width of the first pulse, minus the mean of its wider surroundings (which
    takes offset, drift and hum away); a hammer that bounces pushes again, so only excursions of the same sign count. Three
    widths beside the first pulse are the ringing of the anti-alias filter and are left out.
    """
    width = max((stop - start) // 2, 1)
    width += width % 2  # an even mean is blind at half the sampling rate, where filters ring
    wide = 12 * width
    guard = ringing(start, stop)
    sum_ = np.concatenate(([0.0], np.cumsum(x)))
    if x.size < 2 * wide:
        return 0.0, 0.0, peak
    near = (sum_[width:] - sum_[:-width]) / width
    far = (sum_[wide:] - sum_[:-wide]) / wide
    offset = (wide - width) // 2
    smooth = (near[offset : offset + far.size] - far) * (1.0 if height > 0 else -1.0)
    at = np.arange(smooth.size) + offset + width // 2
    # The first through the same mean.
    own = float(np.max(np.abs(near[max(peak - width, 0) : peak + 1])))
    level = np.where((at < start - guard) | (at > stop + guard), smooth, -np.inf)
    part = max(level.size // _SEGMENTS, 64)
    edges = np.arange(0, max(level.size - part, 0) + 1, part)
    tops = np.maximum.reduceat(level, edges)
    jumps = np.abs(np.diff(x))[offset : offset + level.size]
    spread = np.add.reduceat(jumps, edges) / np.diff(np.append(edges, jumps.size)) * np.sqrt(np.pi) / 2
    spread = np.maximum(spread, _step(x, height)) / np.sqrt(width)
    z = tops / np.maximum(spread, 1e-9 * abs(height))
    first = int(np.argmax(z))
    if not np.isfinite(tops[first]):
        return 0.0, 0.0, peak
    last = edges[first + 1] if first + 1 < edges.size else level.size
    place = int(edges[first] + np.argmax(level[edges[first] : last]))
    everywhere = float(np.median(tops[np.isfinite(tops)]))
    if level[place] < _ALONE * everywhere:  # hum comes again and again
        return 0.0, 0.0, peak
    if own == 0:  # no pulse, but a few steps of the converter that cancel
        return 0.0, 0.0, peak
    share = float(level[place]) / own
    if window is not None:
        share *= float(window[peak] / window[min(int(at[place]), window.size - 1)])
    return share, float(z[first]), int(at[place])


def _step(x: FloatArray, height: float) -> float:
    """The converter's step: the smallest gap between values over the block."""
    return smallest_gap(x[:: max(1, x.size // 512)], 1e-6 * abs(height))


def smallest_gap(values: FloatArray, above: float) -> float:
    """Smallest difference between any two values that is larger than `above`; 0 for none."""
    gaps = np.diff(np.sort(values))
    gaps = gaps[gaps > above]
    return float(gaps.min()) if gaps.size else 0.0
