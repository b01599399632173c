"""Spectra, axes and frames by themselves: what is stored comes back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.compute.frame import make_frame
from service.compute.spectra import Spectrum, decode, encode, encode_axis
from service.errors import Damaged


def test_a_frame_turns_points_and_directions_alike() -> None:
    rng = np.random.default_rng(1)
    q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    q[:, 2] = np.cross(q[:, 0], q[:, 1])
    frame = make_frame(tuple(rng.standard_normal(3)), tuple(q[:, 0]), tuple(q[:, 1]))
    specimen = rng.standard_normal((5, 3))
    np.testing.assert_allclose(frame.points(specimen @ q.T + frame.origin_m), specimen, atol=1e-14)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.lists(st.complex_numbers(allow_nan=True, allow_infinity=True), min_size=1, max_size=40))
def test_every_spectrum_survives_bit_for_bit(values: list[complex]) -> None:
    for dtype in ("c16", ">c16", "c8"):
        with np.errstate(over="ignore"):
            array = np.array(values).astype(dtype)
        stored = encode(array)
        assert decode(stored).tobytes() == array.astype(array.dtype.newbyteorder("<")).tobytes()
        broken = Spectrum(stored.dtype, stored.count, stored.data[:-1] + bytes([stored.data[-1] ^ 1]), stored.sha256)
        with pytest.raises(Damaged):
            decode(broken)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.floats(0, 1e5), st.floats(1e-3, 100), st.integers(1, 500))
def test_an_axis_keeps_its_lines(start: float, step: float, count: int) -> None:
    even = start + step * np.arange(count)
    stored = encode_axis(even)
    assert (stored.lines is None) == (count > 1)
    np.testing.assert_allclose(stored.frequency_hz(), even, rtol=0, atol=1e-12 * even[-1])
    if count > 2:
        uneven = even.copy()
        uneven[1] += 0.25 * step
        np.testing.assert_array_equal(encode_axis(uneven).frequency_hz(), uneven)
