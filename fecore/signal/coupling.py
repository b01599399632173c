"""The tail that an AC coupled force channel puts behind the pulse.

An ICP hammer passes no steady force: behind a pulse of impulse J = ∫ F dt its channel swings below
zero and returns,

    F_tail(t) = -A J exp(-c t),      A = c = 2π f_c for one coupling of corner f_c,

with A the sum of the corners where analyser and hammer have one each. The sensor on the body does
the same to the response, so the ratio of the spectra is the FRF only where the force keeps its
tail. A force window that sets all behind the pulse to zero takes the tail away: the FRF is then
multiplied by 1 - A/(iω + c), a phase of 18 mrad at 28 Hz for f_c = 0.5 Hz, which a fit of damping
takes up. So the tail of all hits together is fitted, A and c by least squares over the blocks with
an offset of its own for each, and stands in place of the noise behind the window.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.normal import SD_OF_MAD
from fecore.signal.blocks import Hit
from fecore.signal.hit_features import HitFeatures
from fecore.signal.pulse import SMALLEST_SECOND, Pulse, ringing

_CORNERS_HZ = np.geomspace(0.02, 10.0, 55)  # that are tried
_PART = 32  # samples that are averaged before the fit: a tail is slow
_FEWEST_PARTS = 16  # below which a block is too short to show a tail
_CLEAR = 4.0  # standard deviations that A must differ from zero by
_CLEAR_PULSE = 20.0  # standard deviations of the noise that a pulse must reach to be asked


@dataclass(frozen=True)
class Coupling:
    """The tail of a unit impulse, -amplitude exp(-rate t): both in 1/s."""

    amplitude_per_s: float
    rate_per_s: float


def impulse(hit: Hit, pulse: Pulse) -> float:
    """∫ F dt over the pulse, N s, the analyser's window undone."""
    beside = ringing(pulse.start, pulse.stop)
    cut = slice(max(pulse.start - beside, 0), pulse.stop + beside)
    part = np.asarray(hit.force.samples[cut], dtype=float)
    window = hit.force.window(hit.sample_rate_hz)
    if window is not None:
        part = part / window[cut]
    return float((part - pulse.baseline).sum()) / hit.sample_rate_hz


def find_coupling(sample: Sequence[tuple[Hit, HitFeatures]]) -> Coupling | None:
    """The tail that these hits have in common; None where it does not stand out of their
    scatter.
    """
    parts = [part for hit, features in sample if (part := _parts(hit, features.pulse)) is not None]
    if len(parts) < 2:
        return None
    best: tuple[float, FloatArray, float] | None = None
    for rate in 2 * np.pi * _CORNERS_HZ:
        fits = [_fit(values, weight, time, rate) for values, weight, time in parts]
        gained = sum(gain for _, gain in fits)
        if best is None or gained > best[0]:
            best = gained, np.array([amplitude for amplitude, _ in fits]), float(rate)
    assert best is not None, "there are corners"
    _, amplitudes, rate = best
    middle = float(np.median(amplitudes))
    spread = SD_OF_MAD * float(np.median(np.abs(amplitudes - middle))) / np.sqrt(amplitudes.size)
    return Coupling(middle, rate) if middle > _CLEAR * spread else None


def _parts(hit: Hit, pulse: Pulse) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Means of the force over its impulse, their weights, and times since the peak (negative before
    the pulse).
    """
    second = pulse.second > 2 * SMALLEST_SECOND and pulse.second_z > 8
    if abs(pulse.height) < _CLEAR_PULSE * pulse.noise or second or pulse.start < pulse.width:
        return None
    size = hit.samples // _PART * _PART
    window = hit.force.window(hit.sample_rate_hz)
    weight = np.ones(size) if window is None else window[:size]
    time = (np.arange(size) - pulse.peak) / hit.sample_rate_hz
    values = np.asarray(hit.force.samples[:size], dtype=float)
    beside = ringing(pulse.start, pulse.stop)
    outside = (np.arange(size) < pulse.start - beside) | (np.arange(size) >= pulse.stop + beside)
    whole = outside.reshape(-1, _PART).all(axis=1)
    if whole.sum() < _FEWEST_PARTS:
        return None
    mean = [x.reshape(-1, _PART).mean(axis=1)[whole] for x in (values, weight, time)]
    return mean[0] / impulse(hit, pulse), mean[1], mean[2]


def _fit(
    values: FloatArray, weight: FloatArray, time: FloatArray, rate: float
) -> tuple[float, float]:
    """A of one hit at a given rate with an offset of its own, and what it takes off the sum of
    squares.
    """
    shape = np.where(time > 0, -np.exp(-rate * np.maximum(time, 0)), 0.0) * weight
    level = weight @ weight
    own = shape - weight * (weight @ shape) / level
    power = float(own @ own)
    amplitude = float(own @ values) / power if power > 0 else 0.0
    return amplitude, amplitude**2 * power
