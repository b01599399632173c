"""Hits to FRFs, on simulated hammer tests whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecore.errors import InputError
from fecore.frf import Dof
from fecore.modal import identify
from fecore.signal import (
    Averages,
    Block,
    Findings,
    Hit,
    Processing,
    Windows,
    by_point,
    each_hit,
    inspect,
    process,
    process_in_parts,
    remove_window,
)
from tests.support import hammer
from tests.support.hammer import Bench, campaign, random_body, random_laboratory


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
    ("fault", "criterion"),
    [
        ("double", "double"),
        ("clip_force", "overload"),
        ("clip_response", "overload"),
        ("early", "early"),
        ("late", "late"),
        ("quiet", "quiet"),
    ],
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_fault_is_found_by_its_name_and_the_good_hits_stay(fault: str, criterion: str, seed: int) -> None:
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


def test_frfs_in_parts_by_several_threads_are_the_same_bits_as_all_at_once() -> None:
    bench = _bench(1)
    points = [_hits(bench, 5, "double" if label == 2 else None, label) for label in range(1, 6)]
    whole = process(points)
    *parts, found = process_in_parts(points, shelf={}, threads=3)
    assert isinstance(found, Findings)
    assert (found.verdicts, found.warnings, found.delay) == (whole.verdicts, whole.warnings, whole.delay)
    averages = [part for part in parts if isinstance(part, Averages)]
    assert np.array_equal(np.concatenate([part.frfs.values for part in averages]), whole.frfs.values)
    assert np.array_equal(np.concatenate([part.frfs.variance for part in averages]), whole.frfs.variance)
    assert np.array_equal(np.concatenate([part.coherence for part in averages]), whole.coherence)
    assert sum((part.used for part in averages), ()) == whole.used


def _with_response(hit: Hit, samples: np.ndarray) -> Hit:
    return replace(hit, responses=(replace(hit.responses[0], samples=samples),))


def test_a_body_that_rings_three_times_as_loud_as_the_noise_is_found() -> None:
    bench = _bench(2, "free", sample_rate_hz=6400.0, samples=8192, pretrigger=380, response_noise=3e-4, hum=1e-5)
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
    bench = _bench(2, "free", sample_rate_hz=6400.0, samples=8192, pretrigger=380, response_noise=3e-4, hum=1e-5)
    hits = [hit for label in (1, 2, 3) for hit in _hits(bench, 4, label=label)]
    louder = [_with_response(hit, 5 * hit.responses[0].samples) for hit in hits[:4]]
    verdicts = process(by_point([*louder, *hits[4:]])).verdicts
    assert [v.accepted for v in verdicts] == [True] * 12
    level = 5 * hits[0].responses[0].samples[:250].std()
    ring = np.sqrt(2) * level * np.exp(-np.arange(8192) / 4000) * np.sin(0.4 * np.arange(8192))
    ringing = _with_response(hits[0], hits[0].responses[0].samples + ring)
    (fault,) = process(by_point([ringing, *hits[1:]])).verdicts[0].faults
    assert fault.criterion == "early"


def test_a_top_of_three_equal_samples_is_an_overload_where_the_filter_lets_nothing_through() -> None:
    bench = _bench(5, "free", sample_rate_hz=6400.0, samples=8192, force_noise=1e-2, tip_s=1.2e-3)
    hits = _hits(bench, 5)
    assert not any(v.faults for v in process(by_point(hits)).verdicts)
    force = hits[-1].force.samples.copy()
    *_, fourth, third = np.sort(force)[:-2]
    cut = np.minimum(force, (third + fourth) / 2)
    hits[-1] = replace(hits[-1], force=replace(hits[-1].force, samples=cut))
    fault, *_ = process(by_point(hits)).verdicts[-1].faults
    assert fault.criterion == "overload"
    assert fault.sentence.startswith("The force has 1.4 samples more at its largest value than a round top")


def test_a_round_top_that_is_cut_off_is_an_overload() -> None:
    bench = _bench(2, "free", sample_rate_hz=12800.0, samples=8192, response_step=5e-5)
    hits = _hits(bench, 5)
    slow = np.cos(2 * np.pi * 15 * (np.arange(8192) - 1000) / 12800.0) * np.exp(-np.arange(8192) / 4000)
    slow *= 5 * max(float(np.abs(hit.responses[0].samples).max()) for hit in hits)
    whole = [_with_response(hit, hit.responses[0].samples + slow) for hit in hits]
    assert not any(f.criterion == "overload" for v in process(by_point(whole)).verdicts for f in v.faults)
    samples = whole[-1].responses[0].samples
    level = 0.9 * np.abs(samples).max()
    whole[-1] = _with_response(whole[-1], np.clip(samples, -level, level))
    assert [f.criterion for f in process(by_point(whole)).verdicts[-1].faults] == ["overload"]


def test_a_force_of_a_few_steps_of_the_converter_is_no_pulse() -> None:
    bench = _bench(2)
    hits = _hits(bench, 4)
    step = np.tile([1.0, -1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, -1.0], hits[0].samples // 10 + 1)[: hits[0].samples]
    step[60:] = 0.0
    hits[-1] = replace(hits[-1], force=replace(hits[-1].force, samples=0.01 * step))
    assert "late" in {f.criterion for f in process(by_point(hits)).verdicts[-1].faults}


def test_a_hit_with_the_opposite_sign_is_found_by_pulse_and_by_response() -> None:
    hits = _hits(_bench(4), 5)
    turned = replace(hits[2], force=replace(hits[2].force, samples=-hits[2].force.samples))
    response = replace(hits[3].responses[0], samples=-hits[3].responses[0].samples)
    found = process(by_point([hits[0], hits[1], turned, replace(hits[3], responses=(response,)), hits[4]]))
    assert [[f.criterion for f in v.faults] for v in found.verdicts] == [[], [], ["polarity"], ["polarity"], []]


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


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_frfs_have_the_scale_and_shape_of_the_exact_ones(
    estimator: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hammer, "PLACE_SD_M", 1e-6)  # the scatter of hits is not the estimator's error
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


def test_stated_variance_is_what_repeated_campaigns_show(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hammer, "PLACE_SD_M", 1e-6)
    bench = _bench(8, "clamped")
    windows = Processing(windows=Windows(40 / bench.laboratory.sample_rate_hz, 1.0))
    values, stated = [], []
    for _ in range(20):
        found = process(by_point(_hits(bench, 4)), windows)
        values.append(found.frfs.values[0])
        stated.append(found.frfs.variance[0])  # type: ignore[index]  # four hits have one
    excited = found.frfs.frequency_hz < found.excited_hz
    seen = np.var(values, axis=0, ddof=1)[excited]
    ratio = np.mean(stated, axis=0)[excited] / seen
    assert 0.8 < np.median(ratio) < 1.25


def test_damping_is_the_same_under_any_exponential_window() -> None:
    bench = _bench(9, "free", high_pass=False, samples=8192)
    places = [(x * bench.body.length_m, y * bench.body.width_m) for x in (0.15, 0.9) for y in (-0.4, 0.4)]
    hits = [bench.hit(label, place, n).hit for label, place in enumerate(places, 1) for n in (1, 2, 3)]
    length = 40 / bench.laboratory.sample_rate_hz
    elastic = bench.body.frequency_hz[bench.body.frequency_hz > 5]
    band = (0.8 * elastic[0], 1.15 * elastic[1])
    ratios = []
    for rate in (0.0, 3.0):
        found = process(by_point(hits), Processing(windows=Windows(length, rate), band_hz=band))
        modes = identify(found.frfs).modes
        frequency, damping = remove_window(modes.frequency_hz, modes.damping_ratio, found.rate_per_s)
        ratios.append([damping[np.argmin(np.abs(frequency - f))] for f in elastic[:2]])
    truth = bench.body.damping_ratio[bench.body.frequency_hz > 5][:2]
    np.testing.assert_allclose(ratios, np.tile(truth, (2, 1)), rtol=0.02)


def test_an_analysers_window_on_one_channel_is_completed_on_the_other() -> None:
    hits = _hits(_bench(10), 3)
    rate = 3.0
    weight = np.exp(-rate * np.arange(hits[0].samples) / hits[0].sample_rate_hz)
    applied = [
        replace(
            h, responses=(replace(h.responses[0], samples=h.responses[0].samples * weight, window_rate_per_s=rate),)
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
    body, laboratory = random_body(rng, "clamped"), replace(random_laboratory(rng, rate), high_pass=True)
    bench = Bench(body, laboratory, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    place = (0.8 * body.length_m, 0.3 * body.width_m)
    hits = [bench.hit(1, place, n).hit for n in range(1, 7)]
    found = process(by_point(hits), Processing(windows=Windows(0.01)))
    coupling = found.coupling
    assert coupling is not None
    assert coupling.amplitude_per_s == pytest.approx(2 * np.pi * 0.5, rel=0.15)  # the coupling's corner is at 0.5 Hz
    s = 2j * np.pi * found.frfs.frequency_hz
    exact = bench.body.accelerance((s + rate) / 2j / np.pi, bench.sensor, bench.body.shapes(place))
    low = np.abs(found.frfs.frequency_hz / body.frequency_hz.min() - 1) < 0.1
    phase = np.angle(np.vdot(exact[low], found.frfs.values[0][low]))
    assert abs(phase) < 0.15 * 0.5 / body.frequency_hz.min()  # without the tail it is the whole of this


def test_a_delay_between_the_channels_is_told_and_can_be_taken_out() -> None:
    rng = np.random.default_rng(11)
    body = random_body(rng, "free")
    laboratory = replace(random_laboratory(rng, 0.0), delay_s=30e-6, high_pass=False)
    bench = Bench(body, laboratory, (0.96 * body.length_m, 0.45 * body.width_m), rng)
    places = [(x * body.length_m, 0.3 * body.width_m) for x in (0.1, 0.35, 0.6, 0.8)]
    hits = [bench.hit(label, place, n).hit for label, place in enumerate(places, 1) for n in (1, 2, 3)]
    found = process(by_point(hits))
    assert found.delay is not None
    assert found.delay.seconds == pytest.approx(30e-6, abs=max(3 * found.delay.sd, 3e-6))
    assert any("delay_s" in w for w in found.warnings)
    mended = process(by_point(hits), Processing(delay_s=30e-6))
    assert mended.delay is not None
    assert abs(mended.delay.seconds) < max(3 * mended.delay.sd, 3e-6)


def test_the_same_hits_give_the_same_bits() -> None:
    _, _, simulated = campaign(np.random.default_rng(12), "free", 3, 4, 0.3, 0.0)
    hits = [s.hit for s in simulated]
    one, two = process(by_point(hits)), process(by_point(hits))
    assert one.frfs.values.tobytes() == two.frfs.values.tobytes()
    assert one.frfs.variance.tobytes() == two.frfs.variance.tobytes()  # type: ignore[union-attr]  # several hits
    assert one.verdicts == two.verdicts


def test_choices_are_stated_and_repeat_the_result() -> None:
    hits = _hits(_bench(13), 4)
    found = process(by_point(hits))
    assert found.processing.windows is not None
    again = process(by_point(hits), found.processing)
    assert again.frfs.values.tobytes() == found.frfs.values.tobytes()


def test_a_single_hit_has_an_frf_without_variance_and_says_so() -> None:
    found = process(by_point(_hits(_bench(14), 1)))
    assert np.isnan(found.frfs.variance).all()  # type: ignore[arg-type]  # an array
    assert any("no variance" in w for w in found.warnings)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_force_and_response_that_are_swapped_are_named(seed: int) -> None:
    hits = _hits(_bench(seed, ("free", "clamped", "plate", "free")[seed - 1]))
    assert all(verdict.accepted for verdict in process(by_point(hits)).verdicts)

    def swap(hit: Hit) -> Hit:
        (response,) = hit.responses
        other = replace(response, samples=hit.force.samples)
        return replace(hit, force=replace(hit.force, samples=response.samples, full_scale=None), responses=(other,))

    with pytest.raises(InputError, match="swapped"):
        process(by_point([swap(hit) for hit in hits]))


def _flat(samples: np.ndarray, quantity: str = "force") -> Block:
    return Block(Dof(1, 3), quantity, samples)  # type: ignore[arg-type]  # a literal


def test_channels_that_carry_nothing_are_an_error_that_says_why() -> None:
    silent = Hit(_flat(np.zeros(1024)), (_flat(np.zeros(1024), "acceleration"),), 1000.0)
    with pytest.raises(InputError, match="none of the hits is good"):
        process([[silent, silent, silent]])


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda x: Hit(_flat(x, "acceleration"), (_flat(x, "acceleration"),), 1000.0), "swapped"),
        (lambda x: Hit(_flat(x), (_flat(x[:100], "acceleration"),), 1000.0), "as long"),
        (lambda x: Hit(_flat(x), (_flat(x, "acceleration"),), 0.0), "sample_rate_hz"),
        (lambda x: Hit(_flat(x), (), 1000.0), "needs a response"),
        (lambda x: _flat(np.where(np.arange(x.size) == 7, np.nan, x)), "NaN or infinity, first at sample 8"),
        (lambda x: _flat(x[:10]), "samples"),
        (lambda x: Block(Dof(1, 3), "force", x, window_rate_per_s=-1.0), "window_rate_per_s"),
    ],
)
def test_blocks_that_cannot_be_right_are_refused(make: object, text: str) -> None:
    with pytest.raises(InputError, match=text):
        make(np.ones(256))  # type: ignore[operator]  # a lambda of the table


def test_hits_of_unlike_length_are_refused_with_both_lengths() -> None:
    hit = _hits(_bench(15), 1)[0]
    half = replace(
        hit,
        force=replace(hit.force, samples=hit.force.samples[: hit.samples // 2]),
        responses=(replace(hit.responses[0], samples=hit.responses[0].samples[: hit.samples // 2]),),
    )
    with pytest.raises(InputError, match=f"{hit.samples // 2} samples"):
        process([[hit, half]])


def test_a_band_of_no_two_lines_and_a_delay_of_most_of_a_block_are_refused_with_what_was_stated() -> None:
    hits = _hits(_bench(15), 2)
    block_s = hits[0].samples / hits[0].sample_rate_hz
    for band, lines in (((0.0, 0.4 / block_s), 1), ((100.1 / block_s, 100.4 / block_s), 0)):
        with pytest.raises(InputError, match=f"is {band[0]:g} to {band[1]:g} Hz and holds {lines} of the lines"):
            process([hits], Processing(band_hz=band))
    assert process([hits], Processing(band_hz=(99.9 / block_s, 101.1 / block_s))).frfs.frequency_hz.size == 2
    with pytest.raises(InputError, match="at most half a block of"):
        process([hits], Processing(delay_s=-0.6 * block_s))
