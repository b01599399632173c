"""FRFs in, modes out: accuracy, uncertainty, guards, real and independent data."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.identification import SETS
from benchmarks.made_frfs import GOOD, KINDS, Harsh
from examples.paper import synthesis
from examples.paper.published import FREE_UPDATED, free_beam
from fecore.body.supports import PointMass
from fecore.correlation import mac
from fecore.errors import IdentificationError
from fecore.frf import Dof, FrfSet
from fecore.modal import Identification, Options, identify
from tests.support.beams import (
    LINES,
    PAPER_HZ,
    PAPER_SHAPES,
    PAPER_ZETA,
    add_noise,
    assert_papers_modes,
    paper_frfs,
    read_uff,
    receptance,
)
from tests.support.lengths import long
from tests.support.places import shared_file

BENDING_HZ = (51.5, 142.2, 278.7, 460.4, 687.2, 958.5)  # of the free beam that somebody measured


@pytest.fixture(scope="module")
def seeds() -> list[Identification]:
    return [identify(paper_frfs(0.05, seed, LINES)) for seed in range(4)]


def test_five_per_cent_noise_and_a_heavily_damped_first_mode(seeds: list[Identification]) -> None:
    for found in seeds:  # ± 3 standard deviations of ζ₁ (1.3 %) and many of the others (0.4 %)
        assert_papers_modes(found, 6e-3, 0.04, 0.998)
    zeta = np.mean([s.modes.damping_ratio for s in seeds], axis=0)
    hz = np.mean([s.modes.frequency_hz for s in seeds], axis=0)
    assert abs(zeta[0] / PAPER_ZETA[0] - 1) < 0.02
    assert np.all(np.abs(zeta[1:] / PAPER_ZETA[1:] - 1) < 0.01)
    assert abs(hz[0] / PAPER_HZ[0] - 1) < 3e-3  # of four: ± 0.1 %
    assert np.all(np.abs(hz[1:] / PAPER_HZ[1:] - 1) < 3e-4)


def test_stated_standard_deviations_match_the_scatter(seeds: list[Identification]) -> None:
    z = np.array(
        [
            np.append(
                (s.modes.frequency_hz - PAPER_HZ) / s.modes.frequency_sd_hz,
                (s.modes.damping_ratio - PAPER_ZETA) / s.modes.damping_sd,
            )
            for s in seeds
        ]
    )
    # 40 standardised errors: their rms is 1 ± 0.11 when the stated values are right
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.3)


def test_one_per_cent_noise() -> None:
    found = identify(paper_frfs(0.01, 1))
    assert_papers_modes(found, 1e-3, 0.01, 0.9999)
    assert found.shapes.mass_normalised is not None
    # the driving point gives modal mass: tip deflection of the first mode is 2/√0.407 for unit
    # modal mass
    true = PAPER_SHAPES / np.sqrt(0.407)
    assert np.allclose(np.abs(found.shapes.mass_normalised[:, -1]), np.abs(true[:, -1]), rtol=0.01)
    assert np.all(found.shapes.collinearity > 0.999)
    assert found.warnings == ()
    assert len(found.used) == 33


def test_another_quantity() -> None:
    clean = paper_frfs(0.0, lines=LINES).to_quantity("receptance")
    noisy = replace(clean, values=add_noise(clean.values, 0.01, 0.5, np.random.default_rng(2)))
    found = identify(noisy)
    # noise as a share of the rms, which a receptance has in its first mode: the higher ones drown
    assert abs(found.modes.frequency_hz[0] / PAPER_HZ[0] - 1) < 1e-3
    assert abs(found.modes.damping_ratio[0] / PAPER_ZETA[0] - 1) < 0.02
    assert np.all(np.min(np.abs(found.modes.frequency_hz[:, None] / PAPER_HZ - 1), axis=1) < 2e-3)


def test_a_band_is_kept_and_its_neighbours_do_not_leak_in() -> None:
    found = identify(paper_frfs(0.01, 3), Options(band_hz=(300.0, 600.0)))
    assert np.allclose(found.modes.frequency_hz, PAPER_HZ[2:4], rtol=1e-4)
    assert np.allclose(found.modes.damping_ratio, PAPER_ZETA[2:4], rtol=0.02)


def test_known_variance_weights_the_fit() -> None:
    clean, noisy = paper_frfs(0.0, lines=LINES), paper_frfs(0.05, 5, LINES)
    rms = np.mean(np.abs(clean.values) ** 2, axis=1, keepdims=True)
    variance = 0.025**2 * np.abs(clean.values) ** 2 + 0.05**2 * rms
    found = identify(replace(noisy, variance=variance))
    assert_papers_modes(found, 6e-3, 0.04, 0.998)
    assert np.array_equal(found.noise_variance, variance)
    assert found.noise_ratio == pytest.approx(1, abs=0.03)  # 30,000 values: ± 0.008
    optimistic = identify(replace(noisy, variance=variance / 25))
    assert any("5.0 times the noise" in w or "scatter more" in w for w in optimistic.warnings)
    assert len(optimistic.modes) == 5
    assert np.allclose(optimistic.modes.damping_sd, found.modes.damping_sd, rtol=0.2)


def test_stabilisation_data_show_the_true_poles(seeds: list[Identification]) -> None:
    diagram = seeds[0].stabilisation
    assert diagram.line_hz.size == diagram.indicator.size == LINES
    assert diagram.cmif.shape == (1, LINES)  # one reference
    assert np.allclose(diagram.cmif[0], diagram.indicator)
    for hz in PAPER_HZ[1:]:
        near = np.abs(diagram.frequency_hz / hz - 1) < 0.005
        assert np.sum(near & diagram.damping_stable) > 5


def test_two_curves_of_the_cmif_peak_where_two_modes_are_close() -> None:
    """Two modes a third of a bandwidth apart are one peak of each FRF and two singular values, the
    single mode one.
    """
    frfs, _ = plate_frfs(0.006, 0, 5)
    diagram = identify(frfs).stabilisation
    first, second = diagram.cmif
    assert np.allclose(first**2 + second**2, diagram.indicator**2)
    close, single = (int(np.argmin(np.abs(diagram.line_hz - hz))) for hz in (301.0, 700.0))
    assert second[close] > 10 * np.median(second)
    assert second[single] < 3 * np.median(second)


# --- close and double modes, rigid bodies
# ---------------------------------------------------------------------------


def plate_frfs(separation: float, *references: int) -> tuple[FrfSet, np.ndarray]:
    """Two modes around 300 Hz (ζ = 1 %, half-power bandwidth 6 Hz) and one at 700 Hz, at 12
    points.
    """
    rng = np.random.default_rng(12)
    shapes = rng.standard_normal((3, 12))
    hz = np.array([300.0, 300.0 * (1 + separation), 700.0])
    frequency = np.arange(100.0, 901.0)
    omega = 2 * np.pi * frequency
    values = np.concatenate(
        [
            -(omega**2) * receptance(omega, hz, np.full(3, 0.01), shapes, shapes[:, j])
            for j in references
        ]
    )
    values = add_noise(values, 0.01, 0.5, rng)
    responses = tuple(Dof(i + 1, 3) for _ in references for i in range(12))
    return (
        FrfSet(
            frequency,
            values,
            responses,
            tuple(Dof(j + 1, 3) for j in references for _ in range(12)),
        ),
        shapes,
    )


def test_two_modes_within_a_bandwidth_are_kept_as_two_by_one_reference() -> None:
    frfs, shapes = plate_frfs(0.005, 5)  # 1.5 Hz apart, a quarter of the half-power bandwidth
    found = identify(frfs)
    assert np.allclose(found.modes.frequency_hz, [300.0, 301.5, 700.0], atol=0.2)
    assert np.allclose(found.modes.damping_ratio, 0.01, rtol=0.1)
    assert np.all(np.diag(mac(found.modes.shapes, shapes)) > 0.98)
    assert any("close pair" in w for w in found.warnings)


def test_a_double_mode_at_one_frequency_is_parted_by_the_references() -> None:
    found = identify(plate_frfs(0.0, 0, 5, 7)[0])
    assert found.modes.frequency_hz == pytest.approx([300.0, 300.0, 700.0], rel=2e-4)
    assert any("parted by the references" in w for w in found.warnings)
    apart = identify(plate_frfs(0.1, 0, 5, 7)[0])
    assert len(apart.modes) == 3
    assert not any("parted by" in w or "rank two" in w for w in apart.warnings)


def test_rigid_body_motion_does_not_leak_into_the_first_mode() -> None:
    frequency = np.arange(1.0, 801.0)
    omega = 2 * np.pi * frequency
    x = np.linspace(-0.5, 0.5, 11)
    shapes = np.array([np.cos(4.73 * x), np.sin(7.85 * x)])
    hz, zeta = np.array([160.0, 450.0]), np.array([0.02, 0.02])
    elastic = receptance(omega, hz, zeta, shapes, shapes[:, -1]) / 0.4
    s = 1j * omega
    # mass-proportional damping of 27 /s
    rigid = (1 + 12 * x * x[-1])[:, None] / 0.4 / (s * (s + 27.0))
    values = add_noise(-(omega**2) * (elastic + rigid), 0.01, 0.5, np.random.default_rng(3))
    dofs = tuple(Dof(i + 1, 3) for i in range(11))
    found = identify(FrfSet(frequency, values, dofs, (dofs[-1],) * 11))
    assert np.allclose(found.modes.frequency_hz, hz, rtol=1e-4)
    assert np.allclose(found.modes.damping_ratio, zeta, rtol=0.01)


@pytest.mark.parametrize("seed", [5069, 12002, 12008, 15002, 15006])
def test_noise_that_rises_towards_0_hz_and_hum_hold_no_mode(seed: int) -> None:
    """At 12002 and 15006 hum stands in one line of all FRFs; at 12008 no pole may be a mode after a
    refusal; at 15002 one FRF rises as 1/f².
    """
    with pytest.raises(IdentificationError, match="no mode"):
        identify(KINDS["quiet"](seed, Harsh.drawn(seed) if seed % 2 else GOOD).frfs)


@pytest.mark.parametrize("rows", [1, 5])
def test_a_line_of_interference_is_no_mode_however_high(rows: int) -> None:
    rng = np.random.default_rng(rows)
    values = rng.standard_normal((rows, 400)) + 1j * rng.standard_normal((rows, 400))
    values[:, 150] += 30 * rng.standard_normal(rows)
    dofs = tuple(Dof(i + 1, 3) for i in range(rows))
    with pytest.raises(IdentificationError, match="no mode"):
        identify(FrfSet(np.arange(1.0, 401.0), values, dofs, dofs[:1] * rows))


def test_a_limit_on_the_modes_that_stopped_the_search_is_named() -> None:
    found = identify(paper_frfs(0.05, 0, LINES), Options(most_modes=2))
    assert "the search stopped at most_modes; raise it, or leave it out" in found.warnings


@pytest.mark.parametrize(
    ("a0", "a1", "highest_hz", "noise"), [(30.0, 1e-5, 1000, 0.0), long(60.0, 2e-5, 1600, 1e-4)]
)
def test_nearly_no_noise_is_no_harm(
    a0: float, a1: float, highest_hz: int, noise: float, monkeypatch
) -> None:
    """A simulated free body: at a hundred decibels its many residual terms must still be
    distinguished.
    """
    monkeypatch.setattr(synthesis, "NOISE", noise)
    beam = free_beam(FREE_UPDATED)
    x, y, _ = synthesis.grid(beam)[synthesis.SENSOR]
    beam = replace(beam, masses=(PointMass(x, y, 0.0048),))
    frfs = synthesis.rayleigh_body(
        beam, np.array([a0, a1]), 1, np.arange(2.0, highest_hz + 0.5, 2.0)
    )
    found = identify(frfs.select([i for i in range(33) if i % 8 != 4])).modes
    true = synthesis.solve(beam).frequency_hz
    true = true[true < highest_hz]
    assert len(found) == len(true)
    np.testing.assert_allclose(found.frequency_hz, true, rtol=2e-5)
    np.testing.assert_allclose(
        found.damping_ratio, a0 / (4 * np.pi * true) + a1 * np.pi * true, rtol=1e-3
    )


# --- data that others made
# -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "damping"),
    [("paper-like", 0.02), long("free-1pct", 0.02), ("cantilever-5pct-sensor-mass", 0.05)],
)
def test_independent_data(name: str, damping: float) -> None:
    path = shared_file("BLIND_OPEN", "blind-open", f"{name}.uff")
    truth = json.loads(path.with_suffix("").with_suffix(".truth.json").read_text())
    known = [m for m in truth["modes"] if m["out_of_plane"] and 0 < m["f_hz"] < 1000]
    identified = identify(read_uff(path)).found
    # a mode of 15 % of the FRFs in 5 % noise is uncertain by a little
    assert np.all(identified.probability > 0.75)
    found = identified.modes
    inside = found.frequency_hz < 1000
    assert np.allclose(found.frequency_hz[inside], [m["f_hz"] for m in known], rtol=1e-3)
    assert np.allclose(found.damping_ratio[inside], [m["zeta"] for m in known], rtol=damping)


def test_measured_free_beam_of_the_corpus() -> None:
    path = shared_file("UFF_CORPUS", "uff-corpus", "pyuff/measurement_v1.uff")
    found = identify(read_uff(path))
    for hz in BENDING_HZ:
        assert np.sum(np.abs(found.modes.frequency_hz - hz) < 0.15) == 1
    others = np.min(np.abs(found.found.modes.frequency_hz[:, None] - BENDING_HZ), axis=1) > 0.2
    for k in np.flatnonzero(others):  # what else is reported is doubtful or called weak
        name = f"({found.found.modes.frequency_hz[k]:.2f} Hz): weak"
        assert found.found.doubt[k] is not None or any(name in w for w in found.warnings)
    assert any("0 Hz" in w for w in found.warnings)
    assert any("finer line spacing" in w for w in found.warnings)


@pytest.mark.parametrize("drift", [long(0.0), 1e-3])
def test_a_wide_band_has_its_modes_down_to_its_lowest_hundredth(drift: float) -> None:
    rng, hz = np.random.default_rng(4), 0.25 * np.arange(1, 5001)
    f = np.array([10, 14, 22, 41, 60, 98, 150, 230, 340, 351, 470, 600, 760, 980, 1170.0])
    zeta, residues = rng.uniform(0.005, 0.015, f.size), rng.standard_normal((6, f.size))
    d = drift * rng.standard_normal(6)
    w, s = 2 * np.pi * f * (1 + d - d.mean())[:, None], 2j * np.pi * hz[:, None, None]
    values = (residues * s**2 / (s**2 + 2 * zeta * w * s + w**2)).sum(axis=2).T
    points = tuple(Dof(point, 3) for point in range(1, 7))
    frfs = FrfSet(hz, add_noise(values, 0.01, 0.0, rng), points, points[:1] * 6)
    found = identify(frfs)
    modes = found.modes
    assert len(modes) == f.size
    off = (modes.frequency_hz - f) / modes.frequency_sd_hz
    of_zeta = (modes.damping_ratio - zeta) / modes.damping_sd
    assert np.abs(np.append(off, of_zeta)).max() < 4.5  # of 30 standard normal values
    assert np.all(np.abs(modes.damping_ratio / zeta - 1) < 0.2)  # half a line wide, the lowest
    assert np.isclose(found.drift, d.std(), rtol=0.2)


@pytest.mark.long
def test_measured_ruler_to_2_khz() -> None:
    """In short a wide band of made modes and the measured free beam above."""
    shared_file("MEASURED", "measured", "ruler.mat")
    found = identify(SETS["ruler to 2 kHz"]())
    modes, seen = found.modes, found.found.modes.frequency_hz
    # as octaves that were identified alone have them
    for hz, percent in (
        (39.38, 0.70),
        (108.57, 0.84),
        (212.5, 1.19),
        (352.3, 0.66),
        (517.3, 1.35),
        (728.8, 1.28),
        (967, 2.0),
    ):
        k = int(np.argmin(np.abs(modes.frequency_hz - hz)))
        assert abs(modes.frequency_hz[k] / hz - 1) < 4e-3
        assert abs(100 * modes.damping_ratio[k] / percent - 1) < 0.2
    assert np.all(np.abs(seen[:, None] / [269.8, 551.3] - 1).min(axis=0) < 2e-3)
