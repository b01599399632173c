"""Normal modes: complete, orthogonal, and none missing; and the largest pairs of dense matrices."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

import fecore.dynamics.factor
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import section
from fecore.body.supports import edges, of_boundary
from fecore.dynamics.dense import largest_eigenpairs
from fecore.dynamics.eigen import normal_modes
from fecore.dynamics.multifrontal import Elimination
from fecore.errors import ModelError
from tests.support.plates import matrices, paper_section, plate, solve


def test_agrees_with_arpack() -> None:
    K, M = matrices(plate((0.5, 0.04), (20, 3), of_boundary("cantilever")), paper_section())
    ours = normal_modes(K, M, 15)
    theirs = np.sort(eigsh(K, 15, M, sigma=0.0)[0])
    # Solves with K are good to its condition (10¹¹) times round-off, at the lowest mode.
    np.testing.assert_allclose(ours.eigenvalue, theirs, rtol=2e-8)
    np.testing.assert_allclose(ours.shapes.T @ (M @ ours.shapes), np.eye(15), atol=1e-12)
    residual = K @ ours.shapes - (M @ ours.shapes) * ours.eigenvalue
    assert np.abs(residual).max() < 1e-9 * np.abs(K @ np.abs(ours.shapes)).max()


def test_rigid_body_modes_are_exact_and_the_rest_orthogonal_to_them() -> None:
    body = plate((0.5, 0.04), (20, 3), (), membrane=True)
    K, M = matrices(body, paper_section())
    modes = normal_modes(K, M, 14, body.model.rigid_modes)
    assert modes.rigid == 6
    assert np.all(modes.eigenvalue[:6] == 0)
    assert modes.eigenvalue[6] > 1e5
    np.testing.assert_allclose(modes.shapes.T @ (M @ modes.shapes), np.eye(14), atol=1e-12)
    dense = eigh(K.toarray(), M.toarray(), eigvals_only=True)
    # the dense solver's own error
    np.testing.assert_allclose(modes.eigenvalue[6:], dense[6:14], rtol=1e-6)


def test_repeated_roots_of_a_square_plate_are_complete() -> None:
    square = OrthotropicMaterial(10e9, 10e9, 4e9, 4e9, 4e9, 0.3, 1000.0)
    held = edges("simply_supported", "simply_supported", "simply_supported", "simply_supported")
    modes = solve(plate((0.3, 0.3), (10, 10), held), section([Ply(square, 0.005)]), 9)
    # (1,2) = (2,1), (1,3) = (3,1), (2,3) = (3,2): alike to the accuracy of the solves.
    for first in (1, 4, 6):
        assert modes.eigenvalue[first + 1] == pytest.approx(modes.eigenvalue[first], rel=1e-9)


def test_modes_are_complete_where_there_are_fewer_different_roots_than_modes() -> None:
    """What the factor makes of a block then lies in the block, and the search goes on from a new
    one.
    """
    value = np.repeat([2.0, 3.0], 30)
    modes = normal_modes(sparse.csc_array(np.diag(value)), sparse.csc_array(np.eye(60)), 40)
    np.testing.assert_allclose(modes.eigenvalue, value[:40], rtol=1e-11)


def test_negative_pivots_of_banded_matrices_are_the_negative_eigenvalues(monkeypatch) -> None:
    random = np.random.default_rng(1)
    for _ in range(100):
        size, band = int(random.integers(1, 60)), int(random.integers(0, 8))
        full = random.standard_normal((size, size))
        full = full + full.T + random.uniform(-6, 12) * np.eye(size)
        full[np.abs(np.subtract.outer(np.arange(size), np.arange(size))) > band] = 0
        monkeypatch.setattr(fecore.dynamics.factor, "_RUN", int(random.integers(1, 9)))
        counted = fecore.dynamics.factor.negative_eigenvalues(sparse.csc_array(full))
        assert counted == np.sum(np.linalg.eigvalsh(full) < 0)


@pytest.mark.parametrize("widest", [0, 10**6])
def test_a_pivot_of_zero_is_refused(widest, monkeypatch) -> None:
    monkeypatch.setattr(fecore.dynamics.factor, "_WIDEST_BAND", widest)
    with pytest.raises(ModelError, match="a pivot vanishes"):
        fecore.dynamics.factor.negative_eigenvalues(
            sparse.csc_array(np.array([[0.0, 0.0], [0.0, 1.0]]))
        )


@pytest.mark.parametrize("seed", range(30))
def test_any_pattern_is_eliminated_front_by_front(seed) -> None:
    """Random graphs of nodes with some dofs each, also in pieces; definite and indefinite, with one
    elimination.
    """
    random = np.random.default_rng(seed)
    nodes, dofs = int(random.integers(1, 60)), int(random.integers(1, 7))
    ends = random.integers(0, nodes, (2, int(random.integers(0, 3 * nodes))))
    graph = sparse.coo_array((np.ones(ends.shape[1]), tuple(ends)), shape=(nodes, nodes)).toarray()
    full = np.kron(graph + graph.T + np.eye(nodes) > 0, np.ones((dofs, dofs)))
    size = len(full)
    full *= random.uniform(-1, 1, full.shape)
    full = full + full.T
    elimination = Elimination.of(sparse.csc_array(full))
    assert np.all(np.sort(elimination.order) == np.arange(size))
    lowest = float(np.linalg.eigvalsh(full)[0])
    definite = sparse.csc_array(full + (1 - lowest) * np.eye(size))
    assert elimination.suits(definite)
    factor = elimination.factorise(definite)
    assert factor is not None
    right = random.standard_normal(size)
    np.testing.assert_allclose(definite @ factor.solve(right), right, atol=1e-11 * size)
    L = factor.colour(np.eye(size))
    np.testing.assert_allclose(L @ L.T, definite.toarray(), atol=1e-13 * size * size)
    assert elimination.negative_pivots(sparse.csc_array(full)) == np.sum(
        np.linalg.eigvalsh(full) < 0
    )
    assert elimination.factorise(sparse.csc_array(full - (1 + lowest) * np.eye(size))) is None


def test_a_missing_mode_is_noticed(monkeypatch) -> None:
    import fecore.dynamics.eigen

    body = plate((0.5, 0.04), (10, 2), of_boundary("cantilever"))
    K, M = matrices(body, paper_section())
    whole = fecore.dynamics.eigen._lanczos

    def forgetful(*arguments):
        factor, mass, rigid, wanted, width = arguments
        value, vectors = whole(factor, mass, rigid, wanted + 1, width)
        keep = np.delete(np.arange(value.size), 2)
        return value[keep], vectors[:, keep]

    monkeypatch.setattr(fecore.dynamics.eigen, "_lanczos", forgetful)
    np.testing.assert_allclose(
        normal_modes(K, M, 6).omega, np.sqrt(eigh(K.toarray(), M.toarray(), eigvals_only=True)[:6])
    )
    monkeypatch.setattr(fecore.dynamics.eigen, "_FEW", 0)
    with pytest.raises(ModelError, match="not found"):
        normal_modes(K, M, 6)


@pytest.mark.parametrize("widest", [0, 10**6])
def test_both_factorisations_solve_and_colour(widest, monkeypatch) -> None:
    monkeypatch.setattr(fecore.dynamics.factor, "_WIDEST_BAND", widest)
    K, _ = matrices(plate((0.5, 0.04), (6, 2), of_boundary("cantilever")), paper_section())
    factor = fecore.dynamics.factor.factorise(K)
    right = np.random.default_rng(0).standard_normal((K.shape[0], 3))
    solution = factor.solve(right)
    residual = np.abs(K @ solution - right).max() / np.abs(abs(K) @ np.abs(solution)).max()
    assert residual < 1e-14  # backward stable
    L = factor.colour(np.eye(K.shape[0]))
    np.testing.assert_allclose(L @ L.T, K.toarray(), atol=1e-14 * np.abs(K).max())
    with pytest.raises(ModelError, match="positive definite"):
        fecore.dynamics.factor.factorise(sparse.csc_array(-1.0 * K))


@given(
    size=st.integers(1, 40),
    share=st.floats(0, 1),
    alike=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_largest_eigenpairs_are_lapacks(size, share, alike, seed) -> None:
    """Also for repeated roots and spectra over eight decades, as those of a plate are."""
    random = np.random.default_rng(seed)
    count = max(1, round(share * size))
    turn = np.linalg.qr(random.standard_normal((size, size)))[0]
    value = np.repeat(1.0, size) if alike else 10.0 ** random.uniform(-8, 0, size)
    lower = np.tril(random.uniform(-1, 1, (size, size)), -1) + np.diag(random.uniform(1, 2, size))
    C = turn * value @ turn.T
    A, B = lower @ (C + C.T) @ lower.T / 2, lower @ lower.T
    found, vectors = largest_eigenpairs(A, B, count)
    exact = eigh(A, B, eigvals_only=True)[::-1][:count]
    # Round-off of the products that made A and of the reduction to C, whose condition is that of B.
    round_off = 1e-15 * size * np.linalg.cond(B)
    np.testing.assert_allclose(found, exact, atol=round_off)
    np.testing.assert_allclose(vectors.T @ B @ vectors, np.eye(count), atol=round_off)
    np.testing.assert_allclose(
        vectors.T @ A @ vectors, np.diag(found), atol=round_off * np.abs(A).max()
    )


def test_where_inverse_iteration_fails_the_vectors_come_from_all(monkeypatch) -> None:
    A, B = np.diag([3.0, 1.0, 2.0, 5.0]), np.eye(4)
    monkeypatch.setattr(scipy.linalg.lapack, "dstein", lambda *_: (np.full((4, 2), np.nan), 1))
    value, vectors = largest_eigenpairs(A, B, 2)
    np.testing.assert_allclose(value, [5, 3], rtol=1e-15)
    np.testing.assert_allclose(np.abs(vectors), [[0, 1], [0, 0], [0, 0], [1, 0]], atol=1e-15)
