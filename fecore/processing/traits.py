"""Numbers of one hit that its judgement needs, from one pass over its blocks; nothing here knows the other hits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import fft

from fecore.arrays import FloatArray
from fecore.frf import Dof
from fecore.processing.blocks import Block, ChannelQuantity, Hit
from fecore.processing.pulse import Pulse, find_pulse, smallest_gap

_NEAR_TOP = 0.97  # share of the largest value from which a sample is near it
_EQUAL = 1e-4  # of the largest value, within which two samples are the same
_SHARE_AT_TOP = 0.6  # of the samples near the top that are the same where a channel is cut off
_STOP_BAND = 0.475  # of the sampling rate: above it every anti-alias filter cuts
_STOP_SAMPLES, _STOP_LEAD = 256, 32
_FILTER_REACH = 64  # samples before the pulse that the ringing of a linear-phase filter may reach


@dataclass(frozen=True)
class Top:
    """How a channel's largest samples lie: many equal ones are an overload.

    Attributes:
        level: largest magnitude, unit of the block, the analyser's window undone.
        equal: samples that reach it within 0.01 %.
        near: samples that reach 97 % of it.
        lopsided: for exactly two equal samples: how unlike the samples beside them are, as a share of the level.
        stop_band: what lies above the anti-alias filter's cut about the pulse, as the magnitude of a single sample
        with that
            spectrum. A cut top is cut after the filter, so it has a part there that nothing else has.
    """

    level: float
    equal: int
    near: int
    lopsided: float
    stop_band: float

    def flat(self, pulse: bool) -> bool:
        """Whether the channel was cut off: three equal samples, or two on the top of an unsymmetrical pulse."""
        if self.equal >= 3:
            return self.equal > _SHARE_AT_TOP * self.near
        return pulse and self.equal == 2 and self.near == 2 and self.lopsided > 0.1


@dataclass(frozen=True)
class Before:
    """A response before the pulse: its offset, and how loud it is about it.

    Attributes:
        offset: mean, unit of the block, as it was before the analyser's window.
        level: standard deviation, smoothed over two samples.
        samples: how many it rests on; 0 where nothing lies before the pulse.
    """

    offset: float
    level: float
    samples: int


@dataclass(frozen=True)
class Channel:
    """What a block was, without its samples."""

    dof: Dof
    quantity: ChannelQuantity
    full_scale: float | None

    @property
    def name(self) -> str:
        """What a sentence calls it."""
        return "force" if self.quantity == "force" else f"{self.quantity} at point {self.dof.point}"


@dataclass(frozen=True)
class Traits:
    """Numbers of one hit; they take its place once its samples are gone.

    Attributes:
        number: which hit of its point it is.
        sample_rate_hz: samples a second.
        samples: length of the blocks.
        channels: force first, then the responses.
        pulse: the hammer's pulse.
        tops: of each channel, how its largest samples lie.
        before: of each response, what lay before the pulse.
        lasting: of each channel, how many samples it lasts, (Σx²)²/Σx⁴ about its mean; 0 where it holds nothing.
        rebound: the force's largest value against the sign of its largest one, as a share of that.
    """

    number: int
    sample_rate_hz: float
    samples: int
    channels: tuple[Channel, ...]
    pulse: Pulse
    tops: tuple[Top, ...]
    before: tuple[Before, ...]
    lasting: tuple[float, ...]
    rebound: float

    @property
    def force(self) -> Dof:
        """Where it was hit."""
        return self.channels[0].dof

    @property
    def responses(self) -> tuple[Dof, ...]:
        """Where the sensors stood."""
        return tuple(channel.dof for channel in self.channels[1:])


def find_traits(hit: Hit) -> Traits:
    """The numbers that judge one hit."""
    rate, blocks = hit.sample_rate_hz, (hit.force, *hit.responses)
    pulse = find_pulse(hit.force, rate)
    return Traits(
        number=hit.number,
        sample_rate_hz=rate,
        samples=hit.samples,
        channels=tuple(Channel(block.dof, block.quantity, block.full_scale) for block in blocks),
        pulse=pulse,
        tops=tuple(_top(block, pulse, rate) for block in blocks),
        before=tuple(_before(block, pulse, rate) for block in hit.responses),
        lasting=tuple(_lasting(block.samples) for block in blocks),
        rebound=_rebound(hit.force.samples),
    )


def _lasting(samples: FloatArray) -> float:
    largest = float(np.abs(samples).max())
    if largest == 0:
        return 0.0
    power = ((samples - samples.mean()) / largest) ** 2
    fourth = float(power @ power)
    return float(power.sum()) ** 2 / fourth if fourth > 0 else 0.0


def _rebound(samples: FloatArray) -> float:
    sides = abs(float(samples.max())), abs(float(samples.min()))
    return min(sides) / max(sides) if max(sides) > 0 else 0.0


def _top(block: Block, pulse: Pulse, sample_rate_hz: float) -> Top:
    x = np.abs(block.samples)
    window = block.window(sample_rate_hz)
    step = 0.0
    if window is not None:
        step = smallest_gap(
            x[:: max(1, x.size // 512)], 1e-6 * float(x.max())
        )  # the window may have come before the converter
        window = np.maximum(window, 0.03)
        x = x / window
    level = float(x.max())
    high = np.flatnonzero(x >= _NEAR_TOP * level)
    slack = (
        _EQUAL * level
        if window is None
        else np.minimum(np.maximum(_EQUAL * level, step / window[high]), 10 * _EQUAL * level)
    )
    equal = high[x[high] >= level - slack]
    lopsided = 0.0
    if equal.size == 2 and equal[1] == equal[0] + 1 and equal[0] > 0 and equal[1] + 1 < x.size and level > 0:
        lopsided = float(abs(x[equal[0] - 1] - x[equal[1] + 1])) / level
    return Top(level, int(equal.size), int(high.size), lopsided, _stop_band(block, pulse, window))


def _stop_band(block: Block, pulse: Pulse, window: FloatArray | None) -> float:
    """Root mean square of the spectrum above the filter's cut, of the samples about the pulse."""
    start = max(pulse.start - _STOP_LEAD, 0)
    cut = slice(start, start + _STOP_SAMPLES)
    part = np.asarray(block.samples[cut], dtype=float)
    if window is not None:
        part = part / window[cut]
    part = (part - part[0]) * _taper(part.size)
    spectrum = fft.rfft(part)
    high = spectrum[int(np.ceil(_STOP_BAND * part.size)) :]
    return float(np.sqrt(np.vdot(high, high).real / high.size))


@lru_cache(maxsize=8)
def _taper(samples: int) -> FloatArray:
    """(n,) 1 over the lead and the first quarter, then a raised cosine down to 0."""
    ramp = np.clip((np.arange(samples) - samples / 4) / (0.75 * samples), 0, 1)
    weights: FloatArray = 0.5 + 0.5 * np.cos(np.pi * ramp)
    return weights


def _before(block: Block, pulse: Pulse, sample_rate_hz: float) -> Before:
    reach = min(_FILTER_REACH + 2 * pulse.width, pulse.start // 2)
    part = np.asarray(block.samples[: max(pulse.start - reach, 0)], dtype=float)
    if part.size < 8:
        return Before(0.0, 0.0, 0)
    window = block.window(sample_rate_hz)
    if window is not None:
        part = part / window[: part.size]
    offset = float(part.sum()) / part.size
    smooth = (part[1:] + part[:-1]) / 2 - offset
    return Before(offset, float(np.sqrt(smooth @ smooth / smooth.size)), int(part.size))
