"""Control charts: run lengths, states of an alarm, and limits under autocorrelation."""

import itertools
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy import stats

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.trend import (
    Chart,
    Condition,
    Event,
    Limits,
    Series,
    State,
    Watch,
    alarm_probability,
    assess,
    average_run_length,
    control_limits,
    step,
    worst,
)
from fecore.trend.autocorrelation import (
    GRID,
    Autocorrelation,
    diagnose,
    normal_score,
    simulated_scores,
    widened,
)


def integral_equation(chart: Chart, limit: float, shift: float) -> float:
    """ARL from Page's integral equation L(u) = 1 + L(0) P(S' = 0) + ∫ L(y) p(y | u) dy, by
    Gauss-Legendre quadrature.
    """
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
    # Montgomery, Introduction to Statistical Quality Control, table of CUSUM run lengths with k =
    # 1/2: two-sided 168 and 465 without a change, twice that for one side
    [(4, 0, 336), (5, 0, 930), (4, 1, 8.38), (5, 1, 10.4), (4, 2, 3.34), (5, 2, 4.01)],
)
def test_cusum_run_lengths_are_the_published_ones(
    limit: float, shift: float, published: float
) -> None:
    assert average_run_length(Chart("cusum", reference=0.5), Limits(limit), shift) == pytest.approx(
        published, rel=5e-3
    )


@pytest.mark.parametrize("shift", [0.0, 0.5, 2.0])
@pytest.mark.parametrize(
    ("chart", "limit"),
    [(Chart("ewma", weight=0.2), 0.9), (Chart("ewma", weight=0.5), 1.6), (Chart("cusum"), 4.0)],
)
def test_the_markov_chain_solves_the_integral_equation(
    chart: Chart, limit: float, shift: float
) -> None:
    exact = integral_equation(chart, limit, shift)
    assert average_run_length(chart, Limits(limit), shift) == pytest.approx(exact, rel=5e-3)
    # the error falls with the square of the cell's width
    errors = [
        abs(average_run_length(chart, Limits(limit), shift, cells=n) - exact) for n in (20, 40)
    ]
    assert errors[1] < 0.4 * errors[0]


def test_shewhart_runs_are_geometric() -> None:
    p = stats.norm.sf(2.5)
    chart = Chart("shewhart")
    assert average_run_length(chart, Limits(2.5)) == pytest.approx(1 / p, rel=1e-12)
    assert average_run_length(chart, Limits(2.5), pending=2) == pytest.approx(
        1 / p + 1 / p**2, rel=1e-6
    )
    assert alarm_probability(chart, Limits(2.5), 24) == pytest.approx(1 - (1 - p) ** 24, rel=1e-9)


@pytest.mark.parametrize("pending", [1, 2])
@pytest.mark.parametrize("chart", [Chart("ewma"), Chart("cusum")])
def test_combined_charts_and_pending_periods_against_simulation(chart: Chart, pending: int) -> None:
    limits = Limits(control_limits(chart, 0.2, 24).chart, 2.2)
    rng = np.random.default_rng(pending)
    called = sum(is_called(chart, limits, z, pending) for z in rng.standard_normal((1000, 24)))
    p = alarm_probability(chart, limits, 24, pending)
    assert called / 1000 == pytest.approx(p, abs=3.5 * np.sqrt(p * (1 - p) / 1000) + 0.005 * p)


@pytest.mark.parametrize("n", [6, 15])
@pytest.mark.parametrize("chart", [Chart("ewma"), Chart("shewhart")])
def test_limits_hold_for_a_short_baseline(chart: Chart, n: int) -> None:
    # scores against a mean and a standard deviation of n campaigns, as a monitor has them
    rng = np.random.default_rng(n)
    y = rng.standard_normal((1000, n + 24))
    base, later = y[:, :n], y[:, n:]
    t = (later - base.mean(axis=1)[:, None]) / (
        base.std(axis=1, ddof=1)[:, None] * np.sqrt(1 + 1 / n)
    )
    limits = control_limits(chart, 0.2, 24, 1, 1 / n, float(n - 1))
    called = sum(is_called(chart, limits, z, 1) for z in normal_score(t, n - 1))
    assert called / 1000 == pytest.approx(0.2, abs=3.5 * np.sqrt(0.2 * 0.8 / 1000) + 0.005)


def is_called(chart: Chart, limits: Limits, scores: np.ndarray, pending: int) -> bool:
    outside = chart.outside(scores, limits)[1]
    return bool(np.any(np.convolve(outside, np.ones(pending), "valid") >= pending))


I, O, M, A = Event.INSIDE, Event.OUTSIDE, Event.MISSING, Event.ACKNOWLEDGE  # noqa: E741
NO_DATA, NORMAL, PENDING, ALARM, SEEN = State


def walk(events: list[Event], pending: int = 2) -> list[State]:
    condition, states = Condition(), []
    for event in events:
        condition = step(condition, event, pending)
        states.append(condition.state)
    return states


@pytest.mark.parametrize(
    ("events", "states"),
    [
        ([I, O, O], [NORMAL, PENDING, ALARM]),
        ([O, I, O], [PENDING, NORMAL, PENDING]),
        ([I, M, I], [NORMAL, NO_DATA, NORMAL]),
        ([O, M, O], [PENDING, NO_DATA, ALARM]),  # a missing campaign is not inside
        ([O, O, I, M], [PENDING, ALARM, ALARM, ALARM]),  # an alarm waits to be seen
        ([O, O, A, O, O], [PENDING, ALARM, SEEN, SEEN, SEEN]),
        ([O, O, A, M, O], [PENDING, ALARM, SEEN, NO_DATA, SEEN]),
        # a new alarm after it was well
        ([O, O, A, I, O, O], [PENDING, ALARM, SEEN, NORMAL, PENDING, ALARM]),
        ([M, M], [NO_DATA, NO_DATA]),
    ],
)
def test_stories(events: list[Event], states: list[State]) -> None:
    assert walk(events) == states


def test_an_alarm_needs_k_in_a_row_and_is_never_lost() -> None:
    for events in itertools.product((I, O, M), repeat=6):
        states = walk(list(events), 3)
        present = [e for e in events if e is not M]
        runs = [sum(1 for _ in group) for event, group in itertools.groupby(present) if event is O]
        assert (ALARM in states) == (max(runs, default=0) >= 3)
        assert ALARM not in states or states[-1] is ALARM


def test_the_worst_state_counts() -> None:
    assert worst((NORMAL, SEEN, NO_DATA)) is NO_DATA
    assert worst((NORMAL, ALARM, PENDING)) is ALARM
    with pytest.raises(InputError, match="states"):
        worst(())
    with pytest.raises(InputError, match="pending"):
        step(Condition(), I, 0)


START = datetime(2024, 1, 15, tzinfo=UTC)
N, HORIZON, CALLED = 12, 24, 0.2


def errors(rng: np.random.Generator, phi: float, length: int, series: int) -> FloatArray:
    """(length, series) of an autoregression with unit variance."""
    e = rng.standard_normal((length, series))
    for i in range(1, length):
        e[i] = phi * e[i - 1] + np.sqrt(1 - phi**2) * e[i]
    return e


def known(phi: float) -> Autocorrelation:
    return Autocorrelation((phi == GRID).astype(float), 30.0, N, ())


def called(e: FloatArray, limits: Limits) -> float:
    """Share of series that an EWMA calls, judged against the mean and scatter of their first
    twelve.
    """
    base, later = e[:N], e[N:]
    sd = base.std(axis=0, ddof=1) * np.sqrt(1 + 1 / N)
    scores = normal_score((later - base.mean(axis=0)) / sd, N - 1)
    runs = [Chart().outside(column, limits)[1].any() for column in scores.T]
    return float(np.mean(runs))


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.8])
def test_limits_hold_where_phi_is_known(phi: float) -> None:
    independent = control_limits(Chart(), CALLED, HORIZON, 1, 1 / N, N - 1)
    limits, factor = widened(independent, Chart(), known(phi), campaigns=HORIZON, pending=1)
    assert limits.chart == pytest.approx(factor * independent.chart)
    e = errors(np.random.default_rng(5), phi, N + HORIZON, 1500)
    # four standard errors of 1500 series, and of the 4000 of which the factor comes
    assert called(e, limits) == pytest.approx(CALLED, abs=0.05)
    if phi == 0:
        assert factor == pytest.approx(1, abs=1e-6)
    else:
        assert called(e, independent) > CALLED + 0.15


def test_phi_is_found_in_a_long_baseline_and_has_no_bias_downwards() -> None:
    rng, days = np.random.default_rng(3), 30.0 * np.arange(60)
    X = np.column_stack([np.ones(60), np.cos(2 * np.pi * np.arange(60) / 12)])
    for phi, low, high in ((0.0, 0.0, 0.12), (0.6, 0.5, 0.7)):
        found = [diagnose(X, column, np.ones(60), days) for column in errors(rng, phi, 60, 40).T]
        assert low <= np.mean([one.mean for one in found]) <= high
        assert np.mean([one.interval_95[0] <= phi <= one.interval_95[1] for one in found]) >= 0.9


def test_gaps_between_campaigns_do_not_hide_how_alike_they_are() -> None:
    """A third of the campaigns is missing: by their dates the others are as alike as they were, by
    their number less.
    """
    rng = np.random.default_rng(8)
    kept = np.sort(rng.choice(200, 135, replace=False))
    e = errors(rng, 0.7, 200, 1)[kept, 0]
    X, sd = np.ones((135, 1)), np.ones(135)
    dated, counted = (diagnose(X, e, sd, 30.0 * days) for days in (kept, np.arange(135)))
    assert dated.interval_days == 30.0
    assert dated.mean == pytest.approx(0.7, abs=0.12)
    assert counted.mean < dated.mean


def test_a_short_baseline_widens_by_what_it_shows_and_says_so() -> None:
    watch = Watch({"Ex": "fall"}, N, (), 0.01, HORIZON)
    rng = np.random.default_rng(11)
    factors = {}
    for phi in (0.0, 0.6):
        trends = []
        for column in errors(rng, phi, N + HORIZON, 60).T:
            dates = [START + timedelta(days=30 * i) for i in range(N + HORIZON)]
            series = Series("Ex", dates, 32e9 * (1 + 0.005 * column), np.full(N + HORIZON, 1e6))
            trends.append(assess({"Ex": series}, watch).parameters["Ex"])
        factors[phi] = np.mean([trend.widened_by for trend in trends])
        for trend in trends:
            wide = any("resemble their neighbours" in note for note in trend.notes)
            assert wide is (trend.widened_by is not None and trend.widened_by >= 1.15)
    assert 1.0 <= factors[0.0] < factors[0.6]


def test_limits_that_nothing_reaches_are_not_widened() -> None:
    limits = Limits(1e6, 1e6)
    assert widened(limits, Chart(), known(0.8), campaigns=HORIZON, pending=1) == (limits, 1.0)


@pytest.mark.parametrize("degrees_of_freedom", [1, 6, 40])
def test_the_table_of_scores_is_as_exact_as_it_says(degrees_of_freedom: int) -> None:
    t = np.random.default_rng(0).standard_t(degrees_of_freedom, 20_000) * np.geomspace(
        1, 30, 20_000
    )
    t = t[np.abs(t) < 1e6]
    np.testing.assert_allclose(
        simulated_scores(t, degrees_of_freedom),
        normal_score(t, degrees_of_freedom),
        rtol=0,
        atol=2e-5,
    )
