"""Modes of measured loads: frequencies and damping ratios inside their intervals."""

import numpy as np
import pytest

from fecore.frf import along_z
from fecore.modal import identify_measured_loads
from fecore.signal import frfs_of_loads
from tests.unit.fecore.signal.test_measured_loads import (
    POLES,
    RATE,
    SHAPES,
    THREE,
    bursts,
    random_loads,
    recorded,
)


@pytest.mark.parametrize("loads", [random_loads(1), bursts()])
def test_modes_are_inside_their_intervals(loads: np.ndarray) -> None:
    x = recorded(loads)
    frfs = frfs_of_loads(lambda: [x], RATE, THREE, along_z(range(1, len(loads) + 1)))
    modes = identify_measured_loads(frfs).found.modes
    rate = np.log(POLES) * RATE
    assert modes.covariance is not None
    assert modes.frequency_sd_hz is not None
    assert modes.damping_sd is not None
    np.testing.assert_array_less(
        abs(modes.frequency_hz - abs(rate) / (2 * np.pi)), 3 * modes.frequency_sd_hz
    )
    np.testing.assert_array_less(
        abs(modes.damping_ratio + rate.real / abs(rate)), 3 * modes.damping_sd
    )
    np.testing.assert_array_less(modes.damping_sd, 0.1 * modes.damping_ratio)
    for k, shape in enumerate(SHAPES.T):
        seen = modes.shapes[k].real
        assert np.dot(seen, shape) ** 2 > 0.999 * np.dot(seen, seen) * np.dot(shape, shape)
