"""What measured shapes say of a loss of stiffness in a stretch of a body, beside its frequencies
(`fecore.updating.damage`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.elastic_result import SAME_SHAPE, ElasticResult
from fecore.updating.inputs import GRID_SD, POINT_SD
from fecore.updating.posterior import DISCREPANCY, SHAPE_DISCREPANCY
from fecore.updating.shape_error import ShapeErrors, real_shape
from fecore.updating.state import ForwardState

_LIKE = 0.1  # of a shape in another, below which the two are not compared
_CLOSE = 1e-3  # relative distance of eigenvalues below which modes are turned freely


@dataclass(frozen=True)
class ShapesOfLosses:
    """Residuals of n shapes in the space of b shapes of the model, over σ, and what they follow
    from.
    """

    residual: FloatArray  # (n, b)
    by: FloatArray  # (n, b, X) of the model's by the unknowns
    # (n, b, b) covariance by turns of modes, and by points that are met within `POINT_SD`
    turned: FloatArray
    change: FloatArray  # (l, P, n, b) by losses
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
    ) -> ShapesOfLosses | None:
        """Of a campaign; None where it has no shapes.

        Args:
            elastic: the update.
            number: of the campaign.
            turned: (l, P, n, m) what its paired modes are made of by losses.
            value: (m,) eigenvalues of those modes.
            seen: (m, r) their shapes at the model's rows, of which those of the shapes are the first.
        """
        campaign, state = elastic.layout.campaigns[number], elastic.states[number]
        pairing = elastic.pairings[number]
        if campaign.modes.shapes is None:
            return None
        count, (rows, columns) = (
            len(campaign.modes.dofs),
            (list(each) for each in zip(*pairing.pairs, strict=True)),
        )
        assert pairing.mac is not None, "modes with shapes are paired by them"
        same = pairing.mac[rows, columns] >= SAME_SHAPE
        weight = np.sqrt(elastic.problem.weights[elastic.rows[number]]) * same
        missed, of_theta = ShapeErrors().residual(campaign.modes, state, pairing, weight)
        by = of_theta @ (campaign.prior.slope(state.theta)[:, None] * campaign.pick)
        seen = seen[:, :count]
        basis = np.linalg.qr(seen.T)[0]  # (points, b)
        # A model's shape at the scale at which it is compared with the measured one, over σ.
        real, own = np.array([real_shape(campaign.modes, row) for row in rows]), seen[columns]
        scale = weight * np.sum(real * own, axis=1) / np.sum(own**2, axis=1) / SHAPE_DISCREPANCY
        placed = _placed(state, scale[:, None, None] * state.slopes[columns, :count], basis)
        shapes = seen @ basis
        own = shapes[columns]
        lost = turned @ shapes
        along = np.sum(lost * own, axis=3) / np.sum(own**2, axis=1)
        like = np.abs(along) > _LIKE
        change = (
            scale[:, None] * (lost / np.where(like, along, 1.0)[..., None] - own) * like[..., None]
        )
        fitted = elastic.problem.others.get("mode shapes")
        return cls(
            missed.reshape(-1, count) @ basis,
            np.einsum("npx,pb->nbx", by.reshape(len(rows), count, -1), basis),
            _turned(value, columns, shapes, scale) + placed,
            change,
            np.zeros((by.shape[1],) * 2) if fitted is None else fitted,
            np.zeros(by.shape[1]) if fitted is None else elastic.problem.other_descent,
        )

    def given(self, k: float) -> ShapesGiven:
        """What they say where a shape's standard deviation is k times the usual one."""
        covariance = k**2 * np.eye(self.residual.shape[1]) + self.turned
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        r, J = (whiten @ self.residual[..., None])[..., 0], whiten @ self.by
        d = np.stack([self.change[:, :, j] @ each.T for j, each in enumerate(whiten)], axis=2)
        return ShapesGiven(
            cost=float(np.sum(r**2) + np.linalg.slogdet(covariance)[1].sum()),
            hessian=np.einsum("nbx,nby->xy", J, J) - self.information,
            descent=np.einsum("nbx,nb->x", J, r) - self.descent,
            across=np.tensordot(d, J, ((2, 3), (0, 1))),
            along=np.tensordot(d, r, 2) - np.sum(d**2, axis=(2, 3)) / 2,
        )


@dataclass(frozen=True)
class ShapesGiven:
    """The terms of the shapes in ln B: of the misfit twice, by the unknowns, and by losses."""

    cost: float
    hessian: FloatArray  # (X, X)
    descent: FloatArray  # (X,)
    across: FloatArray  # (l, P, X) dᵀWS
    along: FloatArray  # (l, P) dᵀWr - ½ dᵀWd


def _turned(
    value: FloatArray, columns: list[int], shapes: FloatArray, scale: FloatArray
) -> FloatArray:
    """(n, b, b) covariance of paired modes' shapes, by what turns them towards others."""
    apart = np.abs(value[columns, None] - value) / np.sqrt(value[columns, None] * value)
    sd = np.sqrt(2) * DISCREPANCY / np.maximum(apart, _CLOSE)
    own = shapes[columns]
    across = shapes - (own @ shapes.T / np.sum(own**2, axis=1)[:, None])[..., None] * own[:, None]
    sd[np.arange(len(columns)), columns] = 0.0
    each = (scale[:, None] * sd)[..., None] * across
    return np.asarray(each.transpose(0, 2, 1) @ each)


def _placed(state: ForwardState, slopes: FloatArray, basis: FloatArray) -> FloatArray:
    """(n, b, b) covariance of (n, p, 3) slopes times how far points, and the ends of their grid,
    are off their places.
    """
    places = state.forward.places[: slopes.shape[1]]
    axis = int(np.argmax(np.ptp(places, axis=0)))
    x = (places[:, axis] - places[:, axis].min()) / max(float(np.ptp(places[:, axis])), 1e-300)
    own = np.einsum("pb,npk,pc->nbc", basis, (POINT_SD * slopes) ** 2, basis)
    ends = GRID_SD * np.stack([slopes[..., axis] * x, slopes[..., axis] * (1 - x)]) @ basis
    return np.asarray(own + np.einsum("enb,enc->nbc", ends, ends))
