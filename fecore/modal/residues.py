"""Mode shapes at known poles: what is left to find when a user types in frequencies and damping
ratios.

For fixed poles the FRFs are linear in residues and residual terms; see `basis` for the series and
`linear` for the least squares.
"""

from collections.abc import Sequence

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import IdentificationError, InputError
from fecore.frf import FrfSet
from fecore.modal.arrangement import Arrangement, arrange
from fecore.modal.basis import Terms
from fecore.modal.growth import local_level
from fecore.modal.preparation import noise_of
from fecore.modal.refinement import Level
from fecore.modal.shapes import Shapes, shapes_from_residues
from fecore.modes import MeasuredModes


def shapes_at_poles(
    frfs: FrfSet | Sequence[FrfSet],
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    *,
    band_hz: tuple[float, float] | None = None,
    exponents: tuple[int, ...] = (-2, -1, 0, 1, 2),
) -> tuple[MeasuredModes, Shapes]:
    """Mode shapes from FRFs at given natural frequencies and damping ratios.

    Args:
        frfs: FRFs of one campaign, one set or several; poles outside their band are fitted too and
            returned.
        frequency_hz: (n,) ascending undamped natural frequencies, Hz.
        damping_ratio: (n,) viscous damping ratios, above 0 and below 1.
        band_hz: lines to use; all where not given.
        exponents: powers of iω of the lower and upper residual terms (of the receptance).

    Returns:
        The modes with complex shapes at the roving dofs (positive directions), and the shapes in
        full: realised, mass normalised where a driving point was measured, with standard deviations
            and phase collinearity. The poles' own
        uncertainty is not known here: the modes carry no covariance.

    Raises:
        InputError: frequencies or ratios that are not usable.
        IdentificationError: two poles coincide, or a pole has no support in the data's band.
    """
    frequency, zeta = np.asarray(frequency_hz, dtype=float), np.asarray(damping_ratio, dtype=float)
    if frequency.ndim != 1 or frequency.size == 0 or zeta.shape != frequency.shape:
        raise InputError(
            "frequency_hz",
            f"and damping_ratio have shapes {frequency.shape} and {zeta.shape}, expected one of"
            " each a mode",
        )
    if not np.all(np.isfinite(frequency) & (frequency > 0)) or np.any(np.diff(frequency) < 0):
        raise InputError("frequency_hz", "must be positive and ascend")
    if not np.all((zeta > 0) & (zeta < 1)):
        raise InputError(
            "damping_ratio",
            "must be above 0 and below 1 to find shapes from FRFs (a ratio, not per cent)",
        )
    arrangement = arrange(frfs, band_hz)
    dead = [r for r in range(len(arrangement.pairs)) if not np.any(arrangement.values[r])]
    arrangement = arrangement.without(dead) if dead else arrangement
    fit = _fit_at(arrangement, Terms(frequency, zeta, exponents))
    spread = fit.linear.variance[:, : 2 * frequency.size]
    shapes = shapes_from_residues(
        arrangement, fit.residues, spread[:, 0::2] + spread[:, 1::2], fit.terms.poles.imag
    )
    return MeasuredModes(frequency, zeta, shapes.complex, arrangement.roving), shapes


def _fit_at(arrangement: Arrangement, terms: Terms) -> Level:
    """The series at given poles under the variance of its own misfit.

    Raises:
        IdentificationError: fewer lines than unknowns, or terms that cannot be separated.
    """
    lines = arrangement.measured.sum(axis=1)
    if 2 * lines.min() <= terms.columns:
        raise IdentificationError(
            f"{terms.pairs} poles and the residual terms are {terms.columns} unknowns an FRF, but"
            f" {arrangement.label(int(lines.argmin()))} has only {lines.min()} lines; use a wider"
            " band or fewer modes"
        )
    fit = local_level(arrangement, terms, noise_of(arrangement))
    if fit.linear.turn.shape[1] < terms.columns:
        raise IdentificationError(
            "the model's terms cannot be distinguished on the measured lines: two poles coincide,"
            " or there are fewer lines than unknowns; use fewer poles or a wider band"
        )
    return fit
