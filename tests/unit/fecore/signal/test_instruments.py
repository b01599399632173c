"""Good hits stay good under what real instruments and hands do; what is faulty among them is still found."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hammer import campaign
from fecore.signal import Processing, by_point, process
from fecore.signal.usual import reach


@pytest.mark.parametrize(
    ("habit", "kind", "seed"),
    [
        ("hard tip", "clamped", 7),
        ("offset", "free", 2),
        ("drift", "free", 2),
        ("hum, short pretrigger", "plate", 2),
        ("hits soon after one another", "clamped", 2),
        ("half-band filter", "clamped", 2),
        ("soft tip, short pretrigger", "plate", 3),
    ],
)
def test_a_habit_of_instruments_or_hands_makes_no_hit_a_bad_one(habit: str, kind: str, seed: int) -> None:
    _, places, simulated = campaign(np.random.default_rng(seed), kind, 4, 5, 0.0, habit=habit)
    found = process(by_point([s.hit for s in simulated]))
    refused = [[f.sentence for f in v.faults if f.criterion != "place"] for v in found.verdicts]
    assert refused == [[]] * 20
    assert len(places) == 4


def test_a_body_that_rings_loudly_is_found_among_hits_that_follow_one_another() -> None:
    rng = np.random.default_rng(3)
    bench, places, simulated = campaign(rng, "free", 4, 5, 0.0, habit="hits soon after one another")
    bench.habit = "as simulated"
    hits = [s.hit for s in simulated]
    hits[7] = bench.hit(2, places[2], 3, "early").hit
    verdicts = process(by_point(hits), Processing()).verdicts
    assert "early" in {f.criterion for f in verdicts[7].faults}


def test_numbers_reach_as_far_as_their_lower_half_scatters() -> None:
    rng = np.random.default_rng(1)
    for spread in (0.1, 1.0):
        values = np.exp(spread * rng.standard_normal(4000))
        assert np.log(reach(values)) / spread == pytest.approx(3.17, rel=0.1)  # 0.674 + 2.5 standard deviations
        values[:1200] *= 1e6  # three in ten that are faulty: they do not carry the limit away
        assert np.log(reach(values)) / spread < 6
    assert reach(np.array([0.0, 0.0, 1.0])) == 0.0  # nothing to measure by
