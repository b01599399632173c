"""The core's minimiser: closed-form minima, points out of bounds, misfits that no minimum has."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.least_squares import Stopping, minimise


@dataclass(frozen=True)
class Point:
    x: FloatArray
    residual: FloatArray
    jacobian: FloatArray

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def descent(self) -> FloatArray:
        return -2 * self.jacobian.T @ self.residual

    @property
    def hessian(self) -> FloatArray:
        return 2 * self.jacobian.T @ self.jacobian


def rosenbrock(x: FloatArray) -> Point:
    """r = (10 (y - x²), 1 - x), minimum 0 at (1, 1)."""
    return Point(
        x, np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), np.array([[-20 * x[0], 10], [-1, 0]])
    )


def mover(
    at: Callable[[FloatArray], Point], allowed: Callable[[FloatArray], bool] = lambda _: True
):
    return lambda point, step: at(point.x + step) if allowed(point.x + step) else None


@pytest.mark.parametrize("start", [(-1.2, 1.0), (10.0, -30.0), (0.0, 0.0)])
def test_a_curved_valley_is_followed_to_its_end(start: tuple[float, float]) -> None:
    found = minimise(rosenbrock(np.array(start)), mover(rosenbrock), Stopping(absolute=1e-24))
    assert found.outcome == "converged"
    # round-off of the residuals, over the valley's slope
    np.testing.assert_allclose(found.point.x, [1, 1], atol=1e-10)


def test_a_linear_problem_takes_the_normal_equations_answer_in_any_units() -> None:
    random = np.random.default_rng(1)
    A, b, units = (
        random.standard_normal((30, 4)),
        random.standard_normal(30),
        np.array([1e-9, 1.0, 1e6, 1e12]),
    )

    def at(x: FloatArray) -> Point:
        return Point(x, A / units @ x - b, A / units)

    found = minimise(at(np.zeros(4)), mover(at))
    exact = np.linalg.lstsq(A, b, rcond=None)[0] * units
    # What an undamped step could still gain is 10⁻¹⁰ of E, so x is within 10⁻⁵ of the residual's
    # own size.
    assert found.outcome == "converged"
    np.testing.assert_allclose(found.point.x, exact, rtol=1e-4)


def test_a_step_out_of_bounds_is_shortened() -> None:
    visited: list[FloatArray] = []
    found = minimise(
        rosenbrock(np.array([0.1, 0.0])),
        mover(rosenbrock, lambda x: bool(x[0] < 0.5)),
        visit=lambda _, point: visited.append(point.x),
    )
    assert found.outcome in ("stuck", "exhausted", "converged")
    assert all(x[0] < 0.5 for x in visited)
    assert found.point.cost < rosenbrock(np.array([0.1, 0.0])).cost


@pytest.mark.parametrize("slope", [0.0, 1.0, 1e7, 7e-12])
def test_a_direction_that_changes_nothing_is_said_to_be_singular(slope: float) -> None:
    """x₂ alone, or x₁ = -s x₂, in whatever units; round-off gives the matrix a curvature that is
    nearly nothing.
    """

    def at(x: FloatArray) -> Point:
        rows = np.array([[1.0, slope], [0.1, 0.1 * slope], [1 / 3, slope / 3]])
        return Point(x, rows @ x - 1, rows)

    assert minimise(at(np.zeros(2)), mover(at)).outcome == "singular"


def test_a_wrong_descent_is_stuck_and_few_steps_are_exhausted() -> None:
    @dataclass(frozen=True)
    class Wrong(Point):
        @property
        def descent(self) -> FloatArray:
            return -super().descent

    start = rosenbrock(np.array([-1.2, 1.0]))
    wrong = Wrong(start.x, start.residual, start.jacobian)
    assert minimise(wrong, mover(rosenbrock)).outcome == "stuck"
    assert minimise(start, mover(rosenbrock), Stopping(steps=2)).outcome == "exhausted"
