"""Steady sines of several recordings of a body whose FRFs are known, joined to one set."""

from dataclasses import replace

import numpy as np
import pytest

from fecore.errors import InputError
from fecore.frf import Dof, along_z
from fecore.modal import identify_measured_loads
from fecore.signal import LoadFrfs, frfs_of_loads, with_steps_joined
from tests.unit.fecore.signal.test_measured_loads import (
    POLES,
    RATE,
    THREE,
    expected,
    recorded_sines,
)

ONE = along_z((1,))


def step(*hz: float, noise: float = 0.1, seed: int = 0, level: float = 1.0) -> LoadFrfs:
    """FRFs of half a minute of sines that no period of the recording and no sample fits."""
    x = recorded_sines(hz, 3000, noise, seed)
    x[:3] *= level
    return frfs_of_loads(lambda: [x], RATE, THREE, ONE)


def test_lines_are_those_of_the_sines_and_values_the_bodys() -> None:
    found = step(3.013, 8.118, 17.62, noise=0.0)
    assert found.notes[0].kind == "load_of_sines"
    assert found.window_rate_per_s == 0
    # no noise; the body is steady to e^{-0.005 · 3000} before the first segment
    np.testing.assert_allclose(found.frequency_hz, [3.013, 8.118, 17.62], rtol=1e-7)
    np.testing.assert_allclose(found.mean, expected(found), rtol=1e-5)


def test_sines_of_two_loads_that_have_one_each() -> None:
    x = recorded_sines((3.013, 17.62), 3000, 0.0, loads=2)
    found = frfs_of_loads(lambda: [x], RATE, THREE, along_z((1, 2)))
    np.testing.assert_array_equal(found.separable, [[True, False], [False, True]])
    there = np.broadcast_to(found.separable, found.mean.shape)
    np.testing.assert_allclose(found.mean[there], expected(found)[there], rtol=1e-5)


def test_sines_that_a_recording_does_not_resolve_are_refused() -> None:
    x = recorded_sines((17.0, 17.2), 3000, 0.0)
    with pytest.raises(InputError, match="is 30 s long, expected 45 s or more for its load's"):
        frfs_of_loads(lambda: [x], RATE, THREE, ONE)


def test_steps_are_one_set_with_modes() -> None:
    grid = np.concatenate([np.arange(3.013, 30), 7.96 + np.arange(-4, 5) / 16])
    recordings = [step(hz, seed=seed) for seed, hz in enumerate(grid)]
    (joined,) = with_steps_joined(recordings)
    assert [note.kind for note in joined.notes] == ["steps_joined"]
    np.testing.assert_allclose(joined.frequency_hz, np.sort(grid), rtol=1e-6)
    off = np.abs(joined.mean - expected(joined)) ** 2 / joined.variance
    assert 0.6 < off.mean() < 1.6  # 36 lines, three responses, deviations from 11 groups
    modes = identify_measured_loads(recordings).found.modes
    true = np.log(POLES) * RATE
    assert modes.damping_sd is not None
    assert modes.frequency_sd_hz is not None
    for k, pole in enumerate(true):
        off_hz = modes.frequency_hz[k] - abs(pole) / 2 / np.pi
        assert abs(off_hz) < 3 * modes.frequency_sd_hz[k]
        assert abs(modes.damping_ratio[k] + pole.real / abs(pole)) < 3 * modes.damping_sd[k]


def test_repeats_are_averaged_by_their_variance() -> None:
    good, poor = step(8.118, 12.3, noise=0.01, seed=1), step(8.118, 20.7, noise=3.0, seed=2)
    (joined,) = with_steps_joined([good, poor])
    assert [note.kind for note in joined.notes] == ["steps_joined"]
    np.testing.assert_allclose(joined.frequency_hz, [8.118, 12.3, 20.7], rtol=1e-4)
    # the poor one has next to no weight where the good one is known, and is all there is elsewhere
    np.testing.assert_allclose(joined.mean[..., :2], good.mean, rtol=1e-3)
    np.testing.assert_allclose(joined.mean[..., 2], poor.mean[..., 1])
    np.testing.assert_allclose(joined.variance[..., 2], poor.variance[..., 1])
    again = step(8.118, 12.3, noise=0.01, seed=3)
    (alike,) = with_steps_joined([good, again])
    # of six pairs, each known from 11 groups to half of itself
    assert alike.variance.mean() == pytest.approx(good.variance.mean() / 2, rel=0.5)


def test_repeats_that_differ_are_named() -> None:
    recordings = [step(8.118, seed=1), step(8.118, seed=2, level=1.3), step(12.3)]
    (joined,) = with_steps_joined(recordings, ["a.csv", "b.csv", "c.csv"])
    _, note = joined.notes
    assert "FRFs of a.csv, b.csv at 8.118 Hz differ by 2" in note.text
    # the mean of two that lie 0.3 apart is off by half of that, a standard deviation
    sd = np.sqrt(joined.variance[..., 0]) / np.abs(joined.mean[..., 0])
    assert 0.05 < sd.min() < sd.max() < 0.3


def test_channels_in_another_order_and_direction_are_the_same() -> None:
    first, other = step(8.118), step(12.3)
    turned = replace(
        other,
        blocks=-other.blocks[:, ::-1],
        coherence=other.coherence[::-1],
        responses=tuple(Dof(dof.point, -3) for dof in reversed(THREE)),
    )
    (joined,) = with_steps_joined([first, turned])
    np.testing.assert_allclose(joined.mean[..., 1], other.mean[..., 0])
    # other sensors, and loads that do not repeat, are sets of their own
    elsewhere = replace(other, responses=along_z((1, 2, 4)))
    windowed = replace(other, window_rate_per_s=0.1)
    assert len(with_steps_joined([first, elsewhere, windowed, windowed])) == 4
