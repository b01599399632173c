"""The plate element itself: patch tests, rigid bodies, zero-energy modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.elements.shell8 import Shell8, gauss, shape_function_derivatives, shape_functions
from fecore.body.laminate import OrthotropicMaterial, Ply, section
from fecore.body.mesh import RectangleMesh, rectangle
from fecore.body.model import plate
from fecore.body.supports import Supports
from tests.support.plates import paper_section


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
