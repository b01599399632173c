"""An exponential window that an analyser has applied and nobody stated, seen where the noise decays with it.

Behind its pulse the force channel holds noise alone. The root mean square s of the steps from sample to sample, which hum
and drift hardly reach, is taken in equal parts of a block; under exp(-r t)

    ln s(t) = c - r t.

r is the mean of the hits' slopes, without those of double hits and the like that lie far from their median. It counts where it
stands out of their scatter, and where ln s bends far less than it falls: what else rings in a hammer dies away into a floor,
and a window has none. Noise that does not fall shows that there is no window, as surely as its slopes agree. Noise far below
the converter's step shows nothing: most samples are then as the one before, and s says how often drift crosses a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.signal.blocks import Hit
from fecore.signal.pulse import REACH, find_pulse, ringing
from fecore.signal.spectra import Source

_PARTS = 12  # of a block's noise
_FEWEST_SAMPLES = 64  # of a part
_FEWEST_HITS = 4  # whose scatter says what stands out of it
_NEAR = 2.5  # standard deviations about the median, up to which a slope is no outlier
_LOOKED_AT = 72  # hits, spread over the points
_CERTAIN = 5.0  # standard deviations that the rate is above none
_BENT = 0.25  # of the fall, that ln s may bend over the block
_STILL = 0.75  # of the samples, that are as the one before where the converter's steps hide the noise


@dataclass(frozen=True)
class SeenRate:
    """Rate of an exponential window, 0 for none, and its standard deviation, 1/s; None where the noise does not show it."""

    rate_per_s: float
    sd: float | None

    @property
    def sentence(self) -> str:
        """What a user should know of a rate that was seen."""
        return (
            f"the force's noise decays by {self.rate_per_s:.3g} ± {self.sd:.1g} per second in all hits: an exponential window "
            "that is not stated, and that is taken out like a stated one"
        )


class UnderWindow:
    """Hits whose blocks state the window that was seen."""

    def __init__(self, source: Source, rate_per_s: float) -> None:
        self.source, self.rate = source, rate_per_s

    def __len__(self) -> int:
        return len(self.source)

    def __getitem__(self, point: int) -> Sequence[Hit]:
        return [
            replace(
                hit,
                force=replace(hit.force, window_rate_per_s=self.rate),
                responses=tuple(replace(block, window_rate_per_s=self.rate) for block in hit.responses),
            )
            for hit in self.source[point]
        ]


def with_unstated_window(source: Source) -> tuple[Source, SeenRate | None]:
    """The same hits with the window that their noise shows, and which; hits that state one as they are, and None."""
    step = max(1, -(-len(source) // _LOOKED_AT))
    sample = [
        hit for number in range(0, len(source), step) for hit in source[number][: max(_LOOKED_AT // len(source), 1)]
    ]
    if any(block.window_rate_per_s for hit in sample for block in (hit.force, *hit.responses)):
        return source, None
    seen = seen_rate(sample)
    return (UnderWindow(source, seen.rate_per_s) if seen.rate_per_s else source), seen


def seen_rate(hits: Sequence[Hit]) -> SeenRate:
    """The rate by which the noise of the hits' force decays."""
    found = np.array([row for hit in hits if (row := _decay(hit)) is not None])
    if len(found) < _FEWEST_HITS:
        return SeenRate(0.0, None)
    off = np.abs(found - np.median(found, axis=0))
    near = found[(off <= _NEAR * 1.4826 * np.median(off, axis=0)).all(axis=1)]
    if len(near) < _FEWEST_HITS:
        return SeenRate(0.0, None)
    rate, bend = (float(x) for x in near.mean(axis=0))
    block = hits[0].samples / hits[0].sample_rate_hz
    least = np.sqrt(6 / hits[0].samples) * np.array([1 / block, 1.0])  # what white noise leaves open, of a few hits too
    sd, bend_sd = (float(x) for x in np.maximum(near.std(axis=0), least) / np.sqrt(len(near)))
    if rate < _CERTAIN * sd:
        return SeenRate(0.0, float(np.hypot(rate, sd)))
    if abs(bend) > _BENT * rate * block + _CERTAIN * bend_sd:
        return SeenRate(0.0, None)
    return SeenRate(rate, sd)


def _decay(hit: Hit) -> tuple[float, float] | None:
    """-d(ln s)/dt, 1/s, and how far ln s bends from the middle of the noise to its ends; None where there is no noise."""
    pulse = find_pulse(hit.force, hit.sample_rate_hz)
    noise = hit.force.samples[pulse.stop + ringing(pulse.start, pulse.stop) + REACH :]
    size = noise.size // _PARTS
    if size < _FEWEST_SAMPLES:
        return None
    steps = np.abs(np.diff(noise[: size * _PARTS].astype(float).reshape(_PARTS, size), axis=1))
    power = (steps**2).mean(axis=1)
    if not power.min() > 0 or (np.quantile(steps, _STILL, axis=1) < 0.1 * np.sqrt(power)).mean() > 0.5:
        return None
    bend, slope, _ = np.polyfit(np.linspace(-1, 1, _PARTS), np.log(power) / 2, 2)
    half_s = 0.5 * (_PARTS - 1) * size / hit.sample_rate_hz
    return -float(slope) / half_s, float(bend)
