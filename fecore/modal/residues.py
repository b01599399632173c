"""Mode shapes at known poles: what is left to find when a user types in frequencies and damping ratios.

For fixed poles the FRFs are linear in residues and residual terms; see `basis` for the series and `linear` for the
least squares. The weights are refined with the residual twice, so a noisy FRF does not drown in its own floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import IdentificationError, InputError
from fecore.frf import FrfSet
from fecore.modal.arrangement import Arrangement, arrange
from fecore.modal.basis import Terms, columns, poles
from fecore.modal.linear import LinearFit, fit_linear
from fecore.modal.noise import residual_variance, rough_variance
from fecore.modal.shapes import Shapes, shapes_from_residues
from fecore.modes import MeasuredModes

_WEIGHT_PASSES = 2  # in which the noise is taken from the residual


@dataclass(frozen=True)
class ResidueFit:
    """Residues of all FRFs at given poles.

    Attributes:
        terms: the poles and residual terms of the series.
        residues: (N, n) complex receptance residues.
        residue_variance: (N, n) their variance E|error|².
        model: (N, L) fitted FRFs.
        variance: (N, L) noise variance that weighted the fit.
        linear: coefficients with their covariance, columns as in `basis.columns`.
    """

    terms: Terms
    residues: ComplexArray
    residue_variance: FloatArray
    model: ComplexArray
    variance: FloatArray
    linear: LinearFit


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
        frfs: FRFs of one campaign, one set or several; poles outside their band are fitted too and returned.
        frequency_hz: (n,) ascending undamped natural frequencies, Hz.
        damping_ratio: (n,) viscous damping ratios, above 0 and below 1.
        band_hz: lines to use; all where not given.
        exponents: powers of iω of the lower and upper residual terms (of the receptance).

    Returns:
        The modes with complex shapes at the roving dofs (positive directions), and the shapes in full: realised, mass
        normalised where a driving point was measured, with standard deviations and phase collinearity. The poles' own
        uncertainty is not known here: the modes carry no covariance.

    Raises:
        InputError: frequencies or ratios that are not usable.
        IdentificationError: two poles coincide, or a pole has no support in the data's band.
    """
    frequency, zeta = np.asarray(frequency_hz, dtype=float), np.asarray(damping_ratio, dtype=float)
    if frequency.ndim != 1 or frequency.size == 0 or zeta.shape != frequency.shape:
        raise InputError(
            "frequency_hz",
            f"and damping_ratio have shapes {frequency.shape} and {zeta.shape}, expected one of each a mode",
        )
    if not np.all(np.isfinite(frequency) & (frequency > 0)) or np.any(np.diff(frequency) < 0):
        raise InputError("frequency_hz", "must be positive and ascend")
    if not np.all((zeta > 0) & (zeta < 1)):
        raise InputError(
            "damping_ratio", "must be above 0 and below 1 to find shapes from FRFs (a ratio, not per cent)"
        )
    arrangement = arrange(frfs, band_hz)
    dead = [r for r in range(len(arrangement.pairs)) if not np.any(arrangement.values[r])]
    arrangement = arrangement.without(dead) if dead else arrangement
    fit = fit_residues(arrangement, Terms(frequency, zeta, exponents))
    shapes = shapes_from_residues(arrangement, fit.residues, fit.residue_variance, poles(frequency, zeta).imag)
    return MeasuredModes(frequency, zeta, shapes.complex, arrangement.roving), shapes


def fit_residues(arrangement: Arrangement, terms: Terms, variance: FloatArray | None = None) -> ResidueFit:
    """Residues of all FRFs for given poles, weighted by `variance`, or by one estimated from the residual.

    Raises:
        IdentificationError: fewer lines than unknowns, or terms that cannot be separated.
    """
    lines = arrangement.measured.sum(axis=1)
    if 2 * lines.min() <= terms.columns:
        raise IdentificationError(
            f"{terms.pairs} poles and the residual terms are {terms.columns} unknowns an FRF, but"
            f" {arrangement.label(int(lines.argmin()))} has only {lines.min()} lines; use a wider band or fewer modes"
        )
    basis = columns(arrangement.omega, terms, arrangement.power)
    passes = 0 if variance is not None else _WEIGHT_PASSES
    noise = known_or(arrangement, rough_variance(arrangement.values, arrangement.measured)) if passes else variance
    assert noise is not None
    fit = fit_linear(basis, arrangement.values, weights(arrangement, noise))
    for _ in range(passes):
        model = fit.coefficients @ basis.T
        estimate = residual_variance(arrangement.values - model, model, arrangement.measured, terms.columns)
        noise = known_or(arrangement, estimate)
        fit = fit_linear(basis, arrangement.values, weights(arrangement, noise))
    n = terms.pairs
    residues = fit.coefficients[:, 0 : 2 * n : 2] + 1j * fit.coefficients[:, 1 : 2 * n : 2]
    spread = np.einsum("nii->ni", fit.covariance)
    return ResidueFit(
        terms,
        residues,
        spread[:, 0 : 2 * n : 2] + spread[:, 1 : 2 * n : 2],
        fit.coefficients @ basis.T,
        noise,
        fit,
    )


def known_or(arrangement: Arrangement, estimate: FloatArray) -> FloatArray:
    """Variance handed in where it is known, else the estimate."""
    return np.asarray(np.where(np.isnan(arrangement.variance), estimate, arrangement.variance))


def weights(arrangement: Arrangement, variance: FloatArray) -> FloatArray:
    """(N, L) weights 2/v of each complex value, 0 where nothing was measured."""
    return np.asarray(np.where(arrangement.measured, 2 / np.maximum(variance, np.finfo(float).tiny), 0.0))
