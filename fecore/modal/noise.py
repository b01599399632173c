"""How noisy each value is.

Where the FRF set carries a variance (from coherence and averages) it is used. Elsewhere the noise is taken to have a
part that is constant over the record and a part proportional to the FRF, v_il = a_i² + b_i² |H_il|², which covers the
electronics' floor and the scatter of hits and cable alike. First a_i, b_i come from how much the record jumps from
line to line; later from the residual of a fit, by iterated regression of |r|² on (1, |H|²) with weights 1/v² (the
scoring iteration of the Gaussian likelihood).
"""

from __future__ import annotations

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray

_ITERATIONS = 8  # of the scoring for the two parts of the noise
_POLISH = 8  # steps more, by the likelihood itself
_NODES = 64  # frequencies at which the scatter of the lines is taken, by ratio
_REACH = 0.3  # half the window over the number of its line
_NARROW, _WIDE = 4, 40  # ... and its bounds, lines
_FREEDOM = 8.0  # of Student's law
_ROUNDS = 3  # of its weights
_LARGE, _MOST_RELATIVE = 0.95, 0.05  # quantile of the values that are large; largest ε
_LOCAL = 25  # lines over which the misfit is averaged
_FLOOR = 1e-5  # of the rms of a record: below this nothing is believed, so that clean data keep finite weights


def rough_variance(values: ComplexArray, measured: BoolArray) -> FloatArray:
    """(N, L) variance from the second difference of each record, whose noise part is Var(n) · (1 + 4 + 1)/4.

    With d_l = H_l - (H_{l-1} + H_{l+1})/2, E|d|² = 1.5 v plus the record's own curvature, so this errs to the large
    side at sharp resonances, where the first fit then merely trusts the data a little less.
    """
    jump = np.abs(values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2) ** 2 / 1.5
    whole = measured[:, 1:-1] & measured[:, :-2] & measured[:, 2:]
    level = np.abs(values[:, :-2] + values[:, 2:]) ** 2 / 4
    return _two_part(jump, level, whole, values, measured, robust=True)


def believable(variance: FloatArray, rough: FloatArray, measured: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Stated variance, enlarged for each FRF whose own roughness is larger by more than a factor 2: (N, L), (N,)
    factors.

    Coherence that was averaged over few hits, or stated for the wrong estimator, is often too good by far.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(measured & np.isfinite(variance), rough / variance, np.nan)
    factor = np.ones(len(ratio))
    stated = np.isfinite(ratio).any(axis=1)
    factor[stated] = _row_medians(ratio[stated])
    factor = np.where(factor > 2, factor, 1.0)
    return variance * factor[:, None], factor


def residual_variance(
    residual: ComplexArray,
    model: ComplexArray,
    measured: BoolArray,
    columns: float,
) -> FloatArray:
    """(N, L) variance from the residual of a fit with `columns` real coefficients an FRF."""
    lines = measured.sum(axis=1)
    spare = np.maximum(2 * lines - columns, 1) / np.maximum(2 * lines, 1)
    square = np.abs(residual) ** 2 / spare[:, None]
    return _two_part(square, np.abs(model) ** 2, measured, model, measured, robust=False)


def _two_part(
    square: FloatArray,
    level: FloatArray,
    use: BoolArray,
    shape_of: ComplexArray,
    measured: BoolArray,
    robust: bool,
) -> FloatArray:
    """(N, L) a² + b²|H|² with a², b² >= 0 fitted to `square` at the magnitudes squared `level`."""
    power = np.sum(np.abs(shape_of) ** 2 * measured, axis=1) / np.maximum(measured.sum(axis=1), 1)
    power = np.where(power > 0, power, 1.0)
    square, level = square / power[:, None], level / power[:, None]
    if robust:  # one jump in a hundred may be a spike: cap at a value that exponential scatter hardly reaches
        ranked = np.where(use, square, np.nan)
        square = np.minimum(square, 8 * _row_medians(ranked)[:, None] * (1 + level / level.mean()))
    count = np.maximum(use.sum(axis=1), 1)
    constant = np.sum(square * use, axis=1) / count + _FLOOR**2
    slope = np.zeros_like(constant)
    for _ in range(_ITERATIONS):
        weight = use / (constant[:, None] + slope[:, None] * level) ** 2
        constant, slope = _regress(square, level, weight)
    for _ in range(_POLISH):  # a step that cannot lower the likelihood, for residuals that are not just noise
        v = constant[:, None] + slope[:, None] * level
        pull, hold = use * square / v**2, use / v
        constant = np.maximum(constant * np.sqrt(pull.sum(1) / np.maximum(hold.sum(1), 1e-300)), _FLOOR**2)
        slope = slope * np.sqrt((pull * level).sum(1) / np.maximum((hold * level).sum(1), 1e-300))
    v = constant[:, None] + slope[:, None] * level
    scale = np.maximum(np.sum(use * square / v, axis=1) / count, _FLOOR**2)
    constant = np.maximum(constant * scale, _FLOOR**2)
    full = np.abs(shape_of) ** 2
    return np.asarray(constant[:, None] * power[:, None] + (slope * scale)[:, None] * full)


def _regress(square: FloatArray, level: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted straight line square = a² + b² level through each row, with both coefficients held at or above zero."""
    s0, s1, s2 = weight.sum(1), (weight * level).sum(1), (weight * level**2).sum(1)
    r0, r1 = (weight * square).sum(1), (weight * square * level).sum(1)
    determinant = s0 * s2 - s1**2
    known = determinant > 1e-12 * s0 * s2  # levels that differ
    safe = np.where(known, determinant, 1.0)
    constant, slope = (s2 * r0 - s1 * r1) / safe, (s0 * r1 - s1 * r0) / safe
    only_constant, only_slope = r0 / np.maximum(s0, 1e-300), np.where(s2 > 0, r1 / np.where(s2 > 0, s2, 1.0), 0.0)
    flat = ~known | (slope < 0)
    constant, slope = (
        np.where(flat, only_constant, np.where(constant < 0, 0.0, constant)),
        np.where(flat, 0.0, np.where(constant < 0, only_slope, slope)),
    )
    return np.maximum(constant, _FLOOR**2), np.minimum(slope, _FLOOR**-2)


def _row_medians(rows: FloatArray) -> FloatArray:
    """(N,) median of each row without its NaNs, NaN of a row that is nothing else; numpy's own sorts masked arrays, slowly."""
    ordered = np.sort(rows, axis=1)  # NaN comes last
    count = np.sum(~np.isnan(rows), axis=1)
    at = np.arange(len(rows))
    low, high = (ordered[at, np.maximum(place, 0)] for place in ((count - 1) // 2, count // 2))
    return np.asarray(np.where(count > 0, low / 2 + high / 2, np.nan))


def line_scatter(values: ComplexArray, measured: BoolArray, first_line: float) -> FloatArray:
    """(N, L) variance of what changes from line to line without memory, as it follows frequency.

    The running median of the squared second differences (E = 1.5 v, median of an exponential = ln 2 of its mean), over a window
    that grows with the number of the line from 0 Hz: leakage rises towards 0 Hz as a power of it. A median does not see
    resonances as long as they cover less than half of the window.

    Args:
        values: (N, L) FRFs, or the residual of a fit.
        measured: (N, L) where they were measured.
        first_line: frequency of the first line over the line spacing.
    """
    lines = values.shape[1]
    jump = np.abs(values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2) ** 2 / (1.5 * np.log(2))
    whole = measured[:, 1:-1] & measured[:, :-2] & measured[:, 2:]
    jump = np.where(whole & (jump > 0), jump, np.nan)
    nodes = np.unique(np.geomspace(1 + first_line, lines + first_line, _NODES).round() - first_line - 1).astype(int)
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
        out[row] = np.exp(np.interp(line, nodes[known], np.log(own[known]))) if known.any() else usual[row]
    return np.asarray(np.maximum(out, _FLOOR**2 * np.maximum(usual, np.finfo(float).tiny)[:, None]))


def local_variance(
    residual: ComplexArray, values: ComplexArray, noise: FloatArray, measured: BoolArray, *, alike: bool = True
) -> FloatArray:
    """(N, L) variance that follows the local misfit: the mean of |residual|² over 25 lines, at least the noise, and
    at least the share ε²|H|² that is usual where the FRFs are large: errors of the chain stand on the few lines of a
    peak.

    Args:
        residual: (N, L) of a fit.
        values: (N, L) the FRFs.
        noise: (N, L) variance of the noise.
        measured: (N, L) where they were measured.
        alike: take the variances as one function of frequency but for a factor, v_il = g_i p_l, where no value is missing.
    """
    square = scipy.ndimage.uniform_filter1d(
        np.where(measured, np.abs(residual) ** 2, 0.0), _LOCAL, axis=1, mode="nearest"
    )
    count = scipy.ndimage.uniform_filter1d(measured.astype(float), _LOCAL, axis=1, mode="nearest")
    variance = np.maximum(np.where(measured, noise, 0.0), square / np.maximum(count, 1 / _LOCAL))
    variance = np.maximum(variance, _relative(residual, values) * np.abs(values) ** 2)
    variance = np.maximum(variance, np.finfo(float).tiny)
    if not alike or not measured.all():
        return np.asarray(variance)
    log = np.log(variance)
    level = log.mean(axis=1, keepdims=True)
    return np.asarray(np.exp(level) * np.exp(log - level).mean(axis=0))


def _relative(residual: ComplexArray, values: ComplexArray) -> float:
    """ε², the usual |residual|² over |H|² of the largest twentieth of the values, at most 0.05²."""
    size = np.abs(values) ** 2
    large = size >= np.quantile(size, _LARGE)
    share = np.abs(residual[large]) ** 2 / np.maximum(size[large], np.finfo(float).tiny)
    return float(min(np.median(share) / np.log(2), _MOST_RELATIVE**2))


def student(residual: ComplexArray, values: ComplexArray, noise: FloatArray, measured: BoolArray) -> FloatArray:
    """(N, L) variance of each value by Student's law with ν degrees of freedom about the local one: v/u, at least the noise.

    u = (ν + 2)/(ν + 2|r|²/v), v the local mean of u|r|² (expectation maximisation; Lange, Little and Taylor 1989): a line of
    interference or an overload counts for little, and does not raise the variance of the lines beside it.
    """
    weight: FloatArray = np.ones(residual.shape)
    for _ in range(_ROUNDS):
        v = local_variance(residual * np.sqrt(weight), values, noise, measured, alike=False)
        weight = (_FREEDOM + 2) / (_FREEDOM + 2 * np.abs(residual) ** 2 / v)
    return np.asarray(v / np.minimum(weight, 1.0))
