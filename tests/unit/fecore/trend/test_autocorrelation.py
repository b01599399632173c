"""Campaigns that resemble their neighbours: φ is found in a baseline, and the limits hold in spite of it."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.trend import Chart, Limits, Series, Watch, assess, control_limits
from fecore.trend.autocorrelation import GRID, Autocorrelation, diagnose, normal_score, simulated_scores, widened

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
    """Share of series that an EWMA calls, judged against the mean and scatter of their first twelve."""
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
    """A third of the campaigns is missing: by their dates the others are as alike as they were, by their number less."""
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
    t = np.random.default_rng(0).standard_t(degrees_of_freedom, 20_000) * np.geomspace(1, 30, 20_000)
    t = t[np.abs(t) < 1e6]
    np.testing.assert_allclose(
        simulated_scores(t, degrees_of_freedom), normal_score(t, degrees_of_freedom), rtol=0, atol=2e-5
    )
