"""How noisy each value is.

Where the FRF set carries a variance (from coherence and averages) it is used, as far as the records
bear it out. Elsewhere the noise is what changes from line to line without memory. A fit leaves
more: its variance follows the local misfit.
"""

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.modal.arrangement import Arrangement

_REACH = 0.3  # half the window over the number of its line
_NARROW, _WIDE = 4, 40  # ... and its bounds, lines
_FREEDOM = 8.0  # of Student's law
OUTLYING = (_FREEDOM + 2 - 0.1 * _FREEDOM) / 2
"""|r|² over its variance v/u from which a value's weight u is below 0.1."""

_LARGE, _MOST_RELATIVE = 0.95, 0.05  # quantile of the values that are large; largest ε
# FRFs from which they show what is common, lines on each side, and times that a scatter may be more
_MANY, _BESIDE, _TIMES = 8, 8, 4.0
WHOLE = 0.9
"""Of its lines that every FRF has where gaps are few."""

_LOCAL = 25  # lines over which the misfit is averaged
# of the rms of a record: below this nothing is believed, so that clean data keep finite weights
_FLOOR = 1e-5


def excess(variance: FloatArray, scatter: FloatArray, measured: BoolArray) -> FloatArray:
    """(N,) median over the lines of each FRF of the scatter (N, L) over the stated variance; NaN
    where none is stated.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return _row_medians(np.where(measured & np.isfinite(variance), scatter / variance, np.nan))


def _row_medians(rows: FloatArray) -> FloatArray:
    """(N,) median of each row without its NaNs, NaN of a row that is nothing else; numpy's own
    sorts masked arrays, slowly.
    """
    ordered = np.sort(rows, axis=1)  # NaN comes last
    count = np.sum(~np.isnan(rows), axis=1)
    at = np.arange(len(rows))
    low, high = (ordered[at, np.maximum(place, 0)] for place in ((count - 1) // 2, count // 2))
    return np.asarray(np.where(count > 0, low / 2 + high / 2, np.nan))


def line_scatter(values: ComplexArray, measured: BoolArray, first_line: float) -> FloatArray:
    """(N, L) variance of what changes from line to line without memory, as it follows frequency.

    The running median of the squared second differences (E = 1.5 v, median of an exponential = ln 2
    of its mean), over a window that grows with the number of the line from 0 Hz: leakage rises
    towards 0 Hz as a power of it. A median does not see resonances as long as they cover less than
    half of the window.

    Args:
        values: (N, L) FRFs, or the residual of a fit.
        measured: (N, L) where they were measured.
        first_line: frequency of the first line over the line spacing.
    """
    lines = values.shape[1]
    jump = np.abs(values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2) ** 2 / (1.5 * np.log(2))
    whole = measured[:, 1:-1] & measured[:, :-2] & measured[:, 2:]
    jump = np.where(whole & (jump > 0), jump, np.nan)
    nodes = np.unique(
        np.geomspace(1 + first_line, lines + first_line, 64).round() - first_line - 1
    ).astype(int)
    nodes = np.clip(nodes, 0, lines - 3)
    seen = np.empty((len(values), nodes.size))
    for place, node in enumerate(nodes):
        reach = int(np.clip(_REACH * (node + first_line), _NARROW, _WIDE))
        part = jump[:, max(0, node - reach) : node + reach + 1]
        seen[:, place] = _row_medians(part)
    line = np.arange(-1, lines - 1)
    usual = np.mean(np.abs(values) ** 2, axis=1)
    out = np.empty((len(values), lines))
    for row, own in enumerate(seen):
        known = np.isfinite(own)
        out[row] = (
            np.exp(np.interp(line, nodes[known], np.log(own[known]))) if known.any() else usual[row]
        )
    return np.asarray(np.maximum(out, _floor(values)))


def _floor(values: ComplexArray) -> FloatArray:
    """(N, 1) the least variance that is believed."""
    usual = np.mean(np.abs(values) ** 2, axis=1, keepdims=True)
    return np.asarray(_FLOOR**2 * np.maximum(usual, np.finfo(float).tiny))


def scatter_of(arrangement: Arrangement) -> FloatArray:
    """(N, L) variance of what changes from line to line of FRFs, at most several times what they do
    not have in common.
    """
    first = float(arrangement.frequency_hz[0] / max(arrangement.spacing_hz, np.finfo(float).tiny))
    scatter = line_scatter(arrangement.values, arrangement.measured, first)
    level = np.median(scatter, axis=1, keepdims=True)
    least = np.minimum(scatter, _TIMES * level * _uncommon(arrangement, level))
    return np.asarray(np.maximum(least, _floor(arrangement.values)))


def _uncommon(arrangement: Arrangement, level: FloatArray) -> FloatArray:
    """(L,) power, over the level (N, 1), of what many FRFs do not have in common on neighbouring
    lines; infinite where they are few or have gaps.

    Modes are common to all FRFs: they fill few directions of the FRFs, or of the lines, and noise
    fills all. It is the mean of the smaller half of the singular values' squares. Second differences
    take several resonances on the few lines next to 0 Hz for noise.
    """
    lines, out = arrangement.frequency_hz.size, np.full(arrangement.frequency_hz.size, np.inf)
    if len(level) < _MANY or lines <= 2 * _BESIDE:
        return out
    scaled = arrangement.values / np.sqrt(level)
    nodes = np.unique(np.append(np.arange(_BESIDE, lines - _BESIDE, _BESIDE), lines - 1 - _BESIDE))
    power = np.full(nodes.size, np.inf)
    for place, node in enumerate(nodes):
        near = slice(node - _BESIDE, node + _BESIDE + 1)
        if arrangement.measured[:, near].all():
            both = np.concatenate([scaled[:, near].real, scaled[:, near].imag], axis=1)
            small = both @ both.T if len(both) < both.shape[1] else both.T @ both
            value = np.linalg.eigvalsh(small)
            power[place] = max(value[: value.size // 2].mean(), 0.0) * 2 / max(both.shape)
    return np.asarray(np.repeat(power, np.diff(np.r_[0, (nodes[1:] + nodes[:-1]) // 2, lines])))


def local_variance(
    arrangement: Arrangement,
    residual: ComplexArray,
    noise: FloatArray,
    *,
    spare: FloatArray | float = 1.0,
    alike: bool = True,
) -> FloatArray:
    """(N, L) variance that follows the local misfit: the mean of |residual|² over 25 lines, at
    least the noise, and at least the share ε²|H|² that is usual where the FRFs are large: errors of
    the chain stand on the few lines of a peak.

    Args:
        arrangement: the FRFs.
        residual: (N, L) of a fit.
        noise: (N, L) variance of the noise.
        spare: (L,) share of each line that the fit leaves to its errors, 1 less the leverage: on
            the two or three lines of a narrow peak the residue and the pole take up most of them.
        alike: take the variances as one function of frequency but for a factor, v_il = g_i p_l,
            where few values are missing.
    """
    values, measured = arrangement.values, arrangement.measured
    square = scipy.ndimage.uniform_filter1d(
        np.where(measured, np.abs(residual) ** 2, 0.0), _LOCAL, axis=1, mode="nearest"
    )
    count = scipy.ndimage.uniform_filter1d(measured * spare, _LOCAL, axis=1, mode="nearest")
    variance = np.maximum(np.where(measured, noise, 0.0), square / np.maximum(count, 1 / _LOCAL))
    variance = np.maximum(variance, _relative(residual, values, spare) * np.abs(values) ** 2)
    variance = np.maximum(variance, np.finfo(float).tiny)
    if not alike or measured.mean(axis=1).min() < WHOLE:
        return np.asarray(variance)
    log = np.log(variance)
    level = np.mean(log, axis=1, keepdims=True, where=measured)
    size = np.exp(log - level)
    seen = measured.any(axis=0)
    shape = np.mean(size, axis=0, where=measured | ~seen)
    return np.asarray(np.exp(level) * shape)


def _relative(residual: ComplexArray, values: ComplexArray, spare: FloatArray | float) -> float:
    """ε², the usual |residual|² over |H|² of the largest twentieth of the values, at most 0.05²."""
    size = np.abs(values) ** 2
    large = size >= np.quantile(size, _LARGE)
    share = np.abs(residual[large]) ** 2 / np.maximum((size * spare)[large], np.finfo(float).tiny)
    return float(min(np.median(share) / np.log(2), _MOST_RELATIVE**2))


def student(
    arrangement: Arrangement, residual: ComplexArray, noise: FloatArray, spare: FloatArray
) -> FloatArray:
    """(N, L) variance of each value by Student's law with ν degrees of freedom about the local one:
    v/u, at least the noise.

    u = (ν + 2)/(ν + 2|r|²/v), v the local mean of u|r|² (expectation maximisation; Lange, Little
    and Taylor 1989): a line of interference or an overload counts for little, and does not raise
    the variance of the lines beside it.
    """
    weight: FloatArray = np.ones(residual.shape)
    for _ in range(3):  # the weights change little after these
        v = local_variance(arrangement, residual * np.sqrt(weight), noise, spare=spare, alike=False)
        weight = (_FREEDOM + 2) / (_FREEDOM + 2 * np.abs(residual) ** 2 / v)
    return np.asarray(v / np.minimum(weight, 1.0))
