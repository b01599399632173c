"""How far two close modes may be mixed, and what that does to their shares of strain energy.

Where two modes veer, what the model misses by a per mille turns their shapes into each other. With
a perturbation δ of K - λM and h = φ_jᵀδφ_k the modes of the body are the model's, turned by the
angle α of

    sin 2α = 2h/(λ_k - λ_j),     h ~ N(0, σ_h²),     |α| < 45°, beyond which they would be paired the other way,

with the measured eigenvalues, and they share their energies U_jk = φ_jᵀK_mφ_k/√(λ_jλ_k) in every
mechanism m:

    U_j' = U_jj cos² α + U_kk sin² α + U_jk sin 2α,     U_k' = U_jj sin² α + U_kk cos² α - U_jk sin 2α.

σ_h has two parts: what the constants' posterior leaves open, gᵀCg with g = φ_jᵀ(∂K - λ∂M)φ_k, and
the model's discrepancy s of a frequency, √2 s λ: the entries off the diagonal of a symmetric random
matrix have half the variance of those on it (Mehta, Random Matrices, 3rd ed., 2). Measured shapes ψ
say more: their mean square off the turned ones is that of a model's shape, 1 % of the largest
entry, and counts once a mode, as its errors at the points are not independent.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.dynamics.sensitivity import mode_forms
from fecore.updating.posterior import SHAPE_DISCREPANCY
from fecore.updating.state import ForwardState

_SINES = np.linspace(-1, 1, 41)  # of 2α


@dataclass(frozen=True)
class Mixing:
    """Two modes that may be mixed."""

    rows: tuple[int, ...]  # of the measured modes, one or both
    change: FloatArray  # (a, rows, q) changes of their shares of strain energy, by angle
    cost: FloatArray  # (a,) of each angle: -2 ln p, 0 of the model's own shapes


def mixings(
    state: ForwardState,
    columns: Sequence[int],
    hz: FloatArray,
    shapes: FloatArray | None,
    discrepancy: float,
    covariance: FloatArray,
) -> tuple[Mixing, ...]:
    """The pairs of modes that may be mixed by more than the angles' grid resolves.

    Args:
        state: the updated model.
        columns: (n,) elastic modes that were measured.
        hz: (n,) their measured frequencies, Hz.
        shapes: (n, points) their realised measured shapes, at the first of the model's points.
        discrepancy: relative standard deviation of a frequency of the model.
        covariance: (p, p) posterior covariance of θ.
    """
    rigid, c = state.modes.rigid, state.coefficients
    value = (2 * np.pi * state.frequency_hz) ** 2
    measured = value.copy()
    measured[list(columns)] = (2 * np.pi * hz) ** 2
    stiffness = mode_forms(state.modes, state.stiffness, c.stiffness_by)
    mass = mode_forms(state.modes, state.mass, c.mass_by)
    mean = (measured[:, None] + measured) / 2
    by = stiffness[:, rigid:, rigid:] - mean * mass[:, rigid:, rigid:]
    sd = np.sqrt(np.einsum("pjk,pq,qjk->jk", by, covariance, by) + 2 * (discrepancy * mean) ** 2)
    with np.errstate(divide="ignore"):
        spread = 2 * sd / np.abs(measured[:, None] - measured)
    energy = state.energy_forms[:, rigid:, rigid:] / np.sqrt(value[:, None] * value)
    pairs = []
    for number, j in enumerate(columns):
        for k in range(value.size):
            if spread[j, k] > _SINES[1] - _SINES[0] and (k > j or (k < j and k not in columns)):
                rows = (number, columns.index(k)) if k in columns else (number,)
                cost = (_SINES / spread[j, k]) ** 2
                if shapes is not None:
                    cost = cost + _off(state.shapes[[j, k], : shapes.shape[1]], shapes[list(rows)])
                pairs.append(Mixing(rows, _change(energy, j, k)[:, : len(rows)], cost - cost.min()))
    return tuple(pairs)


def _change(energy: FloatArray, j: int, k: int) -> FloatArray:
    """(a, 2, q) changes of the shares of two modes, by angle."""
    sine = _SINES[:, None]
    moved = (1 - np.sqrt(1 - sine**2)) / 2 * (energy[:, k, k] - energy[:, j, j]) + sine * energy[
        :, j, k
    ]
    return np.stack([moved, -moved], axis=1)


def _off(pair: FloatArray, measured: FloatArray) -> FloatArray:
    """(a,) -2 ln p of one or both of (2, points) shapes, as they were measured, by the angle that
    turns them.
    """
    cosine, sine = np.cos(np.arcsin(_SINES) / 2), np.sin(np.arcsin(_SINES) / 2)
    turned = np.array([[cosine, sine], [-sine, cosine]]).transpose(2, 0, 1) @ pair
    turned = turned[:, : len(measured)]
    unit = measured / np.abs(measured).max(axis=1, keepdims=True)
    along = np.sum(turned * unit, axis=2) ** 2 / np.sum(turned**2, axis=2)
    return np.asarray(
        np.sum(np.sum(unit**2, axis=1) - along, axis=1) / measured.shape[1] / SHAPE_DISCREPANCY**2
    )
