"""Numbers of hits that their judgement needs, each from its own blocks alone; no number depends on another hit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.frf import Dof
from fecore.signal.blocks import Block, ChannelQuantity, Hit
from fecore.signal.estimators import squared
from fecore.signal.pulse import Pulse, find_pulse, smallest_gap

_NEAR_TOP = 0.97  # share of the largest value from which a sample is near it
_EQUAL = 1e-4  # of the largest value, within which two samples are the same
REBOUND = 0.5
"""Share of its largest value that a force may swing back: a pulse behind AC coupling comes to a fifth."""
_SHARE_AT_TOP = 0.4  # of the samples near the top that are the same where a channel is cut off; of a round one 0.06
_STOP_BAND = 0.475  # of the sampling rate: above it every anti-alias filter cuts
_STOP_SAMPLES, _STOP_LEAD = 256, 32
_AT_ONCE = 2**18
"""Samples that are worked on together: enough for fast passes, few enough for a processor's cache."""
_WEAKEST = 0.03  # of an analyser's window, that is undone: below it there is noise alone
_SPECTRUM = 256  # samples before the pulse whose lines are taken
LINES = 160
"""Lines before the pulse, up to 0.31 of the sampling rate: above it the filter rings where the lead is short."""
_SMOOTHING = (0.125, 0.375)  # outer and inner weights of four samples: 0.01 at 0.43 of the sampling rate
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
        level: standard deviation about a straight line, smoothed over four samples with 1, 3, 3, 1: where the lead is short
        the anti-alias filter of linear phase rings in it, near half of the sampling rate.
        samples: how many it rests on; 0 where nothing lies before the pulse.
        lines: (160,) |Σ x_j exp(-2πi j k/512)|² / n at k = 1 to 160, of its last n samples, up to 256, about their mean.
        after: the same of as many samples behind the pulse.
    """

    offset: float
    level: float
    samples: int
    lines: FloatArray = field(compare=False)
    after: FloatArray = field(compare=False)


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
        rebound: the force's largest value against the sign of its largest one, as a share of that.
        lasting: of each channel, how many samples it lasts, (Σx²)²/Σx⁴ about its mean, 0 where it holds nothing; empty for
        a force that swings back by less than half, which is a pulse.
    """

    number: int
    sample_rate_hz: float
    samples: int
    channels: tuple[Channel, ...]
    pulse: Pulse
    tops: tuple[Top, ...]
    before: tuple[Before, ...]
    rebound: float
    lasting: tuple[float, ...]

    @property
    def force(self) -> Dof:
        """Where it was hit."""
        return self.channels[0].dof

    @property
    def responses(self) -> tuple[Dof, ...]:
        """Where the sensors stood."""
        return tuple(channel.dof for channel in self.channels[1:])


def parts(hits: int, values: int) -> Iterator[slice]:
    """Hits of so many values each, in parts that are worked on together."""
    step = max(1, min(hits, _AT_ONCE // values))
    return (slice(start, min(start + step, hits)) for start in range(0, hits, step))


def find_traits(hits: Sequence[Hit]) -> tuple[Traits, ...]:
    """The numbers that judge hits of one length, sampling rate and set of sensors, in their order."""
    found: list[Traits] = []
    for _, alike in groupby(hits, lambda hit: [block.window_rate_per_s for block in (hit.force, *hit.responses)]):
        same = list(alike)
        for part in parts(len(same), same[0].samples):
            found += _traits(same[part])
    return tuple(found)


def _traits(hits: Sequence[Hit]) -> Iterator[Traits]:
    rate = hits[0].sample_rate_hz
    pulses = [find_pulse(hit.force, rate) for hit in hits]
    by_channel = list(zip(*((hit.force, *hit.responses) for hit in hits), strict=True))
    beyond = iter(
        _stop_bands(
            [_about(block, pulse, rate) for blocks in by_channel for block, pulse in zip(blocks, pulses, strict=True)]
        )
    )
    channels = [[_largest(block, rate, next(beyond)) for block in blocks] for blocks in by_channel]
    before = [_before(blocks, pulses, rate) for blocks in by_channel[1:]]
    for i, (hit, pulse) in enumerate(zip(hits, pulses, strict=True)):
        blocks = (hit.force, *hit.responses)
        rebound = _rebound(hit.force, pulse, rate, channels[0][i].sides)
        yield Traits(
            number=hit.number,
            sample_rate_hz=rate,
            samples=hit.samples,
            channels=tuple(Channel(block.dof, block.quantity, block.full_scale) for block in blocks),
            pulse=pulse,
            tops=tuple(channel[i].top for channel in channels),
            before=tuple(channel[i] for channel in before),
            rebound=rebound,
            lasting=tuple(_lasting(block.samples) for block in blocks) if rebound > REBOUND else (),
        )


@dataclass(frozen=True)
class _Largest:
    """Of one block: its top, and its largest magnitudes to either side."""

    top: Top
    sides: tuple[float, float]


def _largest(block: Block, rate: float, beyond: float) -> _Largest:
    """How a block's largest samples lie, in few passes, for a campaign has thousands of blocks. `beyond` is what it has in
    the stop band.
    """
    samples = size = block.samples
    window, step = block.window(rate), 0.0
    sides = high, low = abs(samples.max()), abs(samples.min())
    if window is not None:  # which may have come before the converter
        few = np.abs(samples[:: max(1, samples.size // 512)])
        step = smallest_gap(few, 1e-6 * float(max(sides)))
        window = np.maximum(window, _WEAKEST)
        size = samples / window
        high, low = abs(size.max()), abs(size.min())
    near = _NEAR_TOP * max(high, low)
    reach = size >= near
    if low >= near:
        reach |= size <= -near
    top = _top(size, np.flatnonzero(reach), window, step=step, stop_band=beyond)
    return _Largest(top, (float(sides[0]), float(sides[1])))


def _rebound(force: Block, pulse: Pulse, rate: float, sides: tuple[float, float]) -> float:
    """How far a force swings back, over its largest value. The block's own extremes say it for nearly all hits; where they
    are far on both sides, an offset of the channel may be in them.
    """
    small, large = sorted(sides)
    if small > REBOUND * large and pulse.baseline:
        window = force.window(rate)
        x = force.samples - (pulse.baseline if window is None else pulse.baseline * window)
        small, large = sorted((abs(float(x.max())), abs(float(x.min()))))
    return small / large if large > 0 else 0.0


def _lasting(samples: FloatArray) -> float:
    largest = float(np.abs(samples).max())
    if largest == 0:
        return 0.0
    power = ((samples - samples.mean()) / largest) ** 2
    fourth = float(power @ power)
    return float(power.sum()) ** 2 / fourth if fourth > 0 else 0.0


def _top(x: FloatArray, high: IntArray, window: FloatArray | None, *, step: float, stop_band: float) -> Top:
    """Of one block, the window undone, and its samples that reach 97 % of the largest magnitude."""
    size = np.abs(x[high])
    level = float(size.max())
    slack: float | FloatArray = _EQUAL * level
    if window is not None:
        slack = np.minimum(np.maximum(slack, step / window[high]), 10 * _EQUAL * level)
    equal = high[size >= level - slack]
    lopsided = 0.0
    if equal.size == 2 and equal[1] == equal[0] + 1 and equal[0] > 0 and equal[1] + 1 < x.size and level > 0:
        lopsided = float(abs(abs(x[equal[0] - 1]) - abs(x[equal[1] + 1]))) / level
    return Top(level, int(equal.size), int(high.size), lopsided, stop_band)


def _about(block: Block, pulse: Pulse, rate: float) -> FloatArray:
    """Samples about the pulse, the window undone."""
    start = max(pulse.start - _STOP_LEAD, 0)
    cut = slice(start, start + _STOP_SAMPLES)
    part = np.asarray(block.samples[cut], dtype=float)
    window = block.window(rate)
    return part if window is None else part / np.maximum(window[cut], _WEAKEST)


def _stop_bands(parts: Sequence[FloatArray]) -> list[float]:
    """Root mean square of the spectrum above the filter's cut, of the samples about each pulse."""
    if len({part.size for part in parts}) > 1:  # a pulse at the end of its block has fewer behind it
        return [value for part in parts for value in _stop_bands([part])]
    table = np.array(parts)
    table = (table - table[:, :1]) * _taper(table.shape[1])
    high = np.fft.rfft(table)[:, int(np.ceil(_STOP_BAND * table.shape[1])) :]
    values: list[float] = np.sqrt(np.mean(high.real**2 + high.imag**2, axis=1)).tolist()
    return values


@lru_cache(maxsize=8)
def _taper(samples: int) -> FloatArray:
    """(n,) 1 over the lead and the first quarter, then a raised cosine down to 0."""
    ramp = np.clip((np.arange(samples) - samples / 4) / (0.75 * samples), 0, 1)
    weights: FloatArray = 0.5 + 0.5 * np.cos(np.pi * ramp)
    return weights


def _level(values: FloatArray) -> float:
    """Standard deviation about a straight line of (n,) values, smoothed over four samples: neither a drift nor the slow swing
    of a body on its cords is a body that rings.
    """
    outer, inner = _SMOOTHING
    smooth = outer * (values[3:] + values[:-3]) + inner * (values[2:-1] + values[1:-2])
    count = smooth.size
    rise = float(np.arange(count) @ smooth) - (count - 1) / 2 * float(smooth.sum())
    power = float(smooth @ smooth) - float(smooth.sum()) ** 2 / count - 12 * rise**2 / (count * (count**2 - 1))
    return float(np.sqrt(max(power, 0.0) / count))


def _before(blocks: Sequence[Block], pulses: Sequence[Pulse], sample_rate_hz: float) -> list[Before]:
    """What lies before the pulse in one response of several hits; the transforms of all are one call."""
    found, beside = [], np.zeros((2, len(blocks), 2 * _SPECTRUM))
    for row, (block, pulse) in enumerate(zip(blocks, pulses, strict=True)):
        reach = min(_FILTER_REACH + 2 * pulse.width, pulse.start // 2)
        part = np.asarray(block.samples[: max(pulse.start - reach, 0)], dtype=float)
        if part.size < 8:
            found.append((0.0, 0.0, 0))
            continue
        window = block.window(sample_rate_hz)
        if window is not None:
            part = part / window[: part.size]
        offset = float(part.sum()) / part.size
        found.append((offset, _level(part - offset), int(part.size)))
        end = part[-_SPECTRUM:]
        behind = slice(pulse.stop + _FILTER_REACH, pulse.stop + _FILTER_REACH + end.size)
        ringing = np.asarray(block.samples[behind], dtype=float)
        if window is not None:
            ringing = ringing / window[behind]
        for side, values in enumerate((end, ringing)):
            beside[side, row, : values.size] = values - float(values.sum()) / max(values.size, 1)
    powers = squared(np.fft.rfft(beside)[..., 1 : LINES + 1])
    return [
        Before(offset, level, samples, *(power / max(min(samples, _SPECTRUM), 1)).astype(np.float32))
        for (offset, level, samples), power in zip(found, powers.swapaxes(0, 1), strict=True)
    ]
