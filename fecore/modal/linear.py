"""Weighted linear least squares of all FRFs at once, for given poles, that dependent columns cannot
spoil.

Each FRF i has its own weights w_i² = 1/v_i, so its own normal matrix G_i = Re Φᴴ W_i² Φ. Normal
matrices square the condition number of Φ. Therefore Φ is first made orthonormal under the weights'
mean over the FRFs, Φ = Q T⁻¹, by the singular value decomposition of its scaled columns: what is
left of G_i is as well conditioned as the FRFs' weights are alike, and a direction of the
coefficients that the lines do not determine (a singular value below round-off) is left out, so that
it is 0 in the solution and touches no other coefficient.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, real_times
from fecore.errors import IdentificationError

# of the largest singular value: below it a direction of the scaled coefficients is round-off
_NULL = 1e-9


@dataclass(frozen=True)
class LinearFit:
    """Coefficients of every FRF on one basis."""

    coefficients: FloatArray  # (N, q) real coefficients
    frame: ComplexArray  # (L, r) the basis made orthonormal, r <= q
    turn: FloatArray  # (q, r) coefficients of the basis from those of the frame
    # (N, r, r) R with RᵀR the inverse normal matrices of the frame. What is left of a product after
    # projection keeps twice the digits when it is made from the root.
    root: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        """(N, q, q) covariance of the coefficients for the stated weights."""
        lever = np.matmul(self.root, self.turn.T)
        covariance: FloatArray = np.matmul(lever.transpose(0, 2, 1), lever)
        return covariance


def orthonormal(basis: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """The basis made orthonormal under the mean weight, (L, r), and (q, r) what makes it so; null
    directions are left out.
    """
    root = mean_weight(weight)
    scaled = stacked(basis, root)
    length = np.linalg.norm(scaled, axis=0)
    length = np.where(length > 0, length, 1.0)
    triangle = np.linalg.qr(scaled / length, mode="r")
    _, singular, right = np.linalg.svd(triangle)
    singular, right = singular[: len(right)], right[: singular.size]
    kept = singular > _NULL * singular.max(initial=0.0)
    turn = (right[kept] / singular[kept, None]).T / length[:, None]
    return real_times(turn.T, basis.T).T, np.asarray(turn)


def stacked(basis: ComplexArray, root: FloatArray) -> FloatArray:
    """(2L, q) real above imaginary parts of columns, weighted by (L,)."""
    return np.concatenate([basis.real * root[:, None], basis.imag * root[:, None]])


def mean_weight(weight: FloatArray) -> FloatArray:
    """(L,) root of the mean over the FRFs of their weights, each FRF's scaled to mean 1."""
    level = weight.mean(axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.mean(weight / np.where(level > 0, level, 1.0), axis=0)))


def solve_normal(
    normal: FloatArray,
    frame: ComplexArray,
    turn: FloatArray,
    values: ComplexArray,
    weight: FloatArray,
) -> LinearFit:
    """The coefficients where the (N, r, r) normal matrices of the orthonormal frame are known.

    Raises:
        IdentificationError: an FRF has fewer measured lines than unknowns.
    """
    right = real_part(weight * values, frame.T)
    scale = np.sqrt(np.einsum("nii->ni", normal))
    if not np.all(scale > 0):
        raise IdentificationError(
            "a term has no weight on the measured lines of an FRF; leave that FRF out"
        )
    unit = normal / (scale[:, :, None] * scale[:, None, :])
    if proportional(weight) is not None:
        unit = unit[:1]
    try:
        inverse: FloatArray = np.asarray(np.linalg.inv(np.linalg.cholesky(unit)), dtype=np.float64)
    except np.linalg.LinAlgError:
        inverse = _roots(unit)
    root = np.asarray(np.broadcast_to(inverse, normal.shape)) / scale[:, None, :]
    solved = np.einsum("nji,nj->ni", root, np.einsum("nij,nj->ni", root, right))
    return LinearFit(solved @ turn.T, frame, turn, root)


def _roots(normal: FloatArray) -> FloatArray:
    """(N, r, r) R with RᵀR the inverse of each matrix on the directions that it determines, 0 on
    the others.
    """
    value, vector = np.linalg.eigh(normal)
    floor = _NULL * value[:, -1:]
    inverse = np.where(value > floor, 1 / np.sqrt(np.where(value > floor, value, 1.0)), 0.0)
    return np.asarray(inverse[:, :, None] * vector.transpose(0, 2, 1))


def normal_columns(basis: ComplexArray, weight: FloatArray, first: int = 0) -> FloatArray:
    """(N, q, q - first) the columns, from the `first` on, of the normal matrices Re Φᴴ W_i² Φ of
    all FRFs.
    """
    q, rows = basis.shape[1], weight.shape[0]
    if (share := proportional(weight)) is not None:
        both = np.concatenate([basis.real, basis.imag]) * np.sqrt(np.tile(weight[0], 2))[:, None]
        return np.asarray(share[:, None, None] * (both.T @ both[:, first:]))
    real, imag = np.ascontiguousarray(basis.real.T), np.ascontiguousarray(basis.imag.T)
    across = np.ascontiguousarray(weight.T)
    normal = np.empty((q, q - first, rows))
    for i in range(q):  # one row of the matrices at a time: its products stay in the cache
        start = max(i, first)
        outer = real[start:] * real[i] + imag[start:] * imag[i]
        normal[i, start - first :] = outer @ across
        if i >= first:
            normal[i:, i - first] = normal[i, i - first :]
    return np.ascontiguousarray(normal.transpose(2, 0, 1))


def real_part(rows: ComplexArray, others: ComplexArray) -> FloatArray:
    """(n, m) Re Y Zᴴ of (n, L) Y and (m, L) Z, as one real product."""
    own, other = (np.ascontiguousarray(each).view(np.float64) for each in (rows, others))
    product: FloatArray = own @ other.T
    return product


def proportional(weight: FloatArray) -> FloatArray | None:
    """(N,) the FRFs' weights over those of the first, where these are one function of frequency but
    for a factor.
    """
    share: FloatArray = weight.sum(axis=1) / weight[0].sum()
    return share if np.allclose(weight, share[:, None] * weight[0], rtol=1e-9, atol=0) else None
