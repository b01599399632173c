"""The shell element against closed forms, published solutions and a three-dimensional body."""

import numpy as np
import pytest

from fecore.body.kinds import mode_kinds
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import section
from fecore.body.supports import edges, of_boundary
from tests.support.plates import PAPER, integrated, navier_hz, paper_section, plate, solve

HELD = edges("simply_supported", "simply_supported", "simply_supported", "simply_supported")
ISOTROPIC = OrthotropicMaterial(70e9, 70e9, 70e9 / 2.6, 70e9 / 2.6, 70e9 / 2.6, 0.3, 2700.0)
GRAPHITE = OrthotropicMaterial(175e9, 7e9, 3.5e9, 3.5e9, 1.4e9, 0.25, 1600.0)


def noor(ratio: float) -> OrthotropicMaterial:
    return OrthotropicMaterial(ratio * 1e9, 1e9, 0.6e9, 0.6e9, 0.5e9, 0.25, 1.0)


@pytest.mark.parametrize(
    ("boundary", "length", "material", "reference"),
    [
        ("cantilever", 0.5, PAPER, [25.941, 161.956, 403.350, 450.777, 875.805, 1215.70, 1432.13]),
        (
            "free",
            0.501,
            OrthotropicMaterial(31.85e9, 30.86e9, 6.31e9, 4.77e9, 5.56e9, 0.15, 2012.0),
            [164.489, 450.973, 785.237, 876.966, 1434.20],
        ),
    ],
)
def test_three_dimensional_body(boundary, length, material, reference) -> None:
    body = plate((length, 0.04), (40, 4), of_boundary(boundary))
    rigid = body.model.rigid_modes.shape[1]
    modes = solve(body, section([Ply(material, 0.01012)]), len(reference) + rigid)
    # 0.1 %: the difference between first-order plate theory and a converged solid of this
    # slenderness.
    np.testing.assert_allclose(modes.frequency_hz[rigid:], reference, rtol=1e-3)


@pytest.mark.parametrize(
    ("material", "thickness"), [(ISOTROPIC, 0.004), (ISOTROPIC, 0.03), (GRAPHITE, 0.02)]
)
def test_simply_supported_plate_has_naviers_six_modes(material, thickness) -> None:
    laminate = section([Ply(material, thickness)])
    modes = solve(plate((0.4, 0.3), (20, 16), HELD), laminate, 6)
    # The mesh's own error at the sixth mode, (h/L)⁴ of a half wave of five elements.
    np.testing.assert_allclose(modes.frequency_hz, navier_hz(laminate, 0.4, 0.3, 6), rtol=2e-4)


def test_frequencies_converge_with_the_fourth_power_of_the_element_size() -> None:
    laminate = section([Ply(ISOTROPIC, 0.03)])
    exact = navier_hz(laminate, 0.4, 0.3, 4)
    sizes = np.array([4, 6, 8, 12])
    errors = [
        np.abs(solve(plate((0.4, 0.3), (n, n), HELD), laminate, 4).frequency_hz / exact - 1)
        for n in sizes
    ]
    slope = -np.polyfit(np.log(sizes), np.log(np.array(errors)), 1)[0]
    # Quadratic shape functions: eigenvalues of order 2p = 4.
    assert np.all(slope > 3.7), slope


@pytest.mark.parametrize(
    ("ratio", "published"), [(10, 8.2982), (20, 9.5671), (30, 10.326), (40, 10.854)]
)
def test_symmetric_cross_ply_against_published_first_order_solution(ratio, published) -> None:
    """[0/90/90/0], a/h = 5: Khdeir and Librescu, Composite Structures 9 (1988), first-order theory,
    κ = 5/6.
    """
    laminate = integrated([Ply(noor(ratio), 0.05, angle) for angle in (0, 90, 90, 0)], 5 / 6)
    found = solve(plate((1, 1), (12, 12), HELD), laminate, 1).omega[0] / 0.2 * np.sqrt(1 / 1e9)
    # They print five digits.
    assert found == pytest.approx(published, rel=1e-4)


def test_antisymmetric_cross_ply_couples_membrane_and_bending() -> None:
    laminate = section([Ply(GRAPHITE, 0.01, angle) for angle in (0, 90)])
    assert laminate.is_coupled
    body = plate((0.4, 0.3), (20, 16), HELD, membrane=True)
    modes = solve(body, laminate, 12)
    bending = modes.frequency_hz[np.array(mode_kinds(body.model, modes.shapes)) != "in-plane"]
    np.testing.assert_allclose(bending[:6], navier_hz(laminate, 0.4, 0.3, 6), rtol=2e-4)


def test_in_plane_modes_of_a_free_bar_are_labelled() -> None:
    # A slender bar: axial waves f = n/2L √(E/ρ), Poisson's inertia lowers the first by less than
    # 0.1 %.
    body = plate((0.5, 0.01), (40, 2), (), membrane=True)
    modes = solve(body, paper_section(), 24)
    kinds = np.array(mode_kinds(body.model, modes.shapes[:, 6:]))
    axial = np.sqrt(PAPER.Ex / PAPER.density) / (2 * 0.5)
    flat = modes.frequency_hz[6:][kinds == "in-plane"]
    assert np.min(np.abs(flat / axial - 1)) < 1e-3
    assert {"bending", "torsion", "in-plane"} == set(kinds)


@pytest.mark.parametrize(
    ("plies", "ratio", "published"),
    [(2, 10, 13.044), (8, 10, 19.289), (2, 20, 14.179), (8, 5, 12.892)],
)
def test_antisymmetric_angle_ply_against_published_first_order_solution(
    plies, ratio, published
) -> None:
    """[45/-45]_n square plate, E1/E2 = 40, edges held across and free along (SS-2): ω a²/h √(ρ/E2)
    by first-order theory, Reddy and Phan, J. Sound Vib. 98, 1985, Table 4.
    """
    held = edges(*["simply_supported_normal"] * 4)
    body = plate((1.0, 1.0), (12, 12), held, membrane=True)
    laminate = integrated(
        [Ply(noor(40.0), 1 / ratio / plies, 45.0 * (-1) ** k) for k in range(plies)], 5 / 6
    )
    assert laminate.is_coupled
    omega = 2 * np.pi * solve(body, laminate, 1).frequency_hz[0]
    # 0.05 %: the table has four to five digits.
    assert omega * ratio * np.sqrt(1e-9) == pytest.approx(published, rel=5e-4)
