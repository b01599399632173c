"""Derivatives against complex steps.

LAPACK's eigensolvers lose an infinitesimal imaginary part, so the oracle is Newton's method on Kφ =
λMφ, φᵀMφ = 1 in complex arithmetic from the real pair: K(θ + ih), h = 10⁻²⁰, and the derivative is
the imaginary part over h.
"""

import numpy as np
import pytest
from scipy.linalg import eigh

from fecore.body.constants import Parameter
from fecore.body.specimen import CONSTANTS, Specimen
from fecore.body.supports import PointMass
from fecore.dynamics.dense import DenseFactor
from fecore.dynamics.eigen import NormalModes
from fecore.dynamics.sensitivity import (
    eigenvalue_derivatives,
    mode_forms,
    mode_shape_derivatives,
    same_cluster,
)
from fecore.dynamics.synthesis import residual_series
from fecore.frf import Dof, along_z
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from tests.support.plates import PAPER

STEP = 1e-20


class Pencil:
    """A dense K(θ), M(θ) of 12 dofs, smooth and non-linear in two parameters."""

    def __init__(self, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        A = rng.standard_normal((4, 12, 12))
        self.parts = [a @ a.T + 12 * np.eye(12) for a in A]

    def at(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, b = theta
        k0, k1, m0, m1 = self.parts
        return k0 * a**2 + k1 * np.exp(b) * 3, m0 + m1 * a * b

    def by(self, theta: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        a, b = theta
        k0, k1, _, m1 = self.parts
        return [2 * a * k0, 3 * np.exp(b) * k1], [b * m1, a * m1]


THETA = np.array([1.3, 0.4])


def modes_of(K, M, count: int, shift: float = -0.1) -> NormalModes:
    value, vectors = eigh(K, M)
    return NormalModes(value[:count], vectors[:, :count], 0, shift, DenseFactor(K - shift * M))


def complex_pair(K, M, value, shape):
    """The eigenpair of complex K, M next to a real one, φᵀMφ = 1 (no conjugate), by Newton."""
    value, shape = complex(value), shape.astype(complex)
    for _ in range(3):
        size = len(shape)
        system = np.zeros((size + 1, size + 1), dtype=complex)
        system[:size, :size], system[:size, size], system[size, :size] = (
            K - value * M,
            -M @ shape,
            2 * (M @ shape),
        )
        residual = np.append(K @ shape - value * (M @ shape), shape @ M @ shape - 1)
        step = np.linalg.solve(system, -residual)
        shape, value = shape + step[:size], value + step[size]
    return value, shape


def test_eigenvalues_and_shapes_against_complex_steps() -> None:
    pencil = Pencil()
    K, M = pencil.at(THETA)
    modes = modes_of(K, M, 6)
    by = pencil.by(THETA)
    G = eigenvalue_derivatives(modes, *(mode_forms(modes, terms, np.eye(2)) for terms in by))
    shapes = mode_shape_derivatives(K, M, modes, *by)
    for p in range(2):
        stepped = THETA.astype(complex)
        stepped[p] += 1j * STEP
        Kc, Mc = pencil.at(stepped)
        for k in range(6):
            value, shape = complex_pair(Kc, Mc, modes.eigenvalue[k], modes.shapes[:, k])
            assert G[p, k, k] == pytest.approx(value.imag / STEP, rel=1e-11)
            exact = shape.imag / STEP
            np.testing.assert_allclose(shapes[p, :, k], exact, atol=1e-10 * np.abs(exact).max())


def test_residual_series_is_that_of_the_modes_left_out() -> None:
    K, M = Pencil(1).at(THETA)
    modes, load = modes_of(K, M, 4), np.random.default_rng(0).standard_normal((12, 2))
    value, shapes = eigh(K, M)
    left, away = shapes[:, 4:], value[4:] - modes.shift
    for t, found in enumerate(residual_series(modes, M, load, 3)):
        expected = left @ ((left.T @ load) / away[:, None] ** (t + 1))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


def test_repeated_roots_give_exact_derivatives_of_what_has_one() -> None:
    """A pencil with a double root: the sum over the cluster of λ, and of φφᵀ, are smooth; so are
    its FRFs.
    """
    rng = np.random.default_rng(4)
    size = 10
    T = rng.standard_normal((size, size)) + 4 * np.eye(size)
    value = np.array([2.0, 5.0, 5.0, 9.0, 11, 13, 17, 19, 23, 29])
    K, M = T.T @ np.diag(value) @ T, T.T @ T
    dK, dM = (a + a.T for a in rng.standard_normal((2, size, size)))
    modes = modes_of((K + K.T) / 2, M, 5)
    inside = same_cluster(modes.eigenvalue)
    assert inside[1, 2]
    assert inside.sum() == 7
    G = eigenvalue_derivatives(
        modes, *(mode_forms(modes, [term], np.ones((1, 1))) for term in (dK, dM))
    )[0]
    by = mode_shape_derivatives(K, M, modes, [dK], [dM])[0]
    z = 6.3 + 0.4j
    pair = modes.shapes[:, 1:3]
    D = np.eye(2) / (5.0 - z)
    change = by[:, 1:3] @ D @ pair.T + pair @ D @ by[:, 1:3].T - pair @ D @ G[1:3, 1:3] @ D @ pair.T

    def cluster_receptance(h: float) -> np.ndarray:
        w, V = eigh(K + h * dK, M + h * dM)
        return V[:, 1:3] @ np.diag(1 / (w[1:3] - z)) @ V[:, 1:3].T

    h = 1e-4
    numeric = sum(
        c * cluster_receptance(k * h) for k, c in ((-2, 1), (-1, -8), (1, 8), (2, -1))
    ) / (12 * h)
    # Fourth-order differences of a well-conditioned pencil.
    np.testing.assert_allclose(change, numeric, atol=1e-8 * np.abs(numeric).max())
    # The cluster's own derivatives are the eigenvalues of G: the double root splits along them.
    split = np.sort(eigh(K + 1e-7 * dK, M + 1e-7 * dM, eigvals_only=True)[1:3] - 5.0) / 1e-7
    np.testing.assert_allclose(np.linalg.eigvalsh(G[1:3, 1:3]), split, rtol=1e-5, atol=1e-6)


def test_roots_are_one_within_a_relative_distance() -> None:
    alike = same_cluster(1e6 * np.array([0, 0, 1, 1 + 0.5e-8, 1 + 2e-8]))
    np.testing.assert_array_equal(alike, np.equal.outer([0, 0, 1, 1, 2], [0, 0, 1, 1, 2]))


SPECIMEN = Specimen(
    0.3, 0.05, 0.01, PAPER, "cantilever", (PointMass(0.29, 0.02, 0.005),), divisions=(3, 1)
)
PLACES = np.array([[0.1, 0.0], [0.2, 0.02], [0.3, -0.025]])
DOFS = [Dof(point, 3) for point in range(3)]


@pytest.mark.parametrize("boundary", ["cantilever", "free"])
@pytest.mark.parametrize("reduced", [False, True])
def test_forward_models_derivatives_against_complex_steps(boundary, reduced) -> None:
    """All eight constants; the oracle steps the element terms themselves, over the dofs or over the
    basis.
    """
    specimen = Specimen(0.3, 0.05, 0.01, PAPER, boundary, SPECIMEN.masses, divisions=(3, 1))
    parametrisation = parametrise(specimen, [Parameter(name) for name in CONSTANTS])
    forward = ForwardModel(specimen, parametrisation, along_z((0, 1, 2)), PLACES, 7, reduced)
    theta = parametrisation.prior_mean * 1.02
    state = forward.solve(theta)
    stiffness, mass = (
        np.array([np.asarray(a.todense() if hasattr(a, "todense") else a) for a in terms])
        for terms in (state.stiffness, state.mass)
    )
    observation = forward.observation.toarray() @ (
        np.eye(stiffness.shape[1]) if state.basis is None else state.basis
    )
    rigid = state.modes.rigid
    assert not state.eigenvalue_jacobian[:rigid].any()
    for p in range(theta.size):
        stepped = theta.astype(complex)
        stepped[p] += 1j * STEP * theta[p]
        c = parametrisation.coefficients(stepped)
        K, M = np.tensordot(c.stiffness, stiffness, 1), np.tensordot(c.mass, mass, 1)
        # a common size of all dofs, for the oracle's sake
        scale = np.sqrt(np.diag(K.real) + 1e3 * np.diag(M.real))
        for k in range(rigid, 7):
            value, shape = complex_pair(
                K / np.outer(scale, scale),
                M / np.outer(scale, scale),
                state.modes.eigenvalue[k],
                state.modes.shapes[:, k] * scale,
            )
            exact = value.imag / (STEP * theta[p])
            largest = np.abs(state.eigenvalue_jacobian[k] * theta).max() / theta[p]
            assert state.eigenvalue_jacobian[k, p] == pytest.approx(
                exact, rel=1e-8, abs=1e-8 * largest
            )
            seen = observation @ (shape.imag / (STEP * theta[p]) / scale)
            size = np.abs(state.shape_jacobian[:, k] * theta[:, None]).max() / theta[p]
            np.testing.assert_allclose(state.shape_jacobian[p, k], seen, atol=1e-8 * size)
