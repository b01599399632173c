"""An exponential window that nobody stated: what it would do to the damping, and whether the damping looks like one.

A window exp(-t/τ) makes every mode decay faster by 1/τ, as a constant part of the damping does (a0 = 2/τ): FRFs alone do not
distinguish the two. But windows are chosen to end a record of T seconds at 10 to 1 % of its first value, so 1/τ lies between
2/T and 5/T. A body whose own constant part lies there, and makes most of the slowest modes' decay, looks windowed.
"""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.damping_stage import DampingResult
from fecore.updating.inputs import Inputs
from fecore.updating.verdict import Finding

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
    ask = "state the window's rate 1/τ with the campaign, 0 for none"
    if rate is None:
        text = (
            f"nobody said whether the response had an exponential window: one usual for this record would make {names[worst]} "
            f"too high by {100 * shares[worst]:.0f} %, which its interval includes; {ask}"
        )
        return [Finding(text, None, 0.2)]
    text = (
        f"the FRFs look as if the response had had an exponential window: the slowest modes decay by {rate:.3g} 1/s on top of "
        f"all else, as with a window that ends a record of {record_s:.3g} s at {100 * np.exp(-rate * record_s):.2g} %; {ask}"
    )
    return [Finding(text, "with_care", 1.5)]


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
    scale = np.linalg.norm(basis, axis=0)
    constant = float(np.linalg.lstsq(basis / scale, np.ones_like(omega), rcond=None)[0][0] / scale[0])
    usual = _USUAL[0] <= constant * record_s <= _USUAL[1]
    return constant if usual and constant > _MOST * decay.min() else None
