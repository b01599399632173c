"""FRFs with the faults that measured ones have: none of the modes lost, none invented; and each remedy alone."""

from __future__ import annotations

import functools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff

from benchmarks.made_frfs import KINDS, Draw
from fecore.errors import IdentificationError
from fecore.frf import Dof, FrfSet
from fecore.modal import Found, Identification, Options, identify
from fecore.modal.arrangement import arrange
from fecore.modal.basis import Terms
from fecore.modal.causality import turned_backwards
from fecore.modal.compression import compress
from fecore.modal.error_model import memory
from fecore.modal.leakage import leakage
from fecore.modal.noise import line_scatter, rough_variance
from fecore.modal.refinement import evaluate, refine
from fecore.modal.screening import screen
from tests.support.beams import PAPER_HZ, PAPER_ZETA, paper_frfs
from tests.support.places import shared_file


def with_coherence(path: Path, averages: int = 5) -> FrfSet:
    """The FRFs of a UFF file, with the variance that their coherences state (Bendat and Piersol)."""
    file = pyuff.UFF(str(path))
    sets = [file.read_sets(int(i)) for i in np.flatnonzero(np.asarray(file.get_set_types()) == 58)]
    frfs, coherences = ([s for s in sets if s["func_type"] == kind] for kind in (4, 6))
    values = np.array([s["data"] for s in frfs], dtype=complex)
    variance = None
    if coherences:
        gamma = np.clip(np.array([s["data"].real for s in coherences]), 1e-6, 1 - 1e-9)
        variance = np.abs(values) ** 2 * (1 - gamma) / (gamma * averages)
    dofs = [[Dof(int(s[f"{side}_node"]), int(s[f"{side}_dir"])) for s in frfs] for side in ("rsp", "ref")]
    return FrfSet(np.asarray(frfs[0]["x"], float), values, tuple(dofs[0]), tuple(dofs[1]), "accelerance", variance)


def assert_found(found: Found, draw: Draw) -> None:
    """Every mode that must be there is a mode, f within 0.2 %, ζ within 10 % or its 95 % interval; and there is no other."""
    sd = found.modes.damping_sd
    assert sd is not None
    f, zeta = found.modes.frequency_hz, found.modes.damping_ratio
    sure = [k for k, why in enumerate(found.doubt) if why is None]
    for true, ratio in zip(draw.frequency_hz[~draw.optional], draw.zeta[~draw.optional], strict=True):
        near = [k for k in sure if abs(f[k] / true - 1) < 0.002]
        assert near, f"{true:.2f} Hz is lost; found {f}"
        assert any(abs(zeta[k] - ratio) < max(0.1 * ratio, 1.96 * sd[k]) for k in near), f"damping at {true:.2f} Hz"
    for k in sure:
        assert (
            np.min(np.abs(f[k] / draw.frequency_hz - 1)) < 0.05 if f[k] < draw.frequency_hz[~draw.optional][0] else True
        )
    above = [k for k in sure if f[k] > 0.98 * draw.frequency_hz[~draw.optional][0]]
    assert len(above) == int(np.sum(~draw.optional)), f"invented among {f[above]}"


@pytest.mark.parametrize("kind", ["bridge", "plate", "aeroplane"])
def test_open_sets_with_the_faults_of_measured_ones(kind: str) -> None:
    path = shared_file("BLIND_OPEN", "blind-open", f"real-like-{kind}.uff")
    modes = json.loads(path.with_suffix(".truth.json").read_text())["modes"]
    f, zeta, suspension = (np.array([m[key] for m in modes]) for key in ("f_hz", "zeta_seen", "suspension"))
    frfs = with_coherence(path)
    if kind == "aeroplane":  # every other of its 74 hits, each at three sensors
        frfs = frfs.select([i for i in range(222) if i // 3 % 2 == 0])
    assert_found(identify(frfs).found, Draw(frfs, f, zeta, suspension, np.empty(0)))


@functools.cache
def drawn(kind: str) -> tuple[Draw, Identification]:
    draw = KINDS[kind](7)
    return draw, identify(draw.frfs)


@pytest.mark.parametrize("kind", ["bridge", "plate"])
def test_draws_of_our_own(kind: str) -> None:
    draw, found = drawn(kind)
    assert_found(found.found, draw)


@pytest.mark.parametrize("seed", [2, 4002])
def test_a_group_of_overlapping_modes_is_found_though_none_of_them_pays_alone(seed: int) -> None:
    draw = KINDS["plate"](seed)
    assert_found(identify(draw.frfs).found, draw)


@pytest.mark.parametrize(("part", "said"), [("real", "no imaginary part"), ("imag", "no real part")])
def test_half_of_the_numbers_is_refused_by_name(part: str, said: str) -> None:
    frfs = paper_frfs(0.01, 3)
    only = getattr(frfs.values, part) * (1 if part == "real" else 1j)
    with pytest.raises(IdentificationError, match=said):
        identify(replace(frfs, values=only.astype(complex)))


@pytest.mark.parametrize("kind", ["bridge", "plate"])
def test_conjugates_are_conjugated_back_and_named(kind: str) -> None:
    draw, straight = drawn(kind)
    turned = identify(draw.frfs.conjugated())
    assert_found(turned.found, draw)
    assert any("the FRFs are conjugates" in w for w in turned.warnings)
    assert np.allclose(turned.modes.frequency_hz, straight.modes.frequency_hz, rtol=1e-9)


def test_the_sense_is_judged_by_all_lines_and_noise_has_none() -> None:
    hz, f = np.arange(50.0, 250.0, 0.5), np.array([[100.0], [200.0]])
    resonances = 1 / (f**2 - hz**2 + 0.04j * f * hz)
    frfs = FrfSet(hz, resonances.sum(axis=0)[None], (Dof(1, 3),), (Dof(1, 3),), "receptance")
    antiresonance = (140.0, 175.0)  # where a driving point turns the other way
    assert turned_backwards(arrange(frfs, antiresonance))
    assert not screen(frfs, antiresonance).conjugated
    assert screen(frfs.conjugated(), antiresonance).conjugated
    rng = np.random.default_rng(1)
    values = rng.standard_normal((4, 400)) + 1j * rng.standard_normal((4, 400))
    dofs = tuple(Dof(i + 1, 3) for i in range(4))
    assert not turned_backwards(arrange(FrfSet(np.arange(1.0, 401.0), values, dofs, (Dof(9, 3),) * 4)))


def test_a_narrow_mode_beside_a_multiple_of_the_mains_is_a_mode() -> None:
    """Lines 1.25 Hz apart: a hum of 100 Hz lies on one of them and has no tails, so what has tails is a mode."""
    rng = np.random.default_rng(2)
    hz, f = np.arange(1.25, 400.0, 1.25), np.array([100.5, 180.0, 290.0])
    s, w = 2j * np.pi * hz, 2 * np.pi * f[:, None]
    values = rng.standard_normal((10, 3)) @ (s**2 / (s**2 + 0.003 * w * s + w**2))
    values = values + 0.02 * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
    dofs = tuple(Dof(i + 1, 3) for i in range(10))
    frfs = FrfSet(hz, values, dofs, (Dof(99, 3),) * 10)
    assert identify(frfs).modes.frequency_hz == pytest.approx(f, rel=1e-3)


def test_the_bridge_that_somebody_measured() -> None:
    found = identify(with_coherence(shared_file("MEASURED", "measured", "dam0.unv")))
    f = found.modes.frequency_hz
    for true in (2.482, 2.958, 3.497, 4.081, 4.166, 4.632):
        assert np.sum(np.abs(f / true - 1) < 0.002) == 1
    assert np.sum(f < 6) == 6
    assert any("leakage below" in w for w in found.warnings)


def test_drift_between_the_frfs_is_found_and_taken_out() -> None:
    draw = KINDS["aeroplane"](3, points=74, sensors=3)
    rows = [i for i in range(222) if i % 3 == 0]  # one sensor
    band = draw.frfs.select(rows).band(40.0, 130.0)
    inside = (draw.frequency_hz > 40) & (draw.frequency_hz < 130)
    found = identify(band)
    assert found.drift == pytest.approx(3e-4, rel=0.25)  # 74 draws: ± 8 %, and drift beside the errors of the chain
    assert any("drift" in w for w in found.warnings)
    sd_f, sd_zeta = found.modes.frequency_sd_hz, found.modes.damping_sd
    assert sd_f is not None
    assert sd_zeta is not None
    z = []
    for true, ratio in zip(draw.frequency_hz[inside], draw.zeta[inside], strict=True):
        k = int(np.argmin(np.abs(found.modes.frequency_hz - true)))
        z += [
            (found.modes.frequency_hz[k] - true) / sd_f[k],
            (found.modes.damping_ratio[k] - ratio) / sd_zeta[k],
        ]
        assert abs(found.modes.damping_ratio[k] / ratio - 1) < 0.02  # a drift left in makes it 2 to 10 % too large
    assert np.mean(np.abs(z) < 1.96) >= 0.85  # of 95 % intervals, few of them


def test_scatter_between_sessions_counts_where_it_is_larger_than_the_fit_supposes() -> None:
    """FRFs of one sensor whose poles jump from FRF to FRF: white noise alone would promise too much by far."""
    rng = np.random.default_rng(2)
    hz = np.arange(20.0, 80.0, 0.25)
    s = 2j * np.pi * hz
    w = 2 * np.pi * 50 * (1 + 2e-3 * rng.standard_normal((40, 1)))
    values = s**2 / (s**2 + 2 * 0.01 * w * s + w**2) + 0.003 * (
        rng.standard_normal((40, hz.size)) + 1j * rng.standard_normal((40, hz.size))
    )
    frfs = FrfSet(hz, values, tuple(Dof(i + 1, 3) for i in range(40)), (Dof(99, 3),) * 40, "accelerance")
    arrangement = arrange(frfs)
    fit = refine(arrangement, Terms(np.array([50.0]), np.array([0.01]), (0,)), np.full(values.shape, 1.8e-5))
    white = fit.parameter_covariance[0, 0] ** 0.5
    seen = replace(fit, sessions=np.arange(40)).parameter_covariance[0, 0] ** 0.5
    assert white < 1e-4
    assert seen == pytest.approx(2e-3 / 40**0.5, rel=0.25)  # the mean of 40 jumps, and its own scatter of 11 %


def test_a_null_direction_touches_only_its_own_parameters() -> None:
    """A pole far beyond the band beside another: nothing is known of either, and all is known of the others."""
    arrangement = arrange(paper_frfs(0.01, 3))
    variance = rough_variance(arrangement.values, arrangement.measured)
    alone = evaluate(arrangement, Terms(PAPER_HZ, PAPER_ZETA, (-2, 0)), variance)
    beside = Terms(np.append(PAPER_HZ, [9e5, 9.0001e5]), np.append(PAPER_ZETA, [0.5, 0.5]), (-2, 0))
    fit = evaluate(arrangement, beside, variance)
    own, all_of = np.diag(alone.parameter_covariance), np.diag(fit.parameter_covariance)
    assert np.allclose(all_of[:5] / fit.inflation, own[:5] / alone.inflation, rtol=0.5)
    assert np.all(all_of[5:7] > 1e3 * own[:5].max())


def test_combinations_keep_the_poles_and_lose_the_bulk() -> None:
    arrangement = arrange(paper_frfs(0.01, 3))
    noise = line_scatter(arrangement.values, arrangement.measured, 1.0)
    small = compress(arrangement, noise)
    assert 5 <= len(small.mixing) < 15
    own = np.sqrt(np.median(noise, axis=1))
    back = own[:, None] ** 2 * small.mixing.T @ small.arrangement.values
    lost = np.mean(np.abs(back - arrangement.values) ** 2) / np.mean(noise)
    assert lost < 2  # what is left out is noise


def test_memory_of_white_and_of_smooth_errors() -> None:
    rng = np.random.default_rng(4)
    white = rng.standard_normal((20, 2000)) + 1j * rng.standard_normal((20, 2000))
    smooth = sum(np.roll(white, shift, axis=1) for shift in range(5))
    whole, one = np.ones((20, 2000), dtype=bool), np.ones((20, 2000))
    assert memory(white, one, whole) == 1.0
    assert memory(smooth, one, whole) == pytest.approx(5, rel=0.05)  # 1 + 2 (0.8 + 0.6 + 0.4 + 0.2)


def test_scatter_of_lines_follows_frequency_and_does_not_see_resonances() -> None:
    draw = KINDS["bridge"](5)
    values, hz = draw.frfs.values[:, 1:], draw.frfs.frequency_hz[1:]
    scatter = np.sqrt(np.median(line_scatter(values, np.ones(values.shape, dtype=bool), 1.0), axis=0))
    low, high = scatter[np.argmin(np.abs(hz - 1))], scatter[np.argmin(np.abs(hz - 7))]
    assert 5 < low / high < 60  # 1/f² down to a floor
    peak = np.argmin(np.abs(hz - draw.frequency_hz[2]))
    assert scatter[peak] < 0.3 * np.sqrt(np.mean(np.abs(values[:, peak]) ** 2))


def test_leakage_is_left_out_only_where_there_is_some() -> None:
    draw = KINDS["bridge"](5)
    cut, said = leakage(arrange(draw.frfs))
    assert 0.5 < cut.frequency_hz[0] < draw.frequency_hz[0]
    assert "leakage below" in said[0]
    for clean in (paper_frfs(0.05, 1), paper_frfs(0.0)):
        assert leakage(arrange(clean))[1] == []


def test_a_run_ends_with_what_its_report_raises() -> None:
    class StopError(Exception):
        pass

    seen: list[float] = []

    def report(stage: str, share: float) -> None:
        assert stage
        seen.append(share)
        if share > 0.3:
            raise StopError

    with pytest.raises(StopError):
        identify(KINDS["bridge"](5).frfs, report=report)
    assert seen == sorted(seen)
    assert len(seen) >= 4


def test_a_single_frf_is_enough_and_its_uncertain_poles_are_kept_apart_and_can_be_had() -> None:
    """At the root the first mode, of 16 % damping, is within the errors of its lines."""
    found = identify(paper_frfs(0.01, 6).select([0]))
    assert np.allclose(found.modes.frequency_hz[-4:], PAPER_HZ[1:], rtol=0.01)
    assert all(p >= 0.9 for p in found.chosen().probability)
    strict = identify(paper_frfs(0.01, 6).select([0]), Options(threshold=1.0))
    assert strict.doubtful is not None
    assert len(strict.doubtful.modes) == len(strict.found.modes)
    assert len(strict.chosen(include_doubtful=True).modes) == len(strict.found.modes)
    with pytest.raises(IdentificationError, match="include_doubtful"):
        strict.chosen()
    assert "a mode with probability" in str(strict.doubtful.doubt[0])
    assert {feature.name for feature in strict.found.features[0]} <= {"phase", "rise", "share", "damping", "twin"}
