"""Hits of one long recording: found at every level, cut without another hit in their blocks."""

from collections.abc import Iterator

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fecore.signal.pulse import LEAD
from fecore.signal.recording import cut, survey

RATE = 2048.0


def recording(
    times: list[float], levels: list[float], seconds: float, bounce: float = 0.0
) -> np.ndarray:
    """(2, n) force and response of a 40 Hz mode that decays by exp(-6 t), with noise."""
    rng = np.random.default_rng(1)
    time = np.arange(int(seconds * RATE)) / RATE
    force, response = rng.normal(0, 1e-3, (2, time.size))
    for at, level in zip(times, levels, strict=True):
        late = time - at
        force += level * (
            np.exp(-((late / 8e-4) ** 2)) + bounce * np.exp(-(((late - 0.05) / 8e-4) ** 2))
        )
        response += np.where(
            late > 0, level * np.exp(-6 * np.maximum(late, 0)) * np.sin(251 * late), 0.0
        )
    return np.array([force, response])


def parts(whole: np.ndarray, size: int) -> Iterator[np.ndarray]:
    return (whole[:, k : k + size] for k in range(0, whole.shape[1], size))


def test_double_hits_and_different_levels_are_found_once_each() -> None:
    times, levels = [1.0, 4.0, 7.5, 12.0], [1.0, 0.2, 3.0, 0.5]
    found = survey([recording(times, levels, 16.0, bounce=0.4)], RATE, 0)
    np.testing.assert_allclose([hit.at / RATE for hit in found.hits], times, atol=1 / RATE)
    np.testing.assert_allclose([hit.force for hit in found.hits], levels, rtol=0.02)
    # the response of 1 is in noise of 0.001 after ln(1000) / 6 = 1.15 s
    assert 0.8 * RATE < found.length < 2.0 * RATE


def test_a_hit_whose_next_comes_early_is_left_out_and_the_others_keep_their_length() -> None:
    whole = recording([1.0, 4.0, 4.4, 8.0, 11.0], [1.0] * 5, 15.0)
    found = survey([whole], RATE, 0)
    assert [found.fits(hit) for hit in found.hits] == [True, False, True, True, True]
    assert found.length > 0.8 * RATE


@settings(max_examples=40)
@given(
    gaps=st.lists(st.floats(0.4, 4.0), min_size=1, max_size=8),
    size=st.integers(50, 20_000),
    levels=st.lists(st.floats(0.2, 2.0), min_size=9, max_size=9),
)
def test_blocks_are_what_was_recorded_and_hold_no_other_hit(
    gaps: list[float], size: int, levels: list[float]
) -> None:
    times = list(np.cumsum([0.5, *gaps]))
    whole = recording(times, levels[: len(times)], times[-1] + 2.0)
    found = survey(parts(whole, size), RATE, 0)
    assert len(found.hits) == len(times)
    blocks = list(cut(parts(whole, size), found))
    assert blocks
    assert [hit for hit, _ in blocks] == [hit for hit in found.hits if found.fits(hit)]
    for hit, samples in blocks:
        begin, end = hit.at - LEAD, hit.at - LEAD + found.length
        np.testing.assert_array_equal(samples, whole[:, begin:end])
        assert [other.at for other in found.hits if begin <= other.at < end] == [hit.at]


def test_a_clipped_channel_is_named_with_its_hits() -> None:
    whole = np.clip(recording([1.0, 4.0], [1.0, 0.3], 7.0), -0.5, 0.5)
    found = survey([whole], RATE, 0, full_scale=[0.5, None])
    assert [hit.clipped for hit in found.hits] == [(0,), ()]
