"""Condition monitoring on simulated series: false alarms and detection delays, beside Shewhart's
chart.

Monthly campaigns of a beam: 12 make the baseline, 24 follow, a change comes with the 7th of these.
The stiffness Ex (own standard deviation 0.3 %, scatter between campaigns 0.4 %, −0.1 %/K) is
watched for a fall, the damping ratio (5 % and 6 %) for a rise; 0.01 false alarms a campaign for
both together. The peers:

Shewhart, our scores   Shewhart's limits on the scores of our other charts: covariates, uncertainty, short baseline seen to
Shewhart, raw values   as a laboratory draws it: baseline's mean ± L of its standard deviations, L from the normal distribution
"""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from typing import Literal, NamedTuple

import numpy as np
from scipy import stats

from benchmarks.tables import Table
from fecore.arrays import FloatArray
from fecore.trend import Chart, Series, State, Watch, assess

BASELINE, HORIZON, CHANGE, RATE = 12, 24, 6, 0.01
OWN, BETWEEN, MEAN = (
    {"Ex": 0.003, "zeta_1": 0.05},
    {"Ex": 0.004, "zeta_1": 0.06},
    {"Ex": 32e9, "zeta_1": 0.012},
)
DIRECTIONS: dict[str, Literal["fall", "rise"]] = {"Ex": "fall", "zeta_1": "rise"}
START = datetime(2024, 1, 15, tzinfo=UTC)
Factor = Callable[[FloatArray], FloatArray]
"""Campaigns since the change, 0 at the first changed one → share of the mean."""


class Scenario(NamedTuple):
    """A kind of series: amplitude of the seasons, K, what changes, how much of the usual scatter
    campaigns have, and the lag-1 autocorrelation of what is left after the temperature.
    """

    name: str
    swing: float
    factors: Mapping[str, Factor] = {}
    baseline: int = BASELINE
    between: float = 1.0
    alike: float = 0.0


SCENARIOS = (
    Scenario("no change, 20 ± 3 °C", 0),
    Scenario("no change, seasons ±15 K", 15),
    Scenario("no change, ±15 K, 6 in baseline", 15, baseline=6),
    Scenario("no change, ±15 K, scatter as stated", 15, between=0.0),
    Scenario("no change, 20 ± 3 °C, alike 0.5", 0, alike=0.5),
    Scenario("no change, ±15 K, alike 0.5", 15, alike=0.5),
    Scenario("3 % stiffness loss", 15, {"Ex": lambda t: np.where(t >= 0, 0.97, 1.0)}),
    Scenario(
        "0.2 % a month stiffness loss", 15, {"Ex": lambda t: 1 - 0.002 * np.maximum(0, t + 1)}
    ),
    Scenario("20 % damping rise", 15, {"zeta_1": lambda t: np.where(t >= 0, 1.2, 1.0)}),
)

CHARTS = {
    "EWMA": Chart("ewma"),
    "CUSUM": Chart("cusum"),
    "Shewhart, our scores": Chart("shewhart"),
}


def simulate(scenario: Scenario, rng: np.random.Generator) -> dict[str, Series]:
    """Series of both parameters with their temperatures."""
    n = scenario.baseline + HORIZON
    months = np.arange(n)
    season = np.cos(2 * np.pi * (months + rng.uniform(0, 12)) / 12)
    temperature = 20 + scenario.swing * season + 3 * rng.standard_normal(n)
    dates = tuple(START + timedelta(days=30.4375 * i) for i in range(n))
    series = {}
    for name, mean in MEAN.items():
        own, between = (_alike(rng.standard_normal(n), scenario.alike) for _ in range(2))
        y = 1 + OWN[name] * own + scenario.between * BETWEEN[name] * between
        if name == "Ex":
            y = y + -0.001 * (temperature - 20)
        y = y * scenario.factors.get(name, np.ones_like)(
            (months - scenario.baseline - CHANGE).astype(float)
        )
        series[name] = Series(
            name, dates, mean * y, np.full(n, OWN[name] * mean), {"temperature_c": temperature}
        )
    return series


def _alike(e: FloatArray, phi: float) -> FloatArray:
    """An autoregression of unit variance made of independent values."""
    for i in range(1, e.size):
        e[i] = phi * e[i - 1] + np.sqrt(1 - phi**2) * e[i]
    return e


def first_alarm(series: dict[str, Series], chart: Chart, baseline: int) -> int | None:
    """Watched campaign of the first alarm, from 0."""
    watch = Watch(DIRECTIONS, baseline, ("temperature_c",), RATE, HORIZON, chart=chart)
    timelines = [trend.timeline for trend in assess(series, watch).parameters.values()]
    return min(
        (i for line in timelines for i, moment in enumerate(line) if moment.state is State.ALARM),
        default=None,
    )


def first_beyond(series: dict[str, Series], baseline: int) -> int | None:
    """The same of a plain Shewhart chart of raw values, whose mean and standard deviation count as
    known.
    """
    each = (1 - (1 - RATE) ** HORIZON) / 2
    limit, beyond = stats.norm.isf(1 - (1 - each) ** (1 / HORIZON)), np.zeros(HORIZON, dtype=bool)
    for name, sign in (("Ex", -1), ("zeta_1", 1)):
        base, later = series[name].estimate[:baseline], series[name].estimate[baseline:]
        beyond |= sign * (later - base.mean()) / base.std(ddof=1) > limit
    return int(np.argmax(beyond)) if beyond.any() else None


FALSE = ("false alarms a campaign:.4f", "of the stated:.2f")
FOUND = (
    "delay, mean:.2f",
    "median:.1f",
    f"not found, counted as {HORIZON - CHANGE}:d",
    "called before:d",
)


def calls(firsts: list[int | None], changes: bool) -> tuple[float, ...]:
    """The columns `FOUND` of a series that changes, `FALSE` of one that does not."""
    if not changes:
        called = float(np.mean([first is not None for first in firsts]))
        rate = 1 - (1 - called) ** (1 / HORIZON)
        return rate, rate / RATE
    delays = np.array(
        [HORIZON - CHANGE if f is None else f - CHANGE for f in firsts if f is None or f >= CHANGE]
    )
    missed = sum(f is None for f in firsts)
    return delays.mean(), float(np.median(delays)), missed, len(firsts) - len(delays)


def trend(sets: int = 200, seed: int = 100) -> None:
    """False alarms and delays of control charts."""
    for k, scenario in enumerate(SCENARIOS):
        rng = np.random.default_rng(seed + k)
        drawn = [simulate(scenario, rng) for _ in range(sets)]
        changes, baseline = bool(scenario.factors), scenario.baseline
        table = Table(
            f"{scenario.name} ({sets} series)", "chart:20", *(FOUND if changes else FALSE)
        )
        for label, chart in CHARTS.items():
            table.row(label, *calls([first_alarm(s, chart, baseline) for s in drawn], changes))
        table.row(
            "Shewhart, raw values", *calls([first_beyond(s, baseline) for s in drawn], changes)
        )
