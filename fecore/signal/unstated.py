"""An exponential window that an analyser has applied and nobody stated, seen where the noise decays
with it.

Behind its pulse the force channel holds noise alone. The mean square of the steps from sample to
sample, which hum and drift hardly reach, is taken in equal parts of a block. White noise of
standard deviation s under exp(-r t), behind which a converter has steps q, has steps of

    p(t) = 2 (s² exp(-2 r t) + q²/12),    ln √(p/2 - q²/12) = ln s - r t

(Widrow and Kollár, Quantization Noise, 2008), as long as s exp(-r t) > q/2. Below, p depends on
where between two steps the mean lies; that far the parts reach. q is the smallest gap between two
values. Where the window came behind the converter, as in floating point, no two values are a step
apart, q is nil, and the noise of the steps decays with all else.

r is the mean of the hits' slopes, without those of double hits and the like that lie far from their
median. It counts where it stands out of their scatter, and where the logarithm bends far less than
it falls: what else rings in a hammer dies away into a floor, and a window has none but the
converter's. Noise that does not fall shows that there is no window, as surely as its slopes agree.
Noise below half a step from the first makes single steps of the converter: they decay with a window
that came behind it. Where they stay, p shows at most that there is none: how its slopes scatter is
what drift across the steps makes, in all hits alike, and they may be half of r.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.findings import Finding
from fecore.normal import SD_OF_MAD
from fecore.signal.blocks import FEWEST_SAMPLES, Hit, smallest_step
from fecore.signal.findings import finding
from fecore.signal.pulse import REACH, find_pulse, ringing
from fecore.signal.spectra import Source

_PARTS = 12  # of a block's noise
# of a block, in which it is seen how far the noise stands above the converter's steps
_FINE_PARTS = 48
_FEWEST_HITS = 4  # whose scatter says what stands out of it
_NEAR = 2.5  # standard deviations about the median, up to which a slope is no outlier
_TRIMMED = 0.955  # standard deviation of a normal variable up to there
_LOOKED_AT = 72  # hits, spread over the points
_CERTAIN = 5.0  # standard deviations that the rate is above none
_BENT = 0.25  # of the fall, that ln s may bend over the block
_STILL = 0.1  # of their root mean square, below which a step is none
# share of such steps where white noise is half a step of the converter: E max(1 - √2 |g|/2, 0)
_HIDDEN = 0.486


@dataclass(frozen=True)
class SeenRate:
    """Rate of an exponential window, 0 for none, and its standard deviation, 1/s; None where the
    noise does not show it.
    """

    rate_per_s: float
    sd: float | None

    @property
    def finding(self) -> Finding:
        """What a user should know of a rate that was seen."""
        return finding("window_seen", rate=self.rate_per_s, sd=self.sd)


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
                responses=tuple(
                    replace(block, window_rate_per_s=self.rate) for block in hit.responses
                ),
            )
            for hit in self.source[point]
        ]


def with_unstated_window(source: Source) -> tuple[Source, SeenRate | None]:
    """The same hits with the window that their noise shows, and which; hits that state one as they
    are, and None.
    """
    step = max(1, -(-len(source) // _LOOKED_AT))
    sample = [
        hit
        for number in range(0, len(source), step)
        for hit in source[number][: max(_LOOKED_AT // len(source), 1)]
    ]
    # others are refused where they are read
    alike = len({(hit.samples, hit.sample_rate_hz) for hit in sample}) == 1
    if not alike or any(
        block.window_rate_per_s for hit in sample for block in (hit.force, *hit.responses)
    ):
        return source, None
    seen = seen_rate(sample)
    return (UnderWindow(source, seen.rate_per_s) if seen.rate_per_s else source), seen


def seen_rate(hits: Sequence[Hit]) -> SeenRate:
    """The rate by which the noise of the hits' force decays."""
    noises, rate_hz = [_noise(hit) for hit in hits], hits[0].sample_rate_hz
    start, end, last = (
        int(np.median([noise.start for noise in noises])),
        _shown(noises),
        hits[0].samples - 1,
    )
    if end - start >= _PARTS * FEWEST_SAMPLES:
        return _seen(
            [_decay(noise, end, rate_hz, _power) for noise in noises], end - start, rate_hz
        )
    seen = _seen([_decay(noise, last, rate_hz, _step) for noise in noises], last - start, rate_hz)
    if seen.rate_per_s:
        return seen
    near = _near([_decay(noise, last, rate_hz, _steps_power) for noise in noises])
    most = 2 * float(np.hypot(near[:, 0].mean(), near[:, 0].std(ddof=1))) if len(near) else np.inf
    return SeenRate(0.0, most if most < rate_hz / (last - start) else None)


def _near(rows: Sequence[tuple[float, float, float] | None]) -> FloatArray:
    """(n, 3) the hits' numbers without those that lie far from their median; none where they are
    too few.
    """
    located = np.array([row for row in rows if row is not None])
    if len(located) < _FEWEST_HITS:
        return np.empty((0, 3))
    off = np.abs(located - np.median(located, axis=0))
    near = located[(off <= _NEAR * SD_OF_MAD * np.median(off, axis=0))[:, :2].all(axis=1)]
    return near if len(near) >= _FEWEST_HITS else np.empty((0, 3))


def _seen(
    rows: Sequence[tuple[float, float, float] | None], samples: int, sample_rate_hz: float
) -> SeenRate:
    """What the decay of each hit over so many samples says together."""
    near, length = _near(rows), samples / sample_rate_hz
    if not len(near):
        return SeenRate(0.0, None)
    rate, bend, doubt = (float(x) for x in near.mean(axis=0))
    # what white noise leaves open, of a few hits too
    least = np.sqrt(6 / samples) * np.array([1 / length, 1.0])
    sd, bend_sd = (
        float(x) for x in np.maximum(near[:, :2].std(axis=0), least) / np.sqrt(len(near))
    )
    # that of Student's t is larger than 1
    sd = float(np.hypot(sd / (_TRIMMED * np.sqrt(1 - 3 / len(near))), doubt))
    if rate < _CERTAIN * sd:
        return SeenRate(0.0, float(np.hypot(rate, sd)))
    if abs(bend) > _BENT * rate * length + _CERTAIN * bend_sd:
        return SeenRate(0.0, None)
    return SeenRate(rate, sd)


@dataclass(frozen=True)
class _Noise:
    """The force of a hit behind its pulse."""

    hit: Hit
    start: int  # of the steps from sample to sample, from which on there is noise alone
    gap: float  # smallest one between two of the values there

    @property
    def steps(self) -> FloatArray:
        """(n - 1,) sizes of the steps from sample to sample of the whole block; not kept, as hits
        may be many.
        """
        return np.abs(np.diff(self.hit.force.samples.astype(float)))


def _noise(hit: Hit) -> _Noise:
    pulse = find_pulse(hit.force, hit.sample_rate_hz)
    start = pulse.stop + ringing(pulse.start, pulse.stop) + REACH
    behind = hit.force.samples[start:].astype(float)
    return _Noise(hit, start, smallest_step(behind) if behind.size else 0.0)


def _shown(noises: Sequence[_Noise]) -> int:
    """Steps of a block up to which the noise of most hits is at least half a step of the
    converter.
    """
    whole = noises[0].hit.samples - 1
    size = whole // _FINE_PARTS
    quiet = np.full((len(noises), _FINE_PARTS), np.nan)
    for row, noise in zip(quiet, noises, strict=True):
        parts = noise.steps[: _FINE_PARTS * size].reshape(_FINE_PARTS, size)
        first = -(-noise.start // size)
        none = parts <= _STILL * np.sqrt((parts**2).mean(axis=1, keepdims=True))
        row[first:] = none.mean(axis=1)[first:]
    most = np.array(
        [np.median(own) if (own := column[np.isfinite(column)]).size else 0.0 for column in quiet.T]
    )
    hidden = np.flatnonzero(most > _HIDDEN)
    return int(hidden[0]) * size if hidden.size else whole


def _decay(
    noise: _Noise,
    end: int,
    sample_rate_hz: float,
    measure: Callable[[FloatArray, float], FloatArray],
) -> tuple[float, float, float] | None:
    """-d(ln s)/dt, 1/s; how far ln s bends from the middle of the noise to its ends; and by how
    much the first may be off where the mean stays at one place between two steps; None where there
    is no noise.

    Args:
        noise: of a hit.
        end: of its steps, up to which it is looked at.
        sample_rate_hz: of the block.
        measure: makes s² of (parts, n) steps and the converter's own.
    """
    steps = noise.steps[noise.start : end]
    size = steps.size // _PARTS
    if size < FEWEST_SAMPLES:
        return None
    power = measure(steps[: size * _PARTS].reshape(_PARTS, size), noise.gap)
    if not power.min() > 0:
        return None
    time = np.linspace(-1, 1, _PARTS)
    bend, slope, _ = np.polyfit(time, np.log(power) / 2, 2)
    half_s = 0.5 * (_PARTS - 1) * size / sample_rate_hz
    doubt = float(time @ _off(power, noise.gap)) / float(time @ time)
    return -float(slope) / half_s, float(bend), doubt / half_s


def _power(steps: FloatArray, gap: float) -> FloatArray:
    """Of white noise that makes such steps behind a converter."""
    return _steps_power(steps, gap) - gap**2 / 12


def _steps_power(steps: FloatArray, _: float) -> FloatArray:
    """Of white noise that makes such steps."""
    return np.asarray((steps**2).mean(axis=1) / 2)


def _step(steps: FloatArray, _: float) -> FloatArray:
    """Square of the converter's step, which most of those are that are not nil."""
    least = 0.5 * np.sqrt((steps**2).mean(axis=1))
    moved = (own[own > low] for own, low in zip(steps, least, strict=True))
    return np.array([np.median(own) ** 2 if own.size else 0.0 for own in moved])


def _off(power: FloatArray, gap: float) -> FloatArray:
    """By how much ln s is off where the mean lies at one place between two steps, root mean square
    over the places: the first harmonic of the error of white noise of that power under such steps.
    """
    square = np.maximum(power / max(gap, 1e-300) ** 2, 0.25)
    return np.asarray(
        np.exp(-2 * np.pi**2 * square) * (4 * square + 1 / np.pi**2) / (2 * square) / np.sqrt(2)
    )
