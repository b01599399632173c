"""Stabilisation diagram: poles of all orders, and which of them come back from order to order."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.lscf import lscf
from fecore.identification.noise import rough_variance
from fecore.identification.residues import known_or

FREQUENCY_TOLERANCE = 0.01  # relative, between orders: the usual 1 % of stabilisation diagrams
DAMPING_TOLERANCE = 0.05  # relative, between orders: the usual 5 %


@dataclass(frozen=True)
class Stabilisation:
    """Data of the stabilisation diagram, one entry a pole.

    Attributes:
        order: (k,) model order.
        frequency_hz: (k,) natural frequency.
        damping_ratio: (k,) damping ratio.
        frequency_stable: (k,) True where the next lower order has a pole within 1 % in frequency.
        damping_stable: (k,) True where that pole is also within 5 % in damping.
        line_hz: (L,) axis of the indicator.
        indicator: (L,) root of the sum of squares of all FRFs, to be drawn behind the poles.
    """

    order: IntArray
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    frequency_stable: BoolArray
    damping_stable: BoolArray
    line_hz: FloatArray
    indicator: FloatArray


def stabilise(arrangement: Arrangement, variance: FloatArray, orders: tuple[int, ...]) -> Stabilisation:
    """Poles of the linear stage for all orders.

    With several fixed dofs and all pairs measured the estimate is poly-reference; otherwise all FRFs share one
    denominator.

    Raises:
        IdentificationError: the linear estimate is singular at every order.
    """
    values, measured, spread = _grouped(arrangement, variance)
    found = lscf(arrangement.omega, values, measured, 1 / spread, orders)
    order = found.order.astype(np.int64)
    near = np.zeros(order.size, dtype=bool)
    still = np.zeros(order.size, dtype=bool)
    for low, high in pairwise(orders):
        below, here = np.flatnonzero(order == low), np.flatnonzero(order == high)
        if not below.size or not here.size:
            continue
        off = np.abs(found.frequency_hz[here, None] / found.frequency_hz[below] - 1)
        ratio = np.abs(found.damping_ratio[here, None] / found.damping_ratio[below] - 1)
        near[here] = (off < FREQUENCY_TOLERANCE).any(axis=1)
        still[here] = ((off < FREQUENCY_TOLERANCE) & (ratio < DAMPING_TOLERANCE)).any(axis=1)
    indicator = np.sqrt(np.sum(np.abs(arrangement.values) ** 2, axis=0))
    return Stabilisation(
        order=order,
        frequency_hz=found.frequency_hz,
        damping_ratio=found.damping_ratio,
        frequency_stable=near,
        damping_stable=still,
        line_hz=arrangement.frequency_hz,
        indicator=indicator,
    )


def first_variance(arrangement: Arrangement) -> FloatArray:
    """(N, L) noise variance before any fit: as handed in, else from the records' roughness."""
    return known_or(arrangement, rough_variance(arrangement.values, arrangement.measured))


def _grouped(arrangement: Arrangement, variance: FloatArray) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """(p, m, L) values and marks by roving and fixed dof, (p, L) variance; (N, 1, L) where pairs are missing."""
    p, m = len(arrangement.roving), len(arrangement.fixed)
    floor = np.finfo(float).tiny
    if m == 1 or p * m != len(arrangement.pairs):
        return arrangement.values[:, None], arrangement.measured[:, None], np.maximum(variance, floor)
    place = np.empty((p, m), dtype=np.int64)
    place[arrangement.row[:, 0], arrangement.row[:, 1]] = np.arange(len(arrangement.pairs))
    mean = np.where(arrangement.measured, variance, 0)[place].mean(axis=1)
    return arrangement.values[place], arrangement.measured[place], np.maximum(mean, floor)
