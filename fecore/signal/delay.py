"""Delay between the channels, estimated from the FRFs themselves.

A response that comes d seconds late has phase -ωd in its FRF, which a fit takes for damping. A
lightly and proportionally damped body has real modal constants, so at each resonance H = (iω)^k
R/(iω - p) + smooth, with R in phase ±90° but for the delay. At every clear peak the rational
function (a + b iω)/(iω - p) is fitted to a few lines by linear least squares; the residues' phases,
up to half turns, over all peaks give d: the maximum of Σ cos(2(φ + ω d)).
"""

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import FrfSet, convert
from fecore.normal import SD_OF_MAD

_NARROWEST, _WIDEST = 3, 100
_MOST_FRFS = 200  # that are asked; of more, every k-th: the delay is the same in all
_MOST_PEAKS = 50  # of one FRF that are looked at, the sharpest
_CLEAR = 10.0  # standard deviations of the FRF that a peak must have
_FEWEST_PEAKS = 6  # that the phase is read at
_LARGEST_S = 3e-4  # s, beyond which it is no delay between channels of one analyser
_GOOD_FIT = 0.03  # of the largest value, that a one-mode fit may miss


@dataclass(frozen=True)
class Delay:
    """How much later the response is than the force: `seconds` ± `sd`, from `peaks` resonances."""

    seconds: float
    sd: float
    peaks: int


class DelaySearch:
    """The delay common to FRFs that come in parts.

    Args:
        count: of all FRFs.
        rate_per_s: of the exponential window that they carry.
    """

    def __init__(self, count: int, rate_per_s: float = 0.0) -> None:
        self._every, self._rate, self._number = max(1, -(-count // _MOST_FRFS)), rate_per_s, 0
        self._omega: list[float] = []
        self._phase: list[float] = []

    def add(self, frfs: FrfSet) -> None:
        """The next FRFs."""
        power = int(np.round(np.angle(convert(np.ones(1), frfs.quantity))[0] / (np.pi / 2))) % 4
        for number in range(-self._number % self._every, len(frfs.values), self._every):
            values = frfs.values[number]
            noise = None if frfs.variance is None else np.sqrt(frfs.variance[number])
            for line, half in _peaks(np.abs(values), noise):
                fit = _residue(frfs.omega, values, line, half)
                if fit is not None:
                    pole, residue = fit
                    scaled = residue / (pole + self._rate) ** power * 2j
                    self._omega.append(abs(pole.imag))
                    self._phase.append(float(np.angle(scaled)))
        self._number += len(frfs.values)

    def estimate(self) -> Delay | None:
        """The delay, or None where they have too few clear resonances for it."""
        if len(self._omega) < _FEWEST_PEAKS:
            return None
        return _common(np.array(self._omega), np.array(self._phase))


def _common(w: FloatArray, p: FloatArray) -> Delay:
    """The delay that residues of these circular frequencies and phases have in common."""
    top = min(_LARGEST_S, 0.8 * np.pi / (2 * float(np.median(w))) * 2)
    grid = np.linspace(-top, top, 2001)
    score = np.cos(2 * (p + w * grid[:, None])).sum(axis=1)
    d = float(grid[int(np.argmax(score))])
    off = (np.angle(np.exp(2j * (p + w * d)))) / 2
    keep = np.abs(off) < 3 * max(float(np.median(np.abs(off))) * SD_OF_MAD, 1e-3)
    d -= float(np.sum(w[keep] * off[keep]) / np.sum(w[keep] ** 2))
    off = np.angle(np.exp(2j * (p[keep] + w[keep] * d))) / 2
    sd = float(np.sqrt(np.sum(off**2) / max(keep.sum() - 1, 1) / np.sum(w[keep] ** 2)))
    return Delay(d, sd, int(keep.sum()))


def _peaks(size: FloatArray, noise: FloatArray | None) -> list[tuple[int, int]]:
    """Line and half width, in lines, of the clear maxima: those that stand out of the scatter of
    hits, and fall to half on both sides before they rise again.
    """
    maxima = (size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])
    if noise is not None:
        maxima &= ~(size[1:-1] < _CLEAR * noise[1:-1])  # of a single hit the scatter is not known
    lines = np.flatnonzero(maxima) + 1
    if lines.size > _MOST_PEAKS:
        sharp = size[lines] / scipy.ndimage.uniform_filter1d(size, _WIDEST)[lines]
        lines = np.sort(lines[np.argsort(-sharp, kind="stable")[:_MOST_PEAKS]])
    peaks = []
    for line in lines:
        low = size[max(line - _WIDEST, 0) : line][::-1] < size[line] / 2
        high = size[line + 1 : line + 1 + _WIDEST] < size[line] / 2
        if not (low.any() and high.any()):
            continue
        half = max(int(np.argmax(low)), int(np.argmax(high)), _NARROWEST - 1) + 1
        if (
            half <= line < size.size - half
            and size[line] == size[line - half : line + half + 1].max()
        ):
            peaks.append((int(line), half))
    return peaks


def _residue(
    omega: FloatArray, values: ComplexArray, line: int, half: int
) -> tuple[complex, complex] | None:
    """Pole and residue of (a + b iω)/(iω - p) about a line; None where it does not fit."""
    cut = slice(line - half, line + half + 1)
    centre = omega[line]
    s, h = 1j * (omega[cut] - centre), values[cut]
    matrix = np.column_stack((h, np.ones_like(s), s))
    (pole, a, b), *_ = np.linalg.lstsq(matrix, s * h, rcond=None)
    with np.errstate(divide="ignore", invalid="ignore"):
        fitted = (a + b * s) / (s - pole)
    if (
        not np.all(np.isfinite(fitted))
        or np.abs(fitted - h).max() > _GOOD_FIT * np.abs(h).max()
        or pole.real >= 0
    ):
        return None
    return complex(pole + 1j * centre), complex(a + b * pole)
