"""The noise that the residual of an FRF fit shows: a part that is constant over the record and one
proportional to the FRF.

v_il = a_i² + b_i² |H_il|² covers the electronics' floor and the scatter of hits and cable alike.
a_i, b_i come by iterated regression of |r|² on (1, |H|²) with weights 1/v², the scoring iteration
of the Gaussian likelihood.
"""

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray

_ITERATIONS = 8  # of the scoring
_POLISH = 8  # steps more, by the likelihood itself
# of the rms of a record: below this nothing is believed, so that clean data keep finite weights
_FLOOR = 1e-5


def residual_variance(
    residual: ComplexArray, model: ComplexArray, measured: BoolArray
) -> FloatArray:
    """(N, L) variance a² + b²|H|², a², b² >= 0, of each FRF's residual of a fit with model H, by
    scoring of the likelihood.
    """
    power = np.sum(np.abs(model) ** 2 * measured, axis=1) / np.maximum(measured.sum(axis=1), 1)
    power = np.where(power > 0, power, 1.0)[:, None]
    square, level = np.abs(residual) ** 2 / power, np.abs(model) ** 2 / power
    count = np.maximum(measured.sum(axis=1), 1)
    constant = np.sum(square * measured, axis=1) / count + _FLOOR**2
    slope = np.zeros_like(constant)
    for _ in range(_ITERATIONS):
        weight = measured / (constant[:, None] + slope[:, None] * level) ** 2
        constant, slope = _regress(square, level, weight)
    # a step that cannot lower the likelihood, for residuals that are not just noise
    for _ in range(_POLISH):
        v = constant[:, None] + slope[:, None] * level
        numerator, denominator = measured * square / v**2, measured / v
        constant = np.maximum(
            constant * np.sqrt(numerator.sum(1) / np.maximum(denominator.sum(1), 1e-300)), _FLOOR**2
        )
        slope = slope * np.sqrt(
            (numerator * level).sum(1) / np.maximum((denominator * level).sum(1), 1e-300)
        )
    v = constant[:, None] + slope[:, None] * level
    scale = np.maximum(np.sum(measured * square / v, axis=1) / count, _FLOOR**2)
    return np.asarray(
        (np.maximum(constant * scale, _FLOOR**2)[:, None] + (slope * scale)[:, None] * level)
        * power
    )


def _regress(
    square: FloatArray, level: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Weighted straight line square = a² + b² level through each row, with both coefficients held
    at or above zero.
    """
    s0, s1, s2 = weight.sum(1), (weight * level).sum(1), (weight * level**2).sum(1)
    r0, r1 = (weight * square).sum(1), (weight * square * level).sum(1)
    determinant = s0 * s2 - s1**2
    known = determinant > 1e-12 * s0 * s2  # levels that differ
    safe = np.where(known, determinant, 1.0)
    constant, slope = (s2 * r0 - s1 * r1) / safe, (s0 * r1 - s1 * r0) / safe
    only_constant = r0 / np.maximum(s0, 1e-300)
    only_slope = np.where(s2 > 0, r1 / np.where(s2 > 0, s2, 1.0), 0.0)
    flat = ~known | (slope < 0)
    constant, slope = (
        np.where(flat, only_constant, np.where(constant < 0, 0.0, constant)),
        np.where(flat, 0.0, np.where(constant < 0, only_slope, slope)),
    )
    return np.maximum(constant, _FLOOR**2), np.minimum(slope, _FLOOR**-2)
