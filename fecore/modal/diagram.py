"""Stabilisation diagram: linear poles of all orders, and which of them come back from order to
order.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.lscf import LinearPoles

FREQUENCY_TOLERANCE = 0.01  # relative, between orders: the usual 1 % of stabilisation diagrams
DAMPING_TOLERANCE = 0.05  # relative, between orders: the usual 5 %


@dataclass(frozen=True)
class Stabilisation:
    """Data of the stabilisation diagram, one entry a pole."""

    order: IntArray  # (k,) model order
    frequency_hz: FloatArray  # (k,) natural frequency
    damping_ratio: FloatArray  # (k,) damping ratio
    frequency_stable: BoolArray  # (k,) True where a lower order has a pole within 1 % in frequency
    damping_stable: BoolArray  # (k,) True where that pole is also within 5 % in damping
    line_hz: FloatArray  # (L,) axis of the indicator
    indicator: FloatArray  # (L,) root of the sum of squares of all FRFs
    cmif: FloatArray  # (c, L) the complex mode indicator function, to be drawn behind the poles


def diagram_of(arrangement: Arrangement, linear: LinearPoles) -> Stabilisation:
    """The diagram of the linear stage's poles, in ascending frequency."""
    at = np.argsort(np.abs(linear.pole), kind="stable")
    order, pole = linear.order[at], linear.pole[at]
    size = np.abs(pole)
    hz, zeta = size / (2 * np.pi), -pole.real / np.maximum(size, np.finfo(float).tiny)
    near, still = np.zeros(hz.size, dtype=bool), np.zeros(hz.size, dtype=bool)
    for below in np.unique(order)[:-1]:
        lower = order == below
        next_above = order == np.min(order[order > below])
        close, alike = _close(hz[next_above], hz[lower], zeta[next_above], zeta[lower])
        near[next_above] |= close
        still[next_above] |= alike
    return Stabilisation(
        order=order,
        frequency_hz=hz,
        damping_ratio=zeta,
        frequency_stable=near,
        damping_stable=still,
        line_hz=arrangement.frequency_hz,
        indicator=np.sqrt(np.sum(np.abs(arrangement.values) ** 2, axis=0)),
        cmif=mode_indicator(arrangement),
    )


def mode_indicator(arrangement: Arrangement) -> FloatArray:
    """(c, L) the largest singular values of H(ω), roving by fixed dofs: as many are large at a line
    as modes are there (complex mode indicator function, Shih et al. 1988). With one fixed dof it is
    the root of the sum of squares. At most three, as of more modes at one frequency nobody reads
    off the number.
    """
    whole = np.zeros(
        (arrangement.frequency_hz.size, len(arrangement.roving), len(arrangement.fixed)),
        dtype=complex,
    )
    whole[:, arrangement.row[:, 0], arrangement.row[:, 1]] = arrangement.values.T
    gram = np.einsum("lpm,lpn->lmn", whole.conj(), whole)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(gram)[:, ::-1][:, :3], 0)).T


def _close(
    hz: FloatArray, below_hz: FloatArray, zeta: FloatArray, below_zeta: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Whether each pole has one of the order below within the tolerance in frequency, and in
    damping as well.
    """
    off = np.abs(hz[:, None] / below_hz - 1) < FREQUENCY_TOLERANCE
    alike = np.abs(zeta[:, None] / below_zeta - 1) < DAMPING_TOLERANCE
    return np.asarray(off.any(axis=1)), np.asarray((off & alike).any(axis=1))
