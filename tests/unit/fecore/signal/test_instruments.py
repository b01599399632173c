"""Good hits stay good under what real instruments and hands do; what is faulty among them is still found."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from fecore.signal import Processing, by_point, process
from fecore.signal.judgement import _usual_of_most
from tests.support.habits import HabitBench
from tests.support.hammer import campaign


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
def test_a_habit_of_instruments_or_hands_makes_few_hits_bad_ones(habit: str, kind: str, seed: int) -> None:
    _, places, simulated = campaign(np.random.default_rng(seed), kind, 4, 5, 0.0, make=partial(HabitBench, habit=habit))
    found = process(by_point([s.hit for s in simulated]))
    refused = [[f.sentence for f in v.faults if f.criterion != "place"] for v in found.verdicts]
    assert len(refused) == 20
    assert sum(map(bool, refused)) <= 2  # of all seven campaigns' 140 good hits 3
    assert len(places) == 4


def test_a_body_that_rings_loudly_is_found_among_hits_that_follow_one_another() -> None:
    rng = np.random.default_rng(4)
    bench, places, simulated = campaign(
        rng, "free", 4, 5, 0.0, make=partial(HabitBench, habit="hits soon after one another")
    )
    bench.habit = "as simulated"
    hits = [s.hit for s in simulated]
    hits[7] = bench.hit(2, places[2], 3, "early").hit
    verdicts = process(by_point(hits), Processing()).verdicts
    assert "early" in {f.criterion for f in verdicts[7].faults}


def test_what_is_usual_is_told_by_the_good_hits_where_four_in_ten_are_bad() -> None:
    rng = np.random.default_rng(1)
    values = rng.standard_normal(4000)
    values[:1600] += 30.0
    middle, spread = _usual_of_most(values)
    assert middle == pytest.approx(0.0, abs=0.2)
    assert spread == pytest.approx(1.0, abs=0.2)
