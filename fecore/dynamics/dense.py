"""Small dense symmetric matrices, such as those of a reduced system: factorised, and their largest
eigenpairs.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.errors import ModelError


@dataclass(frozen=True)
class DenseFactor:
    """Cholesky factorisation of a small matrix, made when it is first used."""

    matrix: FloatArray

    @cached_property
    def _cholesky(self) -> tuple[FloatArray, bool]:
        factor: tuple[FloatArray, bool] = scipy.linalg.cho_factor(self.matrix, lower=True)
        return factor

    def solve(self, right: FloatArray) -> FloatArray:
        """A⁻¹ right."""
        solution: FloatArray = scipy.linalg.cho_solve(self._cholesky, right)
        return solution

    def colour(self, white: FloatArray) -> FloatArray:
        """L white."""
        coloured: FloatArray = np.tril(self._cholesky[0]) @ white
        return coloured


def largest_eigenpairs(A: FloatArray, B: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """The `count` largest eigenvalues of A x = ν B x, descending, and their vectors, xᵀBx = 1.

    Args:
        A: (n, n) symmetric.
        B: (n, n) symmetric, positive definite.
        count: how many, at most n.

    Raises:
        ModelError: B is not positive definite.
    """
    L, fault = scipy.linalg.lapack.dpotrf(B, lower=1)
    if fault:
        raise ModelError("the reduced stiffness is not positive definite: are the constants right?")
    solve = scipy.linalg.blas.dtrsm  # dsygst takes twice as long
    C = solve(1.0, L, solve(1.0, L, A, lower=1), side=1, lower=1, trans_a=1)
    value, vectors = _by_inverse_iteration(C, count) or np.linalg.eigh(C)
    vectors, _ = scipy.linalg.lapack.dtrtrs(L, vectors[:, ::-1][:, :count], lower=1, trans=1)
    return value[::-1][:count], vectors


def _by_inverse_iteration(C: FloatArray, count: int) -> tuple[FloatArray, FloatArray] | None:
    """All eigenvalues of C, of which the lower triangle is used, and the vectors of the `count`
    largest; ascending.

    LAPACK's own drivers for some eigenpairs find eigenvalues by bisection. For some tens of rows it
    takes half the time to find all of them by the root-free QR method, and the wanted vectors by
    inverse iteration. None where that fails.
    """
    size = len(C)
    if size < 3:
        return None
    reflectors, diagonal, beside, scale, _ = scipy.linalg.lapack.dsytrd(C, lower=1)
    value, unconverged = scipy.linalg.lapack.dsterf(diagonal, beside)
    one_block = np.ones(size, dtype=np.int32), np.full(size, size, dtype=np.int32)
    vectors, failed = scipy.linalg.lapack.dstein(
        diagonal, beside, value[size - count :], *one_block
    )
    if unconverged or failed:
        return None
    vectors[1:], _, _ = scipy.linalg.lapack.dormqr(
        "L", "N", reflectors[1:, :-1], scale, vectors[1:], 64 * count
    )
    return value, vectors
