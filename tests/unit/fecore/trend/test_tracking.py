"""Modes of several campaigns are tracked by shape and frequency, through crossings, gaps and
newcomers.
"""

import numpy as np

from fecore.trend import TrackedMode, track
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
