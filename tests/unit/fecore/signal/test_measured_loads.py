"""FRFs of measured loads: of a body whose FRFs are known, under loads of each kind."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.signal import butter, chirp, lfilter

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.frf import along_z
from fecore.signal.measured_loads import LoadFrfs, frfs_of_loads

RATE, SAMPLES, SETTLED = 100.0, 24_000, 3000
THREE, TWO = along_z((1, 2, 3)), along_z((1, 2))
POLES = np.array([0.995 * np.exp(0.5j), 0.99 * np.exp(1.1j)])  # of a sample: ζ 1 and 0.9 %
SHAPES = np.array([[1.0, 0.5], [0.6, -1.0], [-0.8, 0.7]])


def responses_to(loads: FloatArray) -> FloatArray:
    """(3, n) of the two modes."""
    modal = SHAPES[: len(loads)].T @ loads
    return SHAPES @ [
        lfilter([1, -1], [1, -2 * pole.real, abs(pole) ** 2], each)
        for pole, each in zip(POLES, modal, strict=True)
    ]


def expected(found: LoadFrfs) -> ComplexArray:
    """(3, R, L) the FRFs with the window's rate."""
    z = np.exp((found.window_rate_per_s + 2j * np.pi * found.frequency_hz) / RATE)
    modal = [(1 - 1 / z) / (1 - 2 * p.real / z + abs(p) ** 2 / z**2) for p in POLES]
    return np.einsum("ik,jk,kl->ijl", SHAPES, SHAPES[: len(found.references)], modal)


def recorded(loads: FloatArray, noise: float = 0.01) -> FloatArray:
    """Responses and below them loads, once the body is in motion."""
    x = responses_to(loads)
    x += noise * x.std() * np.random.default_rng(9).standard_normal(x.shape)
    return np.concatenate([x, loads])[:, SETTLED:]


def recorded_sines(
    hz: Sequence[float], samples: int, noise: float, seed: int = 0, loads: int = 1
) -> FloatArray:
    """Responses and loads that are sines, with noise; of two loads each has one."""
    rng, time = np.random.default_rng(seed), np.arange(samples + SETTLED) / RATE
    sines = np.sin(2 * np.pi * np.outer(hz, time) + rng.uniform(0, 6, (len(hz), 1)))
    x = recorded(sines.sum(axis=0)[None] if loads == 1 else sines, noise=0.0)
    x[:3] += noise * rng.standard_normal(x[:3].shape)
    return x


def random_loads(count: int) -> FloatArray:
    white = np.random.default_rng(4).standard_normal((count, SAMPLES + SETTLED))
    white[1:] += 0.5 * white[:1]
    return np.asarray(lfilter([1], [1, -0.7], white))


def bursts() -> FloatArray:
    return random_loads(2) * (np.arange(SAMPLES + SETTLED) % 700 < 350)


def sweeps() -> FloatArray:
    """Two shakers that sweep at rates of their own."""
    time = np.arange(SAMPLES + SETTLED) / RATE
    return np.stack([chirp(time % long, 0.5, long, 39.0) for long in (11.0, 14.3)])


def pulses() -> FloatArray:
    rng, loads = np.random.default_rng(2), np.zeros((2, SAMPLES + SETTLED))
    for row in loads:
        for at in rng.choice(loads.shape[1] - 4, 80):
            row[at : at + 3] += rng.uniform(0.5, 2) * np.array([0.5, 1.0, 0.5])
    return loads


@pytest.mark.parametrize("loads", [random_loads(1), random_loads(2), bursts(), sweeps(), pulses()])
def test_frfs_of_any_load_are_the_bodys(loads: FloatArray) -> None:
    x = recorded(loads)
    found = frfs_of_loads(lambda: [x], RATE, THREE, along_z(range(1, len(loads) + 1)))
    off = found.mean - expected(found)
    # 12 to 14 lengths of a segment: a few percent of the largest by chance; and each value within
    # three deviations that rest on as many groups, of which a sweep passes each line in a few
    assert abs(off).max() < 0.06 * abs(expected(found)).max()
    within = abs(off) ** 2 < 9 * found.variance
    assert within.mean() > 0.93
    assert np.median(found.coherence) > 0.98
    assert found.notes == ()
    assert found.frfs().values.shape == (3 * len(loads), found.frequency_hz.size)


def test_chunks_of_any_length_give_the_same() -> None:
    x = recorded(random_loads(2))
    whole = frfs_of_loads(lambda: [x], RATE, THREE, TWO)
    parts = frfs_of_loads(
        lambda: (x[:, at : at + 777] for at in range(0, x.shape[1], 777)), RATE, THREE, TWO
    )
    np.testing.assert_allclose(parts.blocks, whole.blocks, rtol=1e-9, atol=1e-9)


def test_a_load_that_repeats_needs_no_window() -> None:
    one = np.random.default_rng(7).standard_normal(500)
    x = recorded(np.tile(one, (SAMPLES + SETTLED) // 500)[None], noise=0.0)
    found = frfs_of_loads(lambda: [x], RATE, THREE, along_z((1,)))
    assert found.window_rate_per_s == 0
    assert found.notes[0].kind == "load_periodic"
    np.testing.assert_allclose(np.diff(found.frequency_hz), RATE / 500)
    # the body is steady to e^{-0.005 · 3000} before the first block
    np.testing.assert_allclose(found.mean, expected(found), rtol=1e-5, atol=1e-5)


def test_loads_that_are_alike_in_a_band_are_left_out_there() -> None:
    loads = random_loads(2)
    low, high = butter(8, 10.0, fs=RATE), butter(8, 10.0, "high", fs=RATE)
    loads[1] = lfilter(*low, loads[0]) + lfilter(*high, loads[1])
    found = frfs_of_loads(lambda: [recorded(loads)], RATE, THREE, TWO)
    (note,) = found.notes
    assert note.kind == "loads_alike"
    assert "points 1, 2" in note.text
    assert found.frequency_hz[0] == pytest.approx(10, abs=2)
    off = abs(found.mean - expected(found))[..., found.frequency_hz > 12]
    assert off.max() < 0.06 * abs(expected(found)).max()


def test_loads_that_are_alike_are_refused() -> None:
    loads = random_loads(1)
    x = recorded(np.concatenate([loads, 0.7 * loads]))
    with pytest.raises(InputError, match="points 1, 2 are alike in all lines"):
        frfs_of_loads(lambda: [x], RATE, THREE, TWO)


@pytest.mark.parametrize(
    ("samples", "lag_s", "message"),
    [
        (1500, None, "recording: is 15 s long, expected 15.4 s or more"),
        (SAMPLES, 20.0, "lag_s: is 20 s, expected 0.64 to 10 s"),
    ],
)
def test_what_is_too_short_is_refused(samples: int, lag_s: float | None, message: str) -> None:
    x = recorded(random_loads(1))[:, :samples]
    with pytest.raises(InputError, match=message):
        frfs_of_loads(lambda: [x], RATE, THREE, along_z((1,)), lag_s=lag_s)
