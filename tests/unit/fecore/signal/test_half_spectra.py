"""Half spectra: of recordings whose correlations are known, in chunks of any length."""

from collections.abc import Iterator

import numpy as np
import pytest
import scipy

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.frf import Dof, along_z
from fecore.signal.half_spectra import Motion, half_spectra, needed_s
from tests.support.lengths import long

RATE, TWO = 50.0, along_z((1, 2))


POLE = 0.9 * np.exp(0.9j)  # of a sample: 7.2 Hz
# of two poles: Im(p^(k+1)) / Im p
RESPONSE = (POLE ** np.arange(1, 2001)).imag / POLE.imag


@pytest.fixture(scope="module")
def ringing() -> FloatArray:
    """A resonance in white noise, and half of it."""
    e = np.random.default_rng(5).standard_normal(400_000)
    x = scipy.signal.lfilter([1], [1, -2 * POLE.real, abs(POLE) ** 2], e)
    return np.stack([x, x / 2])


def in_parts(x: FloatArray, size: int) -> Iterator[FloatArray]:
    for at in range(0, x.shape[1], size):
        yield x[:, at : at + size]


def test_it_is_the_windowed_transform_of_the_correlation(ringing: FloatArray) -> None:
    found = half_spectra(lambda: [ringing], RATE, TWO, references=TWO[:1], lag_s=4.0)
    correlation = np.correlate(RESPONSE, RESPONSE, "full")[RESPONSE.size - 1 :][:200]
    kept = correlation * 0.05 ** (np.arange(200) / 200)
    kept[0] /= 2
    expected = np.fft.rfft(kept)[1:][: found.frequency_hz.size] / RATE
    np.testing.assert_allclose(found.frequency_hz[0], 0.25)
    assert found.frequency_hz[-1] <= RATE / 2.56 < found.frequency_hz[-1] + 0.25
    # 400,000 samples of which some 10 depend on each other, in blocks of 400: 1 % of the largest
    # by chance, and 1 % as each block is taken in its own power
    np.testing.assert_allclose(found.mean[0, 0], expected, atol=0.03 * abs(expected).max())
    np.testing.assert_allclose(found.mean[1, 0], found.mean[0, 0] / 2, rtol=1e-9)
    assert found.window_rate_per_s == pytest.approx(np.log(20) / 4)


def test_chunks_of_any_length_give_the_same(ringing: FloatArray) -> None:
    whole = half_spectra(lambda: [ringing], RATE, TWO, lag_s=4.0)
    parts = half_spectra(lambda: in_parts(ringing, 777), RATE, TWO, lag_s=4.0)
    np.testing.assert_allclose(parts.blocks, whole.blocks, rtol=1e-9)
    assert 20 <= whole.weights.size <= 40  # of 1000 blocks
    np.testing.assert_allclose(whole.weights.sum(), 1)
    assert whole.references == TWO[:1]  # the other channel shows nothing more


def test_a_sine_has_its_kurtosis_and_a_random_response_has_none() -> None:
    rng, t = np.random.default_rng(6), np.arange(60_000) / RATE
    x = rng.standard_normal((1, t.size)) + 3 * np.sin(2 * np.pi * 7 * t)
    found = half_spectra(lambda: [x], RATE, along_z((1,)), lag_s=4.0)
    sine = int(np.argmin(abs(found.frequency_hz - 7)))
    assert found.kurtosis[sine] == pytest.approx(-1, abs=0.01)  # the noise has 1e-3 of the power
    others = np.delete(found.kurtosis, range(sine - 2, sine + 3))
    # of half-overlapping Hann segments of 200 samples, of which 1.056 are one independent
    sd = 2 / np.sqrt(3 * 150 / 1.056)
    assert abs(others.mean()) < 4 * sd / np.sqrt(others.size)
    assert np.std(others) == pytest.approx(sd, rel=0.3)


def test_power_spectra_are_the_variance_over_frequency(ringing: FloatArray) -> None:
    found = half_spectra(lambda: [ringing], RATE, TWO, references=TWO[:1], lag_s=4.0)
    # beyond the last line, RATE / 2.56, lies little of it; a Hann segment's variance is 1 % off
    assert found.autos[0].sum() * 0.25 == pytest.approx(ringing[0].var(), rel=0.03)
    np.testing.assert_allclose(found.crosses[1, 0], found.autos[0] / 2, rtol=1e-9)
    top = found.singular_values[0]
    np.testing.assert_allclose(top, np.hypot(found.autos[0], found.crosses[1, 0].real), rtol=1e-9)


@pytest.mark.parametrize(("quantity", "power"), [long("velocity", 1), ("displacement", 2)])
def test_sensors_of_a_lower_derivative_are_taken_to_the_highest(
    ringing: FloatArray, quantity: Motion, power: int
) -> None:
    spectrum = np.fft.rfft(ringing[0])
    omega = 2 * np.pi * np.fft.rfftfreq(ringing.shape[1], 1 / RATE)
    lower = np.fft.irfft(spectrum / np.maximum(1j * omega, 2j * np.pi) ** power)
    x = np.stack([ringing[0], lower])
    quantities: tuple[Motion, Motion] = ("acceleration", quantity)
    found = half_spectra(lambda: [x], RATE, TWO, lag_s=4.0, quantities=quantities)
    assert (found.quantity, found.references) == ("acceleration", TWO[:1])
    # about the resonance at 7.2 Hz; the rest holds constants of round-off and of central differences
    near = abs(found.frequency_hz - 7.2) < 1.5
    np.testing.assert_allclose(
        found.mean[1, 0, near], found.mean[0, 0, near], atol=0.03 * abs(found.mean[0, 0]).max()
    )
    np.testing.assert_allclose(found.crosses[1, 0, near], found.autos[0, near], rtol=0.03)
    with pytest.raises(
        InputError, match="references: the sensor of point 2 measures less than the acceleration"
    ):
        half_spectra(lambda: [x], RATE, TWO, TWO[1:], lag_s=4.0, quantities=quantities)


def test_the_length_that_a_mode_needs_is_the_rule_of_thumb() -> None:
    assert needed_s(1.0, 0.01) == pytest.approx(1907, abs=1)


@pytest.mark.parametrize(
    ("x", "message"),
    [
        (np.ones((2, 90_000)), "channel 1 is 1 throughout"),
        (np.full((2, 90_000), np.nan), "channel 1 holds NaN or infinity at sample 1"),
        (np.arange(400.0).reshape(2, 200), "is 4 s long, expected 51.2 s or more"),
        (np.ones((3, 100)), "has 3 channels, expected 2"),
    ],
)
def test_what_cannot_be_used_is_said(x: FloatArray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        half_spectra(lambda: [x], RATE, TWO)


def test_what_is_stated_must_be_there(ringing: FloatArray) -> None:
    with pytest.raises(InputError, match=r"lag_s: is 1e\+03 s, expected 1.28 to 200 s"):
        half_spectra(lambda: [ringing], RATE, TWO, lag_s=1000.0)
    with pytest.raises(InputError, match="point 9 along 3 is no channel"):
        half_spectra(lambda: [ringing], RATE, TWO, references=[Dof(9, 3)])
