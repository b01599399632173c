"""Coupons and series that the core refuses: each a call, and how the `InputError` begins that ends
it.
"""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from fecore.coupons import d3039, d3518
from fecore.coupons.batch import CouponResult, Statistics, prior, summarise
from fecore.coupons.curves import Curve
from fecore.trend import Chart, Condition, Event, Series, Watch, assess, control_limits, step
from fecore.trend.baseline import fit_with_scatter

WIDE, THICK = (25e-3,), (2e-3,)
STRAIN = np.linspace(0, 0.01, 201)
FORCE = 2e6 * STRAIN
AT = np.arange(201)
GAMMA = np.array([0, 1, 2, 3, 4, 5, 6, 8, 12]) * 1e-3
SHEAR = Curve(450e3 * GAMMA, 0.6 * GAMMA, transverse_strain=-0.4 * GAMMA)
DATES = [datetime(2024, 1, 1, tzinfo=UTC) + timedelta(days=30 * i) for i in range(14)]
NOISE = np.random.default_rng(1).standard_normal(14)
SERIES = Series(
    "Ex",
    DATES,
    32e9 * (1 + 0.003 * NOISE),
    np.full(14, 3.2e7),
    {},
    tuple(f"c{i}" for i in range(14)),
)
WATCH = Watch({"Ex": "fall"}, baseline=8, expected_interval_days=30)


def reduced(
    force: np.ndarray = FORCE, strain: np.ndarray = STRAIN, width: Any = WIDE, **more: Any
) -> object:
    return d3039.reduce(Curve(force, strain), width, THICK, **more)


def sheared(curve: Curve = SHEAR, **more: Any) -> object:
    return d3518.reduce(curve, WIDE, THICK, **more)


def changed(values: np.ndarray, at: int, value: float) -> np.ndarray:
    return np.where(AT[: len(values)] == at, value, values)


def watched(series: Series = SERIES, **change: Any) -> object:
    return assess({"Ex": series}, replace(WATCH, **change))


def acknowledged(*events: Event) -> object:
    condition = Condition()
    for event in (*events, Event.ACKNOWLEDGE):
        condition = step(condition, event, 2)
    return condition


# fmt: off
SERIES_AND_COUPONS: list[tuple[Callable[[], object], str]] = [
    (lambda: prior(Statistics(5, 1.0, 0.0)), "standard_deviation: is 0; specimens that agree to the last digit were not"),
    (lambda: prior(Statistics(1, 1.0, 0.1)), "n: is 1, but a scatter needs at least two specimens"),
    (lambda: prior(Statistics(None, 0.0, None)), "mean: is 0, so a relative scatter means nothing; state the standard"),
    (lambda: summarise([]), "specimens: none of 0 counts"),
    (lambda: summarise([CouponResult("a"), CouponResult("a")]), "specimens: a is in the batch twice; every specimen has a"),
    (lambda: summarise([CouponResult("a", exclusion_reason="broken")]), "specimens: none of 1 counts"),
    (lambda: reduced(-FORCE), "force_n: is never positive; tension is positive, turn the sign"),
    (lambda: reduced(strain=STRAIN * 1e6), "strain: reaches 1e+04 m/m; is it in µε or per cent?"),
    (lambda: reduced(changed(FORCE, 7, np.nan)), "force_n: is not a number at point 8 of 201"),
    (lambda: reduced(strain=changed(STRAIN, 7, np.nan)), "strain: is not a number at point 8, and is again later; fill or"),
    (lambda: reduced(strain=STRAIN[:-1]), "strain: has shape (200,), expected (201,) as the force"),
    (lambda: reduced(FORCE[::25], STRAIN[::25]), "strain: the closest points to 1000–3000 µε are at 1250 and 2500 µε, too"),
    (lambda: reduced(strain=changed(STRAIN, 40, 0.0016)), "strain: runs back by 350 µε at point 41, within 1000–3000 µε"),
    (lambda: reduced(strain=STRAIN + 0.0012), "strain: begins at 1200 µε only, the range is 1000–3000 µε"),
    (lambda: reduced(np.r_[1e6, FORCE[1:]]), "force_n: is largest at point 1, expected at least 5 points up to there"),
    (lambda: reduced(strain=STRAIN / 4, chord_range=(1e-3, 3e-3)), "strain: reaches 2500 µε only, the range is 1000–3000 µε"),
    (lambda: reduced(strain=STRAIN + 0.19 * (AT >= 40), chord_range=(1e-3, 3e-3)),
     "strain: reaches 1950 µε only, the range is 1000–3000 µε"),
    (lambda: reduced(width=()), "width_m: has no reading"),
    (lambda: reduced(width=(25e-3, -1.0)), "width_m: has a reading that is not a positive number"),
    (lambda: reduced(width=(25e-3, 25.0)), "width_m: has readings from 0.025 to 25 m; is one in another unit?"),
    (lambda: sheared(Curve(SHEAR.force_n, SHEAR.strain)), "transverse_strain: is missing; γ = ε_x − ε_y needs it"),
    (lambda: sheared(chord_start=0.001), "chord_start: is 1000 µε, expected 1500 to 2500"),
    (lambda: sheared(SHEAR.part(0, 6)), "shear_strain: reaches 5000 µε only, the range is 2000–6000 µε"),
    (lambda: sheared(chord_start=2500e-6), "shear_strain: the closest points to 2500–6500 µε are at 2000 and 6000 µε,"),
    (lambda: replace(SERIES, estimate=changed(SERIES.estimate, 3, np.nan)), "estimate: of campaign c3 is not a finite"),
    (lambda: replace(SERIES, standard_deviation=SERIES.standard_deviation * 0),
     "standard_deviation: of campaign c0 is not positive; an exact estimate does not exist"),
    (lambda: replace(SERIES, dates=[d.replace(tzinfo=None) if i else d for i, d in enumerate(DATES)]),
     "dates: some have a time zone and some have none; give all of them one"),
    (lambda: replace(SERIES, dates=[], estimate=np.zeros(0)), "dates: the series Ex is empty, expected at least one campaign"),
    (lambda: replace(SERIES, estimate=SERIES.estimate[:3]), "estimate: has shape (3,), expected (14,)"),
    (lambda: replace(SERIES, covariates={"T": np.ones(3)}), "covariates.T: has shape (3,), expected (14,)"),
    (lambda: replace(SERIES, covariates={"T": np.full(14, np.inf)}), "covariates.T: is infinite; use NaN where it was not"),
    (lambda: replace(SERIES, labels=("a",)), "labels: 1 labels for 14 campaigns"),
    (lambda: watched(directions={}), "directions: is empty, expected at least one watched parameter"),
    (lambda: watched(directions={"Ex": "down"}), "directions.Ex: is 'down', expected fall, rise or both"),
    (lambda: watched(false_alarm_rate=0.0), "false_alarm_rate: is 0.0, expected between 0 and 0.5 a campaign"),
    (lambda: watched(pending=0), "horizon: is 24 with a pending period of 0, expected 1 ≤ k ≤ H"),
    (lambda: watched(expected_interval_days=-1.0), "expected_interval_days: is -1.0, expected a positive number"),
    (lambda: watched(baseline=3), "baseline: 3 campaigns, expected at least 4 for 0 covariates"),
    (lambda: watched(directions={"Ey": "fall"}), "series.Ey: is missing; there are Ex"),
    (lambda: watched(replace(SERIES, dates=[*DATES[:13], DATES[4]])), "dates: campaigns c4 and c13 are both of"),
    (lambda: watched(replace(SERIES, covariates={"t": np.full(14, 20.0)}), covariates=("t",)),
     "covariates.t: does not vary in the baseline, so its effect is not known"),
    (lambda: fit_with_scatter(np.ones((3, 2)), np.ones(3), np.ones(3)), "points: 3 points for 2 coefficients and their"),
    (lambda: fit_with_scatter(np.ones((8, 2)), np.arange(8.0), np.ones(8)), "covariates: the points do not separate the"),
    (lambda: control_limits(Chart(), 1.5, 24), "probability: is 1.5, expected between 0 and 1"),
    (lambda: control_limits(Chart(), 0.1, 1, 2), "campaigns: 1 campaigns and a pending period of 2: nothing can be called"),
    (lambda: Chart("moving"), "chart.kind: is 'moving', expected ewma, cusum or shewhart"),
    (lambda: Chart(weight=0.0), "chart.weight: is 0.0, expected 0 < weight ≤ 1"),
    (lambda: Chart("cusum", reference=-1.0), "chart.reference: is -1.0, expected 0 < reference < 10"),
    (lambda: Chart(jump_share=1.0), "chart.jump_share: is 1.0, expected 0 ≤ jump_share < 1"),
    (lambda: acknowledged(), "state: is no data; only an alarm can be acknowledged"),
    (lambda: acknowledged(Event.INSIDE), "state: is normal; only an alarm can be acknowledged"),
    (lambda: acknowledged(Event.OUTSIDE), "state: is pending; only an alarm can be acknowledged"),
    (lambda: acknowledged(Event.OUTSIDE, Event.OUTSIDE, Event.ACKNOWLEDGE), "state: is acknowledged; only an alarm can be"),
]
# fmt: on
