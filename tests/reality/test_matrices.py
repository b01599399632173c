"""Matrices of few rows and of one kind of dof, as condensations and hand calculations leave
them.
"""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from fecore.errors import InputError
from service.platform.errors import Invalid
from tests.support.imported import Imported, imported, npz_of

EI, MASS, LENGTH = 100.0, 1.0, 1.0  # N·m², kg/m, m
FREE_HZ = 22.3733 / (2 * np.pi) * np.sqrt(EI / MASS)
HELD_HZ = 3.51602 / (2 * np.pi) * np.sqrt(EI / MASS)


def read(
    nodes: Any, dofs: Any, K: Any, M: Any, boundary: str = "as_modelled", **asked: Any
) -> Imported:
    buffer = io.BytesIO()
    np.savez(buffer, **npz_of(nodes, dofs, K, M))
    return imported("a.npz", buffer.getvalue(), "m-N-kg", boundary=boundary, **asked)


def beam(elements: int = 10) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Nodes along x, rows w and θy = -w' of each, K and M of Euler's beam."""
    h, size = LENGTH / elements, 2 * (elements + 1)
    k = (
        EI
        / h**3
        * np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=float)
    )
    m = (
        MASS
        * h
        / 420
        * np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    )
    arms = np.diag([1, -h, 1, -h])
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for own in (slice(2 * e, 2 * e + 4) for e in range(elements)):
        K[own, own] += arms @ k @ arms
        M[own, own] += arms @ m @ arms
    nodes = np.column_stack([np.linspace(0, LENGTH, elements + 1), np.zeros((elements + 1, 2))])
    return nodes, np.array([[n + 1, dof] for n in range(elements + 1) for dof in (3, 5)]), K, M


def condensed(K: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows w alone, by Guyan."""
    w, turns = np.arange(0, len(K), 2), np.arange(1, len(K), 2)
    T = np.zeros((len(K), len(w)))
    T[w] = np.eye(len(w))
    T[turns] = -np.linalg.solve(K[np.ix_(turns, turns)], K[np.ix_(turns, w)])
    K, M = T.T @ K @ T, T.T @ M @ T
    return (K + K.T) / 2, (M + M.T) / 2


@pytest.mark.parametrize("boundary", ["free", "as_modelled"])
def test_w_and_one_rotation(boundary: str) -> None:
    model = read(*beam(), boundary)
    assert model.frequencies()[0] == pytest.approx(FREE_HZ, rel=1e-4)
    assert model.body.model.rigid_modes.shape[1] == 2
    assert model.document["mass_kg"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("axis", "along"),
    [(axis, along) for axis in (1, 2, 3) for along in (0, 1, 2) if axis != along + 1],
)
def test_displacements_of_one_kind(axis: int, along: int) -> None:
    nodes, dofs, K, M = beam()
    K, M = condensed(K, M)
    nodes = np.roll(nodes, along, axis=1)
    free = read(nodes, np.column_stack([dofs[::2, 0], np.full(len(K), axis)]), K, M, "free")
    assert free.frequencies()[0] == pytest.approx(FREE_HZ, rel=1e-3)


def test_what_holds_the_body_is_seen() -> None:
    nodes, dofs, K, M = beam()
    held = nodes, dofs[2:], K[2:, 2:], M[2:, 2:]
    assert read(*held).frequencies()[0] == pytest.approx(HELD_HZ, rel=1e-4)
    with pytest.raises(InputError, match="is free, but the matrices hold the body"):
        assert read(*held, "free").body
    K, M = condensed(K, M)
    pinned = nodes, dofs[2::2], K[1:, 1:], M[1:, 1:]
    assert read(*pinned).body.model.rigid_modes.shape[1] == 1
    with pytest.raises(InputError, match="is free, but the matrices hold the body"):
        assert read(*pinned, "free").body


@pytest.mark.parametrize("rows", [1, 2, 3, 20, 200])
@pytest.mark.parametrize("dof", [1, 3])
def test_chains(rows: int, dof: int) -> None:
    """λ of a chain of equal masses: 4 k/m sin² of (2n - 1)π / (4 rows + 2) held at one end, of nπ /
    (2 rows) free.
    """
    nodes = np.column_stack([np.linspace(0, 1, rows), np.zeros((rows, 2))])
    dofs = np.column_stack([np.arange(1, rows + 1), np.full(rows, dof)])
    K = 1e6 * (2 * np.eye(rows) - np.eye(rows, k=1) - np.eye(rows, k=-1))
    K[-1, -1] -= 1e6
    order = np.arange(1, min(rows, 10) + 1)
    expected = 1e3 / np.pi * np.sin((2 * order - 1) * np.pi / (4 * rows + 2))
    np.testing.assert_allclose(
        read(nodes, dofs, K, np.eye(rows)).frequencies(), expected, rtol=1e-9
    )
    K[0, 0] -= 1e6
    if rows == 1:
        with pytest.raises(
            InputError,
            match="nothing vibrates: the model has 1 dofs, 1 rigid-body modes and 0 others",
        ):
            read(nodes, dofs, K, np.eye(rows), "free")
        return
    order = np.arange(1, min(rows - 1, 10) + 1)
    found = read(nodes, dofs, K, np.eye(rows), "free").frequencies()
    np.testing.assert_allclose(found, 1e3 / np.pi * np.sin(order * np.pi / (2 * rows)), rtol=1e-9)


@pytest.mark.parametrize("dofs", [(3,), (3, 5), (1, 2), (1, 2, 3, 4, 5, 6)])
def test_full_matrices_of_close_modes(dofs: Sequence[int]) -> None:
    size, rng = 60, np.random.default_rng(1)
    places, own = (
        rng.random((size // len(dofs), 3)),
        [[n + 1, d] for n in range(size // len(dofs)) for d in dofs],
    )
    root = rng.standard_normal((size, size))
    K = 1e4 * (root @ root.T + 20 * size * np.eye(size))
    expected = np.sqrt(np.linalg.eigvalsh(K)[:10]) / 2 / np.pi
    np.testing.assert_allclose(
        read(places, own, K, np.eye(size)).frequencies(), expected, rtol=1e-9
    )


def test_rows_without_mass_follow() -> None:
    nodes, dofs, K, M = beam()
    lumped = np.diag(np.where(dofs[:, 1] == 3, M[::2, ::2].sum(1).repeat(2), 0.0))
    model = read(nodes, dofs[2:], K[2:, 2:], lumped[2:, 2:])
    inner = np.arange(2, len(K), 2)
    expected = np.linalg.eigvals(np.linalg.inv(K[2:, 2:])[::2, ::2] @ lumped[np.ix_(inner, inner)])
    np.testing.assert_allclose(
        model.frequencies(4), np.sort(1 / np.sqrt(expected.real))[:4] / 2 / np.pi, rtol=1e-8
    )
    with pytest.raises(
        InputError, match="modes: is 11, and the model has 10 besides rigid motions"
    ):
        model.frequencies(11)
    with pytest.raises(Invalid, match=r"accept: 'density:a' answers nothing .*: none"):
        read(nodes, dofs, K, M, accept=["density:a"])


def test_turns_alone_have_no_points() -> None:
    model = read(np.zeros((1, 3)), [[1, 5]], [[4.0]], [[1.0]])
    with pytest.raises(InputError, match="this model has turns alone, and no displacements"):
        model.frequencies()


@pytest.mark.parametrize(
    ("K", "M", "reach"),
    [(1e200, 1.0, 1.0), (1.0, 1e155, 1.0), (1e-200, 1.0, 1.0), (1.0, 1.0, 1e180)],
)
def test_numbers_without_a_square(K: float, M: float, reach: float) -> None:
    nodes = np.array([[0.0, 0.0, 0.0], [reach, 0.0, 0.0]])
    with pytest.raises(
        Invalid,
        match=r"(K_0|M_0|nodes): has 1e.* as its largest number, expected 1e-100 to 1e\+100",
    ):
        read(nodes, [[1, 3], [2, 3]], K * np.eye(2), M * np.eye(2))
