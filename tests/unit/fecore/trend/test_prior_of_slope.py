"""What is known beforehand of a parameter's change by temperature is the prior of its
regression.
"""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from fecore.trend import Series, Watch, assess, fit_baseline, rate, score
from fecore.trend.document import describe_trend

START = datetime(2025, 1, 1, tzinfo=UTC)
LEVEL, SLOPE, NOISE = 32e9, -0.0015, 0.002
PRIOR = (-0.002, 0.0015)


def series(temperature: np.ndarray, random: np.random.Generator, slope: float = SLOPE) -> Series:
    y = LEVEL * (1 + slope * (temperature - 20) + NOISE * random.standard_normal(temperature.size))
    dates = tuple(START + timedelta(days=30 * i) for i in range(temperature.size))
    return Series("Gxy", dates, y, np.full(y.size, NOISE * LEVEL), {"temperature_c": temperature})


def relative(found: Series, n: int, prior: tuple[float, float] | None) -> tuple[float, float]:
    """Slope and its standard deviation, relative to the level."""
    fit = fit_baseline(found, n, ("temperature_c",), prior)[0].fit
    return fit.coefficients[1] / LEVEL, np.sqrt(fit.covariance[1, 1]) / LEVEL


def test_a_baseline_that_saw_one_temperature_keeps_to_the_prior_and_one_that_saw_many_overrules_it() -> (
    None
):
    random = np.random.default_rng(1)
    narrow = series(20 + 0.05 * random.standard_normal(8), random)
    slope, sd = relative(narrow, 8, PRIOR)
    assert (slope, sd) == (pytest.approx(PRIOR[0], abs=0.0005), pytest.approx(PRIOR[1], rel=0.1))
    assert relative(narrow, 8, None)[1] > 5 * PRIOR[1]
    wide = series(20 + 12 * random.standard_normal(30), random)
    assert relative(wide, 30, PRIOR)[0] == pytest.approx(relative(wide, 30, None)[0], abs=2e-5)
    exact = relative(wide, 30, (-0.003, 1e-7))
    assert exact[0] == pytest.approx(-0.003, rel=1e-2)


def test_scores_of_an_unchanged_structure_far_from_its_baselines_temperatures_are_standard_normal() -> (
    None
):
    random, scores = np.random.default_rng(2), []
    for _ in range(150):
        temperature = np.append(20 + 1.0 * random.standard_normal(8), 32.0)
        found = series(temperature, random, PRIOR[0] + PRIOR[1] * random.standard_normal())
        baseline, watched, _ = fit_baseline(found, 8, ("temperature_c",), PRIOR)
        assert watched is not None
        scores.append(score(baseline, watched).score[0])
    assert np.mean(np.abs(scores) > 2) <= 0.07
    assert abs(np.mean(scores)) < 0.2


def test_the_temperature_is_taken_out_once() -> None:
    random = np.random.default_rng(3)
    season = 20 + 10 * np.sin(np.arange(36))
    found = series(season, random)
    watch = Watch({"Gxy": "both"}, 12, ("temperature_c",), per_kelvin={"Gxy": PRIOR})
    trend = assess({"Gxy": found}, watch).parameters["Gxy"]
    corrected = score(trend.baseline, found).corrected
    assert abs(np.polyfit(season, corrected, 1)[0]) < 0.0002 * LEVEL
    assert np.std(corrected) < 1.5 * NOISE * LEVEL
    assert trend.rate == rate(found, ("temperature_c",), trend.baseline.mean, PRIOR)


def test_the_document_has_the_parameter_over_temperature() -> None:
    random = np.random.default_rng(4)
    found = series(20 + 8 * random.standard_normal(16), random)
    watch = Watch({"Gxy": "fall"}, 12, ("temperature_c",), per_kelvin={"Gxy": PRIOR})
    curve = describe_trend(assess({"Gxy": found}, watch).parameters["Gxy"])["curve"]
    true = LEVEL * (1 + SLOPE * (np.array(curve["temperature_c"]) - 20))
    assert np.all((curve["low"] < true) & (true < curve["high"]))
    assert abs(curve["per_K"] - SLOPE) < 3 * curve["per_K_sd"]
    plain = assess({"Gxy": found}, Watch({"Gxy": "fall"}, 12)).parameters["Gxy"]
    assert describe_trend(plain)["curve"] is None
