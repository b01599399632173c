"""The shell element against patches, closed forms, published solutions and a three-dimensional body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.elements.shell8 import Shell8, gauss, shape_function_derivatives, shape_functions
from fecore.body.laminate import OrthotropicMaterial, Ply, section
from fecore.body.mesh import RectangleMesh, rectangle
from fecore.body.model import plate
from fecore.body.supports import Supports
from tests.support.plates import PAPER, navier_hz, paper_section, solve


def with_corners(mesh: RectangleMesh, move) -> RectangleMesh:
    """The mesh with its corner nodes moved by a function of (x, y), mid-sides kept half-way."""
    nodes = np.array(move(mesh.nodes.T)).T
    for element in mesh.elements:
        for side, (a, b) in enumerate(((0, 1), (1, 2), (2, 3), (3, 0))):
            nodes[element[4 + side]] = (nodes[element[a]] + nodes[element[b]]) / 2
    return replace(mesh, nodes=nodes)


def distorted() -> RectangleMesh:
    mesh = rectangle(1.0, 0.8, 3, 3)
    shift = np.random.default_rng(3).uniform(-0.06, 0.06, mesh.nodes.shape)
    inside = (np.abs(mesh.nodes[:, 1]) < 0.39) & (mesh.nodes[:, 0] > 0.01) & (mesh.nodes[:, 0] < 0.99)
    return with_corners(mesh, lambda xy: xy + (shift * inside[:, None]).T)


def sheared() -> RectangleMesh:
    return with_corners(rectangle(1.0, 0.8, 3, 3), lambda xy: (xy[0] + 0.3 * xy[1], xy[1] + 0.1 * xy[0]))


def interior(mesh: RectangleMesh) -> np.ndarray:
    """Nodes that lie on no outer edge of the undistorted grid."""
    grid = rectangle(mesh.length, mesh.width, mesh.nx, mesh.ny).nodes
    inside = (np.abs(grid[:, 1]) < 0.999 * mesh.width / 2) & (grid[:, 0] > 1e-9) & (grid[:, 0] < mesh.length * 0.999)
    return np.flatnonzero(inside)


def test_shape_functions_interpolate_and_their_derivatives_are_exact() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (20, 2))
    np.testing.assert_allclose(shape_functions(points).sum(axis=1), 1, rtol=1e-14)
    step = 1e-6
    for axis in range(2):
        move = step * np.eye(2)[axis]
        difference = (shape_functions(points + move) - shape_functions(points - move)) / (2 * step)
        np.testing.assert_allclose(shape_function_derivatives(points)[:, axis], difference, atol=1e-9)


def test_constant_membrane_strain_leaves_no_force_inside_a_distorted_patch() -> None:
    mesh = distorted()
    laminate = section([Ply(OrthotropicMaterial(30e9, 10e9, 4e9, 3e9, 2e9, 0.2, 1.0), 0.01, 25)])
    model = plate(mesh, Supports(), membrane=True)
    K = model.stiffness.at(model.stiffness_coefficients(laminate))
    x, y = mesh.nodes.T
    field = np.zeros((len(x), 5))
    field[:, 0], field[:, 1] = 2e-3 * x - 1e-3 * y, 4e-3 * x + 3e-3 * y
    force = (K @ field.ravel()).reshape(-1, 5)
    # Round-off of the forces that cancel.
    assert np.abs(force[interior(mesh)]).max() < 1e-12 * np.abs(force).max()


def test_constant_curvature_leaves_no_force_inside_a_patch_of_parallelograms() -> None:
    # An 8-node element holds all quadratics, which w is here, only where its sides are parallel.
    mesh = sheared()
    laminate = section([Ply(OrthotropicMaterial(30e9, 10e9, 4e9, 3e9, 2e9, 0.2, 1.0), 0.01, 25)])
    model = plate(mesh, Supports())
    K = model.stiffness.at(model.stiffness_coefficients(laminate))
    x, y = mesh.nodes.T
    field = np.column_stack([-(2 * x**2 + 3 * y**2 + x * y) / 2, -(6 * y + x) / 2, (4 * x + y) / 2])
    force = (K @ field.ravel()).reshape(-1, 3)
    assert np.abs(force[interior(mesh)]).max() < 1e-10 * np.abs(force).max()


@pytest.mark.parametrize("membrane", [False, True])
def test_rigid_motions_store_no_energy_and_nothing_else_is_soft(membrane) -> None:
    mesh = distorted()
    model = plate(mesh, Supports(), membrane=membrane)
    K = model.stiffness.at(model.stiffness_coefficients(paper_section())).toarray()
    scale = np.abs(K).max()
    energy = np.einsum("di,de,ei->i", model.rigid_modes, K, model.rigid_modes)
    assert np.all(np.abs(energy) < 1e-11 * scale * np.sum(model.rigid_modes**2, axis=0))
    D = 1 / np.sqrt(np.diag(K))
    soft = np.linalg.eigvalsh(D[:, None] * K * D)
    # Exactly the rigid motions: no spurious zero-energy mode survives assembly.
    count = 6 if membrane else 3
    assert np.sum(soft < 1e-10) == count == model.rigid_modes.shape[1]


def test_terms_add_up_to_the_stiffness_of_any_laminate() -> None:
    element, mesh = Shell8(membrane=True), distorted()
    laminate = section(
        [Ply(OrthotropicMaterial(30e9, 10e9, 4e9, 3e9, 2e9, 0.2, 1.0), t, a) for t, a in ((1e-3, 30), (2e-3, -50))]
    )
    coordinates = mesh.nodes[mesh.elements]
    natural, weights = gauss(2)
    B, determinant = element.strain_matrix(coordinates, natural)
    C = np.zeros((8, 8))
    C[:3, :3], C[:3, 3:6], C[3:6, :3], C[3:6, 3:6], C[6:, 6:] = (
        laminate.A,
        laminate.B,
        laminate.B,
        laminate.D,
        laminate.S,
    )
    whole = np.einsum("ep,epsi,st,eptj->eij", determinant * weights, B, C, B, optimize=True)
    values = laminate.coefficients()
    c = np.array([values[name] for name in element.terms])
    np.testing.assert_allclose(
        np.tensordot(c, element.stiffness_terms(coordinates), 1), whole, atol=1e-13 * np.abs(whole).max()
    )


HELD = Supports("simply_supported", "simply_supported", "simply_supported", "simply_supported")
ISOTROPIC = OrthotropicMaterial(70e9, 70e9, 70e9 / 2.6, 70e9 / 2.6, 70e9 / 2.6, 0.3, 2700.0)
GRAPHITE = OrthotropicMaterial(175e9, 7e9, 3.5e9, 3.5e9, 1.4e9, 0.25, 1600.0)


def noor(ratio: float) -> OrthotropicMaterial:
    return OrthotropicMaterial(ratio * 1e9, 1e9, 0.6e9, 0.6e9, 0.5e9, 0.25, 1.0)


def test_paper_table_3_updated() -> None:
    model = plate(rectangle(0.5, 0.04, 40, 4), Supports.of("cantilever"))
    modes = solve(model, paper_section(), 5)
    paper = np.array([25.63, 160.06, 399.28, 445.54, 865.86])
    # 0.05 %: what issue and paper ask; the paper prints four digits and its mesh is not known.
    np.testing.assert_allclose(modes.frequency_hz, paper, rtol=5e-4)
    assert model.kinds(modes.shapes) == ("bending", "bending", "torsion", "bending", "bending")


@pytest.mark.parametrize(
    ("boundary", "length", "material", "reference"),
    [
        (
            "cantilever",
            0.5,
            PAPER,
            [25.941, 161.956, 403.350, 450.777, 875.805, 1215.70, 1432.13],
        ),
        (
            "free",
            0.501,
            OrthotropicMaterial(31.85e9, 30.86e9, 6.31e9, 4.77e9, 5.56e9, 0.15, 2012.0),
            [164.489, 450.973, 785.237, 876.966, 1434.20],
        ),
    ],
)
def test_three_dimensional_body(boundary, length, material, reference) -> None:
    model = plate(rectangle(length, 0.04, 40, 4), Supports.of(boundary))
    rigid = model.rigid_modes.shape[1]
    modes = solve(model, section([Ply(material, 0.01012)]), len(reference) + rigid)
    # 0.1 %: the difference between first-order plate theory and a converged solid of this slenderness.
    np.testing.assert_allclose(modes.frequency_hz[rigid:], reference, rtol=1e-3)


@pytest.mark.parametrize(("material", "thickness"), [(ISOTROPIC, 0.004), (ISOTROPIC, 0.03), (GRAPHITE, 0.02)])
def test_simply_supported_plate_has_naviers_six_modes(material, thickness) -> None:
    laminate = section([Ply(material, thickness)])
    modes = solve(plate(rectangle(0.4, 0.3, 20, 16), HELD), laminate, 6)
    # The mesh's own error at the sixth mode, (h/L)⁴ of a half wave of five elements.
    np.testing.assert_allclose(modes.frequency_hz, navier_hz(laminate, 0.4, 0.3, 6), rtol=2e-4)


def test_frequencies_converge_with_the_fourth_power_of_the_element_size() -> None:
    laminate = section([Ply(ISOTROPIC, 0.03)])
    exact = navier_hz(laminate, 0.4, 0.3, 4)
    sizes = np.array([4, 6, 8, 12])
    errors = [
        np.abs(solve(plate(rectangle(0.4, 0.3, n, n), HELD), laminate, 4).frequency_hz / exact - 1) for n in sizes
    ]
    slope = -np.polyfit(np.log(sizes), np.log(np.array(errors)), 1)[0]
    # Quadratic shape functions: eigenvalues of order 2p = 4.
    assert np.all(slope > 3.7), slope


@pytest.mark.parametrize(("ratio", "published"), [(10, 8.2982), (20, 9.5671), (30, 10.326), (40, 10.854)])
def test_symmetric_cross_ply_against_published_first_order_solution(ratio, published) -> None:
    """[0/90/90/0], a/h = 5: Khdeir and Librescu, Composite Structures 9 (1988), first-order theory, κ = 5/6."""
    laminate = section([Ply(noor(ratio), 0.05, angle) for angle in (0, 90, 90, 0)])
    found = solve(plate(rectangle(1, 1, 12, 12), HELD), laminate, 1).omega[0] / 0.2 * np.sqrt(1 / 1e9)
    # They print five digits.
    assert found == pytest.approx(published, rel=1e-4)


def test_antisymmetric_cross_ply_couples_membrane_and_bending() -> None:
    laminate = section([Ply(GRAPHITE, 0.01, angle) for angle in (0, 90)])
    assert laminate.is_coupled
    model = plate(rectangle(0.4, 0.3, 20, 16), HELD, membrane=True)
    modes = solve(model, laminate, 12)
    bending = modes.frequency_hz[np.array(model.kinds(modes.shapes)) != "in-plane"]
    np.testing.assert_allclose(bending[:6], navier_hz(laminate, 0.4, 0.3, 6), rtol=2e-4)


def test_in_plane_modes_of_a_free_bar_are_labelled() -> None:
    # A slender bar: axial waves f = n/2L √(E/ρ), Poisson's inertia lowers the first by less than 0.1 %.
    model = plate(rectangle(0.5, 0.01, 40, 2), Supports(), membrane=True)
    modes = solve(model, paper_section(), 24)
    kinds = np.array(model.kinds(modes.shapes[:, 6:]))
    axial = np.sqrt(PAPER.Ex / PAPER.density) / (2 * 0.5)
    flat = modes.frequency_hz[6:][kinds == "in-plane"]
    assert np.min(np.abs(flat / axial - 1)) < 1e-3
    assert {"bending", "torsion", "in-plane"} == set(kinds)


@pytest.mark.parametrize(
    ("plies", "ratio", "published"), [(2, 10, 13.044), (8, 10, 19.289), (2, 20, 14.179), (8, 5, 12.892)]
)
def test_antisymmetric_angle_ply_against_published_first_order_solution(plies, ratio, published) -> None:
    """[45/-45]_n square plate, E1/E2 = 40, edges held across and free along (SS-2): ω a²/h √(ρ/E2) by first-order theory,
    Reddy and Phan, J. Sound Vib. 98, 1985, Table 4.
    """
    held = Supports(*["simply_supported_normal"] * 4)
    model = plate(rectangle(1.0, 1.0, 12, 12), held, membrane=True)
    laminate = section([Ply(noor(40.0), 1 / ratio / plies, 45.0 * (-1) ** k) for k in range(plies)])
    assert laminate.is_coupled
    omega = 2 * np.pi * solve(model, laminate, 1).frequency_hz[0]
    # 0.05 %: the table has four to five digits.
    assert omega * ratio * np.sqrt(1e-9) == pytest.approx(published, rel=5e-4)
