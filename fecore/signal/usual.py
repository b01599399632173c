"""What the hits of a campaign are usually like, and how far they reach by themselves.

A number of good hits scatters, in some campaigns by tenths and in others by decades: hits that follow one another after
different rests, drift, or hum of which a short lead shows another phase each time. So beside the usual value stands the reach

    q₃ (q₃/q₁)^(2.5/1.35),    q₃ = min(q₇₅, q₅₀²/q₂₅),    q₁ = q₂₅,

which one of a thousand log-normal values exceeds: ln(q₃/q₁) is 1.35 standard deviations, and q₇₅ + 2.5 standard deviations is
3.2. The upper quartile is no higher than the lower half says, so that up to half of the hits may be faulty.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from fecore.arrays import FloatArray
from fecore.frf import Dof
from fecore.signal.traits import Top, Traits

_MOST_LINED = 256  # hits that say what the lines before the pulse usually have; of more, every k-th
_FLOOR = 10  # one in so many hits, the quietest, has at most the channel's own noise above the filter's cut
_BEYOND = 2.5  # standard deviations of the logarithm above the upper quartile
_BETWEEN = 1.349  # standard deviations between the quartiles


@dataclass(frozen=True)
class Ordinary:
    """Of one number: its usual value, and up to where good hits come by their own scatter."""

    level: float
    reach: float


@dataclass(frozen=True)
class StopBand:
    """What a channel has above the filter's cut: over its level, and in the quietest hits at least."""

    share: Ordinary
    least: float


@dataclass(frozen=True)
class Lines:
    """(k,) usual power of the lines before the pulse, and how far the loudest line of a hit comes over it."""

    power: FloatArray
    reach: float


@dataclass(frozen=True)
class Usual:
    """What the hits of a campaign are usually like.

    Attributes:
        peak: median magnitude of the peak force, N; None for a hit alone.
        before: level before the pulse of the quiet hits, by response dof.
        stop_band: by response dof, and of the force under None.
        polarity: sign of most pulses.
        lines: before the pulse, of the response dofs that `before` has.
    """

    peak: float | None
    before: Mapping[Dof, Ordinary]
    stop_band: Mapping[Dof | None, StopBand] = field(default_factory=dict)
    polarity: int = 1
    lines: Mapping[Dof, Lines] = field(default_factory=dict)


def usual(found: Sequence[Traits], *, before: bool = True) -> Usual:
    """What hits are usually like, from all of them: medians, so that up to half may be faulty. `before` is whether what lies
    before the pulse is asked for.
    """
    if len(found) < 3:
        return Usual(None, {})
    clear = [t for t in found if abs(t.pulse.height) > 20 * t.pulse.noise]
    levels: dict[Dof, list[float]] = {}
    for traits in found if before else ():
        for dof, own in zip(traits.responses, traits.before, strict=True):
            if own.samples:
                levels.setdefault(dof, []).append(own.level)
    quiet = {
        d: Ordinary(median(sorted(v)[: (len(v) + 1) // 2 + 1]), reach(np.array(v)))
        for d, v in levels.items()
        if len(v) >= 3
    }
    lines = {dof: _usual_lines(found, dof) for dof in quiet}
    if not clear:
        return Usual(None, quiet, lines=lines)
    heights = [t.pulse.height for t in clear]
    upward = sum(h > 0 for h in heights)
    return Usual(median(map(abs, heights)), quiet, _stop_bands(clear), 1 if 2 * upward >= len(heights) else -1, lines)


def reach(values: FloatArray) -> float:
    """How far (n,) positive values come by their own scatter, see the module; 0 where a quarter of them is 0."""
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
    if low <= 0:
        return 0.0
    high = min(high, middle**2 / low)
    return float(high * (high / low) ** (_BEYOND / _BETWEEN))


def _stop_bands(found: Sequence[Traits]) -> dict[Dof | None, StopBand]:
    """Of each channel that three hits or more have, none of them without a signal."""
    channels: dict[Dof | None, list[Top]] = {}
    for traits in found:
        for channel, top in zip((None, *traits.responses), traits.tops, strict=True):
            channels.setdefault(channel, []).append(top)
    return {
        channel: _stop_band(tops)
        for channel, tops in channels.items()
        if len(tops) >= 3 and all(top.level > 0 for top in tops)
    }


def _stop_band(tops: Sequence[Top]) -> StopBand:
    beyond = np.array([top.stop_band for top in tops])
    share = beyond / np.array([top.level for top in tops])
    return StopBand(Ordinary(float(np.median(share)), reach(share)), float(np.sort(beyond)[len(beyond) // _FLOOR]))


def _usual_lines(found: Sequence[Traits], dof: Dof) -> Lines:
    """Mean power of each line before the pulse, from its median over the hits, which is ln 2 of it for noise; no line is
    held to be quieter than the median of all, since a few hits say little of a line of its own.
    """
    powers = [
        before.lines
        for traits in found
        for own, before in zip(traits.responses, traits.before, strict=True)
        if own == dof and before.samples
    ]
    sample = np.array(powers[:: -(-len(powers) // _MOST_LINED)])
    middle = np.median(sample, axis=0) / np.log(2)
    floored: FloatArray = np.maximum(middle, np.median(middle))
    return Lines(floored, reach((sample / floored).max(axis=1)) if floored.min() > 0 else 0.0)
