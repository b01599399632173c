"""Modes of several campaigns are tracked by shape and frequency, through crossings, gaps and
newcomers.
"""

import json
from collections import Counter

import numpy as np
import pytest

from fecore.errors import InputError
from fecore.trend import Following, TrackedMode, follow, track
from fecore.trend.tracking import same_modes

POINTS = np.linspace(0.1, 0.9, 9)


def bent(order: int, hz: float, noise: float = 0.0) -> TrackedMode:
    """A half-sine shape of an order at nine points, with a little noise."""
    values = np.sin(order * np.pi * POINTS) + noise * np.random.default_rng(order).standard_normal(
        POINTS.size
    )
    return TrackedMode(hz, {(point, 3): complex(value) for point, value in enumerate(values, 1)})


def test_shapes_tell_modes_apart_that_cross() -> None:
    campaigns = [
        [bent(1, 10.0), bent(2, 10.4)],
        [bent(2, 10.1, 0.05), bent(1, 10.3, 0.05)],
        [bent(2, 9.9), bent(1, 10.4)],
    ]
    assert track(campaigns) == [[0, 1], [1, 0], [1, 0]]
    alone = [[TrackedMode(mode.frequency_hz) for mode in modes] for modes in campaigns]
    assert track(alone) == [[0, 1], [0, 1], [0, 1]]  # frequencies alone keep the order


def test_a_track_waits_for_a_campaign_that_misses_it() -> None:
    frequencies = [[5.0, 8.0, 13.0], [5.1, 13.2], [5.0, 8.1, 13.1, 21.0]]
    assert track([[TrackedMode(f) for f in row] for row in frequencies]) == [
        [0, 1, 2],
        [0, 2],
        [0, 1, 2, 3],
    ]


def test_a_far_frequency_or_another_shape_begins_a_track() -> None:
    assert track([[TrackedMode(10.0)], [TrackedMode(11.6)], [TrackedMode(11.4)]]) == [[0], [1], [1]]
    assert track([[bent(1, 10.0)], [bent(2, 10.0)]]) == [[0], [1]]


def test_shapes_at_too_few_common_points_are_not_compared() -> None:
    few = TrackedMode(10.1, {(1, 3): 1.0, (2, 3): -1.0})
    assert track([[bent(1, 10.0)], [few], [], [bent(1, 10.2)]]) == [[0], [0], [], [0]]


def test_of_two_alike_shapes_the_nearer_frequency_is_meant() -> None:
    """At sparse points two modes look alike; the MAC alone would take the farther one, which is
    alike by a hair more.
    """
    shape = {(1, 3): 1.0, (2, 3): -0.5, (3, 3): 0.25}
    nearly = {**shape, (3, 3): 0.26}
    others = [TrackedMode(101.0, nearly), TrackedMode(112.0, shape)]
    assert same_modes([TrackedMode(100.0, shape)], others) == {0: 0}
    assert same_modes([TrackedMode(100.0, shape)], []) == {}


def test_modes_nearer_than_their_sds_are_told_by_frequency() -> None:
    """Shapes of a pair mix by any angle from run to run, so the MAC would swap half of them. What
    a swap would have done is said.
    """
    rng = np.random.default_rng(4)
    runs, sd = [], 0.01
    plane = np.array([list(bent(order, 10.0).shape.values()) for order in (1, 2)])
    for _ in range(30):
        angle = rng.uniform(0, np.pi)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        values = turn @ plane
        hz = np.array([10.0, 10.02]) + sd / 4 * rng.standard_normal(2)
        runs.append(
            [
                TrackedMode(f, dict(enumerate_dofs(row)), frequency_sd_hz=sd, damping_ratio=0.01)
                for f, row in zip(hz, values, strict=True)
            ]
        )
    tracks = follow(runs)
    order = [np.argsort([mode.frequency_hz for mode in run]).tolist() for run in runs]
    kept = [
        [numbers[i] for i in places] for numbers, places in zip(tracks.numbers, order, strict=True)
    ]
    assert kept == [kept[0]] * 30
    assert np.min(tracks.identity_sd[-1]) > 1e-4  # a swap is likely by these sds


def enumerate_dofs(values: np.ndarray) -> list[tuple[tuple[int, int], complex]]:
    """Values by their degrees of freedom."""
    return [((point, 3), complex(value)) for point, value in enumerate(values, 1)]


def test_runs_come_unsorted_and_spurious_modes_are_not_confirmed() -> None:
    rng = np.random.default_rng(5)
    days = rng.permutation(40).astype(float)
    runs = []
    for day in days:
        drift = 1 - 0.001 * day  # one mode falls onto where the other was: time order keeps both
        modes = [bent(1, 10.0 * drift), bent(2, 10.5 * drift), bent(3, 22.0)]
        if day % 5 == 0:
            modes.insert(0, TrackedMode(5.0 + day / 10))
        runs.append(modes[: None if day % 7 else -1])
    tracks = follow(runs, days.tolist())
    watched = tracks.confirmed(range(40))
    assert len(watched) == 3
    assert Counter(k for numbers in tracks.numbers for k in numbers)[watched[2]] > 30
    for run, numbers in zip(runs, tracks.numbers, strict=True):
        own = [k for mode, k in zip(run, numbers, strict=True) if mode.shape]
        assert own == watched[: len(own)]


@pytest.mark.parametrize(
    ("mode", "days", "named"),
    [
        (TrackedMode(-1.0), [0.0], "frequency_hz"),
        (TrackedMode(1.0, frequency_sd_hz=-1.0), [0.0], "frequency_sd_hz"),
        (TrackedMode(1.0, {(1, 1): np.nan}), [0.0], "shape"),
        (TrackedMode(1.0), [np.nan], "days"),
        (TrackedMode(1.0), [0.0, 1.0], "days"),
    ],
)
def test_what_cannot_be_followed_is_named(mode: TrackedMode, days: list[float], named: str) -> None:
    with pytest.raises(InputError, match=named):
        follow([[mode]], days)


def test_a_state_that_was_written_down_goes_on_as_if_it_had_not_been() -> None:
    """Bit for bit, with shapes of new points, gaps and tracks that are forgotten."""
    rng = np.random.default_rng(6)
    runs = []
    for _ in range(150):
        modes = [bent(k, hz * (1 + 0.002 * rng.standard_normal()), 0.1) for k, hz in RUNS]
        new = {(int(rng.integers(1, 14)), 3): complex(rng.standard_normal()) for _ in range(6)}
        modes.append(TrackedMode(float(rng.uniform(5, 60)), new, 0.01, damping_ratio=0.01))
        runs.append([mode for mode in modes if rng.random() > 0.2])
    whole, following = follow(runs, list(range(150))), Following()
    for day, run in enumerate(runs):
        following = Following.from_document(json.loads(json.dumps(following.document())))
        following, numbers, identity = following.after(run, float(day))
        assert numbers == whole.numbers[day]
        assert identity == whole.identity_sd[day]
    assert len(following.tracks) < following.begun  # spurious ones were forgotten


RUNS = ((1, 10.0), (2, 10.2), (3, 24.0))
