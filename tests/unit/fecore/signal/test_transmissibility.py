"""Transmissibilities are the filters that made the responses, within their stated errors."""

from typing import Any

import numpy as np
import pytest
import scipy

from fecore.errors import InputError
from fecore.frf import Dof, along_z
from fecore.signal import HalfSpectra, Transmissibilities, half_spectra, transmissibilities

RATE, SAMPLES = 256.0, 1 << 16
POINTS = along_z((1, 2, 3, 4))
FILTERS = {(2, 0): [0.5, 1.0, -0.3], (2, 1): [0.8], (3, 0): [-1.0, 0.4]}
"""Taps by (response, reference)."""


def recorded(seed: int = 1, noise: float = 0.3) -> np.ndarray:
    """Two independent references, a response of both, and one of the first alone, with noise."""
    rng = np.random.default_rng(seed)
    x = np.zeros((4, SAMPLES))
    x[:2] = rng.standard_normal((2, SAMPLES))
    for (row, column), taps in FILTERS.items():
        x[row] += scipy.signal.lfilter(taps, [1.0], x[column])
    x[2:] += noise * rng.standard_normal((2, SAMPLES))
    return x


def spectra(x: np.ndarray, references: Any = POINTS[:2], **more: Any) -> HalfSpectra:
    return half_spectra(lambda: [x], RATE, POINTS, references, lag_s=1.0, **more)


def truth(made: Transmissibilities, row: int, column: int) -> np.ndarray:
    taps = FILTERS.get((row, column), [0.0])
    _, values = scipy.signal.freqz(taps, worN=made.frequency_hz, fs=RATE)
    return np.asarray(values)


def test_values_lie_within_their_errors() -> None:
    """|δT|²/E|δT|² has the mean 1; over 2 × 2 × 100 lines, of which each two neighbours share
    segments' leakage, and 10 recordings its scatter is 3 %, so that ± 10 % is more than 3 sd.
    """
    ratios = []
    for seed in range(10):
        made = transmissibilities(spectra(recorded(seed)), POINTS[:2])
        assert made.notes == ()
        assert made.frequency_hz.size == 100
        for row in (2, 3):
            for column in (0, 1):
                off = np.abs(made.values[row, column] - truth(made, row, column)) ** 2
                ratios.append(off / made.variance[row, column])
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    np.testing.assert_array_equal(made.values[:2], np.eye(2)[..., None] * np.ones(100))
    assert np.all(made.coherence[:2] == 1)
    assert np.all(made.variance[:2] == 0)


def test_one_reference_and_the_coherence_that_is_left() -> None:
    made = transmissibilities(spectra(recorded(noise=1.0)))
    assert made.references == POINTS[:1]
    # response 4 has |H|² of its taps, over that and noise of 1; sd of the mean of 100 lines 0.01
    level = np.abs(truth(made, 3, 0)) ** 2
    assert np.mean(made.coherence[3] - level / (level + 1)) == pytest.approx(0, abs=0.03)
    off = np.abs(made.values[3, 0] - truth(made, 3, 0)) ** 2
    assert np.mean(off / made.variance[3, 0]) == pytest.approx(
        1.0, abs=0.4
    )  # 100 exponentials, 4 sd


def test_velocities_beside_accelerations_are_taken_to_these() -> None:
    x = recorded(noise=0.0)
    x[3] = scipy.signal.lfilter([1 / RATE], [1, -1], x[3])  # integrated: a velocity
    kinds: Any = ("acceleration", "acceleration", "acceleration", "velocity")
    made = transmissibilities(spectra(x, POINTS[:1], quantities=kinds))
    # above the leakage of the lowest frequencies; there the sum stands for the integral, to
    # (ωΔt)²/24 = 0.3 %
    low = (made.frequency_hz > 3) & (made.frequency_hz < 10)
    ratio = np.abs(made.values[3, 0] / truth(made, 3, 0))[low]
    np.testing.assert_allclose(ratio, 1, atol=0.05)


def test_references_that_are_alike_or_unknown_are_refused() -> None:
    x = recorded()
    x[1] = 2 * x[0]
    with pytest.raises(InputError, match="those at points 1, 2 are alike at all lines"):
        transmissibilities(spectra(x), POINTS[:2])
    half = recorded()
    low = scipy.signal.firwin(201, 40.0, fs=RATE)
    high = half[1] - np.convolve(half[1], low, "same")
    half[1] = np.convolve(half[0], low, "same") + high
    (note,) = transmissibilities(spectra(half), POINTS[:2]).notes
    assert "alike at" in note.text
    with pytest.raises(InputError, match="point 4 along 3 is no channel of these"):
        transmissibilities(spectra(recorded()), [Dof(4, 3)])
    with pytest.raises(InputError, match="name one sensor twice"):
        transmissibilities(spectra(recorded()), [POINTS[0], POINTS[0]])
