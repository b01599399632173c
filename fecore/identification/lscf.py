"""Linear stage: poly-reference least-squares complex frequency (p-LSCF) estimates.

The FRFs of roving dof o against the m fixed dofs are written as a right matrix fraction in z = exp(iωT),

    H_o(z) = (Σ_r β_or z^r) (Σ_r α_r z^r)⁻¹,    β_or (1, m), α_r (m, m), r = 0 … n,

and Σ_r β_or z^r - H_o Σ_r α_r z^r is made small in the weighted least-squares sense (Guillaume, Verboven and
Vanlanduit 1998; Peeters, Van der Auweraer, Guillaume and Leuridan 2004). The β_or are eliminated, the α_n is the unit
matrix, and the poles are the eigenvalues of the companion matrix of the α. With one fixed dof this is the
common-denominator LSCF. All inner products are Toeplitz in r, so they are moments Σ_l w² (...) z^k: one matrix
product, even on an uneven axis and with missing lines.

The estimate is linear but biased by noise, badly so for a heavily damped mode. It is a start for the refinement and
the stuff of the stabilisation diagram, nothing more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError

_ZOOM_FROM = 0.25  # a band that starts above this share of its end is mapped to the whole circle, with complex α


@dataclass(frozen=True)
class Orders:
    """Poles of every model order, one entry a pole.

    Attributes:
        order: (k,) model order.
        frequency_hz: (k,) undamped natural frequency, Hz.
        damping_ratio: (k,) damping ratio, above 0 and below 1.
    """

    order: IntArray
    frequency_hz: FloatArray
    damping_ratio: FloatArray


@dataclass(frozen=True)
class _Moments:
    """Normal matrices of the largest order for every output: R (o, P, P), S (o, P, mP), T (mP, mP), P = order + 1."""

    R: FloatArray | ComplexArray
    S: FloatArray | ComplexArray
    T: FloatArray | ComplexArray


def lscf(
    omega: FloatArray, values: ComplexArray, measured: BoolArray, weight: FloatArray, orders: tuple[int, ...]
) -> Orders:
    """Poles for every order.

    Args:
        omega: (L,) circular frequencies, rad/s.
        values: (p, m, L) FRFs of p roving against m fixed dofs.
        measured: (p, m, L) where they were measured; a line of a roving dof counts where all m are.
        weight: (p, L) weights w².
        orders: ascending model orders n; each has n·m poles.

    Raises:
        IdentificationError: the normal equations are singular at every order.
    """
    low, high = float(omega[0]), float(omega[-1])
    zoom = low > _ZOOM_FROM * high
    shift = low if zoom else 0.0
    period = 2 * np.pi * 0.95 / (high - low) if zoom else np.pi / high
    whole = np.where(measured.all(axis=1), weight, 0.0)
    alive = whole.any(axis=1)
    moments = _moments(values[alive], whole[alive], np.exp(1j * (omega - shift) * period), orders[-1], zoom)
    found: list[tuple[FloatArray, FloatArray, int]] = []
    for order in orders:
        z = _poles_of_order(moments, order, values.shape[1])
        if z is None:
            continue
        turned = np.log(z)
        # The band lies on 0 to 1.9 π of the circle: what the logarithm gives below it belongs to the upper half.
        if zoom:
            turned = np.where(turned.imag < -0.05 * np.pi, turned + 2j * np.pi, turned)
        s = turned / period + 1j * shift
        frequency, zeta = np.abs(s) / (2 * np.pi), -s.real / np.abs(s)
        keep = (s.imag > 0) & (zeta > 0) & (zeta < 1)
        found.append((frequency[keep], zeta[keep], order))
    if not found:
        raise IdentificationError("the linear estimate is singular at every order; use more lines or a lower order")
    return Orders(
        np.concatenate([np.full(f.size, n, dtype=np.int64) for f, _, n in found]),
        np.concatenate([f for f, _, _ in found]),
        np.concatenate([zeta for _, zeta, _ in found]),
    )


def _moments(values: ComplexArray, weight: FloatArray, z: ComplexArray, order: int, zoom: bool) -> _Moments:
    p, m, lines = values.shape
    size = order + 1
    forward = np.cumprod(np.concatenate([np.ones((lines, 1)), np.repeat(z[:, None], order, axis=1)], axis=1), axis=1)
    lags = np.concatenate([forward[:, :0:-1].conj(), forward], axis=1)  # z^-order … z^order
    one = weight @ lags
    weighted = weight[:, None, :] * values
    cross = weighted.reshape(p * m, lines) @ lags
    power = np.einsum("oil,ojl->ijl", weighted.conj(), values).reshape(m * m, lines) @ lags
    R = np.stack([_toeplitz(c, order) for c in one])
    S = np.stack([_toeplitz(c, order) for c in cross]).reshape(p, m, size, size)
    T = np.stack([_toeplitz(c, order) for c in power]).reshape(m, m, size, size)
    by_power = -S.transpose(0, 2, 3, 1).reshape(p, size, size * m)  # columns ordered (power s, fixed dof j)
    square = T.transpose(2, 0, 3, 1).reshape(size * m, size * m)
    return _Moments(R, by_power, square) if zoom else _Moments(R.real, by_power.real, square.real)


def _toeplitz(moment: ComplexArray, order: int) -> ComplexArray:
    """Matrix [r, s] = moment of z^(s - r), from moments of z^-order … z^order."""
    return np.asarray(scipy.linalg.toeplitz(moment[order::-1], moment[order:]))


def _poles_of_order(moments: _Moments, order: int, m: int) -> ComplexArray | None:
    """Eigenvalues of the companion matrix with α_order = 1, or None where the equations are singular."""
    size = order + 1
    R, S = moments.R[:, :size, :size], moments.S[:, :size, : size * m]
    try:
        eliminated = np.matmul(S.conj().transpose(0, 2, 1), np.linalg.solve(R, S)).sum(axis=0)
        M = moments.T[: size * m, : size * m] - eliminated
        alpha = -np.linalg.solve(M[: order * m, : order * m], M[: order * m, order * m :])
    except np.linalg.LinAlgError:
        return None
    companion = np.zeros((order * m, order * m), dtype=alpha.dtype)
    companion[m:, : (order - 1) * m] = np.eye((order - 1) * m)
    companion[:, (order - 1) * m :] = -alpha
    z = np.linalg.eigvals(companion)
    z = z[np.abs(z) > np.finfo(float).tiny]
    return np.asarray(z, dtype=complex) if np.all(np.isfinite(z)) else None
