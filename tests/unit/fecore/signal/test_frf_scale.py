"""A sensitivity that is wrong by ten is named where a processing can know it."""

from dataclasses import replace

import numpy as np
import pytest

from fecore.findings import Finding
from fecore.frf import Dof, FrfSet
from fecore.signal import Hit, Processing, Strip, Windows, by_point, process
from fecore.signal.frf_scale import FrfScale
from tests.support.hammer import Bench, campaign
from tests.support.lengths import long

FIRST = {"clamped": 1.8751, "free": 4.7300}


def _scaled(hit: Hit, factor: float) -> Hit:
    (response,) = hit.responses
    return replace(hit, responses=(replace(response, samples=factor * response.samples),))


def _strip(bench: Bench) -> Strip:
    """What is known of a simulated beam: its mass, and the stiffness that its first bending mode
    has.
    """
    body = bench.body
    first = body.orders.index((1, 0) if body.kind == "clamped" else (2, 0))
    mass = body.mass_kg / body.length_m
    wave = FIRST[body.kind] / body.length_m
    return Strip(mass, mass * (2 * np.pi * body.frequency_hz[first] / wave**2) ** 2)


@pytest.mark.parametrize(("seed", "kind", "factor"), [(21, "clamped", 10.0), long(22, "free", 0.1)])
def test_a_whole_campaign_by_what_a_strip_of_its_mass_shows(
    seed: int, kind: str, factor: float
) -> None:
    bench, _, simulated = campaign(np.random.default_rng(seed), kind, 4, 3, 0.0)
    known = Processing(strip=_strip(bench))
    hits = [one.hit for one in simulated]
    assert not any("strip" in w for w in process(by_point(hits), known).warnings)
    wrong = process(by_point([_scaled(hit, factor) for hit in hits]), known)
    assert any("strip of this mass" in w and "sensitivity" in w for w in wrong.warnings)
    assert all(v.accepted for v in wrong.verdicts)


def test_a_strong_window_is_named_where_it_makes_a_campaign_low() -> None:
    bench, _, simulated = campaign(np.random.default_rng(21), "clamped", 4, 3, 0.0)
    hits = by_point([_scaled(one.hit, 0.1) for one in simulated])
    strong = process(
        hits, Processing(strip=_strip(bench), windows=Windows(rate_per_s=300.0))
    ).warnings
    (said,) = (w for w in strong if "strip of this mass" in w)
    assert "the exponential window of 301 per second, down to 1 % after 0.015 of" in said
    assert "sensitivity" not in said  # the bench's analyser adds 1 per second
    weak = process(hits, Processing(strip=_strip(bench), windows=Windows(rate_per_s=3.0))).warnings
    assert any("strip of this mass" in w and "sensitivity" in w for w in weak)


@pytest.mark.parametrize("factor", [10.0, long(0.1)])
def test_two_hits_of_five_under_another_range_are_named_and_left_out(factor: float) -> None:
    _, _, simulated = campaign(np.random.default_rng(24), "free", 3, 5, 0.0)
    hits = [_scaled(one.hit, factor) if n in (1, 3) else one.hit for n, one in enumerate(simulated)]
    verdicts = process(by_point(hits)).verdicts
    assert [v.accepted for v in verdicts[:5]] == [True, False, True, False, True]
    fault, other = (next(f for f in verdicts[k].faults if f.criterion == "height") for k in (1, 3))
    # hits differ by place, too
    assert np.log([fault.number, other.number]) == pytest.approx(np.log(factor), abs=0.5)
    assert "sensitivity" in fault.sentence


def _wrong(frfs: FrfSet) -> list[Finding]:
    heights = FrfScale(frfs.frequency_hz, 500.0)
    heights.add(frfs)
    return heights.wrong(None)


def test_a_point_whose_sensitivity_was_changed_is_named() -> None:
    f = np.linspace(10, 500, 200)
    one = 1 / (1 - (f / 90) ** 2 + 0.02j * f / 90) + 0.3
    heights = np.array([0.2, 0.7, 1.0, 14.0, 2.0])  # near a clamp a point is low, and that is right
    points = tuple(Dof(n, 3) for n in range(1, 6))
    frfs = FrfSet(f, heights[:, None] * one, (Dof(33, 3),) * 5, points, "accelerance")
    (said,) = _wrong(frfs)
    assert "at point 4 are 14 times as high" in said.text
    assert _wrong(replace(frfs, values=np.minimum(heights, 2.0)[:, None] * one)) == []


def test_a_pair_measured_both_ways_with_unlike_heights_is_named() -> None:
    f = np.linspace(10, 500, 200)
    one = 1 / (1 - (f / 90) ** 2 + 0.02j * f / 90) + 0.3
    places = (Dof(1, 3), Dof(2, 3))
    frfs = FrfSet(f, np.array([one, 10 * one]), places, places[::-1], "accelerance")
    (said,) = _wrong(frfs)
    assert "point 1 hit at point 2 is 10 times lower than that of the opposite way" in said.text
    assert _wrong(replace(frfs, values=np.array([one, 1.2 * one]))) == []
