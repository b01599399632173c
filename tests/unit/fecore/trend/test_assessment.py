"""A monitor's judgement of whole series: alarms, missing and late campaigns, covariates,
families.
"""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from fecore.errors import InputError
from fecore.trend import (
    Acknowledgement,
    Chart,
    Event,
    Series,
    State,
    Watch,
    assess,
    fit_baseline,
    in_time_order,
    rate,
    score,
)
from fecore.trend.document import describe_trend

START = datetime(2024, 1, 1, tzinfo=UTC)
WATCH = Watch({"Ex": "fall"}, baseline=8, expected_interval_days=30)


def dates(n: int) -> tuple[datetime, ...]:
    return tuple(START + timedelta(days=30 * i) for i in range(n))


def stiffness(n: int = 14, loss_from: int = 99, seed: int = 1, **covariates: np.ndarray) -> Series:
    rng = np.random.default_rng(seed)
    y = 32e9 * (1 + 0.003 * rng.standard_normal(n)) * np.where(np.arange(n) >= loss_from, 0.95, 1.0)
    return Series(
        "Ex", dates(n), y, np.full(n, 0.001 * 32e9), covariates, tuple(f"c{i}" for i in range(n))
    )


def warm(n: int = 30, lowest: float = 5, highest: float = 35, seed: int = 2) -> Series:
    t = lowest + (highest - lowest) * (0.5 + 0.5 * np.cos(2 * np.pi * np.arange(n) / 12))
    s = stiffness(n, seed=seed, temperature_c=t)
    return replace(s, estimate=s.estimate * (1 - 0.001 * (t - 20)))


def warm_but(temperatures: dict[int, float]) -> Series:
    """With other temperatures stated at some campaigns."""
    series = warm()
    t = series.covariates["temperature_c"].copy()
    t[list(temperatures)] = list(temperatures.values())
    return replace(series, covariates={"temperature_c": t})


def test_a_loss_raises_one_alarm_that_says_when_and_how_much() -> None:
    trend = assess({"Ex": stiffness(loss_from=11)}, WATCH).parameters["Ex"]
    assert [m.state for m in trend.timeline] == [State.NORMAL] * 3 + [State.ALARM] * 3
    assert trend.timeline[3].label == "c11"
    assert trend.change.interval == (3, 3)
    assert trend.change.size == pytest.approx(-0.05 * 32e9, rel=0.15)
    assert trend.rate.relative_interval_95[1] < 0


def test_a_judged_parameter_is_plain_json_with_or_without_a_baseline() -> None:
    watch = replace(WATCH, covariates=("temperature_c",))
    for count in (14, 4):
        trend = assess({"Ex": warm(count)}, watch).parameters["Ex"]
        stated = json.loads(json.dumps(describe_trend(trend), allow_nan=False))
        assert [row["campaign_id"] for row in stated["points"]] == list(trend.series.labels)
        assert [row["state"] for row in stated["timeline"]] == [
            m.state.value for m in trend.timeline
        ]
        known = trend.baseline is not None
        assert known == (count == 14)
        assert [stated[name] is not None for name in ("baseline", "autocorrelation", "limits")] == [
            known
        ] * 3
        assert [row["in_baseline"] for row in stated["points"]] == [
            known and i < 8 for i in range(count)
        ]
        assert [row["judged"] is not None for row in stated["points"]] == [
            known and i >= 8 for i in range(count)
        ]
        assert all((row["corrected"] is None) != known for row in stated["points"])
        if trend.baseline is not None:
            (covariate,) = stated["baseline"]["covariates"]
            assert covariate["slope"] == pytest.approx(trend.baseline.fit.coefficients[1])
            assert covariate["name"] == "temperature_c"


def test_the_rate_of_a_loss_that_goes_on_is_the_one_since_its_onset() -> None:
    """4.8 % a year from the twelfth of 26 campaigns on; a line through the baseline too has its
    interval elsewhere.
    """
    n, truth, covered, over_all = 26, -0.048, [], []
    years = np.array([(date - dates(n)[11]).days for date in dates(n)]) / 365.25
    for seed in range(25):
        series = stiffness(n, seed=seed)
        series = replace(series, estimate=series.estimate * (1 + truth * np.maximum(0.0, years)))
        trend = assess({"Ex": series}, replace(WATCH, baseline=12)).parameters["Ex"]
        if trend.change.pattern == "ramp":
            assert trend.rate.since is not None
            low, high = trend.rate.relative_interval_95
            covered.append(low <= truth <= high)
            line = rate(series, (), trend.baseline.mean)
            over_all.append(line.relative_interval_95[0] <= truth <= line.relative_interval_95[1])
    assert len(covered) >= 23
    assert np.mean(covered) >= 0.82  # 95 % of 25 draws less three standard deviations of that share
    assert np.mean(over_all) < 0.1


def test_an_unchanged_structure_is_normal_and_a_rise_is_no_fall() -> None:
    assert assess({"Ex": stiffness()}, WATCH).state is State.NORMAL
    stiffer = stiffness(loss_from=10)
    stiffer = replace(stiffer, estimate=2 * 32e9 - stiffer.estimate)
    assert assess({"Ex": stiffer}, WATCH).state is State.NORMAL
    assert assess({"Ex": stiffer}, replace(WATCH, directions={"Ex": "rise"})).state is State.ALARM
    both = assess({"Ex": stiffer}, replace(WATCH, directions={"Ex": "both"})).parameters["Ex"]
    assert both.state is State.ALARM
    assert set(both.statistic) == {"fall", "rise"}


def test_an_acknowledged_alarm_stays_acknowledged_while_outside() -> None:
    seen = Acknowledgement("Ex", dates(14)[12] + timedelta(days=1))
    trend = assess({"Ex": stiffness(loss_from=11)}, WATCH, acknowledgements=[seen]).parameters["Ex"]
    assert [m.state for m in trend.timeline[3:]] == [
        State.ALARM, State.ALARM, State.ACKNOWLEDGED, State.ACKNOWLEDGED,
    ]  # fmt: skip
    with pytest.raises(InputError, match="only an alarm"):
        assess({"Ex": stiffness()}, WATCH, acknowledgements=[seen])
    with pytest.raises(InputError, match="not watched"):
        assess({"Ex": stiffness()}, WATCH, acknowledgements=[replace(seen, parameter="Ey")])


def test_a_late_campaign_is_no_data() -> None:
    series, last = stiffness(), dates(14)[-1]
    assert assess({"Ex": series}, WATCH, as_of=last + timedelta(days=44)).state is State.NORMAL
    late = assess({"Ex": series}, WATCH, as_of=last + timedelta(days=46)).parameters["Ex"]
    assert late.state is State.NO_DATA
    assert late.timeline[-1].event is Event.MISSING
    assert late.timeline[-1].date == last + timedelta(days=45)
    unhurried = replace(WATCH, expected_interval_days=None)
    assert assess({"Ex": series}, unhurried, as_of=last + timedelta(days=999)).state is State.NORMAL


def test_campaigns_out_of_order_give_the_same_and_a_note() -> None:
    series = stiffness(loss_from=11)
    order = [*range(6), 12, *range(6, 12), 13]
    mixed = Series(
        "Ex", [series.dates[i] for i in order], series.estimate[order], series.standard_deviation[order],
        labels=[series.labels[i] for i in order],
    )  # fmt: skip
    expected, found = (assess({"Ex": s}, WATCH).parameters["Ex"] for s in (series, mixed))
    assert found.timeline == expected.timeline
    assert "c6, c7, c8, c9, c10, c11 came after later campaigns" in found.notes[0]
    assert expected.notes == ()
    assert in_time_order(series)[0] is series


def test_before_the_baseline_is_complete_there_is_no_data() -> None:
    trend = assess({"Ex": stiffness(5)}, WATCH).parameters["Ex"]
    assert (trend.state, trend.baseline) == (State.NO_DATA, None)
    assert trend.notes == ("no baseline yet: 5 of 8 campaigns",)
    assert assess({"Ex": stiffness(8)}, WATCH).state is State.NO_DATA  # nothing to judge yet


def test_seasons_are_regressed_out() -> None:
    watch = Watch({"Ex": "both"}, 12, ("temperature_c",))
    trend = assess({"Ex": warm()}, watch).parameters["Ex"]
    assert trend.state is State.NORMAL
    slope, sd = trend.baseline.fit.coefficients[1], np.sqrt(trend.baseline.fit.covariance[1, 1])
    assert abs(slope + 0.001 * 32e9) < 3 * sd
    assert np.std(trend.scores.corrected) < 0.005 * 32e9
    assert assess({"Ex": warm()}, Watch({"Ex": "both"}, 12)).parameters["Ex"].baseline is not None


def test_extrapolation_beyond_the_baselines_temperatures_is_said_and_widens() -> None:
    hot = warm_but({20: 60.0, 21: 21.0})
    baseline, watched, _ = fit_baseline(hot, 12, ("temperature_c",))
    scores = score(baseline, watched)
    assert np.flatnonzero(scores.extrapolated).tolist() == [8]
    assert scores.residual_sd[8] > 1.5 * scores.residual_sd[9]
    notes = (
        assess({"Ex": hot}, Watch({"Ex": "fall"}, 12, ("temperature_c",))).parameters["Ex"].notes
    )
    assert "temperature_c 5 to 35" in notes[0]
    assert notes[0].endswith(": c20")


def test_a_missing_temperature_is_judged_with_the_spread_that_it_may_cause() -> None:
    unknown = warm_but({20: np.nan})
    baseline, watched, _ = fit_baseline(unknown, 12, ("temperature_c",))
    scores = score(baseline, watched)
    spread = abs(baseline.fit.coefficients[1]) * np.sqrt(baseline.variance[0])
    assert scores.missing.tolist() == [i == 8 for i in range(18)]
    assert scores.residual_sd[8] > spread
    trend = assess({"Ex": unknown}, Watch({"Ex": "both"}, 12, ("temperature_c",))).parameters["Ex"]
    assert trend.state is State.NORMAL
    assert trend.notes[-1].endswith("the baseline saw: c20")


def test_a_baseline_campaign_without_temperature_is_left_out_and_named() -> None:
    trend = assess(
        {"Ex": warm_but({3: np.nan})}, Watch({"Ex": "fall"}, 12, ("temperature_c",))
    ).parameters["Ex"]
    assert "c3" not in trend.baseline.labels
    assert trend.baseline.labels[-1] == "c12"
    assert trend.notes[0] == "left out of the baseline, a covariate is missing: c3"
    bare = assess({"Ex": stiffness()}, Watch({"Ex": "fall"}, 8, ("temperature_c",))).parameters[
        "Ex"
    ]
    assert bare.notes == ("no baseline yet: 0 of 8 campaigns with temperature_c",)


def test_overstated_standard_deviations_are_noticed() -> None:
    series = stiffness()
    vague = replace(series, standard_deviation=np.full(14, 0.02 * 32e9))
    assert "larger than the scatter" in assess({"Ex": vague}, WATCH).parameters["Ex"].notes[0]


@pytest.mark.long
def test_the_false_alarm_rate_of_a_family_is_held() -> None:
    """In short limits hold in `test_charts.py`."""
    watch = Watch(
        {"Ex": "fall", "a0": "rise"}, 10, chart=Chart("ewma"), false_alarm_rate=0.02, horizon=12
    )
    rng = np.random.default_rng(12)
    called = 0
    for _ in range(50):
        series = {
            name: Series(name, dates(22), 1 + 0.01 * rng.standard_normal(22), np.full(22, 0.003))
            for name in ("Ex", "a0")
        }
        called += any(
            m.state is State.ALARM
            for p in assess(series, watch).parameters.values()
            for m in p.timeline
        )
    rate = 1 - (1 - called / 50) ** (1 / 12)
    # ten campaigns cannot exclude that they resemble their neighbours, so the limits are wider than
    # need be
    assert 0.02 / 5 <= rate <= 0.02  # ± 0.004 of 50 families


def test_a_temperature_that_runs_with_time_leaves_the_rate_unknown_and_says_so() -> None:
    """Ageing and warming cannot be separated then; the judgement itself goes on."""
    n = 16
    days = np.array([(date - dates(n)[0]).days for date in dates(n)], dtype=float)
    series = stiffness(n, temperature=10 + 0.05 * days)
    trend = assess(
        {"Ex": series}, Watch({"Ex": "fall"}, covariates=("temperature",), baseline=8)
    ).parameters["Ex"]
    assert trend.rate is None
    assert any("no rate of change" in note for note in trend.notes)
    assert trend.scores is not None
