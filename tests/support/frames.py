"""A footbridge of frame elements with lumped masses, as many solvers write it: rows of turns have
no mass.
"""

from collections.abc import Mapping

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.matrices import MatrixBody
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.measurement import Measurement

BAYS = 10
_E, _G, _RHO = 210e9, 80e9, 7850.0
# A in m², I in m⁴
_SECTIONS = {"chords": (4e-3, 4e-6), "diagonals": (1.5e-3, 1e-6), "deck": (1.5e-3, 7e-7)}
_EXTRA_KG, _BEARING = 150.0, 1e7  # of what lies on each upper node; N/m


def bridge(factors: Mapping[str, float], spread: float = 0.0, seed: int = 0) -> MatrixBody:
    """The bridge with each part's stiffness times its factor, and each element's off by a share of
    sd `spread`.
    """
    nodes = np.array([[3.0 * i, y, z] for i in range(BAYS + 1) for y in (-1, 1) for z in (-1, 0)])
    rng, size = np.random.default_rng(seed), 6 * len(nodes)
    K = {name: np.zeros((size, size)) for name in (*_SECTIONS, "bearings")}
    mass = np.zeros((len(nodes), 6))
    mass[nodes[:, 2] == 0, :3] = _EXTRA_KG
    for part, a, b in _members():
        area, inertia = _SECTIONS[part]
        rows = np.r_[6 * a : 6 * a + 6, 6 * b : 6 * b + 6]
        K[part][np.ix_(rows, rows)] += (1 + spread * rng.standard_normal()) * _element(
            nodes[a], nodes[b], area, inertia
        )
        mass[[a, b], :3] += _RHO * area * np.linalg.norm(nodes[b] - nodes[a]) / 2
    for corner in (0, 2, 4 * BAYS, 4 * BAYS + 2):
        along = 1.0 if corner < 4 else 0.05  # the far end is on rollers
        held = np.arange(6 * corner, 6 * corner + 3)
        K["bearings"][held, held] = _BEARING * np.array([along, 1.0, 10.0])
    dofs = np.array([[node, dof] for node in range(len(nodes)) for dof in range(6)])
    stiffness = {
        name: scipy.sparse.csc_array(factors.get(name, 1.0) * matrix) for name, matrix in K.items()
    }
    return MatrixBody(nodes, dofs, stiffness, {"0": scipy.sparse.csc_array(np.diag(mass.ravel()))})


def measured(body: MatrixBody, count: int, shape_noise: float, seed: int) -> Measurement:
    """Modes of a bridge as a test finds them: frequencies to 0.2 %, shapes to a share of their
    largest entry.
    """
    rng = np.random.default_rng(seed)
    K, M = sum(body.stiffness.values()).toarray(), body.mass["0"].toarray()
    moves = np.diag(M) > 0
    rest = np.linalg.solve(K[~moves][:, ~moves], K[~moves][:, moves])
    value, shapes = scipy.linalg.eigh(
        K[moves][:, moves] - K[moves][:, ~moves] @ rest, M[moves][:, moves]
    )
    points = range(1, len(body.nodes), 2)  # of the deck
    rows = [3 * node + axis for node in points for axis in (1, 2)]
    seen = np.abs(shapes[rows]).max(axis=0) > 0.3 * np.abs(shapes).max(axis=0)
    chosen = np.flatnonzero(seen)[:count]
    hz = np.sqrt(value[chosen]) / 2 / np.pi * (1 + 0.002 * rng.standard_normal(count))
    noisy = shapes[rows][:, chosen].T
    noisy = noisy + shape_noise * np.abs(noisy).max(axis=1, keepdims=True) * rng.standard_normal(
        noisy.shape
    )
    order = np.argsort(hz)
    modes = MeasuredModes(
        hz[order],
        np.full(count, 0.01),
        noisy[order].astype(complex),
        tuple(Dof(node + 1, axis + 1) for node in points for axis in (1, 2)),
        np.diag(np.concatenate([(0.002 * hz[order]) ** 2, np.full(count, 1e-6)])),
    )
    return Measurement(
        None, {node + 1: tuple(map(float, body.nodes[node])) for node in points}, modes
    )  # type: ignore[misc]


def _members() -> list[tuple[str, int, int]]:
    """The part and both nodes of each element; nodes of a frame are lower and upper left, lower and
    upper right.
    """
    members = []
    for i in range(BAYS + 1):
        low, top, low_right, top_right = range(4 * i, 4 * i + 4)
        members += [("diagonals", low, top), ("diagonals", low_right, top_right)]
        members += [("deck", top, top_right), ("deck", low, low_right)]
        if i < BAYS:
            members += [("chords", node, node + 4) for node in (low, top, low_right, top_right)]
            members += [("diagonals", *((low, top + 4) if i % 2 else (top, low + 4)))]
            members += [
                (
                    "diagonals",
                    *((low_right, top_right + 4) if i % 2 else (top_right, low_right + 4)),
                )
            ]
            members += [("deck", top, top_right + 4)]
    return members


def _element(a: FloatArray, b: FloatArray, area: float, inertia: float) -> FloatArray:
    """(12, 12) stiffness of a round Euler beam between two nodes."""
    length = float(np.linalg.norm(b - a))
    x = (b - a) / length
    y = np.cross([0.0, 0.0, 1.0] if abs(x[2]) < 0.9 else [1.0, 0.0, 0.0], x)
    y /= np.linalg.norm(y)
    axes = np.kron(np.eye(4), np.array([x, y, np.cross(x, y)]))
    k = np.zeros((12, 12))
    for dof, stiffness in ((0, _E * area), (3, 2 * _G * inertia)):
        k[np.ix_([dof, dof + 6], [dof, dof + 6])] = (
            stiffness / length * np.array([[1, -1], [-1, 1]])
        )
    L = length
    bending = np.array(
        [[12, 6 * L, -12, 6 * L], [6 * L, 4 * L**2, -6 * L, 2 * L**2]] * 2, dtype=float
    )
    bending[2] *= -1
    bending[3, 1::2] = bending[3, :0:-2]
    for rows, sign in (([1, 5, 7, 11], 1), ([2, 4, 8, 10], -1)):
        turns = np.array([1, sign, 1, sign])
        k[np.ix_(rows, rows)] += _E * inertia / L**3 * np.outer(turns, turns) * bending
    return np.asarray(axes.T @ k @ axes)
