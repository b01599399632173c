"""Levenberg and Marquardt's method for sums of squares: the minimiser of every fit of the core that
is to come to rest.

Poles are refined elsewhere (`modal.refinement`): there a few steps are enough, each is bounded by
the width of its pole, and directions that the data do not know are left out of it.

At a point x the misfit E is modelled by its descent g = -∂E/∂x and a positive semidefinite H ≈
∂²E/∂x² (Gauss and Newton's),

    E(x + s) ≈ E(x) - gᵀs + sᵀHs/2,        (H + μ diag H) s = g,

and the damping μ follows the ratio of the decrease to the one that this model foretells, by
Nielsen's rule (IMM-REP-1999-05): a rule that multiplies μ by fixed factors makes every other step
fail where the misfit is curved. The parameters are scaled by √diag H, so their units do not matter
(Moré, Lecture Notes in Mathematics 630, 1978).

A point is an object of the caller's, which knows its own misfit: what it holds besides, and how a
step moves it, is not the method's business. So bounds, logarithms and parameters on a manifold are
all in `move`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np

from fecore.arrays import FloatArray

_FIRST_DAMPING = 1e-3  # of the scaled matrix, whose diagonal is 1
_LEAST_RELIEF = 0.1  # of the damping after a step as good as foretold
_FLAT = float(np.finfo(np.float64).eps)  # curvature for each parameter that round-off alone gives
_STUCK = 1e12  # damping beyond which no step will help


class Iterate(Protocol):
    """A point with the quadratic model of the misfit there."""

    @property
    def cost(self) -> float:
        """The misfit E."""
        ...

    @property
    def descent(self) -> FloatArray:
        """(p,) -∂E/∂x."""
        ...

    @property
    def hessian(self) -> FloatArray:
        """(p, p) Gauss and Newton's approximation of ∂²E/∂x²."""
        ...


P = TypeVar("P", bound=Iterate)
Outcome = Literal["converged", "stuck", "exhausted", "singular"]


@dataclass(frozen=True)
class Stopping:
    """When a minimum is reached, and when the search is given up."""

    # relative, absolute: an undamped step that could gain no more than relative · E + absolute has
    # converged. A damped one is short, so what it gains says nothing.
    relative: float = 1e-10
    absolute: float = 0.0
    # relative decrease of E that counts as none; `stalled_steps` of them running have converged too
    stalled: float = 1e-7
    stalled_steps: int = 5
    steps: int = 100  # most trial steps


@dataclass(frozen=True)
class Minimum(Generic[P]):
    """Where a search ended."""

    point: P  # the best point
    # `converged`; `stuck` where no step along the descent lowers E; `exhausted` after the most
    # steps; `singular` where a direction does not change E at all, so the minimum is no point
    outcome: Outcome


def minimise(
    first: P,
    move: Callable[[P, FloatArray], P | None],
    stopping: Stopping | None = None,
    visit: Callable[[int, P], None] = lambda *_: None,
) -> Minimum[P]:
    """Go down from a first point to a minimum of E.

    Args:
        first: where to start.
        move: the point that a step of shape (p,) leads to, or None where there is none: out of
            bounds, not computable.
        stopping: when to stop; the defaults suit a misfit that is smooth to round-off.
        visit: called before each trial step with its number and the point it starts from, for
            progress and histories; an exception from it ends the search.
    """
    stopping = stopping or Stopping()
    point, damping, growth, stalled = first, _FIRST_DAMPING, 2.0, 0
    outcome: Outcome = "exhausted"
    for trial in range(stopping.steps):
        visit(trial, point)
        if (principal := _principal(point)) is None:
            return Minimum(point, "singular")
        size, curvature, axes = principal
        along = axes.T @ (point.descent / size)
        if (
            float(along @ (along / curvature)) / 2
            <= stopping.relative * point.cost + stopping.absolute
        ):
            outcome = "converged"
            break
        step = axes @ (along / (curvature + damping)) / size
        there = move(point, step)
        if there is not None and there.cost <= point.cost:
            fall = point.cost - there.cost
            stalled = stalled + 1 if fall <= stopping.stalled * point.cost else 0
            foretold = float(step @ point.descent - step @ point.hessian @ step / 2)
            damping *= max(_LEAST_RELIEF, 1 - (2 * fall / foretold - 1) ** 3)
            point, growth = there, 2.0
            if stalled >= stopping.stalled_steps:
                outcome = "converged"
                break
        elif damping > _STUCK:
            outcome = "stuck"
            break
        else:
            damping, growth = damping * growth, 2 * growth
    return Minimum(point, outcome if curvature[0] > _FLAT * size.size else "singular")


def _principal(point: Iterate) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """√diag H, and the principal curvatures and axes of H scaled by it; None where a parameter does
    not change E at all.

    Curvatures are at least what round-off gives: a step along a flat direction stays finite.
    """
    size = np.sqrt(np.diag(point.hessian))
    if not np.all(size > 0) or not np.all(np.isfinite(point.hessian)):
        return None
    curvature, axes = np.linalg.eigh(point.hessian / np.outer(size, size))
    return size, np.maximum(curvature, _FLAT * size.size), axes


def unit_columns(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, p) rows with columns of unit length, and the (p,) lengths; 1 of a column of zeros."""
    length = np.linalg.norm(rows, axis=0)
    length[length == 0] = 1.0
    return rows / length, length


def nearest(rows: FloatArray, target: FloatArray) -> FloatArray:
    """(p,) coefficients a with the least |rows a - target|², whatever their units; 0 where a column
    is zero.
    """
    unit, length = unit_columns(rows)
    coefficients: FloatArray = np.linalg.lstsq(unit, target, rcond=None)[0] / length
    return coefficients
