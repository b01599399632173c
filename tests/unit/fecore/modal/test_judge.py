"""Which pole is a mode: the phase of distortions, one answer for every band, and no other error
whatever the input.
"""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.made_frfs import KINDS
from fecore.errors import IdentificationError, InputError
from fecore.frf import Dof, FrfSet
from fecore.modal import Identification, Options, identify
from fecore.modal.judge import phase_ratio, predictive
from tests.support.lengths import long

SURE = 0.9


def sure(found: Identification) -> np.ndarray:
    return found.found.modes.frequency_hz[found.found.probability >= SURE]


def agree(one: np.ndarray, other: np.ndarray, low: float, high: float) -> tuple[int, int]:
    """How many modes of each, well within a band, the other has too; and how many there are."""
    both = [np.array([f for f in each if low < f < high]) for each in (one, other)]
    shared = [
        np.min(np.abs(f / b - 1), initial=1.0) < 0.004 for a, b in (both, both[::-1]) for f in a
    ]
    return int(np.sum(shared)), len(shared)


@pytest.mark.long
def test_one_record_in_several_bands_and_by_halves_has_one_answer() -> None:
    """In short a measured bridge has in `tests/corpus`."""
    draw = KINDS["bridge"](11)
    whole = sure(identify(draw.frfs))
    first, last = draw.frfs.frequency_hz[[0, -1]]
    bands = [
        (first + a * (last - first), first + b * (last - first))
        for a, b in ((0, 0.6), (0.15, 0.8), (0.3, 1))
    ]
    shared, count = 0, 0
    for low, high in bands:
        margin = 0.03 * (high - low)
        found = agree(
            whole,
            sure(identify(draw.frfs, Options(band_hz=(low, high)))),
            low + margin,
            high - margin,
        )
        shared, count = shared + found[0], count + found[1]
    rows = len(draw.frfs.responses)
    for half in (range(0, rows, 2), range(1, rows, 2)):
        found = agree(whole, sure(identify(draw.frfs.select(list(half)))), first, last)
        shared, count = shared + found[0], count + found[1]
    assert count >= 20
    assert shared >= 0.97 * count


def test_hits_of_several_heights_show_what_a_cubic_spring_moves() -> None:
    draw = KINDS["cubed"](6)
    off, named = {}, {}
    for known in (True, False):
        found = identify(draw.frfs if known else replace(draw.frfs, growth=None))
        k = [np.argmin(np.abs(found.modes.frequency_hz - f)) for f in draw.frequency_hz]
        off[known] = np.abs(found.modes.frequency_hz[k] - draw.frequency_hz)
        off[known] /= found.modes.frequency_sd_hz[k]
        named[known] = [note.subject for note in found.notes if note.kind == "not_linear"]
    assert off[True].max() < 2.5 < off[False].max()
    assert named[True]
    assert not named[False]


@settings(max_examples=25)
@given(
    rows=st.integers(1, 6),
    lines=st.integers(2, 120),
    start=st.sampled_from([0.0, 1e-3, 10.0, 5e5]),
    content=st.sampled_from(
        ["noise", "zeros", "resonance", "spikes", "tiny", "huge", "constant", "gaps"]
    ),
    seed=st.integers(0, 99),
    band=st.sampled_from([None, (0.2, 0.7), (0.45, 0.55)]),
    places=st.sampled_from([1, 2, 6]),
)
def test_any_finite_input_gives_modes_or_an_error_in_words(
    rows: int,
    lines: int,
    start: float,
    content: str,
    seed: int,
    band: tuple[float, float] | None,
    places: int,
) -> None:
    rng = np.random.default_rng(seed)
    hz = start + np.arange(lines) * (1.0 if start < 1e5 else 1e3)
    noise = rng.standard_normal((rows, lines)) + 1j * rng.standard_normal((rows, lines))
    s, at = 1j * hz, hz[lines // 2] + 0.3
    values = (
        1 / (s**2 + 0.02 * at * s + at**2 + 1e-9) * rng.standard_normal((rows, 1)) + 1e-8 * noise
    )
    measured = np.ones((rows, lines), dtype=bool)
    if content == "spikes":
        values[:, rng.integers(0, lines, 3)] *= 1e6
    elif content == "gaps":
        measured = rng.uniform(size=measured.shape) > 0.4
    else:
        values = {
            "noise": noise, "zeros": 0 * noise, "resonance": values, "tiny": 1e-150 * noise, "huge": 1e150 * noise,
            "constant": np.ones_like(noise),
        }[content]  # fmt: skip
    dofs = tuple(Dof(i // places + 1, 3) for i in range(rows))
    others = tuple(Dof(int(i) + 1, 3) for i in rng.integers(0, places, rows))
    limits = None if band is None else tuple(hz[0] + share * (hz[-1] - hz[0]) for share in band)
    with contextlib.suppress(IdentificationError, InputError):
        frfs = FrfSet(
            hz, np.where(measured, values, 0), dofs, others, "accelerance", None, measured
        )
        found = identify(frfs, Options(band_hz=limits)).found  # type: ignore[arg-type]
        assert np.all(np.isfinite(found.modes.frequency_hz))
        assert np.all((found.probability >= 0.1) & (found.probability <= 1))


def test_the_threshold_is_the_users() -> None:
    draw = KINDS["bridge"](5)
    found = identify(draw.frfs, Options(threshold=0.5)).found
    assert all(
        (p >= 0.5) == (why is None) for p, why in zip(found.probability, found.doubt, strict=True)
    )
    for unreachable in (0.01, 1.0):
        with pytest.raises(InputError, match="threshold"):
            Options(threshold=unreachable)


def test_the_phase_speaks_for_modes_and_its_ratio_stays_finite() -> None:
    ratio = phase_ratio(np.array([-1.0, -0.9, 0.0, 0.98, 1.0]))
    assert np.all(np.isfinite(ratio))
    assert ratio[3] > 0 > ratio[1]
    assert predictive(np.array([3.0]), np.array([0.0]))[0] == pytest.approx(1 / (1 + np.exp(-3)))
    assert (
        0.5 < predictive(np.array([3.0]), np.array([20.0]))[0] < 0.9
    )  # what is hardly known is drawn towards one half


@pytest.mark.parametrize(
    ("seed", "band"),
    [(5000, (10.0, 120.0)), (19004, (60.0, 120.0)), (18001, (150.0, 400.0)), long(5000, None)],
)
def test_a_mode_that_a_roving_sensor_moves_is_one_mode(
    seed: int, band: tuple[float, float] | None
) -> None:
    """Its poles have shapes of their own, each that of the tests where it is large, and are nearer
    than modes are; or each speaks against the other, and neither stays.
    """
    draw = KINDS["wing"](seed)
    found = identify(draw.frfs, Options(band_hz=band))
    low, high = band or (0.0, np.inf)
    true = draw.frequency_hz[(draw.frequency_hz > low) & (draw.frequency_hz < high)]
    near = np.abs(sure(found)[:, None] / true - 1) < 0.004
    assert np.all(near.sum(axis=0) == 1)
    assert any(note.kind == "sensor_mass" for note in found.notes)


def test_a_refused_pole_that_leaves_beside_a_better_one_is_listed() -> None:
    found = identify(KINDS["plate"](15000).frfs)
    near = [pole for pole in found.refused_poles if abs(pole.frequency_hz - 455.6) < 1]
    assert [pole.probability < 0.1 and bool(pole.features) for pole in near] == [True]


def test_a_sensor_that_rings_in_one_of_twelve_frfs_is_no_mode() -> None:
    draw = KINDS["loose"](5002)
    found = identify(draw.frfs).found
    kept = found.modes.frequency_hz[found.probability >= SURE]
    assert np.min(np.abs(kept / draw.distortions[0] - 1)) > 0.004
    assert all(np.min(np.abs(kept / f - 1)) < 0.004 for f in draw.frequency_hz)
