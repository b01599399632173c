"""FRFs, coherence and variance from the spectra of several hits.

With F_i and A_i the spectra of force and response of hit i, S_ff = Σ|F_i|², S_aa = Σ|A_i|², S_af =
Σ A_i F_i*:

    H1 = S_af/S_ff           least squares with noise in the response alone,
    H2 = S_aa/S_af*          with noise in the force alone,
    Hv                       total least squares: the eigenvector of the 2 × 2 matrix for its smallest eigenvalue, with
    the channels
                             scaled to equal power,
    γ² = |S_af|²/(S_ff S_aa).

The hits of a point differ mostly by where they land, not by noise, so each counts alike however
strong it was: both spectra of a hit are divided by the root mean square of its force over the lines
before they are summed.

Variance. Hit i says H_i = A_i/F_i with weight w_i = |F_i|²/S_ff; the estimate is their weighted
mean, and its variance is that of the scatter seen, for weights that differ (the "HC2" sandwich,
unbiased where all hits scatter alike):

    s² = Σ w_i² |H_i - H|² / (1 - w_i).

With n hits it rests on about n - 1 complex degrees of freedom, so one line alone may be wrong by a
factor of several. A line's variance is therefore drawn towards the mean over its neighbourhood and
over the campaign's FRFs, by the weight of `_PRIOR` degrees of freedom; the mean over lines stays
what was seen. One hit alone has no scatter: its variance is not known (NaN).

Growth. Where a body is linear, hits of all heights show one H. With x_i the logarithm of the root mean
square of the force, less its mean over the hits, over its standard deviation,

    ΔH = Σ x_i w_i (H_i - H)

is what H changes by in hits harder by one standard deviation; of noise alone its variance is that of
H. One spectrum shows a mode whose frequency falls with the hit, a distortion that grows with it, and
interference that the hits do not share.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError

Estimator = Literal["H1", "H2", "Hv"]

_PRIOR = 4.0  # degrees of freedom that the expected variance of a line is worth
_ALIKE = 1e-3  # differences of ln of the heights of hits below which they show no growth
_NEIGHBOURS = 9  # lines, over which a variance is averaged
# lines that are worked on together: what one hit needs of them stays in a processor's cache
_AT_ONCE = 8192


@dataclass(frozen=True)
class Estimate:
    """One FRF."""

    values: ComplexArray  # (L,) complex FRF
    coherence: FloatArray  # (L,) γ², 0 to 1
    variance: FloatArray  # (L,) variance E|n|² of each value; NaN for a single hit
    # (L,) what a value grows by where a hit is harder by the scatter (1 sd of ln) of the hits; NaN
    # where they are alike, or one
    growth: ComplexArray
    hits: int  # how many hits it is the mean of


def check_estimator(name: str) -> None:
    """Refuse an unknown estimator.

    Raises:
        InputError: it is not one of H1, H2, Hv.
    """
    if name not in get_args(Estimator):
        raise InputError(
            "estimator", f"is {name!r}, expected one of {', '.join(get_args(Estimator))}"
        )


def estimate(
    forces: ComplexArray, responses: ComplexArray, estimator: Estimator = "H1"
) -> Estimate:
    """The FRF of (h, L) force and (h, L) response spectra of the hits of one point."""
    check_estimator(estimator)
    level = np.array([float(np.vdot(force, force).real) for force in forces]) / forces.shape[1]
    share = 1 / np.where(level > 0, level, 1.0)  # of each hit's spectra, squared
    height = np.log(np.maximum(level, np.finfo(float).tiny))
    height -= height.mean()
    height /= np.sqrt(np.mean(height**2)) if np.abs(height).max() > _ALIKE else np.nan
    parts = [
        _lines(
            forces[:, start : start + _AT_ONCE],
            responses[:, start : start + _AT_ONCE],
            share,
            height,
            estimator,
        )
        for start in range(0, forces.shape[1], _AT_ONCE)
    ]
    values, coherence, variance, growth = map(np.concatenate, zip(*parts, strict=True))
    if len(forces) > 1:
        variance = pooled(values, variance, len(forces))
    return Estimate(values, coherence, variance, growth.astype(np.complex64), len(forces))


def _lines(
    forces: ComplexArray,
    responses: ComplexArray,
    share: FloatArray,
    height: FloatArray,
    estimator: Estimator,
) -> tuple[ComplexArray, FloatArray, FloatArray, ComplexArray]:
    """FRF, coherence, variance and growth of some lines, each line by itself; `share` (h,) is what a
    hit's power is multiplied by, `height` (h,) its x.

    Hit by hit, so that what is worked on stays in a processor's cache: several times as fast as all
    hits at once.
    """
    lines = forces.shape[1]
    power, ff, aa = np.empty(forces.shape), np.zeros(lines), np.zeros(lines)
    af, one, parts, level = (
        np.zeros(lines, complex),
        np.empty(lines, complex),
        np.empty(2 * lines),
        np.empty(lines),
    )
    for force, response, own, weight in zip(forces, responses, share.tolist(), power, strict=True):
        ff += np.multiply(squared(force, parts, weight), own, out=weight)
        aa += np.multiply(squared(response, parts, level), own, out=level)
        np.conj(force, out=one)
        one *= response
        one.view(float)[:] *= own  # a product of complex numbers would cost four times as much
        af += one
    with np.errstate(divide="ignore", invalid="ignore"):
        values = _ESTIMATORS[estimator](ff, aa, af)
        coherence = squared(af, parts, np.empty(lines)) / (ff * aa)
    values[~np.isfinite(values)] = 0
    coherence[~np.isfinite(coherence)] = 0
    np.minimum(coherence, 1, out=coherence)
    if len(forces) < 2:
        return values, coherence, np.full(lines, np.nan), np.full(lines, np.nan, dtype=complex)
    inverse, variance, growth = 1 / np.maximum(ff, 1e-300), np.zeros(lines), np.zeros_like(af)
    each = zip(forces, responses, share.tolist(), height.tolist(), power, strict=True)
    for force, response, own, x, weight in each:
        np.subtract(response, np.multiply(values, force, out=one), out=one)
        squared(one, parts, level)
        one *= np.conj(force, out=af)
        one.view(float)[:] *= own * x
        growth += one
        level *= np.multiply(weight, inverse, out=weight)
        np.subtract(1, np.minimum(weight, 0.999, out=weight), out=weight)
        level /= weight
        level *= own
        variance += level
    variance *= inverse
    growth *= inverse
    return values, coherence, variance, growth


def squared(
    values: ComplexArray, parts: FloatArray | None = None, into: FloatArray | None = None
) -> FloatArray:
    """|z|² of (..., L) values that lie side by side, without the root that `abs` takes.

    Args:
        values: complex.
        parts: (..., 2 L) room for the squares of their parts; new by default.
        into: (..., L) room for the result; new by default.
    """
    flat = values.view(float)
    parts = np.multiply(flat, flat, out=parts)
    return np.add(parts[..., ::2], parts[..., 1::2], out=into)


def pooled(values: ComplexArray, variance: FloatArray, hits: int) -> FloatArray:
    """The variance of each line drawn towards that of its neighbours, relative to |H|²; the sum
    over a neighbourhood stays.
    """
    if variance.size < _NEIGHBOURS:
        return variance
    kernel = np.ones(_NEIGHBOURS) / _NEIGHBOURS
    power = squared(values)
    level = _smooth(power, kernel)
    near = _smooth(variance, kernel)
    shape = np.where(level > 0, power / np.maximum(level, 1e-300), 1.0)
    expected = near * (0.5 + 0.5 * shape)
    freedom = hits - 1.0
    drawn: FloatArray = (freedom * variance + _PRIOR * expected) / (freedom + _PRIOR)
    return drawn


def _smooth(x: FloatArray, kernel: FloatArray) -> FloatArray:
    half = kernel.size // 2
    edges = np.concatenate((np.full(half, x[0]), x, np.full(half, x[-1])))
    mean: FloatArray = np.convolve(edges, kernel, mode="valid")
    return mean


def _h1(ff: FloatArray, _aa: FloatArray, af: ComplexArray) -> ComplexArray:
    return np.asarray(af / ff)


def _h2(_ff: FloatArray, aa: FloatArray, af: ComplexArray) -> ComplexArray:
    return np.asarray(aa / af.conj())


def _hv(ff: FloatArray, aa: FloatArray, af: ComplexArray) -> ComplexArray:
    gain = np.sqrt(aa / ff)  # channels of equal power: the eigenvector then lies between H1 and H2
    return np.asarray(gain * af / np.abs(af))


_ESTIMATORS = {"H1": _h1, "H2": _h2, "Hv": _hv}
