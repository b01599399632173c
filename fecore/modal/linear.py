"""Weighted linear least squares of all FRFs at once, for given poles, that dependent columns cannot
spoil.

Each FRF i has its own weights w_i² = 1/v_i, so its own normal matrix G_i = Re Φᴴ W_i² Φ. Normal
matrices square the condition number of Φ. Therefore Φ is first made orthonormal under the weights'
mean over the FRFs, Φ = Q T⁻¹: what is left of G_i is as well conditioned as the FRFs' weights are
alike, and a direction of the coefficients that the lines do not determine (a singular value of the
scaled columns below round-off) is left out, so that it is 0 in the solution and touches no other
coefficient.

Where the weights are one function of frequency but for a factor, w_i² = a_i p, every G_i is a_i, and
an FRF with gaps g has a_i (1 - Q_gᵀQ_g), whose inverse is (1 + Q_gᵀS⁻¹Q_g)/a_i, S = 1 - Q_g Q_gᵀ of
the gaps' size.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray, real_times
from fecore.errors import IdentificationError
from fecore.modal.noise import WHOLE

# of the largest singular value: below it a direction of the scaled coefficients is round-off
_NULL = 1e-9
_CLEAR = 1e-4  # singular value of scaled columns over the largest, from which products keep 1e-8


@dataclass(frozen=True)
class Weights:
    """What each value of the FRFs counts."""

    each: FloatArray  # (N, L) 2/v of each complex value, 0 where nothing was measured
    # (N,) of each FRF, where all have one function of frequency but for this factor and few gaps
    share: FloatArray | None
    root: FloatArray  # (L,) of the weights' mean over the FRFs, see `mean_weight`
    gaps: tuple[tuple[int, IntArray], ...] = ()  # number and missing lines of FRFs with a share

    @classmethod
    def of(cls, variance: FloatArray, measured: BoolArray) -> "Weights":
        """The weights for a variance (N, L) of the values that were measured."""
        whole = 2 / np.maximum(variance, np.finfo(float).tiny)
        each = np.where(measured, whole, 0.0)
        if measured.mean(axis=1).min() < WHOLE or (share := proportional(whole)) is None:
            return cls(each, None, mean_weight(each))
        level = whole[0].mean()
        gaps = tuple(
            (int(i), np.flatnonzero(~measured[i])) for i in np.flatnonzero(~measured.all(1))
        )
        return cls(each, share * level, np.sqrt(whole[0] / level), gaps)


@dataclass(frozen=True)
class LinearFit:
    """Coefficients of every FRF on one basis."""

    coefficients: FloatArray  # (N, q) real coefficients
    basis: ComplexArray  # (L, q)
    turn: FloatArray  # (q, r) coefficients of the basis from those of the frame
    # (N, r, r) R with RᵀR the inverse normal matrices of the frame; (1, r, r) where these are alike
    # but for the share. What is left of a product after projection keeps twice the digits when it
    # is made from the root.
    root: FloatArray
    share: FloatArray  # (N,) by which the normal matrices are larger than R says

    @cached_property
    def frame(self) -> ComplexArray:
        """(L, r) the basis made orthonormal, r <= q."""
        return real_times(self.turn.T, self.basis.T).T

    @cached_property
    def spread(self) -> FloatArray:
        """(N, q, q), or (1, q, q), covariance of the coefficients for the stated weights, times the
        share.
        """
        lever = np.matmul(self.root, self.turn.T)
        spread: FloatArray = np.matmul(lever.transpose(0, 2, 1), lever)
        return spread

    @property
    def variance(self) -> FloatArray:
        """(N, q) variance of the coefficients for the stated weights."""
        return np.asarray(np.einsum("nii->ni", self.spread) / self.share[:, None])


def whitening(scaled: FloatArray) -> FloatArray:
    """(q, r) what makes weighted real columns (2L, q) orthonormal; null directions are left out.

    From their products where these keep the digits, else from the columns themselves.
    """
    products = scaled.T @ scaled
    length = np.sqrt(np.diag(products))
    length = np.where(length > 0, length, 1.0)
    triangle, fault = scipy.linalg.lapack.dpotrf(products / length / length[:, None])
    if fault or scipy.linalg.lapack.dtrcon(triangle)[0] < _CLEAR:
        triangle = np.linalg.qr(scaled / length, mode="r")
        _, singular, right = np.linalg.svd(triangle)
        singular, right = singular[: len(right)], right[: singular.size]
        kept = singular > _NULL * singular.max(initial=0.0)
        return np.asarray((right[kept] / singular[kept, None]).T / length[:, None])
    return np.asarray(scipy.linalg.lapack.dtrtri(triangle)[0] / length[:, None])


def orthonormal(basis: ComplexArray, root: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """The basis made orthonormal under the square of a weight (L,), as (L, r), and (q, r) what makes
    it so; null directions are left out.
    """
    turn = whitening(stacked(basis, root))
    return real_times(turn.T, basis.T).T, turn


def stacked(basis: ComplexArray, root: FloatArray) -> FloatArray:
    """(2L, q) real above imaginary parts of columns, weighted by (L,)."""
    return np.concatenate([basis.real * root[:, None], basis.imag * root[:, None]])


def mean_weight(weight: FloatArray) -> FloatArray:
    """(L,) root of the mean over the FRFs of their weights, each FRF's scaled to mean 1."""
    level = weight.mean(axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.mean(weight / np.where(level > 0, level, 1.0), axis=0)))


def solved(basis: ComplexArray, values: ComplexArray, weights: Weights) -> LinearFit:
    """The coefficients of all FRFs (N, L) on a basis (L, q).

    Raises:
        IdentificationError: an FRF has fewer measured lines than unknowns.
    """
    turn = whitening(stacked(basis, weights.root))
    if weights.share is not None:
        return _alike(basis, turn, values, weights)
    frame = real_times(turn.T, basis.T).T
    right = real_part(weights.each * values, frame.T)
    normal = normal_columns(frame, weights.each)
    scale = np.sqrt(np.einsum("nii->ni", normal))
    _check_weight(scale)
    unit = normal / (scale[:, :, None] * scale[:, None, :])
    try:
        inverse: FloatArray = np.asarray(np.linalg.inv(np.linalg.cholesky(unit)), dtype=np.float64)
    except np.linalg.LinAlgError:
        inverse = _roots(unit)
    root = inverse / scale[:, None, :]
    found = np.matmul(root.transpose(0, 2, 1), np.matmul(root, right[:, :, None]))[:, :, 0]
    return LinearFit(found @ turn.T, basis, turn, root, np.ones(len(values)))


def _alike(
    basis: ComplexArray, turn: FloatArray, values: ComplexArray, weights: Weights
) -> LinearFit:
    """The same where the weights are alike but for a share; gaps count in the coefficients alone,
    not in their covariance.
    """
    assert weights.share is not None
    _check_weight(weights.share)
    masked = values * weights.root**2
    for row, lines in weights.gaps:
        masked[row, lines] = 0.0
    found = real_part(masked, basis.T) @ turn
    for row, lines in weights.gaps:
        own = stacked(basis[lines], weights.root[lines]) @ turn
        found[row] += own.T @ (_without(own) @ (own @ found[row]))
    return LinearFit(found @ turn.T, basis, turn, np.eye(turn.shape[1])[None], weights.share)


def _check_weight(size: FloatArray) -> None:
    if not np.all(size > 0):
        raise IdentificationError(
            "a term has no weight on the measured lines of an FRF; leave that FRF out"
        )


def _without(own: FloatArray) -> FloatArray:
    """S⁻¹ of the rows of an orthonormal frame at the gaps of an FRF."""
    return np.asarray(np.linalg.pinv(np.eye(len(own)) - own @ own.T, _NULL, hermitian=True))


def missing_slopes(
    frame: ComplexArray, steep: ComplexArray, root: FloatArray, lines: IntArray
) -> FloatArray:
    """(k, p) F with FᵀF what gaps take of the products of columns less their projection on the
    frame.
    """
    own = stacked(frame[lines], root[lines])
    return np.asarray(np.linalg.cholesky(_without(own)).T @ stacked(steep[lines], root[lines]))


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
    expected = share[:, None] * weight[0]
    return share if np.all(np.abs(weight - expected) <= 1e-9 * expected) else None
