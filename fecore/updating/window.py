"""An exponential window that nobody stated: what it would do to the damping, and whether the damping looks like one.

A window exp(-t/τ) makes every mode decay faster by 1/τ, as a constant part of the damping does (a0 = 2/τ): FRFs alone do not
distinguish the two. But windows are chosen to end a record of T seconds at 10 to 1 % of its first value, so 1/τ lies between
2/T and 5/T. A body whose own constant part lies there, and makes most of the slowest modes' decay, looks windowed.
"""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray
from fecore.least_squares import nearest
from fecore.updating.damping_stage import DampingResult
from fecore.updating.findings import found
from fecore.updating.inputs import Inputs
from fecore.updating.result import Finding

_USUAL = (2.0, 5.0)  # 1/τ of usual windows, over the record's length
_MOST = 0.5  # share of the slowest mode's decay that a window has where FRFs look windowed
_FEWEST_MODES = 3  # that show a constant part of the decay
_MATTERS = 0.05  # share of a coefficient that an unstated window may take


def unstated_window(damping: DampingResult, inputs: Inputs, record_s: float) -> list[Finding]:
    """What a user must know of a window that nobody stated; nothing where it was, or where it would hardly matter.

    Args:
        damping: the fitted law.
        inputs: what the laboratory says of the window.
        record_s: T, the length of the records that the FRFs' line spacing is of.
    """
    if inputs.window_rate is not None:
        return []
    values, names = damping.fit.coefficients, damping.fit.law.coefficient_names
    shares = np.abs(damping.window / np.where(values == 0, 1.0, values))
    worst = int(np.argmax(shares))
    if shares[worst] < _MATTERS:
        return []
    rate = looks_windowed(damping.reference.ratios.omega, damping.reference.ratios.ratio, record_s)
    if rate is None:
        return [found("window_unstated", name=names[worst], percent=100 * shares[worst])]
    return [found("looks_windowed", rate=rate, record=record_s, end=100 * np.exp(-rate * record_s))]


def looks_windowed(omega: FloatArray, ratio: FloatArray, record_s: float) -> float | None:
    """The part of the decay that all modes share, 1/s, where it is that of a usual window; else None.

    Args:
        omega: (n,) circular frequencies, rad/s.
        ratio: (n,) damping ratios.
        record_s: T, s.
    """
    if omega.size < _FEWEST_MODES:
        return None
    decay = ratio * omega
    basis = np.column_stack([np.ones_like(omega), omega**2]) / decay[:, None]
    constant = float(nearest(basis, np.ones_like(omega))[0])
    usual = _USUAL[0] <= constant * record_s <= _USUAL[1]
    return constant if usual and constant > _MOST * decay.min() else None
