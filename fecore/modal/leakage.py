"""Leakage next to 0 Hz: what a record that did not die away, or drifts, leaves in its first
lines.
"""

from dataclasses import replace

import numpy as np
import scipy

from fecore.findings import Finding
from fecore.modal.arrangement import Arrangement
from fecore.modal.findings import finding
from fecore.modal.screening import FEWEST_LINES

_DROWNED = 0.3  # square of the jumps from line to line over the power: nothing but noise
# power of such lines next to 0 Hz over that at their end, from which they are leakage
_RAISED = 10.0


def leakage(arrangement: Arrangement) -> tuple[Arrangement, list[Finding]]:
    """Leave out the lines next to 0 Hz in which the FRFs jump from line to line as noise does, and
    rise towards 0 Hz.

    FRFs that are noise nearly to their last line stay whole: there is nothing that leakage stands
    before.
    """
    values = arrangement.values
    power = np.sum(np.abs(values) ** 2, axis=0)
    jump = np.sum(np.abs(values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2) ** 2, axis=0) / 1.5
    around = (power[:-2] + power[1:-1] + power[2:]) / 3
    rough = scipy.ndimage.median_filter(
        jump / np.maximum(around, np.finfo(float).tiny), size=5, mode="nearest"
    )
    drowned = int(np.argmax(rough < _DROWNED))
    first = drowned + 1  # `rough` is of the lines between others
    left = power.size - first
    if not drowned or left < FEWEST_LINES or np.mean(power[:first]) < _RAISED * power[first]:
        return arrangement, []
    cut = replace(
        arrangement,
        frequency_hz=arrangement.frequency_hz[first:],
        values=values[:, first:],
        measured=arrangement.measured[:, first:],
        variance=arrangement.variance[:, first:],
    )
    return cut, [finding("leakage", hz=cut.frequency_hz[0])]
