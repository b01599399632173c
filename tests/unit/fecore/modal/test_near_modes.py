"""Two modes under one pole: parted by several references, and one mode left as one."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.made_frfs import KINDS
from fecore.correlation import mac
from fecore.frf import Dof, FrfSet
from fecore.modal import identify
from fecore.modal.arrangement import arrange
from fecore.modal.shapes import of_rank_two
from tests.support.beams import add_noise
from tests.support.lengths import long

LINE = 1 / 32  # Hz
POINTS = 20
# how the two references see four modes
PSI = np.array([[1.0, -0.8], [0.9, 0.7], [0.6, -1.1], [-0.7, 0.8]])


def frfs(
    gap_lines: float, references: int = 2, seed: int = 3
) -> tuple[FrfSet, np.ndarray, np.ndarray, np.ndarray]:
    """FRFs of four modes, two of them `gap_lines` apart, with 2 % of error in each FRF;
    frequencies, damping and shapes.
    """
    rng = np.random.default_rng(seed)
    hz = np.arange(1.0, 6.0, LINE)
    f = np.array([2.0, 3.0, 3.0 + gap_lines * LINE, 4.2])
    zeta = np.array([0.01, 0.009, 0.011, 0.01])
    phi = rng.standard_normal((4, POINTS))
    s, w = 2j * np.pi * hz, 2 * np.pi * f[:, None]
    resonance = s**2 / (s**2 + 2 * zeta[:, None] * w * s + w**2)
    values = np.einsum("qp,qm,ql->pml", phi, PSI[:, :references], resonance).reshape(
        POINTS * references, -1
    )
    # calibration and hits, alike on all lines
    values = values * (1 + 0.02 * rng.standard_normal((len(values), 1)))
    white = rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    values = values + 0.01 * np.sqrt(np.mean(np.abs(values) ** 2)) * white
    pairs = [(Dof(100 + j, 3), Dof(1 + p, 3)) for p in range(POINTS) for j in range(references)]
    return FrfSet(hz, values, tuple(a for a, _ in pairs), tuple(b for _, b in pairs)), f, zeta, phi


@pytest.mark.parametrize(("gap", "likeness"), [(1 / 6, 0.995), long(1 / 3, 0.96)])
def test_two_references_part_modes_a_fraction_of_a_line_apart(gap: float, likeness: float) -> None:
    """At a sixth the references part them; at a third the series has both poles, and its shapes mix
    a little more.
    """
    data, f, zeta, phi = frfs(gap)
    identified = identify(data)
    found = identified.modes
    assert len(found) == 4
    sd_f, sd_zeta = found.frequency_sd_hz, found.damping_sd
    assert sd_f is not None
    assert sd_zeta is not None
    assert found.shapes is not None
    assert np.all(np.abs(found.frequency_hz - f) < np.minimum(4 * sd_f, 0.05 * LINE))
    assert np.all(np.abs(found.damping_ratio - zeta) < np.minimum(4 * sd_zeta, 0.05 * zeta))
    assert np.all(np.diag(mac(found.shapes, phi.astype(complex))) > likeness)
    # the series holds both: what it predicts is the measured FRFs but for their errors of 2 %
    used = np.isfinite(identified.measured)
    off = np.linalg.norm((identified.predicted - identified.measured)[used])
    assert off < 0.04 * np.linalg.norm(identified.measured[used])
    assert identified.terms.pairs >= 4


def test_a_repeated_frequency_has_two_shapes_that_span_its_plane() -> None:
    data, f, _, phi = frfs(0.0)
    found = identify(data).modes
    assert len(found) == 4
    assert found.shapes is not None
    assert found.frequency_hz[1:3] == pytest.approx(f[1:3], rel=2e-4)
    plane = np.linalg.qr(found.shapes[1:3].real.T)[0]
    for true in phi[1:3]:
        assert np.linalg.norm(plane.T @ true) / np.linalg.norm(true) > 0.99


def test_one_mode_is_left_as_one() -> None:
    arrangement = arrange(frfs(1 / 6)[0])
    rng = np.random.default_rng(1)
    one = np.outer(rng.standard_normal(POINTS), [1.0, -0.8]).ravel()[:, None] * (
        1 + 0.03 * rng.standard_normal((2 * POINTS, 1))
    )
    other = np.outer(rng.standard_normal(POINTS), [0.8, 1.0]).ravel()[:, None]
    spread = np.full((2 * POINTS, 1), 1e-4)
    # errors of 3 % in each FRF are no second shape
    assert not of_rank_two(arrangement, one.astype(complex), spread)[0]
    assert of_rank_two(arrangement, (one + 0.5 * other).astype(complex), spread)[0]


def test_a_table_with_a_gap_and_a_pair_twice_has_no_second_shape() -> None:
    """Four FRFs of 2 x 2 dofs: repeats that contradict one another leave others beside them, and no
    FRF of the last pair.
    """
    pairs = [(1, 11), (1, 12), (2, 11), (2, 11)]
    responses, references = (tuple(Dof(pair[side], 3) for pair in pairs) for side in (0, 1))
    arrangement = arrange(
        FrfSet(np.arange(1.0, 30.0), np.ones((4, 29), dtype=complex), responses, references)
    )
    residues = np.array([[1.0], [2.0], [-2.0], [1.0]], dtype=complex)
    assert not of_rank_two(arrangement, residues, np.full((4, 1), 1e-6))[0]


TOUR_HZ = np.array([95.0, 160.0, 240.0, 330.0])


def tour(f: np.ndarray, drift: np.ndarray) -> FrfSet:
    """FRFs of as many hits as drifts, each with all frequencies a share higher, 1 % noise."""
    rng = np.random.default_rng(4)
    hz = np.arange(50.0, 400.0)
    s, w = 2j * np.pi * hz, 2 * np.pi * f[:, None, None] * (1 + drift[:, None])
    resonance = s**2 / (s**2 + 0.008 * w * s + w**2)
    values = np.einsum("qp,qpl->pl", rng.standard_normal((f.size, drift.size)), resonance)
    white = rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    values = values + 0.007 * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True)) * white
    dofs = tuple(Dof(i + 1, 3) for i in range(drift.size))
    return FrfSet(hz, values, (Dof(99, 3),) * drift.size, dofs, "accelerance")


@pytest.mark.parametrize("course", [np.repeat([-0.5, 0.5], 6), long(np.linspace(-0.5, 0.5, 12))])
def test_a_tour_in_which_the_structure_drifts_beyond_a_bandwidth_has_each_mode_once(
    course: np.ndarray,
) -> None:
    """A modulus that changes by 2 %, at once or slowly: 1 % of every frequency, where a half
    bandwidth is 0.4 %.
    """
    found = identify(tour(TOUR_HZ, 0.01 * course))
    assert found.modes.frequency_hz == pytest.approx(TOUR_HZ, rel=5e-4)
    # half a line wide
    assert found.modes.damping_ratio == pytest.approx(np.full(4, 0.004), rel=0.05)
    assert found.drift == pytest.approx(0.01 * np.std(course), rel=0.1)
    assert any("drift together" in w for w in found.warnings)


def test_modes_that_all_come_in_pairs_are_no_drift() -> None:
    """A symmetric structure: every mode twice, 1.1 to 1.5 % apart."""
    pairs = np.sort(np.concatenate([TOUR_HZ, TOUR_HZ * np.array([1.012, 1.015, 1.011, 1.013])]))
    found = identify(tour(pairs, np.zeros(12)))
    assert found.modes.frequency_hz == pytest.approx(pairs, rel=5e-4)
    assert not any("drift together" in w for w in found.warnings)


def test_a_small_mode_in_the_flank_of_another_stays_as_uncertain() -> None:
    """A fifth as large and 0.4 half bandwidths of both beside it: rather no mode, by features; but it
    bends the curve of the larger by many standard deviations, and left in silence.
    """
    rng, hz = np.random.default_rng(0), np.arange(0.5, 400.1, 0.5)
    true, zeta = np.array([100.0, 214.0, 215.0, 300.0]), np.array([0.006, 0.0033, 0.0087, 0.005])
    residue = rng.standard_normal((4, 12)) * np.array([[1.0], [1.0], [0.2], [1.0]])
    w, s = 2 * np.pi * true[:, None], 2j * np.pi * hz
    values = residue.T @ (s**2 / (s**2 + 2 * zeta[:, None] * w * s + w**2))
    dofs = tuple(Dof(i + 1, 3) for i in range(12))
    frfs = FrfSet(hz, add_noise(values, 0.01, 0.0, rng), dofs, (Dof(1, 3),) * 12)
    modes = identify(frfs).found.modes
    np.testing.assert_allclose(modes.frequency_hz, true, rtol=1e-4)
    assert np.all(np.abs(modes.damping_ratio - zeta) < 3 * modes.damping_sd)
    assert 0.1 < modes.probability[2] < 0.9 < np.delete(modes.probability, 2).min()


def test_the_wrong_sign_of_one_frf_is_no_second_shape_and_is_named() -> None:
    frfs = KINDS["aeroplane"](3).frfs.band(60, 120)
    values = frfs.values.copy()
    values[7] *= -1
    whole, wrong = (identify(each) for each in (frfs, replace(frfs, values=values)))
    np.testing.assert_allclose(wrong.modes.frequency_hz, whole.modes.frequency_hz, rtol=1e-4)
    named = [
        [n.subject for n in each.notes if n.kind == "opposite_sign"] for each in (whole, wrong)
    ]
    ends = frfs.responses[7].point, frfs.references[7].point
    assert not named[0]
    assert "{}Z/{}Z".format(*ends) in named[1]
