"""Regression with scatter between campaigns, change points and rates: closed forms and coverage."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy import stats

from fecore.errors import InputError
from fecore.trend import Series, change_point, fit_baseline, rate, score
from fecore.trend.baseline import fit_with_scatter
from tests.support.lengths import long

START = datetime(2025, 1, 1, tzinfo=UTC)


def dates(n: int) -> tuple[datetime, ...]:
    return tuple(START + timedelta(days=30 * i) for i in range(n))


def test_without_own_uncertainty_it_is_students_t() -> None:
    rng = np.random.default_rng(1)
    X = np.column_stack([np.ones(12), rng.standard_normal(12)])
    y = 32e9 * (1 + 0.005 * rng.standard_normal(12))
    fit = fit_with_scatter(X, y, np.full(12, 1.0))
    beta, rss = np.linalg.lstsq(X, y, rcond=None)[:2]
    np.testing.assert_allclose(fit.coefficients, beta, rtol=1e-10)
    assert fit.total_variance == pytest.approx(rss[0] / 10, rel=1e-6)
    assert fit.degrees_of_freedom == pytest.approx(10, rel=1e-4)


def test_where_own_uncertainty_explains_all_it_is_normal() -> None:
    rng = np.random.default_rng(2)
    X = np.ones((60, 1))
    fits = [fit_with_scatter(X, rng.standard_normal(60), np.ones(60)) for _ in range(40)]
    # sixty points know their variance to 0.18; some of what lies above 1 is always allowed for
    assert 1 <= np.median([f.total_variance for f in fits]) < 1.1
    assert np.median([f.degrees_of_freedom for f in fits]) > 100


def test_mixed_uncertainties_weigh_as_they_should() -> None:
    s = np.array([1.0, 1.0, 1.0, 1.0, 3.0, 3.0])
    y = np.array([1.0, -1.0, 0.5, -0.5, 3.0, -2.0])
    fit = fit_with_scatter(np.ones((6, 1)), y, s)
    w = 1 / (s**2 + fit.between_sd**2)
    assert fit.coefficients[0] == pytest.approx(w @ y / w.sum(), rel=1e-12)
    assert fit.covariance[0, 0] == pytest.approx(1 / w.sum(), rel=1e-12)


@pytest.mark.parametrize("ratio", [long(0.0), 2.0])
def test_scores_of_an_unchanged_structure_are_standard_normal(ratio: float) -> None:
    # ratio = scatter between campaigns over own standard deviation
    rng = np.random.default_rng(4)
    scores = []
    for _ in range(400):
        temperature = 20 + 8 * rng.standard_normal(13)
        y = (
            100
            - 0.1 * (temperature - 20)
            + 0.3 * (rng.standard_normal(13) + ratio * rng.standard_normal(13))
        )
        series = Series("Ex", dates(13), y, np.full(13, 0.3), {"temperature_c": temperature})
        baseline, watched, _ = fit_baseline(series, 12, ("temperature_c",))
        scores.append(score(baseline, watched).score[0])
    # 4.6 % lie beyond 2 sd; without any scatter between campaigns fewer do, as some is always
    # allowed for
    assert (0.01 if ratio == 0 else 0.025) <= np.mean(np.abs(scores) > 2) <= 0.07
    assert (0.78 if ratio == 0 else 0.9) <= np.std(scores) <= 1.1


@pytest.mark.parametrize("ratio", [*map(long, (0.0, 0.9)), 1.33, long(30.0)])
def test_no_scatter_between_campaigns_makes_scores_larger_than_stated(ratio: float) -> None:
    """P(score > 2.3) of later campaigns, known exactly for each baseline as the truth is: at most
    what Φ says.
    """
    rng = np.random.default_rng(7)
    n, own, tails = 12, 1 / np.hypot(1, ratio), []
    for y in rng.standard_normal((500, n)):
        fit = fit_with_scatter(np.ones((n, 1)), y, np.full(n, own))
        limit = stats.t.isf(stats.norm.sf(2.3), fit.degrees_of_freedom) * np.sqrt(
            fit.covariance[0, 0] + own**2 + fit.between_sd**2
        )
        tails.append(stats.norm.sf(limit + fit.coefficients[0]))
    relative, error = np.array([np.mean(tails), np.std(tails) / np.sqrt(500)]) / stats.norm.sf(2.3)
    assert relative < 1 + 3 * error
    assert error < 0.1  # 1.4 would be seen
    if ratio > 1:  # where the scatter is seen it is not overstated either
        assert relative > 1 - 3 * error


@pytest.mark.parametrize("pattern", ["step", long("ramp")])
def test_intervals_of_the_change_point_cover_it(pattern) -> None:
    rng = np.random.default_rng(5)
    n, m, at, held, named = 12, 16, 6, 0, 0
    sets = 150
    for _ in range(sets):
        later = np.arange(m) - at
        change = np.where(later >= 0, -1.5 if pattern == "step" else -0.4 * (later + 1), 0.0)
        y = 100 + np.r_[np.zeros(n), change] + 0.5 * rng.standard_normal(n + m)
        series = Series("Ex", dates(n + m), y, np.full(n + m, 1e-3))
        baseline, watched, _ = fit_baseline(series, n)
        scores = score(baseline, watched)
        found = change_point(
            series.dates[n - 1 :], series.days[n - 1 :], scores.residual, scores.covariance(baseline),
            baseline.fit.degrees_of_freedom, pattern=pattern,
        )  # fmt: skip
        held += found.interval[0] <= at <= found.interval[1]
        chosen = change_point(
            series.dates[n - 1 :], series.days[n - 1 :], scores.residual, scores.covariance(baseline),
            baseline.fit.degrees_of_freedom,
        )  # fmt: skip
        named += chosen.pattern == pattern
    assert 0.88 <= held / sets <= 0.99
    assert named / sets > 0.8


def test_the_size_of_a_change_is_its_size() -> None:
    y = np.r_[100.0, 100.2, 99.8, 100.1, 99.9, 100.0, 97.0, 97.1, 96.9, 97.0]
    series = Series("Ex", dates(10), y, np.full(10, 0.1))
    baseline, watched, _ = fit_baseline(series, 6)
    scores = score(baseline, watched)
    found = change_point(
        series.dates[5:],
        series.days[5:],
        scores.residual,
        scores.covariance(baseline),
        baseline.fit.degrees_of_freedom,
    )
    assert (found.pattern, found.index, found.interval) == ("step", 0, (0, 0))
    assert found.date_interval == (series.dates[5], series.dates[6])
    assert found.size == pytest.approx(-3.0, abs=0.01)
    with pytest.raises(InputError, match="at least 2"):
        change_point(series.dates[:2], series.days[:2], np.ones(1), np.eye(1), 5.0)


def test_intervals_of_the_rate_cover_it_beside_seasons() -> None:
    rng = np.random.default_rng(6)
    held, sets, n = 0, 100, 30
    t = np.arange(n) * 30 / 365.25
    for _ in range(sets):
        temperature = 20 + 15 * np.cos(2 * np.pi * t) + 2 * rng.standard_normal(n)
        y = 100 * (1 - 0.024 * t - 0.001 * (temperature - 20) + 0.004 * rng.standard_normal(n))
        y += 0.3 * rng.standard_normal(n)
        found = rate(Series("Ex", dates(n), y, np.full(n, 0.3), {"T": temperature}), ("T",), 100.0)
        held += found.interval_95[0] <= -2.4 <= found.interval_95[1]
        assert (
            found.relative_interval_95[0] < found.relative_per_year < found.relative_interval_95[1]
        )
    assert 0.88 <= held / sets <= 0.99


def test_the_rate_of_a_line_is_its_slope() -> None:
    rng = np.random.default_rng(7)
    t = np.arange(20) * 30 / 365.25
    y = 5 - 0.3 * t + 0.01 * rng.standard_normal(20)
    found = rate(Series("a", dates(20), y, np.full(20, 1e-6)), (), 5.0)
    line = stats.linregress(t, y)
    assert found.per_year == pytest.approx(line.slope, rel=1e-6)
    assert found.standard_deviation == pytest.approx(line.stderr, rel=1e-3)
    assert found.relative_per_year == pytest.approx(line.slope / 5, rel=1e-6)
    with pytest.raises(InputError, match="baseline_mean"):
        rate(Series("a", dates(20), y, np.full(20, 1e-6)), (), 0.0)
