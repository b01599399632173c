"""What measured shapes say of a loss of stiffness in a stretch of a body, beside its frequencies
(`fecore.updating.damage`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.updating.elastic_result import SAME_SHAPE, ElasticResult
from fecore.updating.inputs import GRID_SD, POINT_SD
from fecore.updating.posterior import DISCREPANCY, SHAPE_DISCREPANCY
from fecore.updating.shape_error import ShapeErrors, real_shape
from fecore.updating.state import ForwardState

_LIKE = 0.1  # of a shape in another, below which the two are not compared
_CLOSE = 1e-3  # relative distance of eigenvalues below which modes are turned freely


@dataclass(frozen=True)
class DamageShapes:
    """Residuals of n shapes in the space of b shapes of the model, over σ, and what they follow
    from, along the N = n b axes of the covariance that they share.
    """

    residual: FloatArray  # (N,)
    by: FloatArray  # (N, X) of the model's by the unknowns
    # (N,) by turns of modes, and by points that are met within `POINT_SD`
    variance: FloatArray
    change: FloatArray  # (l, P, N) by losses
    # information, descent: (X, X) and (X,) of them in the fit, where it looks at shapes
    information: FloatArray
    descent: FloatArray

    @classmethod
    def of(
        cls,
        elastic: ElasticResult,
        number: int,
        turned: FloatArray,
        value: FloatArray,
        seen: FloatArray,
    ) -> DamageShapes | None:
        """Of a campaign; None where it has no shapes that are those of the model.

        Args:
            elastic: the update.
            number: of the campaign.
            turned: (l, P, n, m) what its paired modes are made of by losses.
            value: (m,) eigenvalues of those modes.
            seen: (m, r) their shapes at the model's rows, those of the shapes' dofs first.
        """
        campaign, state = elastic.layout.campaigns[number], elastic.states[number]
        pairing = elastic.pairings[number]
        # Shapes at one point alone are not compared, and modes are paired by frequency.
        if campaign.modes.shapes is None or pairing.mac is None:
            return None
        count, (rows, columns) = (
            len(campaign.modes.dofs),
            (list(each) for each in zip(*pairing.pairs, strict=True)),
        )
        same = pairing.mac[rows, columns] >= SAME_SHAPE
        weight = np.sqrt(elastic.problem.weights[elastic.rows[number]]) * same
        if not same.any():
            return None
        missed, _ = ShapeErrors().residual(campaign.modes, state, pairing, 1.0 * same)
        weight = weight * _evenly(missed.reshape(-1, count), same)
        missed, of_theta = ShapeErrors().residual(campaign.modes, state, pairing, weight)
        by = of_theta @ (campaign.prior.slope(state.theta)[:, None] * campaign.pick)
        seen = seen[:, :count]
        basis = np.linalg.qr(seen.T)[0]  # (points, b)
        # A model's shape at the scale at which it is compared with the measured one, over σ.
        real, own = np.array([real_shape(campaign.modes, row) for row in rows]), seen[columns]
        scale = weight * np.sum(real * own, axis=1) / np.sum(own**2, axis=1) / SHAPE_DISCREPANCY
        placed = _placed(state, scale[:, None, None] * state.slopes[columns, :count], basis)
        shapes = seen @ basis
        both = np.hstack([_turned(value, columns, shapes, scale), placed])
        variance, axes = np.linalg.eigh(both @ both.T)
        own = shapes[columns]
        lost = turned @ shapes
        along = np.sum(lost * own, axis=3) / np.sum(own**2, axis=1)
        like = np.abs(along) > _LIKE
        change = (
            scale[:, None] * (lost / np.where(like, along, 1.0)[..., None] - own) * like[..., None]
        )
        fitted = elastic.problem.others.get("mode shapes")
        each = by.reshape(len(rows), count, -1)
        return cls(
            axes.T @ (missed.reshape(-1, count) @ basis).ravel(),
            axes.T @ np.einsum("npx,pb->nbx", each, basis).reshape(len(axes), -1),
            np.maximum(variance, 0.0),
            change.reshape(*change.shape[:2], -1) @ axes,
            np.zeros((by.shape[1],) * 2) if fitted is None else fitted,
            np.zeros(by.shape[1]) if fitted is None else elastic.problem.other_descent,
        )

    def given(self, k: float) -> DamageShapesAt:
        """What they say where a shape's standard deviation is k times the usual one."""
        variance = k**2 + self.variance
        r, J, d = self.residual, self.by / variance[:, None], self.change
        return DamageShapesAt(
            cost=float(np.sum(r**2 / variance + np.log(variance))),
            hessian=self.by.T @ J - self.information,
            descent=J.T @ r - self.descent,
            across=d @ J,
            along=d @ (r / variance) - d**2 @ (0.5 / variance),
        )


@dataclass(frozen=True)
class DamageShapesAt:
    """The terms of the shapes in ln B: of the misfit twice, by the unknowns, and by losses."""

    cost: float
    hessian: FloatArray  # (X, X)
    descent: FloatArray  # (X,)
    across: FloatArray  # (l, P, X) dᵀWS
    along: FloatArray  # (l, P) dᵀWr - ½ dᵀWd


def _evenly(missed: FloatArray, same: BoolArray) -> FloatArray:
    """(n,) weights by which (n, p) shapes that are further off than the middle one of some are as
    far off as it: what is wrong with one mode alone, such as a share of another in it, is no loss,
    which all modes see.
    """
    off = np.sqrt(np.mean(missed**2, axis=1))
    return np.asarray(np.minimum(1.0, np.median(off[same]) / np.maximum(off, 1e-300)))


def _turned(
    value: FloatArray, columns: list[int], shapes: FloatArray, scale: FloatArray
) -> FloatArray:
    """(n b, n m) root of the covariance of paired modes' shapes, by what turns them towards
    others.
    """
    apart = np.abs(value[columns, None] - value) / np.sqrt(value[columns, None] * value)
    sd = np.sqrt(2) * DISCREPANCY / np.maximum(apart, _CLOSE)
    own = shapes[columns]
    across = shapes - (own @ shapes.T / np.sum(own**2, axis=1)[:, None])[..., None] * own[:, None]
    sd[np.arange(len(columns)), columns] = 0.0
    each = (scale[:, None] * sd)[..., None] * across
    return np.asarray(scipy.linalg.block_diag(*each.transpose(0, 2, 1)))


def _placed(state: ForwardState, slopes: FloatArray, basis: FloatArray) -> FloatArray:
    """(n b, 3 p + 2) root of the covariance of shapes with (n, p, 3) slopes by how far points, and
    the ends of their grid, are off their places: as far in each mode.
    """
    places = state.forward.places[: slopes.shape[1]]
    axis = int(np.argmax(np.ptp(places, axis=0)))
    x = (places[:, axis] - places[:, axis].min()) / max(float(np.ptp(places[:, axis])), 1e-300)
    own = np.einsum("pb,npk->nbpk", basis, POINT_SD * slopes)
    ends = GRID_SD * np.einsum("pb,np,pe->nbe", basis, slopes[..., axis], np.stack([x, 1 - x], 1))
    rows = len(slopes) * basis.shape[1]
    return np.hstack([own.reshape(rows, -1), ends.reshape(rows, -1)])
