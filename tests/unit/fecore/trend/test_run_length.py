"""Run lengths against closed forms, published tables, the integral equation and simulation; limits against simulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from fecore.trend import Chart, alarm_probability, average_run_length, control_limits
from fecore.trend.baseline import normal_score
from fecore.trend.charts import Limits


def integral_equation(chart: Chart, limit: float, shift: float) -> float:
    """ARL from Page's integral equation L(u) = 1 + L(0) P(S' = 0) + ∫ L(y) p(y | u) dy, by Gauss-Legendre quadrature."""
    a, b, c = chart.recursion
    x, w = np.polynomial.legendre.leggauss(120)
    y, w = limit * (x + 1) / 2, limit * w / 2
    u = np.append(0.0, y)
    kernel = np.zeros((u.size, u.size))
    kernel[:, 0] = stats.norm.cdf((c - a * u) / b, shift)
    kernel[:, 1:] = w * stats.norm.pdf((y[None, :] + c - a * u[:, None]) / b, shift) / b
    return float(np.linalg.solve(np.eye(u.size) - kernel, np.ones(u.size))[0])


@pytest.mark.parametrize(
    ("limit", "shift", "published"),
    # Montgomery, Introduction to Statistical Quality Control, table of CUSUM run lengths with k = 1/2: two-sided 168 and
    # 465 without a change, twice that for one side
    [(4, 0, 336), (5, 0, 930), (4, 1, 8.38), (5, 1, 10.4), (4, 2, 3.34), (5, 2, 4.01)],
)
def test_cusum_run_lengths_are_the_published_ones(limit: float, shift: float, published: float) -> None:
    assert average_run_length(Chart("cusum", reference=0.5), Limits(limit), shift) == pytest.approx(published, rel=5e-3)


@pytest.mark.parametrize("shift", [0.0, 0.5, 2.0])
@pytest.mark.parametrize(
    ("chart", "limit"), [(Chart("ewma", weight=0.2), 0.9), (Chart("ewma", weight=0.5), 1.6), (Chart("cusum"), 4.0)]
)
def test_the_markov_chain_solves_the_integral_equation(chart: Chart, limit: float, shift: float) -> None:
    exact = integral_equation(chart, limit, shift)
    assert average_run_length(chart, Limits(limit), shift) == pytest.approx(exact, rel=5e-3)
    # the error falls with the square of the cell's width
    errors = [abs(average_run_length(chart, Limits(limit), shift, cells=n) - exact) for n in (20, 40)]
    assert errors[1] < 0.4 * errors[0]


def test_shewhart_runs_are_geometric() -> None:
    p = stats.norm.sf(2.5)
    chart = Chart("shewhart")
    assert average_run_length(chart, Limits(2.5)) == pytest.approx(1 / p, rel=1e-12)
    assert average_run_length(chart, Limits(2.5), pending=2) == pytest.approx(1 / p + 1 / p**2, rel=1e-6)
    assert alarm_probability(chart, Limits(2.5), 24) == pytest.approx(1 - (1 - p) ** 24, rel=1e-9)


@pytest.mark.parametrize("pending", [1, 2])
@pytest.mark.parametrize("chart", [Chart("ewma"), Chart("cusum")])
def test_combined_charts_and_pending_periods_against_simulation(chart: Chart, pending: int) -> None:
    limits = Limits(control_limits(chart, 0.2, 24).chart, 2.2)
    rng = np.random.default_rng(pending)
    called = sum(is_called(chart, limits, z, pending) for z in rng.standard_normal((4000, 24)))
    p = alarm_probability(chart, limits, 24, pending)
    assert called / 4000 == pytest.approx(p, abs=3.5 * np.sqrt(p * (1 - p) / 4000) + 0.005 * p)


@pytest.mark.parametrize("n", [6, 15])
@pytest.mark.parametrize("chart", [Chart("ewma"), Chart("shewhart")])
def test_limits_hold_for_a_short_baseline(chart: Chart, n: int) -> None:
    # scores against a mean and a standard deviation of n campaigns, as a monitor has them
    rng = np.random.default_rng(n)
    y = rng.standard_normal((4000, n + 24))
    base, later = y[:, :n], y[:, n:]
    t = (later - base.mean(axis=1)[:, None]) / (base.std(axis=1, ddof=1)[:, None] * np.sqrt(1 + 1 / n))
    limits = control_limits(chart, 0.2, 24, 1, 1 / n, float(n - 1))
    called = sum(is_called(chart, limits, z, 1) for z in normal_score(t, n - 1))
    assert called / 4000 == pytest.approx(0.2, abs=3.5 * np.sqrt(0.2 * 0.8 / 4000) + 0.005)


def test_limits_fall_with_the_rate_and_share_it() -> None:
    chart = Chart("ewma")
    tight, wide = control_limits(chart, 0.01, 24), control_limits(chart, 0.3, 24)
    assert tight.chart > wide.chart
    assert tight.score > wide.score
    assert alarm_probability(chart, wide, 24) == pytest.approx(0.3, rel=2e-3)
    assert alarm_probability(Chart("shewhart"), Limits(wide.score), 24) == pytest.approx(0.15, rel=2e-3)


def is_called(chart: Chart, limits: Limits, scores: np.ndarray, pending: int) -> bool:
    outside = chart.outside(scores, limits)[1]
    return bool(np.any(np.convolve(outside, np.ones(pending), "valid") >= pending))
