"""Single values that no model of the rest explains: left out, named in a warning, and the fit repeated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.refinement import Fit, noise_of, refine_with_noise
from fecore.identification.screening import lines_in_words

_FAR = 36.0  # |residual|²/variance; one in 10¹⁵ of Gaussian values is beyond
_NEAR = 9.0  # ... of both neighbours, which are ordinary beside a true outlier
_PASSES = 2  # as a large outlier hides a smaller one
_SHARED = 0.25  # share of the FRFs that may have an outlier at one line; more of them show the structure's doing
_MOST = 0.01  # share of a record that may be left out


def _near_poles(arrangement: Arrangement, fit: Fit) -> BoolArray:
    """(L,) lines at a resonance, where the model's own error may be meant."""
    off = np.abs(arrangement.frequency_hz[:, None] - fit.terms.frequency_hz)
    reach = 3 * np.maximum(fit.terms.frequency_hz * fit.terms.damping_ratio, arrangement.spacing_hz)
    narrow = fit.terms.damping_ratio * fit.terms.frequency_hz < arrangement.spacing_hz
    return np.asarray(((off < reach) & narrow).any(axis=1))


def leave_out_outliers(
    arrangement: Arrangement, fit: Fit, profile: FloatArray | None = None
) -> tuple[Arrangement, Fit, list[str]]:
    """Fit without isolated outliers. A misfit at a resonance spans several lines and is not one."""
    notes: list[str] = []
    for _ in range(_PASSES):
        square = np.where(arrangement.measured, np.abs(fit.residual) ** 2 / fit.variance, 0.0)
        beside = np.zeros_like(square)
        beside[:, 1:-1] = np.maximum(square[:, :-2], square[:, 2:])
        beside[:, 0], beside[:, -1] = square[:, 1], square[:, -2]
        found = (square > _FAR) & (beside < _NEAR) & ~_near_poles(arrangement, fit)
        found[:, found.sum(axis=0) > max(1, _SHARED * len(found))] = False  # what many show is not one record's fault
        many = found.sum(axis=1) > np.maximum(1, _MOST * arrangement.measured.sum(axis=1))
        found[many] = False
        if not found.any():
            break
        for row in np.flatnonzero(found.any(axis=1)):
            words = lines_in_words(arrangement.frequency_hz[found[row]])
            notes.append(f"{arrangement.label(int(row))}: {words} left out, far off what the other lines say")
        measured = arrangement.measured & ~found
        arrangement = replace(arrangement, measured=measured, values=np.where(measured, arrangement.values, 0))
        fit = refine_with_noise(arrangement, fit.terms, noise_of(arrangement, fit, profile), profile=profile)
    if len(notes) > 8:
        notes = [*notes[:8], f"outlying values were left out of {len(notes) - 8} more FRFs"]
    return arrangement, fit, notes
