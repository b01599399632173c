"""What a user should know of the modes that were found, and of what the fit leaves."""

from functools import partial

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.findings import Finding
from fecore.modal.arrangement import Arrangement
from fecore.modal.findings import finding
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
) -> list[Finding]:
    """What a user should know of the poles that were kept, whose reasons for doubt are given."""
    f, zeta = fit.terms.frequency_hz[kept], fit.terms.damping_ratio[kept]
    sd = np.sqrt(np.diag(fit.parameter_covariance))[fit.terms.pairs + kept]
    named = _named(doubt)
    notes = []
    for k in range(f.size):
        of_mode = partial(finding, which=named[k], hz=f[k])
        if (why := doubt[k]) is not None:
            notes.append(finding("mode_uncertain", hz=f[k], why=why))
        lines = 2 * zeta[k] * f[k] / max(arrangement.spacing_hz, np.finfo(float).tiny)
        if lines < _FEW_LINES:
            notes.append(of_mode("few_lines_in_peak", lines=lines))
        if share[kept[k]] < _WEAK:
            notes.append(of_mode("weak", percent=100 * share[kept[k]]))
        if shapes.collinearity[k] < _COMPLEX:
            notes.append(of_mode("complex_shape", collinearity=shapes.collinearity[k]))
        if sd[k] > 0.1 * zeta[k]:
            notes.append(of_mode("damping_uncertain", percent=100 * sd[k] / zeta[k]))
        if k and (f[k] - f[k - 1]) < _CLOSE * (zeta[k] * f[k] + zeta[k - 1] * f[k - 1]) / 2:
            notes.append(
                finding("close_pair", low=named[k - 1], high=named[k], first=f[k - 1], second=f[k])
            )
    return (
        notes
        + _of_one_record(arrangement, fit, kept, named)
        + _rank_two(arrangement, fit, kept, named)
        + _driving_points(arrangement, fit, kept)
    )


def _named(doubt: tuple[str | None, ...]) -> list[str]:
    """Modes by their number in the set, which has no uncertain pole."""
    sure = np.cumsum([why is None for why in doubt])
    return [
        "an uncertain pole" if why else f"mode {number}"
        for why, number in zip(doubt, sure, strict=True)
    ]


def _of_one_record(
    arrangement: Arrangement, fit: Fit, kept: IntArray, named: list[str]
) -> list[Finding]:
    """Poles that one of several FRFs shows: a mode and a resonance of that sensor have the same
    phase.
    """
    size = np.abs(fit.residues[:, kept]) ** 2
    if len(size) < 3:
        return []
    return [
        finding(
            "one_record",
            which=named[k],
            hz=fit.terms.frequency_hz[kept[k]],
            frf=arrangement.label(int(np.argmax(size[:, k]))),
        )
        for k in np.flatnonzero(size.max(axis=0) > 0.99 * size.sum(axis=0))
    ]


def _rank_two(
    arrangement: Arrangement, fit: Fit, kept: IntArray, named: list[str]
) -> list[Finding]:
    """Poles whose residues against several fixed dofs are not one shape, and which the data did not
    part.
    """
    two = of_rank_two(arrangement, fit.residues, fit.residue_variance)
    return [
        finding("rank_two", which=which, hz=fit.terms.frequency_hz[k])
        for which, k in zip(named, kept, strict=True)
        if two[k]
    ]


def _driving_points(arrangement: Arrangement, fit: Fit, kept: IntArray) -> list[Finding]:
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
                finding(
                    "driving_point",
                    frf=arrangement.label(row),
                    negative=int(np.sum(modal < 0)),
                    count=modal.size,
                )
            )
    return notes
