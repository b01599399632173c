"""The linear stage: poles over many orders, and those of them from which the search chooses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.stabilisation import Stabilisation, first_variance, stabilise

_BEYOND = np.array([1.02, 1.06, 1.12, 1.2, 1.35, 1.6])  # candidate frequencies above the band, in its end
_BELOW = np.array([0.5, 0.8, 0.95])  # ... and below it, in its start
_LOOK_BACK = 40  # poles of lower frequency that a candidate is compared with
_WIDTHS = np.array([0.01, 0.03, 0.1])


@dataclass(frozen=True)
class LinearStage:
    """The stabilisation diagram of FRFs, with the variance of each line that it was made with.

    Attributes:
        diagram: poles of all orders.
        variance: (N, L) of the FRFs' errors, as first supposed.
        pool: (c,) frequencies in Hz and (c,) damping ratios of the candidates.
    """

    diagram: Stabilisation
    variance: FloatArray
    pool: tuple[FloatArray, FloatArray]


def linear_stage(arrangement: Arrangement, highest_order: int) -> LinearStage:
    """Poles of orders up to a highest one, and the candidates among them."""
    variance = first_variance(arrangement)
    diagram = stabilise(arrangement, variance, _orders(arrangement, highest_order))
    return LinearStage(diagram, variance, _candidates(arrangement, diagram))


def _orders(arrangement: Arrangement, highest: int) -> tuple[int, ...]:
    """Orders of the linear stage: with m fixed dofs each order has m poles, and a line can carry half an unknown."""
    p, m = len(arrangement.roving), len(arrangement.fixed)
    shared = m if m > 1 and p * m == len(arrangement.pairs) else 1
    top = min(max(6, 2 * highest // (shared + 1)), int(arrangement.measured.sum(axis=1).min()) // 3)
    return tuple(range(2, max(top, 3) + 1))


def _candidates(arrangement: Arrangement, diagram: Stabilisation) -> tuple[FloatArray, FloatArray]:
    """Poles of every fourth and of the highest two orders, once each, and a few beyond the band."""
    top = int(diagram.order.max())
    keep = (diagram.order % 4 == 0) | (diagram.order >= top - 1)
    high, low = arrangement.frequency_hz[-1] * _BEYOND, arrangement.frequency_hz[0] * _BELOW
    low = low[low > 2 * arrangement.spacing_hz]
    outside_hz, outside_zeta = (v.ravel() for v in np.meshgrid(np.append(low, high), _WIDTHS))
    hz = np.append(diagram.frequency_hz[keep], outside_hz)
    zeta = np.append(diagram.damping_ratio[keep], outside_zeta)
    order = np.argsort(hz, kind="stable")
    hz, zeta = hz[order], zeta[order]
    fresh = np.ones(hz.size, dtype=bool)
    for k in range(1, hz.size):  # a pole within a tenth of its bandwidth of one that is there adds nothing to the scan
        near = slice(max(0, k - _LOOK_BACK), k)
        like = np.abs(hz[near] - hz[k]) < 0.1 * zeta[k] * hz[k]
        fresh[k] = not np.any(like & fresh[near] & (np.abs(np.log(zeta[near] / zeta[k])) < 0.15))
    return hz[fresh], zeta[fresh]
