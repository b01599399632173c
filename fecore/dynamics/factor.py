"""The one place that picks the sparse factorisation of a symmetric matrix.

A positive definite matrix with a band (a strip's, whose nodes are numbered across it) goes to
LAPACK's banded Cholesky, a wide one front by front (`multifrontal`) in a minimum degree order.
METIS's order leaves as many entries, and CHOLMOD's wheel is under the GPL.

For n dofs and a band b the banded factor costs about n b² operations and a solve reads n b numbers;
the fronts' factor of these two-dimensional meshes holds about 3.2 n √b numbers, with more overhead.
So the choice, for a factorisation and the forty solves of ten modes, depends on the band alone: ten
modes of a plate take 0.19 s and 0.51 s with a band of 140, 0.42 s and 0.48 s with one of 374.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.dynamics.multifrontal import Elimination, MultifrontalFactor
from fecore.errors import ModelError

_WIDEST_BAND = 350  # beyond this band the sparser factor is as fast, and smaller

# bands that the count of negative pivots takes at a time: longer runs waste more where one ends
# early
_RUN = 4


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
        solution, _ = scipy.linalg.lapack.dpbtrs(self.lower, right, lower=1)
        return np.asarray(solution)

    def colour(self, white: FloatArray) -> FloatArray:
        """L white."""
        band, size = self.lower.shape
        L = scipy.sparse.dia_array((self.lower, -np.arange(band)), shape=(size, size))
        coloured: FloatArray = L @ white
        return coloured


def factorise(matrix: scipy.sparse.csc_array, like: Factor | None = None) -> Factor:
    """Factorise a sparse symmetric positive definite matrix.

    Args:
        matrix: the matrix.
        like: a factor of another matrix, whose order of elimination serves again where their
            patterns are the same.

    Raises:
        ModelError: the matrix is not positive definite.
    """
    below = _below_diagonal(matrix)
    if below.max(initial=0) > _WIDEST_BAND:
        factor = _elimination(matrix, like).factorise(matrix)
        if factor is None:
            raise ModelError(_INDEFINITE)
        return factor
    lower, pivot = scipy.linalg.lapack.dpbtrf(_banded(matrix, below), lower=1, overwrite_ab=1)
    if pivot:
        raise ModelError(_INDEFINITE)
    return BandedFactor(lower)


def negative_eigenvalues(matrix: scipy.sparse.csc_array, like: Factor | None = None) -> int:
    """How many eigenvalues of a sparse symmetric matrix are negative: its negative pivots
    (Sylvester's inertia).

    Args:
        matrix: the matrix.
        like: see `factorise`.

    Raises:
        ModelError: a pivot vanishes.
    """
    below = _below_diagonal(matrix)
    if below.max(initial=0) > _WIDEST_BAND:
        return _elimination(matrix, like).negative_pivots(matrix)
    return _negative_pivots(_banded(matrix, below))


def _elimination(matrix: scipy.sparse.csc_array, like: Factor | None) -> Elimination:
    if isinstance(like, MultifrontalFactor) and like.elimination.suits(matrix):
        return like.elimination
    return Elimination.of(matrix)


_INDEFINITE = "the stiffness is not positive definite: are the supports and the constants right?"


def _below_diagonal(matrix: scipy.sparse.csc_array) -> IntArray:
    """How far below the diagonal each stored entry lies."""
    columns = np.repeat(
        np.arange(matrix.shape[0], dtype=matrix.indices.dtype), np.diff(matrix.indptr)
    )
    below: IntArray = matrix.indices - columns
    return below


def _banded(matrix: scipy.sparse.csc_array, below: IntArray) -> FloatArray:
    """LAPACK's lower banded form: entry (i - j, j) is (i, j) of the matrix. It has a row of zeros
    after the last.

    So it is itself a matrix in compressed columns; what lies above the diagonal falls into the row
    after the last.
    """
    last = int(below.max(initial=0)) + 1
    rows = np.where(below < 0, np.array(last, below.dtype), below)
    shape = (last + 1, matrix.shape[1])
    stored: FloatArray = scipy.sparse.csc_array(
        (matrix.data, rows, matrix.indptr), shape=shape
    ).toarray(order="F")
    stored[-1] = 0
    return stored


def _negative_pivots(stored: FloatArray) -> int:
    """Negative pivots of LDLᵀ without pivoting of a lower banded matrix, which is overwritten.

    LAPACK has no banded LDLᵀ, but Cholesky's method is one as long as the pivots are positive, and
    names the first that is not. So runs of columns are eliminated by it, and the pivots that end
    them one by one.
    """
    width, size = stored.shape
    lower_half = np.tri(width)
    start, negative = 0, 0
    while start < size:
        end = min(start + _RUN * width, size)
        lower, failed = scipy.linalg.lapack.dpbtrf(stored[:, start:end], lower=1)
        if failed:
            end = start + failed - 1
            lower, _ = scipy.linalg.lapack.dpbtrf(stored[:, start:end], lower=1)
        _eliminate(stored, lower, end, lower_half)
        if failed:
            pivot, column = stored[0, end], stored[1 : size - end, end]
            if pivot == 0:
                raise ModelError("a pivot vanishes: modes cannot be counted at a mode")
            _subtract(stored, end + 1, np.outer(column, column / pivot), lower_half)
            negative, end = negative + 1, end + 1
        start = end
    return negative


def _eliminate(stored: FloatArray, lower: FloatArray, end: int, lower_half: FloatArray) -> None:
    """Take what the columns before `end`, whose factor's last columns are in `lower`, leave to the
    ones after it.
    """
    band, known = stored.shape[0] - 1, min(stored.shape[0] - 1, lower.shape[1])
    left = min(band, stored.shape[1] - end)
    if left and known:
        own = _dense(lower, lower.shape[1] - known, lower.shape[1] - known, (known, known))
        below = (
            _dense(stored, end, end - known, (left, known))
            * lower_half[band - known : band, :left].T
        )
        solved = scipy.linalg.lapack.dtrtrs(own, below.T, lower=1)[0]
        _subtract(stored, end, solved.T @ solved, lower_half)


def _dense(stored: FloatArray, row: int, column: int, shape: tuple[int, int]) -> FloatArray:
    """A block of a lower banded matrix, which lies in memory like one of a full matrix of b rows.

    What lies outside the band, or above the diagonal, has no meaning.
    """
    band, item = stored.shape[0] - 1, stored.itemsize
    return np.ndarray(
        shape, stored.dtype, stored.T, (row + column * band) * item, (item, band * item)
    )


def _subtract(stored: FloatArray, first: int, block: FloatArray, lower_half: FloatArray) -> None:
    """Subtract a symmetric block of no more rows than the band from a lower banded matrix, from the
    diagonal entry `first`.
    """
    if len(block):
        _dense(stored, first, first, block.shape)[...] -= (
            block * lower_half[: len(block), : len(block)]
        )
