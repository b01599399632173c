"""A tower's modes of 154 ten-minute recordings, which another code identified: unsorted, missing
and in company.
"""

from datetime import UTC, datetime

import numpy as np
import pytest

from fecore.trend import ModesOfRun, TrackedMode, Watch, assess, mode_series
from tests.support.places import shared_file

FAMILIES = ((0.34, 0.365), (0.605, 0.64), (1.27, 1.35), (2.0, 2.09), (3.22, 3.4))


def runs_of_the_tower() -> list[ModesOfRun]:
    """The runs that have modes."""
    data = np.load(shared_file("MEASURED", "measured", "tower-modal.npz"))
    runs = []
    for at, hz in enumerate(data["frequency_hz"]):
        there = np.flatnonzero(np.isfinite(hz))
        modes = [
            TrackedMode(
                float(hz[i]),
                {(c + 1, 3): complex(v) for c, v in enumerate(data["shapes"][at, i])},
                float(data["frequency_sd_hz"][at, i]),
                damping_ratio=float(data["damping_ratio"][at, i]),
                damping_sd=float(data["damping_sd"][at, i]),
            )
            for i in there
        ]
        if modes:
            climate = {
                "temperature_1_c": float(data["temperature_c"][at, 1]),
                "wind_m_s": float(data["wind_mean"][at, 0]),
            }
            runs.append(
                ModesOfRun(
                    str(at),
                    datetime.fromtimestamp(float(data["time_s"][at]), UTC),
                    modes,
                    {name: value for name, value in climate.items() if np.isfinite(value)},
                )
            )
    return runs


@pytest.mark.long
def test_five_modes_of_the_tower_are_followed_through_gaps() -> None:
    """Each of five families has a watched track that is in at least 80 % of the runs that have a
    mode there; no track goes from one family to another; and nothing calls, as nothing happened. In
    short those of a made structure are, in `tests/unit/fecore/trend/test_mode_series.py`.
    """
    runs = runs_of_the_tower()
    found = mode_series(runs, baseline=40)
    frequencies = {name: one for name, one in found.series.items() if name.startswith("freq")}
    assert 5 <= len(frequencies) <= 10  # each family is a pair, of which the second may be rare
    for low, high in FAMILIES:
        with_one = sum(any(low < mode.frequency_hz < high for mode in run.modes) for run in runs)
        most = max(
            (one for one in frequencies.values() if low < np.median(one.estimate) < high), key=len
        )
        # the 2.7 sd of the widest stated uncertainty that a track takes, 15 %
        assert np.all(np.abs(np.log(most.estimate / np.median(most.estimate))) < 0.15)
        assert np.sum((most.estimate > low) & (most.estimate < high)) >= 0.8 * with_one
    # its stated standard deviations are some ten times what runs differ by
    assert sum(note.startswith("frequency") for note in found.notes) >= 5
    watch = Watch(
        {name: "fall" if name in frequencies else "rise" for name in found.series},
        30,
        ("temperature_1_c", "wind_m_s"),
    )
    assert {trend.state.value for trend in assess(found.series, watch).parameters.values()} <= {
        "normal",
        "no data",
    }
