"""The hammer's pulse in a force block: where it lies, what the channel's noise is, and whether a
second one follows.

All of it is a few passes over the block, because a campaign has thousands.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.signal.blocks import MEAN_TO_SD, Block, smallest_step

FOOT = 0.05
"""A pulse reaches to where the force falls below this share of its peak."""

SMALLEST_SECOND = 0.015
"""Smallest second pulse that is looked for, as a share of the first."""

REACH = 64
"""Samples that the ringing of a linear-phase filter may reach, weakly, beyond `ringing`."""

LEAD = 256
"""Samples before a pulse that the channels' baselines are taken from."""

# times that a second pulse is higher than what half of the other parts of the block reach
_ALONE = 2.0
# noise is taken in so many parts of a block, since an undone window raises it along the block
_SEGMENTS = 32


@dataclass(frozen=True)
class Pulse:
    """The largest excursion of a force block, the analyser's window undone."""

    peak: int  # sample of the largest magnitude
    # start, stop: first sample of the pulse, and the one behind its last
    start: int
    stop: int
    height: float  # signed value at the peak over the baseline, N
    # offset of the channel before the pulse (of the whole block where nothing is before it), N
    baseline: float
    noise: float = 0.0  # standard deviation of the white noise of one sample, N
    second: float = 0.0  # largest other pulse of the block as a share of the height
    second_z: float = 0.0  # the same over the noise of its own neighbourhood
    second_at: int = 0  # sample where it lies

    @property
    def width(self) -> int:
        """Samples from foot to foot."""
        return self.stop - self.start


def find_pulse(block: Block, sample_rate_hz: float) -> Pulse:
    """The pulse of a force block."""
    raw = block.undone(sample_rate_hz)
    few = raw[:: max(1, raw.size // 512)]
    peak = int(np.argmax(np.abs(raw - few.mean())))
    baseline = _baseline(raw, peak - 4, few)
    if raw[peak] == baseline:
        return Pulse(peak, peak, peak + 1, 0.0, baseline)
    start, stop = _feet(raw, baseline, peak)
    if peak - start > LEAD // 8:  # the flank of a soft tip's pulse is in the baseline
        baseline = _baseline(raw, start - (peak - start) // 2, few)
        start, stop = _feet(raw, baseline, peak)
    height = float(raw[peak]) - baseline
    noise = _noise(raw[stop + 8 :] if raw.size - stop > 64 else raw[: max(start - 8, 2)])
    force = (raw - baseline) * np.sign(height)
    return Pulse(peak, start, stop, height, baseline, noise, *_second(force, peak, start, stop))


def _baseline(raw: FloatArray, end: int, few: FloatArray) -> float:
    """Median of what lies before the sample `end`; of the whole block where that is nothing."""
    part = raw[max(end - LEAD, 0) : max(end, 0)]
    return float(np.median(part if part.size >= 8 else few))


def ringing(start: int, stop: int) -> int:
    """Samples on either side of a pulse that the ringing of the anti-alias filter may reach."""
    return 3 * (stop - start) + 4


def _feet(raw: FloatArray, baseline: float, peak: int) -> tuple[int, int]:
    """First sample of the pulse and the one behind its last."""
    height = raw[peak] - baseline
    outside = np.flatnonzero((raw - baseline) / height <= FOOT)
    k = int(np.searchsorted(outside, peak))
    return (int(outside[k - 1]) + 1 if k else 0), (
        int(outside[k]) if k < outside.size else raw.size
    )


def _noise(x: FloatArray) -> float:
    """Standard deviation of white noise, by the quietest quarter of the first parts of the
    block.
    """
    part = max(x.size // _SEGMENTS, 16)
    count = max(min(x.size // part, 8), 1)
    steps = np.abs(np.diff(x[: count * part], append=x[min(count * part, x.size) - 1]))
    means = np.add.reduceat(steps, np.arange(0, steps.size, part)) / part
    return float(np.sort(means)[max(count // 2, 1) // 2]) * MEAN_TO_SD


def _second(force: FloatArray, peak: int, start: int, stop: int) -> tuple[float, float, int]:
    """Height over the first one's, height over noise, and place of the largest other pulse.

    The force is smoothed over the width of the first pulse, minus the mean of its wider
    surroundings (which takes offset, drift and hum away); a hammer that bounces pushes again, so
    only excursions of the same sign count. Three widths beside the first pulse are the ringing of
    the anti-alias filter and are left out.
    """
    guard, none = ringing(start, stop), (0.0, 0.0, peak)
    width = max((stop - start) // 2, 1)
    width += width % 2  # an even mean is blind at half the sampling rate, where filters ring
    wide = 12 * width
    outside = np.concatenate((force[: max(start - guard, 0)], force[stop + guard :]))
    if force.size < 2 * wide or not outside.size or outside.max() <= SMALLEST_SECOND * force[peak]:
        return none
    sums = np.concatenate(([0.0], np.cumsum(force)))
    near, far = ((sums[n:] - sums[:-n]) / n for n in (width, wide))
    offset = (wide - width) // 2
    at = np.arange(far.size) + offset + width // 2
    level = np.where(
        (at < start - guard) | (at > stop + guard), near[offset : offset + far.size] - far, -np.inf
    )
    own = float(np.max(np.abs(near[max(peak - width, 0) : peak + 1])))
    part = max(level.size // _SEGMENTS, 64)
    edges = np.arange(0, max(level.size - part, 0) + 1, part)
    tops = np.maximum.reduceat(level, edges)
    steps = np.abs(np.diff(force))[offset : offset + level.size]
    spread = np.add.reduceat(steps, edges) / np.diff(np.append(edges, steps.size)) * MEAN_TO_SD
    spread = np.maximum(spread, smallest_step(force[:: max(1, force.size // 512)])) / np.sqrt(width)
    z = tops / np.maximum(spread, 1e-9 * force[peak])
    first = int(np.argmax(z))
    if not np.isfinite(tops[first]) or own == 0:
        return none
    last = edges[first + 1] if first + 1 < edges.size else level.size
    place = int(edges[first] + np.argmax(level[edges[first] : last]))
    # hum comes again and again
    if level[place] < _ALONE * float(np.median(tops[np.isfinite(tops)])):
        return none
    return float(level[place]) / own, float(z[first]), int(at[place])
