"""What a user should know of the modes that were found, and of what the fit leaves."""

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.refinement import Fit
from fecore.modal.shapes import Shapes, of_rank_two

_FEW_LINES = 2.0  # lines in the half-power bandwidth below which the damping is not resolved
_COMPLEX = 0.8  # modal phase collinearity below which a mode is called complex
_WEAK = 0.1  # of the FRFs at its frequency, below which a mode is called weak
_CLOSE = 1.5  # distance of two modes in their mean bandwidth from which their shapes mix little


def remarks(
    arrangement: Arrangement,
    fit: Fit,
    kept: IntArray,
    shapes: Shapes,
    share: FloatArray,
    doubt: tuple[str | None, ...],
) -> list[str]:
    """What a user should know of the poles that were kept, whose reasons for doubt are given."""
    f, zeta = fit.terms.frequency_hz[kept], fit.terms.damping_ratio[kept]
    sd = np.sqrt(np.diag(fit.parameter_covariance))[fit.terms.pairs + kept]
    notes = []
    for k in range(f.size):
        name = f"mode {k + 1} ({f[k]:.2f} Hz)"
        if (why := doubt[k]) is not None:
            notes.append(f"{name} is uncertain: {why}")
        lines = 2 * zeta[k] * f[k] / max(arrangement.spacing_hz, np.finfo(float).tiny)
        if lines < _FEW_LINES:
            notes.append(
                f"{name}: its half-power bandwidth covers {lines:.1f} lines, so its damping rests"
                " on the window and on leakage; measure with a finer line spacing"
            )
        if share[kept[k]] < _WEAK:
            notes.append(
                f"{name}: weak, {100 * share[kept[k]]:.0f} % of the FRFs at its own frequency"
            )
        if shapes.collinearity[k] < _COMPLEX:
            notes.append(
                f"{name}: complex shape (modal phase collinearity {shapes.collinearity[k]:.2f})"
            )
        if sd[k] > 0.1 * zeta[k]:
            notes.append(f"{name}: damping is known to ± {100 * sd[k] / zeta[k]:.0f} % only")
        if k and (f[k] - f[k - 1]) < _CLOSE * (zeta[k] * f[k] + zeta[k - 1] * f[k - 1]) / 2:
            notes.append(
                f"modes {k} and {k + 1} ({f[k - 1]:.2f} and {f[k]:.2f} Hz) overlap: a close pair"
            )
    return (
        notes
        + _of_one_record(arrangement, fit, kept)
        + _rank_two(arrangement, fit, kept)
        + _driving_points(arrangement, fit, kept)
    )


def _of_one_record(arrangement: Arrangement, fit: Fit, kept: IntArray) -> list[str]:
    """Poles that one of several FRFs shows: a mode and a resonance of that sensor have the same
    phase.
    """
    size = np.abs(fit.residues[:, kept]) ** 2
    if len(size) < 3:
        return []
    return [
        f"mode {k + 1} ({fit.terms.frequency_hz[kept[k]]:.2f} Hz):"
        f" {arrangement.label(int(np.argmax(size[:, k])))} alone shows it: a local mode, or a"
        " resonance of that sensor or hammer"
        for k in np.flatnonzero(size.max(axis=0) > 0.99 * size.sum(axis=0))
    ]


def _rank_two(arrangement: Arrangement, fit: Fit, kept: IntArray) -> list[str]:
    """Poles whose residues against several fixed dofs are not one shape, and which the data did not
    part.
    """
    two = of_rank_two(arrangement, fit.residues, fit.residue_variance)
    return [
        f"mode {number} ({fit.terms.frequency_hz[k]:.2f} Hz): its residues against the fixed dofs"
        " are of rank two: two modes at one frequency, of which the stronger shape is given"
        for number, k in enumerate(kept, start=1)
        if two[k]
    ]


def _driving_points(arrangement: Arrangement, fit: Fit, kept: IntArray) -> list[str]:
    """A driving point has positive modal masses; where most come out negative, one of its signs is
    wrong.
    """
    notes = []
    masses = (2j * fit.terms.poles.imag * fit.residues)[:, kept].real
    for row, (a, b) in enumerate(arrangement.pairs):
        if a != b:
            continue
        modal = masses[row]
        if modal.size and np.sum(modal[modal < 0]) < -0.5 * np.sum(np.abs(modal)):
            notes.append(
                f"driving point {arrangement.label(row)}: {int(np.sum(modal < 0))} of {modal.size}"
                " modes have a negative modal mass there, so the sign of hammer or sensor is wrong"
                " (a hit along -Z entered as +Z?); all shapes of this fixed dof are turned if it"
                " is the sensor, one entry if it is the hit"
            )
    return notes
