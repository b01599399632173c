"""The one place that picks the sparse factorisation of a symmetric matrix.

A positive definite matrix with a narrow band (a strip's, whose nodes are numbered across it) goes to LAPACK's banded
Cholesky, a wide one to SuperLU in symmetric mode with a minimum degree ordering. Both come with SciPy. CHOLMOD was
measured against them (`python -m benchmarks forward`): it is no faster on a strip, and its wheel is under the GPL.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import sparse
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse.linalg import SuperLU, splu

from fecore.arrays import FloatArray, IntArray
from fecore.errors import ModelError

_WIDEST_BAND = 200  # beyond this band SuperLU's sparser factor is the faster one (benchmark `forward`)

_NARROW_BAND = 80


class Factor(Protocol):
    """A factorised symmetric positive definite matrix A."""

    def solve(self, right: FloatArray) -> FloatArray:
        """A⁻¹ right, of (n,) or (n, r)."""
        ...

    def colour(self, white: FloatArray) -> FloatArray:
        """L white with LLᵀ = A: of independent unit normals it makes vectors of covariance A."""
        ...


@dataclass(frozen=True)
class BandedFactor:
    """Cholesky factor in LAPACK's lower banded form: row d holds the d-th subdiagonal."""

    lower: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        """A⁻¹ right."""
        solution: FloatArray = cho_solve_banded((self.lower, True), right, check_finite=False)
        return solution

    def colour(self, white: FloatArray) -> FloatArray:
        """L white."""
        band, size = self.lower.shape
        L = sparse.dia_array((self.lower, -np.arange(band)), shape=(size, size))
        coloured: FloatArray = L @ white
        return coloured


@dataclass(frozen=True)
class SparseFactor:
    """SuperLU's factor of a symmetric matrix without pivoting: PAPᵀ = LDLᵀ."""

    factor: SuperLU

    def solve(self, right: FloatArray) -> FloatArray:
        """A⁻¹ right."""
        solution: FloatArray = self.factor.solve(np.ascontiguousarray(right))
        return solution

    def colour(self, white: FloatArray) -> FloatArray:
        """Pᵀ L D^½ white."""
        pivots = self.factor.U.diagonal()
        permuted = self.factor.L @ (np.sqrt(pivots)[:, None] * white)
        coloured: FloatArray = permuted[self.factor.perm_c]
        return coloured


def factorise(matrix: sparse.csc_array) -> Factor:
    """Factorise a sparse symmetric positive definite matrix.

    Raises:
        ModelError: the matrix is not positive definite.
    """
    columns, below, band = _band(matrix)
    if band > _WIDEST_BAND:
        lu = _symmetric_lu(matrix)
        if np.any(lu.U.diagonal() <= 0):
            raise ModelError(_INDEFINITE)
        return SparseFactor(lu)
    stored = np.zeros((band + 1, matrix.shape[0]), order="F")
    kept = below >= 0
    stored[below[kept], columns[kept]] = matrix.data[kept]
    try:
        return BandedFactor(cholesky_banded(stored, overwrite_ab=True, lower=True, check_finite=False))
    except LinAlgError as error:
        raise ModelError(_INDEFINITE) from error


def negative_eigenvalues(matrix: sparse.csc_array) -> int:
    """How many eigenvalues of a sparse symmetric matrix are negative: its negative pivots (Sylvester's inertia).

    Raises:
        ModelError: a pivot vanishes.
    """
    return int(np.sum(_symmetric_lu(matrix).U.diagonal() < 0))


_INDEFINITE = "the stiffness is not positive definite: are the supports and the constants right?"


def _band(matrix: sparse.csc_array) -> tuple[IntArray, IntArray, int]:
    """Column of each stored entry, how far below the diagonal it lies, and the furthest."""
    columns = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    below = matrix.indices - columns
    return columns, below, int(below.max(initial=0))


def _symmetric_lu(matrix: sparse.csc_array) -> SuperLU:
    """Without pivoting, so that the signs of the pivots give the inertia."""
    options = {"SymmetricMode": True}
    # In a narrow band there is little to gain by an ordering, which costs a third of the time.
    ordering = "NATURAL" if _band(matrix)[2] <= _NARROW_BAND else "MMD_AT_PLUS_A"
    try:
        return splu(sparse.csc_matrix(matrix), permc_spec=ordering, diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:
        raise ModelError(f"{_INDEFINITE} ({error})") from error
