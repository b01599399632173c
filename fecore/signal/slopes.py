"""How the shares of resonances change from place to place: their slopes at each point of the grid,
with what is not known of them.

A share is known at the grid's points and its slope is wanted at one. A uniform strip's or plate's
shapes are made of
waves: along one axis, of wave number κ,

    cos κx,  sin κx,  exp(-κ(x - x₁)),  exp(-κ(x₂ - x)),

whatever holds the ends; along the other the same with a wave number of its own (for a strip, whose
points span little
of the width: a constant for bending or a straight line for torsion). A share is the sum of the
products with random weights, a Gaussian process whose kernel is the product of one kernel along
each axis (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, chapters 2 and 5;
its derivatives are those of the kernel). Smooth kernels exp(-(x
- x')²/2ℓ²) stand beside, for bodies that are not uniform. Wave numbers are not known: each pair of
  kernels counts by
the probability that it gives the values seen. Values and slopes are the mean over pairs, and their
covariance has both what one pair leaves open and what the pairs differ by. So a slope is well known
where the points lie near one another against the wave's length, and said to be unknown where not.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray

NARROW = 0.2
"""Extent of the points across over along up to which they are a strip's."""

_NEIGHBOURS = 24  # points, the nearest, that a slope rests on
# of a share's root mean square: what hits beside the points and other modes put on it
_ERROR = 0.04
_LINE = 1.4  # at the edge, of a torsion mode whose mean square over the width is near one
_ENDS = 0.02  # of the extent, that the body reaches beyond the outermost points
_WAVES = (45, 25.0)  # wave numbers tried along a strip, and the largest times the extent
_PLATE_WAVES = ((16, 20.0), (10, 14.0))  # the same along and across a plate
# Lengths ℓ over the extent; the first leaves points unlike their neighbours.
_SMOOTH = (0.04, 0.1, 0.15, 0.22, 0.33, 0.5)


@dataclass(frozen=True)
class _Kernels:
    """Kernels along one axis: k(x_a, x_b) as (F, P, P), ∂k(x, x_b)/∂x at the point asked as (F, P),
    ∂²k/∂x∂x' there as (F,).
    """

    value: FloatArray
    slope: FloatArray
    both: FloatArray


def plane(positions: FloatArray) -> FloatArray:
    """(P, 2) coordinates of (P, 3) positions along the two axes in which they extend most, the
    longer first.
    """
    order = np.argsort(-np.ptp(positions, axis=0), kind="stable")[:2]
    flat: FloatArray = positions[:, order]
    return flat


def slopes(
    places: FloatArray, participation: FloatArray, point: int
) -> tuple[FloatArray, FloatArray]:
    """(2, K) slopes of K shares at one of the points along the two axes, 1/m, and their (2, K)
    variances.

    Args:
        places: (P, 2) coordinates, m, as `plane` gives them.
        participation: (P, K) values there.
        point: row of the point asked.
    """
    extent = np.ptp(places, axis=0)
    near = np.argsort(((places - places[point]) ** 2).sum(axis=1), kind="stable")[:_NEIGHBOURS]
    low, high = places.min(axis=0), places.max(axis=0)
    x, y = (_Axis(places[near, k], float(low[k]), float(high[k])) for k in (0, 1))
    if extent[1] <= NARROW * extent[0]:
        along, across = x.kernels(*_WAVES), y.straight()
    else:
        along, across = (
            axis.kernels(*tried) for axis, tried in zip((x, y), _PLATE_WAVES, strict=True)
        )
    scale = np.sqrt((participation[near] ** 2).mean(axis=0)) + 1e-300
    mean, variance = _averaged(along, across, participation[near] / scale)
    return mean * scale, variance * scale**2


def _averaged(
    along: _Kernels, across: _Kernels, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(2, K) mean and variance of the slopes at the first of the points, over all pairs of
    kernels.
    """
    size = len(values)

    def pairs(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray((a[:, None] * b[None]).reshape(-1, *a.shape[1:]))

    matrix = pairs(along.value, across.value) + _ERROR**2 * np.eye(size)
    towards = np.stack(
        (pairs(along.slope, across.value[:, 0]), pairs(along.value[:, 0], across.slope)), axis=2
    )
    prior = np.stack(
        (pairs(along.both, across.value[:, 0, 0]), pairs(along.value[:, 0, 0], across.both)), axis=1
    )
    solved = np.linalg.solve(
        matrix, np.concatenate((np.broadcast_to(values, (len(matrix), *values.shape)), towards), 2)
    )
    weights, reach = solved[..., : values.shape[1]], solved[..., values.shape[1] :]
    misfit = np.einsum("pk,fpk->fk", values, weights)
    evidence = -0.5 * (misfit + np.linalg.slogdet(matrix)[1][:, None])
    chance = np.exp(evidence - evidence.max(axis=0))
    chance /= chance.sum(axis=0)
    each = np.einsum("fpa,fpk->fak", towards, weights)
    left = np.maximum(prior - np.einsum("fpa,fpa->fa", towards, reach), 0.0)
    mean = np.einsum("fk,fak->ak", chance, each)
    variance = np.einsum("fk,fa->ak", chance, left) + np.einsum(
        "fk,fak->ak", chance, (each - mean) ** 2
    )
    return mean, variance


class _Axis:
    """The coordinates of the points along one axis, the point asked first, and the extent of all
    points.
    """

    def __init__(self, x: FloatArray, low: float, high: float) -> None:
        self.x, self.extent = x, max(high - low, 1e-9)
        self.low, self.high = low - _ENDS * self.extent, high + _ENDS * self.extent
        self.middle = (low + high) / 2

    def straight(self) -> _Kernels:
        """A constant, a line through the middle, and both: a share may be of a bending and a
        torsion mode.
        """
        one, none = np.ones(self.x.size), np.zeros(self.x.size)
        half = self.extent / 2 if self.extent > 1e-6 else 1.0
        line, rise = _LINE * (self.x - self.middle) / half, _LINE * one / half
        values = (
            np.array([[one, none], [none, line], [one, line]])
            / np.sqrt([[1, 1], [1, 1], [2, 2]])[..., None]
        )
        slope = (
            np.array([[none, none], [none, rise], [none, rise]])
            / np.sqrt([[1, 1], [1, 1], [2, 2]])[..., None]
        )
        return _of_features(values.swapaxes(1, 2), slope.swapaxes(1, 2))

    def kernels(self, count: int, largest: float) -> _Kernels:
        """A line with its constant, waves and smooth kernels."""
        wave = np.linspace(1.0, largest, count)[:, None] / self.extent
        x = self.x[None]
        cos, sin = np.cos(wave * x), np.sin(wave * x)
        left, right = np.exp(-wave * (x - self.low)), np.exp(-wave * (self.high - x))
        values = np.stack((cos, sin, left, right), axis=2)
        slope = wave[..., None] * np.stack((-sin, cos, -left, right), axis=2)
        line = (self.x - self.middle) * 2 / self.extent
        flat = np.zeros((1, self.x.size, 4)), np.zeros((1, self.x.size, 4))
        flat[0][0, :, 0], flat[0][0, :, 1], flat[1][0, :, 1] = 1.0, line, 2 / self.extent
        kernels = _of_features(np.concatenate((flat[0], values)), np.concatenate((flat[1], slope)))
        smooth = self._smooth()
        return _Kernels(
            np.concatenate((kernels.value, smooth.value)),
            np.concatenate((kernels.slope, smooth.slope)),
            np.concatenate((kernels.both, smooth.both)),
        )

    def _smooth(self) -> _Kernels:
        length = np.array(_SMOOTH)[:, None] * self.extent
        off = self.x[:, None] - self.x[None]
        value = np.exp(-(off**2) / (2 * length[..., None] ** 2))
        return _Kernels(
            value, (self.x - self.x[0]) / length**2 * value[:, 0], 1 / length[:, 0] ** 2
        )


def _of_features(values: FloatArray, slope: FloatArray) -> _Kernels:
    """Kernels Σ f(x) f(x') of (F, P, m) features and their slopes."""
    return _Kernels(
        np.einsum("fpm,fqm->fpq", values, values),
        np.einsum("fm,fpm->fp", slope[:, 0], values),
        np.einsum("fm,fm->f", slope[:, 0], slope[:, 0]),
    )
