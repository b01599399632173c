"""Series of modes without a model, on made runs of `benchmarks.tracks`: seasons, wind, gaps, a pair
that crosses, spurious modes.
"""

from datetime import timedelta

import numpy as np
import pytest

from benchmarks.tracks import BASELINE, CHANGE, HZ, START, first_alarm, make, swaps
from fecore.trend import mode_series
from fecore.trend.mode_series import ModesOfRun
from fecore.trend.tracking import TrackedMode


def test_five_modes_are_watched_through_gaps_and_a_crossing() -> None:
    made = make(np.random.default_rng(1), 0.0)
    watched, modes, swapped, beyond, lost = swaps(made)
    assert watched == 5
    # two of the five lie within their sds of one another for long: there they may swap
    assert swapped < 0.12 * modes
    assert beyond < 0.01 * modes
    assert lost < 0.02 * modes
    found = mode_series(made.runs, BASELINE)
    assert [*found.series] == [
        f"{kind}_{n}" for n in range(1, 6) for kind in ("frequency", "damping_ratio")
    ]
    means = [found.series[f"frequency_{n}"].estimate.mean() for n in range(1, 6)]
    assert means == pytest.approx(HZ, rel=0.01)  # seasons move them by 1 % at most
    assert 0 < len(found.series["frequency_1"]) < len(made.runs)  # gaps
    assert np.isfinite(found.series["frequency_1"].covariates["wind_m_s"]).all()
    assert found.newcomers == ()


@pytest.mark.long
def test_one_percent_of_one_frequency_raises_an_alarm_and_seasons_do_not() -> None:
    """In short a loss of one parameter does, in `test_assessment.py`."""
    same, less = (make(np.random.default_rng(2), change) for change in (0.0, -0.01))
    assert first_alarm(mode_series(same.runs, BASELINE - 10)) is None
    at = first_alarm(mode_series(less.runs, BASELINE - 10))
    assert at is not None
    assert BASELINE + CHANGE <= at <= BASELINE + CHANGE + 3  # measured delay: 0.5 in the mean


def test_nothing_gives_nothing() -> None:
    assert mode_series([], 4).series == {}


@pytest.mark.parametrize(("stated", "notes"), [(0.01, 0), (0.1, 1)])
def test_overstated_standard_deviations_are_noted_and_none_counts_as_better_known(
    stated: float, notes: int
) -> None:
    """Frequencies scatter by 0.01 Hz; the first is stated to be known ten times better."""
    hz = 2 + 0.01 * np.random.default_rng(3).standard_normal(12)
    runs = [
        ModesOfRun(
            f"r{n}",
            START + timedelta(days=n),
            [TrackedMode(f, frequency_sd_hz=stated / (1 if n else 10))],
        )
        for n, f in enumerate(hz)
    ]
    made = mode_series(runs, 12)
    assert len(made.notes) == notes
    assert all("frequency_1: runs differ by 0." in note for note in made.notes)
    least = made.series["frequency_1"].standard_deviation[0]
    assert least == pytest.approx(stated if notes else stated / 10)
