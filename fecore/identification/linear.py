"""Weighted linear least squares of all FRFs at once, for given poles.

Each FRF i has its own weights w_i² = 1/v_i, so its own normal matrix G_i = Re Φᴴ W_i² Φ. Since all share the basis Φ,
all the G_i come from products of the weights with the line-wise outer products of Φ. Columns are scaled to unit
length in each FRF, which keeps the normal equations well conditioned for distinct poles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import IdentificationError


@dataclass(frozen=True)
class LinearFit:
    """Coefficients of every FRF on one basis.

    Attributes:
        coefficients: (N, q) real coefficients.
        root: (N, q, q) R with RᵀR the inverse normal matrices. What is left of a product after projection on the basis
            keeps twice the digits when it is made from the root.
    """

    coefficients: FloatArray
    root: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        """(N, q, q) covariance of the coefficients for the stated weights."""
        covariance: FloatArray = np.matmul(self.root.transpose(0, 2, 1), self.root)
        return covariance


def fit_linear(basis: ComplexArray, values: ComplexArray, weight: FloatArray) -> LinearFit:
    """Least squares min Σ_l weight_il |values_il - (Φ c_i)_l|² with real c_i, for every FRF i.

    The weight is 2/v for a complex noise of variance v = E|n|² (each of its two parts has v/2), so that the
    inverse normal matrix is the covariance of c.

    Args:
        basis: (L, q) columns Φ.
        values: (N, L) FRFs.
        weight: (N, L) weights, 0 where nothing was measured.

    Raises:
        IdentificationError: the columns are dependent (two poles in one place), or too few lines were measured.
    """
    return solve_normal(normal_matrices(basis, weight), basis, values, weight)


def solve_normal(
    normal: FloatArray, basis: ComplexArray, values: ComplexArray, weight: FloatArray, ridge: float = 0.0
) -> LinearFit:
    """The same where the (N, q, q) normal matrices are known.

    A `ridge` on columns of unit length holds what the data cannot tell at small values.
    """
    right = ((weight * values) @ basis.conj()).real
    scale = np.sqrt(np.einsum("nii->ni", normal))
    if not np.all(scale > 0):
        raise IdentificationError("a term has no weight on the measured lines of an FRF; leave that FRF out")
    unit = normal / (scale[:, :, None] * scale[:, None, :]) + ridge * np.eye(normal.shape[1])
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(unit))
    except np.linalg.LinAlgError:
        raise IdentificationError(
            "the model's terms cannot be told apart on the measured lines: two poles coincide, or there are fewer lines"
            " than unknowns; use fewer poles or a wider band"
        ) from None
    root = inverse / scale[:, None, :]
    return LinearFit(np.einsum("nji,nj->ni", root, np.einsum("nij,nj->ni", root, right)), root)


def normal_matrices(basis: ComplexArray, weight: FloatArray) -> FloatArray:
    """(N, q, q) normal matrices Re Φᴴ W_i² Φ of all FRFs, by matrix products over the lines."""
    q, rows = basis.shape[1], weight.shape[0]
    real, imag = np.ascontiguousarray(basis.real.T), np.ascontiguousarray(basis.imag.T)
    across = np.ascontiguousarray(weight.T)
    normal = np.empty((q, q, rows))
    for i in range(q):  # one row of the matrices at a time: its products stay in the cache
        outer = real[i:] * real[i] + imag[i:] * imag[i]
        normal[i, i:] = outer @ across
        normal[i:, i] = normal[i, i:]
    return np.ascontiguousarray(normal.transpose(2, 0, 1))
