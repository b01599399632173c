"""Hits to FRFs, on simulated hammer tests whose truth is known; good ones stay good under what
instruments and hands do.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fecore.errors import InputError
from fecore.modal import identify
from fecore.signal import (
    Hit,
    Processing,
    Windows,
    by_point,
    each_hit,
    inspect,
    process,
    remove_window,
)
from fecore.signal.estimators import estimate
from fecore.signal.judgement import _usual_of_most
from tests.support import hammer
from tests.support.habits import HabitBench
from tests.support.hammer import Bench, campaign, random_body, random_laboratory
from tests.support.lengths import long


def _bench(seed: int, kind: str = "free", rate: float = 0.0, **changes: object) -> Bench:
    rng = np.random.default_rng(seed)
    body = random_body(rng, kind)
    laboratory = replace(random_laboratory(rng, rate), **changes)  # type: ignore[arg-type]  # fields of many types
    return Bench(body, laboratory, (0.96 * body.length_m, 0.45 * body.width_m), rng)


def _hits(bench: Bench, count: int = 5, fault: str | None = None, label: int = 1) -> list[Hit]:
    place = (0.7 * bench.body.length_m, 0.3 * bench.body.width_m)
    hits = [bench.hit(label, place, number).hit for number in range(1, count + 1)]
    if fault:
        hits[-1] = bench.hit(label, place, count, fault).hit
    return hits


@pytest.mark.parametrize(
    ("fault", "criterion", "seed"),
    [
        ("double", "double", 3),
        ("clip_force", "overload", 1),
        ("clip_response", "overload", 2),
        ("early", "early", 3),
        ("late", "late", 1),
        ("quiet", "quiet", 2),
    ],
)
def test_a_fault_is_found_by_its_name_and_the_good_hits_stay(
    fault: str, criterion: str, seed: int
) -> None:
    bench = _bench(seed, ("free", "clamped", "plate")[seed - 1])
    found = process(by_point(_hits(bench, 5, fault)))
    named = {f.criterion for f in found.verdicts[-1].faults}
    assert named & {
        criterion,
        "place" if fault == "clip_force" else criterion,
    }  # a single lost sample may look like that
    assert not found.verdicts[-1].accepted
    assert [v.accepted for v in found.verdicts[:-1]] == [True] * 4
    for finding in found.verdicts[-1].faults:
        assert finding.sentence.endswith(".")
        assert np.isfinite(finding.number)


def _with_response(hit: Hit, samples: np.ndarray) -> Hit:
    return replace(hit, responses=(replace(hit.responses[0], samples=samples),))


def test_a_body_that_rings_three_times_as_loud_as_the_noise_is_found() -> None:
    bench = _bench(
        2,
        "free",
        sample_rate_hz=6400.0,
        samples=8192,
        pretrigger=380,
        response_noise=3e-4,
        hum=1e-5,
    )
    hits = _hits(bench, 6)
    quiet = hits[-1].responses[0].samples[:250]
    ring = 3 * quiet.std() * np.exp(-np.arange(8192) / 4000) * np.sin(0.4 * np.arange(8192))
    hits[-1] = _with_response(hits[-1], hits[-1].responses[0].samples + ring)
    verdicts = process(by_point(hits)).verdicts
    (fault,) = verdicts[-1].faults
    assert fault.criterion == "early"
    assert "times as loud as its quietest part" in fault.sentence
    assert [v.accepted for v in verdicts[:-1]] == [True] * 5


def test_a_range_that_was_changed_for_a_hit_is_no_body_that_rings() -> None:
    """Its noise is louder in all lines alike; a ring of the same level beside it is found."""
    bench = _bench(
        2,
        "free",
        sample_rate_hz=6400.0,
        samples=8192,
        pretrigger=380,
        response_noise=3e-4,
        hum=1e-5,
    )
    hits = [hit for label in (1, 2, 3) for hit in _hits(bench, 4, label=label)]
    louder = [_with_response(hit, 5 * hit.responses[0].samples) for hit in hits[:4]]
    verdicts = process(by_point([*louder, *hits[4:]])).verdicts
    assert [v.accepted for v in verdicts] == [True] * 12
    level = 5 * hits[0].responses[0].samples[:250].std()
    ring = np.sqrt(2) * level * np.exp(-np.arange(8192) / 4000) * np.sin(0.4 * np.arange(8192))
    ringing = _with_response(hits[0], hits[0].responses[0].samples + ring)
    (fault,) = process(by_point([ringing, *hits[1:]])).verdicts[0].faults
    assert fault.criterion == "early"


def test_a_top_of_three_equal_samples_is_an_overload_where_the_filter_lets_nothing_through() -> (
    None
):
    bench = _bench(5, "free", sample_rate_hz=6400.0, samples=8192, force_noise=1e-2, tip_s=1.2e-3)
    hits = _hits(bench, 5)
    assert not any(v.faults for v in process(by_point(hits)).verdicts)
    force = hits[-1].force.samples.copy()
    *_, fourth, third = np.sort(force)[:-2]
    cut = np.minimum(force, (third + fourth) / 2)
    hits[-1] = replace(hits[-1], force=replace(hits[-1].force, samples=cut))
    fault, *_ = process(by_point(hits)).verdicts[-1].faults
    assert fault.criterion == "overload"
    assert fault.sentence.startswith(
        "The force has 1.4 samples more at its largest value than a round top"
    )


def test_a_round_top_that_is_cut_off_is_an_overload() -> None:
    bench = _bench(2, "free", sample_rate_hz=12800.0, samples=8192, response_step=5e-5)
    hits = _hits(bench, 5)
    slow = np.cos(2 * np.pi * 15 * (np.arange(8192) - 1000) / 12800.0) * np.exp(
        -np.arange(8192) / 4000
    )
    slow *= 5 * max(float(np.abs(hit.responses[0].samples).max()) for hit in hits)
    whole = [_with_response(hit, hit.responses[0].samples + slow) for hit in hits]
    assert not any(
        f.criterion == "overload" for v in process(by_point(whole)).verdicts for f in v.faults
    )
    samples = whole[-1].responses[0].samples
    level = 0.9 * np.abs(samples).max()
    whole[-1] = _with_response(whole[-1], np.clip(samples, -level, level))
    assert [f.criterion for f in process(by_point(whole)).verdicts[-1].faults] == ["overload"]


def test_a_force_of_a_few_steps_of_the_converter_is_no_pulse() -> None:
    bench = _bench(2)
    hits = _hits(bench, 4)
    step = np.tile(
        [1.0, -1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, -1.0], hits[0].samples // 10 + 1
    )[: hits[0].samples]
    step[60:] = 0.0
    hits[-1] = replace(hits[-1], force=replace(hits[-1].force, samples=0.01 * step))
    assert "late" in {f.criterion for f in process(by_point(hits)).verdicts[-1].faults}


def test_a_hit_with_the_opposite_sign_is_found_by_pulse_and_by_response() -> None:
    hits = _hits(_bench(4), 5)
    turned = replace(hits[2], force=replace(hits[2].force, samples=-hits[2].force.samples))
    response = replace(hits[3].responses[0], samples=-hits[3].responses[0].samples)
    found = process(
        by_point([hits[0], hits[1], turned, replace(hits[3], responses=(response,)), hits[4]])
    )
    assert [[f.criterion for f in v.faults] for v in found.verdicts] == [
        [],
        [],
        ["polarity"],
        ["polarity"],
        [],
    ]


def test_a_hit_at_another_point_is_found() -> None:
    bench = _bench(5)
    hits = _hits(bench, 5)
    hits[1] = bench.hit(1, (0.4 * bench.body.length_m, -0.2 * bench.body.width_m), 2).hit
    found = process(by_point(hits))
    assert [f.criterion for f in found.verdicts[1].faults] in (["place"], ["polarity"])
    assert [v.accepted for v in found.verdicts] == [True, False, True, True, True]


def test_a_users_decision_overrules_both_ways_and_changes_the_frf() -> None:
    hits = _hits(_bench(6), 5, "double")
    dof = hits[0].force.dof
    judged = process(by_point(hits))
    forced = process(by_point(hits), Processing(overrules={(dof, 5): True, (dof, 1): False}))
    assert judged.used == ((1, 2, 3, 4),)
    assert forced.used == ((2, 3, 4, 5),)
    assert forced.verdicts[4].faults  # what was found stays said
    assert not np.array_equal(judged.frfs.values, forced.frfs.values)
    with pytest.raises(InputError, match="none of the hits is used: all are left out by hand; see"):
        process(by_point(hits[:2]), Processing(overrules={(dof, 1): False, (dof, 2): False}))


def test_hits_are_looked_at_one_by_one_as_they_are_processed() -> None:
    """Beside the hammer and in a figure of each hit, by the rules of the whole campaign."""
    hits = _hits(_bench(6), 5, "double")
    judged = process(by_point(hits))
    seen, drawn = inspect(by_point(hits)), each_hit(hits)
    assert [v.accepted for v in seen.verdicts] == list(drawn.accepted) == [True] * 4 + [False]
    assert list(seen.coherence) == [hits[0].force.dof]
    assert 0.9 < seen.coherence[hits[0].force.dof] <= 1
    assert inspect(by_point(hits[:1])).coherence == {}  # one hit has none
    assert drawn.frfs.shape == (5, 1, drawn.frequency_hz.size)
    lines = np.searchsorted(drawn.frequency_hz, judged.frfs.frequency_hz)
    np.testing.assert_allclose(drawn.mean[0].values[lines], judged.frfs.values[0], rtol=1e-9)
    other = each_hit(hits, [True, True, False, False, False])
    assert [estimate.hits for estimate in other.mean] == [2]
    alone, double = each_hit(hits[:4]).pulse_s, drawn.pulse_s
    assert double[0] == pytest.approx(alone[0], rel=0.05)
    assert double[1] > alone[1]  # the second pulse is in it


def test_a_channel_at_its_full_scale_is_an_overload() -> None:
    first, *others = _hits(_bench(7), 5)
    largest = float(np.abs(first.responses[0].samples).max())
    for scale, named in ((largest, ["overload"]), (10 * largest, [])):
        response = replace(first.responses[0], full_scale=scale)
        verdict = process(by_point([replace(first, responses=(response,)), *others])).verdicts[0]
        assert [fault.criterion for fault in verdict.faults] == named


@pytest.mark.parametrize(("estimator", "seed"), [("H1", 1), ("H2", 2), ("Hv", 3)])
def test_frfs_have_the_scale_and_shape_of_the_exact_ones(
    estimator: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the scatter of hits is not the estimator's error
    monkeypatch.setattr(hammer, "PLACE_SD_M", 1e-6)
    bench = _bench(seed, ("free", "clamped", "plate")[seed - 1], high_pass=False, hum=0.0)
    found = process(by_point(_hits(bench)), Processing(estimator=estimator))  # type: ignore[arg-type]  # parametrised
    f = found.frfs.frequency_hz
    s = 2j * np.pi * f[:, None] + found.rate_per_s  # the exponential window's FRF is that at iω + r
    w, z = 2 * np.pi * bench.body.frequency_hz, bench.body.damping_ratio
    gains = bench.sensor * bench.body.shapes((0.7 * bench.body.length_m, 0.3 * bench.body.width_m))
    exact = np.sum(gains * s**2 / (w**2 + 2 * z * w * s + s**2), axis=1)
    band = (f > 10) & (f < found.excited_hz)
    measured, exact = found.frfs.values[0, band], exact[band]
    assert abs(np.vdot(exact, measured) / np.vdot(exact, exact) - 1) < 0.003
    # away from the antiresonances, where H1 and H2 differ by noise
    loud = np.abs(exact) > 0.02 * np.median(np.abs(exact))
    assert np.corrcoef(np.log(np.abs(exact[loud])), np.log(np.abs(measured[loud])))[0, 1] > 0.999


def test_the_growth_of_frfs_is_what_harder_hits_change() -> None:
    rng, x = np.random.default_rng(2), np.array([-1.0, 0.0, 1.0]) * np.sqrt(1.5)
    pulse, H, change = rng.standard_normal((3, 100)).view(complex)
    forces = np.exp(0.3 * x)[:, None] * pulse
    found = estimate(forces, (H + x[:, None] * change) * forces)
    np.testing.assert_allclose(found.growth, change, rtol=1e-5)  # single precision
    np.testing.assert_allclose(found.values, H, rtol=1e-12)
    alike = np.stack([pulse, pulse])
    assert np.isnan(estimate(alike, H * alike).growth).all()


def test_stated_variance_is_what_repeated_campaigns_show(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hammer, "PLACE_SD_M", 1e-6)
    bench = _bench(8, "clamped")
    windows = Processing(windows=Windows(40 / bench.laboratory.sample_rate_hz, 1.0))
    values, stated = [], []
    for _ in range(10):  # a variance of ten, by its median over many lines, is 7 % too small
        found = process(by_point(_hits(bench, 4)), windows)
        values.append(found.frfs.values[0])
        stated.append(found.frfs.variance[0])  # type: ignore[index]  # four hits have one
    excited = found.frfs.frequency_hz < found.excited_hz
    seen = np.var(values, axis=0, ddof=1)[excited]
    ratio = np.mean(stated, axis=0)[excited] / seen
    assert 0.8 < np.median(ratio) < 1.25


def test_damping_is_the_same_under_any_exponential_window() -> None:
    bench = _bench(9, "free", high_pass=False, samples=8192)
    places = [
        (x * bench.body.length_m, y * bench.body.width_m) for x in (0.15, 0.9) for y in (-0.4, 0.4)
    ]
    hits = [
        bench.hit(label, place, n).hit for label, place in enumerate(places, 1) for n in (1, 2, 3)
    ]
    length = 40 / bench.laboratory.sample_rate_hz
    elastic = bench.body.frequency_hz[bench.body.frequency_hz > 5]
    band = (0.8 * elastic[0], 1.15 * elastic[1])
    ratios = []
    for rate in (0.0, 3.0):
        found = process(by_point(hits), Processing(windows=Windows(length, rate), band_hz=band))
        modes = identify(found.frfs).modes
        frequency, damping = remove_window(
            modes.frequency_hz, modes.damping_ratio, found.rate_per_s
        )
        ratios.append([damping[np.argmin(np.abs(frequency - f))] for f in elastic[:2]])
    truth = bench.body.damping_ratio[bench.body.frequency_hz > 5][:2]
    np.testing.assert_allclose(ratios, np.tile(truth, (2, 1)), rtol=0.02)


def test_an_analysers_window_on_one_channel_is_completed_on_the_other() -> None:
    hits = _hits(_bench(10), 3)
    rate = 3.0
    weight = np.exp(-rate * np.arange(hits[0].samples) / hits[0].sample_rate_hz)
    applied = [
        replace(
            h,
            responses=(
                replace(
                    h.responses[0], samples=h.responses[0].samples * weight, window_rate_per_s=rate
                ),
            ),
        )
        for h in hits
    ]
    by_analyser = process(by_point(applied), Processing(windows=Windows(0.02, 0.0)))
    here = process(by_point(hits), Processing(windows=Windows(0.02, rate)))
    assert by_analyser.rate_per_s == here.rate_per_s == rate
    np.testing.assert_allclose(by_analyser.frfs.values, here.frfs.values, rtol=1e-9)


@pytest.mark.parametrize("rate", [0.0, 3.0])
def test_an_ac_coupled_hammer_leaves_no_phase_behind(rate: float) -> None:
    rng = np.random.default_rng(5)
    body, laboratory = (
        random_body(rng, "clamped"),
        replace(random_laboratory(rng, rate), high_pass=True),
    )
    bench = Bench(body, laboratory, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    place = (0.8 * body.length_m, 0.3 * body.width_m)
    hits = [bench.hit(1, place, n).hit for n in range(1, 7)]
    found = process(by_point(hits), Processing(windows=Windows(0.01)))
    coupling = found.coupling
    assert coupling is not None
    # the coupling's corner is at 0.5 Hz
    assert coupling.amplitude_per_s == pytest.approx(2 * np.pi * 0.5, rel=0.15)
    s = 2j * np.pi * found.frfs.frequency_hz
    exact = bench.body.accelerance((s + rate) / 2j / np.pi, bench.sensor, bench.body.shapes(place))
    low = np.abs(found.frfs.frequency_hz / body.frequency_hz.min() - 1) < 0.1
    phase = np.angle(np.vdot(exact[low], found.frfs.values[0][low]))
    # without the tail it is the whole of this
    assert abs(phase) < 0.15 * 0.5 / body.frequency_hz.min()


def test_a_delay_between_the_channels_is_told_and_can_be_taken_out() -> None:
    rng = np.random.default_rng(11)
    body = random_body(rng, "free")
    laboratory = replace(random_laboratory(rng, 0.0), delay_s=30e-6, high_pass=False)
    bench = Bench(body, laboratory, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    places = [(x * body.length_m, 0.3 * body.width_m) for x in (0.1, 0.35, 0.6, 0.8)]
    hits = [
        bench.hit(label, place, n).hit for label, place in enumerate(places, 1) for n in (1, 2, 3)
    ]
    found = process(by_point(hits))
    assert found.delay is not None
    assert found.delay.seconds == pytest.approx(30e-6, abs=max(3 * found.delay.sd, 3e-6))
    assert any("delay_s" in w for w in found.warnings)
    mended = process(by_point(hits), Processing(delay_s=30e-6))
    assert mended.delay is not None
    assert abs(mended.delay.seconds) < max(3 * mended.delay.sd, 3e-6)


def test_choices_are_stated_and_repeat_the_result() -> None:
    hits = _hits(_bench(13), 4)
    found = process(by_point(hits))
    assert found.processing.windows is not None
    again = process(by_point(hits), found.processing)
    assert again.frfs.values.tobytes() == found.frfs.values.tobytes()


def test_force_and_response_that_are_swapped_are_named() -> None:
    hits = _hits(_bench(3, "plate"))
    assert all(verdict.accepted for verdict in process(by_point(hits)).verdicts)

    def swap(hit: Hit) -> Hit:
        (response,) = hit.responses
        other = replace(response, samples=hit.force.samples)
        return replace(
            hit,
            force=replace(hit.force, samples=response.samples, full_scale=None),
            responses=(other,),
        )

    with pytest.raises(InputError, match="swapped"):
        process(by_point([swap(hit) for hit in hits]))


@pytest.mark.parametrize(
    ("habit", "kind", "seed"),
    [
        ("hard tip", "clamped", 7),
        long("offset", "free", 2),
        long("drift", "free", 2),
        ("hum, short pretrigger", "plate", 2),
        long("hits soon after one another", "clamped", 2),
        long("half-band filter", "clamped", 2),
        long("soft tip, short pretrigger", "plate", 3),
    ],
)
def test_a_habit_of_instruments_or_hands_makes_few_hits_bad_ones(
    habit: str, kind: str, seed: int
) -> None:
    _, places, simulated = campaign(
        np.random.default_rng(seed), kind, 4, 5, 0.0, make=partial(HabitBench, habit=habit)
    )
    found = process(by_point([s.hit for s in simulated]))
    refused = [[f.sentence for f in v.faults if f.criterion != "place"] for v in found.verdicts]
    assert len(refused) == 20
    assert sum(map(bool, refused)) <= 2  # of all seven campaigns' 140 good hits 3
    assert len(places) == 4


def test_a_body_that_rings_loudly_is_found_among_hits_that_follow_one_another() -> None:
    rng = np.random.default_rng(4)
    habit = partial(HabitBench, habit="hits soon after one another")
    bench, places, simulated = campaign(rng, "free", 4, 5, 0.0, make=habit)
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
