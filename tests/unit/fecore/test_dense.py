from __future__ import annotations

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigh

from fecore.dynamics.dense import largest_eigenpairs
from fecore.errors import ModelError


@given(size=st.integers(1, 40), share=st.floats(0, 1), alike=st.booleans(), seed=st.integers(0, 2**32 - 1))
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
    np.testing.assert_allclose(vectors.T @ A @ vectors, np.diag(found), atol=round_off * np.abs(A).max())


def test_where_inverse_iteration_fails_the_vectors_come_from_all(monkeypatch) -> None:
    A, B = np.diag([3.0, 1.0, 2.0, 5.0]), np.eye(4)
    monkeypatch.setattr(scipy.linalg.lapack, "dstein", lambda *_: (np.full((4, 2), np.nan), 1))
    value, vectors = largest_eigenpairs(A, B, 2)
    np.testing.assert_allclose(value, [5, 3], rtol=1e-15)
    np.testing.assert_allclose(np.abs(vectors), [[0, 1], [0, 0], [0, 0], [1, 0]], atol=1e-15)


def test_an_indefinite_matrix_is_refused() -> None:
    with pytest.raises(ModelError, match="positive definite"):
        largest_eigenpairs(np.eye(3), np.diag([1.0, -1.0, 1.0]), 1)
