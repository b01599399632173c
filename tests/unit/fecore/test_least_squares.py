"""The core's minimiser: closed-form minima, points out of bounds, misfits that no minimum has."""

from __future__ import annotations

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
    return Point(x, np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), np.array([[-20 * x[0], 10], [-1, 0]]))


def mover(at: Callable[[FloatArray], Point], allowed: Callable[[FloatArray], bool] = lambda _: True):
    return lambda point, step: at(point.x + step) if allowed(point.x + step) else None


@pytest.mark.parametrize("start", [(-1.2, 1.0), (10.0, -30.0), (0.0, 0.0)])
def test_a_curved_valley_is_followed_to_its_end(start: tuple[float, float]) -> None:
    found = minimise(rosenbrock(np.array(start)), mover(rosenbrock), Stopping(absolute=1e-24))
    assert found.outcome == "converged"
    np.testing.assert_allclose(found.point.x, [1, 1], atol=1e-10)  # round-off of the residuals, over the valley's slope


def test_a_linear_problem_takes_the_normal_equations_answer_in_any_units() -> None:
    random = np.random.default_rng(1)
    A, b, units = random.standard_normal((30, 4)), random.standard_normal(30), np.array([1e-9, 1.0, 1e6, 1e12])

    def at(x: FloatArray) -> Point:
        return Point(x, A / units @ x - b, A / units)

    found = minimise(at(np.zeros(4)), mover(at))
    exact = np.linalg.lstsq(A, b, rcond=None)[0] * units
    # What an undamped step could still gain is 10⁻¹⁰ of E, so x is within 10⁻⁵ of the residual's own size.
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


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_a_direction_that_changes_nothing_is_said_to_be_singular(slope: float) -> None:
    """x₂ alone, or x₁ = -x₂."""

    def at(x: FloatArray) -> Point:
        return Point(x, np.array([x[0] + slope * x[1] - 1]), np.array([[1.0, slope]]))

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


@dataclass(frozen=True)
class Given:
    """A point of one parameter with unit curvature, whose misfit is given."""

    cost: float
    slope: float = 1.0

    @property
    def descent(self) -> FloatArray:
        return np.array([self.slope])

    @property
    def hessian(self) -> FloatArray:
        return np.array([[4.0]])


def dampings(trials: list[Given | None], stopping: Stopping) -> tuple[str, list[float]]:
    """How a search over these trial points ends, and the damping of each step: g/h = s (1 + μ)."""
    steps: list[float] = []

    def move(point: Given, step: FloatArray) -> Given | None:
        steps.append(point.slope / 4.0 / step[0] - 1)
        return trials[len(steps) - 1]

    visited: list[int] = []
    found = minimise(Given(10.0), move, stopping, lambda trial, _: visited.append(trial))
    assert visited[: len(steps)] == list(range(len(steps)))
    return found.outcome, steps


def test_the_damping_follows_nielsens_rule() -> None:
    """μ grows by 2, 4, 8 … where steps fail; a gain of ρ times what was foretold makes it μ max(1/10, 1 - (2ρ - 1)³)."""
    worse = Given(11.0)
    # The first step foretells s g - 2 s² with s = 1/(4 (1 + μ)), and gains that, half of it, a quarter of it.
    mu = 1e-3
    step = 0.25 / (1 + mu)
    foretold = step - 2 * step**2
    for share, factor in ((1.0, 0.1), (0.75, 0.875), (0.5, 1.0), (0.25, 1.125)):
        outcome, found = dampings(
            [Given(10.0 - share * foretold), None, worse, worse, None], Stopping(steps=5, stalled=0.0)
        )
        assert outcome == "exhausted"
        after = mu * factor
        np.testing.assert_allclose(found, [mu, after, 2 * after, 8 * after, 64 * after], rtol=1e-9)
    outcome, found = dampings([None, worse, Given(10.0 - 1e-3), None, None], Stopping(steps=5, stalled=0.0))
    assert found[1:3] == pytest.approx([2 * mu, 8 * mu], rel=1e-9)
    assert found[4] / found[3] == pytest.approx(2.0, rel=1e-9)  # the growth begins anew after a step that gains


def test_a_search_that_stalls_has_converged_and_one_that_nothing_helps_is_stuck() -> None:
    once = Stopping(stalled=0.1, stalled_steps=1, steps=2)
    assert dampings([Given(9.0)], once)[0] == "converged"  # by a tenth, no more
    assert dampings([Given(8.9), None], once)[0] == "exhausted"
    same: list[Given | None] = [Given(10.0)] * 9
    for steps in (1, 3):
        outcome, found = dampings(same, Stopping(stalled=0.0, stalled_steps=steps))
        assert (outcome, len(found)) == ("converged", steps)
    falls: list[Given | None] = [Given(cost) for cost in (9.5, 7.0, 6.5, 6.4, 6.3)]
    outcome, found = dampings(falls, Stopping(stalled=0.1, stalled_steps=2, steps=5))
    assert (outcome, len(found)) == ("converged", 4)  # only those that follow upon each other count
    for ratio, ended in ((0.99, ("exhausted", 100)), (1.0, ("converged", 5))):
        outcome, found = dampings([Given(10 * ratio**step) for step in range(1, 101)], Stopping())
        assert (outcome, len(found)) == ended
    outcome, found = dampings([None] * 99, Stopping())
    assert outcome == "stuck"
    assert found[-1] > 1e12 > found[-2]


def test_only_an_undamped_step_that_could_gain_next_to_nothing_has_converged() -> None:
    # What an undamped step could gain is g²/2h = 1/8.
    for stopping, outcome in (
        (Stopping(absolute=0.125, steps=1), "converged"),
        (Stopping(absolute=0.1249, steps=1), "exhausted"),
        (Stopping(relative=0.0125, steps=1), "converged"),
        (Stopping(relative=0.01249, steps=1), "exhausted"),
        (Stopping(relative=0.01, absolute=0.0251, steps=1), "converged"),
    ):
        assert dampings([None], stopping)[0] == outcome
