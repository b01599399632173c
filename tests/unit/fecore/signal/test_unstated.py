"""An exponential window that nobody stated is seen in the force's noise, and nothing else is taken
for one.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.signal import Hit, Processing, Windows, by_point, process
from fecore.signal.unstated import SeenRate, seen_rate
from tests.support.hammer import Bench, random_body, random_laboratory
from tests.support.lengths import long

NOT_SHOWN = SeenRate(0.0, None)


def hits(
    rate: float, seed: int = 4, count: int = 6, force_step: float = 0.0, first: bool = False
) -> list[Hit]:
    """Of one point, under a window that the blocks do not state; steps of the converter in terms of
    the noise, 0: as drawn; and whether the window came before the converter.
    """
    rng = np.random.default_rng(seed)
    body = random_body(rng, "free")
    lab = random_laboratory(rng, rate)
    lab = replace(
        lab, force_step=force_step * lab.force_noise or lab.force_step, window_first=first
    )
    bench = Bench(body, lab, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    made = [
        bench.hit(1, (0.7 * body.length_m, 0.3 * body.width_m), n).hit for n in range(1, count + 1)
    ]
    return [
        replace(
            hit,
            force=replace(hit.force, window_rate_per_s=0.0),
            responses=tuple(replace(block, window_rate_per_s=0.0) for block in hit.responses),
        )
        for hit in made
    ]


@pytest.mark.parametrize(("rate", "seed"), [(0.5, 4), (1.0, 5), (3.0, 6)])
def test_a_window_that_nobody_stated_is_seen(rate: float, seed: int) -> None:
    seen = seen_rate(hits(rate, seed))
    assert seen.sd is not None
    assert seen.rate_per_s > 0
    assert abs(seen.rate_per_s - rate) < max(4 * seen.sd, 0.01)


@pytest.mark.parametrize("seed", [0, *map(long, range(1, 5))])
def test_noise_without_a_window_shows_none(seed: int) -> None:
    seen = seen_rate(hits(0.0, seed))
    assert seen.rate_per_s == 0
    assert seen.sd is not None
    assert seen.sd < 0.12  # and that there is none is sure


def test_a_hammer_that_rings_into_its_noise_shows_no_window() -> None:
    ringing = []
    for hit in hits(0.0):
        x = hit.force.samples.copy()
        late = np.arange(x.size - np.argmax(x)) / hit.sample_rate_hz
        x[np.argmax(x) :] += (
            0.02 * x.max() * np.exp(-8 * late) * np.sin(0.3 * hit.sample_rate_hz * late)
        )
        ringing.append(replace(hit, force=replace(hit.force, samples=x)))
    assert seen_rate(ringing) == NOT_SHOWN


def test_the_ringing_of_a_filter_behind_a_short_pulse_is_no_window() -> None:
    """A hard tip's pulse is shorter than the filter rings, and some of that was left in the first
    of the noise.
    """
    rng = np.random.default_rng(77)
    body = random_body(rng, "clamped")
    lab = replace(
        random_laboratory(rng, 0.0),
        sample_rate_hz=6400.0,
        samples=16384,
        pretrigger=640,
        tip_s=8e-4,
        force_n=100.0,
    )
    bench = Bench(body, lab, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    seen = seen_rate(
        [bench.hit(1, (0.15 * body.length_m, 0.4 * body.width_m), n).hit for n in range(1, 19)]
    )
    assert seen.rate_per_s == 0
    assert seen.sd is not None
    assert seen.sd < 0.01


@pytest.mark.parametrize("rate", [long(0.5), 1.0, long(3.0)])
def test_a_converter_behind_the_window_has_steps_that_do_not_decay(rate: float) -> None:
    """Noise of 1.3 steps: 0.5 per second was seen as 0.45 ± 0.003, 1 as 0.84 ± 0.004, and 3 not at
    all.
    """
    seen = seen_rate(hits(rate, 5, count=12, force_step=0.75, first=True))
    assert seen.sd is not None
    assert abs(seen.rate_per_s - rate) < 2.5 * seen.sd
    assert seen.sd < 0.06 * rate


def test_noise_that_the_converters_steps_hide_shows_nothing() -> None:
    """Steps of four times the noise: drift decides how often one is crossed, and 1 per second was
    seen as 1.39 ± 0.04.
    """
    assert seen_rate(hits(1.0, 5, force_step=4.0, first=True)) == NOT_SHOWN


@pytest.mark.parametrize("rate", [long(0.5), 1.0, long(3.0)])
def test_single_steps_that_decay_show_a_window_behind_the_converter(rate: float) -> None:
    seen = seen_rate(hits(rate, 5, force_step=4.0))
    assert seen.sd is not None
    assert abs(seen.rate_per_s - rate) < 0.01
    assert seen.sd < 0.02


def test_steps_that_drift_crosses_leave_open_what_they_hide() -> None:
    """Noise of 0.3 steps without a window: 0.13 ± 0.005 per second was seen."""
    seen = seen_rate(hits(0.0, 5, force_step=3.3, first=True))
    assert seen.rate_per_s == 0
    assert seen.sd is None or seen.sd > 0.05


def test_a_force_without_noise_and_few_hits_show_none() -> None:
    silent = [
        replace(h, force=replace(h.force, samples=np.where(h.force.samples > 5, 1.0, 0.0)))
        for h in hits(3.0)
    ]
    assert seen_rate(silent) == NOT_SHOWN
    assert seen_rate(hits(3.0, count=3)) == NOT_SHOWN


def test_the_frfs_carry_the_window_that_was_seen_and_a_warning_says_so() -> None:
    found = process(by_point(hits(1.0)), Processing(windows=Windows()))
    assert found.rate_per_s == pytest.approx(1.0, abs=0.02)
    assert found.rate_sd_per_s is not None
    assert 0 < found.rate_sd_per_s < 0.05
    assert any("an exponential window that is not stated" in warning for warning in found.warnings)
    stated = [replace(h, force=replace(h.force, window_rate_per_s=0.7)) for h in hits(1.0)]
    found = process(by_point(stated), Processing(windows=Windows()))
    assert (found.rate_per_s, found.rate_sd_per_s) == (0.7, 0.0)
    few = process(by_point(hits(0.0, count=3)), Processing(windows=Windows()))
    assert (few.rate_per_s, few.rate_sd_per_s) == (0.0, None)
