"""Numbers of a hit that its judgement needs, each from its own blocks alone; they take its place
once its samples are gone.

| name | what it is |
|---|---|
| lost | 1 where the block holds no pulse above its noise, or not its beginning, or most of the response is lost; else 0 |
| second | largest other pulse of the force over the first, where it stands out of its noise |
| swing | the force's largest value against the sign of its pulse, over the pulse |
| turned | 1 where the pulse points down; `judgement` makes it 1 where it points the other way than most |
| flat | (n - 1)(n/m - 0.3), n samples within 0.03 % of a channel's largest value, m within 3 %: a round top has n/m = 0.1 |
| beyond | part of a channel above the anti-alias filter's cut about the pulse and the noise, over its largest value |
| height | peak force, N |
| early | root mean square of the response before the pulse over its largest value; `judgement` takes it over the floor |
| jump | largest third difference of the response in 64 samples over their mean: a spark, a loose cable, a cut record |
| floor | mean step from sample to sample over the largest value, in the quietest part of the response |

Of several channels the one that objects most speaks: the smallest `floor`, the largest of all else.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from fecore.arrays import FloatArray
from fecore.frf import Dof
from fecore.signal.blocks import MEAN_TO_SD, Block, Hit
from fecore.signal.pulse import REACH, Pulse, find_pulse, ringing

OWN = ("lost", "second", "swing", "turned", "flat", "beyond", "height", "early", "jump", "floor")
"""The names of the numbers, in their order."""

_CLEAR = 8.0  # standard deviations of the noise that a pulse, and a second one, must reach
_STOP_BAND = 0.475  # of the sampling rate: above it every anti-alias filter cuts
_FEWEST = 16  # samples before the pulse that say something
_ABOUT = 256  # samples about the pulse, and on either side of it, whose spectra are taken


@dataclass(frozen=True)
class HitFeatures:
    """Numbers of one hit."""

    number: int  # which hit of its point it is
    force: Dof  # where it was hit
    pulse: Pulse  # the hammer's pulse
    # of each response, its mean before the pulse, as it was before the analyser's window
    offsets: tuple[float, ...]
    # the numbers of `OWN`; NaN where the blocks do not show one
    own: FloatArray = field(compare=False)
    cut: str  # the channel whose top speaks most for an overload
    # largest share of its stated full scale that a channel reaches, and which; 0 where none is
    # stated
    overload: tuple[float, str]
    samples: int  # length of the blocks
    sample_rate_hz: float  # samples a second

    @property
    def clear(self) -> bool:
        """Whether the force holds a pulse above its noise."""
        return abs(self.pulse.height) > _CLEAR * self.pulse.noise

    @property
    def second_s(self) -> float:
        """How long after the first pulse the second one comes, s."""
        return (self.pulse.second_at - self.pulse.peak) / self.sample_rate_hz


def find_features(hits: Sequence[Hit]) -> tuple[HitFeatures, ...]:
    """The numbers of hits, in their order."""
    return tuple(_features(hit) for hit in hits)


@dataclass(frozen=True)
class _Channel:
    """Numbers of one channel, and the mean of a response before the pulse."""

    name: str
    share: float
    flat: float
    beyond: float
    floor: float
    early: float = np.nan
    jump: float = np.nan
    offset: float = 0.0


def _features(hit: Hit) -> HitFeatures:
    rate, pulse = hit.sample_rate_hz, find_pulse(hit.force, hit.sample_rate_hz)
    channels = [_channel(block, pulse, rate) for block in (hit.force, *hit.responses)]
    responses = channels[1:]
    height = max(abs(pulse.height), 1e-300)
    lost = pulse.peak > 0.5 * hit.samples or pulse.start < max(0.1 * pulse.width, 2.0)
    own = {
        "lost": float(lost or abs(pulse.height) <= _CLEAR * pulse.noise),
        "second": pulse.second if pulse.second_z > _CLEAR else 0.0,
        "swing": _swing(hit.force, pulse, rate) / height,
        "turned": float(pulse.height < 0),
        "flat": max(channel.flat for channel in channels),
        "beyond": max(channel.beyond for channel in channels),
        "height": height,
        "early": max(channel.early for channel in responses),
        "jump": max(channel.jump for channel in responses),
        "floor": min(channel.floor for channel in responses),
    }
    fullest = max(channels, key=lambda channel: channel.share)
    return HitFeatures(
        number=hit.number,
        force=hit.force.dof,
        pulse=pulse,
        offsets=tuple(channel.offset for channel in responses),
        own=np.array([own[name] for name in OWN]),
        cut=max(channels, key=lambda channel: (channel.flat, channel.beyond)).name,
        overload=(fullest.share, fullest.name),
        samples=hit.samples,
        sample_rate_hz=rate,
    )


def _channel(block: Block, pulse: Pulse, rate: float) -> _Channel:
    x = block.undone(rate)
    level, floor = max(float(x.max()), -float(x.min()), 1e-300), _floor(x[: block.shown(rate)])
    of_all = (
        level / block.full_scale if block.full_scale else 0.0,
        _flat(x, level),
        _beyond(x, pulse, floor) / level,
    )
    if block.quantity == "force":
        return _Channel("force", *of_all, floor / level)
    lead = _lead(x, pulse)
    offset = float(lead.mean()) if lead.size >= _FEWEST else 0.0
    name = f"{block.quantity} at point {block.dof.point}"
    return _Channel(name, *of_all, floor / level, _before(lead, level), _jump(x, pulse), offset)


def _lead(samples: FloatArray, pulse: Pulse) -> FloatArray:
    """Samples before the pulse and the ringing of the filter."""
    return samples[: max(pulse.start - min(REACH + 2 * pulse.width, pulse.start // 2), 0)]


def _swing(force: Block, pulse: Pulse, rate: float) -> float:
    """Largest force against the sign of the pulse, where the analyser's window leaves an offset
    what it was.
    """
    x = (force.undone(rate)[: force.shown(rate)] - pulse.baseline) * np.sign(pulse.height)
    return max(-float(x.min()), 0.0)


def _flat(x: FloatArray, level: float) -> float:
    size = np.abs(x)
    equal, near = (int(np.count_nonzero(size >= share * level)) for share in (1 - 3e-4, 0.97))
    return (equal - 1) * max(equal / max(near, 1) - 0.3, 0.0)


def _beyond(x: FloatArray, pulse: Pulse, floor: float) -> float:
    """Root mean square of the spectrum above the filter's cut about the pulse, the size of a sample
    with that spectrum, beyond twice what the noise has.
    """
    start = max(pulse.start - _ABOUT // 8, 0)
    part = x[start : start + _ABOUT]
    taper = _taper(part.size)
    high = np.fft.rfft((part - part[0]) * taper)[int(np.ceil(_STOP_BAND * part.size)) :]
    power = float(np.mean(high.real**2 + high.imag**2)) - (2 * MEAN_TO_SD * floor) ** 2 * float(
        taper @ taper
    )
    return float(np.sqrt(max(power, 0.0)))


@lru_cache(maxsize=8)
def _taper(samples: int) -> FloatArray:
    """(n,) 1 over the lead and the first quarter, then a raised cosine down to 0."""
    ramp = np.clip((np.arange(samples) - samples / 4) / (0.75 * samples), 0, 1)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * ramp))


def _before(lead: FloatArray, level: float) -> float:
    """`early`; NaN where too little lies before the pulse. A drift is no body that rings: the
    straight line is taken out.
    """
    before = lead[-_ABOUT:]
    if before.size < _FEWEST:
        return np.nan
    rise = np.linspace(-1, 1, before.size)
    before = before - before.mean() - rise * float(rise @ before) / float(rise @ rise)
    taper = np.hanning(before.size)
    loudest = float(np.abs(np.fft.rfft(before * taper)).max())
    return loudest / float(np.sqrt(taper @ taper * np.log(before.size / 2))) / level


def _jump(x: FloatArray, pulse: Pulse) -> float:
    third = np.abs(np.diff(x, 3))
    parts = third[: third.size // REACH * REACH].reshape(-1, REACH)
    if not len(parts) or third.max() == 0:
        return 1.0
    guard = ringing(pulse.start, pulse.stop) + REACH
    number = np.arange(len(parts)) * REACH
    outside = (number + REACH < pulse.start - guard) | (number > pulse.stop + guard)
    if not outside.any():
        return 1.0
    return float((parts.max(axis=1) / (parts.mean(axis=1) + 0.01 * third.max()))[outside].max())


def _floor(x: FloatArray) -> float:
    steps = np.abs(np.diff(x))
    size = max(steps.size // 32, 16)
    count = steps.size // size
    return float(steps[: count * size].reshape(count, size).mean(axis=1).min())
