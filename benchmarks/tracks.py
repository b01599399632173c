"""Monitors without a model on made runs: tracks kept and swapped, false alarms, and delays of a
change.

A structure of five modes at eight sensors is identified daily, 40 runs of a baseline and 40 more.
Its frequencies follow a temperature (a season and days) and the wind, differently: the pair near
3.1 Hz crosses, and mixes its shapes where it is within 0.3 %. Modes are missing in a tenth of the
runs, a tenth of the runs is missing, one run in three has a spurious mode. Frequencies are known to
0.15 %, damping ratios to 10 %, as is stated; runs scatter by 0.1 % more. The change with the 10th
watched run is 1 % of one frequency. All frequencies are watched for a fall, all damping ratios for
a rise, 0.01 false alarms a run for all ten.
"""

from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np

from benchmarks.tables import Table
from fecore.arrays import FloatArray
from fecore.trend import State, Watch, assess
from fecore.trend.mode_series import ModeSeries, ModesOfRun, mode_series
from fecore.trend.tracking import TrackedMode, follow

BASELINE, HORIZON, CHANGE, RATE = 40, 40, 10, 0.01
HZ = np.array([2.0, 3.09, 3.12, 5.4, 8.3])
PER_KELVIN = np.array([-5e-4, -1.2e-3, -2e-4, -8e-4, -4e-4])
PER_WIND = np.array([-5e-4, -5e-4, -2e-4, -3e-4, -2e-4])  # a m/s
STATED, BETWEEN, MIXED = 0.0015, 0.001, 0.003
START = datetime(2024, 3, 1, tzinfo=UTC)
COVARIATES = ("temperature_deck_c", "wind_m_s")
SENSORS = np.arange(1, 9)


class Made(NamedTuple):
    """Runs; which mode of the truth each of their modes is, −1 for a spurious one; and the five
    frequencies without errors.
    """

    runs: list[ModesOfRun]
    truth: list[list[int]]
    hz: list[FloatArray]


def make(rng: np.random.Generator, change: float) -> Made:
    """A structure's runs; `change` is relative, of one frequency."""
    count = BASELINE + HORIZON
    days = np.arange(count) + rng.uniform(0, 0.3, count)
    season = 8 * np.sin(2 * np.pi * days / 60 + rng.uniform(0, 2 * np.pi))
    temperature = 15 + season + 3 * rng.standard_normal(count)
    wind = rng.gamma(2.0, 2.5, count)
    shapes = np.sin(np.outer(np.arange(1, 6), np.pi * SENSORS / 9)) + 0.1 * rng.standard_normal(
        (5, 8)
    )
    changed = int(rng.integers(5))
    made = Made([], [], [])
    for at in range(count):
        if rng.random() < 0.1:
            continue
        hz = HZ * (1 + PER_KELVIN * (temperature[at] - 15) + PER_WIND * (wind[at] - 5))
        if at >= BASELINE + CHANGE:
            hz[changed] *= 1 + change
        hz = hz * (1 + BETWEEN * rng.standard_normal(5))
        seen = shapes + 0.05 * rng.standard_normal(shapes.shape)
        if abs(hz[1] / hz[2] - 1) < MIXED:
            turn = rng.uniform(0, np.pi)
            c, s = np.cos(turn), np.sin(turn)
            seen[1:3] = np.array([[c, s], [-s, c]]) @ seen[1:3]
        modes = [
            (n, hz[n] * (1 + STATED * rng.standard_normal()), seen[n], STATED)
            for n in range(5)
            if rng.random() > 0.1
        ]
        if rng.random() < 1 / 3:
            modes.append((-1, rng.uniform(1.5, 9), rng.standard_normal(8), 0.01))
        rng.shuffle(modes)
        made.hz.append(hz)
        made.truth.append([n for n, *_ in modes])
        made.runs.append(
            ModesOfRun(
                str(at),
                START + timedelta(days=float(days[at])),
                [
                    TrackedMode(
                        float(f),
                        {(int(p), 3): complex(v) for p, v in zip(SENSORS, values, strict=True)},
                        float(f) * sd,
                        damping_ratio=0.01 * (1 + 0.1 * rng.standard_normal()),
                        damping_sd=0.001,
                    )
                    for _, f, values, sd in modes
                ],
                {"temperature_deck_c": float(temperature[at]), "wind_m_s": float(wind[at])},
            )
        )
    return made


def swaps(made: Made) -> tuple[int, ...]:
    """Watched tracks; modes of the truth; those of them that stand in another's track, and of these
    the ones further off its own frequency than three standard deviations, as stated with them; and
    those in no watched track.
    """
    tracks = follow([run.modes for run in made.runs], [float(i) for i in range(len(made.runs))])
    watched = tracks.confirmed(range(BASELINE))
    pairs = [
        (n, k)
        for true, numbers in zip(made.truth, tracks.numbers, strict=True)
        for n, k in zip(true, numbers, strict=True)
        if n >= 0
    ]
    home = {n: max(watched, key=lambda k, n=n: pairs.count((n, k)), default=-1) for n in range(5)}
    mode_of = {k: n for n, k in home.items()}
    wrong = far = 0
    for at, (run, numbers) in enumerate(zip(made.runs, tracks.numbers, strict=True)):
        for i, (n, k) in enumerate(zip(made.truth[at], numbers, strict=True)):
            if n < 0 or k not in mode_of or k == home[n]:
                continue
            wrong += 1
            off = abs(np.log(run.modes[i].frequency_hz / made.hz[at][mode_of[k]]))
            far += off > 3 * np.hypot(STATED, tracks.identity_sd[at][i])
    lost = sum(k != home[n] for n, k in pairs) - wrong
    return len(watched), len(pairs), wrong, far, lost


def first_alarm(found: ModeSeries) -> int | None:
    """Label of the run that raises the first alarm."""
    watch = Watch(
        {name: "fall" if name.startswith("frequency") else "rise" for name in found.series},
        BASELINE - 10,
        COVARIATES,
        RATE,
        HORIZON,
    )
    trends = assess(found.series, watch).parameters.values()
    return min(
        (
            int(moment.label)
            for trend in trends
            for moment in trend.timeline
            if moment.state is State.ALARM
        ),
        default=None,
    )


def tracks(sets: int = 250, seed: int = 300) -> None:
    """Tracks, false alarms and delays of monitors of modes."""
    rng = np.random.default_rng(seed)
    for change in (0.0, -0.01):
        table = Table(
            f"{100 * change:+.0f} % of one frequency, {sets} series",
            *("watched:.2f", "modes:d", "swapped:d", "beyond their sd:d", "not in a track:d"),
            *("false a run:.4f", "of stated:.2f", "delay, mean:.2f", "median:.1f", "missed:d"),
        )
        firsts, counts = [], []
        for _ in range(sets):
            made = make(rng, change)
            counts.append(swaps(made))
            firsts.append(first_alarm(mode_series(made.runs, BASELINE - 10)))
        total = np.array(counts)
        begin = BASELINE + CHANGE
        early = [f for f in firsts if f is not None and (change == 0 or f < begin)]
        watched = HORIZON if change == 0 else CHANGE
        rate = 1 - (1 - len(early) / sets) ** (1 / watched)
        delays = [f - begin for f in firsts if f is not None and f >= begin] if change else []
        table.row(
            total[:, 0].mean(),
            *total[:, 1:].sum(axis=0).tolist(),
            rate,
            rate / RATE,
            float(np.mean(delays)) if delays else None,
            float(np.median(delays)) if delays else None,
            sum(f is None for f in firsts) if change else None,
        )
