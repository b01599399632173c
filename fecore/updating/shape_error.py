"""How far measured mode shapes may be from the model's: scatter at the points, and other modes that
are mixed in.

A measured shape ψ_k, scaled to a largest entry of 1, is

    ψ_k = a φ_k + Σ_j≠k m_j a φ_j + e,    m_j ~ N(0, h²/((λ_j - λ_k)² + h²)),    h² = 2 s² λ_j λ_k,    e ~ N(0, v),

with the model's shapes φ, eigenvalues λ, and s the discrepancy of a frequency: a stiffness that
misses λ by 2 s λ on the diagonal has entries of half that variance off it (Mehta, Random Matrices,
3rd ed., 2), which turn the shapes into one another, two close ones without resistance. The variance
v of the scatter is estimated for each mode, with a scaled inverse χ² of two degrees of freedom
about 1 % as its prior, so that a shape which the model does not have says less.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.correlation import Pairing
from fecore.modal import turn_real
from fecore.modes import MeasuredModes
from fecore.updating.posterior import DISCREPANCY_DOF, SHAPE_DISCREPANCY
from fecore.updating.state import ForwardState

_REACH = np.log([0.01, 100.0])  # of the scatter about its prior scale
_SAME = 0.01  # relative change of a scatter that changes nothing


@dataclass(frozen=True)
class ShapeErrors:
    """Of the measured modes of one campaign that have a partner, by their rows."""

    # √v, as a share of the shape's largest entry
    scatter: Mapping[int, float] = field(default_factory=dict)
    # (p, p) W with WᵀW the inverse of the covariance of the errors at the points
    whitening: Mapping[int, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(
        cls, modes: MeasuredModes, state: ForwardState, pairing: Pairing, discrepancy: float
    ) -> ShapeErrors:
        """The errors at a solved model.

        Args:
            modes: the measured modes, with shapes at the first of the model's points.
            state: the solved model.
            pairing: measured modes with the model's.
            discrepancy: s, relative standard deviation of a frequency of the model.
        """
        scatter, whitening = dict[int, float](), dict[int, FloatArray]()
        value, shapes = (2 * np.pi * state.frequency_hz) ** 2, state.shapes[:, : len(modes.dofs)]
        for row, column in pairing.pairs:
            measured, model = real_shape(modes, row), shapes[column]
            size = float(measured @ model / (model @ model))
            coupling = 2 * discrepancy**2 * value * value[column]
            share = coupling / ((value - value[column]) ** 2 + coupling)
            share[column] = 0.0
            axes, singular, _ = np.linalg.svd(
                (size * np.sqrt(share)[:, None] * shapes).T, full_matrices=False
            )
            scatter[row] = _scatter(measured - size * model, axes, singular**2)
            relief = 1 - scatter[row] / np.hypot(scatter[row], singular)
            whitening[row] = (np.eye(len(model)) - (axes * relief) @ axes.T) / scatter[row]
        return cls(scatter, whitening)

    def are_those_of(self, other: ShapeErrors) -> bool:
        """Whether they differ by no more than what changes nothing."""
        pairs = [(self.scatter[row], other.scatter.get(row, np.inf)) for row in self.scatter]
        return len(self.scatter) == len(other.scatter) and all(
            abs(a - b) <= _SAME * a for a, b in pairs
        )

    def residual(
        self, modes: MeasuredModes, state: ForwardState, pairing: Pairing, root_weight: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Measured less model shapes, each at its best scale, in standard deviations, and -∂/∂θ of
        them.

        Args:
            modes: the measured modes.
            state: the solved model.
            pairing: measured modes with the model's.
            root_weight: (n,) root of the weight of each pair.

        Returns:
            (n p,) and (n p, parameters).
        """
        residuals, jacobians, points = [], [], len(modes.dofs)
        for (row, column), root in zip(pairing.pairs, root_weight, strict=True):
            whitening = self.whitening.get(row, np.eye(points) / SHAPE_DISCREPANCY)
            measured = whitening @ real_shape(modes, row)
            model = whitening @ state.shapes[column, :points]
            by = state.shape_jacobian[:, state.modes.rigid + column, :points] @ whitening.T
            scale = measured @ model / (model @ model)
            # the best scale takes what lies along
            across = by - np.outer(by @ model, model) / (model @ model)
            residuals.append(root * (measured - scale * model))
            jacobians.append(root * scale * across.T)
        return np.concatenate(residuals), np.vstack(jacobians)


def real_shape(modes: MeasuredModes, row: int) -> FloatArray:
    """(p,) a measured shape turned to be as real as it can be, its largest entry ±1."""
    assert modes.shapes is not None, "it was looked for"
    shape = turn_real(modes.shapes[row]).real
    return np.asarray(shape / np.abs(shape).max())


def _scatter(off: FloatArray, axes: FloatArray, variance: FloatArray) -> float:
    """√v, most probable for (p,) differences of shapes that also scatter by (q,) variances along
    (p, q) axes.
    """
    along = (axes.T @ off) ** 2
    across, rest = max(float(off @ off - along.sum()), 0.0), len(off) - 1 - len(along)
    prior = DISCREPANCY_DOF * SHAPE_DISCREPANCY**2

    def cost(log_scatter: float) -> float:
        v = SHAPE_DISCREPANCY**2 * np.exp(2 * log_scatter)
        known = np.sum(np.log(v + variance) + along / (v + variance))
        return float(known + (max(rest, 0) + DISCREPANCY_DOF) * np.log(v) + (across + prior) / v)

    return float(
        SHAPE_DISCREPANCY
        * np.exp(scipy.optimize.minimize_scalar(cost, bounds=_REACH, method="bounded").x)
    )
