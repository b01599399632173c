"""Hits that hold almost nothing: a dead channel, a pulse at the edge of its block, a point without
one good hit.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.frf import Dof
from fecore.signal import (
    Averages,
    Block,
    Findings,
    Hit,
    Processed,
    Processing,
    by_point,
    each_hit,
    process,
    process_in_parts,
)
from fecore.signal.process import batched
from fecore.signal.windows import Windows
from tests.support.hammer import Bench, campaign, random_body, random_laboratory

RATE, SAMPLES = 2048.0, 2048
TIME = np.arange(SAMPLES) / RATE


def noise(*seed: int) -> FloatArray:
    return 1e-3 * np.random.default_rng(seed).standard_normal(SAMPLES)


def pulse(at: int = 200, width: int = 8, *, seed: int = 0) -> FloatArray:
    """A hammer's pulse with the converter's noise."""
    force = noise(1, seed)
    force[at : at + width] += 100 * np.hanning(width + 2)[1 : 1 + len(force[at : at + width])]
    return force


def ringing(at: int = 200, *, point: int = 1, seed: int = 0) -> FloatArray:
    """A body of two modes from that sample on."""
    after = np.clip(TIME - at / RATE, 0, None)
    x = sum(
        amplitude * np.exp(-zeta * 2 * np.pi * hz * after) * np.sin(2 * np.pi * hz * after)
        for amplitude, hz, zeta in ((9.0, 97.0, 0.02), (4.0 / point, 310.0, 0.01))
    )
    return np.asarray(x) + noise(2, point, seed)


def a_hit(
    number: int,
    point: int = 1,
    *,
    force: FloatArray | None = None,
    response: FloatArray | None = None,
) -> Hit:
    return Hit(
        Block(Dof(point, 3), "force", pulse(seed=number) if force is None else force),
        (
            Block(
                Dof(9, 3),
                "acceleration",
                ringing(point=point, seed=number) if response is None else response,
            ),
        ),
        RATE,
        number,
    )


def processed(*hits: Hit, **choices: Any) -> Processed:
    return process(by_point(list(hits)), **choices)


DEAD = np.zeros(SAMPLES)
LOUD = 100 * ringing()
TOUR = {point: (0.1 * point, 0.0) for point in range(1, 8)}


@pytest.mark.parametrize(
    ("force", "response", "fault"),
    [
        (DEAD, None, "The force block holds no pulse above its noise"),
        (np.full(SAMPLES, 3.0), None, "The force block holds no pulse above its noise"),
        (
            pulse(at=SAMPLES - 6),
            None,
            "The pulse lies at 100% of the block; most of the response is lost.",
        ),
        (None, DEAD, "The channel lost its signal, or holds noise alone."),
        (LOUD, DEAD, "The channel lost its signal, or holds noise alone."),
        (LOUD, LOUD, "The channels seem swapped."),
    ],
)
def test_a_hit_of_almost_nothing_is_refused_beside_good_ones(
    force: FloatArray | None, response: FloatArray | None, fault: str
) -> None:
    found = processed(*(a_hit(n) for n in (1, 2, 3)), a_hit(4, force=force, response=response))
    assert [v.accepted for v in found.verdicts] == [True, True, True, False]
    assert any(fault in f.sentence for f in found.verdicts[3].faults), found.verdicts[3].faults


def test_an_offset_under_the_analysers_window_is_no_swing_of_the_force() -> None:
    rate = 5 * RATE / SAMPLES  # down to 0.7 % at the end, where an offset is no longer what it was

    def under_window(block: Block, offset: float) -> Block:
        return replace(
            block, samples=(block.samples + offset) * np.exp(-rate * TIME), window_rate_per_s=rate
        )

    hits = [a_hit(number) for number in (1, 2, 3)]
    found = processed(
        *(
            replace(
                h,
                force=under_window(h.force, 60.0),
                responses=tuple(under_window(r, 0.0) for r in h.responses),
            )
            for h in hits
        )
    )
    assert [v.accepted for v in found.verdicts] == [True] * 3, found.verdicts


def test_a_point_without_a_good_hit_has_no_frf_and_a_warning() -> None:
    hits = (
        [a_hit(n) for n in (1, 2, 3)]
        + [a_hit(n, point=2, force=DEAD) for n in (1, 2)]
        + [a_hit(1, point=3)]
    )
    found = processed(*hits, processing=Processing(positions=TOUR))
    assert [dof.point for dof in found.frfs.references] == [1, 3]
    none, single = (
        next(w for w in found.warnings if words in w)
        for words in ("no hit of point", "a single good hit")
    )
    assert none.startswith("no hit of point 2 is good, so there is no FRF")
    assert single.startswith("a single good hit at point 3")
    assert found.frfs.variance is not None
    assert np.isnan(found.frfs.variance).all(axis=1).tolist() == [False, True]


def test_hits_left_out_one_and_all_have_no_mean() -> None:
    hits = [a_hit(n) for n in (1, 2)]
    assert each_hit(hits, [False, False]).mean == ()


def test_many_hits_of_a_point_are_compared_as_few_are() -> None:
    hits = [a_hit(n, response=-ringing() if n == 14 else None) for n in range(1, 15)]
    faults = [[f.criterion for f in v.faults] for v in processed(*hits).verdicts]
    assert faults == [[]] * 13 + [["polarity"]]


def test_frfs_in_parts_are_those_of_one_part() -> None:
    hits = [a_hit(n, point=point) for point in (1, 2, 3) for n in (1, 2, 3)]
    whole = processed(*hits)
    *parts, found = process_in_parts(by_point(hits), shelf={}, part_bytes=1, threads=3)
    assert isinstance(found, Findings)
    averages = [part for part in parts if isinstance(part, Averages)]
    assert len(averages) == 3
    for of in (
        lambda part: part.frfs.values,
        lambda part: part.frfs.variance,
        lambda part: part.coherence,
    ):
        assert np.array_equal(np.concatenate([of(part) for part in averages]), of(whole))
    assert found.verdicts == whole.verdicts
    assert tuple(used for part in averages for used in part.used) == whole.used
    assert tuple(dof for part in averages for dof in part.frfs.references) == whole.frfs.references
    assert found.warnings == whole.warnings


def test_a_force_window_that_is_longer_than_the_block_takes_nothing() -> None:
    hits = [a_hit(n) for n in (1, 2, 3)]
    wide, none = (
        processed(*hits, processing=Processing(windows=Windows(s))).frfs.values for s in (2.0, None)
    )
    assert np.array_equal(wide, none)


def test_places_that_say_nothing_of_the_hits_change_no_verdict() -> None:
    """Too few hits at one point, as many here as there at another, and shares that change along one
    axis alone.
    """

    def at(point: int, *places: int) -> list[Hit]:
        return [
            a_hit(n, point, response=ringing(point=place, seed=n))
            for n, place in enumerate(places, start=1)
        ]

    hits = [
        *at(1, 1),
        *at(2, 2, 2, 5, 5),
        *(hit for point in (3, 4, 5, 6, 7) for hit in at(point, *[point] * 3)),
    ]
    placed, unplaced = (
        processed(*hits, processing=Processing(positions=places)) for places in (TOUR, {})
    )
    assert placed.verdicts == unplaced.verdicts
    assert np.array_equal(placed.frfs.values, unplaced.frfs.values)


def test_a_second_pulse_is_as_large_under_an_analysers_window() -> None:
    def second(rate: float) -> float:
        decay = np.exp(-rate * TIME)

        def windowed(number: int) -> Hit:
            force = pulse(seed=number) + (0.5 * pulse(900) if number == 3 else 0)
            hit = a_hit(number, force=force * decay, response=ringing(seed=number) * decay)
            force_block, block = (
                replace(b, window_rate_per_s=rate) for b in (hit.force, *hit.responses)
            )
            return Hit(force_block, (block,), RATE, number)

        *_, double = processed(*(windowed(n) for n in (1, 2, 3))).verdicts
        (fault,) = double.faults
        assert fault.criterion == "double"
        return fault.number

    assert second(2.0) == pytest.approx(second(0.0), rel=0.02)


def test_hits_in_the_shortest_blocks_are_taken() -> None:
    def cut(block: Block) -> Block:
        return replace(block, samples=block.samples[190:254])

    hits = [a_hit(n) for n in (1, 2, 3)]
    found = processed(
        *(Hit(cut(hit.force), (cut(hit.responses[0]),), RATE, hit.number) for hit in hits)
    )
    assert [v.accepted for v in found.verdicts] == [True] * 3
    assert found.frfs.values.shape == (1, 25)
    assert (
        processed(*hits, processing=Processing(band_hz=(99.9, 101.1))).frfs.frequency_hz.size == 2
    )


@pytest.mark.parametrize("response", [DEAD, pulse()], ids=["dead", "rigid"])
def test_hits_of_a_body_that_shows_no_resonance_are_not_located(response: FloatArray) -> None:
    hits = [a_hit(n, point, response=response) for point in TOUR for n in (1, 2, 3)]
    overrules = {(hit.force.dof, hit.number): True for hit in hits}
    found = processed(*hits, processing=Processing(positions=TOUR, overrules=overrules))
    assert not [f for v in found.verdicts for f in v.findings if "mm" in f.sentence]


def test_one_thread_and_three_give_the_same_in_the_same_order() -> None:
    assert (
        list(batched(lambda n: n * n, 9, 1))
        == list(batched(lambda n: n * n, 9, 3))
        == [n * n for n in range(9)]
    )


def test_good_hits_are_not_cut_where_a_stated_window_ends_in_the_converters_steps() -> None:
    """A body that dies away under 6 per second before the converter: six of sixteen hits were
    refused, their last parts being still, and those of the others not.
    """
    rng = np.random.default_rng([31, 4])
    body = random_body(rng, "clamped")
    body = replace(body, damping_ratio=np.maximum(body.damping_ratio, 0.02))
    lab = replace(
        random_laboratory(rng, 6.0), sample_rate_hz=6400.0, samples=4096, pretrigger=160, tip_s=1e-3
    )
    lab = replace(
        lab, force_noise=1.4e-3 * lab.force_n, force_step=1e-3 * lab.force_n, window_first=True
    )
    lab = replace(lab, response_noise=8e-5, response_step=6e-5, hum=2e-4, high_pass=True)
    bench = Bench(body, lab, (0.97 * body.length_m, 0.45 * body.width_m), rng)
    hits = [simulated.hit for simulated in bench.tour(4, 4, 0.0)]
    assert not any(verdict.faults for verdict in process(by_point(hits)).verdicts)
    (block,) = hits[5].responses
    short = replace(block, samples=np.where(np.arange(4096) < 500, block.samples, 0.0))
    cut = process(by_point([*hits[:5], replace(hits[5], responses=(short,)), *hits[6:]])).verdicts[
        5
    ]
    assert "cut" in {fault.criterion for fault in cut.faults}


def test_points_where_nobody_can_see_where_a_hit_landed_are_named() -> None:
    """Two hits of a point do not locate a third."""
    _, places, simulated = campaign(np.random.default_rng(3), "free", 6, 4, 0.0)
    hits = [s.hit for s in simulated if s.hit.force.dof.point != 6 or s.hit.number < 3]
    known = Processing(positions={label: (*place, 0.0) for label, place in places.items()})
    (warning,) = (w for w in process(by_point(hits), known).warnings if "landed" in w)
    assert warning.startswith("where the hits of point 6 landed does not show")
    assert not any("landed" in w for w in process(by_point(hits)).warnings)
