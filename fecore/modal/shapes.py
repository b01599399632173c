"""Residues to mode shapes.

With viscous damping that does not couple the modes, the residue of pole k between dofs i and j is
R_ij = φ_i φ_j / (2iω_d), with φ normalised to unit modal mass. A = 2iω_d R is therefore real, of
rank one, and positive at a driving point. Measured A are complex and noisy: the shape is the best
rank-one factor, turned to the phase in which it is as real as can be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.modal.arrangement import Arrangement

# second singular value of the residues over the first from which there are two modes
_SECOND_SHAPE = 0.1
_ABOVE_NOISE = 5.0  # largest singular values of noise alone that the second one must reach
# standard deviations that a driving-point residue must be above zero to normalise by it
_SURE = 4.0


@dataclass(frozen=True)
class Shapes:
    """Shapes of n modes at p roving dofs."""

    # (n, p) complex shapes, largest magnitude 1, turned as near to real as they go
    complex: ComplexArray
    real: FloatArray  # (n, p) realised shapes (the real part of `complex`), signed
    # (n, p) standard deviation of `complex` (root of E|error|²) beside its largest entry, which is
    # 1 by definition
    sd: FloatArray
    collinearity: FloatArray  # (n,) modal phase collinearity, 1 for a real mode
    # (n, p) real shapes for unit modal mass, 1/√kg; None where no driving point was measured, NaN
    # rows where its residue is not clearly positive
    mass_normalised: FloatArray | None

    def select(self, which: IntArray) -> Shapes:
        """The shapes of some modes."""
        mass = None if self.mass_normalised is None else self.mass_normalised[which]
        return Shapes(
            self.complex[which], self.real[which], self.sd[which], self.collinearity[which], mass
        )


def phase_collinearity(shape: ComplexArray) -> float:
    """Modal phase collinearity, 1 when all entries share a phase (or its opposite) and 0 when
    phases are scattered.

    MPC = ((S_xx - S_yy)² + 4 S_xy²) / (S_xx + S_yy)², x and y the real and imaginary parts (Pappa,
    Elliott and Schenk 1993, without the removal of means, which has no meaning for shapes) =
    |Σψ²|²/(Σ|ψ|²)².
    """
    total = float(np.sum(np.abs(shape) ** 2))
    return float(np.abs(np.sum(shape**2)) ** 2 / total**2) if total > 0 else float("nan")


def turn_real(shape: ComplexArray) -> ComplexArray:
    """The shape times the unit phase that makes its imaginary part least, ½ arg Σψ²; largest real
    entry positive.
    """
    turned = shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))
    largest = turned[np.argmax(np.abs(turned))]
    return np.asarray(turned if largest.real >= 0 else -turned)


def shapes_from_residues(
    arrangement: Arrangement, residues: ComplexArray, variance: FloatArray, damped_omega: FloatArray
) -> Shapes:
    """Shapes at the roving dofs from residues of all FRFs.

    Args:
        arrangement: which FRF lies between which dofs.
        residues: (N, n) receptance residues.
        variance: (N, n) their variance E|error|².
        damped_omega: (n,) damped circular frequencies of the poles, rad/s.
    """
    p, n = len(arrangement.roving), damped_omega.size
    scaled = 2j * damped_omega * residues
    spread = (2 * damped_omega) ** 2 * variance
    psi, sd = np.zeros((n, p), dtype=complex), np.zeros((n, p))
    collinearity, mass = np.ones(n), np.full((n, p), np.nan)
    for k in range(n):
        vector, error, factor = _rank_one(arrangement, scaled[:, k], spread[:, k])
        turned = turn_real(vector)
        largest = int(np.argmax(np.abs(turned)))
        unit = turned / np.abs(turned[largest])
        psi[k] = unit
        sd[k] = np.sqrt(error**2 + np.abs(unit) ** 2 * error[largest] ** 2) / np.abs(
            turned[largest]
        )
        sd[k, largest] = 0.0
        collinearity[k] = phase_collinearity(unit)
        mass[k] = _mass_normalised(
            arrangement, scaled[:, k], spread[:, k], unit.real, vector, factor
        )
    driven = any(a == b for a, b in arrangement.pairs)
    return Shapes(psi, psi.real.copy(), sd, collinearity, mass if driven else None)


def residue_matrix(arrangement: Arrangement, residues: ComplexArray) -> ComplexArray:
    """(p, m) residues of one mode, roving by fixed dof; NaN where that pair was not measured."""
    matrix = np.full((len(arrangement.roving), len(arrangement.fixed)), np.nan, dtype=complex)
    matrix[arrangement.row[:, 0], arrangement.row[:, 1]] = residues
    return matrix


def of_rank_two(
    arrangement: Arrangement, residues: ComplexArray, variance: FloatArray
) -> BoolArray:
    """(n,) whether the residues (N, n) of each pole against several fixed dofs are two shapes: two
    modes at one frequency.
    """
    p, m = len(arrangement.roving), len(arrangement.fixed)
    two = np.zeros(residues.shape[1], dtype=bool)
    measured = {tuple(row) for row in arrangement.row.tolist()}
    if len(arrangement.pairs) != p * m or len(measured) != p * m or min(p, m) < 2:
        return two
    for k in range(two.size):
        singular = np.linalg.svd(residue_matrix(arrangement, residues[:, k]), compute_uv=False)
        # about the largest value of noise alone
        noise = (np.sqrt(p) + np.sqrt(m)) * np.sqrt(np.mean(variance[:, k]))
        two[k] = singular[1] > _ABOVE_NOISE * noise and singular[1] > _SECOND_SHAPE * singular[0]
    return two


def _rank_one(
    arrangement: Arrangement, entries: ComplexArray, variance: FloatArray
) -> tuple[ComplexArray, FloatArray, ComplexArray]:
    """Weighted rank-one fit entries_r ≈ ψ_i l_j (alternating least squares): ψ, its standard
    deviation, and l.
    """
    i, j = arrangement.row.T
    of_roving, of_fixed = (
        np.eye(len(arrangement.roving))[i],
        np.eye(len(arrangement.fixed))[j],
    )  # sum over the entries of a dof
    m, tiny = len(arrangement.fixed), np.finfo(float).tiny
    weight: FloatArray = 1 / np.maximum(variance, 1e-30 * np.max(variance, initial=1e-270))
    strongest = int(np.argmax((np.abs(entries) ** 2 * weight) @ of_fixed))
    factor = np.eye(m, dtype=complex)[strongest]
    if m > 1:  # start: correlate every column with the strongest one over the dofs that they share
        columns = np.nan_to_num(residue_matrix(arrangement, entries))
        known = columns[:, strongest]
        for column, other in enumerate(columns.T):
            shared = np.abs(known) * (other != 0)
            factor[column] = np.vdot(known, other) / np.sum(shared**2) if np.any(shared) else 0.0
    for _ in range(60):  # more change no digit that counts
        information = np.maximum((weight * np.abs(factor[j]) ** 2) @ of_roving, tiny)
        vector = (weight * factor[j].conj() * entries) @ of_roving / information
        if m == 1:  # it sees all dofs alike
            return vector, 1 / np.sqrt(information), factor
        own = (weight * np.abs(vector[i]) ** 2) @ of_fixed
        factor = (weight * vector[i].conj() * entries) @ of_fixed / np.maximum(own, tiny)
        factor /= np.max(np.abs(factor))
    return *_shrunk(vector, information), factor


def _shrunk(vector: ComplexArray, information: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Posterior means and standard deviations of entries whose prior spread is that of the entries
    that are known.

    ψ_i ~ N(0, s²), s² = Σ (w_i|ψ̂_i|² - 1)/Σ w_i with w_i = 1/var ψ̂_i. A dof that only a reference
    near a node sees is noise
    alone: it must not be the largest of the shape.
    """
    power = float(np.sum(information * np.abs(vector) ** 2 - 1) / np.sum(information))
    if power <= 0:
        return vector, 1 / np.sqrt(information)
    total = information + 1 / power
    return np.asarray(vector * information / total), 1 / np.sqrt(total)


def _mass_normalised(
    arrangement: Arrangement,
    entries: ComplexArray,
    variance: FloatArray,
    real: FloatArray,
    vector: ComplexArray,
    factor: ComplexArray,
) -> FloatArray:
    """Shape for unit modal mass, from the strongest driving point; NaN where none is clearly
    positive.
    """
    driving = [r for r, (a, b) in enumerate(arrangement.pairs) if a == b]
    sure = [r for r in driving if entries[r].real > _SURE * np.sqrt(variance[r])]
    if not sure:
        return np.full(real.size, np.nan)
    i, j = arrangement.row[max(sure, key=lambda r: float(entries[r].real))]
    modal = (vector[i] * factor[j]).real  # φ_i² from all data of the mode, not from the one entry
    if modal <= 0 or real[i] == 0:
        return np.full(real.size, np.nan)
    return np.asarray(real * np.sqrt(modal) / abs(real[i]))
